//! `semfm`: the published method, to the letter.
//!
//! Two semantic anchors, diffused and scaled to unit ℓ₂ norm over the vertices, the minimum-norm C of
//! size 20, plain ZoomOut to 50 in steps of 5 on all vertices, no smoothing of the result. Only
//! the direction is ours: the paper's T and C do not fit together (see [`PointMap`]), so C is
//! fitted source → target for the preimage rule and, roles swapped, target → source for the paper's
//! own image rule. Both are computed.

use semfm_geom::{Eigenbasis, Task};

use super::{Matched, Pair, PairedParts, Stages, TransferSettings};
use crate::descriptors::diffused_indicators;
use crate::fit::{Fit, fit};
use crate::zoomout::{MapSide, point_map, zoomout};
use crate::{Anchors, FunctionalMap, PointMap, Result};

/// C (k_start × k_start) from the anchors alone: section IV-E's equation.
///
/// Each side is its basis and one cluster label per vertex (n).
///
/// # Errors
/// As [`fit`].
pub fn anchor_fit(
    source: (&Eigenbasis, &[u32]),
    target: (&Eigenbasis, &[u32]),
    anchors: &Anchors,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Fit> {
    let (k, t, norm) = (settings.zoomout.k_start, settings.heat_time, settings.descriptor_norm);
    let a = diffused_indicators(source.0, source.1, &anchors.source_labels(), t, norm, k);
    let b = diffused_indicators(target.0, target.1, &anchors.target_labels(), t, norm, k);
    fit((a.as_ref(), b.as_ref()), source.0, target.0, &settings.fit, task)
}

pub(super) fn match_pair(
    pair: &Pair<'_>,
    parts: &PairedParts,
    stages: &mut Stages,
) -> Result<Matched> {
    let (source, target) = pair.plain_sides();
    let (on_source, on_target) =
        (pair.source.vertex_labels(&parts.source), pair.target.vertex_labels(&parts.target));
    let swapped = parts.anchors.swapped();
    let (forth, back) = stages.time("fit", || {
        let settings = pair.settings;
        let forth = anchor_fit(
            (source.basis, &on_source),
            (target.basis, &on_target),
            &parts.anchors,
            settings,
            pair.task,
        )?;
        let back = anchor_fit(
            (target.basis, &on_target),
            (source.basis, &on_source),
            &swapped,
            settings,
            pair.task,
        )?;
        Ok((forth, back))
    })?;
    let report = forth.report.clone();
    let (forth, back) = stages.time("zoomout", || {
        let (forth, back) = rayon::join(
            || refine(forth.map, &source, &target, pair),
            || refine(back.map, &target, &source, pair),
        );
        Ok((forth?, back?))
    })?;
    let (map, forth) = forth;
    Ok(Matched {
        point_map: forth,
        reverse: Some(back.1.source_of),
        map: Some(map),
        fit: Some(report),
    })
}

fn refine(
    map: FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    pair: &Pair<'_>,
) -> Result<(FunctionalMap, PointMap)> {
    let map = zoomout(map, source, target, &pair.settings.zoomout, pair.task)?;
    let points = point_map(&map, source, target, pair.settings.zoomout.feature_weight);
    Ok((map, points))
}
