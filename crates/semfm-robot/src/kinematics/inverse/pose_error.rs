//! What is left between the tip and its target: a displacement and the logarithm of a rotation.
//!
//! SE(3)'s own logarithm couples the two. It was tried, with its exact Jacobian, on 1,000 random poses of each of five
//! arms: as many descents, and 1.4 times their time. Kept apart, the Jacobian of the tip gives the exact gradient
//! as it is, since J_l(φ)ᵀ φ = φ for a rotation's left Jacobian J_l.

use semfm_geom::math::{DMat3, DQuat, DVec3};

use super::super::chain::Frame;

/// Half the angle, radians, below which its sine is the angle to the last bit.
const SMALL_ANGLE: f64 = 1e-8;

/// What takes the tip to its target, in the base's axes: a displacement, and a rotation vector about the tip.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseError {
    /// p_target − p_tip, metres.
    pub displacement: DVec3,
    /// log(R_target · R_tipᵀ), radians.
    pub rotation: DVec3,
}

impl PoseError {
    pub fn between(tip: &Frame, target: &Frame) -> Self {
        let rotation = target.rotation * tip.rotation.transpose();
        Self {
            displacement: target.translation - tip.translation,
            rotation: log_rotation(&rotation),
        }
    }

    pub fn distance(&self) -> f64 {
        self.displacement.length()
    }

    pub fn angle(&self) -> f64 {
        self.rotation.length()
    }
}

/// The rotation vector of a rotation matrix, of length 0 to π.
///
/// > φ = 2 atan2(|v|, w) · v / |v|   for the quaternion (v, w) with w ≥ 0
fn log_rotation(rotation: &DMat3) -> DVec3 {
    let quaternion = DQuat::from_mat3(rotation);
    let sign = if quaternion.w < 0.0 { -1.0 } else { 1.0 };
    let (v, w) = (quaternion.xyz() * sign, quaternion.w * sign);
    let sine = v.length();
    if sine < SMALL_ANGLE { v * 2.0 } else { v * (2.0 * sine.atan2(w) / sine) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_undoes_the_exponential_up_to_half_a_turn() {
        let axis = DVec3::new(0.6, -0.48, 0.64);
        for angle in [0.0, 1e-12, 1e-8, 1e-3, 1.0, 3.0, std::f64::consts::PI - 1e-9] {
            let found = log_rotation(&DMat3::from_quat(DQuat::from_axis_angle(axis, angle)));
            // A matrix tells a small angle to within the rounding of its entries.
            assert!((found - axis * angle).length() < 1e-14 + 1e-15 * angle, "{angle}: {found}");
        }
        let over = log_rotation(&DMat3::from_quat(DQuat::from_axis_angle(axis, 4.0)));
        assert!((over.length() - (std::f64::consts::TAU - 4.0)).abs() < 1e-14);
    }
}
