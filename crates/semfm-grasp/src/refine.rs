//! The best of what was found: moved to where each is best in its neighbourhood, and examined on the object as it is.

use std::f64::consts::TAU;

use parry3d_f64::math::Pose;
use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::math::DVec3;

use crate::Result;
use crate::candidate::Candidate;
use crate::grasp::Grasp;
use crate::likely_symmetry::LikelySymmetry;
use crate::neighbours::{steps, turned};
use crate::search::{Found, Near, Search};
use crate::select::best_apart;
use crate::settings::Separation;

/// Grasps that climb by the long steps.
pub(crate) const CLIMBERS: usize = 16;

/// Of those the ones that go on by the short steps.
const FINALISTS: usize = 8;

/// The first climbers begin so many times as far from each other as two grasps must be, so that they are not all on one
/// part: with 1.5 those of a mug all held its body, and its rim, which is better, had none.
const FIRST_APART: f64 = 3.0;

/// The others, and what goes on: nearer ones end in one place.
const APART: f64 = 1.5;

/// Turns of the best grasps about their closing axis that climb, too, over a full turn: what is round or symmetric is
/// held equally well from several sides, and the samples come from only some of them.
const SIDES: usize = 12;

/// Turns of the very best about the axis of revolution: on the rim of a mug they are a millimetre apart, and which of its
/// places is best depends on its triangles.
const FINE_TURNS: usize = 240;

/// Lengths of the steps, as shares of the distance that makes two grasps two: from a centimetre to two and a half
/// millimetres, then to a third of a millimetre.
const LONG_STEPS: [f64; 3] = [1.0, 0.5, 0.25];
/// See [`LONG_STEPS`].
const SHORT_STEPS: [f64; 3] = [0.12, 0.06, 0.03];

/// Directions tried at each length at most, and steps in one direction.
const MOVES: (usize, usize) = (6, 8);

/// A move must raise the score by this: what rounding makes of one and the same grasp is less.
const RISE: f64 = 1e-4;

/// Of grasps found on a simpler surface so many times those asked for are examined on the object itself, and at least
/// so many.
const EXAMINED: (usize, usize) = (10, 200);

impl Search<'_> {
    /// Moves the best grasps to where each is best in its neighbourhood, so that which one is best of all depends on
    /// the object and not on where the samples fell. Grasps that meet on the way become one.
    pub(crate) fn climb(&self, found: Found, task: &Task) -> Result<Found> {
        let Found { kept, n_survivors, sampled } = found;
        if self.settings().neighbour_rounds == 0 {
            return Ok(Found { kept, n_survivors, sampled });
        }
        let Separation { translation, rotation } = self.settings().separation;
        let [far, apart] = [FIRST_APART, APART].map(|times| Separation {
            translation: times * translation,
            rotation: times * rotation,
        });
        let first = self.climbed(&best_apart(&kept, far, CLIMBERS), &LONG_STEPS, task)?;
        let symmetry = LikelySymmetry::of(self.object());
        let candidates = elsewhere(&best_apart(&first, apart, FINALISTS), &symmetry);
        let elsewhere = self.examined(&candidates, task)?;
        let second = self.climbed(&best_apart(&elsewhere, apart, CLIMBERS), &LONG_STEPS, task)?;
        let all = [first, second].concat();
        let third = self.climbed(&best_apart(&all, apart, FINALISTS), &SHORT_STEPS, task)?;
        let around =
            third.first().map(|best| symmetry.around(&Candidate::from_grasp(best), FINE_TURNS));
        let around = self.examined(&around.unwrap_or_default(), task)?;
        let last = self.climbed(&best_apart(&around, apart, FINALISTS), &SHORT_STEPS, task)?;
        let mut kept = self.merged([kept, all, third, last].concat());
        kept.retain(Grasp::is_scored);
        // What climbed passed every check, too.
        Ok(Found { n_survivors: n_survivors.max(kept.len()), kept, sampled })
    }

    /// Each of the grasps moved by steps of these lengths; best first.
    fn climbed(&self, starts: &[Grasp], shares: &[f64], task: &Task) -> Result<Vec<Grasp>> {
        let mut climbed: Vec<Grasp> = starts
            .par_iter()
            .map(|start| task.check().map(|()| self.climbed_from(start, shares)))
            .collect::<std::result::Result<_, _>>()?;
        climbed.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(climbed)
    }

    /// The steepest direction again and again, as far as it leads upwards, with ever shorter steps.
    fn climbed_from(&self, start: &Grasp, shares: &[f64]) -> Grasp {
        let mut best = start.clone();
        let Separation { translation, rotation } = self.settings().separation;
        let (n_directions, n_steps) = MOVES;
        for share in shares {
            let moves = steps(share * translation, share * rotation);
            for _ in 0..n_directions {
                let tried =
                    moves.iter().filter_map(|motion| Some((self.moved(&best, motion)?, *motion)));
                let steepest = tried.reduce(|a, b| if b.0.score > a.0.score { b } else { a });
                let Some((better, motion)) = steepest else { break };
                best = better;
                for _ in 1..n_steps {
                    let Some(better) = self.moved(&best, &motion) else { break };
                    best = better;
                }
            }
        }
        best
    }

    /// The grasp after a motion of its hand, where it is better there.
    fn moved(&self, grasp: &Grasp, motion: &Pose) -> Option<Grasp> {
        let here = Candidate::from_grasp(grasp);
        let least = grasp.score + RISE;
        let moved =
            self.examine_above(&Candidate { tcp: here.tcp * *motion, ..here }, least).ok()?;
        (moved.score > least && moved.is_scored()).then_some(moved)
    }

    /// Those of the candidates that pass every check.
    fn examined(&self, candidates: &[Candidate], task: &Task) -> Result<Vec<Grasp>> {
        let examined: Vec<Option<Grasp>> = candidates
            .par_iter()
            .map(|candidate| task.check().map(|()| self.examine(candidate).ok()))
            .collect::<std::result::Result<_, _>>()?;
        Ok(examined.into_iter().flatten().collect())
    }

    /// How many grasps are to pass on the object as it is, where contacts are sought on a simpler surface.
    pub(crate) fn n_examined_exactly(&self) -> Option<usize> {
        let (times, least) = EXAMINED;
        let wanted = self.settings().top.saturating_mul(times).max(least);
        self.object().is_simplified().then_some(wanted)
    }

    /// Where contacts were sought on a simpler surface: the best grasps (`all` of them, or a multiple of those asked
    /// for), closed and examined on the object as it is. Others are left out.
    pub(crate) fn on_exact_surface(&self, found: Found, all: bool, task: &Task) -> Result<Found> {
        if !self.object().is_simplified() {
            return Ok(found);
        }
        let Found { kept, mut n_survivors, mut sampled } = found;
        let wanted = self.n_examined_exactly().filter(|_| !all).unwrap_or(usize::MAX);
        let mut exact = Vec::new();
        for part in kept.chunks(EXAMINED.1) {
            let results: Vec<std::result::Result<Grasp, Box<Near>>> = part
                .par_iter()
                .map(|grasp| task.check().map(|()| self.examine_exactly(grasp)))
                .collect::<std::result::Result<_, _>>()?;
            for result in results {
                match result {
                    Ok(grasp) => exact.push(grasp),
                    Err(near) => {
                        n_survivors -= 1;
                        sampled.refuse(*near);
                    }
                }
            }
            if exact.len() >= wanted {
                break;
            }
        }
        exact.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(Found { kept: exact, n_survivors, sampled })
    }
}

/// Where else grasps as good as the best may be: the same contacts with the hand turned about them, and its images under
/// the object's likely symmetries.
fn elsewhere(best: &[Grasp], symmetry: &LikelySymmetry) -> Vec<Candidate> {
    let turns = (1..SIDES).map(|k| turned(TAU * k as f64 / SIDES as f64, DVec3::Y));
    let turns: Vec<Pose> = turns.collect();
    let of = |here: Candidate| {
        let sides = turns.iter().map(move |turn| Candidate { tcp: here.tcp * *turn, ..here });
        sides.chain(symmetry.images(&here))
    };
    best.iter().map(Candidate::from_grasp).flat_map(of).collect()
}
