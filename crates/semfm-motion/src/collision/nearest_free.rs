//! Free joint values near ones that are not: what to offer for a start in collision.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::checker::CollisionChecker;

/// Radii of the search, radians or metres: each is this much larger than the one before.
const GROWTH: f64 = 1.5;
/// The smallest radius.
const FIRST_RADIUS: f64 = 0.01;
/// How many radii: the last is 1.3 rad.
const N_RADII: usize = 13;
/// Tries at each radius. 100 find a way out of a shelf's board for 19 of 20 arms; 400 for all that were tried.
const N_TRIES: usize = 400;
/// Halvings of the way back towards the start.
const N_HALVINGS: usize = 20;

impl CollisionChecker {
    /// Free joint values within the arm's limits near `q`, which need not be free: of the random states that were tried
    /// at the least distance at which one is free, the nearest to `q`, moved back towards it as far as it stays free.
    /// Distances are Euclidean in joint values. `q` itself where it is free; `None` where no state within 1.3 rad is
    /// found. The same seed gives the same answer.
    pub fn nearest_free(&self, q: &[f64], seed: u64) -> Option<Vec<f64>> {
        if !self.is_sound(q) {
            return None;
        }
        if self.is_within_limits(q) && self.is_free(q) {
            return Some(q.to_vec());
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut radius = FIRST_RADIUS;
        for _ in 0..N_RADII {
            let tries = (0..N_TRIES).map(|_| self.near(q, radius, &mut random));
            let nearest = tries
                .filter(|state| self.is_free(state))
                .map(|state| (distance(&state, q), state))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, state)) = nearest {
                return Some(self.moved_back(state, q));
            }
            radius *= GROWTH;
        }
        None
    }

    /// A random state in the cube of that half edge around `q`, and within limits.
    fn near(&self, q: &[f64], radius: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
        let joints = self.model().arm().joints();
        q.iter()
            .zip(joints)
            .map(|(value, joint)| {
                let share: f64 = random.random();
                (value + radius * (2.0 * share - 1.0)).max(joint.lower).min(joint.upper)
            })
            .collect()
    }

    /// The free state on the way from a free state to `q` that is nearest to `q`, by halving.
    fn moved_back(&self, free: Vec<f64>, q: &[f64]) -> Vec<f64> {
        let at = |share: f64| -> Vec<f64> {
            free.iter().zip(q).map(|(free, q)| free + share * (q - free)).collect()
        };
        let (mut good, mut bad) = (0.0, 1.0);
        for _ in 0..N_HALVINGS {
            let middle = f64::midpoint(good, bad);
            let state = at(middle);
            if self.is_within_limits(&state) && self.is_free(&state) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        at(good)
    }

    fn is_within_limits(&self, q: &[f64]) -> bool {
        self.model().arm().check_positions("state", q).is_ok()
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}
