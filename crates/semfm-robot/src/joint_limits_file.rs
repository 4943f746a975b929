//! Limits of joints that a URDF cannot tell: accelerations and jerks, and other values that take the place of its own.

use std::collections::BTreeMap;

/// Limits by the names of joints, as MoveIt's `joint_limits.yaml` tells them. They take the place of the URDF's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointLimitsFile {
    /// What is told of each joint.
    pub joints: BTreeMap<String, ToldLimits>,
}

/// What a joint limits file tells of one joint; `None` where it tells nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToldLimits {
    /// Lowest position, radians or metres.
    pub lower: Option<f64>,
    /// Highest position, radians or metres.
    pub upper: Option<f64>,
    /// Greatest speed, per second.
    pub velocity: Option<f64>,
    /// Greatest acceleration, per second squared.
    pub acceleration: Option<f64>,
    /// Greatest jerk, per second cubed.
    pub jerk: Option<f64>,
}
