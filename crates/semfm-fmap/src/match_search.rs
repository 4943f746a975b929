//! The search for matches in the space of a map, turn after turn.

use faer::{Mat, MatRef};

use crate::nearest_rows::{Patches, Rows, nearest_of};
use crate::point_map::rows_of;
use crate::sampled_projection::Equations;
use crate::zoomout::MapSide;
use crate::{FunctionalMap, Result};

/// Columns of the eigenbasis that tell which vertices are neighbours.
const SMOOTH: usize = 24;

/// Which way vertices are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// A source vertex for each target vertex.
    TargetToSource,
    /// A target vertex for each source vertex.
    SourceToTarget,
}

/// The nearest vertex of the one side to each of the other, where the source's delta functions are sent through C.
pub(crate) fn all_matches(
    map: &FunctionalMap,
    source: &MapSide<'_>,
    target: &MapSide<'_>,
    feature_weight: f64,
    direction: Direction,
) -> Result<Vec<u32>> {
    let mapped = map.mapped_deltas(source.basis.first(map.k_source()));
    let scale = feature_weight * (map.k_target() as f64).sqrt();
    let on_source = with_features(mapped.as_ref(), source.features, scale);
    let on_target = with_features(target.basis.first(map.k_target()), target.features, scale);
    let k = map.k_source().max(map.k_target());
    let Orders { of_source, of_target } = Orders::new((source, &[]), (target, &[]), k, direction);
    let (queries, points, patches) = match direction {
        Direction::TargetToSource => {
            (on_target, on_source, Patches { queries: of_target, points: of_source })
        }
        Direction::SourceToTarget => {
            (on_source, on_target, Patches { queries: of_source, points: of_target })
        }
    };
    nearest_of(&queries, &points, &patches, None)
}

/// Orders of the chosen vertices of both sides in which neighbours are neighbours.
struct Orders {
    of_source: Vec<u32>,
    of_target: Vec<u32>,
}

impl Orders {
    fn new(
        source: (&MapSide<'_>, &[u32]),
        target: (&MapSide<'_>, &[u32]),
        k: usize,
        direction: Direction,
    ) -> Self {
        let smooth = |(side, chosen): (&MapSide<'_>, &[u32])| {
            let smooth = side.basis.first(SMOOTH.min(k));
            if chosen.is_empty() { smooth.to_owned() } else { rows_of(smooth, chosen) }
        };
        let (on_source, on_target) = (smooth(source), smooth(target));
        let (on_source, on_target) = (Rows::of(on_source.as_ref()), Rows::of(on_target.as_ref()));
        match direction {
            Direction::TargetToSource => {
                let Patches { queries, points } = Patches::of(&on_target, &on_source);
                Self { of_source: points, of_target: queries }
            }
            Direction::SourceToTarget => {
                let Patches { queries, points } = Patches::of(&on_source, &on_target);
                Self { of_source: queries, of_target: points }
            }
        }
    }
}

/// Rows of \[spectral, scale · features\], the columns of both in turns.
fn with_features<'a>(
    spectral: MatRef<'a, f64>,
    features: Option<MatRef<'a, f64>>,
    scale: f64,
) -> Rows<'a> {
    match features.filter(|_| scale > 0.0) {
        Some(features) => Rows::of(spectral).beside(features, scale),
        None => Rows::of(spectral),
    }
}

/// A search between some vertices of both sides, all or samples, in many turns. Each turn starts from the answers of the last one.
///
/// Both bases are held with their rows in the order of the search's patches, so that every turn reads and writes them
/// from front to back.
pub(crate) struct MatchSearch<'a> {
    source: Vertices<'a>,
    target: Vertices<'a>,
    feature_weight: f64,
    direction: Direction,
    /// The last answers: for each row that looks for a match the row that it found.
    found: Option<Vec<u32>>,
}

impl<'a> MatchSearch<'a> {
    /// A search among the chosen vertices of both sides; all where none are chosen.
    pub fn new(
        source: (&MapSide<'a>, &'a [u32]),
        target: (&MapSide<'a>, &'a [u32]),
        k: usize,
        feature_weight: f64,
        direction: Direction,
    ) -> Self {
        let Orders { of_source, of_target } = Orders::new(source, target, k, direction);
        let source = Vertices::in_order(source, of_source, k);
        let target = Vertices::in_order(target, of_target, k);
        Self { source, target, feature_weight, direction, found: None }
    }

    /// Takes these for the last answers: a vertex of the other side for each vertex that looks for a match.
    pub fn start_from(&mut self, vertices: &[u32]) {
        let (queries, points) = self.sides();
        let mut row_of = vec![0; points.n_vertices];
        (0..).zip(&points.order).for_each(|(row, _)| row_of[points.vertex(row) as usize] = row);
        let found = queries.order.iter().map(|&i| row_of[vertices[i as usize] as usize]);
        self.found = Some(found.collect());
    }

    /// Finds the nearest row of the one side to each of the other, where the source's delta functions are sent through C.
    pub fn find_nearest(&mut self, map: &FunctionalMap) -> Result<()> {
        let mapped = map.mapped_deltas(self.source.basis.subcols(0, map.k_source()));
        let scale = self.feature_weight * (map.k_target() as f64).sqrt();
        let on_source = self.source.rows(mapped.as_ref(), scale);
        let on_target = self.target.rows(self.target.basis.subcols(0, map.k_target()), scale);
        let (queries, points) = match self.direction {
            Direction::TargetToSource => (on_target, on_source),
            Direction::SourceToTarget => (on_source, on_target),
        };
        let patches = Patches::in_order(queries.len(), points.len());
        self.found = Some(nearest_of(&queries, &points, &patches, self.found.as_deref())?);
        Ok(())
    }

    /// The first `k` columns of both bases, matched row by row.
    pub fn matched(&self, k: usize) -> MatchedRows<'_> {
        let (queries, points) = self.sides();
        let found = self.found.as_deref().unwrap_or_default();
        MatchedRows {
            on_queries: queries.basis.subcols(0, k).subrows(0, found.len()),
            on_points: rows_of(points.basis.subcols(0, k), found),
            direction: self.direction,
        }
    }

    /// The rows of the target's basis (vertices × k), in the order of the search.
    pub fn target_basis(&self) -> MatRef<'_, f64> {
        self.target.basis.as_ref()
    }

    /// The target's vertices, in the order of the search.
    pub fn target_vertices(&self) -> impl Iterator<Item = u32> {
        (0..self.target.order.len() as u32).map(|row| self.target.vertex(row))
    }

    /// What looks for a match, and where it looks.
    fn sides(&self) -> (&Vertices<'a>, &Vertices<'a>) {
        match self.direction {
            Direction::TargetToSource => (&self.target, &self.source),
            Direction::SourceToTarget => (&self.source, &self.target),
        }
    }
}

/// Rows of both bases, those of a match beside each other.
pub(crate) struct MatchedRows<'a> {
    /// Of the side that looked for matches (matches × k).
    pub on_queries: MatRef<'a, f64>,
    /// Of the side in which they were found (matches × k).
    pub on_points: Mat<f64>,
    direction: Direction,
}

impl MatchedRows<'_> {
    /// Φ_target\[one end of each match\] C = Φ_source\[the other\].
    pub fn equations(&self) -> Equations<'_> {
        let (queries, points) = (self.on_queries, self.on_points.as_ref());
        match self.direction {
            Direction::TargetToSource => Equations { left: queries, right: points },
            Direction::SourceToTarget => Equations { left: points, right: queries },
        }
    }
}

/// What is known of some vertices of a shape, one row each, in an order of the search's own.
struct Vertices<'a> {
    basis: Mat<f64>,
    features: Option<Mat<f64>>,
    /// Which of the chosen vertices each row is; of equally near ones the first chosen is taken.
    order: Vec<u32>,
    /// The chosen vertices; empty for all.
    chosen: &'a [u32],
    /// Of the whole shape.
    n_vertices: usize,
}

impl<'a> Vertices<'a> {
    fn in_order((side, chosen): (&MapSide<'a>, &'a [u32]), order: Vec<u32>, k: usize) -> Self {
        let (basis, n_vertices) = (Mat::new(), side.basis.n_vertices());
        let mut vertices = Self { basis, features: None, order, chosen, n_vertices };
        let ids: Vec<u32> = (0..vertices.order.len() as u32).map(|i| vertices.vertex(i)).collect();
        vertices.basis = rows_of(side.basis.first(k), &ids);
        vertices.features = side.features.map(|features| rows_of(features, &ids));
        vertices
    }

    /// The vertex behind a row.
    fn vertex(&self, row: u32) -> u32 {
        let i = self.order[row as usize];
        self.chosen.get(i as usize).map_or(i, |&vertex| vertex)
    }

    /// \[spectral, scale · features\].
    fn rows<'b>(&'b self, spectral: MatRef<'b, f64>, scale: f64) -> Rows<'b> {
        let features = self.features.as_ref().map(Mat::as_ref);
        with_features(spectral, features, scale).ranked(&self.order)
    }
}
