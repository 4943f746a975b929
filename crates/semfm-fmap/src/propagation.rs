//! A vote, spread along the target's own surface up to where its features change.
//!
//! A map transfers the share of a region well and its outline badly: a grip that is 65 % of one tool
//! arrives as 65 % of the next, whatever that one's handle measures. The target's own features show
//! where its parts end, and between two points of one object there is no gap between domains. So
//! the vote s (one value per cloud point) is replaced by the x that stays close to it and changes
//! only where the features do:
//!
//! min Σ cᵢ (xᵢ − sᵢ)² + λ Σ wᵢⱼ (xᵢ − xⱼ)²
//!
//! over the neighbour graph, wᵢⱼ = exp(−‖fᵢ − fⱼ‖²/σ²): the local and global consistency of Zhou,
//! Bousquet, Lal, Weston & Schölkopf 2004, that is the random walker of Grady 2006 with soft seeds.
//!
//! Ours is the balance cᵢ = mᵢ (sᵢ/π + (1 − sᵢ)/(1 − π))/2 with m the mass of a point (mean 1) and
//! π the mean vote: inside and outside then weigh the same. Without it the many outside drain the
//! few inside (a cup's handle is 6 % of its surface: IoU .96 became .88 at λ = 100).

use faer::Mat;
use semfm_geom::SparseCholesky;
use serde::{Deserialize, Serialize};

use crate::neighbour_graph::NeighbourGraph;
use crate::{Error, Result};

/// π is kept this far from 0 and 1, so that a handful of stray votes cannot outweigh the rest.
const LEAST_SHARE: f64 = 0.005;

/// How a vote is spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PropagationSettings {
    /// λ/M: weight of agreeing with one's neighbours beside agreeing with the vote; 0 leaves the vote
    /// as it is. λ grows with the number of points M, so that the reach along the surface does not
    /// change with it: with more points there are more edges along the same way. Mean IoU of real
    /// pairs: .789 at 0, .807 at .03, .816 at .08, .817 at .16, where small parts begin to be lost
    /// (share below .3: .019 at .08, .029 at .16).
    pub weight: f64,
    /// σ² in units of the median squared difference of features between neighbours. .3 holds the
    /// vote back everywhere (.809), 1 leaks over the edges of parts (.815, share below .3 .029).
    pub contrast: f64,
}

impl Default for PropagationSettings {
    fn default() -> Self {
        Self { weight: 0.08, contrast: 0.5 }
    }
}

/// Spreads `votes` (M, in [0, 1]) over the graph of points with `masses` (M, positive).
///
/// The result (M) lies in the range of the votes.
///
/// # Errors
/// [`Error::Geom`] where the system cannot be factorised.
pub(crate) fn propagate(
    graph: &NeighbourGraph,
    masses: &[f64],
    votes: &[f64],
    settings: &PropagationSettings,
) -> Result<Vec<f64>> {
    Error::length("votes on the cloud", masses.len(), votes.len())?;
    let mean_mass = masses.iter().sum::<f64>() / masses.len() as f64;
    let voted: f64 = masses.iter().zip(votes).map(|(m, s)| m * s).sum();
    let share = (voted / (mean_mass * masses.len() as f64)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
    // cᵢ = mᵢ (sᵢ/π + (1 − sᵢ)/(1 − π))/2
    let ties: Vec<f64> = masses
        .iter()
        .zip(votes)
        .map(|(m, &s)| m / mean_mass * ((s / share + (1.0 - s) / (1.0 - share)) / 2.0))
        .collect();
    let (mut system, _) = graph.laplacian(settings.contrast)?;
    let (pattern, values) = system.parts_mut();
    let weight = settings.weight * masses.len() as f64;
    for (j, tie) in ties.iter().enumerate() {
        for at in pattern.col_range(j) {
            let own = if pattern.row_idx()[at] == j { *tie } else { 0.0 };
            values[at] = weight * values[at] + own;
        }
    }
    let mut x = Mat::from_fn(votes.len(), 1, |i, _| ties[i] * votes[i]);
    SparseCholesky::new(system.as_ref())?.solve_in_place(x.as_mut());
    Ok(x.col(0).iter().copied().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    /// A strip of 100 × 3 points whose features change at x = `edge`.
    fn strip(edge: usize) -> NeighbourGraph {
        let points: Vec<DVec3> =
            (0..300).map(|i| DVec3::new(f64::from(i / 3), f64::from(i % 3), 0.0)).collect();
        let features: Vec<f64> = (0..300)
            .map(|i| f64::from(u8::from(i / 3 >= edge)) + 0.1 * (i as f64 * 7.0).sin())
            .collect();
        NeighbourGraph::new(&points, 8, |i, j| (features[i] - features[j]).powi(2)).unwrap()
    }

    fn votes(until: usize) -> Vec<f64> {
        (0..300).map(|i| f64::from(u8::from(i / 3 < until))).collect()
    }

    #[test]
    fn the_outline_moves_to_where_the_features_change() {
        // Two columns beyond the edge are cut off, two short of it filled up.
        for found in [38, 42] {
            let spread =
                propagate(&strip(40), &[1.0; 300], &votes(found), &PropagationSettings::default())
                    .unwrap();
            for (i, x) in spread.iter().enumerate() {
                assert_eq!(*x >= 0.5, i / 3 < 40, "{found}: {x} in column {}", i / 3);
                assert!((-1e-9..=1.0 + 1e-9).contains(x));
            }
        }
    }

    #[test]
    fn a_small_part_is_not_drained_by_the_large_rest() {
        let settings = PropagationSettings::default();
        let spread = propagate(&strip(5), &[1.0; 300], &votes(5), &settings).unwrap();
        assert!((0..300).all(|i| (spread[i] >= 0.42) == (i / 3 < 5)), "{spread:?}");
    }

    #[test]
    fn weight_zero_changes_nothing_and_unanimous_votes_stay() {
        let (graph, masses) = (strip(40), [1.0; 300]);
        let still = PropagationSettings { weight: 0.0, ..PropagationSettings::default() };
        let same = propagate(&graph, &masses, &votes(20), &still).unwrap();
        assert!(same.iter().zip(votes(20)).all(|(x, s)| (x - s).abs() < 1e-12));
        for all in [0.0, 1.0] {
            let spread = propagate(&graph, &masses, &[all; 300], &PropagationSettings::default());
            assert!(spread.unwrap().iter().all(|x| (x - all).abs() < 1e-9));
        }
        assert!(propagate(&graph, &masses, &[0.0; 7], &still).is_err());
    }
}
