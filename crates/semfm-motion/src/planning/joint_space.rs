//! The space of joint values: ranges, distances, and the short way round for continuous joints.

use std::f64::consts::{PI, TAU};

use crate::{Error, Result};

/// By how much a value may pass a limit and still count as within, radians or metres: files round their numbers.
pub(crate) const LIMIT_SLACK: f64 = 1e-9;

/// The values that a joint may take.
#[derive(Clone, Debug, PartialEq)]
pub struct JointRange {
    /// Its name, for messages.
    pub name: String,
    /// Least value, radians or metres; −∞ together with an infinite `upper` makes the joint continuous.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
}

impl JointRange {
    /// True of a joint that turns for ever: values that differ by 2π are one.
    pub fn is_continuous(&self) -> bool {
        self.lower == f64::NEG_INFINITY && self.upper == f64::INFINITY
    }
}

/// All joint values of an arm. Distance is the root of the summed squares of the joints' ways, each the short way
/// round; a metre counts as a radian.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSpace {
    joints: Vec<JointRange>,
}

impl JointSpace {
    /// A space of at least one joint; each range is finite and not empty, or continuous.
    pub fn new(joints: Vec<JointRange>) -> Result<Self> {
        if joints.is_empty() {
            return Err(Error::Invalid {
                what: "joints".into(),
                expected: "at least one".into(),
                found: "none".into(),
            });
        }
        for joint in &joints {
            let finite =
                joint.lower.is_finite() && joint.upper.is_finite() && joint.lower <= joint.upper;
            if !finite && !joint.is_continuous() {
                return Err(Error::Invalid {
                    what: format!("range of joint `{}`", joint.name),
                    expected: "lower ≤ upper, both finite, or −∞ and ∞ for a continuous joint"
                        .into(),
                    found: format!("{} … {}", joint.lower, joint.upper),
                });
            }
        }
        Ok(Self { joints })
    }

    /// The joints in order.
    pub fn joints(&self) -> &[JointRange] {
        &self.joints
    }

    /// Number of joints.
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Fails unless `q` has one finite value a joint, each within its range; `what` names the list in the message.
    pub fn check(&self, what: &str, q: &[f64]) -> Result<()> {
        let invalid = |what: String, expected: String, found: String| {
            Err(Error::Invalid { what, expected, found })
        };
        if q.len() != self.joints.len() {
            return invalid(
                what.into(),
                format!("{} joint values", self.joints.len()),
                q.len().to_string(),
            );
        }
        for (joint, &value) in self.joints.iter().zip(q) {
            let within = value >= joint.lower - LIMIT_SLACK && value <= joint.upper + LIMIT_SLACK;
            if !value.is_finite() || !within {
                return invalid(
                    format!("joint `{}` in {what}", joint.name),
                    format!("a value within {} … {}", joint.lower, joint.upper),
                    value.to_string(),
                );
            }
        }
        Ok(())
    }

    /// Length of the short way between two joint values.
    pub fn distance(&self, from: &[f64], to: &[f64]) -> f64 {
        let mut squares = 0.0;
        for (joint, (&a, &b)) in self.joints.iter().zip(from.iter().zip(to)) {
            let way = short_way(joint, a, b);
            squares += way * way;
        }
        squares.sqrt()
    }

    /// `to` unrolled as seen from `from`: continuous joints are turned by whole turns so that the straight line
    /// between the two lists is the short way; the others are `to`'s. Values may leave −π … π.
    pub fn toward(&self, from: &[f64], to: &[f64]) -> Vec<f64> {
        self.joints
            .iter()
            .zip(from.iter().zip(to))
            .map(
                |(joint, (&a, &b))| {
                    if joint.is_continuous() { a + short_way(joint, a, b) } else { b }
                },
            )
            .collect()
    }
}

/// Signed way of one joint from `a` to `b`; of a continuous joint the shorter one, −π … π.
pub(super) fn short_way(joint: &JointRange, a: f64, b: f64) -> f64 {
    let way = b - a;
    if joint.is_continuous() && way.abs() > PI { way - TAU * (way / TAU).round() } else { way }
}

/// The point at `share` (0 … 1) of the straight line between two lists.
pub(crate) fn between(from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(&a, &b)| a + (b - a) * share).collect()
}

/// Length of the straight line between two lists, without a short way round.
pub(crate) fn straight_length(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn space() -> JointSpace {
        let joint = |name: &str, lower, upper| JointRange { name: name.into(), lower, upper };
        JointSpace::new(vec![
            joint("bounded", -1.0, 2.0),
            joint("turning", f64::NEG_INFINITY, f64::INFINITY),
        ])
        .unwrap()
    }

    #[test]
    fn a_continuous_joint_goes_across_pi() {
        let space = space();
        assert!((space.distance(&[0.0, 3.0], &[0.0, -3.0]) - (TAU - 6.0)).abs() < 1e-12);
        assert!((space.toward(&[0.0, 3.0], &[1.0, -3.0])[1] - (TAU - 3.0)).abs() < 1e-12);
        assert_eq!(space.toward(&[0.0, 3.0], &[1.0, -3.0])[0], 1.0);
    }

    proptest! {
        #[test]
        fn turns_do_not_matter(a in -20.0..20.0f64, b in -20.0..20.0f64, turns in -3i32..4) {
            let space = space();
            let (from, to) = ([0.0, a], [0.5, b]);
            let turned = [0.5, b + f64::from(turns) * TAU];
            prop_assert!((space.distance(&from, &to) - space.distance(&from, &turned)).abs() < 1e-9);
            prop_assert!((space.distance(&from, &to) - space.distance(&to, &from)).abs() < 1e-9);
            let unrolled = space.toward(&from, &to);
            prop_assert!((unrolled[1] - a).abs() <= PI + 1e-9);
            prop_assert!(((unrolled[1] - b).sin()).abs() < 1e-9 && (unrolled[1] - b).cos() > 0.0);
        }
    }

    #[test]
    fn bad_ranges_and_values_name_the_joint() {
        let half_open = vec![JointRange { name: "elbow".into(), lower: 0.0, upper: f64::INFINITY }];
        assert!(JointSpace::new(half_open).unwrap_err().to_string().contains("elbow"));
        let error = space().check("start", &[2.5, 0.0]).unwrap_err().to_string();
        assert!(
            error.contains("bounded") && error.contains("2.5") && error.contains('2'),
            "{error}"
        );
        assert!(space().check("start", &[0.0]).is_err());
        assert!(space().check("start", &[f64::NAN, 0.0]).is_err());
    }
}
