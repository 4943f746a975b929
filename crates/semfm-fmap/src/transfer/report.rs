//! How an answer came about, for people and for files.

use std::borrow::Cow;
use std::fmt;
use std::time::{Duration, Instant};

use semfm_geom::PointIndex;
use semfm_geom::math::DVec3;
use serde::de::{MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize};

use super::{Matching, Rule, TransferSettings, mask};
use crate::confidence::Evidence;
use crate::fit::FitReport;
use crate::metrics::{AnchorError, anchor_error, dirichlet_energy};
use crate::{Anchor, Result};

/// Time per stage in milliseconds, in the order in which the stages ran; a JSON object by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stages(Vec<(Cow<'static, str>, f64)>);

impl Stages {
    /// Name and milliseconds of each stage.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(stage, ms)| (&**stage, *ms))
    }

    /// Milliseconds in all.
    pub fn total_ms(&self) -> f64 {
        self.0.iter().map(|stage| stage.1).sum()
    }

    /// Runs `work` and books its time under `stage`.
    pub(super) fn time<T>(
        &mut self,
        stage: &'static str,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        let start = Instant::now();
        let result = work();
        self.put(stage, start.elapsed());
        result
    }

    /// Books time under `stage`, adding to what is there.
    pub(super) fn put(&mut self, stage: &'static str, time: Duration) {
        let ms = time.as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|entry| entry.0 == stage) {
            Some(entry) => entry.1 += ms,
            None => self.0.push((Cow::Borrowed(stage), ms)),
        }
    }
}

impl Serialize for Stages {
    fn serialize<S: serde::Serializer>(
        &self,
        serializer: S,
    ) -> std::result::Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (stage, ms) in &self.0 {
            map.serialize_entry(stage, ms)?;
        }
        map.end()
    }
}

/// Reads the names in the order of the file.
impl<'de> Deserialize<'de> for Stages {
    fn deserialize<D: serde::Deserializer<'de>>(
        deserializer: D,
    ) -> std::result::Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Stages;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("milliseconds by stage")
            }

            fn visit_map<A: MapAccess<'de>>(
                self,
                mut map: A,
            ) -> std::result::Result<Stages, A::Error> {
                let mut stages = Vec::new();
                while let Some((name, ms)) = map.next_entry::<String, f64>()? {
                    stages.push((Cow::Owned(name), ms));
                }
                Ok(Stages(stages))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}

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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Points of the source's and of the target's cloud.
    pub n_source: usize,
    /// Points of the target's cloud.
    pub n_target: usize,
    /// Largest relative change in the last iteration.
    pub change: f64,
    /// Whether it had to be computed in the log domain.
    pub log_domain: bool,
}

/// The answer under the other rule, beside the one that was asked for.
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
    /// Milliseconds by stage.
    pub stages_ms: Stages,
    /// Agreement of the method's region with the second opinion.
    pub agreement: f64,
    /// What the answer says about itself: the confidence of `fused` follows from it.
    pub evidence: Evidence,
    /// Share of the source's area in the region.
    pub source_area_share: f64,
    /// Share of the target's area in the region.
    pub target_area_share: f64,
    /// The semantic anchors, whether the method used them or not.
    pub anchors: Vec<AnchorReport>,
    /// The fit behind the first map, where there was one.
    pub fit: Option<FitReport>,
    /// Quality of the map.
    pub map: MapQuality,
    /// The transport between the clouds.
    pub transport: TransportReport,
    /// The other rule's answer, where the method computes both.
    pub other_rule: Option<OtherRule>,
}

impl Matching {
    pub(super) fn report(
        &self,
        (agreement, evidence): (f64, Evidence),
        other_iou: Option<f64>,
        votes: &[f64],
        inside: &[bool],
    ) -> TransferReport {
        let share = |mask: &[bool], areas: &[f64]| {
            let inside: f64 =
                mask.iter().zip(areas).filter(|(inside, _)| **inside).map(|(_, area)| area).sum();
            inside / areas.iter().sum::<f64>()
        };
        TransferReport {
            settings: self.settings.clone(),
            stages_ms: Stages::default(),
            agreement,
            evidence,
            source_area_share: share(inside, &self.source.shape().basis().mass),
            target_area_share: share(&mask(votes), &self.target.shape().basis().mass),
            anchors: self.anchor_reports(),
            fit: self.matched.fit.clone(),
            map: self.map_quality(),
            transport: TransportReport {
                n_source: self.plan.n_source(),
                n_target: self.plan.n_target(),
                change: self.plan.change,
                log_domain: self.plan.log_domain,
            },
            other_rule: other_iou.map(|iou| OtherRule { rule: self.settings.rule.other(), iou }),
        }
    }

    fn anchor_reports(&self) -> Vec<AnchorReport> {
        let carried =
            self.matched.point_map.pull_back(&self.source.vertex_labels(&self.parts.source));
        let labels = self.target.vertex_labels(&self.parts.target);
        let (mesh, areas) = (self.target.shape().mesh(), &self.target.shape().basis().mass);
        let report = |&anchor: &Anchor| {
            let from_source: Vec<bool> = carried.iter().map(|&l| l == anchor.source).collect();
            let partner: Vec<bool> = labels.iter().map(|&l| l == anchor.target).collect();
            let points: Vec<DVec3> = mesh
                .vertices()
                .iter()
                .zip(&partner)
                .filter(|(_, inside)| **inside)
                .map(|(p, _)| *p)
                .collect();
            let index = PointIndex::new(&points).ok(); // fails for no points: nowhere to measure to
            let distance =
                |j: usize| index.as_ref().map_or(0.0, |index| index.nearest(mesh.vertices()[j]).1);
            let error =
                anchor_error(&from_source, &partner, areas, distance, self.target.shape().unit());
            AnchorReport { anchor, error }
        };
        self.parts.anchors.pairs.iter().map(report).collect()
    }

    fn map_quality(&self) -> MapQuality {
        let (source, target) = (self.source.shape(), self.target.shape());
        let unit = source.unit();
        let scaled: Vec<DVec3> = source.mesh().vertices().iter().map(|&p| p / unit).collect();
        let map = self.matched.map.as_ref();
        let mut hit = vec![false; scaled.len()];
        self.matched.point_map.source_of.iter().for_each(|&i| hit[i as usize] = true);
        MapQuality {
            dirichlet_energy: dirichlet_energy(
                target.mesh(),
                &self.matched.point_map.pull_back(&scaled),
            ),
            orthogonality: map.map(|c| c.orthogonality()),
            commutativity: map.map(|c| c.commutativity(source.basis(), target.basis())),
            k: map.map(|c| c.k_target()),
            coverage: hit.iter().filter(|&&h| h).count() as f64 / hit.len() as f64,
        }
    }
}
