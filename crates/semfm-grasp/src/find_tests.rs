//! Properties of the whole search on shapes with known grasps.

use parry3d_f64::math::{Pose, Rotation};
use proptest::prelude::*;
use semfm_geom::math::{DQuat, DVec3};
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, Task, zoo};

use crate::find::{Grasps, PoseToExamine, examine_poses, find_grasps_with};
use crate::grasp_distance::GraspDistance;
use crate::gripper_geometry::{BoxGripper, GripperGeometry};
use crate::object::GraspObject;
use crate::rejection::Reason;
use crate::scene::Scene;
use crate::settings::{ApproachCone, GraspSettings};
use crate::test_meshes::{cuboid, cylinder, joined, moved, noisy};
use crate::working_surface::SurfaceSettings;

fn gripper() -> GripperGeometry {
    GripperGeometry::from_boxes(&BoxGripper::default()).unwrap()
}

fn few(n_samples: usize) -> GraspSettings {
    GraspSettings { n_samples, neighbour_rounds: 0, ..GraspSettings::default() }
}

fn search(mesh: &Mesh, scene: &Scene, settings: &GraspSettings) -> Grasps {
    let object = GraspObject::from_mesh(mesh, 1.0).unwrap();
    let region = vec![1.0; object.n_weights()];
    find_grasps_with(&object, &region, &gripper(), scene, settings, &Task::default()).unwrap()
}

fn bar() -> Mesh {
    cuboid(DVec3::new(0.2, 0.03, 0.05))
}

#[test]
fn grasps_of_a_bar_close_across_it() {
    let found = search(&bar(), &Scene::new(), &few(200));
    assert_eq!(found.grasps.len(), GraspSettings::default().top);
    assert!(found.grasps.is_sorted_by(|a, b| a.score >= b.score));
    assert_eq!(found.rejected.total() + found.n_survivors, found.n_candidates);
    for grasp in &found.grasps {
        let (y, z) = (grasp.closing().y.abs(), grasp.closing().z.abs());
        let width = if y > z { 0.03 } else { 0.05 };
        assert!(y.max(z) > 0.88, "closing along {}", grasp.closing());
        // A tilted gripper is wider by the pad's share of the tilt.
        assert!(grasp.width >= width && grasp.width < width + 0.012, "{}", grasp.width);
        assert!((0.0..=1.0).contains(&grasp.score) && grasp.epsilon > 0.0);
        assert!(grasp.terms.iter().all(|(_, value)| (0.0..=1.0).contains(value)));
        for (contact, normal) in grasp.contacts.iter().zip(&grasp.normals) {
            let inside = contact.abs().cmple(DVec3::new(0.1, 0.015, 0.025) + 1e-9);
            assert!(inside.all() && normal.is_normalized(), "{contact}");
        }
    }
    let best = &found.grasps[0];
    assert!(best.contacts[0].midpoint(best.contacts[1]).length() < 0.03, "near the middle");
}

#[test]
fn grasps_of_a_ball_and_a_can_go_through_their_middles() {
    let ball = moved(&zoo::icosphere(4), |p| 0.025 * p);
    for grasp in search(&ball, &Scene::new(), &few(200)).grasps {
        let line = (grasp.contacts[1] - grasp.contacts[0]).normalize();
        let off = (-grasp.contacts[0]).reject_from_normalized(line).length();
        assert!(off < 0.025 * 0.5f64.atan().sin(), "{off} beside the middle");
        // Where a finger meets the ball beside its pad, the hand stays wider by up to half of what pads give way.
        assert!((0.044..0.0503 + 1.5e-3).contains(&grasp.width), "{}", grasp.width);
    }
    let can = search(&cylinder(0.033, 0.1, 96), &Scene::new(), &few(200));
    assert!(!can.grasps.is_empty());
    for grasp in can.grasps {
        assert!(grasp.closing().z.abs() < 0.45, "100 mm do not fit");
    }
}

#[test]
fn a_block_too_large_is_refused_for_its_width() {
    let found = search(&cuboid(DVec3::splat(0.1)), &Scene::new(), &few(100));
    assert!(found.grasps.is_empty());
    assert!(found.rejected.count(Reason::Width) > 100);
    let miss = found.nearest_miss.unwrap();
    assert_eq!(miss.reason, Reason::Width);
    assert!((miss.by - 0.0202).abs() < 1e-3, "{} m too wide", miss.by);
}

#[test]
fn a_table_removes_what_comes_from_below() {
    let free = search(&bar(), &Scene::new(), &few(200));
    assert!(free.grasps.iter().any(|g| g.approach().z > 0.5));
    let table = Scene::new().with_table(DVec3::Z * -0.025, DVec3::Z).unwrap();
    let found = search(&bar(), &table, &few(200));
    assert!(!found.grasps.is_empty() && found.rejected.count(Reason::Table) > 50);
    for grasp in &found.grasps {
        assert!(grasp.approach().z < 0.1, "approach {}", grasp.approach());
    }
}

#[test]
fn limits_hold_for_every_grasp() {
    let mut settings = few(300);
    let axis = DVec3::new(0.0, 0.2, -1.0);
    settings.limits.approach = Some(ApproachCone { axis, half_angle: 0.5 });
    settings.limits.width = Some(0.02..=0.04);
    settings.limits.clearance = 0.004;
    let found = search(&bar(), &Scene::new(), &settings);
    assert!(!found.grasps.is_empty());
    for grasp in &found.grasps {
        assert!(grasp.approach().angle_between(axis) <= 0.5);
        assert!((0.02..=0.0403).contains(&grasp.width));
        assert!(grasp.term("clearance").unwrap() >= 0.4 - 1e-9);
    }
    assert!(found.rejected.count(Reason::Approach) > 0);
    settings.limits.clearance = 0.04;
    let none = search(&bar(), &Scene::new(), &settings);
    assert!(none.grasps.is_empty());
    assert_eq!(none.nearest_miss.unwrap().reason, Reason::Clearance);
}

#[test]
fn pads_stay_in_the_region_and_stop_at_its_border() {
    // A bar of many triangles, so that a region has a border.
    let long = cylinder(0.02, 0.2, 48);
    let points: Vec<DVec3> =
        sample_uniform(&long, 4000, 1).unwrap().iter().map(|s| s.point).collect();
    let object = GraspObject::from_cloud(&points, None, None).unwrap();
    let region: Vec<f64> = points.iter().map(|p| f64::from(u8::from(p.z > 0.05))).collect();
    let mut settings = few(60);
    settings.limits.pad_in_region = 0.9;
    let task = Task::default();
    let found =
        find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task).unwrap();
    assert!(!found.grasps.is_empty() && found.rejected.count(Reason::Region) > 0);
    for grasp in &found.grasps {
        assert!(grasp.contacts.iter().all(|p| p.z > 0.045), "{:?}", grasp.contacts);
        assert!(grasp.term("region").unwrap() >= 0.9);
    }
}

#[test]
fn the_seed_decides_and_the_number_of_threads_does_not() {
    let mesh = joined(&bar(), &moved(&cylinder(0.02, 0.1, 24), |p| p + 0.06 * DVec3::Z));
    let [one, three, other] = [(1, 7), (3, 7), (1, 8)].map(|(threads, seed)| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = GraspSettings { seed, neighbour_rounds: 1, ..few(40) };
        pool.install(|| search(&mesh, &Scene::new(), &settings))
    });
    assert_eq!(one.grasps, three.grasps);
    assert_eq!(one.rejected, three.rejected);
    assert!(one.grasps != other.grasps);
}

#[test]
fn each_round_of_neighbours_finds_more() {
    let [none, one] = [0, 1].map(|neighbour_rounds| {
        let settings = GraspSettings { neighbour_rounds, ..few(20) };
        search(&bar(), &Scene::new(), &settings).n_survivors
    });
    assert!(none > 0 && one > none + 5, "{none}, then {one}");
}

#[test]
fn a_cancelled_search_stops() {
    let object = GraspObject::from_mesh(&bar(), 1.0).unwrap();
    let (region, task) = (vec![1.0; object.n_weights()], Task::default());
    task.cancel();
    let settings = GraspSettings::default();
    let found = find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task);
    assert!(matches!(found, Err(crate::Error::Geom(semfm_geom::Error::Cancelled))));
}

#[test]
fn every_mesh_of_the_zoo_is_searched_at_every_size() {
    for (name, mesh) in zoo::all() {
        for size in [1e-4, 0.08, 100.0] {
            let scale = size / mesh.diagonal();
            let object = GraspObject::from_mesh(&mesh, scale).unwrap();
            let region = vec![1.0; object.n_weights()];
            let task = Task::default();
            let found =
                find_grasps_with(&object, &region, &gripper(), &Scene::new(), &few(20), &task)
                    .unwrap();
            assert_eq!(
                found.rejected.total() + found.n_survivors,
                found.n_candidates,
                "{name} at {size} m"
            );
            assert!(found.n_survivors > 0 || found.n_candidates > 0);
        }
    }
}

#[test]
fn a_thin_open_sheet_is_held_by_its_border() {
    // 9 × 7 points of the zoo's grid, some 8 cm wide: no thickness and no inside.
    let grid = zoo::open_grid(9, 7);
    let sheet = moved(&grid, |p| 0.08 / grid.diagonal() * DVec3::new(p.x, p.y, 0.0));
    let found = search(&sheet, &Scene::new(), &few(200));
    assert!(!found.grasps.is_empty(), "{:?}", found.rejected.iter().collect::<Vec<_>>());
    assert!(found.grasps.iter().all(|g| g.closing().z.abs() > 0.88));
}

/// A handle with a head, of edges of some 2 mm: a hammer of 22 cm.
fn hammer() -> Mesh {
    let ball = zoo::icosphere(5);
    let handle = moved(&ball, |p| {
        let z = 0.1 * p.z.asin() * std::f64::consts::FRAC_2_PI;
        let r = 0.014 * (1.0 - (z / 0.1).powi(8)).max(0.0).powf(0.25);
        let across = DVec3::new(p.x, p.y, 0.0).normalize_or_zero();
        DVec3::new(0.0, 0.0, z) + r * across
    });
    let head = moved(&zoo::icosphere(4), |p| DVec3::new(0.045 * p.x, 0.02 * p.y, 0.1 + 0.02 * p.z));
    joined(&handle, &head)
}

#[test]
fn noise_of_half_a_percent_leaves_half_of_the_grasps() {
    let clean = hammer();
    let rough = noisy(&clean, 0.005 * clean.diagonal(), 3);
    let settings = few(60);
    let [good, left] = [&clean, &rough].map(|mesh| search(mesh, &Scene::new(), &settings));
    assert!(good.n_survivors > 100, "{}", good.n_survivors);
    assert!(
        2 * left.n_survivors >= good.n_survivors,
        "{} of {}",
        left.n_survivors,
        good.n_survivors
    );
    assert!(left.surface.noise > 0.5e-3 && good.surface.noise == 0.0);
    // The rough mesh itself keeps off every hand, and the pads are told to go below it.
    for grasp in &left.grasps {
        assert!(
            grasp.contact_width() < grasp.width && grasp.command_width() < grasp.contact_width()
        );
        assert!(!meets(&rough, grasp.width, &grasp.object_from_tcp), "{grasp:?}");
    }
    let object = GraspObject::with_surface(&rough, 1.0, SurfaceSettings::exact()).unwrap();
    let region = vec![1.0; object.n_weights()];
    let task = Task::default();
    let bare =
        find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task).unwrap();
    assert!(4 * bare.n_survivors < good.n_survivors, "without smoothing {}", bare.n_survivors);
}

/// Where few are asked for, most grasps are told from them before their score is known.
#[test]
fn the_few_best_are_those_of_all() {
    let best = |top: usize| {
        let settings =
            GraspSettings { n_samples: 60, top, diversity: 0.0, ..GraspSettings::default() };
        search(&hammer(), &Scene::new(), &settings)
    };
    let (few, all) = (best(5), best(usize::MAX));
    assert!(all.grasps.len() > 200, "{}", all.grasps.len());
    assert_eq!(few.grasps.len(), 5);
    for (one, other) in few.grasps.iter().zip(&all.grasps) {
        assert!((one.score - other.score).abs() < 1e-9 && one.is_scored(), "{one:?} {other:?}");
    }
    assert!(all.grasps.iter().all(crate::grasp::Grasp::is_scored));
}

/// Whether a point of the mesh, or of the middle of one of its edges, is inside of a box of the closed default gripper:
/// told without any of the code that the search uses.
fn meets(mesh: &Mesh, width: f64, tcp: &Pose) -> bool {
    let BoxGripper { finger, tip, palm, .. } = BoxGripper::default();
    let inside = |p: DVec3| {
        let side = p.y.abs() - width / 2.0;
        let at_finger = p.x.abs() < finger[0] / 2.0
            && (0.0..finger[1]).contains(&side)
            && (tip - finger[2]..tip).contains(&p.z);
        let palm_z = tip - finger[2] - p.z;
        let at_palm = p.x.abs() < palm[0] / 2.0
            && p.y.abs() < palm[1] / 2.0
            && (0.0..palm[2]).contains(&palm_z);
        at_finger || at_palm
    };
    let tcp_from_object = tcp.inverse();
    (0..mesh.n_faces()).any(|face| {
        let [a, b, c] = mesh.corners(face).map(|p| tcp_from_object * p);
        [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a)].into_iter().any(inside)
    })
}

#[test]
fn grasps_of_a_dense_mesh_are_those_of_the_mesh_itself() {
    let dense = moved(&zoo::icosphere(5), |p| DVec3::new(0.06 * p.x, 0.02 * p.y, 0.03 * p.z));
    let settings = SurfaceSettings { working_vertices: 1500, smooth: true };
    let object = GraspObject::with_surface(&dense, 1.0, settings).unwrap();
    assert!(object.surface_report().is_simplified);
    let (region, task) = (vec![1.0; object.n_weights()], Task::default());
    let settings = GraspSettings { n_samples: 60, neighbour_rounds: 1, ..GraspSettings::default() };
    let found =
        find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task).unwrap();
    assert_eq!(found.grasps.len(), settings.top);
    assert_eq!(found.rejected.total() + found.n_survivors, found.n_candidates);
    let exact = GraspObject::with_surface(&dense, 1.0, SurfaceSettings::exact()).unwrap();
    for grasp in &found.grasps {
        assert!(!meets(&dense, grasp.width, &grasp.object_from_tcp));
        let pose = PoseToExamine { object_from_tcp: grasp.object_from_tcp, width: grasp.width };
        let again =
            examine_poses(&exact, &region, &gripper(), &Scene::new(), &settings, &[pose]).unwrap();
        let again = again[0].as_ref().unwrap();
        assert!((again.width - grasp.width).abs() < 1e-9);
        for (here, there) in grasp.contacts.iter().zip(&again.contacts) {
            assert!(here.distance(*there) < 1e-6, "{here} and {there}");
        }
    }
}

#[test]
fn the_best_grasp_stays_where_it_is_when_the_seed_changes() {
    let mesh = hammer();
    let object = GraspObject::from_mesh(&mesh, 1.0).unwrap();
    let region = vec![1.0; object.n_weights()];
    // Gravity and one side to come from: else a round handle has many equal grasps.
    let mut settings = GraspSettings { n_samples: 200, gravity: Some(DVec3::NEG_Z), ..few(200) };
    settings.neighbour_rounds = 1;
    let places: Vec<DVec3> = (0..3)
        .map(|seed| {
            let settings = GraspSettings { seed, ..settings.clone() };
            let task = Task::default();
            let found =
                find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task);
            let best = &found.unwrap().grasps[0];
            best.contacts[0].midpoint(best.contacts[1])
        })
        .collect();
    for place in &places {
        assert!(place.distance(places[0]) <= 0.01, "{places:?}");
    }
}

#[test]
fn an_uncertain_pose_keeps_the_gripper_away() {
    let margin = 0.004;
    let settings = GraspSettings { pose_margin: margin, ..few(200) };
    let table = Scene::new().with_table(DVec3::Z * -0.04, DVec3::Z).unwrap();
    let found = search(&bar(), &table, &settings);
    assert!(!found.grasps.is_empty());
    for grasp in &found.grasps {
        assert!(grasp.opening >= grasp.width + 1.9 * margin, "{grasp:?}");
        let lowest = grasp.object_from_tcp.translation.z - 0.009 * grasp.approach().z.abs();
        assert!(lowest > -0.04, "{lowest}");
    }
    let [sure, unsure] = [0.0, 0.012].map(|pose_margin| {
        search(&bar(), &table, &GraspSettings { pose_margin, ..few(200) }).n_survivors
    });
    assert!(unsure < sure, "{unsure} of {sure}");
}

#[test]
fn long_pads_hold_a_short_handle_with_their_tips() {
    // A bail of 12 mm before a wall 45 mm behind it: pads of 65 mm do not fit between.
    let bail = moved(&cylinder(0.006, 0.06, 48), |p| DVec3::new(p.x, p.z, p.y));
    let wall = moved(&cuboid(DVec3::new(0.2, 0.2, 0.01)), |p| p - 0.05 * DVec3::Z);
    let both = joined(&bail, &wall);
    let object = GraspObject::from_mesh(&both, 1.0).unwrap();
    let region: Vec<f64> =
        both.vertices().iter().map(|p| f64::from(u8::from(p.z > -0.02))).collect();
    let long = BoxGripper {
        opening: 0.0..=0.14,
        pad: [0.027, 0.065],
        finger: [0.03, 0.014, 0.1],
        tip: 0.0325,
        palm: [0.08, 0.2, 0.1],
    };
    let hand = GripperGeometry::from_boxes(&long).unwrap();
    let (settings, task) = (few(200), Task::default());
    let found = find_grasps_with(&object, &region, &hand, &Scene::new(), &settings, &task).unwrap();
    assert!(found.grasps.len() >= 10, "{} {:?}", found.grasps.len(), found.rejected);
}

/// A rotation from three angles.
fn random_rotation(a: f64, b: f64, c: f64) -> Rotation {
    DQuat::from_euler(glam::EulerRot::XYZ, a, b, c)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3))]

    #[test]
    fn examined_grasps_move_with_the_object(
        a in -3.0..3.0f64, b in -1.5..1.5f64, c in -3.0..3.0f64, shift in -0.5..0.5f64,
    ) {
        let motion = Pose::from_parts(DVec3::new(shift, -0.3, 0.2), random_rotation(a, b, c));
        let object = GraspObject::from_mesh(&bar(), 1.0).unwrap();
        let turned = GraspObject::from_mesh(&moved(&bar(), |p| motion * p), 1.0).unwrap();
        let region = vec![1.0; object.n_weights()];
        let poses: Vec<PoseToExamine> = (0..40)
            .map(|i| {
                let t = f64::from(i);
                let about = random_rotation(0.4 * t.sin(), 0.1 * t.cos(), 0.2 * (2.0 * t).sin());
                let place = DVec3::new(0.08 * t.cos(), 0.003 * t.sin(), 0.02 * (3.0 * t).cos());
                PoseToExamine { object_from_tcp: Pose::from_parts(place, about), width: 0.08 }
            })
            .collect();
        let moved_poses: Vec<PoseToExamine> = poses
            .iter()
            .map(|pose| PoseToExamine { object_from_tcp: motion * pose.object_from_tcp, ..*pose })
            .collect();
        let (settings, gripper, scene) = (GraspSettings::default(), gripper(), Scene::new());
        let here = examine_poses(&object, &region, &gripper, &scene, &settings, &poses).unwrap();
        let there = examine_poses(&turned, &region, &gripper, &scene, &settings, &moved_poses).unwrap();
        let mut good = 0;
        for (here, there) in here.iter().zip(&there) {
            prop_assert_eq!(here.is_ok(), there.is_ok());
            if let (Ok(here), Ok(there)) = (here, there) {
                good += 1;
                let expected = motion * here.object_from_tcp;
                let apart = GraspDistance::between(&expected, &there.object_from_tcp);
                prop_assert!(apart.translation < 1e-7 && apart.rotation < 1e-6);
                prop_assert!((here.width - there.width).abs() < 1e-9);
                prop_assert!((here.score - there.score).abs() < 1e-3);
            }
        }
        prop_assert!(good >= 3, "{} of 40", good);
    }

    #[test]
    fn a_turned_object_has_as_good_grasps(a in -3.0..3.0f64, b in -1.5..1.5f64, c in -3.0..3.0f64) {
        let turn = random_rotation(a, b, c);
        let here = search(&bar(), &Scene::new(), &few(60));
        let there = search(&moved(&bar(), |p| turn * p), &Scene::new(), &few(60));
        prop_assert!((here.grasps[0].score - there.grasps[0].score).abs() < 0.1);
    }

    #[test]
    fn an_object_in_other_units_has_the_same_grasps(scale in 0.01..1000.0f64) {
        let settings = few(30);
        let in_metres = search(&bar(), &Scene::new(), &settings);
        let object = GraspObject::from_mesh(&moved(&bar(), |p| p / scale), scale).unwrap();
        let region = vec![1.0; object.n_weights()];
        let task = Task::default();
        let scaled =
            find_grasps_with(&object, &region, &gripper(), &Scene::new(), &settings, &task).unwrap();
        prop_assert!((in_metres.grasps[0].score - scaled.grasps[0].score).abs() < 0.05);
        prop_assert!((in_metres.n_candidates as f64 / scaled.n_candidates as f64 - 1.0).abs() < 0.1);
    }
}
