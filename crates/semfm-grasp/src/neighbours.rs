//! Neighbours of grasps: where one gripper fits, one a little beside it often does.

use parry3d_f64::math::{Pose, Rotation};
use semfm_geom::math::{DQuat, DVec3};

use crate::candidate::Candidate;
use crate::grasp::Grasp;
use crate::pose_grid::PoseGrid;
use crate::settings::Separation;

/// Neighbours are this much farther away than two grasps must be, so that rounding does not merge
/// them.
const BEYOND: f64 = 1.02;

/// Poses around each grasp of `frontier` that are nobody's neighbour in `kept` nor each other's: a
/// step of the separation along both axes that closing leaves free, and about all three.
pub(crate) fn neighbours(
    frontier: &[Grasp],
    kept: &[Grasp],
    separation: Separation,
) -> Vec<Candidate> {
    let moves = steps(BEYOND * separation.translation, BEYOND * separation.rotation);
    let mut grid = PoseGrid::new(separation);
    kept.iter().for_each(|grasp| grid.insert(&grasp.object_from_tcp));
    let mut proposed = Vec::new();
    for grasp in frontier {
        let Candidate { tcp: here, seed } = Candidate::from_grasp(grasp);
        for motion in &moves {
            let tcp = here * *motion;
            if !grid.has_near(&tcp) {
                grid.insert(&tcp);
                proposed.push(Candidate { tcp, seed });
            }
        }
    }
    proposed
}

/// A step (metres) both ways along both axes that closing leaves free, and a turn (radians) both ways about all three.
pub(crate) fn steps(step: f64, turn: f64) -> Vec<Pose> {
    [-1.0, 1.0]
        .into_iter()
        .flat_map(|sign| {
            [
                Pose::from_translation(sign * step * DVec3::X),
                Pose::from_translation(sign * step * DVec3::Z),
                turned(sign * turn, DVec3::Y),
                turned(sign * turn, DVec3::X),
                turned(sign * turn, DVec3::Z),
            ]
        })
        .collect()
}

/// A turn (radians) about an axis through the TCP.
pub(crate) fn turned(angle: f64, axis: DVec3) -> Pose {
    let rotation: Rotation = DQuat::from_axis_angle(axis, angle);
    Pose::from_parts(DVec3::ZERO, rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grasp_distance::GraspDistance;

    fn grasp(x: f64) -> Grasp {
        Grasp {
            object_from_tcp: Pose::from_translation(DVec3::X * x),
            width: 0.02,
            opening: 0.08,
            contacts: [DVec3::ZERO; 2],
            normals: [DVec3::NEG_Y, DVec3::Y],
            epsilon: 0.0,
            closing_turn: 0.0,
            score: 1.0,
            hold: None,
            terms: Vec::new(),
        }
    }

    #[test]
    fn neighbours_keep_their_distance_from_all() {
        let separation = Separation { translation: 0.01, rotation: 0.25 };
        let alone = [grasp(0.0)];
        assert_eq!(neighbours(&alone, &alone, separation).len(), 10);
        let two = [grasp(0.0), grasp(0.0103)];
        let found = neighbours(&two, &two, separation);
        assert!(found.len() < 20);
        for candidate in &found {
            for other in &two {
                let apart = GraspDistance::between(&other.object_from_tcp, &candidate.tcp);
                assert!(apart.translation >= 0.01 || apart.rotation >= 0.25);
            }
        }
    }
}
