//! ZoomOut: from a small functional map to a large one, alternating point map and projection.
//!
//! Melzi et al., "ZoomOut: Spectral upsampling for efficient shape correspondence", 2019. Three
//! additions, each optional: the search may run on samples only (their section 5), on the basis
//! *and* on features, and in both directions at once (Ren et al., "MapTree", 2020).

use faer::MatRef;
use semfm_geom::{Eigenbasis, Task};

use crate::functional_map::check_size;
use crate::match_search::{Direction, MatchSearch, all_matches};
use crate::sampled_projection::{SampledProjection, least_squares};
use crate::{Error, FunctionalMap, PointMap, Result};

/// One shape as ZoomOut sees it.
#[derive(Clone, Copy, Debug)]
pub struct MapSide<'a> {
    /// Its eigenbasis (n × k).
    pub basis: &'a Eigenbasis,
    /// Features of its vertices (n × d), in the same space on both sides; `None` for a purely
    /// spectral search.
    pub features: Option<MatRef<'a, f64>>,
    /// The vertices that stand for the shape while the map grows; empty for all of them. [`zoomout`]
    /// matches the target's with the source's, [`zoomout_bidirectional`] those of either side with all
    /// vertices of the other.
    pub samples: &'a [u32],
}

impl<'a> MapSide<'a> {
    /// A shape for a purely spectral search on all vertices.
    pub fn spectral(basis: &'a Eigenbasis) -> Self {
        Self { basis, features: None, samples: &[] }
    }

    /// How many vertices stand for the shape.
    fn n_chosen(&self) -> usize {
        if self.samples.is_empty() { self.basis.n_vertices() } else { self.samples.len() }
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
/// [`Error::BasisTooSmall`]; [`Error::OutOfRange`] for a step of 0, a map that is not square, a sample that is no
/// vertex, and numbers that are not finite; [`Error::Length`] for features of another number of vertices;
/// [`Error::LinearAlgebra`] where the projection is singular; [`Error::Geom`] on cancellation.
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
    let (k_final, weight) = (settings.k_final, settings.feature_weight);
    let mut k = map.k_source();
    if k == k_final {
        return Ok(map);
    }
    let (on_source, on_target) = ((source, source.samples), (target, target.samples));
    let mut search =
        MatchSearch::new(on_source, on_target, k_final, weight, Direction::TargetToSource);
    let sampled = match target.samples {
        [] => None,
        _ => Some(SampledProjection::new(&[search.target_basis()])?),
    };
    let vertices = search.target_vertices();
    let mass: Vec<f64> = vertices.map(|v| target.basis.mass[v as usize]).collect();
    while k < k_final {
        task.step("zoomout", k, k_final)?;
        search.find_nearest(&map)?;
        k = (k + settings.step).min(k_final);
        let matched = search.matched(k);
        map = match &sampled {
            None => FunctionalMap::projected(matched.on_points, matched.on_queries, &mass),
            Some(projection) => projection.solve(&[matched.equations()]),
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
    let Matches { source_of, target_of } = matches;
    Error::length("matches of the target's samples", target.n_chosen(), source_of.len())?;
    Error::length("matches of the source's samples", source.n_chosen(), target_of.len())?;
    check_vertices("matches of the target's samples", &source_of, source.basis)?;
    check_vertices("matches of the source's samples", &target_of, target.basis)?;
    let (k_final, weight) = (settings.k_final, settings.feature_weight);
    let mut forth = MatchSearch::new(
        (source, &[]),
        (target, target.samples),
        k_final,
        weight,
        Direction::TargetToSource,
    );
    let mut back = MatchSearch::new(
        (source, source.samples),
        (target, &[]),
        k_final,
        weight,
        Direction::SourceToTarget,
    );
    forth.start_from(&source_of);
    back.start_from(&target_of);
    let mut k = settings.k_start.min(k_final);
    loop {
        task.step("zoomout", k, k_final)?;
        let (of_target, of_source) = (forth.matched(k), back.matched(k));
        let map = least_squares(&[of_target.equations(), of_source.equations()])?;
        if k >= k_final {
            return Ok(map);
        }
        let (of_target, of_source) =
            rayon::join(|| forth.find_nearest(&map), || back.find_nearest(&map));
        of_target.and(of_source)?;
        k = (k + settings.step).min(k_final);
    }
}

/// The point map target → source of a functional map, in the space of basis and features.
///
/// # Errors
/// [`Error::BasisTooSmall`] for a map larger than a basis, [`Error::Length`] for features of another number of
/// vertices, [`Error::OutOfRange`] for numbers that are not finite.
pub fn point_map(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
) -> Result<PointMap> {
    let source_of =
        checked_matches(map, source, target, feature_weight, Direction::TargetToSource)?;
    Ok(PointMap { source_of })
}

/// The opposite reading of the same functional map: a target vertex for each source vertex.
///
/// # Errors
/// As [`point_map`].
pub fn reverse_point_map(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
) -> Result<Vec<u32>> {
    checked_matches(map, source, target, feature_weight, Direction::SourceToTarget)
}

/// Matches of all vertices.
fn checked_matches(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
    direction: Direction,
) -> Result<Vec<u32>> {
    let k = map.k_source().max(map.k_target());
    check_size("the point map", k, source.basis, target.basis)?;
    check_features(source, target)?;
    all_matches(map, source, target, feature_weight, direction)
}

fn check(settings: &ZoomOutSettings, source: &MapSide<'_>, target: &MapSide<'_>) -> Result<()> {
    check_size("ZoomOut", settings.k_final, source.basis, target.basis)?;
    if settings.step == 0 || settings.k_start == 0 {
        let found = format!("start {}, step {}", settings.k_start, settings.step);
        return Error::out_of_range("ZoomOut", "a start and a step of at least 1", found);
    }
    check_vertices("samples of the source", source.samples, source.basis)?;
    check_vertices("samples of the target", target.samples, target.basis)?;
    check_features(source, target)
}

/// Checks that there is a feature for each vertex, in one space.
fn check_features(source: &MapSide<'_>, target: &MapSide<'_>) -> Result<()> {
    let (Some(on_source), Some(on_target)) = (source.features, target.features) else {
        if source.features.is_some() || target.features.is_some() {
            return Error::out_of_range("features", "those of both sides or of none", "one side's");
        }
        return Ok(());
    };
    Error::length("features of the source", source.basis.n_vertices(), on_source.nrows())?;
    Error::length("features of the target", target.basis.n_vertices(), on_target.nrows())?;
    Error::length("numbers of a target's feature", on_source.ncols(), on_target.ncols())
}

fn check_vertices(what: &'static str, ids: &[u32], basis: &Eigenbasis) -> Result<()> {
    let n = basis.n_vertices();
    match ids.iter().find(|&&id| id as usize >= n) {
        None => Ok(()),
        Some(id) => Error::out_of_range(what, format!("vertices below {n}"), id),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, shape};
    use faer::Mat;

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
            let share = right(&point_map(&map, &side, &side, 0.0).unwrap(), &shape);
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
        let forth = point_map(&map, &side, &side, 1.0).unwrap();
        let back = PointMap { source_of: reverse_point_map(&map, &side, &side, 1.0).unwrap() };
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

    #[test]
    fn without_samples_every_vertex_has_a_match() {
        let shape = shape(&blob(1.0), 10);
        let side = MapSide::spectral(shape.basis());
        let settings = ZoomOutSettings { k_start: 6, k_final: 10, step: 2, feature_weight: 0.0 };
        let grow = |matches: Vec<u32>| {
            let matches = Matches { source_of: matches.clone(), target_of: matches };
            zoomout_bidirectional(matches, &side, &side, &settings, &Task::default())
        };
        assert!(matches!(grow(Vec::new()), Err(Error::Length { found: 0, .. })));
        let map = grow((0..shape.basis().n_vertices() as u32).collect()).unwrap();
        assert!(right(&point_map(&map, &side, &side, 0.0).unwrap(), &shape) > 0.99);
    }
}
