//! `anchored`: the paper's anchors, refined with features.
//!
//! The same two anchors start the map, but ZoomOut's search runs in the basis *and* the features
//! (w = .5; the largest single gain there is: IoU .56 → .75), on 600 farthest-point vertices, and the
//! vote is smoothed by heat.

use semfm_geom::Task;

use super::info::{ConfidenceRule, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::semfm::{LabelledBasis, anchor_fit};
use super::votes;
use crate::Result;
use crate::settings::{Rule, TransferSettings};
use crate::stages::Stages;
use crate::zoomout::{MapSide, ZoomOutSettings, point_map, reverse_point_map, zoomout};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "anchored",
    summary: "the paper's anchors, then features and heat",
    color: [204, 121, 167],
    features: ViewFeatures::PULLED,
    reads_features: true,
    has_map: true,
    confidence: ConfidenceRule::Agreement,
    settings,
    matched,
    votes: votes::by_map_spread,
};

fn settings(common: TransferSettings) -> TransferSettings {
    TransferSettings {
        zoomout: ZoomOutSettings { k_start: 20, k_final: 50, step: 5, feature_weight: 0.5 },
        diffusion: 0.001, // as `fused`
        ..common
    }
}

fn matched(
    pair: &Pair,
    settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<Matched> {
    let clustered = stages.time("anchors", || pair.select_anchors(task))?;
    let features = pair.vertex_features();
    let sides = pair.sampled_sides(&features);
    let (source, target) = (&sides.source, &sides.target);
    let labels = clustered.vertex_labels(pair);
    let fit = stages.time("fit", || {
        anchor_fit(
            LabelledBasis { basis: source.basis, labels: &labels.source },
            LabelledBasis { basis: target.basis, labels: &labels.target },
            &clustered.anchors,
            settings,
            task,
        )
    })?;
    // Samples of the target find their match among all vertices of the source.
    let among = MapSide { samples: &[], ..*source };
    let map =
        stages.time("zoomout", || zoomout(fit.map, &among, target, &settings.zoomout, task))?;
    let weight = settings.zoomout.feature_weight;
    let points = stages.time("point_map", || point_map(&map, source, target, weight))?;
    let reversed = || reverse_point_map(&map, source, target, weight);
    let target_of = match settings.rule {
        Rule::Image => Some(stages.time("point_map", reversed)?),
        Rule::Preimage => None,
    };
    Ok(Matched { target_of, map: Some(map), fit: Some(fit.report), ..Matched::points(points) })
}
