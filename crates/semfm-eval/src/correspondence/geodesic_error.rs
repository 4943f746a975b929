//! How far a map is from the truth, along the surface.

use std::collections::BTreeMap;

use faer::Mat;
use semfm::fmap::{PointMap, PreciseMap};
use semfm::geom::geodesic::{HeatGeodesics, HeatSettings};
use semfm::geom::math::DVec3;

use super::annotated_shape::AnnotatedShape;
use crate::{Error, Result};

/// Distances from the true vertices of one pair's samples: computed once, used for every map.
pub(super) struct GeodesicError<'a> {
    source: &'a AnnotatedShape,
    target: &'a AnnotatedShape,
    samples: Vec<usize>,
    /// Distances (n_source × distinct true vertices).
    distances: Mat<f64>,
    column_of: BTreeMap<u32, usize>,
    /// What a pair of vertices that no path joins counts as, at least: the greatest distance among those that are joined.
    apart: f64,
    /// √A of the source.
    unit: f64,
}

/// Where a map sends the target's vertices, on the mesh as read.
pub(super) enum Sent {
    /// To vertices of the source.
    Vertices(PointMap),
    /// To points of its triangles.
    Points(PreciseMap),
}

/// A point of the source: on some of its vertices with weights that sum to 1.
#[derive(Clone, Copy)]
struct SentPoint {
    corners: [u32; 3],
    weights: [f64; 3],
}

impl Sent {
    fn n_target(&self) -> usize {
        match self {
            Self::Vertices(map) => map.n_target(),
            Self::Points(map) => map.n_target(),
        }
    }

    fn of(&self, target_vertex: u32) -> SentPoint {
        let j = target_vertex as usize;
        match self {
            Self::Vertices(map) => {
                SentPoint { corners: [map.source_of[j]; 3], weights: [1.0, 0.0, 0.0] }
            }
            Self::Points(map) => {
                SentPoint { corners: map.corners()[j], weights: map.barycentric()[j] }
            }
        }
    }
}

impl SentPoint {
    /// A function of the vertices, linear on the triangles; vertices without weight are not asked.
    fn interpolated<T: std::iter::Sum>(&self, value: impl Fn(u32, f64) -> T) -> T {
        let corners = self.corners.iter().zip(self.weights).filter(|(_, weight)| *weight > 0.0);
        corners.map(|(&vertex, weight)| value(vertex, weight)).sum()
    }
}

/// Mean errors of one map × 100 / √area.
pub(super) struct MapErrors {
    /// Against the truth.
    pub to_truth: f64,
    /// Against the mirrored truth, where it is known.
    pub to_mirror: Option<f64>,
}

impl<'a> GeodesicError<'a> {
    /// Distances for at most `n_samples` (0: all) of the samples that both shapes have.
    pub fn new(
        source: &'a AnnotatedShape,
        target: &'a AnnotatedShape,
        n_samples: usize,
    ) -> std::result::Result<Self, String> {
        let (n, other) = (source.truth.len(), target.truth.len());
        if n != other || n == 0 {
            return Err(format!("{n} samples on the source and {other} on the target"));
        }
        let wanted = if n_samples == 0 { n } else { n_samples.min(n) };
        let samples: Vec<usize> = (0..wanted).map(|i| i * n / wanted).collect();
        let mut column_of = BTreeMap::new();
        let mirrored = source.mirrored.as_deref().unwrap_or(&[]);
        for &i in &samples {
            for &vertex in [source.truth.get(i), mirrored.get(i)].into_iter().flatten() {
                let next = column_of.len();
                column_of.entry(vertex).or_insert(next);
            }
        }
        let mut from = vec![0; column_of.len()];
        column_of.iter().for_each(|(&vertex, &column)| from[column] = vertex);
        let mesh = source.shape.original();
        let distances = HeatGeodesics::new(mesh, &HeatSettings::default())
            .and_then(|geodesics| geodesics.distances_from_each(&from))
            .map_err(|error| error.to_string())?;
        let columns = (0..distances.ncols()).flat_map(|j| distances.col(j).iter().copied());
        let apart = columns.filter(|d| d.is_finite()).fold(0.0, f64::max);
        let unit = mesh.area().sqrt();
        Ok(Self { source, target, samples, distances, column_of, apart, unit })
    }

    /// Errors of a map T between the meshes as read.
    pub fn of(&self, map: &Sent) -> Result<MapErrors> {
        let expected = self.target.shape.original().n_vertices();
        if map.n_target() != expected {
            let (expected, found) = (expected.to_string(), map.n_target().to_string());
            return Err(Error::invalid("vertices of the map", expected, found));
        }
        Ok(MapErrors {
            to_truth: self.mean(map, &self.source.truth),
            to_mirror: self.source.mirrored.as_deref().map(|truth| self.mean(map, truth)),
        })
    }

    /// 100 / (|S| √A) · Σ_{s ∈ S} d(T(y_s), x_s): d the geodesic distance on the source, x_s the
    /// source's vertex at sample s (`truth`), y_s the target's, T the map target → source. The distance of a point on a
    /// triangle is linear between those of its corners.
    ///
    /// On a source in several parts a sample may be sent to a part that no path joins to where it belongs. That counts
    /// as the greatest distance between vertices that are joined, or as the straight line where that is longer: as
    /// wrong as can be, yet finite, so that one such sample does not hide all others.
    fn mean(&self, map: &Sent, truth: &[u32]) -> f64 {
        let mut total = 0.0;
        for &s in &self.samples {
            let sent = map.of(self.target.truth[s]);
            let column = self.column_of[&truth[s]];
            let along = sent.interpolated(|v, w| w * self.distances[(v as usize, column)]);
            total += if along.is_finite() {
                along
            } else {
                let vertices = self.source.shape.original().vertices();
                let from: DVec3 = sent.interpolated(|v, w| w * vertices[v as usize]);
                self.apart.max(from.distance(vertices[truth[s] as usize]))
            };
        }
        100.0 * total / (self.samples.len() as f64 * self.unit)
    }
}
