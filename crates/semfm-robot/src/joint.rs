//! Joints: how a link moves against its parent.

use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3};

/// How a joint moves, by URDF's types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum JointKind {
    /// Turns about its axis within limits; radians.
    Revolute,
    /// Turns about its axis without limits; radians.
    Continuous,
    /// Slides along its axis within limits; metres.
    Prismatic,
    /// Does not move.
    Fixed,
    /// Moves freely; kept at zero, since one number does not tell its position.
    Floating,
    /// Moves in a plane; kept at zero as well.
    Planar,
    /// Turns about any axis; kept at zero as well.
    Spherical,
}

/// A joint between two links.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name in the file.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// The link nearer the root.
    pub parent: usize,
    /// The link it moves.
    pub child: usize,
    /// Where it sits in its parent at zero.
    pub parent_from_joint: Pose,
    /// Unit axis in the joint's frame.
    pub axis: DVec3,
    /// How far, how fast and with what force it moves.
    pub limits: JointLimits,
    /// The joint that it follows.
    pub mimic: Option<Mimic>,
    /// The narrower range that its controller keeps to, where the file tells one.
    pub safety: Option<SafetyController>,
}

/// Limits of a joint; `None` where there is none or the file tells none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLimits {
    /// Lowest and highest position, radians or metres; of revolute and prismatic joints.
    pub position: Option<[f64; 2]>,
    /// Greatest speed, radians or metres per second.
    pub velocity: Option<f64>,
    /// Greatest torque or force, newton metres or newtons.
    pub effort: Option<f64>,
}

/// `position = multiplier × position of the other + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// The other joint.
    pub joint: usize,
    /// Factor.
    pub multiplier: f64,
    /// Summand.
    pub offset: f64,
}

/// URDF's `safety_controller`: where a joint's controller begins to slow it down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyController {
    /// Lowest and highest position, radians or metres; infinite where the file tells none.
    pub soft_limits: [f64; 2],
    /// Velocity limit for each radian or metre from a soft limit, 1/s.
    pub k_position: f64,
    /// Effort limit for each unit of velocity above that.
    pub k_velocity: f64,
}

impl JointKind {
    /// URDF's name for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
            Self::Fixed => "fixed",
            Self::Floating => "floating",
            Self::Planar => "planar",
            Self::Spherical => "spherical",
        }
    }

    /// Whether one number, an angle or a length, tells where the joint stands.
    pub fn has_position(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous | Self::Prismatic)
    }
}

impl Joint {
    /// `joint_from_child` at a position (radians or metres).
    pub fn motion(&self, position: f64) -> Pose {
        match self.kind {
            JointKind::Revolute | JointKind::Continuous => {
                Pose::from_rotation(DQuat::from_axis_angle(self.axis, position))
            }
            JointKind::Prismatic => Pose::from_translation(self.axis * position),
            JointKind::Fixed | JointKind::Floating | JointKind::Planar | JointKind::Spherical => {
                Pose::IDENTITY
            }
        }
    }
}
