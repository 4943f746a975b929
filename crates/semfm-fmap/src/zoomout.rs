//! ZoomOut: from a small functional map to a large one, alternating point map and projection.
//!
//! Melzi et al., "ZoomOut: Spectral upsampling for efficient shape correspondence", 2019. Three
//! additions, each optional: the search may run on samples only (their section 5), on the basis
//! *and* on features, and in both directions at once (Ren et al., "MapTree", 2020).

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatRef, Par, Side};
use semfm_geom::{Eigenbasis, Task};

use crate::functional_map::check_size;
use crate::nearest_rows::Rows;
use crate::point_map::rows_of;
use crate::{Error, FunctionalMap, PointMap, Result};

/// Tikhonov weight per sample in the projection onto sampled eigenfunctions. Far smaller, and 600
/// samples no longer hold 50 functions apart on thin blades; larger shrinks the map.
const RIDGE: f64 = 1e-4;

/// One shape as ZoomOut sees it.
#[derive(Clone, Copy, Debug)]
pub struct MapSide<'a> {
    /// Its eigenbasis (n × k).
    pub basis: &'a Eigenbasis,
    /// Features of its vertices (n × d), in the same space on both sides; `None` for a purely
    /// spectral search.
    pub features: Option<MatRef<'a, f64>>,
    /// The vertices that are matched while the map grows; empty for all of them.
    pub samples: &'a [u32],
}

impl<'a> MapSide<'a> {
    /// A shape for a purely spectral search on all vertices.
    pub fn spectral(basis: &'a Eigenbasis) -> Self {
        Self { basis, features: None, samples: &[] }
    }
}

/// Matches of both sides' samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matches {
    /// A source vertex for each of the target's samples.
    pub source_of: Vec<u32>,
    /// A target vertex for each of the source's samples.
    pub target_of: Vec<u32>,
}

/// How the map grows.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ZoomOutSettings {
    /// Size of the first map, where ZoomOut makes it itself (bidirectional).
    pub k_start: usize,
    /// Size of the last map.
    pub k_final: usize,
    /// Growth per turn.
    pub step: usize,
    /// Weight w of the features: the search runs in \[spectral, w √k · features\].
    pub feature_weight: f64,
}

impl Default for ZoomOutSettings {
    fn default() -> Self {
        Self { k_start: 20, k_final: 50, step: 5, feature_weight: 0.0 }
    }
}

/// Grows `map` to `k_final` × `k_final`.
///
/// With all target vertices the projection is Φᵀ M, as published; with samples it is the ridge
/// solution of Φ_target\[samples\] C = Φ_source\[matches\].
///
/// # Errors
/// [`Error::BasisTooSmall`], [`Error::OutOfRange`] for a step of 0 or a map that is not square,
/// [`Error::LinearAlgebra`] where the projection is singular, [`Error::Geom`] on cancellation.
pub fn zoomout(
    map: FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    settings: &ZoomOutSettings,
    task: &Task,
) -> Result<FunctionalMap> {
    check(settings, source, target)?;
    let mut map = map;
    if map.k_source() != map.k_target() || map.k_source() > settings.k_final {
        let found = format!("{} × {}", map.k_target(), map.k_source());
        let expected = format!("a square map of at most {}", settings.k_final);
        return Error::out_of_range("the map to refine", expected, found);
    }
    let mut k = map.k_source();
    while k < settings.k_final {
        task.step("zoomout", k, settings.k_final)?;
        let matches = search(&map, source, target, settings.feature_weight, target.samples);
        k = (k + settings.step).min(settings.k_final);
        map = if target.samples.is_empty() {
            FunctionalMap::from_point_map(
                &PointMap { source_of: matches },
                source.basis,
                target.basis,
                k,
            )?
        } else {
            let on_target = rows_of(target.basis.first(k), target.samples);
            let on_source = rows_of(source.basis.first(k), &matches);
            least_squares(&[Equations { left: on_target, right: on_source }])?
        };
    }
    Ok(map)
}

/// Grows a map from matches of both sides' samples, using both directions in every turn.
///
/// In each turn C solves
/// \[Φ_target\[samples\]; Φ_target\[target_of\]\] C = \[Φ_source\[source_of\]; Φ_source\[samples\]\],
/// then both sets of matches are searched again with it.
///
/// # Errors
/// As [`zoomout`]; [`Error::Length`] where matches and samples differ in count.
pub fn zoomout_bidirectional(
    matches: Matches,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    settings: &ZoomOutSettings,
    task: &Task,
) -> Result<FunctionalMap> {
    check(settings, source, target)?;
    let Matches { mut source_of, mut target_of } = matches;
    Error::length("matches of the target's samples", target.samples.len(), source_of.len())?;
    Error::length("matches of the source's samples", source.samples.len(), target_of.len())?;
    let mut k = settings.k_start.min(settings.k_final);
    loop {
        task.step("zoomout", k, settings.k_final)?;
        let (on_source, on_target) = (source.basis.first(k), target.basis.first(k));
        let forth = Equations {
            left: rows_of(on_target, target.samples),
            right: rows_of(on_source, &source_of),
        };
        let back = Equations {
            left: rows_of(on_target, &target_of),
            right: rows_of(on_source, source.samples),
        };
        let map = least_squares(&[forth, back])?;
        if k >= settings.k_final {
            return Ok(map);
        }
        source_of = search(&map, source, target, settings.feature_weight, target.samples);
        target_of = search_back(&map, source, target, settings.feature_weight, source.samples);
        k = (k + settings.step).min(settings.k_final);
    }
}

/// The point map target → source of a functional map, in the space of basis and features.
pub fn point_map(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
) -> PointMap {
    PointMap { source_of: search(map, source, target, feature_weight, &[]) }
}

/// The opposite reading of the same functional map: a target vertex for each source vertex.
pub fn reverse_point_map(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
) -> Vec<u32> {
    search_back(map, source, target, feature_weight, &[])
}

/// For each of the target's `rows` (all, where empty) the nearest source vertex.
fn search(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    weight: f64,
    rows: &[u32],
) -> Vec<u32> {
    let mapped = map.mapped_deltas(source.basis.first(map.k_source()));
    let scale = weight * (map.k_target() as f64).sqrt();
    let points = with_features(mapped.as_ref(), source.features, scale, &[]);
    let queries = with_features(target.basis.first(map.k_target()), target.features, scale, rows);
    queries.nearest_of(&points)
}

/// For each of the source's `rows` (all, where empty) the nearest target vertex.
fn search_back(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    weight: f64,
    rows: &[u32],
) -> Vec<u32> {
    let mapped = map.mapped_deltas(source.basis.first(map.k_source()));
    let scale = weight * (map.k_target() as f64).sqrt();
    let points = with_features(target.basis.first(map.k_target()), target.features, scale, &[]);
    let queries = with_features(mapped.as_ref(), source.features, scale, rows);
    queries.nearest_of(&points)
}

/// \[spectral, scale · features\] on the chosen rows, or on all of them where none is chosen.
fn with_features<'a>(
    spectral: MatRef<'a, f64>,
    features: Option<MatRef<'a, f64>>,
    scale: f64,
    rows: &'a [u32],
) -> Rows<'a> {
    let both = match features.filter(|_| scale > 0.0) {
        Some(features) => Rows::of(spectral).beside(features, scale),
        None => Rows::of(spectral),
    };
    if rows.is_empty() { both } else { both.chosen(rows) }
}

/// Equations A C = B, one for each row.
struct Equations {
    /// A (rows × k_target).
    left: Mat<f64>,
    /// B (rows × k_source).
    right: Mat<f64>,
}

/// C of least Σ ‖Aᵢ C − Bᵢ‖² + ρ ‖C‖² over some blocks of equations, ρ = [`RIDGE`] · rows:
///
/// (Σ Aᵢᵀ Aᵢ + ρ I) C = Σ Aᵢᵀ Bᵢ
fn least_squares(blocks: &[Equations]) -> Result<FunctionalMap> {
    let (k_target, k_source) = (blocks[0].left.ncols(), blocks[0].right.ncols());
    let (mut gram, mut right) =
        (Mat::<f64>::zeros(k_target, k_target), Mat::<f64>::zeros(k_target, k_source));
    let mut rows = 0;
    for Equations { left: a, right: b } in blocks {
        matmul(gram.as_mut(), Accum::Add, a.transpose(), a.as_ref(), 1.0, Par::Seq);
        matmul(right.as_mut(), Accum::Add, a.transpose(), b.as_ref(), 1.0, Par::Seq);
        rows += a.nrows();
    }
    (0..k_target).for_each(|i| gram[(i, i)] += RIDGE * rows as f64);
    let factor = gram.llt(Side::Lower).map_err(|_| Error::LinearAlgebra("ZoomOut's projection"))?;
    Ok(FunctionalMap::new(factor.solve(right)))
}

fn check(settings: &ZoomOutSettings, source: &MapSide<'_>, target: &MapSide<'_>) -> Result<()> {
    check_size("ZoomOut", settings.k_final, source.basis, target.basis)?;
    if settings.step == 0 || settings.k_start == 0 {
        let found = format!("start {}, step {}", settings.k_start, settings.step);
        return Error::out_of_range("ZoomOut", "a start and a step of at least 1", found);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, shape};

    /// Share of vertices that the map sends to themselves or to somewhere very near.
    fn right(map: &PointMap, shape: &semfm_geom::Shape) -> f64 {
        let points = shape.mesh().vertices();
        let near =
            |(&i, p): (&u32, &semfm_geom::math::DVec3)| points[i as usize].distance(*p) < 0.2;
        map.source_of.iter().zip(points).filter(|x| near(*x)).count() as f64 / points.len() as f64
    }

    /// The true 6 × 6 map of a lumpy blob onto itself, somewhat spoiled.
    fn spoiled_start() -> FunctionalMap {
        FunctionalMap::new(Mat::from_fn(6, 6, |i, j| {
            if i == j { 0.9 } else { 0.05 * (i as f64 - j as f64).sin() }
        }))
    }

    #[test]
    fn a_spoiled_small_map_of_a_shape_onto_itself_grows_into_the_identity() {
        let shape = shape(&blob(1.0), 40);
        let samples = semfm_geom::sampling::farthest_points(shape.mesh().vertices(), 150);
        let settings = ZoomOutSettings { k_start: 6, k_final: 40, step: 2, feature_weight: 0.0 };
        for samples in [&[][..], &samples] {
            let side = MapSide { basis: shape.basis(), features: None, samples };
            let map = zoomout(spoiled_start(), &side, &side, &settings, &Task::default()).unwrap();
            let share = right(&point_map(&map, &side, &side, 0.0), &shape);
            assert!(
                share > 0.98,
                "{share} of the vertices are right with {} samples",
                samples.len()
            );
        }
    }

    #[test]
    fn both_directions_at_once_repair_matches_with_errors_and_features_help() {
        let shape = shape(&blob(1.0), 30);
        let points = shape.mesh().vertices();
        let samples = semfm_geom::sampling::farthest_points(points, 150);
        // Every fourth sample is matched to a wrong vertex.
        let wrong =
            |(i, &v): (usize, &u32)| if i % 4 == 0 { samples[(i * 7 + 3) % 150] } else { v };
        let matches: Vec<u32> = samples.iter().enumerate().map(wrong).collect();
        let positions = Mat::from_fn(points.len(), 3, |i, c| points[i][c]);
        let side =
            MapSide { basis: shape.basis(), features: Some(positions.as_ref()), samples: &samples };
        let settings = ZoomOutSettings { k_start: 10, k_final: 30, step: 5, feature_weight: 1.0 };
        let map = zoomout_bidirectional(
            Matches { source_of: matches.clone(), target_of: matches },
            &side,
            &side,
            &settings,
            &Task::default(),
        )
        .unwrap();
        let forth = point_map(&map, &side, &side, 1.0);
        let back = PointMap { source_of: reverse_point_map(&map, &side, &side, 1.0) };
        assert!(right(&forth, &shape) > 0.99, "{}", right(&forth, &shape));
        assert!(right(&back, &shape) > 0.99, "{}", right(&back, &shape));
    }

    #[test]
    fn what_cannot_be_grown_is_refused() {
        let shape = shape(&blob(1.0), 10);
        let side = MapSide { basis: shape.basis(), features: None, samples: &[] };
        let grow = |k_final, step| {
            let settings = ZoomOutSettings { k_start: 6, k_final, step, feature_weight: 0.0 };
            zoomout(spoiled_start(), &side, &side, &settings, &Task::default())
        };
        assert!(matches!(grow(11, 1), Err(Error::BasisTooSmall { asked: 11, .. })));
        assert!(matches!(grow(10, 0), Err(Error::OutOfRange { .. })));
        assert!(matches!(grow(5, 1), Err(Error::OutOfRange { what: "the map to refine", .. })));
    }
}
