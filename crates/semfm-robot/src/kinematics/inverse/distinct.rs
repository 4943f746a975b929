//! Which joint values are the same solution.

use std::f64::consts::TAU;

use super::super::arm_joint::ArmJoint;
use crate::joint::JointKind;

/// Solutions of which no joint differs by more are the same, radians.
const SAME_ANGLE: f64 = 0.1;

/// The same for joints that slide, metres.
const SAME_LENGTH: f64 = 0.01;

/// Turns each joint by whole turns to be as near to `near` as its limits allow. A turn may cross a limit by rounding, so
/// the result is clamped.
pub(super) fn nearest_turns(joints: &[ArmJoint], near: &[f64], q: &mut [f64]) {
    for ((joint, &near), q) in joints.iter().zip(near).zip(q) {
        if joint.kind == JointKind::Prismatic {
            continue;
        }
        let mut turns = ((near - *q) / TAU).round();
        // Towards the range, where the nearest is outside of it.
        let most = ((joint.upper - *q) / TAU + 1e-12).floor();
        let least = ((joint.lower - *q) / TAU - 1e-12).ceil();
        if least <= most {
            turns = turns.clamp(least, most);
            *q = (*q + turns * TAU).clamp(joint.lower, joint.upper);
        }
    }
}

/// Whether two lists of joint values are distinct solutions: a joint that turns differs by more than .1 rad, whole turns
/// aside, or one that slides by more than a centimetre.
pub(super) fn differ(joints: &[ArmJoint], a: &[f64], b: &[f64]) -> bool {
    joints.iter().zip(a.iter().zip(b)).any(|(joint, (a, b))| {
        let difference = (a - b).abs();
        match joint.kind {
            JointKind::Prismatic => difference > SAME_LENGTH,
            _ => {
                let rest = difference % TAU;
                rest.min(TAU - rest) > SAME_ANGLE
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(kind: JointKind, lower: f64, upper: f64) -> ArmJoint {
        let (name, index, jerk) = (String::new(), 0, None);
        ArmJoint { name, index, kind, lower, upper, velocity: 1.0, acceleration: 1.0, jerk }
    }

    #[test]
    fn whole_turns_lead_near_within_limits() {
        let turned = |joint: &ArmJoint, near: f64, from: f64| {
            let mut q = [from];
            nearest_turns(std::slice::from_ref(joint), &[near], &mut q);
            q[0]
        };
        let wide = joint(JointKind::Revolute, -TAU, TAU);
        assert!((turned(&wide, 6.0, -0.5) - (TAU - 0.5)).abs() < 1e-12);
        assert!((turned(&wide, 50.0, 0.5) - 0.5).abs() < 1e-12);
        // Both ends are the same place.
        assert_eq!(turned(&wide, -TAU, TAU), -TAU);
        let free = joint(JointKind::Continuous, f64::NEG_INFINITY, f64::INFINITY);
        assert!((turned(&free, 100.0, 0.5) - (0.5 + 16.0 * TAU)).abs() < 1e-12);
        assert_eq!(turned(&joint(JointKind::Revolute, -1.0, 1.0), 6.0, 0.5), 0.5);
        assert_eq!(turned(&joint(JointKind::Prismatic, -10.0, 10.0), 6.0, 0.5), 0.5);
    }

    #[test]
    fn distinct_means_more_than_a_tenth_apart_aside_from_turns() {
        let joints = [joint(JointKind::Revolute, -TAU, TAU), joint(JointKind::Prismatic, 0.0, 1.0)];
        assert!(!differ(&joints, &[0.0, 0.5], &[TAU - 0.09, 0.505]));
        assert!(differ(&joints, &[0.0, 0.5], &[TAU - 0.11, 0.5]));
        assert!(differ(&joints, &[0.0, 0.5], &[0.0, 0.52]));
    }
}
