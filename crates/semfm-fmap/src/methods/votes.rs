//! Votes: how strongly each working vertex of the target is meant by a region on the source.

use semfm_geom::Shape;

use super::info::Matched;
use super::pair::Pair;
use crate::propagation::{PropagationSettings, propagate};
use crate::settings::{Rule, TransferSettings};
use crate::{PreparedObject, Region, Result};

/// The region (`inside`, n_source) as a map transfers it, smoothed by heat where the settings say so
/// (n_target).
pub(crate) fn by_map(
    pair: &Pair,
    settings: &TransferSettings,
    matched: &Matched,
    inside: &[bool],
) -> Result<Vec<f64>> {
    let target = pair.target.shape();
    let hit = match (settings.rule, &matched.target_of) {
        (Rule::Image, Some(target_of)) => image(target, target_of, inside),
        _ => preimage(matched, inside),
    };
    if settings.diffusion == 0.0 { Ok(hit) } else { pair.target.smooth(&hit, settings.diffusion) }
}

/// [`by_map`], and then [`spread`] along the target's features.
pub(super) fn by_map_spread(
    pair: &Pair,
    settings: &TransferSettings,
    matched: &Matched,
    inside: &[bool],
) -> Result<Vec<f64>> {
    spread(&pair.target, by_map(pair, settings, matched, inside)?, &settings.propagation)
}

/// 1 where the source vertex of a target vertex is inside.
fn preimage(matched: &Matched, inside: &[bool]) -> Vec<f64> {
    matched.point_map.pull_back(inside).into_iter().map(|b| f64::from(u8::from(b))).collect()
}

/// 1 where a source vertex inside is sent to.
fn image(target: &Shape, target_of: &[u32], inside: &[bool]) -> Vec<f64> {
    let mut hit = vec![0.0; target.mesh().n_vertices()];
    for (&j, _) in target_of.iter().zip(inside).filter(|(_, inside)| **inside) {
        hit[j as usize] = 1.0;
    }
    hit
}

/// A vote on the target's working vertices, spread along its features (n_target).
pub(super) fn spread(
    target: &PreparedObject,
    votes: Vec<f64>,
    settings: &PropagationSettings,
) -> Result<Vec<f64>> {
    if settings.weight == 0.0 {
        return Ok(votes);
    }
    let vertices = target.vertex_of_point().iter();
    let on_points: Vec<f64> = vertices.map(|&v| votes[v as usize].clamp(0.0, 1.0)).collect();
    let spread = propagate(target.graph()?, target.masses(), &on_points, settings)?;
    Ok(target.onto_vertices(&spread))
}

/// 1 at the source's cloud points (M_source) that are inside, 0 elsewhere.
pub(crate) fn on_points(source: &PreparedObject, inside: &[bool]) -> Vec<f64> {
    source.vertex_of_point().iter().map(|&v| f64::from(u8::from(inside[v as usize]))).collect()
}

/// Votes in [0, 1], mapped so that `threshold` comes to [`Region::COUNTS`].
pub(crate) fn at_threshold(votes: &[f64], threshold: f64) -> Vec<f64> {
    votes.iter().map(|&vote| rescale(vote, threshold)).collect()
}

/// c + (1 − c) (v − θ)/(1 − θ) from the threshold θ on, c v/θ below it, with c = [`Region::COUNTS`].
fn rescale(vote: f64, threshold: f64) -> f64 {
    let vote = vote.clamp(0.0, 1.0);
    let c = Region::COUNTS;
    if vote >= threshold {
        (c + (1.0 - c) * (vote - threshold) / (1.0 - threshold)).min(1.0)
    } else {
        // Rounding must not lift a vote below the threshold onto it.
        (c * vote / threshold).min(c.next_down())
    }
}

/// Which votes count.
pub(crate) fn mask(votes: &[f64]) -> Vec<bool> {
    votes.iter().map(|&v| v >= Region::COUNTS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_mapped_to_one_half() {
        let mapped = at_threshold(&[0.0, 0.2, 0.4, 0.7, 1.0, 1.3, -0.1], 0.4);
        for (x, expected) in mapped.iter().zip([0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 0.0]) {
            assert!((x - expected).abs() < 1e-12, "{x} for {expected}");
        }
        assert!(at_threshold(&[0.4f64.next_down()], 0.4)[0] < Region::COUNTS);
    }
}
