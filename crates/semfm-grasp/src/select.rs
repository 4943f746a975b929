//! From many grasps to a few: the best of each neighbourhood, then a set that differs.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::grasp::Grasp;
use crate::grasp_distance::GraspDistance;
use crate::pose_grid::PoseGrid;
use crate::settings::Separation;

/// Keeps a grasp where no better one is within the separation in both translation and rotation;
/// best first, ties in the given order.
///
/// A grasp of which only a bound is known is hidden by what is surely as good, and hides only other bounds: its score,
/// once it is known, may be less than that of a near one.
pub(crate) fn suppress(mut grasps: Vec<Grasp>, separation: Separation) -> Vec<Grasp> {
    grasps.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut scored = PoseGrid::new(separation);
    let mut bounded = PoseGrid::new(separation);
    grasps.retain(|grasp| {
        let pose = &grasp.object_from_tcp;
        let apart = !scored.has_near(pose) && (grasp.is_scored() || !bounded.has_near(pose));
        if apart {
            let grid = if grasp.is_scored() { &mut scored } else { &mut bounded };
            grid.insert(pose);
        }
        apart
    });
    grasps
}

/// The best `n` of the scored grasps (best first) that lie apart from each other.
pub(crate) fn best_apart(grasps: &[Grasp], separation: Separation, n: usize) -> Vec<Grasp> {
    let scored = grasps.iter().filter(|grasp| grasp.is_scored()).cloned().collect();
    let mut best = suppress(scored, separation);
    best.truncate(n);
    best
}

/// `top` of the grasps (best first), different from each other among the good ones only.
///
/// Good are grasps whose score is at least (1 − `diversity`) times that of the `top`-th best, the last that a
/// plain ranking would return. Of these the best, then each time the one that is farthest from all chosen
/// (Gonzalez 1985, farthest-first). `radius` is the length that counts as far, metres. Best first again.
pub(crate) fn diverse(
    mut grasps: Vec<Grasp>,
    top: usize,
    diversity: f64,
    radius: f64,
) -> Vec<Grasp> {
    let Some(last) = top.checked_sub(1).and_then(|last| grasps.get(last)) else {
        return grasps;
    };
    let least = (1.0 - diversity) * last.score;
    grasps.truncate(grasps.partition_point(|grasp| grasp.score >= least));
    let mut distance = vec![f64::INFINITY; grasps.len()];
    let mut chosen = vec![false; grasps.len()];
    for _ in 0..top {
        let left = (0..grasps.len()).filter(|&i| !chosen[i]);
        // Of equally far ones the better.
        let farthest = |&a: &usize, &b: &usize| distance[a].total_cmp(&distance[b]).then(b.cmp(&a));
        let Some(next) = left.max_by(farthest) else {
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

/// `top` of the grasps, each as likely as any other; best first.
pub(crate) fn drawn(mut grasps: Vec<Grasp>, top: usize, seed: u64) -> Vec<Grasp> {
    grasps.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    grasps.truncate(top);
    grasps.sort_by(|a, b| b.score.total_cmp(&a.score));
    grasps
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
            closing_turn: 0.0,
            score,
            hold: None,
            terms: vec![("contact", 1.0)],
        }
    }

    fn bound(x: f64, bound: f64) -> Grasp {
        Grasp { terms: Vec::new(), ..grasp(x, 0.0, bound) }
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
    fn a_bound_hides_no_score_and_a_better_score_hides_a_bound() {
        let separation = Separation { translation: 0.01, rotation: 0.26 };
        let scores = |all: Vec<Grasp>| -> Vec<f64> {
            suppress(all, separation).iter().map(|grasp| grasp.score).collect()
        };
        assert_eq!(scores(vec![bound(0.0, 0.9), grasp(0.004, 0.0, 0.5)]), [0.9, 0.5]);
        assert_eq!(scores(vec![bound(0.0, 0.4), grasp(0.004, 0.0, 0.5)]), [0.5]);
        assert_eq!(scores(vec![bound(0.0, 0.9), bound(0.004, 0.8)]), [0.9]);
        let all =
            [bound(0.0, 0.9), grasp(0.0, 0.0, 0.5), grasp(0.004, 0.0, 0.6), grasp(0.03, 0.0, 0.1)];
        let best = best_apart(&all, separation, 9);
        assert_eq!(best.iter().map(|grasp| grasp.score).collect::<Vec<_>>(), [0.6, 0.1]);
        assert_eq!(best_apart(&all, separation, 1).len(), 1);
    }

    #[test]
    fn random_grasps_are_no_better_than_the_others() {
        let all: Vec<Grasp> = (0..1000).map(|i| grasp(0.0, 0.0, f64::from(i) / 1000.0)).collect();
        let some = drawn(all.clone(), 200, 5);
        let mean = some.iter().map(|grasp| grasp.score).sum::<f64>() / 200.0;
        assert!((mean - 0.5).abs() < 0.06, "{mean}"); // three standard deviations of such a mean
        assert!(some.is_sorted_by(|a, b| a.score >= b.score));
        assert_eq!(some, drawn(all, 200, 5));
    }

    #[test]
    fn diversity_is_among_the_good_ones() {
        let all = vec![
            grasp(0.0, 0.0, 0.9),
            grasp(0.011, 0.0, 0.8),
            grasp(0.05, 0.0, 0.75),
            grasp(0.1, 1.5, 0.3),
        ];
        let scores = |diversity: f64| -> Vec<f64> {
            diverse(all.clone(), 2, diversity, 0.1).iter().map(|g| g.score).collect()
        };
        assert_eq!(scores(0.0), [0.9, 0.8], "the plain ranking");
        assert_eq!(scores(0.1), [0.9, 0.75], "at most a tenth below the second");
        assert_eq!(scores(1.0), [0.9, 0.3], "the farthest of all");
        assert_eq!(diverse(all.clone(), 9, 0.5, 0.1).len(), 4);
        assert!(diverse(Vec::new(), 2, 0.1, 0.1).is_empty());
    }
}
