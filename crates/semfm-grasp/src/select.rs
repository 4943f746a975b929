//! From many grasps to a few: the best of each neighbourhood, then a set that differs.

use crate::grasp::Grasp;
use crate::grasp_distance::GraspDistance;
use crate::pose_grid::PoseGrid;
use crate::settings::Separation;

/// Keeps a grasp where no better one is within the separation in both translation and rotation;
/// best first, ties in the given order.
pub(crate) fn suppress(mut grasps: Vec<Grasp>, separation: Separation) -> Vec<Grasp> {
    grasps.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut grid = PoseGrid::new(separation);
    grasps.retain(|grasp| {
        let apart = !grid.has_near(&grasp.object_from_tcp);
        if apart {
            grid.insert(&grasp.object_from_tcp);
        }
        apart
    });
    grasps
}

/// `top` of the grasps (best first): the best, then each time the one whose score and distance to
/// those chosen add up to most (maximal marginal relevance, Carbonell & Goldstein 1998). `radius` is
/// the length that counts as far, metres. Best first again.
pub(crate) fn diverse(grasps: Vec<Grasp>, top: usize, diversity: f64, radius: f64) -> Vec<Grasp> {
    if grasps.len() <= top {
        return grasps;
    }
    let mut distance = vec![1.0; grasps.len()];
    let mut chosen = vec![false; grasps.len()];
    for _ in 0..top {
        let gain = |i: usize| (1.0 - diversity) * grasps[i].score + diversity * distance[i];
        let left = (0..grasps.len()).filter(|&i| !chosen[i]);
        let Some(next) = left.max_by(|&a, &b| gain(a).total_cmp(&gain(b)).then(b.cmp(&a))) else {
            break;
        };
        chosen[next] = true;
        for (d, grasp) in distance.iter_mut().zip(&grasps) {
            let apart =
                GraspDistance::between(&grasp.object_from_tcp, &grasps[next].object_from_tcp);
            *d = d.min(apart.relative(radius));
        }
    }
    grasps.into_iter().zip(chosen).filter(|(_, chosen)| *chosen).map(|(grasp, _)| grasp).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::math::Pose;
    use semfm_geom::math::DVec3;

    fn grasp(x: f64, about_z: f64, score: f64) -> Grasp {
        Grasp {
            object_from_tcp: Pose::new(DVec3::X * x, DVec3::Z * about_z),
            width: 0.01,
            opening: 0.08,
            contacts: [DVec3::ZERO; 2],
            normals: [DVec3::NEG_Y, DVec3::Y],
            epsilon: 0.0,
            score,
            terms: Vec::new(),
        }
    }

    #[test]
    fn the_best_of_each_neighbourhood_stays() {
        let all = vec![
            grasp(0.0, 0.0, 0.5),
            grasp(0.004, 0.1, 0.9),
            grasp(0.05, 0.0, 0.2),
            grasp(0.0, 1.0, 0.3),
        ];
        let kept = suppress(all, Separation { translation: 0.01, rotation: 0.26 });
        assert_eq!(kept.iter().map(|g| g.score).collect::<Vec<_>>(), [0.9, 0.3, 0.2]);
    }

    #[test]
    fn diversity_trades_score_for_distance() {
        let all = vec![grasp(0.0, 0.0, 0.9), grasp(0.011, 0.0, 0.8), grasp(0.1, 1.5, 0.6)];
        for (diversity, expected) in [(0.0, [0.9, 0.8]), (0.5, [0.9, 0.6])] {
            let chosen = diverse(all.clone(), 2, diversity, 0.1);
            assert_eq!(chosen.iter().map(|g| g.score).collect::<Vec<_>>(), expected);
        }
        assert_eq!(diverse(all, 9, 0.5, 0.1).len(), 3);
    }
}
