//! Candidates from pairs of opposite surface points: a ray inside one friction cone that leaves
//! inside the other.
//!
//! The sampler of Chen & Burdick (Finding antipodal point grasps on irregularly shaped objects,
//! 1993) as grasp planners use it (Mahler et al., Dex-Net 2.0, 2017). It works on bare triangles:
//! where no inside is known, rays go both ways, and each surface that a ray crosses within the
//! opening may be the opposite one, so that the rim of a mug, a thin shell and a pair of blades all
//! get their pairs.

use std::f64::consts::TAU;

use parry3d_f64::math::Pose;
use rand::{Rng, RngExt};
use semfm_geom::math::{DQuat, DVec3};

use crate::candidate::{Candidate, rotation};
use crate::gripper_geometry::GripperGeometry;
use crate::object::{GraspObject, Seed, Surface};

/// Rays from each seed: one along the normal, the rest inside the friction cone.
const RAYS: usize = 2;

/// Directions of approach about the closing axis of each pair, evenly spread from a random start.
const APPROACHES: usize = 12;

/// Pairs of one ray: two walls of a shell and two behind them.
const MOST_PAIRS: usize = 4;

/// Share of half the pad's length by which the contacts may lie off its middle.
const OFF_CENTRE: f64 = 0.7;

/// The part of a pad's length that is its tip.
const TIP: f64 = 0.3;

/// Points nearer than this (metres) are one surface.
const SAME_SURFACE: f64 = 1e-5;

/// Adds candidates whose pads meet the surface at `seed` and at a point opposite to it; on a mesh
/// only, for a cloud has no surface for a ray to hit.
pub(crate) fn antipodal(
    object: &GraspObject,
    gripper: &GripperGeometry,
    seed: &Seed,
    friction: f64,
    rng: &mut impl Rng,
    out: &mut Vec<Candidate>,
) {
    let Surface::Mesh { normals, .. } = object.surface() else { return };
    if seed.normal == DVec3::ZERO {
        return;
    }
    let least_cosine = friction.atan().cos();
    let widest = *gripper.opening().end();
    if !object.is_signed() {
        // An open sheet has no opposite surface: its own other side is.
        pair(gripper, seed.point, seed.normal, 0.0, rng, out);
    }
    for ray in 0..RAYS {
        let tilted = if ray == 0 { -seed.normal } else { in_cone(-seed.normal, friction, rng) };
        // Known inside: into it. Otherwise the face may be wound either way.
        let direction = if object.is_signed() || rng.random::<bool>() { tilted } else { -tilted };
        // Beyond the opening too: that the object is there, but too thick, is an answer.
        let hits =
            object.touched().tree.crossings(seed.point, direction, SAME_SURFACE, 4.0 * widest);
        let opposite = hits
            .iter()
            .filter(|(_, face)| *face != seed.item)
            .filter(|(_, face)| opposes(normals[*face as usize], direction, object, least_cosine));
        for &(t, _) in opposite.take(MOST_PAIRS) {
            pair(gripper, seed.point, direction, t, rng, out);
            // Wider pairs only tell that the object is too thick: one is enough.
            if t > widest {
                break;
            }
        }
    }
}

/// Whether a surface can take the push along `direction` from its other side.
fn opposes(normal: DVec3, direction: DVec3, object: &GraspObject, least_cosine: f64) -> bool {
    let cosine = normal.dot(direction);
    if object.is_signed() { cosine >= least_cosine } else { cosine.abs() >= least_cosine }
}

/// One candidate for each approach about the line from `point` to `point + t · closing`.
fn pair(
    gripper: &GripperGeometry,
    point: DVec3,
    closing: DVec3,
    t: f64,
    rng: &mut impl Rng,
    out: &mut Vec<Candidate>,
) {
    let middle = point + closing * (t / 2.0);
    let across = closing.any_orthonormal_vector();
    let start = rng.random::<f64>();
    for k in 0..APPROACHES {
        let angle = TAU * (k as f64 + start) / APPROACHES as f64;
        let approach = DQuat::from_axis_angle(closing, angle) * across;
        // Every other one holds with the middle of the pads, the rest anywhere along them; long pads with their tips, too.
        let share = rng.random::<f64>();
        let off = match k % 4 {
            0 | 2 => 0.0,
            1 if gripper.has_long_pads() => -0.5 + TIP * (0.2 + 0.8 * share),
            _ => OFF_CENTRE * (share - 0.5),
        };
        let place = middle + approach * (off * gripper.pad()[1]);
        let tcp = Pose::from_parts(place, rotation(closing, approach));
        out.push(Candidate { tcp, seed: [-t / 2.0, t / 2.0] });
    }
}

/// A direction uniform in the cone of half-angle atan μ about `axis`.
fn in_cone(axis: DVec3, friction: f64, rng: &mut impl Rng) -> DVec3 {
    let least = friction.atan().cos();
    let cosine = least + (1.0 - least) * rng.random::<f64>();
    let (sin, cos) = (TAU * rng.random::<f64>()).sin_cos();
    let (u, v) = axis.any_orthonormal_pair();
    (axis * cosine + (1.0 - cosine * cosine).max(0.0).sqrt() * (cos * u + sin * v)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper_geometry::BoxGripper;
    use crate::object::Region;
    use crate::test_meshes::cylinder;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use semfm_geom::zoo;

    #[test]
    fn pairs_on_a_cylinder_span_it_inside_both_cones() {
        let object = GraspObject::from_mesh(&cylinder(0.02, 0.1, 128), 1.0).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut candidates = Vec::new();
        for _ in 0..50 {
            let seed = region.draw(&object, &mut rng);
            antipodal(&object, &gripper, &seed, 0.5, &mut rng, &mut candidates);
        }
        assert!(candidates.len() > 500, "{}", candidates.len());
        for candidate in candidates {
            let closing = candidate.tcp.rotation * DVec3::Y;
            let across = DVec3::new(closing.x, closing.y, 0.0).length();
            let caps = closing.z.abs() > 0.89;
            assert!(across > 0.89 || caps, "closing along {closing}");
        }
    }

    #[test]
    fn a_shell_without_inside_has_pairs_too() {
        // Every third face turned around: nothing can be said of inside and outside.
        let ball = zoo::icosphere(3);
        let turned = ball.faces().iter().enumerate();
        let faces = turned.map(|(i, &[a, b, c])| if i % 3 == 0 { [a, c, b] } else { [a, b, c] });
        let mesh = semfm_geom::Mesh::new(ball.vertices().to_vec(), faces.collect()).unwrap();
        let object = GraspObject::from_mesh(&mesh, 0.03).unwrap();
        assert!(!object.is_signed());
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut candidates = Vec::new();
        for _ in 0..20 {
            let seed = region.draw(&object, &mut rng);
            antipodal(&object, &gripper, &seed, 0.5, &mut rng, &mut candidates);
        }
        assert!(candidates.iter().any(|c| (c.seed[1] - 0.03).abs() < 2e-3));
    }
}
