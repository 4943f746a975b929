//! `report.json` of a memory's answer: who said what. Format `semfm.memory_report/1`.

use std::path::{Path, PathBuf};

use semfm_fmap::fusion::Trust;
use semfm_fmap::{Evidence, Stages};
use semfm_geom::io::{FormatError, StagedFolder, read_json};
use semfm_geom::{Mesh, Verdict};
use serde::{Deserialize, Serialize};

use super::memory::MemoryEncoder;
use super::region::RegionFile;
use super::transfer_folder::{put_transfer, write_upright, write_weighted};
use super::transfer_report::{ObjectRecord, Provenance};
use super::transferred_region::{HypothesisRecord, TransferredRegionFile};
use super::write_json;
use crate::memory::{EntryAnswer, Memory, MemoryTransfer};
use crate::{Prepared, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.memory_report/1";

/// The report of a memory's answer as its file has it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MemoryReportFile {
    /// `semfm.memory_report/1`.
    pub format: String,
    /// The probability that the region is right.
    pub confidence: f64,
    /// What to do with the region.
    pub verdict: Verdict,
    /// Why it is not accepted, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Mean IoU of the answers with the fused region, by their shares.
    pub agreement: f64,
    /// The object to act on.
    pub target: ObjectRecord,
    /// The memory's folder.
    pub memory: String,
    /// Demonstrations in it.
    pub n_entries: usize,
    /// The encoder behind all features.
    pub encoder: Option<MemoryEncoder>,
    /// What each demonstration said, the most trusted first.
    pub answers: Vec<EntryAnswerRecord>,
    /// Milliseconds by stage.
    pub stages_ms: Stages,
    /// Where the answer came from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// What one demonstration said.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct EntryAnswerRecord {
    /// Name of the entry.
    pub name: String,
    /// Its kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Cosine of its mean feature with that of the target.
    pub similarity: f64,
    /// The probability that its own answer is right.
    pub confidence: f64,
    /// The verdict on its own answer.
    pub verdict: Verdict,
    /// The numbers behind that.
    pub evidence: Evidence,
    /// Vertices of its own answer.
    pub n_vertices: usize,
    /// How far it was trusted.
    #[serde(flatten)]
    pub trust: Trust,
}

impl MemoryReportFile {
    /// The report of an answer.
    pub fn new(
        memory: &Memory,
        target: &Prepared,
        answer: &MemoryTransfer,
        provenance: Provenance,
    ) -> Self {
        let mut stages_ms = Stages::default();
        for &(name, ms) in &target.report.stages_ms {
            stages_ms.push(format!("{name}_target"), ms);
        }
        answer.stages_ms.iter().for_each(|(name, ms)| stages_ms.push(name.to_owned(), ms));
        Self {
            format: FORMAT.into(),
            confidence: answer.fused.confidence,
            verdict: answer.fused.verdict,
            why: answer.why(),
            agreement: answer.fused.agreement,
            target: ObjectRecord::new(target),
            memory: memory.folder().display().to_string(),
            n_entries: answer.n_entries,
            encoder: memory.encoder().cloned(),
            answers: answer.answers.iter().map(EntryAnswerRecord::new).collect(),
            stages_ms,
            provenance,
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

impl EntryAnswerRecord {
    fn new(said: &EntryAnswer) -> Self {
        Self {
            name: said.entry.name.clone(),
            kind: said.entry.kind.clone(),
            similarity: said.similarity,
            confidence: said.transfer.confidence,
            verdict: said.transfer.verdict,
            evidence: said.transfer.report.evidence,
            n_vertices: said.transfer.region.vertices().len(),
            trust: said.trust,
        }
    }
}

/// Writes the answer of a memory into `folder`, which is made if it is not there: `region.json` and
/// `report.json`, and unless `answer_alone` also `target.ply` and `target.glb`. What an earlier transfer left
/// besides is removed. Returns the paths.
///
/// # Errors
/// As [`write_transfer`](super::write_transfer).
pub fn write_memory_answer(
    folder: &Path,
    target: &Prepared,
    answer: &MemoryTransfer,
    report: &MemoryReportFile,
    answer_alone: bool,
) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    let path = |name: &str| staged.path().join(name);
    let mesh = target.object.shape().original();
    region_file(answer, mesh).write(&path("region.json"))?;
    report.write(&path("report.json"))?;
    if !answer_alone {
        let weights = answer.fused.region.weights();
        write_weighted(&path("target.ply"), mesh, weights)?;
        write_upright(&path("target.glb"), mesh, weights)?;
    }
    put_transfer(staged)
}

/// `region.json`, as that of a transfer.
fn region_file(answer: &MemoryTransfer, target: &Mesh) -> TransferredRegionFile {
    let fused = &answer.fused;
    TransferredRegionFile {
        region: RegionFile::new(&fused.region, target),
        method: answer.method,
        confidence: fused.confidence,
        verdict: fused.verdict,
        hypotheses: fused.hypotheses.iter().map(HypothesisRecord::new).collect(),
    }
}
