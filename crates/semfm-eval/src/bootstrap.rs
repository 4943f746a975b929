//! Intervals by resampling objects (Efron & Tibshirani 1993).
//!
//! Pairs that share an object are not independent, so objects are drawn, with replacement and group
//! by group, and a pair weighs as often as its source times as often as its target was drawn.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Two or three objects, drawn again, give the same pairs over and over: an interval of no width.
const LEAST_OBJECTS: usize = 4;

/// How intervals are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BootstrapSettings {
    /// Number of resamplings. The ends of an interval wander by about .002 with 2000.
    pub draws: usize,
    /// Share of the resamplings that an interval holds.
    pub level: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for BootstrapSettings {
    fn default() -> Self {
        Self { draws: 2000, level: 0.95, seed: 0 }
    }
}

/// A weight for every pair in every resampling.
pub struct PairDraws {
    /// Whether there are objects enough to say anything.
    enough: bool,
    level: f64,
    weights: Vec<Vec<f64>>,
}

impl PairDraws {
    /// Draws for pairs named by group, source and target.
    pub fn new(pairs: &[[&str; 3]], settings: &BootstrapSettings) -> Self {
        let mut groups = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
        for [group, source, target] in pairs {
            let objects = groups.entry(group).or_default();
            for object in [source, target] {
                let next = objects.len();
                objects.entry(object).or_insert(next);
            }
        }
        let enough = groups.values().map(BTreeMap::len).sum::<usize>() >= LEAST_OBJECTS;
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let weights = (0..settings.draws)
            .map(|_| {
                let counts: BTreeMap<&str, Vec<u32>> = groups
                    .iter()
                    .map(|(&name, objects)| (name, draw(objects.len(), &mut rng)))
                    .collect();
                let weigh = |[group, source, target]: &[&str; 3]| {
                    let (places, counts) = (&groups[group], &counts[group]);
                    f64::from(counts[places[source]] * counts[places[target]])
                };
                pairs.iter().map(weigh).collect()
            })
            .collect();
        Self { enough, level: settings.level, weights }
    }

    /// The interval of a statistic that takes one weight per pair; none where there are fewer than
    /// four objects, or half of the resamplings lack the statistic.
    pub fn interval(&self, statistic: impl Fn(&[f64]) -> Option<f64>) -> Option<[f64; 2]> {
        let mut values: Vec<f64> = self.weights.iter().filter_map(|w| statistic(w)).collect();
        if !self.enough || values.is_empty() || values.len() * 2 < self.weights.len() {
            return None;
        }
        values.sort_by(f64::total_cmp);
        let tail = (1.0 - self.level) / 2.0;
        let at = |share: f64| values[((values.len() - 1) as f64 * share).round() as usize];
        Some([at(tail), at(1.0 - tail)])
    }
}

/// How often each of `n` things was drawn in `n` draws.
fn draw(n: usize, rng: &mut ChaCha8Rng) -> Vec<u32> {
    let mut counts = vec![0; n];
    (0..n).for_each(|_| counts[rng.random_range(0..n)] += 1);
    counts
}

/// Weighted mean of the values that are there.
pub(crate) fn weighted_mean(values: &[Option<f64>], weights: &[f64]) -> Option<f64> {
    let (mut sum, mut total) = (0.0, 0.0);
    for (value, weight) in values.iter().zip(weights) {
        if let Some(value) = value {
            sum += weight * value;
            total += weight;
        }
    }
    (total > 0.0).then(|| sum / total)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_pairs(objects: &[String]) -> Vec<[&str; 3]> {
        let pairs =
            objects.iter().flat_map(|a| objects.iter().map(move |b| ["g", a.as_str(), b.as_str()]));
        pairs.filter(|[_, a, b]| a != b).collect()
    }

    #[test]
    fn an_interval_holds_the_mean_and_shrinks_with_more_objects() {
        let width = |n: usize| {
            let objects: Vec<String> = (0..n).map(|i| i.to_string()).collect();
            let pairs = all_pairs(&objects);
            // The target decides the score: only objects, not pairs, are independent.
            let values: Vec<Option<f64>> = pairs
                .iter()
                .map(|[_, _, b]| Some(f64::from(b.parse::<u8>().unwrap() % 2)))
                .collect();
            let draws = PairDraws::new(&pairs, &BootstrapSettings::default());
            let [low, high] = draws.interval(|w| weighted_mean(&values, w)).unwrap();
            let mean = weighted_mean(&values, &vec![1.0; pairs.len()]).unwrap();
            assert!(low < mean && mean < high, "{low} {mean} {high}");
            high - low
        };
        let (few, many) = (width(6), width(40));
        assert!(many < 0.6 * few, "{many} {few}");
        // Forty fair coins: the mean's 95 % interval is 2 · 1.96 · √(.25/40) = .31 wide.
        assert!((many - 0.31).abs() < 0.05, "{many}");
    }

    #[test]
    fn the_same_seed_gives_the_same_interval_and_nothing_gives_none() {
        let objects: Vec<String> = (0..5).map(|i| i.to_string()).collect();
        let pairs = all_pairs(&objects);
        let values: Vec<Option<f64>> = (0..pairs.len()).map(|i| Some(i as f64)).collect();
        let interval = |seed| {
            let settings = BootstrapSettings { seed, ..BootstrapSettings::default() };
            PairDraws::new(&pairs, &settings).interval(|w| weighted_mean(&values, w))
        };
        assert_eq!(interval(3), interval(3));
        assert_ne!(interval(3), interval(4));
        let draws = PairDraws::new(&pairs, &BootstrapSettings::default());
        assert_eq!(draws.interval(|w| weighted_mean(&vec![None; pairs.len()], w)), None);
    }
}
