//! How fast joints may move.

use crate::{Error, Result};

/// The limits of one joint's motion, the same in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMotionLimit {
    /// The joint's name, for messages.
    pub name: String,
    /// Radians or metres per second.
    pub velocity: f64,
    /// Per second squared.
    pub acceleration: f64,
    /// Per second cubed; `None` leaves it without a limit.
    pub jerk: Option<f64>,
}

/// The limits of an arm's motion: a positive finite number each.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionLimits {
    joints: Vec<JointMotionLimit>,
}

impl MotionLimits {
    /// Limits in the order of the arm's joints.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a limit is not a number above 0; it names the joint.
    pub fn new(joints: Vec<JointMotionLimit>) -> Result<Self> {
        for joint in &joints {
            let limits = [
                ("velocity", joint.velocity),
                ("acceleration", joint.acceleration),
                ("jerk", joint.jerk.unwrap_or(1.0)),
            ];
            for (what, limit) in limits {
                if !(limit > 0.0 && limit.is_finite()) {
                    return Err(Error::Invalid {
                        what: format!("{what} limit of joint `{}`", joint.name),
                        expected: "a number above 0".into(),
                        found: limit.to_string(),
                    });
                }
            }
        }
        Ok(Self { joints })
    }

    /// One a joint.
    pub fn joints(&self) -> &[JointMotionLimit] {
        &self.joints
    }

    /// The same limits at a share of speed: velocities times `share`, accelerations times its square, jerks its cube, so
    /// that the same motion takes 1/`share` of the time.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless `share` is above 0 and at most 1.
    pub fn at_speed(&self, share: f64) -> Result<Self> {
        if !(share > 0.0 && share <= 1.0) {
            return Err(Error::Invalid {
                what: "share of speed".into(),
                expected: "above 0, at most 1".into(),
                found: share.to_string(),
            });
        }
        let joints = self.joints.iter().map(|joint| JointMotionLimit {
            name: joint.name.clone(),
            velocity: joint.velocity * share,
            acceleration: joint.acceleration * share.powi(2),
            jerk: joint.jerk.map(|jerk| jerk * share.powi(3)),
        });
        Ok(Self { joints: joints.collect() })
    }
}
