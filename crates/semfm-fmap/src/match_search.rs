//! The search for matches in the space of a map, turn after turn.

use faer::{Mat, MatRef};

use crate::nearest_rows::{Patches, Rows, nearest_of};
use crate::point_map::rows_of;
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

/// A search between some vertices of both sides, all or samples. Each turn starts from the answers of the last one.
pub(crate) struct MatchSearch<'a> {
    source: Vertices<'a>,
    target: Vertices<'a>,
    feature_weight: f64,
    direction: Direction,
    patches: Patches,
    /// The last answers, as numbers of rows.
    last: Option<Vec<u32>>,
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
        let (source, target) = (Vertices::of(source, k), Vertices::of(target, k));
        let smooth = |side: &'_ Vertices<'a>| side.basis.first(SMOOTH.min(k)).to_owned();
        let (on_source, on_target) = (smooth(&source), smooth(&target));
        let (on_source, on_target) = (Rows::of(on_source.as_ref()), Rows::of(on_target.as_ref()));
        let patches = match direction {
            Direction::TargetToSource => Patches::of(&on_target, &on_source),
            Direction::SourceToTarget => Patches::of(&on_source, &on_target),
        };
        Self { source, target, feature_weight, direction, patches, last: None }
    }

    /// The nearest vertex of the one side to each of the other, where the source's delta functions are sent through C.
    pub fn matches(&mut self, map: &FunctionalMap) -> Result<Vec<u32>> {
        let mapped = map.mapped_deltas(self.source.basis.first(map.k_source()));
        let scale = self.feature_weight * (map.k_target() as f64).sqrt();
        let on_source = with_features(mapped.as_ref(), self.source.features.as_ref(), scale);
        let on_target = self.target.basis.first(map.k_target());
        let on_target = with_features(on_target, self.target.features.as_ref(), scale);
        let (queries, points, side) = match self.direction {
            Direction::TargetToSource => (on_target, on_source, &self.source),
            Direction::SourceToTarget => (on_source, on_target, &self.target),
        };
        let rows = nearest_of(&queries, &points, &self.patches, self.last.as_deref())?;
        let vertices = match side.chosen {
            [] => rows.clone(),
            chosen => rows.iter().map(|&row| chosen[row as usize]).collect(),
        };
        self.last = Some(rows);
        Ok(vertices)
    }
}

/// What is known of some vertices of a shape, one row each.
struct Vertices<'a> {
    basis: Matrix<'a>,
    features: Option<Matrix<'a>>,
    chosen: &'a [u32],
}

impl<'a> Vertices<'a> {
    fn of((side, chosen): (&MapSide<'a>, &'a [u32]), k: usize) -> Self {
        let on_chosen = |matrix| match chosen {
            [] => Matrix::Whole(matrix),
            chosen => Matrix::Chosen(rows_of(matrix, chosen)),
        };
        Self {
            basis: on_chosen(side.basis.first(k)),
            features: side.features.map(on_chosen),
            chosen,
        }
    }
}

/// A matrix of another's, or some of its rows.
enum Matrix<'a> {
    Whole(MatRef<'a, f64>),
    Chosen(Mat<f64>),
}

impl Matrix<'_> {
    fn view(&self) -> MatRef<'_, f64> {
        match self {
            Self::Whole(matrix) => *matrix,
            Self::Chosen(matrix) => matrix.as_ref(),
        }
    }

    /// The first `k` columns.
    fn first(&self, k: usize) -> MatRef<'_, f64> {
        self.view().subcols(0, k)
    }
}

/// \[spectral, scale · features\].
fn with_features<'a>(
    spectral: MatRef<'a, f64>,
    features: Option<&'a Matrix<'_>>,
    scale: f64,
) -> Rows<'a> {
    match features.filter(|_| scale > 0.0) {
        Some(features) => Rows::of(spectral).beside(features.view(), scale),
        None => Rows::of(spectral),
    }
}
