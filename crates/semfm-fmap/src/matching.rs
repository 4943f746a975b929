//! A matched pair, and the short call that transfers one region.

use std::sync::OnceLock;

use semfm_geom::{Shape, Task};

use crate::confidence::{
    Answer, Evidence, MOST_WITHOUT_FEATURES, probability_by_agreement, verdict,
};
use crate::congruence::Congruence;
use crate::hypotheses::{Hypothesis, hypotheses, is_connected};
use crate::method::Method;
use crate::methods::{ConfidenceRule, Matched, Pair, at_threshold, by_map, mask, on_points};
use crate::metrics::overlap;
use crate::report::{
    AnchorReport, MapQuality, OtherRule, TransferReport, TransportReport, anchor_reports,
    area_share,
};
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::transfer::Transfer;
use crate::{Anchors, Error, FunctionalMap, PointMap, PreparedObject, Region, Result};

/// Transfers `region`, which lies on the source's original vertices, to the target: a [`Matching`]
/// for one region. Its report lists the anchors where the method reads them.
///
/// # Errors
/// [`Error::EmptyRegion`], [`Error::Length`] where the region is not one of the source's mesh or
/// the features differ in dimension, [`Error::OutOfRange`] for impossible settings and for a method that
/// reads features where an object has none,
/// [`Error::LinearAlgebra`], [`Error::NotOriented`] for `wks` with an orientation, [`Error::Geom`] on
/// cancellation. A region that lands nowhere is no error but a refusal.
pub fn transfer(
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Transfer> {
    check_region(region, source.shape().original().n_vertices())?;
    Matching::new(source, target, settings, task)?.transfer(region)
}

/// [`transfer`] with a report that lists the anchors whatever the method, where there are features: for answers that
/// people look at.
///
/// # Errors
/// As [`transfer`].
pub fn transfer_with_anchors(
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Transfer> {
    check_region(region, source.shape().original().n_vertices())?;
    let mut matching = Matching::new(source, target, settings, task)?;
    if source.has_features() {
        matching.stages.time("anchors", || matching.pair.select_anchors(task).map(drop))?;
    }
    matching.transfer(region)
}

/// A matched pair: computed once, it transfers any number of regions.
pub struct Matching {
    pair: Pair,
    settings: TransferSettings,
    matched: Matched,
    /// The second opinion beside a method without a map: the map of `fused`.
    second_map: Option<SecondMap>,
    stages: Stages,
    /// What reports and answers say of the match, whatever the region: made for the first one.
    point_map: OnceLock<PointMap>,
    quality: OnceLock<MapQuality>,
    anchor_reports: OnceLock<Vec<AnchorReport>>,
}

/// A map of `fused` beside another method, and the settings that it was made with.
struct SecondMap {
    settings: TransferSettings,
    matched: Matched,
}

/// One region: where it lies on the source and what the method says of the target.
struct Voted {
    /// Whether each working vertex of the source (n_source) is inside.
    inside: Vec<bool>,
    /// The method's votes on the target's working vertices (n_target), threshold at
    /// [`Region::COUNTS`].
    votes: Vec<f64>,
}

impl Matching {
    /// Matches two prepared objects by the method and constants of `settings`. Map sizes are clipped
    /// to what both bases hold, and the report says so.
    ///
    /// # Errors
    /// As [`transfer`], those of the region aside.
    pub fn new(
        source: &PreparedObject,
        target: &PreparedObject,
        settings: &TransferSettings,
        task: &Task,
    ) -> Result<Self> {
        semfm_geom::keep_faer_sequential();
        settings.check()?;
        let available = source.shape().basis().k().min(target.shape().basis().k());
        let mut settings = settings.clipped(available);
        let info = settings.method.info();
        check_features(source, target, settings.method)?;
        // Another opinion of the same signatures would be none.
        settings.second_opinion &= source.has_features();
        let mut stages = Stages::default();
        task.check()?;
        let pair = Pair::new(source, target, &settings, &mut stages)?;
        let matched = (info.matched)(&pair, &settings, &mut stages, task)?;
        let mut second_map = None;
        if settings.second_opinion && info.has_map {
            pair.couple(&mut stages, task)?;
        } else if settings.second_opinion {
            let settings = settings.as_fused(available);
            let matched = (Method::Fused.info().matched)(&pair, &settings, &mut stages, task)?;
            second_map = Some(SecondMap { settings, matched });
        }
        Ok(Self {
            pair,
            settings,
            matched,
            second_map,
            stages,
            point_map: OnceLock::new(),
            quality: OnceLock::new(),
            anchor_reports: OnceLock::new(),
        })
    }

    /// The demonstrated object.
    pub fn source(&self) -> &PreparedObject {
        &self.pair.source
    }

    /// The object that regions are transferred to.
    pub fn target(&self) -> &PreparedObject {
        &self.pair.target
    }

    /// The semantic anchors of the pair, selected when first asked for: the methods `semfm` and
    /// `anchored` ask. Reports list them from then on.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for no clusters, [`Error::Geom`] where the eigensolver fails or on
    /// cancellation.
    pub fn anchors(&self, task: &Task) -> Result<&Anchors> {
        Ok(&self.pair.select_anchors(task)?.anchors)
    }

    /// The functional map between the working shapes, where the method makes one.
    pub fn functional_map(&self) -> Option<&FunctionalMap> {
        self.matched.map.as_ref()
    }

    /// The point map between the working meshes.
    pub fn working_point_map(&self) -> &PointMap {
        &self.matched.point_map
    }

    /// Transfers one region, which lies on the source's original vertices.
    ///
    /// # Errors
    /// [`Error::EmptyRegion`], [`Error::Length`] where it is not one of the source's mesh.
    pub fn transfer(&self, region: &Region) -> Result<Transfer> {
        check_region(region, self.source().shape().original().n_vertices())?;
        let mut stages = self.stages.clone();
        let mut transfer = stages.time("vote", || self.answer(region))?;
        stages.time("report", || self.complete(&mut transfer.report));
        transfer.report.stages_ms = stages;
        Ok(transfer)
    }

    /// The answer, with a report that lacks what does not depend on the region.
    fn answer(&self, region: &Region) -> Result<Transfer> {
        let (source, target) = (self.source().shape(), self.target().shape());
        let areas = &target.basis().mass;
        let voted = self.vote(region)?;
        let second = self.second_opinion(&voted.inside)?;
        let answer = mask(&voted.votes);
        let agreement = second.as_ref().map(|second| overlap(&answer, &mask(second), areas));
        let other = self.other_rule(&voted.inside)?;
        let other_iou = other.as_ref().map(|other| overlap(&answer, &mask(other), areas));
        let region = self.onto_original(&voted.votes, &region.mask())?;
        let evidence = Evidence { likeness: self.likeness()?, ..self.evidence(&voted, &answer) };
        let one_kind = evidence.likeness.and_then(|likeness| self.one_kind(likeness));
        let confidence = match (self.settings.method.info().confidence, agreement) {
            _ if region.is_empty() => 0.0,
            (ConfidenceRule::Agreement, Some(agreement)) => probability_by_agreement(agreement),
            _ => self.probability(&evidence),
        };
        let most = if self.source().has_features() { 1.0 } else { MOST_WITHOUT_FEATURES };
        let confidence = confidence.min(most) * one_kind.unwrap_or(1.0);
        Ok(Transfer {
            region,
            confidence,
            verdict: verdict(confidence),
            hypotheses: self.hypotheses(&voted, second.as_deref())?,
            point_map: self.point_map().clone(),
            other_rule: other.map(|votes| onto_original(target, &votes)).transpose()?,
            report: TransferReport {
                settings: self.settings.clone(),
                stages_ms: Stages::default(),
                agreement,
                evidence,
                one_kind,
                same_surface: self.matched.congruence.as_ref().map(Congruence::share),
                source_area_share: area_share(&voted.inside, &source.basis().mass),
                target_area_share: area_share(&answer, areas),
                anchors: Vec::new(),
                fit: self.matched.fit.clone(),
                map: MapQuality::default(),
                transport: self.pair.plan().map(TransportReport::of),
                other_rule: other_iou
                    .map(|iou| OtherRule { rule: self.settings.rule.other(), iou }),
            },
        })
    }

    /// What a report says of the pair.
    fn complete(&self, report: &mut TransferReport) {
        let (pair, matched) = (&self.pair, &self.matched);
        if let Some(clustered) = pair.clustered() {
            let reports = || anchor_reports(pair, clustered, &matched.point_map);
            report.anchors = self.anchor_reports.get_or_init(reports).clone();
        }
        report.map = self.quality.get_or_init(|| MapQuality::of(pair, matched)).clone();
    }

    /// The point map between the meshes as read.
    fn point_map(&self) -> &PointMap {
        let (source, target) = (self.source().shape(), self.target().shape());
        self.point_map.get_or_init(|| self.matched.point_map.onto_originals(source, target))
    }

    fn vote(&self, region: &Region) -> Result<Voted> {
        let inside = self.source().region_on_working(&region.mask());
        let votes = self.settings.method.info().votes;
        let votes = votes(&self.pair, &self.settings, &self.matched, &inside)?;
        let mut votes = at_threshold(&votes, self.settings.threshold);
        if let Some(congruence) = &self.matched.congruence {
            let to_original = &self.target().shape().working().to_original;
            congruence.mixed_into_working(&mut votes, to_original, &region.mask());
        }
        Ok(Voted { votes, inside })
    }

    /// Votes on the working vertices as a region of the target's mesh as read; where that is the source's surface once
    /// more, with the source's region (`inside`) as it is.
    fn onto_original(&self, votes: &[f64], inside: &[bool]) -> Result<Region> {
        let target = self.target().shape();
        let Some(congruence) = &self.matched.congruence else {
            return onto_original(target, votes);
        };
        let mut weights = target.onto_original(votes);
        congruence.mixed_into(&mut weights, inside);
        Region::from_weights(weights.into_iter().map(|w| w.clamp(0.0, 1.0)).collect())
    }

    /// The votes of the second opinion: of the map of `fused` beside a method without a map, else of
    /// the transport.
    fn second_opinion(&self, inside: &[bool]) -> Result<Option<Vec<f64>>> {
        if let Some(SecondMap { settings, matched }) = &self.second_map {
            let votes = (Method::Fused.info().votes)(&self.pair, settings, matched, inside)?;
            return Ok(Some(at_threshold(&votes, settings.threshold)));
        }
        let plan = self.pair.plan().filter(|_| self.settings.second_opinion);
        Ok(plan.map(|plan| {
            let on_target = plan.vote(&on_points(self.source(), inside));
            let threshold = TransferSettings::of(Method::Sinkhorn).threshold;
            at_threshold(&self.target().onto_vertices(&on_target), threshold)
        }))
    }

    /// Where the mean of both opinions, or the only one, says that the region may belong.
    fn hypotheses(&self, voted: &Voted, second: Option<&[f64]>) -> Result<Vec<Hypothesis>> {
        let (source, target) = (self.source().shape(), self.target().shape());
        let votes = match second {
            Some(second) => {
                voted.votes.iter().zip(second).map(|(a, b)| (a + b) / 2.0).collect::<Vec<f64>>()
            }
            None => voted.votes.clone(),
        };
        let connected = is_connected(source.mesh(), &voted.inside, &source.basis().mass);
        let (areas, count) = (&target.basis().mass, self.settings.n_hypotheses);
        let found = hypotheses(target.mesh(), &votes, areas, connected, count).into_iter();
        found
            .map(|found| {
                let region = onto_original(target, &found.weights)?;
                Ok(Hypothesis { region, probability: found.probability })
            })
            .collect()
    }

    /// What the answer says about itself.
    fn evidence(&self, voted: &Voted, answer: &[bool]) -> Evidence {
        let (source, target) = (self.source(), self.target());
        let region = at_vertices(source.vertex_of_point(), &voted.inside);
        let answer = at_vertices(target.vertex_of_point(), answer);
        let on_target: Vec<f64> = answer.iter().map(|&b| f64::from(u8::from(b))).collect();
        let back = match self.pair.plan() {
            Some(plan) => plan.vote_back(&on_target),
            None => self.pair.nearest_target_points().vote(&on_target),
        };
        let answer = Answer {
            votes: &voted.votes,
            areas: &target.shape().basis().mass,
            region: &region,
            answer: &answer,
            back: &mask(&back),
            source_masses: source.masses(),
            target_masses: target.masses(),
        };
        Evidence::of(&answer, &self.pair.joint)
    }

    /// The probability that an answer with this evidence is right, by the weights of both objects' features: where
    /// they differ, the more cautious ones.
    fn probability(&self, evidence: &Evidence) -> f64 {
        let of = |object: &PreparedObject| evidence.probability(object.confidence_weights());
        of(self.source()).min(of(self.target()))
    }

    /// How alike the objects are as a whole; none for objects without features.
    fn likeness(&self) -> Result<Option<f64>> {
        let (source, target) = (self.source(), self.target());
        if !source.has_features() {
            return Ok(None);
        }
        source.plain_features().likeness(target.plain_features()).map(Some)
    }

    /// The probability that the objects are of one kind, where the scale of likeness is known of either object's
    /// features: where they differ, the more cautious one.
    fn one_kind(&self, likeness: f64) -> Option<f64> {
        let scales =
            [self.source(), self.target()].map(|object| object.confidence_weights().likeness);
        let known = scales.into_iter().flatten();
        known.map(|scale| scale.probability_of_one_kind(likeness)).reduce(f64::min)
    }

    /// The votes under the other rule, where both maps are at hand (`semfm`).
    fn other_rule(&self, inside: &[bool]) -> Result<Option<Vec<f64>>> {
        if self.settings.method != Method::Semfm {
            return Ok(None);
        }
        let settings =
            TransferSettings { rule: self.settings.rule.other(), ..self.settings.clone() };
        let votes = by_map(&self.pair, &settings, &self.matched, inside)?;
        Ok(Some(at_threshold(&votes, settings.threshold)))
    }
}

/// Whether the vertex of each cloud point is inside.
fn at_vertices(vertex_of_point: &[u32], inside: &[bool]) -> Vec<bool> {
    vertex_of_point.iter().map(|&v| inside[v as usize]).collect()
}

/// Weights on the working vertices as a region of the original mesh. A mix of weights inside [0, 1]
/// leaves it by a rounding error at most.
pub(crate) fn onto_original(shape: &Shape, weights: &[f64]) -> Result<Region> {
    let weights = shape.onto_original(weights);
    Region::from_weights(weights.into_iter().map(|w| w.clamp(0.0, 1.0)).collect())
}

/// Both objects have features, or neither has and the method reads none.
fn check_features(source: &PreparedObject, target: &PreparedObject, method: Method) -> Result<()> {
    match (source.has_features(), target.has_features()) {
        (true, true) => Ok(()),
        (false, false) if !method.info().reads_features => Ok(()),
        (false, false) => {
            let expected = "`wks`, since the objects were prepared without features";
            Error::out_of_range("method", expected, format!("`{method}`"))
        }
        (source, _) => {
            let (with, without) = if source { ("source", "target") } else { ("target", "source") };
            let found = format!("features of the {with} and none of the {without}");
            Error::out_of_range("features", "those of both objects, or of neither", found)
        }
    }
}

fn check_region(region: &Region, n_vertices: usize) -> Result<()> {
    Error::length("vertices of the region's mesh", n_vertices, region.n_vertices())?;
    if region.is_empty() { Err(Error::EmptyRegion { n_vertices }) } else { Ok(()) }
}

#[cfg(test)]
mod tests;
