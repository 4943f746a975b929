//! How far a map is from the truth, along the surface.

use std::collections::BTreeMap;

use faer::Mat;
use semfm::fmap::PointMap;
use semfm::geom::geodesic::{HeatGeodesics, HeatSettings};

use super::shape::MatchingShape;
use crate::{Error, Result};

/// Distances from the true vertices of one pair's samples: computed once, asked for every map.
pub(crate) struct Measure<'a> {
    target: &'a MatchingShape,
    source: &'a MatchingShape,
    samples: Vec<usize>,
    /// Distances (n_source × distinct true vertices).
    distances: Mat<f64>,
    column_of: BTreeMap<u32, usize>,
    unit: f64,
}

impl<'a> Measure<'a> {
    /// Distances for at most `n_samples` (0: all) of the samples that both shapes have.
    pub fn new(
        source: &'a MatchingShape,
        target: &'a MatchingShape,
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
        Ok(Self { source, target, samples, distances, column_of, unit: mesh.area().sqrt() })
    }

    /// Mean error of a map between the originals, and against the mirrored truth where it is known,
    /// × 100 / √area.
    pub fn of(&self, map: &PointMap) -> Result<(f64, Option<f64>)> {
        if map.n_target() != self.target.shape.original().n_vertices() {
            let expected = self.target.shape.original().n_vertices().to_string();
            return Err(Error::invalid(
                "vertices of the map",
                expected,
                map.n_target().to_string(),
            ));
        }
        let mean = |truth: &[u32]| {
            let distance = |&i: &usize| {
                let sent = map.source_of[self.target.truth[i] as usize];
                self.distances[(sent as usize, self.column_of[&truth[i]])]
            };
            let total: f64 = self.samples.iter().map(distance).sum();
            100.0 * total / (self.samples.len() as f64 * self.unit)
        };
        Ok((mean(&self.source.truth), self.source.mirrored.as_deref().map(mean)))
    }
}
