//! k-means with k-means++ seeding (Lloyd 1982; Arthur & Vassilvitskii 2007), seeded.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Lloyd iterations per start; clusters of a thousand points are stationary within twenty.
const ITERATIONS: usize = 300;

/// Labels (n) of `points` (n rows of length `dim`, row-major) in at most `k` clusters: the best of
/// `starts` seedings by inertia. The same seed gives the same labels.
pub(crate) fn k_means(points: &[f64], dim: usize, k: usize, starts: usize, seed: u64) -> Vec<u32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let runs = (0..starts.max(1)).map(|_| {
        let centres = plus_plus(points, dim, k, &mut rng);
        lloyd(points, dim, centres)
    });
    let best = runs.min_by(|a, b| a.inertia.total_cmp(&b.inertia));
    best.map(|best| best.labels).unwrap_or_default()
}

/// Seeds drawn in proportion to the squared distance from those before; of a few trials each, the
/// one that leaves the least (the greedy variant of the authors' own code).
fn plus_plus(points: &[f64], dim: usize, k: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = points.len() / dim;
    let trials = 2 + (k as f64).ln() as usize;
    let first = row(points, dim, rng.random_range(0..n));
    let mut centres = first.to_vec();
    let mut left: Vec<f64> = points.chunks(dim).map(|p| squared(p, first)).collect();
    for _ in 1..k {
        let total: f64 = left.iter().sum();
        let candidates: Vec<usize> = (0..trials).map(|_| draw(&left, total, rng)).collect();
        let trials = candidates.iter().map(|&c| Trial::new(points, dim, &left, c));
        let Some(best) = trials.min_by(|a, b| a.inertia.total_cmp(&b.inertia)) else { break };
        centres.extend_from_slice(row(points, dim, best.centre));
        left = best.left;
    }
    centres
}

fn row(points: &[f64], dim: usize, i: usize) -> &[f64] {
    &points[i * dim..][..dim]
}

/// An index in proportion to its weight; the weights sum to `total`.
fn draw(weights: &[f64], total: f64, rng: &mut ChaCha8Rng) -> usize {
    let mut pick = rng.random::<f64>() * total;
    let drawn = weights.iter().position(|&weight| {
        pick -= weight;
        pick < 0.0
    });
    drawn.unwrap_or(weights.len() - 1)
}

/// One more centre and what it would leave.
struct Trial {
    centre: usize,
    /// Squared distance of each point to its nearest centre.
    left: Vec<f64>,
    inertia: f64,
}

impl Trial {
    fn new(points: &[f64], dim: usize, left: &[f64], centre: usize) -> Self {
        let at = row(points, dim, centre);
        let pairs = left.iter().zip(points.chunks(dim));
        let left: Vec<f64> = pairs.map(|(&d, p)| d.min(squared(p, at))).collect();
        Self { centre, inertia: left.iter().sum(), left }
    }
}

/// A fixed point of Lloyd's iteration.
struct Clustering {
    /// Sum of squared distances to the nearest centres.
    inertia: f64,
    labels: Vec<u32>,
}

/// The fixed point reached from `centres`.
fn lloyd(points: &[f64], dim: usize, mut centres: Vec<f64>) -> Clustering {
    let k = centres.len() / dim;
    let mut labels = Vec::new();
    for _ in 0..ITERATIONS {
        let next: Vec<u32> = points.chunks(dim).map(|p| nearest(p, &centres, dim).0).collect();
        if next == labels {
            break;
        }
        labels = next;
        let (mut sums, mut counts) = (vec![0.0; k * dim], vec![0.0; k]);
        for (p, &l) in points.chunks(dim).zip(&labels) {
            counts[l as usize] += 1.0;
            sums[l as usize * dim..][..dim].iter_mut().zip(p).for_each(|(s, x)| *s += x);
        }
        // A cluster that lost all its points keeps its centre, and may win some back.
        for c in (0..k).filter(|&c| counts[c] > 0.0) {
            for (centre, sum) in centres[c * dim..][..dim].iter_mut().zip(&sums[c * dim..]) {
                *centre = sum / counts[c];
            }
        }
    }
    let inertia = points.chunks(dim).map(|p| nearest(p, &centres, dim).1).sum();
    Clustering { inertia, labels }
}

fn nearest(point: &[f64], centres: &[f64], dim: usize) -> (u32, f64) {
    let mut best = (0, f64::INFINITY);
    for (c, centre) in (0..).zip(centres.chunks(dim)) {
        let distance = squared(point, centre);
        if distance < best.1 {
            best = (c, distance);
        }
    }
    best
}

fn squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_groups_are_separated_whatever_the_seed() {
        let points: Vec<f64> =
            (0..90).flat_map(|i| [f64::from(i % 3) * 10.0, f64::from(i / 3) * 0.01]).collect();
        for seed in 0..5 {
            let labels = k_means(&points, 2, 3, 2, seed);
            assert!((0..90).all(|i| labels[i] == labels[i % 3]));
            assert!(labels[0] != labels[1] && labels[1] != labels[2] && labels[0] != labels[2]);
            assert_eq!(labels, k_means(&points, 2, 3, 2, seed));
        }
    }

    #[test]
    fn points_on_one_spot_make_one_cluster_and_no_error() {
        let labels = k_means(&[1.0; 20], 2, 4, 3, 0);
        assert!(labels.iter().all(|&l| l == labels[0]));
    }
}
