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

/// A pair by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PairKey<'a> {
    /// Group of the pair; objects are drawn within it.
    pub group: &'a str,
    /// Name of the source.
    pub source: &'a str,
    /// Name of the target.
    pub target: &'a str,
}

/// A weight for every pair in every resampling.
pub struct PairDraws {
    /// Whether there are objects enough to say anything.
    enough: bool,
    level: f64,
    weights: Vec<Vec<f64>>,
}

impl PairDraws {
    /// Draws for these pairs.
    pub fn new(pairs: &[PairKey<'_>], settings: &BootstrapSettings) -> Self {
        let mut groups = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
        for pair in pairs {
            let objects = groups.entry(pair.group).or_default();
            for object in [pair.source, pair.target] {
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
                // w_p = c(source of p) · c(target of p), c counting how often an object was drawn.
                pairs
                    .iter()
                    .map(|pair| {
                        let (places, counts) = (&groups[pair.group], &counts[pair.group]);
                        f64::from(counts[places[pair.source]] * counts[places[pair.target]])
                    })
                    .collect()
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
        // Percentile interval: the quantiles at (1 − level) / 2 and 1 − (1 − level) / 2.
        let tail = (1.0 - self.level) / 2.0;
        Some([quantile(&values, tail), quantile(&values, 1.0 - tail)])
    }
}

/// The value at this share of an ascending list, which is not empty.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// How often each of `n` things was drawn in `n` draws.
fn draw(n: usize, rng: &mut ChaCha8Rng) -> Vec<u32> {
    let mut counts = vec![0; n];
    (0..n).for_each(|_| counts[rng.random_range(0..n)] += 1);
    counts
}

/// Σ wᵢ xᵢ / Σ wᵢ over the values xᵢ that are there.
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

    fn all_pairs(objects: &[String]) -> Vec<PairKey<'_>> {
        let pairs = objects.iter().flat_map(|source| {
            objects.iter().map(move |target| PairKey { group: "g", source, target })
        });
        pairs.filter(|pair| pair.source != pair.target).collect()
    }

    #[test]
    fn an_interval_holds_the_mean_and_shrinks_with_more_objects() {
        fn width(n: usize) -> f64 {
            let objects: Vec<String> = (0..n).map(|i| i.to_string()).collect();
            let pairs = all_pairs(&objects);
            // The target decides the score: only objects, not pairs, are independent.
            let values: Vec<Option<f64>> = pairs
                .iter()
                .map(|pair| Some(f64::from(pair.target.parse::<u8>().unwrap() % 2)))
                .collect();
            let draws = PairDraws::new(&pairs, &BootstrapSettings::default());
            let [low, high] = draws.interval(|w| weighted_mean(&values, w)).unwrap();
            let mean = weighted_mean(&values, &vec![1.0; pairs.len()]).unwrap();
            assert!(low < mean && mean < high, "{low} {mean} {high}");
            high - low
        }
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
        let [first, again, other] = [3, 3, 4].map(|seed| {
            let settings = BootstrapSettings { seed, ..BootstrapSettings::default() };
            PairDraws::new(&pairs, &settings).interval(|w| weighted_mean(&values, w))
        });
        assert_eq!(first, again);
        assert_ne!(first, other);
        let draws = PairDraws::new(&pairs, &BootstrapSettings::default());
        assert_eq!(draws.interval(|w| weighted_mean(&vec![None; pairs.len()], w)), None);
    }
}
