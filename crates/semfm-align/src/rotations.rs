//! Rotations spread over all of them, or around one.

use semfm_geom::math::{DQuat, DVec3};

/// How far around a guess the search looks, in degrees: about the axes of a cube's faces by the
/// first angle, of its corners by the second. Guesses 25° off are what this must mend.
const AROUND_GUESS: [f64; 2] = [22.0, 38.0];

/// `n` rotations spread evenly over all: M. Alexa, *Super-Fibonacci Spirals: Fast, Low-Discrepancy
/// Sampling of SO(3)*, 2022, algorithm 1.
///
/// With s = i + ½, r = √(s/n), R = √(1 − s/n), α = 2π s/√2 and β = 2π s/ψ, the i-th unit quaternion
/// is (x, y, z, w) = (r sin α, r cos α, R sin β, R cos β).
pub fn super_fibonacci(n: usize) -> impl Iterator<Item = DQuat> {
    use std::f64::consts::{SQRT_2, TAU};
    /// The positive root of ψ⁴ = ψ + 4.
    const PSI: f64 = 1.533_751_168_755_204_3;
    (0..n).map(move |i| {
        let s = i as f64 + 0.5;
        let (r, big_r) = ((s / n as f64).sqrt(), (1.0 - s / n as f64).sqrt());
        let (a, b) = (TAU * s / SQRT_2, TAU * s / PSI);
        DQuat::from_xyzw(r * a.sin(), r * a.cos(), big_r * b.sin(), big_r * b.cos()).normalize()
    })
}

/// Fourteen small rotations around a guess, the identity left out.
pub(crate) fn around_guess() -> impl Iterator<Item = DQuat> {
    let axes =
        (0..27i32).map(|i| DVec3::from_array([i % 3, i / 3 % 3, i / 9].map(|x| f64::from(x - 1))));
    axes.filter_map(|axis| {
        let angle = match axis.length_squared() as i32 {
            1 => AROUND_GUESS[0],
            3 => AROUND_GUESS[1],
            _ => return None,
        };
        Some(DQuat::from_axis_angle(axis.normalize(), angle.to_radians()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rotation_is_far_from_all_starts() {
        let starts: Vec<DQuat> = super_fibonacci(400).collect();
        let others = super_fibonacci(977).map(|q| q * DQuat::from_rotation_y(0.37));
        let worst = others
            .map(|q| starts.iter().map(|s| s.angle_between(q)).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max);
        assert!(worst.to_degrees() < 40.0, "{}", worst.to_degrees());
    }

    #[test]
    fn nearby_rotations_are_balanced() {
        let near: Vec<DQuat> = around_guess().collect();
        assert_eq!(near.len(), 14);
        let sum: DVec3 = near.iter().map(|q| q.to_scaled_axis()).sum();
        assert!(sum.length() < 1e-12);
    }
}
