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

use std::time::Instant;

use faer::Mat;
use semfm_geom::Task;

use crate::confidence::{
    Evidence, Hypothesis, Verdict, is_one_piece, islands, probability_by_agreement,
};
use crate::features::JointFeatures;
use crate::fit::FitReport;
use crate::metrics::overlap;
use crate::propagation::{PropagationSettings, propagate};
use crate::transport::{Plan, couple};
use crate::zoomout::MapSide;
use crate::{Anchors, Error, FunctionalMap, PointMap, PreparedShape, Region, Result, ShapePair};

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

/// Carries `region`, which lies on the source's original vertices, to the target: the easy door.
///
/// # Errors
/// [`Error::EmptyRegion`], [`Error::Length`] where the region is not one of the source's mesh or
/// the features differ in dimension, [`Error::OutOfRange`] for impossible settings, whatever the
/// steps report; cancellation. A region that lands nowhere is no error but a refusal.
pub fn transfer(
    pair: ShapePair<'_>,
    region: &Region,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Transfer> {
    check_region(region, pair.source.shape.original().n_vertices())?;
    let start = Instant::now();
    let prepare = |semantic| PreparedShape::new(semantic, &settings.clusters, task);
    let (source, target) = rayon::join(|| prepare(pair.source), || prepare(pair.target));
    let (source, target) = (source?, target?);
    let prepared = start.elapsed();
    let mut matching = Matching::new(&source, &target, settings, task)?;
    matching.stages.put_first("prepare", prepared);
    matching.transfer(region)
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
pub struct Matching<'a> {
    source: &'a PreparedShape<'a>,
    target: &'a PreparedShape<'a>,
    settings: TransferSettings,
    joint: JointFeatures,
    plan: Plan,
    anchors: Anchors,
    matched: Matched,
    voter: Voter,
    /// The map that stands beside a method without one, so that there are two opinions.
    witness: Option<Matched>,
    stages: Stages,
}

impl<'a> Matching<'a> {
    /// Matches two prepared objects by the method and constants of `settings`. Map sizes are clipped
    /// to what both bases hold, and the report says so.
    ///
    /// # Errors
    /// As [`transfer`].
    pub fn new(
        source: &'a PreparedShape<'a>,
        target: &'a PreparedShape<'a>,
        settings: &TransferSettings,
        task: &Task,
    ) -> Result<Self> {
        semfm_geom::algebra::keep_sequential();
        settings.check()?;
        let settings = settings.clipped(source.shape().basis().k().min(target.shape().basis().k()));
        let mut stages = Stages::default();
        let anchors = stages.time("anchors", || {
            Error::length(
                "feature dimension of the target",
                source.cloud().dim(),
                target.cloud().dim(),
            )?;
            let (on_source, on_target) =
                ((source.cloud(), source.clusters()), (target.cloud(), target.clusters()));
            Ok(Anchors::select(on_source, on_target, settings.n_anchors))
        })?;
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
            Method::Semfm => (semfm::match_pair(&pair, &anchors, &mut stages)?, Voter::Map),
            Method::Anchored => (anchored::match_pair(&pair, &anchors, &mut stages)?, Voter::Map),
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
        Ok(Self { source, target, settings, joint, plan, anchors, matched, voter, witness, stages })
    }

    /// The semantic anchors of the pair.
    pub fn anchors(&self) -> &Anchors {
        &self.anchors
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
        let spread = propagate(self.target.graph(), self.target.masses(), &on_points, settings)?;
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
    source: &'a PreparedShape<'a>,
    target: &'a PreparedShape<'a>,
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
        let side = |shape: &'b PreparedShape<'_>, features: &'b Mat<f64>| MapSide {
            basis: shape.shape().basis(),
            features: Some(features.as_ref()),
            samples: shape.samples(),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pair::tests::{blob, cloud, shape};
    use crate::{SemanticShape, metrics};
    use semfm_geom::math::DVec3;
    use semfm_geom::{Mesh, SemanticCloud, Shape, ShapeSettings};

    struct Object(Shape, SemanticCloud);

    impl Object {
        /// A blob whose features tell where along x its points are.
        fn blob(stretch: f64, offset: f32) -> Self {
            let mesh = blob(stretch);
            Self(shape(&mesh, 60), cloud(&mesh, stretch, offset))
        }

        fn semantic(&self) -> SemanticShape<'_> {
            SemanticShape { shape: &self.0, cloud: &self.1 }
        }
    }

    fn pair<'a>(source: &'a Object, target: &'a Object) -> ShapePair<'a> {
        ShapePair { source: source.semantic(), target: target.semantic() }
    }

    /// The end of a blob towards +x.
    fn tip(object: &Object, stretch: f64) -> Region {
        let inside: Vec<bool> =
            object.0.original().vertices().iter().map(|p| p.x / stretch > 1.0).collect();
        Region::from_mask(&inside)
    }

    #[test]
    fn every_method_with_meaning_carries_the_tip_to_the_tip() {
        let (source, target) = (Object::blob(1.0, 0.2), Object::blob(1.5, 0.6));
        let (region, truth) = (tip(&source, 1.0), tip(&target, 1.5));
        for (method, least) in [
            (Method::Fused, 0.8),
            (Method::Sinkhorn, 0.75),
            (Method::Nearest, 0.7),
            (Method::Anchored, 0.7),
            (Method::Semfm, 0.3),
            (Method::Wks, 0.0),
        ] {
            let settings = TransferSettings::of(method);
            let answer =
                transfer(pair(&source, &target), &region, &settings, &Task::default()).unwrap();
            let iou = metrics::iou(&answer.region, &truth).unwrap();
            assert!(iou >= least, "{method} reaches IoU {iou:.2} only");
            assert_eq!(answer.point_map.n_target(), target.0.original().n_vertices());
            assert_eq!(answer.other_rule.is_some(), method == Method::Semfm);
            assert_eq!(answer.report.map.orthogonality.is_some(), method.has_map());
            assert_eq!(answer.report.anchors.len(), 2);
            let json = serde_json::to_value(&answer.report).unwrap();
            assert_eq!(json["settings"]["method"], method.name());
            assert!(json["stages_ms"]["prepare"].as_f64().unwrap() > 0.0);
            assert!(json["anchors"][0]["cosine"].as_f64().unwrap() <= 1.0 + 1e-9);
            if method == Method::Fused {
                assert_eq!(answer.verdict, Verdict::Accept, "agreement {}", answer.confidence);
                assert!(
                    (answer.hypotheses.iter().map(|h| h.probability).sum::<f64>() - 1.0).abs()
                        < 1e-9
                );
            }
        }
    }

    #[test]
    fn the_image_rule_hits_fewer_vertices_of_the_same_place() {
        let (source, target) = (Object::blob(1.0, 0.2), Object::blob(1.5, 0.6));
        let truth = tip(&target, 1.5).mask();
        for method in [Method::Semfm, Method::Anchored, Method::Wks, Method::Fused] {
            let settings = TransferSettings {
                rule: Rule::Image,
                diffusion: 0.0,
                ..TransferSettings::of(method)
            };
            let answer =
                transfer(pair(&source, &target), &tip(&source, 1.0), &settings, &Task::default())
                    .unwrap();
            assert!(!answer.region.is_empty(), "{method}");
            if method == Method::Fused {
                let right = answer.region.vertices().iter().filter(|&&v| truth[v as usize]).count();
                assert!(right as f64 >= 0.8 * answer.region.vertices().len() as f64);
            }
        }
        for method in [Method::Nearest, Method::Sinkhorn] {
            let settings = TransferSettings { rule: Rule::Image, ..TransferSettings::of(method) };
            let error =
                transfer(pair(&source, &target), &tip(&source, 1.0), &settings, &Task::default());
            assert!(error.unwrap_err().to_string().contains(method.name()));
        }
    }

    #[test]
    fn one_matching_carries_many_regions_and_says_the_same_as_the_easy_door() {
        let (source, target) = (Object::blob(1.0, 0.2), Object::blob(1.5, 0.6));
        let (task, settings) = (Task::default(), TransferSettings::default());
        let source_ready =
            PreparedShape::new(source.semantic(), &settings.clusters, &task).unwrap();
        let target_ready =
            PreparedShape::new(target.semantic(), &settings.clusters, &task).unwrap();
        let matching = Matching::new(&source_ready, &target_ready, &settings, &task).unwrap();
        let region = tip(&source, 1.0);
        let kept = matching.transfer(&region).unwrap();
        let easy = transfer(pair(&source, &target), &region, &settings, &task).unwrap();
        assert_eq!((kept.region, kept.point_map), (easy.region, easy.point_map));
        let rest =
            Region::from_mask(&region.mask().iter().map(|inside| !inside).collect::<Vec<_>>());
        assert!(matching.transfer(&rest).unwrap().report.target_area_share > 0.5);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let alone =
            one.install(|| transfer(pair(&source, &target), &region, &settings, &task).unwrap());
        assert_eq!(
            (alone.region, alone.hypotheses),
            (matching.transfer(&region).unwrap().region, easy.hypotheses)
        );
    }

    #[test]
    fn tiny_meshes_and_tiny_clouds_get_through_every_method() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let mesh =
            Mesh::new(corners.clone(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        let tetrahedron = Object(
            Shape::new(mesh, &ShapeSettings::default(), &Task::default()).unwrap(),
            SemanticCloud::new(
                corners,
                vec![1.0, 0.0, 0.9, 0.1, 0.0, 1.0, 0.1, 0.9],
                2,
                vec![1; 4],
            )
            .unwrap(),
        );
        let blob_mesh = blob(1.0);
        let points: Vec<DVec3> = blob_mesh.vertices().iter().step_by(60).copied().collect();
        let features: Vec<f32> = (0..points.len()).flat_map(|i| [i as f32, 1.0]).collect();
        let n = points.len();
        assert_eq!(n, 5);
        let few = Object(
            shape(&blob_mesh, 30),
            SemanticCloud::new(points, features, 2, vec![1; n]).unwrap(),
        );
        let task = Task::default();
        for method in Method::ALL {
            let settings = TransferSettings::of(method);
            let region = Region::from_vertices(4, &[1]).unwrap();
            let there = transfer(pair(&tetrahedron, &few), &region, &settings, &task).unwrap();
            assert_eq!(there.region.n_vertices(), 258);
            let region = Region::from_vertices(258, &[0, 1, 2]).unwrap();
            let back = transfer(pair(&few, &tetrahedron), &region, &settings, &task).unwrap();
            assert_eq!(back.region.n_vertices(), 4);
            if back.region.is_empty() {
                assert_eq!(back.verdict, Verdict::Refuse);
            }
        }
    }

    #[test]
    fn bad_input_is_named() {
        let (source, target) = (Object::blob(1.0, 0.2), Object::blob(1.5, 0.6));
        let (task, settings) = (Task::default(), TransferSettings::default());
        let nothing = Region::from_vertices(258, &[]).unwrap();
        let error = transfer(pair(&source, &target), &nothing, &settings, &task).unwrap_err();
        assert!(matches!(error, Error::EmptyRegion { n_vertices: 258 }));
        let stranger = Region::from_vertices(7, &[1]).unwrap();
        let error = transfer(pair(&source, &target), &stranger, &settings, &task).unwrap_err();
        assert!(matches!(error, Error::Length { expected: 258, found: 7, .. }), "{error}");
        let region = tip(&source, 1.0);
        let other = Object(
            shape(&blob(1.0), 20),
            SemanticCloud::new(vec![DVec3::X; 9], vec![1.0; 18], 2, vec![1; 9]).unwrap(),
        );
        let error = transfer(pair(&source, &other), &region, &settings, &task).unwrap_err();
        assert!(error.to_string().contains("feature dimension"), "{error}");
        let backwards = TransferSettings {
            propagation: PropagationSettings { weight: -1.0, ..PropagationSettings::default() },
            ..settings.clone()
        };
        let error = transfer(pair(&source, &target), &region, &backwards, &task).unwrap_err();
        assert!(error.to_string().contains("propagation"), "{error}");
        task.cancel();
        assert!(matches!(
            transfer(pair(&source, &target), &region, &settings, &task),
            Err(Error::Geom(_))
        ));
    }

    #[test]
    fn thresholds_are_bent_onto_one_half() {
        let bent = at_threshold(&[0.0, 0.2, 0.4, 0.7, 1.0, 1.3, -0.1], 0.4);
        for (x, expected) in bent.iter().zip([0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 0.0]) {
            assert!((x - expected).abs() < 1e-12, "{x} for {expected}");
        }
        assert!(at_threshold(&[0.4f64.next_down()], 0.4)[0] < Region::COUNTS);
    }
}
