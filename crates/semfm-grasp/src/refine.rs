//! The best of what was found: moved to where each is best in its neighbourhood, and examined on the object as it is.

use parry3d_f64::math::Pose;
use rayon::prelude::*;
use semfm_geom::Task;

use crate::Result;
use crate::candidate::Candidate;
use crate::grasp::Grasp;
use crate::neighbours::steps;
use crate::search::{Found, Near, Search};
use crate::select::suppress;
use crate::settings::Separation;

/// Grasps that climb: 32 take 1.7 s where a whole search takes 10, and end where 10 do.
pub(crate) const CLIMBERS: usize = 10;

/// Lengths of the steps, as shares of the distance that makes two grasps two: from a centimetre to a millimetre.
const STEPS: [f64; 4] = [1.0, 0.5, 0.25, 0.12];

/// Moves at each length at most.
const MOVES: usize = 6;

/// A move must raise the score by this: what rounding makes of one and the same grasp is less.
const RISE: f64 = 1e-4;

/// Of grasps found on a simpler surface so many times those asked for are examined on the object itself, and at least
/// so many.
const EXAMINED: (usize, usize) = (10, 200);

impl Search<'_> {
    /// Moves the best grasps to where each is best in its neighbourhood, so that which one is best of all depends on
    /// the object and not on where the samples fell. Grasps that meet on the way become one.
    pub(crate) fn climb(&self, found: Found, task: &Task) -> Result<Found> {
        let Found { mut kept, n_survivors, sampled } = found;
        if self.settings().neighbour_rounds == 0 {
            return Ok(Found { kept, n_survivors, sampled });
        }
        let climbed: Vec<Grasp> = kept[..kept.len().min(CLIMBERS)]
            .par_iter()
            .map(|grasp| task.check().map(|()| self.climbed(grasp)))
            .collect::<std::result::Result<_, _>>()?;
        kept.splice(..climbed.len(), climbed);
        // What climbed has merged others, so that grasps with only a bound may be returned after all.
        let mut kept = self.scored(suppress(kept, self.settings().separation));
        kept.retain(Grasp::is_scored);
        Ok(Found { kept, n_survivors, sampled })
    }

    /// The steepest of the neighbours, again and again, with ever shorter steps.
    fn climbed(&self, start: &Grasp) -> Grasp {
        let mut best = start.clone();
        for share in STEPS {
            let Separation { translation, rotation } = self.settings().separation;
            let moves = steps(share * translation, share * rotation);
            for _ in 0..MOVES {
                let Some(better) = self.best_neighbour(&best, &moves) else { break };
                best = better;
            }
        }
        best
    }

    fn best_neighbour(&self, grasp: &Grasp, moves: &[Pose]) -> Option<Grasp> {
        let here = Candidate::again(grasp);
        let least = grasp.score + RISE;
        let tried = moves.iter().filter_map(|motion| {
            self.examine_above(&Candidate { tcp: here.tcp * *motion, ..here }, least).ok()
        });
        let best = tried.reduce(|a, b| if b.score > a.score { b } else { a })?;
        (best.score > least).then_some(best)
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
