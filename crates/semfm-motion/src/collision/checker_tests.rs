//! Checker and motions on a small arm whose geometry is known.

use std::path::Path;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use proptest::prelude::*;
use semfm_geom::math::DVec3;
use semfm_robot::{Arm, ArmSettings, Geometry, MeshPaths, RobotDescription};

use super::*;
use crate::planning::Validity;

/// Three links of 0.4 m that turn about y, y and z, the last with a plate at its end; a base below.
const ARM: &str = r#"<robot name="r">
  <link name="base"><collision><origin xyz="0 0 -0.06"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="a"><collision><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.03" length="0.3"/></geometry></collision></link>
  <link name="b"><collision><origin xyz="0 0 0.2"/><geometry><box size="0.06 0.04 0.3"/></geometry></collision></link>
  <link name="c"><visual><origin xyz="0 0 0.1"/><geometry><box size="0.3 0.02 0.1"/></geometry></visual></link>
  <link name="frame"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="j3" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit effort="1" velocity="1"/></joint>
  <joint name="f" type="fixed"><parent link="c"/><child link="frame"/></joint>
</robot>"#;

fn model() -> CollisionModel {
    let path = Path::new("r.urdf");
    let robot = RobotDescription::parse(ARM.as_bytes(), path).unwrap().tree().unwrap();
    let arm = Arm::new(Arc::new(robot), &ArmSettings::default()).unwrap();
    let paths = MeshPaths::new(path, &Default::default());
    let settings = CollisionSettings { n_samples: 2000, ..Default::default() };
    CollisionModel::new(Arc::new(arm), &paths, None, &settings).unwrap()
}

fn checker(scene: Scene) -> CollisionChecker {
    CollisionChecker::new(Arc::new(model()), scene).unwrap()
}

fn block(scene: Scene, name: &str, at: [f64; 3], size: f64) -> Scene {
    let shape = Geometry::Box { size: DVec3::splat(size) };
    scene.with_primitive(name, &shape, Pose::from_translation(at.into())).unwrap()
}

#[test]
fn pairs_are_sorted_with_their_reasons() {
    let model = model();
    let reason = |a: &str, b: &str| {
        let pair = model.skipped_pairs().iter().find(|pair| pair.links == [a, b]);
        pair.map(|pair| pair.reason.clone())
    };
    assert_eq!(reason("base", "a"), Some(SkipReason::Adjacent));
    assert_eq!(reason("b", "c"), Some(SkipReason::Adjacent));
    let checked: Vec<[&str; 2]> = model.checked_pairs().collect();
    assert_eq!(checked, [["base", "b"], ["base", "c"]]);
    // Folded flat, the plate is beyond the first link's other end.
    assert_eq!(reason("a", "c"), Some(SkipReason::Never));
    assert!(model.notes().iter().any(|note| note.contains("link `c`") && note.contains("visuals")));
    assert_eq!(model.bodies().len(), 4);
}

#[test]
fn contacts_are_named_with_their_depth() {
    // Upright, the plate's upper edge is at 0.95; the box reaches down to 0.93.
    let scene = block(Scene::new(), "lamp", [0.0, 0.0, 1.0], 0.14);
    let checker = checker(block(scene, "beside", [0.5, 0.0, 0.2], 0.1));
    assert!(!checker.is_free(&[0.0; 3]));
    let contact = checker.first_contact(&[0.0; 3]).unwrap();
    assert_eq!((contact.a.as_str(), contact.b.as_str()), ("c", "lamp"));
    assert!((contact.depth - 0.02).abs() < 1e-6, "{}", contact.depth);
    assert_eq!(checker.clearance(&[0.0; 3]), 0.0);
    let folded = [0.3, 2.9, 0.0];
    let contacts = checker.contacts(&folded);
    assert!(contacts.iter().any(|contact| contact.a == "base" && contact.b == "c"), "{contacts:?}");
    assert!(contacts.windows(2).all(|pair| pair[0].depth >= pair[1].depth));
    assert!(checker.is_free(&[-0.5, 0.5, 0.0]) && checker.contacts(&[-0.5, 0.5, 0.0]).is_empty());
}

#[test]
fn numbers_without_sense_are_not_free() {
    let checker = checker(Scene::new());
    for odd in [&[0.0, f64::NAN, 0.0][..], &[0.0; 2], &[f64::INFINITY, 0.0, 0.0]] {
        assert!(!checker.is_free(odd) && !checker.motion_is_free(odd, &[0.0; 3]));
        assert_eq!(checker.clearance(odd), 0.0);
        assert!(checker.contacts(odd).is_empty() && checker.nearest_free(odd, 0).is_none());
    }
}

#[test]
fn what_may_touch_is_not_in_the_way() {
    let scene = block(Scene::new(), "lamp", [0.0, 0.0, 1.0], 0.14);
    let checker = checker(scene);
    assert!(checker.allowing("lamp", "c").unwrap().is_free(&[0.0; 3]));
    assert!(!checker.allowing("lamp", "b").unwrap().is_free(&[0.0; 3]));
    assert!(checker.allowing("lamp", "nobody").is_err());
    assert!(
        CollisionChecker::new(checker.model().clone(), block(Scene::new(), "a", [9.0; 3], 0.1))
            .is_err()
    );
}

#[test]
fn a_carried_body_is_checked_and_spares_what_it_may_touch() {
    let checker = checker(block(Scene::new(), "lamp", [0.0, 0.0, 1.2], 0.14));
    assert!(checker.is_free(&[0.0; 3]));
    let body = CollisionBody::from_pieces(&[(Pose::IDENTITY, SharedShape::ball(0.05))]).unwrap();
    let attached = |z: f64, may_touch: &[&str]| AttachedBody {
        name: "object".into(),
        link: checker.model().arm().robot().link("frame").unwrap(),
        link_from_body: Pose::translation(0.0, 0.0, z),
        body: body.clone(),
        may_touch: may_touch.iter().map(|&name| name.into()).collect(),
    };
    // The hand's plate is fixed to the frame that carries the ball: they are not checked.
    assert!(checker.with_attached(attached(0.2, &[])).unwrap().is_free(&[0.0; 3]));
    let high = checker.with_attached(attached(0.3, &[])).unwrap();
    let contact = high.first_contact(&[0.0; 3]).unwrap();
    assert_eq!([contact.a.as_str(), contact.b.as_str()], ["object", "lamp"]);
    assert!((contact.depth - 0.02).abs() < 1e-6);
    assert!(checker.with_attached(attached(0.3, &["lamp"])).unwrap().is_free(&[0.0; 3]));
    assert!(high.without_attached().unwrap().is_free(&[0.0; 3]));
    assert!(high.with_attached(attached(0.3, &[])).is_err(), "a name twice");
    let low = checker.with_attached(attached(-0.75, &[])).unwrap();
    let contacts = low.contacts(&[0.0; 3]);
    assert!(contacts.iter().any(|c| c.a == "a" && c.b == "object"), "{contacts:?}");
}

#[test]
fn a_free_start_is_found_near_one_that_is_not() {
    let checker = checker(block(Scene::new(), "lamp", [0.0, 0.0, 1.0], 0.14));
    let found = checker.nearest_free(&[0.0; 3], 1).unwrap();
    assert!(checker.is_free(&found));
    assert!(found.iter().map(|x| x * x).sum::<f64>().sqrt() < 0.6, "{found:?}");
    assert_eq!(found, checker.nearest_free(&[0.0; 3], 1).unwrap());
    assert_eq!(checker.nearest_free(&[-0.5, 0.5, 0.0], 1).unwrap(), [-0.5, 0.5, 0.0]);
}

fn any_scene() -> impl Strategy<Value = Scene> {
    let at = (-1.0..1.0_f64, -0.5..0.5_f64, -0.2..1.2_f64);
    proptest::collection::vec((at, 0.02..0.3_f64), 1..6).prop_map(|boxes| {
        boxes.iter().enumerate().fold(Scene::new(), |scene, (i, &((x, y, z), size))| {
            block(scene, &format!("box {i}"), [x, y, z], size)
        })
    })
}

fn any_state() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-3.0..3.0_f64)
}

fn between(from: &[f64; 3], to: &[f64; 3], share: f64) -> [f64; 3] {
    std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Points of the bodies, sampled on the pieces' surfaces, are nowhere nearer than the clearance says.
    #[test]
    fn the_clearance_is_a_lower_bound(scene in any_scene(), q in any_state()) {
        let checker = checker(scene.clone());
        let clearance = checker.clearance(&q);
        let mut poses = Vec::new();
        checker.model().arm().link_poses(&q, &mut poses);
        for body in checker.bodies.iter().filter(|body| !body.path.is_empty()) {
            for i in 0..200 {
                let t = f64::from(i);
                let way = DVec3::new((7.1 * t).sin(), (3.3 * t).cos(), (1.9 * t).sin());
                let piece = &body.body.pieces()[0];
                let on = parry3d_f64::shape::SupportMap::local_support_point(&piece.convex.core, way);
                let p = poses[body.link] * piece.body_from_piece * on;
                let dot = CollisionBody::from_pieces(&[(Pose::IDENTITY, SharedShape::ball(1e-9))]).unwrap();
                let at = super::body::Frame::new(Pose::from_translation(p));
                for obstacle in scene.obstacles() {
                    prop_assert!(obstacle.gap(&dot, &at, 9.0) >= clearance - 1e-6);
                }
            }
        }
        prop_assert_eq!(clearance == 0.0, !checker.is_free(&q));
        prop_assert_eq!(clearance == 0.0, !checker.contacts(&q).is_empty());
    }

    /// A motion that is said to be free is so at 2000 states.
    #[test]
    fn no_motion_is_free_that_touches(scene in any_scene(), from in any_state(), to in any_state()) {
        let checker = checker(scene);
        let is_free = checker.motion_is_free(&from, &to);
        prop_assert_eq!(is_free, checker.motion_is_free(&to, &from));
        let n = 2000;
        let touches = (0..=n).find(|&i| {
            let q = between(&from, &to, f64::from(i) / f64::from(n));
            // Between the states that were looked at half the contact distance is kept.
            checker.contacts(&q).iter().any(|contact| contact.depth > -0.5e-4)
        });
        if is_free {
            prop_assert_eq!(touches, None);
        } else {
            // And one that is not touches, or comes as near as the contact distance.
            let least = (0..=n)
                .map(|i| checker.clearance(&between(&from, &to, f64::from(i) / f64::from(n))))
                .fold(1.0, f64::min);
            prop_assert!(least < 4e-3, "nearest {}", least);
        }
    }

    /// No point goes farther than the displacement says.
    #[test]
    fn the_displacement_is_an_upper_bound(from in any_state(), to in any_state()) {
        let checker = checker(Scene::new());
        let travel: Vec<f64> = from.iter().zip(&to).map(|(a, b)| (a - b).abs()).collect();
        let bound = checker.displacement(&travel);
        let (mut before, mut after) = (Vec::new(), Vec::new());
        checker.model().arm().link_poses(&from, &mut before);
        checker.model().arm().link_poses(&to, &mut after);
        for body in checker.bodies.iter() {
            for piece in body.body.pieces() {
                for way in [DVec3::ONE, -DVec3::ONE, DVec3::Z] {
                    let p = parry3d_f64::shape::SupportMap::local_support_point(&piece.convex.core, way);
                    let p = piece.body_from_piece * p;
                    prop_assert!((before[body.link] * p).distance(after[body.link] * p) <= bound + 1e-9);
                }
            }
        }
        let half: Vec<f64> = travel.iter().map(|way| way / 2.0).collect();
        prop_assert!((checker.displacement(&half) - bound / 2.0).abs() < 1e-9);
    }
}
