//! How far two grasps are from each other.

use parry3d_f64::math::Pose;
use semfm_geom::math::DQuat;

/// Half a turn about the approach: a gripper with two equal fingers is the same gripper.
const HALF_TURN: DQuat = DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0);

/// How far two grasps are from each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraspDistance {
    /// Between the TCPs, metres.
    pub translation: f64,
    /// Between the grippers, radians in [0, π].
    pub rotation: f64,
}

impl GraspDistance {
    /// The distance of two poses of the TCP. A gripper and the same gripper with its fingers exchanged
    /// are one.
    pub fn between(a: &Pose, b: &Pose) -> Self {
        let turn = a.rotation.inverse() * b.rotation;
        Self {
            translation: a.translation.distance(b.translation),
            rotation: angle(turn).min(angle(HALF_TURN * turn)),
        }
    }

    /// Whether the rotation of [`GraspDistance::between`] is below `limit` radians, without its arctangents: half the angle
    /// has the cosine |w|.
    pub(crate) fn is_turned_less(a: &Pose, b: &Pose, limit: f64) -> bool {
        let turn = a.rotation.inverse() * b.rotation;
        // The half turn about z makes w of z.
        let cosine = turn.w.abs().max(turn.z.abs()) / turn.length();
        cosine > (limit / 2.0).cos()
    }

    /// In [0, 1]: the mean of the translation against `far` (metres) and of the rotation against π.
    pub(crate) fn relative(self, far: f64) -> f64 {
        ((self.translation / far).min(1.0) + self.rotation / std::f64::consts::PI) / 2.0
    }
}

/// The angle of a rotation, radians in [0, π].
pub(crate) fn angle(q: DQuat) -> f64 {
    2.0 * q.xyz().length().atan2(q.w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    use semfm_geom::math::DVec3;

    #[test]
    fn turned_less_is_what_the_angle_says() {
        for i in 0..200 {
            let t = f64::from(i);
            let pose = |t: f64| {
                Pose::new(DVec3::ZERO, DVec3::new(t.sin(), (0.7 * t).cos(), 3.0 * (0.3 * t).sin()))
            };
            let (a, b) = (pose(t), pose(t + 0.3));
            let rotation = GraspDistance::between(&a, &b).rotation;
            assert!(GraspDistance::is_turned_less(&a, &b, rotation + 1e-9));
            assert!(!GraspDistance::is_turned_less(&a, &b, rotation - 1e-9));
        }
        let here = Pose::IDENTITY;
        assert!(
            !GraspDistance::is_turned_less(&here, &here, 0.0),
            "without a separation nothing is near"
        );
    }

    #[test]
    fn exchanged_fingers_are_the_same_gripper() {
        let here = Pose::new(DVec3::ZERO, 0.1 * DVec3::Z);
        let exchanged = Pose::new(0.003 * DVec3::X, (0.1 + PI) * DVec3::Z);
        let near = GraspDistance::between(&here, &exchanged);
        assert!((near.translation - 0.003).abs() < 1e-12 && near.rotation < 1e-7, "{near:?}");
        let turned = GraspDistance::between(&here, &Pose::new(DVec3::ZERO, 0.6 * DVec3::Z));
        assert!((turned.rotation - 0.5).abs() < 1e-12);
        let upside_down = Pose::new(DVec3::ZERO, PI * DVec3::X);
        assert!((GraspDistance::between(&Pose::IDENTITY, &upside_down).rotation - PI).abs() < 1e-9);
    }
}
