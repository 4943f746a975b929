//! How much grasps depend on what the pose of the object leaves open.

use semfm_align::Sim3;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, SurfaceIndex};

use crate::Result;

/// How far (metres) a contact may lie off the surface of another pose and still be one: pads give way
/// by about as much, and poses differ by as much where nothing is open.
const OFF_SURFACE: f64 = 0.004;

/// Least weight of the region under a contact, as a share of the largest.
const IN_REGION: f64 = 0.5;

/// For each grasp, given by its two contacts in the frame of the object in metres: the share of the
/// `alternatives` (poses that explain what the camera saw as well as `pose` does) under which both of
/// them still lie on the object and in the region, whose `weights` are one a vertex. 1 for all grasps
/// where there are no alternatives.
///
/// A grasp at the rim of a mug whose handle is hidden holds wherever the handle is; one at the handle
/// does not.
///
/// # Errors
/// [`semfm_geom::Error::NoArea`] for a mesh without area.
pub fn shares_of_poses(
    mesh: &Mesh,
    weights: &[f64],
    pose: &Sim3,
    alternatives: &[Sim3],
    contacts: &[[DVec3; 2]],
) -> Result<Vec<f64>> {
    if alternatives.is_empty() {
        return Ok(vec![1.0; contacts.len()]);
    }
    let surface = SurfaceIndex::new(mesh)?;
    let least = IN_REGION * weights.iter().copied().fold(0.0, f64::max);
    let in_region = |point: DVec3, scale: f64| {
        surface.closest(point).is_some_and(|hit| {
            let corners = mesh.faces()[hit.face as usize];
            let weight = |k: usize| weights.get(corners[k] as usize).copied().unwrap_or_default();
            let here: f64 = (0..3).map(|k| hit.barycentric[k] * weight(k)).sum();
            hit.distance * scale <= OFF_SURFACE && here >= least
        })
    };
    let holds = |contacts: &[DVec3; 2], other: &Sim3| {
        let back = other.inverse();
        contacts.iter().all(|&contact| {
            let place = pose.apply(contact / pose.scale);
            in_region(back.apply(place), other.scale)
        })
    };
    let share = |contacts: &[DVec3; 2]| {
        let n = alternatives.iter().filter(|other| holds(contacts, other)).count();
        n as f64 / alternatives.len() as f64
    };
    Ok(contacts.iter().map(share).collect())
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DQuat;
    use semfm_geom::zoo;

    use super::*;

    #[test]
    fn what_a_turn_carries_away_depends_on_it_and_what_stays_does_not() {
        let ball = zoo::icosphere(4);
        let pose = Sim3 { scale: 0.05, translation: 0.5 * DVec3::Z, ..Sim3::IDENTITY };
        let turned = |angle: f64| Sim3 { rotation: DQuat::from_rotation_z(angle), ..pose };
        let alternatives = [0.3, 0.6, -0.6, 3.0].map(turned);
        // A cap around x, and all of the ball.
        let cap: Vec<f64> = ball.vertices().iter().map(|p| f64::from(p.x > 0.88)).collect();
        let whole = vec![1.0; ball.n_vertices()];
        let at = |angle: f64| 0.05 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        let contacts = [[at(0.0), at(0.1)], [at(0.0), at(std::f64::consts::PI)]];
        let of = |weights: &[f64], alternatives: &[Sim3]| {
            shares_of_poses(&ball, weights, &pose, alternatives, &contacts).unwrap()
        };
        assert_eq!(of(&cap, &alternatives), [0.25, 0.0]);
        assert_eq!(of(&whole, &alternatives), [1.0, 1.0]);
        assert_eq!(of(&cap, &[]), [1.0, 1.0]);
    }
}
