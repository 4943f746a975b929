//! Directions of the pose that surfaces alone do not determine.
//!
//! Distances from points to planes do not change under a motion that carries every observed face
//! along itself. Three faces of a box, say, stay where they are while the box grows out of their
//! corner, so the normal equations do not determine its scale. The silhouette does: if the box is
//! too small, observed points lie beyond it; if too large, the camera saw nothing where it should
//! be. So the pose is moved along the weak directions, one at a time, to where it explains most.

use semfm_geom::Task;

use crate::Result;
use crate::correspondence::{NearestBy, Problem};
use crate::kernel::geman_mcclure;
use crate::sim3::{Sim3, Tangent};

/// How far the pose is moved either way, in radians, radii of the object and logarithms of the
/// scale: what the search leaves open is less.
const FARTHEST: f64 = 0.24;

/// Distances tried on either side at first, and again around the best of them.
const TRIED: i32 = 8;

/// Points that are compared at each distance.
const POINTS: usize = 300;

/// Poses that explain this share of the best are as good: one in a hundred samples of the model
/// falls on one side or the other of a pixel's border.
const AS_GOOD: f64 = 0.99;

/// The least standard deviation that a silhouette is believed to give, a third of a cell of it.
const LEAST_STD: f64 = 0.005;

/// A pose after its weak directions were searched.
pub(crate) struct MovedPose {
    pub pose: Sim3,
    /// Standard deviation that is left along each direction.
    pub stds: Vec<f64>,
}

/// A distance along a direction and how much the pose there explains.
#[derive(Clone, Copy, Debug)]
struct Trial {
    distance: f64,
    score: f64,
}

/// Where a score is best, and how far around it the score is as good.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plateau {
    middle: f64,
    /// Half the width; infinite where the plateau has no end.
    std: f64,
}

impl Problem<'_> {
    /// The pose that explains most along `weak` directions (unit vectors of turn, shift and growth
    /// in the inner frame), and the standard deviation that is left along each: half of the range
    /// in which poses explain as much, infinite where that has no end.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Cancelled`].
    pub fn move_along_weak_directions(
        &self,
        start: Sim3,
        weak: &[Tangent],
        width: f64,
        task: &Task,
    ) -> Result<MovedPose> {
        let ids = self.observed.subset(POINTS);
        let mut pose = start;
        let mut stds = vec![f64::INFINITY; weak.len()];
        // Each is searched with the others kept, so several take a second pass.
        for _ in 0..weak.len().min(2) {
            for (direction, std) in weak.iter().zip(&mut stds) {
                task.check()?;
                let plateau = best_plateau(|distance| {
                    self.explained(&pose.moved_along(direction, distance), &ids, width)
                });
                (pose, *std) = (pose.moved_along(direction, plateau.middle), plateau.std);
            }
        }
        Ok(MovedPose { pose, stds })
    }

    /// Share of the observed points on the model times the share of the model's visible side that
    /// was observed, both within the noise.
    fn explained(&self, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        if !(self.scales[0]..=self.scales[1]).contains(&pose.scale) {
            return 0.0;
        }
        let mut on_model = 0.0;
        self.for_each_correspondence(pose, ids, width, NearestBy::Triangles, |c| {
            on_model += geman_mcclure(c.squared, width);
        });
        let tolerance = width + 0.01 * self.observed.diameter();
        on_model / ids.len().max(1) as f64 * self.visibility(pose, tolerance, 1, false).share()
    }
}

/// Where in [−`FARTHEST`, `FARTHEST`] the score is best, and half the width of the range in which it
/// is as good. The middle of that range, or 0 where it reaches both ends.
fn best_plateau(score: impl Fn(f64) -> f64) -> Plateau {
    let step = FARTHEST / f64::from(TRIED);
    let coarse = (-TRIED..=TRIED).map(|i| f64::from(i) * step);
    let mut trials: Vec<Trial> =
        coarse.map(|distance| Trial { distance, score: score(distance) }).collect();
    let around = best(&trials).distance;
    // The ends of the range matter, so it is looked at closely on both sides.
    let close = (-TRIED..=TRIED).filter(|&i| i != 0).map(|i| around + f64::from(i) * step / 4.0);
    trials.extend(close.map(|distance| Trial { distance, score: score(distance) }));
    trials.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    let top = best(&trials);
    let at = trials.iter().position(|t| t.distance == top.distance).unwrap_or_default();
    let low = last_as_good(trials[..=at].iter().rev(), top);
    let high = last_as_good(trials[at..].iter(), top);
    let ends = [low <= -FARTHEST, high >= FARTHEST];
    match ends {
        [true, true] => Plateau { middle: 0.0, std: f64::INFINITY },
        [false, false] => {
            Plateau { middle: (low + high) / 2.0, std: ((high - low) / 2.0).max(LEAST_STD) }
        }
        _ => Plateau { middle: top.distance, std: f64::INFINITY },
    }
}

/// The first of the best.
fn best(trials: &[Trial]) -> Trial {
    let none = Trial { distance: 0.0, score: f64::NEG_INFINITY };
    trials.iter().copied().fold(none, |best, one| if one.score > best.score { one } else { best })
}

/// How far the trials go on being as good as the top one.
fn last_as_good<'a>(trials: impl Iterator<Item = &'a Trial>, top: Trial) -> f64 {
    trials
        .take_while(|trial| trial.score >= AS_GOOD * top.score)
        .last()
        .map_or(top.distance, |trial| trial.distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_place_is_the_middle_of_a_plateau_and_an_endless_one_is_told() {
        let Plateau { middle, std } =
            best_plateau(|x| 1.0 - 10.0 * ((x - 0.07).abs() - 0.02).max(0.0));
        assert!((middle - 0.07).abs() < 0.01 && (0.01..0.04).contains(&std), "{middle} ± {std}");
        assert_eq!(best_plateau(|_| 0.5), Plateau { middle: 0.0, std: f64::INFINITY });
        assert_eq!(best_plateau(|x| x).std, f64::INFINITY);
    }
}
