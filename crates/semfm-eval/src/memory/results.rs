//! `memory.json`: what memories of some demonstrations said of every object.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use semfm::Verdict;
use semfm::fmap::fusion::FusionEvidence;
use semfm::geom::io::{read_json, write_json_pretty};
use serde::{Deserialize, Serialize};

use crate::calibration::Calibration;
use crate::row::{Failure, Row};
use crate::summary::POOR;
use crate::{Error, Result};

/// The format that is written.
pub const MEMORY_FORMAT: &str = "semfm.eval-memory/1";

/// Name of the file.
pub(super) const FILE: &str = "memory.json";

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemoryResults {
    /// Name and version of this format.
    pub format: String,
    /// Hash of the dataset.
    pub dataset: String,
    /// Names the features.
    pub embeddings: String,
    /// Objects of other kinds in each memory.
    pub n_distractors: usize,
    /// Demonstrations that were matched, at most.
    pub shortlist: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// One row for each target, number of demonstrations and draw.
    pub rows: Vec<MemoryRow>,
    /// One for each number of demonstrations, over all targets and over either half of them.
    pub summaries: Vec<MemorySummary>,
}

/// One target and one memory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MemoryRow {
    /// Group of the target.
    pub group: String,
    /// Category of the target.
    pub category: String,
    /// Name of the target.
    pub target: String,
    /// Half of the objects that the target is in, by the hash of its name: what is chosen on one half is read on
    /// the other.
    pub half: u8,
    /// Demonstrations of the target's kind, at most.
    pub n: usize,
    /// Number of the draw.
    pub draw: usize,
    /// Names of those that were matched, the most similar first.
    pub matched: Vec<String>,
    /// How many of them are of the target's kind.
    pub n_of_kind: usize,
    /// The fused answer.
    pub fused: ScoredAnswer,
    /// The answer of the most confident demonstration.
    pub chosen: ScoredAnswer,
    /// IoU of the best of all answers: what choosing could reach.
    pub best_iou: f64,
    /// Mean IoU of the answers of the target's kind: what one demonstration is worth.
    pub mean_iou: f64,
    /// The numbers behind the fused confidence.
    pub evidence: Option<FusionEvidence>,
    /// Why there is no score.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failure>,
    /// Milliseconds from prepared objects to the answer.
    pub answer_ms: f64,
}

/// An answer, judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoredAnswer {
    /// IoU with the truth, in vertices.
    pub iou: f64,
    /// What it said of itself.
    pub confidence: f64,
    /// What it advised.
    pub verdict: Option<Verdict>,
}

/// Means over targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemorySummary {
    /// `all`, `half 0` or `half 1`.
    pub targets: String,
    /// Demonstrations of the target's kind, at most.
    pub n: usize,
    /// Targets.
    pub n_targets: usize,
    /// Mean number of demonstrations of the target's kind that were matched.
    pub mean_of_kind: f64,
    /// Mean IoU of single demonstrations.
    pub single: f64,
    /// Mean IoU of the most confident.
    pub chosen: f64,
    /// Mean IoU of the fused answers.
    pub fused: f64,
    /// The same by categories.
    pub fused_by_category: f64,
    /// Mean IoU of the best answers.
    pub best: f64,
    /// Share of the fused answers below .3.
    pub poor: f64,
    /// How well the fused confidence is calibrated.
    pub calibration: Option<Calibration>,
    /// The same for the most confident demonstration's.
    pub chosen_calibration: Option<Calibration>,
    /// Median milliseconds from prepared objects to the answer.
    pub median_ms: f64,
}

impl MemoryResults {
    /// Reads `memory.json`, or the one in a folder.
    ///
    /// # Errors
    /// [`Error::Facade`] where it cannot be read, [`Error::Format`] for a file of another format.
    pub fn read(path: &Path) -> Result<Self> {
        let path = if path.is_dir() { path.join(FILE) } else { path.to_owned() };
        let results: Self = read_json(&path)?;
        if results.format != MEMORY_FORMAT {
            return Err(Error::format(&path, "format", MEMORY_FORMAT, results.format));
        }
        Ok(results)
    }

    /// Writes `memory.json` and `memory.md` into `folder`, each whole or not at all.
    ///
    /// # Errors
    /// [`Error::Facade`] where they cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let (json, table) = (folder.join(FILE), folder.join("memory.md"));
        write_json_pretty(&json, self)?;
        semfm::geom::io::write_atomically(&table, |out| {
            out.write_all(self.to_markdown().as_bytes())
        })?;
        Ok(vec![json, table])
    }

    /// The same without times.
    pub fn without_times(&self) -> Self {
        let mut same = self.clone();
        same.rows.iter_mut().for_each(|row| row.answer_ms = 0.0);
        same.summaries.iter_mut().for_each(|summary| summary.median_ms = 0.0);
        same
    }
}

impl MemorySummary {
    /// Summaries of all numbers of demonstrations, over all targets and over the halves.
    pub(super) fn all_of(rows: &[MemoryRow]) -> Vec<Self> {
        let counts: BTreeSet<usize> = rows.iter().map(|row| row.n).collect();
        let mut summaries = Vec::new();
        for half in [None, Some(0), Some(1)] {
            for &n in &counts {
                let scored = rows.iter().filter(|row| row.n == n && row.failure.is_none());
                let of_half: Vec<&MemoryRow> =
                    scored.filter(|row| half.is_none_or(|half| row.half == half)).collect();
                summaries.extend(Self::of(half, n, &of_half));
            }
        }
        summaries
    }

    fn of(half: Option<u8>, n: usize, rows: &[&MemoryRow]) -> Option<Self> {
        if rows.is_empty() {
            return None;
        }
        let mean = |value: fn(&MemoryRow) -> f64| mean_by_target(rows, value);
        let fused = by_target(rows, |row| row.fused.iou);
        let mut categories = BTreeMap::<&str, Vec<f64>>::new();
        for (target, iou) in &fused {
            categories.entry(target.category).or_default().push(*iou);
        }
        let of_categories: Vec<f64> = categories.values().map(|ious| mean_of(ious)).collect();
        let mut times: Vec<f64> = rows.iter().map(|row| row.answer_ms).collect();
        times.sort_by(f64::total_cmp);
        Some(Self {
            targets: half.map_or("all".into(), |half| format!("half {half}")),
            n,
            n_targets: fused.len(),
            mean_of_kind: mean(|row| row.n_of_kind as f64),
            single: mean(|row| row.mean_iou),
            chosen: mean(|row| row.chosen.iou),
            fused: mean(|row| row.fused.iou),
            fused_by_category: mean_of(&of_categories),
            best: mean(|row| row.best_iou),
            poor: mean(|row| f64::from(u8::from(row.fused.iou < POOR))),
            calibration: calibration("fused", rows, |row| row.fused),
            chosen_calibration: calibration("chosen", rows, |row| row.chosen),
            median_ms: times[times.len() / 2],
        })
    }
}

/// A target, as keys have it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Target<'a> {
    category: &'a str,
    group: &'a str,
    name: &'a str,
}

/// The mean of a value over the draws of each target.
fn by_target<'a>(rows: &[&'a MemoryRow], value: fn(&MemoryRow) -> f64) -> Vec<(Target<'a>, f64)> {
    let mut values = BTreeMap::<Target<'a>, Vec<f64>>::new();
    for row in rows {
        let target = Target { category: &row.category, group: &row.group, name: &row.target };
        values.entry(target).or_default().push(value(row));
    }
    values.into_iter().map(|(target, values)| (target, mean_of(&values))).collect()
}

fn mean_by_target(rows: &[&MemoryRow], value: fn(&MemoryRow) -> f64) -> f64 {
    let values: Vec<f64> = by_target(rows, value).into_iter().map(|(_, value)| value).collect();
    mean_of(&values)
}

fn mean_of(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn calibration(
    name: &str,
    rows: &[&MemoryRow],
    answer: fn(&MemoryRow) -> ScoredAnswer,
) -> Option<Calibration> {
    let judged: Vec<Row> = rows
        .iter()
        .map(|row| {
            let ScoredAnswer { iou, confidence, verdict } = answer(row);
            Row { iou: Some(iou), confidence: Some(confidence), verdict, ..Row::default() }
        })
        .collect();
    Calibration::of(name, judged.iter())
}
