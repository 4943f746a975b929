//! What surfaces alone do not tell: where they end.
//!
//! Point to plane cannot see a motion that carries every observed face along itself. Three faces of
//! a box, say, stay where they are while the box grows out of their corner, and so its scale is
//! unknown to the normal equations. The silhouette knows: if the box is too small, observed points
//! lie beyond it; if too large, the camera saw nothing where it should be. So the pose is moved along
//! the weak directions, one at a time, to where it explains most.

use semfm_geom::Task;

use crate::Result;
use crate::sim3::Sim3;
use crate::solve::{Matching, Problem, Vector7, geman_mcclure};

/// How far the pose is moved either way, in radians, radii of the object and logarithms of the
/// scale: what the search leaves open is less.
const FARTHEST: f64 = 0.24;

/// Places tried on either side at first, and again around the best of them.
const PLACES: i32 = 8;

/// Points that are asked at each place.
const POINTS: usize = 300;

/// Poses that explain this share of the best are as good: one in a hundred samples of the model
/// falls on one side or the other of a pixel's border.
const AS_GOOD: f64 = 0.99;

/// The least standard deviation that a silhouette is believed to give, a third of a cell of it.
const LEAST_STD: f64 = 0.005;

impl Problem<'_> {
    /// The pose that explains most along `weak` directions (unit vectors of turn, shift and growth
    /// in the inner frame), and the standard deviation that is left along each: half of the range
    /// in which poses explain as much, infinite where that has no end.
    pub fn settle(
        &self,
        start: Sim3,
        weak: &[Vector7],
        width: f64,
        task: &Task,
    ) -> Result<(Sim3, Vec<f64>)> {
        let ids = self.observed.some(POINTS);
        let mut pose = start;
        let mut stds = vec![f64::INFINITY; weak.len()];
        // Several directions know of each other only by turns.
        for _ in 0..weak.len().min(2) {
            for (direction, std) in weak.iter().zip(&mut stds) {
                task.check()?;
                let score = |place: f64| self.explained(&pose.along(direction, place), &ids, width);
                let (place, half) = best_place(score);
                (pose, *std) = (pose.along(direction, place), half);
            }
        }
        Ok((pose, stds))
    }

    /// Share of the observed points on the model times the share of the model's visible side that
    /// was observed, both within the noise.
    fn explained(&self, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        if !(self.scales[0]..=self.scales[1]).contains(&pose.scale) {
            return 0.0;
        }
        let mut on_model = 0.0;
        self.pulls(pose, ids, width, Matching::Exact, |_, pull| {
            on_model += geman_mcclure(pull.squared, width);
        });
        let tolerance = width + 0.01 * self.observed.diameter();
        on_model / ids.len().max(1) as f64 * self.seen(pose, tolerance, 1, false).share()
    }
}

impl Sim3 {
    /// This transform moved along a direction of its right-hand frame, as a screw with growth: the
    /// exponential of `place · direction`, so that a point that stays at first stays for good.
    fn along(&self, direction: &Vector7, place: f64) -> Self {
        let part = |at: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| direction[at + k] * place / 64.0);
            semfm_geom::math::DVec3::new(x, y, z)
        };
        let mut small = Self::IDENTITY.then_within(part(0), part(3), direction[6] * place / 64.0);
        for _ in 0..6 {
            small = small * small;
        }
        let moved = *self * small;
        Self { rotation: moved.rotation.normalize(), ..moved }
    }
}

/// Where in [−`FARTHEST`, `FARTHEST`] the score is best, and half the width of the range in which it
/// is as good. The middle of that range, or 0 where it reaches both ends.
fn best_place(score: impl Fn(f64) -> f64) -> (f64, f64) {
    let step = FARTHEST / f64::from(PLACES);
    let mut tried: Vec<(f64, f64)> =
        (-PLACES..=PLACES).map(|i| f64::from(i) * step).map(|x| (x, score(x))).collect();
    let best = |tried: &[(f64, f64)]| {
        let first = (0.0, f64::NEG_INFINITY);
        tried.iter().copied().fold(first, |best, one| if one.1 > best.1 { one } else { best })
    };
    let middle = best(&tried).0;
    // The ends of the range matter, so it is looked at closely on both sides.
    let close = (-PLACES..=PLACES).filter(|&i| i != 0).map(|i| middle + f64::from(i) * step / 4.0);
    tried.extend(close.map(|x| (x, score(x))));
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (place, top) = best(&tried);
    let at = tried.iter().position(|one| one.0 == place).unwrap_or_default();
    let good = |one: &&(f64, f64)| one.1 >= AS_GOOD * top;
    let low = tried[..=at].iter().rev().take_while(good).last().map_or(place, |one| one.0);
    let high = tried[at..].iter().take_while(good).last().map_or(place, |one| one.0);
    if low <= -FARTHEST || high >= FARTHEST {
        return (if low <= -FARTHEST && high >= FARTHEST { 0.0 } else { place }, f64::INFINITY);
    }
    ((low + high) / 2.0, ((high - low) / 2.0).max(LEAST_STD))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_place_is_the_middle_of_a_plateau_and_an_endless_one_is_told() {
        let (place, std) = best_place(|x| 1.0 - 10.0 * ((x - 0.07).abs() - 0.02).max(0.0));
        assert!((place - 0.07).abs() < 0.01 && (0.01..0.04).contains(&std), "{place} ± {std}");
        assert_eq!(best_place(|_| 0.5), (0.0, f64::INFINITY));
        assert_eq!(best_place(|x| x).1, f64::INFINITY);
    }

    #[test]
    fn growing_out_of_a_corner_leaves_the_corner() {
        let corner = semfm_geom::math::DVec3::new(0.3, -0.4, 0.5);
        let direction =
            Vector7::from_column_slice(&[0.0, 0.0, 0.0, -corner.x, -corner.y, -corner.z, 1.0]);
        let grown = Sim3::IDENTITY.along(&direction, 0.2);
        assert!((grown.scale - 0.2f64.exp()).abs() < 1e-12);
        assert!(grown.apply(corner).distance(corner) < 1e-3);
    }
}
