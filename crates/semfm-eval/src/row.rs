//! Rows of the results: one pair and one method (what was found, how good it was, how long it took),
//! and one object.

use std::collections::BTreeMap;

use semfm::Verdict;
use semfm::fmap::metrics::{area_iou, iou};
use semfm::fmap::{AnchorReport, Evidence};
use semfm::{Region, Transfer};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::bootstrap::PairKey;

/// The score of one method on one pair. Fields that hold times, and nothing else, end in `_ms` or are
/// named `paper_runtime`; all others are the same at every thread count.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Group of the pair.
    pub group: String,
    /// Category of the objects.
    pub category: String,
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
    /// Name of the method.
    pub method: String,
    /// Intersection over union in vertices; none where the pair could not be tried. A method that
    /// was asked and gave no answer has 0.
    pub iou: Option<f64>,
    /// The same by area.
    pub area_iou: Option<f64>,
    /// What the method said of itself.
    pub confidence: Option<f64>,
    /// What it advised.
    pub verdict: Option<Verdict>,
    /// The numbers behind the confidence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<Evidence>,
    /// Vertices of the region found.
    pub n_found: usize,
    /// Vertices of the true region.
    pub n_truth: usize,
    /// IoU of the best of its alternatives.
    pub best_hypothesis_iou: Option<f64>,
    /// Whether the paper's f(k₁) ≈ k₂ holds, anchor by anchor.
    #[serde(default)]
    pub anchors: Vec<AnchorRow>,
    /// Dirichlet energy of the point map.
    pub dirichlet_energy: Option<f64>,
    /// Why there is no score, or no answer.
    pub failure: Option<Failure>,
    /// Where the prediction is, relative to the results.
    pub prediction: Option<String>,
    /// What only rows of a vision-language model have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vlm: Option<VlmDetails>,
    /// Milliseconds by stage, both objects' preparation included (made cold).
    #[serde(default)]
    pub stages_ms: BTreeMap<String, f64>,
    /// Milliseconds from prepared objects to the region.
    pub matching_ms: Option<f64>,
    /// Milliseconds from embeddings to the region.
    pub cold_ms: Option<f64>,
    /// Seconds from meshes to the region: views, embedding and everything after them, without
    /// reconstruction. Only this stands beside the paper's runtimes. None where nobody measured what
    /// the encoder took.
    pub paper_runtime: Option<f64>,
}

/// What the results say of an object.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectRow {
    /// Its name.
    pub name: String,
    /// Its category.
    pub category: String,
    /// Hash of the mesh as read.
    pub mesh: String,
    /// Vertices as read.
    pub n_vertices: usize,
    /// Triangles as read.
    pub n_triangles: usize,
    /// Vertices of the true region.
    pub n_region: usize,
    /// Names of its parts.
    pub parts: Vec<String>,
    /// Name of the encoder that made the features of our views.
    pub encoder: Option<String>,
    /// Version of its weights.
    #[serde(default)]
    pub encoder_version: Option<String>,
    /// Rotations that were averaged in them.
    pub rolls: Option<u32>,
    /// Share of the samples that some view saw.
    pub seen: Option<f64>,
    /// Why it cannot take part.
    pub failure: Option<Failure>,
}

/// One anchor and how the map treats it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnchorRow {
    /// Cluster of the source.
    pub source: u32,
    /// Its partner on the target.
    pub target: u32,
    /// Cosine of their mean features.
    pub cosine: f64,
    /// How much that exceeds the best rival; none without a rival.
    pub margin: Option<f64>,
    /// Share of the source's anchor (by area, as carried) that lands in the partner.
    pub landed: f64,
    /// Mean distance of what was carried from the partner, in √area; none where nothing was.
    pub mean_distance: Option<f64>,
}

/// Why there is no score, or no answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// `object`, `features`, `transfer` (the pair could not be tried), or what a model's client says
    /// (`refusal`, `prose`, …: it was asked, and the IoU is 0).
    pub kind: String,
    /// What happened, in words.
    pub text: String,
}

/// What only rows of a vision-language model have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VlmDetails {
    /// Views it was shown.
    pub n_views: usize,
    /// How it was asked to answer.
    pub mode: String,
    /// Name of the model.
    pub model: String,
    /// Whether a real model answered, and not a stand-in.
    pub real_model: bool,
    /// How much the views contradict each other.
    pub inconsistency: Option<f64>,
    /// Tokens in and out.
    pub tokens: serde_json::Value,
}

impl ObjectRow {
    /// Category and name.
    pub(crate) fn key(&self) -> (String, String) {
        (self.category.clone(), self.name.clone())
    }
}

impl Failure {
    pub(crate) fn new(kind: &str, text: impl ToString) -> Self {
        Self { kind: kind.into(), text: text.to_string() }
    }
}

impl From<&AnchorReport> for AnchorRow {
    fn from(report: &AnchorReport) -> Self {
        let AnchorReport { anchor, error } = report;
        Self {
            source: anchor.source,
            target: anchor.target,
            cosine: anchor.cosine,
            margin: Some(anchor.margin).filter(|margin| margin.is_finite()),
            landed: error.landed,
            mean_distance: error.mean_distance,
        }
    }
}

impl Row {
    /// Fills in how well `found` meets `truth`, on a target with these vertex areas.
    pub(crate) fn score(&mut self, found: &Region, truth: &Region, areas: &[f64]) -> Result<()> {
        self.iou = Some(iou(found, truth)?);
        self.area_iou = Some(area_iou(found, truth, areas)?);
        self.n_found = found.vertices().len();
        self.n_truth = truth.vertices().len();
        Ok(())
    }

    /// Fills in all that a transfer says, its score included.
    pub(crate) fn take(&mut self, found: &Transfer, truth: &Region, areas: &[f64]) -> Result<()> {
        self.score(&found.region, truth, areas)?;
        self.confidence = Some(found.confidence);
        self.evidence = Some(found.report.evidence);
        self.verdict = Some(found.verdict);
        let alternatives = found
            .hypotheses
            .iter()
            .map(|h| iou(&h.region, truth))
            .collect::<semfm::fmap::Result<Vec<_>>>()?;
        self.best_hypothesis_iou = alternatives.into_iter().reduce(f64::max);
        self.anchors = found.report.anchors.iter().map(AnchorRow::from).collect();
        self.dirichlet_energy = Some(found.report.map.dirichlet_energy);
        Ok(())
    }

    /// The same row without any time: what must not depend on machine or threads.
    pub fn without_times(&self) -> Self {
        let mut row = self.clone();
        row.stages_ms.clear();
        (row.matching_ms, row.cold_ms, row.paper_runtime) = (None, None, None);
        row
    }

    /// The pair.
    pub fn pair_key(&self) -> PairKey<'_> {
        PairKey { group: &self.group, source: &self.source, target: &self.target }
    }

    /// The IoU; 0 where the pair could not be tried.
    pub(crate) fn iou_or_zero(&self) -> f64 {
        self.iou.unwrap_or(0.0)
    }

    /// Group, source, target and method: what no two rows share.
    pub fn key(&self) -> [&str; 4] {
        [&self.group, &self.source, &self.target, &self.method]
    }
}
