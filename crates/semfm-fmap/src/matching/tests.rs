//! Every method on small pairs: what is transferred where, and what is refused.

use std::sync::Arc;

use semfm_geom::math::DVec3;
use semfm_geom::{ConfidenceWeights, Mesh, SemanticCloud, Shape, ShapeSettings};

use super::*;
use crate::Verdict;
use crate::metrics;
use crate::propagation::PropagationSettings;
use crate::settings::Rule;
use crate::test_objects::{blob, cloud, shape};

fn object(shape: Shape, cloud: SemanticCloud) -> PreparedObject {
    PreparedObject::new(Arc::new(shape), Arc::new(cloud), &Task::default()).unwrap()
}

/// A blob whose features say where along x its points are.
fn blob_object(stretch: f64, offset: f32) -> PreparedObject {
    let mesh = blob(stretch);
    object(shape(&mesh, 60), cloud(&mesh, stretch, offset))
}

fn bare(object: &PreparedObject) -> PreparedObject {
    PreparedObject::without_features(object.shape().clone(), &Task::default()).unwrap()
}

#[test]
fn wks_gives_the_same_region_without_features_and_trusts_it_less() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (region, task) = (tip(&source, 1.0), Task::default());
    for rule in [Rule::Preimage, Rule::Image] {
        let settings = TransferSettings { rule, ..TransferSettings::of(Method::Wks) };
        let with = transfer(&source, &target, &region, &settings, &task).unwrap();
        let without = transfer(&bare(&source), &bare(&target), &region, &settings, &task).unwrap();
        assert_eq!(without.region, with.region);
        assert_eq!(without.point_map, with.point_map);
        assert_eq!(without.report.agreement, None);
        assert!(without.verdict != Verdict::Accept, "{}", without.confidence);
        assert!(without.report.anchors.is_empty());
    }
}

#[test]
fn a_method_that_reads_features_refuses_objects_without() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (region, task) = (tip(&source, 1.0), Task::default());
    let refusal = |source: &PreparedObject, target: &PreparedObject, method: Method| {
        let settings = TransferSettings::of(method);
        transfer(source, target, &region, &settings, &task).unwrap_err().to_string()
    };
    for method in Method::ALL.into_iter().filter(|method| method.info().reads_features) {
        let message = refusal(&bare(&source), &bare(&target), method);
        assert!(message.contains("`wks`") && message.contains(method.name()), "{message}");
    }
    let message = refusal(&source, &bare(&target), Method::Wks);
    assert!(message.contains("none of the target"), "{message}");
    let message = refusal(&bare(&source), &target, Method::Wks);
    assert!(message.contains("none of the source"), "{message}");
}

/// The end of a blob towards +x.
fn tip(object: &PreparedObject, stretch: f64) -> Region {
    let inside: Vec<bool> =
        object.shape().original().vertices().iter().map(|p| p.x / stretch > 1.0).collect();
    Region::from_mask(&inside)
}

#[test]
fn every_method_with_features_transfers_the_tip_to_the_tip() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
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
            transfer_with_anchors(&source, &target, &region, &settings, &Task::default()).unwrap();
        let iou = metrics::iou(&answer.region, &truth).unwrap();
        assert!(iou >= least, "{method} reaches IoU {iou:.2} only");
        assert_eq!(answer.point_map.n_target(), target.shape().original().n_vertices());
        assert_eq!(answer.other_rule.is_some(), method == Method::Semfm);
        assert_eq!(answer.report.map.orthogonality.is_some(), method.info().has_map);
        assert_eq!(answer.report.anchors.len(), 2);
        let json = serde_json::to_value(&answer.report).unwrap();
        assert_eq!(json["settings"]["method"], method.name());
        assert!(json["stages_ms"]["features"].as_f64().unwrap() > 0.0);
        assert!(json["anchors"][0]["cosine"].as_f64().unwrap() <= 1.0 + 1e-9);
        if method == Method::Fused {
            assert_eq!(answer.verdict, Verdict::Accept, "agreement {}", answer.confidence);
            assert!(
                (answer.hypotheses.iter().map(|h| h.probability).sum::<f64>() - 1.0).abs() < 1e-9
            );
        }
    }
}

#[test]
fn the_image_rule_hits_fewer_vertices_of_the_same_place() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let truth = tip(&target, 1.5).mask();
    for method in [Method::Semfm, Method::Anchored, Method::Wks, Method::Fused] {
        let settings =
            TransferSettings { rule: Rule::Image, diffusion: 0.0, ..TransferSettings::of(method) };
        let answer =
            transfer(&source, &target, &tip(&source, 1.0), &settings, &Task::default()).unwrap();
        assert!(!answer.region.is_empty(), "{method}");
        if method == Method::Fused {
            let right = answer.region.vertices().iter().filter(|&&v| truth[v as usize]).count();
            assert!(right as f64 >= 0.8 * answer.region.vertices().len() as f64);
        }
    }
    for method in [Method::Nearest, Method::Sinkhorn] {
        let settings = TransferSettings { rule: Rule::Image, ..TransferSettings::of(method) };
        let error = transfer(&source, &target, &tip(&source, 1.0), &settings, &Task::default());
        assert!(error.unwrap_err().to_string().contains(method.name()));
    }
}

#[test]
fn one_matching_transfers_many_regions_and_says_the_same_as_the_short_call() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (task, settings) = (Task::default(), TransferSettings::default());
    let matching = Matching::new(&source, &target, &settings, &task).unwrap();
    let region = tip(&source, 1.0);
    let kept = matching.transfer(&region).unwrap();
    let short = transfer(&source, &target, &region, &settings, &task).unwrap();
    assert_eq!((kept.region, kept.point_map), (short.region, short.point_map));
    let rest = Region::from_mask(&region.mask().iter().map(|inside| !inside).collect::<Vec<_>>());
    assert!(matching.transfer(&rest).unwrap().report.target_area_share > 0.5);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let alone = one.install(|| transfer(&source, &target, &region, &settings, &task).unwrap());
    assert_eq!(
        (alone.region, alone.hypotheses),
        (matching.transfer(&region).unwrap().region, short.hypotheses)
    );
}

#[test]
fn tiny_meshes_and_tiny_clouds_get_through_every_method() {
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh =
        Mesh::new(corners.clone(), vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
    let tetrahedron = object(
        Shape::new(mesh, &ShapeSettings::default(), &Task::default()).unwrap(),
        SemanticCloud::new(corners, vec![1.0, 0.0, 0.9, 0.1, 0.0, 1.0, 0.1, 0.9], 2, vec![1; 4])
            .unwrap(),
    );
    let blob_mesh = blob(1.0);
    let points: Vec<DVec3> = blob_mesh.vertices().iter().step_by(60).copied().collect();
    let features: Vec<f32> = (0..points.len()).flat_map(|i| [i as f32, 1.0]).collect();
    let n = points.len();
    assert_eq!(n, 5);
    let few =
        object(shape(&blob_mesh, 30), SemanticCloud::new(points, features, 2, vec![1; n]).unwrap());
    let task = Task::default();
    for method in Method::ALL {
        let settings = TransferSettings::of(method);
        let region = Region::from_vertices(4, &[1]).unwrap();
        let there = transfer(&tetrahedron, &few, &region, &settings, &task).unwrap();
        assert_eq!(there.region.n_vertices(), 258);
        let region = Region::from_vertices(258, &[0, 1, 2]).unwrap();
        let back = transfer(&few, &tetrahedron, &region, &settings, &task).unwrap();
        assert_eq!(back.region.n_vertices(), 4);
        if back.region.is_empty() {
            assert_eq!(back.verdict, Verdict::Refuse);
        }
    }
}

#[test]
fn bad_input_is_named() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (task, settings) = (Task::default(), TransferSettings::default());
    let nothing = Region::from_vertices(258, &[]).unwrap();
    let error = transfer(&source, &target, &nothing, &settings, &task).unwrap_err();
    assert!(matches!(error, Error::EmptyRegion { n_vertices: 258 }));
    let other_mesh = Region::from_vertices(7, &[1]).unwrap();
    let error = transfer(&source, &target, &other_mesh, &settings, &task).unwrap_err();
    assert!(matches!(error, Error::Length { expected: 258, found: 7, .. }), "{error}");
    let region = tip(&source, 1.0);
    let other = object(
        shape(&blob(1.0), 20),
        SemanticCloud::new(vec![DVec3::X; 9], vec![1.0; 18], 2, vec![1; 9]).unwrap(),
    );
    let error = transfer(&source, &other, &region, &settings, &task).unwrap_err();
    assert!(error.to_string().contains("feature dimension"), "{error}");
    let backwards = TransferSettings {
        propagation: PropagationSettings { weight: -1.0, ..PropagationSettings::default() },
        ..settings.clone()
    };
    let error = transfer(&source, &target, &region, &backwards, &task).unwrap_err();
    assert!(error.to_string().contains("propagation"), "{error}");
    task.cancel();
    assert!(matches!(transfer(&source, &target, &region, &settings, &task), Err(Error::Geom(_))));
}

#[test]
fn a_second_opinion_is_computed_where_it_is_needed_or_asked_for() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (region, task) = (tip(&source, 1.0), Task::default());
    for method in Method::ALL {
        let settings = TransferSettings::of(method);
        let matching = Matching::new(&source, &target, &settings, &task).unwrap();
        let alone = matching.transfer(&region).unwrap();
        let info = method.info();
        assert_eq!(alone.report.agreement.is_some(), info.has_map, "{method}");
        assert_eq!(alone.report.transport.is_some(), method != Method::Nearest, "{method}");
        let anchored = matches!(method, Method::Semfm | Method::Anchored);
        assert_eq!(!alone.report.anchors.is_empty(), anchored, "{method}");
        if info.has_map {
            continue;
        }
        assert_eq!(
            alone.confidence,
            alone.report.evidence.probability(&ConfidenceWeights::default())
        );
        let asked = TransferSettings { second_opinion: true, ..settings };
        let both = transfer(&source, &target, &region, &asked, &task).unwrap();
        assert_eq!(both.region, alone.region, "{method}: the answer is the same");
        let agreement = both.report.agreement.unwrap();
        assert_eq!(both.confidence, probability_by_agreement(agreement));
        assert!(both.report.stages_ms.iter().any(|(stage, _)| stage == "zoomout"));
        assert!(!alone.report.stages_ms.iter().any(|(stage, _)| stage == "zoomout"));
    }
}

#[test]
fn anchors_are_listed_once_they_are_asked_for() {
    let (source, target) = (blob_object(1.0, 0.2), blob_object(1.5, 0.6));
    let (region, task) = (tip(&source, 1.0), Task::default());
    let matching = Matching::new(&source, &target, &TransferSettings::default(), &task).unwrap();
    assert!(matching.transfer(&region).unwrap().report.anchors.is_empty());
    let anchors = matching.anchors(&task).unwrap().pairs.clone();
    let listed = matching.transfer(&region).unwrap().report.anchors;
    assert_eq!(listed.iter().map(|listed| listed.anchor).collect::<Vec<_>>(), anchors);
}
