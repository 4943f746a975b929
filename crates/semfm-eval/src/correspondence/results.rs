//! `results.json` of an evaluation of maps.

use std::path::{Path, PathBuf};

use semfm::geom::io::write_json_pretty;
use serde::{Deserialize, Serialize};

use super::map_method::MapMethod;
use crate::bootstrap::{BootstrapSettings, PairDraws, PairKey, weighted_mean};
use crate::{Result, results};

/// The format that is written.
pub const MAP_FORMAT: &str = "semfm.eval-maps/1";

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapResults {
    /// Name and version of this format.
    pub format: String,
    /// The folder.
    pub path: PathBuf,
    /// Its hash.
    pub dataset: String,
    /// Samples that errors are means of, at most; 0 for all.
    pub n_samples: usize,
    /// Whether vertices were sent to points of triangles instead of vertices.
    #[serde(default)]
    pub precise: bool,
    /// One row per pair and method.
    pub rows: Vec<MapRow>,
    /// Every set and method.
    pub summaries: Vec<MapSummary>,
}

/// One pair and one method.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapRow {
    /// Name of the set.
    pub set: String,
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
    /// Name of the method.
    pub method: String,
    /// Mean geodesic error × 100 / √area.
    pub error: Option<f64>,
    /// The same against the mirrored truth, where it is known.
    pub mirror_error: Option<f64>,
    /// Whether the mirrored answer is the nearer one.
    pub flipped: Option<bool>,
    /// Why there is no error.
    pub failure: Option<String>,
    /// Milliseconds for the map, from prepared shapes.
    pub map_ms: Option<f64>,
}

/// One method on one set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapSummary {
    /// Name of the set.
    pub set: String,
    /// Name of the method.
    pub method: String,
    /// Pairs with an error.
    pub n: usize,
    /// Mean error.
    pub error: Option<f64>,
    /// 95 % interval, shapes resampled.
    pub interval: Option<[f64; 2]>,
    /// Mean error against the mirrored truth.
    pub mirror_error: Option<f64>,
    /// Mean of the smaller of the two, pair by pair.
    pub best_error: Option<f64>,
    /// Share of pairs whose mirrored answer is the nearer one.
    pub flip_rate: Option<f64>,
    /// Median milliseconds for the map.
    pub median_map_ms: Option<f64>,
}

impl MapResults {
    /// Reads `results.json`, or the one in a folder.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Format`] for a file of another format.
    pub fn read(path: &Path) -> Result<Self> {
        results::read_results(path, MAP_FORMAT, |results: &Self| &results.format)
    }

    /// Writes `results.json` into `folder`, whole or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Facade`] where it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(results::FILE);
        write_json_pretty(&path, self)?;
        Ok(path)
    }

    /// The same without times.
    pub fn without_times(&self) -> Self {
        let mut same = self.clone();
        same.rows.iter_mut().for_each(|row| row.map_ms = None);
        same.summaries.iter_mut().for_each(|summary| summary.median_map_ms = None);
        same
    }

    /// The sets in the order of the summaries.
    pub(crate) fn sets(&self) -> Vec<&str> {
        let mut sets: Vec<&str> = Vec::new();
        for summary in &self.summaries {
            if !sets.contains(&summary.set.as_str()) {
                sets.push(&summary.set);
            }
        }
        sets
    }

    /// The summaries of one set.
    pub(crate) fn of_set<'a>(&'a self, set: &str) -> Vec<&'a MapSummary> {
        self.summaries.iter().filter(|summary| summary.set == set).collect()
    }
}

impl MapRow {
    /// The smaller of the errors against the truth and against its mirror image.
    fn best_error(&self) -> Option<f64> {
        Some(self.error?.min(self.mirror_error?))
    }
}

impl MapSummary {
    /// Sums up the rows of one method on one set.
    pub(super) fn of(
        set: &str,
        method: MapMethod,
        rows: &[MapRow],
        bootstrap: &BootstrapSettings,
    ) -> Self {
        let own: Vec<&MapRow> =
            rows.iter().filter(|r| r.set == set && r.method == method.name()).collect();
        let errors: Vec<Option<f64>> = own.iter().map(|row| row.error).collect();
        let pairs: Vec<PairKey<'_>> = own
            .iter()
            .map(|row| PairKey { group: &row.set, source: &row.source, target: &row.target })
            .collect();
        let draws = PairDraws::new(&pairs, bootstrap);
        let mut times: Vec<f64> = own.iter().filter_map(|row| row.map_ms).collect();
        times.sort_by(f64::total_cmp);
        Self {
            set: set.into(),
            method: method.name().into(),
            n: errors.iter().flatten().count(),
            error: mean(&own, |row| row.error),
            interval: draws.interval(|weights| weighted_mean(&errors, weights)),
            mirror_error: mean(&own, |row| row.mirror_error),
            best_error: mean(&own, MapRow::best_error),
            flip_rate: mean(&own, |row| row.flipped.map(|flipped| f64::from(u8::from(flipped)))),
            median_map_ms: times.get(times.len() / 2).copied(),
        }
    }
}

/// Mean of a value over the rows that have it.
fn mean(rows: &[&MapRow], value: fn(&MapRow) -> Option<f64>) -> Option<f64> {
    let values: Vec<Option<f64>> = rows.iter().map(|row| value(row)).collect();
    weighted_mean(&values, &vec![1.0; rows.len()])
}
