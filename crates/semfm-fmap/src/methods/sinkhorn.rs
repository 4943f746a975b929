//! `sinkhorn`: the transport between the clouds alone.

use semfm_geom::Task;

use super::info::{ConfidenceRule, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::votes;
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::{PointMap, Result};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "sinkhorn",
    summary: "unbalanced transport between the clouds, no map",
    color: [86, 180, 233],
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

/// Each vertex goes to the vertex of the source point that its own nearest point gets most of its
/// mass from.
fn matched(
    pair: &Pair,
    _settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<Matched> {
    let plan = pair.couple(stages, task)?;
    let source_of = pair.through_points(&plan.source_of());
    Ok(Matched::points(PointMap { source_of }))
}

fn voted(
    pair: &Pair,
    settings: &TransferSettings,
    _matched: &Matched,
    inside: &[bool],
) -> Result<Vec<f64>> {
    let plan = pair.couple(&mut Stages::default(), &Task::default())?; // made by `matched`
    let on_points = plan.vote(&votes::on_points(&pair.source, inside));
    votes::spread(&pair.target, pair.target.onto_vertices(&on_points), &settings.propagation)
}
