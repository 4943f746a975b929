//! The search: many coarse starts, fewer at each round, one exact pose.

use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::math::DVec3;

use crate::Result;
use crate::observation::Evidence;
use crate::sight::Seen;
use crate::sim3::Sim3;
use crate::solve::{Matching, Problem, geman_mcclure};
use crate::starts::{fit_extent, rotations, rotations_nearby};

/// Points of the first round; each start takes about .2 ms.
const FIRST_POINTS: usize = 160;
/// Steps of the first round.
const FIRST_STEPS: usize = 10;
/// Poses that the second round continues with.
const SECOND_POSES: usize = 12;
/// Points of the second round.
const SECOND_POINTS: usize = 320;
/// Steps of the second round.
const SECOND_STEPS: usize = 8;
/// Poses that are compared on the triangles.
const THIRD_POSES: usize = 4;
/// Points of the third round.
const THIRD_POINTS: usize = 300;
/// Steps of the third round.
const THIRD_STEPS: usize = 4;

/// Widths of the kernel, as shares of the observed diameter: where the search starts, where the
/// coarse rounds end (a table's cell), and where the third ends.
const WIDTHS: [f64; 3] = [0.25, 0.05, 0.02];

/// Width by which poses are scored, as a share of the observed diameter: about 3 mm on a mug.
const SCORE_WIDTH: f64 = 0.025;

/// An initial pose that scores this much is believed without trying others.
const GOOD_ENOUGH: f64 = 0.7;

/// Poses that place the surface closer than this, in shares of its radius, are the same pose.
const SAME: f64 = 0.06;

/// A pose (camera from the model's inner frame) and how much it explains, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub pose: Sim3,
    pub score: f64,
}

impl Problem<'_> {
    /// The best pose found, the best of the others (with another place of the surface), and how
    /// many starts were tried. `None` where no start leads anywhere.
    pub fn search(
        &self,
        init: Option<Sim3>,
        n_starts: usize,
        task: &Task,
    ) -> Result<Option<(Candidate, Option<Candidate>, usize)>> {
        let mut n_tried = 0;
        if let Some(init) = init {
            let starts = self.around(init.rotation, [init].into_iter());
            n_tried += starts.len();
            let found = self.rounds(starts, task)?;
            if found.first().is_some_and(|best| best.score >= GOOD_ENOUGH) {
                return Ok(self.best_and_rival(found).map(|(best, rival)| (best, rival, n_tried)));
            }
        }
        let starts: Vec<Sim3> = match init {
            Some(init) => rotations_nearby()
                .flat_map(|turn| {
                    let moved = Sim3 { rotation: turn * init.rotation, ..init };
                    self.around(moved.rotation, [moved].into_iter())
                })
                .chain([init])
                .collect(),
            None => rotations(n_starts).flat_map(|r| self.around(r, std::iter::empty())).collect(),
        };
        n_tried += starts.len();
        let found = self.rounds(starts, task)?;
        Ok(self.best_and_rival(found).map(|(best, rival)| (best, rival, n_tried)))
    }

    /// The given starts and the one that fits the observed extent, scales brought into bounds.
    fn around(
        &self,
        rotation: semfm_geom::math::DQuat,
        given: impl Iterator<Item = Sim3>,
    ) -> Vec<Sim3> {
        given
            .chain(fit_extent(self.model, self.observed, rotation))
            .map(|pose| Sim3 { scale: pose.scale.clamp(self.scales[0], self.scales[1]), ..pose })
            .collect()
    }

    /// All three rounds; the best first.
    fn rounds(&self, starts: Vec<Sim3>, task: &Task) -> Result<Vec<Candidate>> {
        let size = self.observed.diameter();
        let [first, second, third] =
            [FIRST_POINTS, SECOND_POINTS, THIRD_POINTS].map(|n| self.observed.some(n));
        let [wide, narrow, fine] = WIDTHS.map(|share| share * size);
        let n = starts.len();
        let found = self.round(starts, task, |pose| {
            let pose = self.anneal(pose, &first, [wide, narrow], FIRST_STEPS, Matching::Coarse)?;
            Some(Candidate { pose, score: self.score(&pose, &first, Matching::Coarse, 3) })
        })?;
        task.step("align", n, n + SECOND_POSES + THIRD_POSES)?;
        let chosen = self.distinct(found, SECOND_POSES);
        let found = self.round(chosen, task, |pose| {
            let widths = [1.6 * narrow, 0.7 * narrow];
            let pose = self.anneal(pose, &second, widths, SECOND_STEPS, Matching::Coarse)?;
            Some(Candidate { pose, score: self.score(&pose, &second, Matching::Coarse, 1) })
        })?;
        task.step("align", n + SECOND_POSES, n + SECOND_POSES + THIRD_POSES)?;
        let chosen = self.distinct(found, THIRD_POSES);
        let found = self.round(chosen, task, |pose| {
            let widths = [narrow, fine];
            let pose = self.anneal(pose, &third, widths, THIRD_STEPS, Matching::Exact)?;
            Some(Candidate { pose, score: self.score(&pose, &third, Matching::Exact, 1) })
        })?;
        Ok(found)
    }

    /// The poses that `work` makes of others, the highest score first, ties in order.
    fn round(
        &self,
        poses: Vec<Sim3>,
        task: &Task,
        work: impl Fn(Sim3) -> Option<Candidate> + Sync,
    ) -> Result<Vec<Candidate>> {
        let work = |pose| task.check().map(|()| work(pose));
        let found: semfm_geom::Result<Vec<_>> = if poses.len() < 3 {
            poses.into_iter().map(work).collect()
        } else {
            poses.into_par_iter().map(work).collect()
        };
        let mut found: Vec<Candidate> = found?.into_iter().flatten().collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }

    /// How much a pose explains: the share of observed points on the model times the share of the
    /// model's visible side that was observed. Every `every`th sample of the model is asked.
    fn score(&self, pose: &Sim3, ids: &[u32], matching: Matching, every: usize) -> f64 {
        let width = SCORE_WIDTH * self.observed.diameter();
        let mut on_model = 0.0;
        self.pulls(pose, ids, width, matching, |_, pull| {
            on_model += geman_mcclure(pull.squared, width) * pull.agreement.min(0.7) / 0.7;
        });
        on_model / ids.len().max(1) as f64 * self.seen(pose, 2.0 * width, every, false).share()
    }

    /// How the visible side of the model compares with what was observed.
    pub fn seen(&self, pose: &Sim3, tolerance: f64, every: usize, exact: bool) -> Seen {
        match &self.observed.evidence {
            Evidence::Sight(sight) => sight.compare(self.model, pose, tolerance, every, exact),
            Evidence::AllAround { index, spacing } => {
                let near = |point: DVec3| index.nearest(pose.apply(point)).1 <= tolerance + spacing;
                let samples = self.model.samples.iter().step_by(3 * every);
                let mut seen = Seen::default();
                samples.for_each(|s| match near(s.point) {
                    true => seen.explained += 1,
                    false => seen.violating += 1,
                });
                seen
            }
        }
    }

    /// Poses of the first `n` candidates that differ.
    fn distinct(&self, found: Vec<Candidate>, n: usize) -> Vec<Sim3> {
        let mut kept: Vec<Sim3> = Vec::with_capacity(n);
        for candidate in found {
            if kept.len() == n {
                break;
            }
            if kept.iter().all(|other| corner_distance(other, &candidate.pose) > SAME) {
                kept.push(candidate.pose);
            }
        }
        kept
    }

    /// The best, and the best of those that place the surface elsewhere: a symmetric object turned
    /// about its axis is no rival.
    fn best_and_rival(&self, found: Vec<Candidate>) -> Option<(Candidate, Option<Candidate>)> {
        let best = *found.first()?;
        let elsewhere =
            |other: &&Candidate| self.surface_distance(&best.pose, &other.pose) > SAME / 2.0;
        Some((best, found.iter().skip(1).find(elsewhere).copied()))
    }

    /// Mean distance from the surface at one pose to the surface at another, in radii (ADD-S,
    /// Hinterstoisser et al. 2012, on both sides' nearest points).
    fn surface_distance(&self, a: &Sim3, b: &Sim3) -> f64 {
        let (mut sum, mut n) = (0.0, 0);
        let b_from_a = b.inverse() * *a;
        for sample in self.model.samples.iter().step_by(self.model.samples.len().div_ceil(150)) {
            let query = b_from_a.apply(sample.point);
            sum += self.model.surface.closest(query).map_or(0.0, |hit| hit.distance);
            n += 1;
        }
        sum / f64::from(n.max(1)) * b.scale / a.scale
    }
}

/// Largest distance that a corner of the model's bounding cube moves from one pose to the other, in
/// radii of the first.
fn corner_distance(a: &Sim3, b: &Sim3) -> f64 {
    (0..8)
        .map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -0.6 } else { 0.6 };
            let corner = DVec3::new(sign(0), sign(1), sign(2));
            a.apply(corner).distance(b.apply(corner)) / a.scale
        })
        .fold(0.0, f64::max)
}
