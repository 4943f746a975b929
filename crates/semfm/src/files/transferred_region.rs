//! `region.json` of a transfer: a region file that also says how sure the transfer is and where
//! else the region may belong.

use std::path::Path;

use semfm_fmap::{Hypothesis, Method};
use semfm_geom::io::read_json;
use semfm_geom::{Mesh, Verdict};
use serde::{Deserialize, Serialize};

use super::region::{RegionFile, weights_at};
use super::write_json;
use crate::{Result, Transfer};

/// A transferred region as its file has it. It is read as a region file, too.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferredRegionFile {
    /// The region on the target.
    #[serde(flatten)]
    pub region: RegionFile,
    /// The method.
    pub method: Method,
    /// The probability that the region is right.
    pub confidence: f64,
    /// What to do with it.
    pub verdict: Verdict,
    /// Where the region may belong, by falling probability.
    pub hypotheses: Vec<HypothesisRecord>,
}

/// One place where the region may belong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HypothesisRecord {
    /// Vertex ids, 0-based.
    pub vertices: Vec<u32>,
    /// Weights parallel to `vertices`.
    pub weights: Vec<f64>,
    /// Share of the votes that fell there.
    pub probability: f64,
}

impl TransferredRegionFile {
    /// The file of a transfer to `target`.
    pub fn new(transfer: &Transfer, target: &Mesh) -> Self {
        Self {
            region: RegionFile::new(&transfer.region, target),
            method: transfer.report.settings.method,
            confidence: transfer.confidence,
            verdict: transfer.verdict,
            hypotheses: transfer.hypotheses.iter().map(HypothesisRecord::new).collect(),
        }
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not of this format.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(read_json(path)?)
    }
}

impl HypothesisRecord {
    pub(super) fn new(hypothesis: &Hypothesis) -> Self {
        let vertices = hypothesis.region.vertices();
        let weights = weights_at(&hypothesis.region, &vertices);
        Self { vertices, weights, probability: hypothesis.probability }
    }
}
