//! `wks`, the paper's baseline: wave kernel signatures, commutation with the Laplacian, plain ZoomOut.

use semfm_geom::descriptors::{WksSettings, wks};
use semfm_geom::{Shape, Task};

use super::info::{ConfidenceRule, Matched, MethodInfo, ViewFeatures};
use super::pair::Pair;
use super::semfm::{Refined, refine};
use super::votes;
use crate::Result;
use crate::descriptors::normalised_coefficients;
use crate::fit::{FitReport, FitSettings, FitSide, OrientedSurface, fit};
use crate::settings::{Rule, TransferSettings};
use crate::stages::Stages;
use crate::zoomout::{MapSide, ZoomOutSettings};

pub(super) const INFO: MethodInfo = MethodInfo {
    name: "wks",
    summary: "wave kernel signatures: geometry alone, the paper's baseline",
    color: [213, 94, 0],
    features: ViewFeatures::PULLED,
    reads_features: false,
    has_map: true,
    confidence: ConfidenceRule::Agreement,
    settings,
    matched,
    votes: votes::by_map_spread,
};

fn settings(common: TransferSettings) -> TransferSettings {
    TransferSettings {
        fit: FitSettings { laplacian: 0.01, ..FitSettings::default() },
        zoomout: ZoomOutSettings { k_start: 20, k_final: 50, step: 5, feature_weight: 0.0 },
        ..common
    }
}

fn matched(
    pair: &Pair,
    settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<Matched> {
    let (source, target) = (pair.source.shape(), pair.target.shape());
    let (forth, fit) = one_way(source, target, settings, stages, task)?;
    let target_of = match settings.rule {
        Rule::Image => Some(one_way(target, source, settings, stages, task)?.0.points.source_of),
        Rule::Preimage => None,
    };
    Ok(Matched { target_of, map: Some(forth.map), fit: Some(fit), ..Matched::points(forth.points) })
}

/// The map from the functions of `source` to those of `target`.
fn one_way(
    source: &Shape,
    target: &Shape,
    settings: &TransferSettings,
    stages: &mut Stages,
    task: &Task,
) -> Result<(Refined, FitReport)> {
    let k = settings.zoomout.k_start;
    let with_surface = settings.fit.orientation > 0.0;
    let found = stages.time("fit", || {
        let (on_source, on_target) =
            (Described::new(source, k, with_surface)?, Described::new(target, k, with_surface)?);
        fit(on_source.side(source), on_target.side(target), &settings.fit, task)
    })?;
    let refined = stages.time("zoomout", || {
        let (on_source, on_target) =
            (MapSide::spectral(source.basis()), MapSide::spectral(target.basis()));
        refine(found.map, &on_source, &on_target, &settings.zoomout, task)
    })?;
    Ok((refined, found.report))
}

/// The signature of a shape and, where its orientation matters, its triangles.
struct Described {
    coefficients: faer::Mat<f64>,
    surface: Option<OrientedSurface>,
}

impl Described {
    fn new(shape: &Shape, k: usize, with_surface: bool) -> Result<Self> {
        let signature = wks(shape.basis(), &WksSettings::default())?;
        let coefficients = normalised_coefficients(shape.basis(), signature.as_ref(), k);
        let surface = with_surface.then(|| OrientedSurface::new(shape.mesh())).transpose()?;
        Ok(Self { coefficients, surface })
    }

    fn side<'a>(&'a self, shape: &'a Shape) -> FitSide<'a> {
        let side = FitSide::new(shape.basis(), self.coefficients.as_ref());
        FitSide { surface: self.surface.as_ref(), ..side }
    }
}
