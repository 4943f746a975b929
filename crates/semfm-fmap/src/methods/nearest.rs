//! `nearest`: the vote of the nearest points in feature space.

use semfm_geom::Task;

use super::info::{ConfidenceRule, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::votes;
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::{PointMap, Result};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "nearest",
    summary: "the vote of the nearest points in feature space, no map",
    color: [230, 159, 0],
    features: ViewFeatures::PULLED,
    reads_features: true,
    has_map: false,
    confidence: ConfidenceRule::Agreement,
    settings,
    matched,
    votes: voted,
};

fn settings(common: TransferSettings) -> TransferSettings {
    TransferSettings { second_opinion: false, ..common }
}

/// Each vertex goes to the vertex of the source point nearest to its own nearest point.
fn matched(
    pair: &Pair,
    _settings: &TransferSettings,
    stages: &mut Stages,
    _task: &Task,
) -> Result<Matched> {
    let nearest = stages.time("neighbours", || pair.nearest_source_points().nearest());
    Ok(Matched::points(PointMap { source_of: pair.through_points(&nearest) }))
}

fn voted(
    pair: &Pair,
    settings: &TransferSettings,
    _matched: &Matched,
    inside: &[bool],
) -> Result<Vec<f64>> {
    let on_source = votes::on_points(&pair.source, inside);
    let on_target = pair.nearest_source_points().vote(&on_source);
    votes::spread(&pair.target, pair.target.onto_vertices(&on_target), &settings.propagation)
}
