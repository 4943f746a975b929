//! Where the search begins: rotations spread over all of them, or over those near a guess.

use semfm_geom::math::{DQuat, DVec3};

use crate::model::AlignModel;
use crate::observation::Observation;
use crate::sim3::Sim3;

/// How far around an initial pose the search looks, in degrees: about the axes of a cube's faces by
/// the first angle, of its corners by the second. Guesses 25° off are what this must mend.
const AROUND_INIT: [f64; 2] = [22.0, 38.0];

/// Share of the points that each border of a robust extent leaves outside.
const OUTSIDE: f64 = 0.04;

/// `n` rotations spread evenly over all (M. Alexa, *Super-Fibonacci Spirals: Fast, Low-Discrepancy
/// Sampling of SO(3)*, 2022).
pub(crate) fn rotations(n: usize) -> impl Iterator<Item = DQuat> {
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

/// Small rotations around a guess, the guess itself left out.
pub(crate) fn rotations_nearby() -> impl Iterator<Item = DQuat> {
    let axes =
        (0..27i32).map(|i| DVec3::from_array([i % 3, i / 3 % 3, i / 9].map(|x| f64::from(x - 1))));
    axes.filter_map(|axis| {
        let angle = match axis.length_squared() as i32 {
            1 => AROUND_INIT[0],
            3 => AROUND_INIT[1],
            _ => return None,
        };
        Some(DQuat::from_axis_angle(axis.normalize(), angle.to_radians()))
    })
}

/// The pose with the given rotation (object to camera) under which the side that faces the camera
/// covers what was observed: as wide across the line of sight, and as far away. `None` where the
/// model shows nothing.
pub(crate) fn fit_extent(
    model: &AlignModel,
    observed: &Observation,
    rotation: DQuat,
) -> Option<Sim3> {
    let sight = observed.frame();
    let outward = |normal: DVec3| {
        let facing = -(rotation * normal).dot(sight.forward);
        if model.both_sides || observed.all_around() { true } else { facing > 0.15 }
    };
    let turned: Vec<DVec3> = model
        .samples
        .iter()
        .step_by(3)
        .filter(|s| outward(s.normal))
        .map(|s| rotation * s.point)
        .collect();
    let (there, here) = (Extent::of(&turned, sight)?, observed.extent());
    // Along the line of sight, a single view shows less than is there.
    let across = if observed.all_around() { 3 } else { 2 };
    let size = |extent: Extent| extent.size[..across].iter().map(|x| x * x).sum::<f64>().sqrt();
    let scale = size(here) / size(there);
    let axes = [sight.right, sight.down, sight.forward];
    let offset: DVec3 = (0..3).map(|k| (here.centre[k] - scale * there.centre[k]) * axes[k]).sum();
    (scale.is_finite() && scale > 0.0).then_some(Sim3 { scale, rotation, translation: offset })
}

/// Axes of the line of sight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SightFrame {
    pub right: DVec3,
    pub down: DVec3,
    pub forward: DVec3,
}

impl SightFrame {
    /// Looking along `forward`.
    pub fn along(forward: DVec3) -> Self {
        let forward = forward.try_normalize().unwrap_or(DVec3::Z);
        let (right, down) = forward.any_orthonormal_pair();
        Self { right, down, forward }
    }
}

/// Where most points lie, along the axes of a line of sight: robust borders across it, the median
/// along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub centre: [f64; 3],
    pub size: [f64; 3],
}

impl Extent {
    pub fn of(points: &[DVec3], sight: SightFrame) -> Option<Self> {
        let mut extent = Self { centre: [0.0; 3], size: [0.0; 3] };
        for (k, axis) in [sight.right, sight.down, sight.forward].into_iter().enumerate() {
            let mut along: Vec<f64> = points.iter().map(|p| p.dot(axis)).collect();
            let outside = (OUTSIDE * along.len() as f64) as usize;
            let last = along.len().checked_sub(1)?;
            let mut at = |place: usize| *along.select_nth_unstable_by(place, f64::total_cmp).1;
            let (low, middle, high) = (at(outside), at(last / 2), at(last - outside));
            extent.centre[k] = if k < 2 { (low + high) / 2.0 } else { middle };
            extent.size[k] = high - low;
        }
        Some(extent)
    }

    /// Diagonal of the three sizes.
    pub fn diameter(&self) -> f64 {
        self.size.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rotation_is_far_from_all_starts() {
        let starts: Vec<DQuat> = rotations(400).collect();
        let others = rotations(977).map(|q| q * DQuat::from_rotation_y(0.37));
        let worst = others
            .map(|q| starts.iter().map(|s| s.angle_between(q)).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max);
        assert!(worst.to_degrees() < 40.0, "{}", worst.to_degrees());
    }

    #[test]
    fn nearby_rotations_are_balanced() {
        let near: Vec<DQuat> = rotations_nearby().collect();
        assert_eq!(near.len(), 14);
        let sum: DVec3 = near.iter().map(|q| q.to_scaled_axis()).sum();
        assert!(sum.length() < 1e-12);
    }
}
