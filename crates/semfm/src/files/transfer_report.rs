//! `report.json`: how a transfer came about. Format `semfm.report/1`.

use std::path::Path;

use semfm_fmap::{Stages, TransferReport};
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::{MeshIdentity, ShapeReport, Verdict};
use semfm_views::LiftSettings;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::transfer_folder::TransferResult;
use super::write_json;
use crate::{EncoderRecord, Prepared, Result, Transfer};

/// The format that is written.
const FORMAT: &str = "semfm.report/1";

/// The report of a transfer as its file has it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TransferReportFile {
    /// `semfm.report/1`.
    pub format: String,
    /// The probability that the region is right.
    pub confidence: f64,
    /// What to do with the region.
    pub verdict: Verdict,
    /// Why it is not accepted, in words, where more is known than that it is doubtful.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// The demonstrated object.
    pub source: ObjectRecord,
    /// The object to act on.
    pub target: ObjectRecord,
    /// How the matching went; its stages include the preparation of both objects.
    #[serde(flatten)]
    pub transfer: TransferReport,
    /// Where the transfer came from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// How an object was prepared.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ObjectRecord {
    /// Its mesh.
    pub mesh: MeshIdentity,
    /// Working mesh and eigenbasis.
    pub shape: ShapeReport,
    /// Whether the shape was read from the cache.
    pub from_cache: bool,
    /// The encoder behind its features, where it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<EncoderRecord>,
    /// Its semantic cloud.
    pub cloud: CloudRecord,
}

/// The semantic cloud of an object.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CloudRecord {
    /// Points.
    pub n_points: usize,
    /// Numbers of a feature.
    pub dim: usize,
    /// Points that at least one view saw, where the features were lifted from views.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_seen: Option<usize>,
    /// What each view contributed, where the features were lifted from views.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lifted_by_view: Option<Vec<usize>>,
}

/// Where a transfer came from: whatever the program that made it knows.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Provenance {
    /// The files that it was made from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub files: Option<TransferInputs>,
    /// How features were lifted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lift: Option<LiftSettings>,
    /// Seeds of what was drawn by chance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seeds: Option<Seeds>,
    /// Version of the program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// IoU with the true region, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iou: Option<f64>,
    /// True where the features were made up, without a network.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulated: Option<bool>,
    /// Further entries, kept as they are.
    #[serde(flatten)]
    pub more: Map<String, Value>,
}

/// The files that a transfer was made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferInputs {
    /// The source's mesh.
    pub source: String,
    /// The target's mesh.
    pub target: String,
    /// The region on the source.
    pub region: String,
}

/// Seeds of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seeds {
    /// Of the surface samples that features are lifted to.
    pub lift: u64,
    /// Of the semantic clusters.
    pub clusters: u64,
}

impl TransferReportFile {
    /// The report of a transfer.
    pub fn new(result: &TransferResult<'_>) -> Self {
        let TransferResult { source, target, transfer, .. } = *result;
        let stages_ms = stages_ms(source, target, transfer);
        Self {
            format: FORMAT.into(),
            confidence: transfer.confidence,
            verdict: transfer.verdict,
            why: transfer.why().map(str::to_owned),
            source: ObjectRecord::new(source),
            target: ObjectRecord::new(target),
            transfer: TransferReport { stages_ms, ..transfer.report.clone() },
            provenance: result.provenance.clone(),
        }
    }

    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
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
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or lacks a field,
    /// [`Error::Format`](crate::Error::Format) for another format.
    pub fn read(path: &Path) -> Result<Self> {
        let file: Self = read_json(path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        Ok(file)
    }
}

impl ObjectRecord {
    pub(super) fn new(prepared: &Prepared) -> Self {
        let (object, report) = (&prepared.object, &prepared.report);
        let lifted = report.lifted.as_ref();
        Self {
            mesh: MeshIdentity::of(object.shape().original()),
            shape: object.shape().report().clone(),
            from_cache: report.from_cache,
            encoder: report.encoder.clone(),
            cloud: CloudRecord {
                n_points: object.cloud().n_points(),
                dim: object.cloud().dim(),
                n_seen: lifted.map(|lifted| lifted.n_seen),
                lifted_by_view: lifted.map(|lifted| lifted.lifted_by_view.clone()),
            },
        }
    }
}

/// Milliseconds of wall time of every stage, preparation of both objects included. Stages of both objects run side by
/// side, so that their sum is more than what passed.
pub fn stages_ms(source: &Prepared, target: &Prepared, transfer: &Transfer) -> Stages {
    let mut stages = Stages::default();
    for (side, prepared) in [("source", source), ("target", target)] {
        for &(name, ms) in &prepared.report.stages_ms {
            stages.push(format!("{name}_{side}"), ms);
        }
    }
    transfer.report.stages_ms.iter().for_each(|(name, ms)| stages.push(name.to_owned(), ms));
    stages
}
