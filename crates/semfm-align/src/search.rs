//! The search: many coarse starts, fewer at each round, one exact pose.

use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::math::{DQuat, DVec3};

use crate::Result;
use crate::correspondence::{NearestBy, Problem};
use crate::initial_pose::fit_extent;
use crate::kernel::geman_mcclure;
use crate::observed_cloud::Coverage;
use crate::rotations::{around_guess, super_fibonacci};
use crate::sim3::Sim3;
use crate::visibility::Visibility;

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

/// A point whose normal agrees this well with its match's counts in full for the score.
const FULL_AGREEMENT: f64 = 0.7;

/// Other ends of the search that are handed on, at most, and the share of the best one's score that
/// each has at least.
const OTHERS: usize = 8;
const OTHERS_SCORE: f64 = 0.7;

/// An initial pose that scores this much is believed without trying others.
const GOOD_ENOUGH: f64 = 0.7;

/// Poses that place the surface closer than this, in shares of its radius, are the same pose.
const SAME: f64 = 0.06;

/// A pose (camera from the model's inner frame) and how much it explains, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScoredPose {
    pub pose: Sim3,
    pub score: f64,
}

/// What a search found.
#[derive(Clone, Debug)]
pub(crate) struct SearchResult {
    pub best: Sim3,
    /// The other poses that it ended in.
    pub others: Vec<Sim3>,
    /// Starts tried.
    pub n_starts: usize,
}

/// How the poses of one round are refined and scored.
struct Round {
    /// Ids of the observed points that take part.
    ids: Vec<u32>,
    /// First and last width of the kernel, metres.
    widths: [f64; 2],
    n_steps: usize,
    nearest_by: NearestBy,
    /// Every so many-th sample of the model takes part in the score.
    every: usize,
}

impl Problem<'_> {
    /// The best pose found, and the others that the search ended in. `None` where no start leads
    /// anywhere.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Cancelled`].
    pub fn search(
        &self,
        guess: Option<Sim3>,
        n_starts: usize,
        task: &Task,
    ) -> Result<Option<SearchResult>> {
        let mut n_tried = 0;
        if let Some(guess) = guess {
            let starts = self.starts(guess.rotation, Some(guess));
            n_tried += starts.len();
            let found = self.all_rounds(starts, n_tried, task)?;
            if found.as_ref().is_some_and(|(_, score)| *score >= GOOD_ENOUGH) {
                return Ok(found.map(|(found, _)| found));
            }
        }
        let starts: Vec<Sim3> = match guess {
            Some(guess) => around_guess()
                .map(|turn| Sim3 { rotation: turn * guess.rotation, ..guess })
                .flat_map(|turned| self.starts(turned.rotation, Some(turned)))
                .chain([guess])
                .collect(),
            None => {
                super_fibonacci(n_starts).flat_map(|rotation| self.starts(rotation, None)).collect()
            }
        };
        n_tried += starts.len();
        Ok(self.all_rounds(starts, n_tried, task)?.map(|(found, _)| found))
    }

    /// The given start and the one with this rotation that fits the observed extent, scales brought
    /// into bounds.
    fn starts(&self, rotation: DQuat, given: Option<Sim3>) -> Vec<Sim3> {
        given
            .into_iter()
            .chain(fit_extent(self.model, self.observed, rotation))
            .map(|pose| Sim3 { scale: pose.scale.clamp(self.scales[0], self.scales[1]), ..pose })
            .collect()
    }

    /// All three rounds: what they found, and the best one's score.
    fn all_rounds(
        &self,
        starts: Vec<Sim3>,
        n_starts: usize,
        task: &Task,
    ) -> Result<Option<(SearchResult, f64)>> {
        let [wide, narrow, fine] = WIDTHS.map(|share| share * self.observed.diameter());
        let first = Round {
            ids: self.observed.subset(FIRST_POINTS),
            widths: [wide, narrow],
            n_steps: FIRST_STEPS,
            nearest_by: NearestBy::Table,
            every: 3,
        };
        let second = Round {
            ids: self.observed.subset(SECOND_POINTS),
            widths: [1.6 * narrow, 0.7 * narrow],
            n_steps: SECOND_STEPS,
            nearest_by: NearestBy::Table,
            every: 1,
        };
        let third = Round {
            ids: self.observed.subset(THIRD_POINTS),
            widths: [narrow, fine],
            n_steps: THIRD_STEPS,
            nearest_by: NearestBy::Triangles,
            every: 1,
        };
        let n = starts.len();
        let n_all = n + SECOND_POSES + THIRD_POSES;
        let found = self.round(&first, starts, task)?;
        task.step("align", n, n_all)?;
        let second = self.round(&second, distinct(&found, SECOND_POSES), task)?;
        task.step("align", n + SECOND_POSES, n_all)?;
        let third = self.round(&third, distinct(&second, THIRD_POSES), task)?;
        let Some(&ScoredPose { pose: best, score }) = third.first() else { return Ok(None) };
        let least = OTHERS_SCORE * second.first().map_or(0.0, |pose| pose.score);
        let rest = second.into_iter().filter(|pose| pose.score >= least);
        let all: Vec<ScoredPose> = third.into_iter().chain(rest).collect();
        let others = distinct(&all, 1 + OTHERS).split_off(1);
        Ok(Some((SearchResult { best, others, n_starts }, score)))
    }

    /// The poses refined and scored, the highest score first, ties in order.
    fn round(&self, round: &Round, poses: Vec<Sim3>, task: &Task) -> Result<Vec<ScoredPose>> {
        let found: semfm_geom::Result<Vec<Option<ScoredPose>>> = if poses.len() < 3 {
            poses.into_iter().map(|pose| self.refined(round, pose, task)).collect()
        } else {
            poses.into_par_iter().map(|pose| self.refined(round, pose, task)).collect()
        };
        let mut found: Vec<ScoredPose> = found?.into_iter().flatten().collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(found)
    }

    /// `None` for a pose under which nothing matches.
    fn refined(
        &self,
        round: &Round,
        start: Sim3,
        task: &Task,
    ) -> semfm_geom::Result<Option<ScoredPose>> {
        task.check()?;
        let Round { ids, widths, n_steps, nearest_by, every } = round;
        let refined = self.anneal(start, ids, *widths, *n_steps, *nearest_by, &[]);
        Ok(refined.map(|pose| {
            let score = self.score(&pose, ids, *nearest_by, *every);
            ScoredPose { pose, score }
        }))
    }

    /// How much a pose explains: the share of observed points on the model times the share of the
    /// model's visible side that was observed. Every `every`th sample of the model takes part.
    fn score(&self, pose: &Sim3, ids: &[u32], nearest_by: NearestBy, every: usize) -> f64 {
        let width = SCORE_WIDTH * self.observed.diameter();
        let mut on_model = 0.0;
        self.for_each_correspondence(pose, ids, width, nearest_by, |c| {
            on_model +=
                geman_mcclure(c.squared, width) * c.agreement.min(FULL_AGREEMENT) / FULL_AGREEMENT;
        });
        on_model / ids.len().max(1) as f64
            * self.visibility(pose, 2.0 * width, every, false).share()
    }

    /// How the visible side of the model compares with what was observed; with `exact`, rays tell
    /// what the model itself hides. `tolerance` in metres.
    pub fn visibility(&self, pose: &Sim3, tolerance: f64, every: usize, exact: bool) -> Visibility {
        match &self.observed.coverage {
            Coverage::SingleView(silhouette) => {
                silhouette.compare(self.model, pose, tolerance, every, exact)
            }
            Coverage::AllAround { index, spacing } => {
                let mut visibility = Visibility::default();
                for sample in self.model.samples.iter().step_by(3 * every) {
                    let distance = index.nearest(pose.apply(sample.point)).1;
                    if distance <= tolerance + spacing {
                        visibility.explained += 1;
                    } else {
                        visibility.violating += 1;
                    }
                }
                visibility
            }
        }
    }
}

/// The first `n` poses that differ from each other.
fn distinct(found: &[ScoredPose], n: usize) -> Vec<Sim3> {
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

/// Largest distance that a corner of the model's bounding cube moves from one pose to the other, in
/// radii of the first.
fn corner_distance(a: &Sim3, b: &Sim3) -> f64 {
    (0..8)
        .map(|i| {
            let corner = DVec3::from_array([0, 1, 2].map(|k| [-0.6, 0.6][i >> k & 1]));
            a.apply(corner).distance(b.apply(corner)) / a.scale
        })
        .fold(0.0, f64::max)
}
