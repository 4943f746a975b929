//! How an answer came about.

use semfm_geom::math::DVec3;
use semfm_geom::{PointIndex, Shape};
use serde::{Deserialize, Serialize};

use crate::confidence::{CHECK, Evidence};
use crate::fit::FitReport;
use crate::methods::{ClusteredPair, Matched, Pair};
use crate::metrics::{AnchorError, anchor_error, dirichlet_energy};
use crate::settings::{Rule, TransferSettings};
use crate::stages::Stages;
use crate::transport::Plan;
use crate::{Anchor, PointMap};

/// An anchor and how the finished map treats it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnchorReport {
    /// The pair of clusters, its cosine and margin.
    #[serde(flatten)]
    pub anchor: Anchor,
    /// Whether the source's anchor arrived at its partner.
    #[serde(flatten)]
    pub error: AnchorError,
}

/// Quality measures of the map. They do not predict success, and nothing is decided by them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapQuality {
    /// Dirichlet energy of the point map with both shapes at area 1: 1 for the identity.
    pub dirichlet_energy: f64,
    /// ‖C Cᵀ − I‖ / √k, where there is a C.
    pub orthogonality: Option<f64>,
    /// ‖C Λ_source − Λ_target C‖ / (λ_max ‖C‖), where there is a C.
    pub commutativity: Option<f64>,
    /// Size of C, where there is one.
    pub k: Option<usize>,
    /// Share of the source's working vertices that some target vertex is matched to.
    pub coverage: f64,
}

/// How the transport went.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransportReport {
    /// Points of the source's cloud.
    pub n_source: usize,
    /// Points of the target's cloud.
    pub n_target: usize,
    /// Largest relative change in the last iteration.
    pub change: f64,
    /// Whether it had to be computed in the log domain.
    pub log_domain: bool,
}

/// The answer under the other rule, beside the chosen one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherRule {
    /// Which rule that is.
    pub rule: Rule,
    /// Area IoU of the two answers.
    pub iou: f64,
}

/// How a transfer came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferReport {
    /// The settings, map sizes clipped to the bases.
    pub settings: TransferSettings,
    /// Milliseconds of wall time by stage.
    pub stages_ms: Stages,
    /// Agreement (IoU by area) of the method's region with the second opinion, where there is one.
    pub agreement: Option<f64>,
    /// What the answer says about itself: the confidence of `fused` follows from it.
    pub evidence: Evidence,
    /// The probability that the objects are of one kind, where the encoder's scale of likeness is known. The
    /// confidence is that of the answer times this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub one_kind: Option<f64>,
    /// Where the target is the source's surface once more, whatever its place, size or tessellation: the share of the
    /// target's vertices that lie on it, each counted by how certain that is. They have the source's region as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub same_surface: Option<f64>,
    /// Share of the source's area in the region.
    pub source_area_share: f64,
    /// Share of the target's area in the region.
    pub target_area_share: f64,
    /// The semantic anchors, where the method or the caller asked for them ([`transfer`](crate::transfer)
    /// does).
    pub anchors: Vec<AnchorReport>,
    /// The fit behind the first map, where there was one.
    pub fit: Option<FitReport>,
    /// Quality of the map.
    pub map: MapQuality,
    /// The transport between the clouds, where the method or the second opinion needed it.
    pub transport: Option<TransportReport>,
    /// The other rule's answer, where the method computes both.
    pub other_rule: Option<OtherRule>,
}

impl TransferReport {
    /// Whether the objects are more likely of different kinds than of one, as far as that is known.
    pub fn is_not_alike(&self) -> bool {
        self.one_kind.is_some_and(|probability| probability < CHECK)
    }
}

impl TransportReport {
    pub(crate) fn of(plan: &Plan) -> Self {
        Self {
            n_source: plan.n_source(),
            n_target: plan.n_target(),
            change: plan.change,
            log_domain: plan.log_domain,
        }
    }
}

impl MapQuality {
    pub(crate) fn of(pair: &Pair, matched: &Matched) -> Self {
        let (source, target) = (pair.source.shape(), pair.target.shape());
        let unit = source.unit();
        let scaled: Vec<DVec3> = source.mesh().vertices().iter().map(|&p| p / unit).collect();
        let mut hit = vec![false; scaled.len()];
        matched.point_map.source_of.iter().for_each(|&i| hit[i as usize] = true);
        let map = matched.map.as_ref();
        Self {
            dirichlet_energy: dirichlet_energy(
                target.mesh(),
                &matched.point_map.pull_back(&scaled),
            ),
            orthogonality: map.map(|c| c.orthogonality()),
            commutativity: map.map(|c| c.commutativity(source.basis(), target.basis())),
            k: map.map(|c| c.k_target()),
            coverage: hit.iter().filter(|&&h| h).count() as f64 / hit.len() as f64,
        }
    }
}

/// How a point map between the working meshes treats each anchor.
pub(crate) fn anchor_reports(
    pair: &Pair,
    clustered: &ClusteredPair,
    point_map: &PointMap,
) -> Vec<AnchorReport> {
    let labels = clustered.vertex_labels(pair);
    let (arrived, target) = (point_map.pull_back(&labels.source), pair.target.shape());
    let report = clustered.anchors.pairs.iter().map(|&anchor| AnchorReport {
        anchor,
        error: error_of(
            &arrived.iter().map(|&l| l == anchor.source).collect::<Vec<bool>>(),
            &labels.target.iter().map(|&l| l == anchor.target).collect::<Vec<bool>>(),
            target,
        ),
    });
    report.collect()
}

/// How much of an anchor, `arrived` on the target's vertices, is off its `partner`.
fn error_of(arrived: &[bool], partner: &[bool], target: &Shape) -> AnchorError {
    let vertices = target.mesh().vertices();
    let inside = vertices.iter().zip(partner).filter(|(_, inside)| **inside);
    let points: Vec<DVec3> = inside.map(|(p, _)| *p).collect();
    let index = PointIndex::new(&points).ok(); // fails for no points: nowhere to measure to
    anchor_error(
        arrived,
        partner,
        &target.basis().mass,
        |j| index.as_ref().map_or(0.0, |index| index.nearest(vertices[j]).1),
        target.unit(),
    )
}

/// Share of the area that is inside.
pub(crate) fn area_share(inside: &[bool], areas: &[f64]) -> f64 {
    let marked = inside.iter().zip(areas).filter(|(inside, _)| **inside);
    let area: f64 = marked.map(|(_, area)| area).sum();
    area / areas.iter().sum::<f64>()
}
