//! Carrying a region from one object to another: six methods under one interface.
//!
//! | name | what |
//! | --- | --- |
//! | `fused` | transport between the clouds starts a bidirectional, feature-augmented ZoomOut; the vote is spread along the target's own features |
//! | `semfm` | the published method: two anchors, minimum-norm C, plain ZoomOut |
//! | `anchored` | the same anchors, then feature-augmented ZoomOut and a diffused vote |
//! | `sinkhorn` | unbalanced transport between the clouds, no map |
//! | `nearest` | the vote of the nearest points in feature space, no map |
//! | `wks` | wave kernel signatures as descriptors: the paper's baseline, blind to meaning |
//!
//! Features are just a [`SemanticCloud`](semfm_geom::SemanticCloud): true part labels as one-hot
//! features make any method its own ceiling.

mod anchored;
mod baselines;
mod fused;
mod report;
pub mod semfm;
mod settings;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Instant;

use faer::Mat;
use semfm_geom::Task;

use crate::clusters::Clusters;
use crate::confidence::{
    Evidence, Hypothesis, Verdict, is_one_piece, islands, probability_by_agreement,
};
use crate::features::JointFeatures;
use crate::fit::FitReport;
use crate::metrics::overlap;
use crate::propagation::{PropagationSettings, propagate};
use crate::transport::{Plan, couple};
use crate::zoomout::MapSide;
use crate::{Anchors, Error, FunctionalMap, PointMap, PreparedObject, Region, Result};

pub use report::{AnchorReport, MapQuality, OtherRule, Stages, TransferReport, TransportReport};
pub use settings::{Method, Rule, TransferSettings};

/// A carried region and everything known about it. Vertices are those of the meshes as read.
#[derive(Clone, Debug)]
pub struct Transfer {
    /// The region on the target. Weights are scaled so that the method's threshold stands at
    /// [`Region::COUNTS`].
    pub region: Region,
    /// The probability that the region's IoU with the truth is at least one half, in [0, 1]
    /// ([`confidence`](crate::confidence) says how it is known).
    pub confidence: f64,
    /// What to do with the answer.
    pub verdict: Verdict,
    /// Where else the region may belong, by falling probability; the first is the likeliest place.
    pub hypotheses: Vec<Hypothesis>,
    /// One source vertex per target vertex. The methods without a map give the vertex at the
    /// nearest or most coupled cloud point.
    pub point_map: PointMap,
    /// The region under the rule that was not asked for, where the method computes both (`semfm`).
    pub other_rule: Option<Region>,
    /// How the answer came about.
    pub report: TransferReport,
}

impl Transfer {
    /// Weight per target vertex, in [0, 1].
    pub fn weights(&self) -> &[f64] {
        self.region.weights()
    }
}

/// Carries `region`, which lies on the source's original vertices, to the target: a [`Matching`]
/// for one region.
///
/// # Errors
/// [`Error::EmptyRegion`], [`Error::Length`] where the region is not one of the source's mesh or
/// the features differ in dimension, [`Error::OutOfRange`] for impossible settings,
/// [`Error::LinearAlgebra`], [`Error::NotOriented`], [`Error::Geom`] on cancellation. A region that
/// lands nowhere is no error but a refusal.
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

/// What a method found out about a pair, on working vertices.
struct Matched {
    point_map: PointMap,
    /// A target vertex per source vertex, where the image rule is asked for.
    reverse: Option<Vec<u32>>,
    map: Option<FunctionalMap>,
    fit: Option<FitReport>,
}

/// How a method turns a region on the source into a vote on the target.
enum Voter {
    /// A point map carries it.
    Map,
    /// The nearest source points of each target point are asked (M_target × neighbours).
    Nearest(Vec<Vec<u32>>),
    /// The transport plan carries it.
    Transport,
}

/// A matched pair: computed once, it carries any number of regions.
pub struct Matching {
    source: PreparedObject,
    target: PreparedObject,
    settings: TransferSettings,
    joint: JointFeatures,
    plan: Plan,
    parts: PairedParts,
    matched: Matched,
    voter: Voter,
    /// The map that stands beside a method without one, so that there are two opinions.
    witness: Option<Matched>,
    stages: Stages,
}

/// The clusters of both objects and which of them are anchors.
struct PairedParts {
    source: Arc<Clusters>,
    target: Arc<Clusters>,
    anchors: Anchors,
}

impl PairedParts {
    fn new(
        source: &PreparedObject,
        target: &PreparedObject,
        settings: &TransferSettings,
        task: &Task,
    ) -> Result<Self> {
        let dim = (source.cloud().dim(), target.cloud().dim());
        Error::length("feature dimension of the target", dim.0, dim.1)?;
        let clusters = |object: &PreparedObject| object.clusters(&settings.clusters, task);
        let (on_source, on_target) = rayon::join(|| clusters(source), || clusters(target));
        let (on_source, on_target) = (on_source?, on_target?);
        let pair = ((&**source.cloud(), &*on_source), (&**target.cloud(), &*on_target));
        let anchors = Anchors::select(pair.0, pair.1, settings.n_anchors);
        Ok(Self { source: on_source, target: on_target, anchors })
    }
}

impl Matching {
    /// Matches two prepared objects by the method and constants of `settings`. Map sizes are clipped
    /// to what both bases hold, and the report says so.
    ///
    /// # Errors
    /// As [`transfer`].
    pub fn new(
        source: &PreparedObject,
        target: &PreparedObject,
        settings: &TransferSettings,
        task: &Task,
    ) -> Result<Self> {
        semfm_geom::algebra::keep_sequential();
        settings.check()?;
        let settings = settings.clipped(source.shape().basis().k().min(target.shape().basis().k()));
        let mut stages = Stages::default();
        let parts = stages.time("anchors", || PairedParts::new(source, target, &settings, task))?;
        task.check()?;
        let joint = stages.time("features", || {
            JointFeatures::new(source.features(), target.features(), settings.feature_dims)
        })?;
        let plan = stages.time("transport", || {
            let (on_source, on_target) = (joint.source.as_ref(), joint.target.as_ref());
            couple(
                (on_source, source.masses()),
                (on_target, target.masses()),
                &settings.transport,
                task,
            )
        })?;
        let pair = Pair { source, target, joint: &joint, settings: &settings, task };
        let (matched, voter) = match settings.method {
            Method::Fused => (fused::match_pair(&pair, &plan, &mut stages)?, Voter::Map),
            Method::Semfm => (semfm::match_pair(&pair, &parts, &mut stages)?, Voter::Map),
            Method::Anchored => (anchored::match_pair(&pair, &parts, &mut stages)?, Voter::Map),
            Method::Wks => (baselines::match_by_wks(&pair, &mut stages)?, Voter::Map),
            Method::Sinkhorn => (baselines::match_by_plan(&pair, &plan), Voter::Transport),
            Method::Nearest => baselines::match_by_neighbours(&pair, &mut stages),
        };
        let witness = match voter {
            Voter::Map => None,
            _ => {
                let fused_settings =
                    settings.as_fused(source.shape().basis().k().min(target.shape().basis().k()));
                let pair = Pair { settings: &fused_settings, ..pair };
                Some(fused::match_pair(&pair, &plan, &mut stages)?)
            }
        };
        let (source, target) = (source.clone(), target.clone());
        Ok(Self { source, target, settings, joint, plan, parts, matched, voter, witness, stages })
    }

    /// The demonstrated object.
    pub fn source(&self) -> &PreparedObject {
        &self.source
    }

    /// The object that the regions are carried to.
    pub fn target(&self) -> &PreparedObject {
        &self.target
    }

    /// The semantic anchors of the pair.
    pub fn anchors(&self) -> &Anchors {
        &self.parts.anchors
    }

    /// The functional map between the working shapes, where the method makes one.
    pub fn functional_map(&self) -> Option<&FunctionalMap> {
        self.matched.map.as_ref()
    }

    /// The point map between the working meshes.
    pub fn working_point_map(&self) -> &PointMap {
        &self.matched.point_map
    }

    /// Carries one region, which lies on the source's original vertices.
    ///
    /// # Errors
    /// [`Error::EmptyRegion`], [`Error::Length`].
    pub fn transfer(&self, region: &Region) -> Result<Transfer> {
        check_region(region, self.source.shape().original().n_vertices())?;
        let mut stages = self.stages.clone();
        let start = Instant::now();
        let (shape, areas) = (self.target.shape(), &self.target.shape().basis().mass);
        let inside = self.source.region_on_working(&region.mask());
        let votes = self.votes(&inside)?;
        let by_transport =
            at_threshold(&self.votes_by_transport(&inside), Method::Sinkhorn.threshold());
        let second = match &self.witness {
            None => by_transport.clone(),
            Some(map) => {
                let diffusion = Method::Fused.diffusion();
                let votes = self.votes_by_map(map, Rule::Preimage, diffusion, &inside)?;
                let votes = self.spread(votes, &Method::Fused.propagation())?;
                at_threshold(&votes, Method::Fused.threshold())
            }
        };
        let agreement = overlap(&mask(&votes), &mask(&second), areas);
        let both: Vec<f64> = votes.iter().zip(&second).map(|(a, b)| (a + b) / 2.0).collect();
        let one_piece =
            is_one_piece(self.source.shape().mesh(), &inside, &self.source.shape().basis().mass);
        // A mix of weights inside [0, 1] leaves it by a rounding error at most.
        let onto_original = |weights: &[f64]| {
            let carried = shape.onto_original(weights);
            Region::from_weights(carried.into_iter().map(|w| w.clamp(0.0, 1.0)).collect())
        };
        let hypotheses = islands(shape.mesh(), &both, areas, one_piece, self.settings.n_hypotheses)
            .into_iter()
            .map(|(weights, probability)| {
                Ok(Hypothesis { region: onto_original(&weights)?, probability })
            })
            .collect::<Result<Vec<_>>>()?;
        let other = self.other_rule(&inside)?;
        let other_rule = other.as_deref().map(onto_original).transpose()?;
        let other_iou = other.map(|other| overlap(&mask(&votes), &mask(&other), areas));
        let region = onto_original(&votes)?;
        let evidence = self.evidence(&inside, &votes);
        let confidence = match self.settings.method {
            _ if region.is_empty() => 0.0,
            Method::Fused => evidence.probability(),
            _ => probability_by_agreement(agreement),
        };
        stages.put("vote", start.elapsed());
        let report = stages.time("report", || {
            Ok(self.report((agreement, evidence), other_iou, &votes, &inside))
        })?;
        let report = TransferReport { stages_ms: stages, ..report };
        Ok(Transfer {
            region,
            confidence,
            verdict: Verdict::of(confidence),
            hypotheses,
            point_map: self.matched.point_map.onto_originals(self.source.shape(), shape),
            other_rule,
            report,
        })
    }

    /// The method's vote on the target's working vertices, threshold at [`Region::COUNTS`].
    fn votes(&self, inside: &[bool]) -> Result<Vec<f64>> {
        let raw = match &self.voter {
            Voter::Map => {
                let Self { matched, settings, .. } = self;
                self.votes_by_map(matched, settings.rule, settings.diffusion, inside)?
            }
            Voter::Transport => self.votes_by_transport(inside),
            Voter::Nearest(neighbours) => {
                let on_points = self.on_points(inside);
                let mean = |ids: &Vec<u32>| {
                    ids.iter().map(|&i| on_points[i as usize]).sum::<f64>()
                        / ids.len().max(1) as f64
                };
                self.target.onto_vertices(&neighbours.iter().map(mean).collect::<Vec<f64>>())
            }
        };
        let spread = self.spread(raw, &self.settings.propagation)?;
        Ok(at_threshold(&spread, self.settings.threshold))
    }

    /// A vote on the target's working vertices, spread along its features.
    fn spread(&self, votes: Vec<f64>, settings: &PropagationSettings) -> Result<Vec<f64>> {
        if settings.weight == 0.0 {
            return Ok(votes);
        }
        let on_points: Vec<f64> = self
            .target
            .vertex_of_point()
            .iter()
            .map(|&v| votes[v as usize].clamp(0.0, 1.0))
            .collect();
        let spread = propagate(self.target.graph()?, self.target.masses(), &on_points, settings)?;
        Ok(self.target.onto_vertices(&spread))
    }

    fn votes_by_map(
        &self,
        matched: &Matched,
        rule: Rule,
        diffusion: f64,
        inside: &[bool],
    ) -> Result<Vec<f64>> {
        let hit = match (rule, &matched.reverse) {
            (Rule::Image, Some(reverse)) => {
                let mut hit = vec![0.0; self.target.shape().mesh().n_vertices()];
                reverse
                    .iter()
                    .zip(inside)
                    .filter(|(_, inside)| **inside)
                    .for_each(|(&j, _)| hit[j as usize] = 1.0);
                hit
            }
            _ => matched
                .point_map
                .pull_back(inside)
                .into_iter()
                .map(|b| f64::from(u8::from(b)))
                .collect(),
        };
        if diffusion == 0.0 {
            return Ok(hit);
        }
        Ok(self.target.shape().smooth(&hit, diffusion)?)
    }

    fn votes_by_transport(&self, inside: &[bool]) -> Vec<f64> {
        self.target.onto_vertices(&self.plan.vote(&self.on_points(inside)))
    }

    fn evidence(&self, inside: &[bool], votes: &[f64]) -> Evidence {
        let region: Vec<bool> =
            self.source.vertex_of_point().iter().map(|&v| inside[v as usize]).collect();
        let answered = mask(votes);
        let answer: Vec<bool> =
            self.target.vertex_of_point().iter().map(|&v| answered[v as usize]).collect();
        Evidence::gather(
            (votes, &self.target.shape().basis().mass),
            (&self.joint, &self.plan),
            (&region, &answer),
            (self.source.masses(), self.target.masses()),
        )
    }

    fn on_points(&self, inside: &[bool]) -> Vec<f64> {
        let vertices = self.source.vertex_of_point();
        vertices.iter().map(|&v| f64::from(u8::from(inside[v as usize]))).collect()
    }

    /// The vote under the rule that was not asked for, where both maps are at hand (`semfm`).
    fn other_rule(&self, inside: &[bool]) -> Result<Option<Vec<f64>>> {
        if self.settings.method != Method::Semfm {
            return Ok(None);
        }
        let votes = self.votes_by_map(
            &self.matched,
            self.settings.rule.other(),
            self.settings.diffusion,
            inside,
        )?;
        Ok(Some(at_threshold(&votes, self.settings.threshold)))
    }
}

/// What every method starts from.
struct Pair<'a> {
    source: &'a PreparedObject,
    target: &'a PreparedObject,
    joint: &'a JointFeatures,
    settings: &'a TransferSettings,
    task: &'a Task,
}

impl Pair<'_> {
    /// Joint features mixed onto the vertices of the source and of the target.
    fn vertex_features(&self) -> (Mat<f64>, Mat<f64>) {
        let on_source = self.source.rows_onto_vertices(self.joint.source.as_ref());
        (on_source, self.target.rows_onto_vertices(self.joint.target.as_ref()))
    }

    /// Both shapes for a ZoomOut with features, on farthest-point samples.
    fn sampled_sides<'b>(
        &'b self,
        features: &'b (Mat<f64>, Mat<f64>),
    ) -> (MapSide<'b>, MapSide<'b>) {
        let side = |object: &'b PreparedObject, features: &'b Mat<f64>| MapSide {
            basis: object.shape().basis(),
            features: Some(features.as_ref()),
            samples: object.samples(),
        };
        (side(self.source, &features.0), side(self.target, &features.1))
    }

    /// Both shapes for a purely spectral ZoomOut on all vertices.
    fn plain_sides(&self) -> (MapSide<'_>, MapSide<'_>) {
        let side = |basis| MapSide { basis, features: None, samples: &[] };
        (side(self.source.shape().basis()), side(self.target.shape().basis()))
    }
}

/// Votes in [0, 1], bent so that `threshold` stands at [`Region::COUNTS`].
fn at_threshold(votes: &[f64], threshold: f64) -> Vec<f64> {
    let bend = |&vote: &f64| {
        let vote = vote.clamp(0.0, 1.0);
        let c = Region::COUNTS;
        if vote >= threshold {
            (c + (1.0 - c) * (vote - threshold) / (1.0 - threshold)).min(1.0)
        } else {
            // Rounding must not lift a vote below the threshold onto it.
            (c * vote / threshold).min(c.next_down())
        }
    };
    votes.iter().map(bend).collect()
}

fn mask(votes: &[f64]) -> Vec<bool> {
    votes.iter().map(|&v| v >= Region::COUNTS).collect()
}

fn check_region(region: &Region, n_vertices: usize) -> Result<()> {
    Error::length("vertices of the region's mesh", n_vertices, region.n_vertices())?;
    if region.is_empty() { Err(Error::EmptyRegion { n_vertices }) } else { Ok(()) }
}
