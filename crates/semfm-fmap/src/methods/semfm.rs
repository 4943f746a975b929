//! `semfm`: the published method, to the letter.
//!
//! Two semantic anchors, diffused and scaled to unit ℓ₂ norm over the vertices, the minimum-norm C of
//! size 20, plain ZoomOut to 50 in steps of 5 on all vertices, no smoothing of the result. Only
//! the direction is ours: the paper's T and C do not fit together (see [`PointMap`]), so C is
//! fitted source → target for the preimage rule and, roles swapped, target → source for the paper's
//! own image rule. Both are computed.

use semfm_geom::{Eigenbasis, Task};

use super::info::{ConfidenceRule, Lifting, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::votes;
use crate::descriptors::{DescriptorNorm, Indicators, diffused_indicators};
use crate::fit::{Fit, FitSide, fit};
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::zoomout::{MapSide, ZoomOutSettings, point_map, zoomout};
use crate::{Anchors, FunctionalMap, PointMap, Result};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "semfm",
    summary: "the published method to the letter: two anchors, minimum-norm C, plain ZoomOut",
    color: [0, 114, 178],
    features: ViewFeatures { lifting: Lifting::Unproject, rolls: 1 },
    reads_features: true,
    has_map: true,
    confidence: ConfidenceRule::Agreement,
    settings,
    matched,
    votes: votes::by_map_spread,
};

fn settings(common: TransferSettings) -> TransferSettings {
    TransferSettings {
        descriptor_norm: DescriptorNorm::Vertices,
        zoomout: ZoomOutSettings { k_start: 20, k_final: 50, step: 5, feature_weight: 0.0 },
        ..common
    }
}

/// An eigenbasis and one cluster label for each of its vertices (n).
#[derive(Clone, Copy, Debug)]
pub struct LabelledBasis<'a> {
    /// The basis (n × k).
    pub basis: &'a Eigenbasis,
    /// Label of each vertex (n).
    pub labels: &'a [u32],
}

/// C (k_start × k_start) from the anchors alone: section IV-E, equations 14 to 17.
///
/// # Errors
/// As [`fit`].
pub fn anchor_fit(
    source: LabelledBasis<'_>,
    target: LabelledBasis<'_>,
    anchors: &Anchors,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Fit> {
    let k = settings.zoomout.k_start;
    let indicators =
        Indicators { heat_time: settings.heat_time, norm: settings.descriptor_norm, k };
    let a = diffused_indicators(source.basis, source.labels, &anchors.source_labels(), &indicators);
    let b = diffused_indicators(target.basis, target.labels, &anchors.target_labels(), &indicators);
    let (on_source, on_target) =
        (FitSide::new(source.basis, a.as_ref()), FitSide::new(target.basis, b.as_ref()));
    fit(on_source, on_target, &settings.fit, task)
}

fn matched(
    pair: &Pair,
    settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<Matched> {
    let clustered = stages.time("anchors", || pair.select_anchors(task))?;
    let sides = pair.spectral_sides();
    let labels = clustered.vertex_labels(pair);
    let source = LabelledBasis { basis: sides.source.basis, labels: &labels.source };
    let target = LabelledBasis { basis: sides.target.basis, labels: &labels.target };
    let (anchors, swapped) = (&clustered.anchors, clustered.anchors.swapped());
    let forth = stages.time("fit", || anchor_fit(source, target, anchors, settings, task))?;
    let back = stages.time("fit", || anchor_fit(target, source, &swapped, settings, task))?;
    let (forth_refined, back_refined) = stages.time("zoomout", || {
        rayon::join(
            || refine(forth.map, &sides.source, &sides.target, &settings.zoomout, task),
            || refine(back.map, &sides.target, &sides.source, &settings.zoomout, task),
        )
    });
    let (forth_refined, back_refined) = (forth_refined?, back_refined?);
    Ok(Matched {
        target_of: Some(back_refined.points.source_of),
        map: Some(forth_refined.map),
        fit: Some(forth.report),
        ..Matched::points(forth_refined.points)
    })
}

/// A map after ZoomOut and the point map read off it.
pub(super) struct Refined {
    pub map: FunctionalMap,
    pub points: PointMap,
}

pub(super) fn refine(
    map: FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    settings: &ZoomOutSettings,
    task: &Task,
) -> Result<Refined> {
    let map = zoomout(map, source, target, settings, task)?;
    let points = point_map(&map, source, target, settings.feature_weight)?;
    Ok(Refined { map, points })
}
