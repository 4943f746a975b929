//! Force closure of two soft contacts, and Ferrari & Canny's measure of it.

use std::f64::consts::{PI, TAU};

use semfm_geom::math::DVec3;

use crate::contact::Patch;
use crate::wrench_hull::{Wrench, inner_radius};

/// Edges of the pyramid that stands for a friction cone. The pyramid lies inside the cone: with 8
/// edges ε comes out at most 8 % too low, never too high.
const CONE_EDGES: usize = 8;

/// A contact through which a pad presses with a unit of force.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SoftContact {
    /// Where, in metres from the centre of mass.
    pub(crate) arm: DVec3,
    /// Unit normal, into the object.
    pub(crate) inward: DVec3,
    /// A direction from which the edges of the friction pyramid are counted, so that they turn with
    /// the gripper; not along the normal.
    pub(crate) tangent: DVec3,
    /// Torque about the normal that friction can hold, metres (per unit of force).
    pub(crate) torsion: f64,
}

impl SoftContact {
    /// A round patch of `area` (m²) under even pressure holds 2/3 μ r about its normal.
    pub(crate) fn new(arm: DVec3, inward: DVec3, tangent: DVec3, area: f64, friction: f64) -> Self {
        Self { arm, inward, tangent, torsion: 2.0 / 3.0 * friction * (area / PI).sqrt() }
    }

    /// Forces on the edge of the friction cone, without torsion, and torsion both ways without
    /// tangential force: the corners of the soft finger's limit surface (Howe & Cutkosky 1996),
    /// whose hull lies inside it.
    fn wrenches(&self, friction: f64, length: f64) -> impl Iterator<Item = Wrench> + '_ {
        let flat = self.tangent.reject_from_normalized(self.inward).try_normalize();
        let u = flat.unwrap_or_else(|| self.inward.any_orthonormal_vector());
        let v = self.inward.cross(u);
        let edges = (0..CONE_EDGES).map(move |k| {
            let (sin, cos) = (TAU * k as f64 / CONE_EDGES as f64).sin_cos();
            let force = self.inward + friction * (cos * u + sin * v);
            (force, self.arm.cross(force))
        });
        let torsions = [-1.0, 1.0].into_iter().map(|sign| {
            let force = self.inward;
            (force, self.arm.cross(force) + sign * self.torsion * self.inward)
        });
        edges.chain(torsions).map(move |(force, torque)| {
            let torque = torque / length;
            [force.x, force.y, force.z, torque.x, torque.y, torque.z]
        })
    }
}

/// Ferrari & Canny's ε (Planning Optimal Grasps, 1992) for contacts whose forces add up to one: the
/// largest ball around the origin within the hull of their wrenches. Torques are divided by `length`
/// metres. 0 where the grasp has no force closure.
pub(crate) fn ferrari_canny(contacts: &[SoftContact], friction: f64, length: f64) -> f64 {
    let wrenches: Vec<Wrench> =
        contacts.iter().flat_map(|contact| contact.wrenches(friction, length)).collect();
    inner_radius(&wrenches)
}

/// The largest angle between the line through both contacts and the four normals there (of the
/// patches and at the points), radians: with two soft contacts, force closure is an angle below
/// atan μ (Nguyen 1988). `closing` is the line's direction where both contacts are one point.
pub(crate) fn widest_angle(patches: &[Patch; 2], closing: DVec3) -> f64 {
    let [left, right] = patches;
    let line = (right.contact - left.contact).try_normalize().unwrap_or(closing);
    let angle = |normal: DVec3, towards: DVec3| normal.dot(towards).clamp(-1.0, 1.0).acos();
    [
        angle(left.normal, -line),
        angle(left.local_normal, -line),
        angle(right.normal, line),
        angle(right.local_normal, line),
    ]
    .into_iter()
    .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn pair(half: f64, area: f64, friction: f64) -> [SoftContact; 2] {
        [-1.0, 1.0].map(|side| {
            SoftContact::new(side * half * DVec3::Y, -side * DVec3::Y, DVec3::Z, area, friction)
        })
    }

    /// Support function of the wrenches of two contacts at ±r y on a ball of radius r, torques over
    /// r, for exact cones: with the tangential force f = (x, z) at the side s the torque is
    /// s (z, 0, -x), so that h(u) = max over s of s u_y + max(μ |a_s|, t |u_τy|) with
    /// a_s = (u_x - s u_τz, u_z + s u_τx) and t the torsion over r.
    fn support(u: &Wrench, friction: f64, t: f64) -> f64 {
        let side = |s: f64| {
            let a = (u[0] - s * u[5]).hypot(u[2] + s * u[3]);
            s * u[1] + (friction * a).max(t * u[4].abs())
        };
        side(-1.0).max(side(1.0))
    }

    #[test]
    fn epsilon_of_a_pinched_ball_is_the_least_value_of_its_support_function() {
        let (r, friction) = (0.03, 0.5);
        for area in [1e-5, 1e-4, 3e-4] {
            let contacts = pair(r, area, friction);
            let t = contacts[0].torsion / r;
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let mut least = f64::INFINITY;
            for _ in 0..40 {
                let mut u: Wrench = std::array::from_fn(|_| rng.random::<f64>() - 0.5);
                let mut step = 0.5;
                while step > 1e-6 {
                    let near: Wrench =
                        std::array::from_fn(|d| u[d] + step * (rng.random::<f64>() - 0.5));
                    let unit = |w: &Wrench| {
                        let length = w.iter().map(|x| x * x).sum::<f64>().sqrt();
                        w.map(|x| x / length)
                    };
                    let (now, then) = (unit(&near), unit(&u));
                    if support(&now, friction, t) < support(&then, friction, t) {
                        u = now;
                    } else {
                        step *= 0.98;
                    }
                }
                least = least.min(support(&u, friction, t));
            }
            let epsilon = ferrari_canny(&contacts, friction, r);
            assert!(epsilon <= least + 1e-4, "{epsilon} above {least}");
            assert!(epsilon >= least * (PI / 8.0).cos() - 1e-4, "{epsilon} far below {least}");
        }
    }

    #[test]
    fn epsilon_does_not_change_with_the_unit_of_length() {
        let small = ferrari_canny(&pair(0.02, 1e-4, 0.4), 0.4, 0.05);
        let large = ferrari_canny(&pair(0.2, 1e-2, 0.4), 0.4, 0.5);
        assert!((small - large).abs() < 1e-6);
    }

    #[test]
    fn epsilon_falls_with_friction_patch_and_lever_and_is_0_without_closure() {
        let at = |area, friction, offset: DVec3| {
            let mut contacts = pair(0.02, area, friction);
            contacts.iter_mut().for_each(|contact| contact.arm += offset);
            ferrari_canny(&contacts, friction, 0.1)
        };
        let good = at(3e-4, 0.5, DVec3::ZERO);
        assert!(good > 0.01);
        assert!(at(3e-5, 0.5, DVec3::ZERO) < good);
        assert!(at(3e-4, 0.2, DVec3::ZERO) < good);
        assert!(at(3e-4, 0.5, 0.1 * DVec3::Z) < good);
        let sideways =
            [DVec3::NEG_Y, DVec3::X].map(|arm| SoftContact::new(arm, -arm, DVec3::Z, 1e-4, 0.5));
        assert_eq!(ferrari_canny(&sideways, 0.5, 1.0), 0.0, "normals at a right angle");
        assert_eq!(ferrari_canny(&pair(0.02, 0.0, 0.5), 0.5, 0.1), 0.0, "points hold no torsion");
    }
}
