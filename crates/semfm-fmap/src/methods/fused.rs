//! `fused`, the default: transport starts the map, features steer it, geometry smooths it.
//!
//! The transport plan between the clouds says for each sample of either object which sample of
//! the other it resembles most, given that everything must go somewhere. Those matches, both ways,
//! start a bidirectional ZoomOut (10 → 30) whose search runs in the basis and the features at once;
//! the map transfers the region, a little heat takes out the specks, and the vote is spread along the
//! target's own features ([`propagation`](crate::propagation)). Anchors are not needed. A target that is the source's
//! surface once more ([`congruence`](crate::congruence)) gets the region as it is.

use semfm_geom::Task;

use super::info::{ConfidenceRule, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::votes;
use crate::congruence::Congruence;
use crate::propagation::PropagationSettings;
use crate::settings::{Rule, TransferSettings};
use crate::stages::Stages;
use crate::transport::Plan;
use crate::zoomout::{
    Matches, ZoomOutSettings, point_map, reverse_point_map, zoomout_bidirectional,
};
use crate::{PreparedObject, Result};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "fused",
    summary: "the default: transport starts a map that features steer, the vote is spread along them",
    color: [0, 158, 115],
    features: ViewFeatures::PULLED,
    reads_features: true,
    has_map: true,
    confidence: ConfidenceRule::Evidence,
    settings,
    matched,
    votes: voted,
};

pub(super) fn settings(common: TransferSettings) -> TransferSettings {
    TransferSettings {
        // The optimum is flat: k 20 to 50 and w .5 to 1 are within .02.
        zoomout: ZoomOutSettings { k_start: 10, k_final: 30, step: 5, feature_weight: 1.0 },
        // On the truth itself this heat time costs IoU 0 to .09; .003 on 60 eigenfunctions cost up
        // to .3 on the handle of a kettle.
        diffusion: 0.001,
        propagation: PropagationSettings::default(),
        congruence: 0.004,
        // Once the vote is spread, .4 to .45 are the same on real pairs; .5 costs .01, and .02 on
        // the hardest of the simulated ones.
        threshold: 0.42,
        ..common
    }
}

/// Couple, start, ZoomOut, point map, congruence.
pub(super) fn matched(
    pair: &Pair,
    settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<Matched> {
    let zoomout = &settings.zoomout;
    let plan = pair.couple(stages, task)?; // in place of the paper's anchors (IV-D)
    let (features, matches) = stages.time("start", || (pair.vertex_features(), start(pair, plan)));
    let sides = pair.sampled_sides(&features);
    let (source, target) = (&sides.source, &sides.target);
    let map =
        stages.time("zoomout", || zoomout_bidirectional(matches, source, target, zoomout, task))?; // IV-E
    let weight = zoomout.feature_weight;
    let mut points = stages.time("point_map", || point_map(&map, source, target, weight))?; // IV-E
    let same = || Congruence::of(pair, &points, settings.congruence);
    let congruence = stages.time("congruence", same)?;
    if let Some(congruence) = &congruence {
        congruence.correct(&mut points, &pair.source, &pair.target);
    }
    let reversed = || reverse_point_map(&map, source, target, weight);
    let target_of = match settings.rule {
        Rule::Image => Some(stages.time("point_map", reversed)?),
        Rule::Preimage => None,
    };
    Ok(Matched { target_of, map: Some(map), congruence, ..Matched::points(points) })
}

/// Vote, spread.
pub(super) fn voted(
    pair: &Pair,
    settings: &TransferSettings,
    matched: &Matched,
    inside: &[bool],
) -> Result<Vec<f64>> {
    let votes = votes::by_map(pair, settings, matched, inside)?; // equation 5
    votes::spread(&pair.target, votes, &settings.propagation)
}

/// Matches of both objects' samples, read off the transport plan.
fn start(pair: &Pair, plan: &Plan) -> Matches {
    Matches {
        source_of: partners(&pair.target, &plan.source_of(), &pair.source),
        target_of: partners(&pair.source, &plan.target_of(), &pair.target),
    }
}

/// For each sample of an object a vertex of its partner: vertex → its cloud point → the partner's
/// cloud point → that point's vertex.
fn partners(object: &PreparedObject, partner_point: &[u32], partner: &PreparedObject) -> Vec<u32> {
    let points = object.samples().iter().map(|&v| object.point_of_vertex()[v as usize]);
    let points = points.map(|j| partner_point[j as usize]);
    points.map(|i| partner.vertex_of_point()[i as usize]).collect()
}
