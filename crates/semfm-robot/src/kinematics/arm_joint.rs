//! A joint of an arm with the limits that it keeps.

use std::f64::consts::TAU;

use crate::joint::{Joint, JointKind};
use crate::joint_limits_file::ToldLimits;
use crate::{Error, Result};

/// Velocity of a joint for which no file tells one, radians or metres per second; MoveIt's default.
pub const DEFAULT_VELOCITY: f64 = 1.0;

/// Acceleration of a joint for which no file tells one, per second squared; MoveIt's default.
pub const DEFAULT_ACCELERATION: f64 = 1.0;

/// A joint of an arm.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmJoint {
    /// Name in the file.
    pub name: String,
    /// Place in the robot's list of joints.
    pub index: usize,
    /// Revolute, continuous or prismatic.
    pub kind: JointKind,
    /// Lowest position, radians or metres; minus infinity where there is no limit.
    pub lower: f64,
    /// Highest position, radians or metres; infinity where there is no limit.
    pub upper: f64,
    /// Greatest speed, per second.
    pub velocity: f64,
    /// Greatest acceleration, per second squared.
    pub acceleration: f64,
    /// Greatest jerk, per second cubed, where a file tells one.
    pub jerk: Option<f64>,
}

impl ArmJoint {
    /// The joint with the limits of all files together; adds what was assumed to `notes`.
    pub(super) fn new(
        index: usize,
        joint: &Joint,
        told: &ToldLimits,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let name = &joint.name;
        let [mut lower, mut upper] =
            joint.limits.position.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        if told.lower.is_some_and(|told| told < lower)
            || told.upper.is_some_and(|told| told > upper)
        {
            notes.push(format!(
                "joint `{name}`: the limits file allows more than the description, {lower} to {upper}"
            ));
        }
        lower = told.lower.unwrap_or(lower);
        upper = told.upper.unwrap_or(upper);
        crossed(name, "limits", lower, upper)?;
        if let Some(safety) = joint.safety {
            let [soft_lower, soft_upper] = safety.soft_limits;
            if soft_lower < soft_upper {
                (lower, upper) = (lower.max(soft_lower), upper.min(soft_upper));
                crossed(name, "limits narrowed by the safety controller's", lower, upper)?;
            } else {
                notes.push(format!(
                    "joint `{name}`: soft limits {soft_lower} to {soft_upper} leave no range and are not used"
                ));
            }
        }
        let velocity = told.velocity.or(joint.limits.velocity).unwrap_or(DEFAULT_VELOCITY);
        let acceleration = told.acceleration.unwrap_or(DEFAULT_ACCELERATION);
        let (name, kind) = (name.clone(), joint.kind);
        Ok(Self { name, index, kind, lower, upper, velocity, acceleration, jerk: told.jerk })
    }

    /// Whether it turns without limits: positions that differ by 2π are the same place.
    pub fn is_continuous(&self) -> bool {
        self.kind != JointKind::Prismatic && self.lower.is_infinite() && self.upper.is_infinite()
    }

    /// Where positions are sampled: the range, or the one turn in its middle where it is wider. A side without a limit
    /// lies one turn, or a metre, from the other.
    pub fn sampling_range(&self) -> [f64; 2] {
        let widest = if self.kind == JointKind::Prismatic { 1.0 } else { TAU };
        match (self.lower.is_finite(), self.upper.is_finite()) {
            (true, true)
                if self.upper - self.lower <= widest || self.kind == JointKind::Prismatic =>
            {
                [self.lower, self.upper]
            }
            (true, true) => {
                let middle = 0.5 * (self.lower + self.upper);
                [middle - 0.5 * widest, middle + 0.5 * widest]
            }
            (true, false) => [self.lower, self.lower + widest],
            (false, true) => [self.upper - widest, self.upper],
            (false, false) => [-0.5 * widest, 0.5 * widest],
        }
    }
}

fn crossed(name: &str, what: &str, lower: f64, upper: f64) -> Result<()> {
    if lower <= upper {
        return Ok(());
    }
    Err(Error::Arm {
        what: format!("joint `{name}`: {what}"),
        expected: "a lower limit not above the upper one".into(),
        found: format!("{lower} and {upper}"),
    })
}
