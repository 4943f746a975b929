//! Objects followed through rendered sequences: still, moving, hidden, pushed, taken away.

mod scenes;

use scenes::{FRAMES, Moment, Scene, Script};
use semfm_geom::math::{DAffine3, DQuat, DVec3};
use semfm_geom::{Mesh, Task};
use semfm_synth::{Category, ObjectSettings, make_object};
use semfm_track::{DepthFrame, TrackRecord, TrackSettings, TrackState, Tracker};

/// Diagonal of the objects, metres.
const SIZE: f64 = 0.2;

/// Width of the pictures.
const WIDTH: u32 = 320;

fn object(category: Category) -> Mesh {
    let settings = ObjectSettings { n_vertices: 2000, ..Default::default() };
    make_object(category, 0, &settings).unwrap().mesh
}

fn rotation() -> DQuat {
    DQuat::from_axis_angle(DVec3::new(0.4, 0.9, -0.2).normalize(), 0.7)
}

/// Follows a run from a pose that is off by some millimetres and degrees.
fn run(scene: &Scene, script: Script, settings: &TrackSettings) -> Vec<(Moment, TrackRecord)> {
    let first = script.moment(scene, rotation(), 0).pose.unwrap();
    let off = semfm_align::Sim3 {
        rotation: DQuat::from_axis_angle(DVec3::Y, 0.05) * first.rotation,
        translation: first.translation + DVec3::new(0.004, -0.003, 0.006),
        ..first
    };
    let settings = TrackSettings { init: Some(off), ..settings.clone() };
    let mut tracker = Tracker::new(&scene.mesh, &settings, &Task::default()).unwrap();
    (0..FRAMES)
        .map(|frame| {
            let moment = script.moment(scene, rotation(), frame);
            let depth = scene.depth(&moment, frame as u64);
            let seen = DepthFrame {
                depth: &depth,
                camera: &scene.camera,
                mask: None,
                time_nanos: Some(33_000_000 * (frame as u64 + 1)),
            };
            (moment, tracker.step(&seen, &Task::default()).unwrap())
        })
        .collect()
}

/// Frames whose state says that the object was seen, and whose pose is not where it is.
fn n_false(scene: &Scene, frames: &[(Moment, TrackRecord)]) -> usize {
    let is_false = |(moment, record): &&(Moment, TrackRecord)| {
        record.state.is_seen()
            && !record
                .camera_from_object
                .is_some_and(|found| scene.is_right(&found, moment.pose.as_ref()))
    };
    frames.iter().filter(is_false).count()
}

#[test]
fn a_mug_that_stands_or_moves_is_followed_within_millimetres() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH);
    for script in [Script::Still, Script::Moving] {
        let frames = run(&scene, script, &TrackSettings::default());
        assert_eq!(frames[0].1.state, TrackState::New);
        for (moment, record) in &frames {
            assert!(record.state.is_seen(), "{script:?}: {record:?}");
            let found = record.camera_from_object.unwrap();
            // With its handle behind it, a mug may turn about its axis.
            let off = scene.surface_error(&found, &moment.pose.unwrap());
            assert!(off < 0.002, "{script:?}, frame {}: {off}", record.frame);
            assert!(record.probability > 0.8 && record.position_std.unwrap() < 0.005);
        }
    }
}

#[test]
fn what_is_hidden_is_not_gone() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH);
    for share in [0.2, 0.5, 0.8] {
        let frames = run(&scene, Script::Hidden(share), &TrackSettings::default());
        assert_eq!(n_false(&scene, &frames), 0, "{share}");
        for (moment, record) in &frames {
            assert_ne!(record.state, TrackState::Lost, "{share}, frame {}", record.frame);
            let found = record.camera_from_object.unwrap();
            assert!(scene.is_right(&found, moment.pose.as_ref()));
        }
        assert_eq!(frames[FRAMES - 1].1.state, TrackState::Tracking);
    }
    let frames = run(&scene, Script::Hidden(1.0), &TrackSettings::default());
    assert!(frames.iter().any(|(_, record)| record.state == TrackState::Occluded));
    let [before, behind] = [0, FRAMES / 2].map(|at| &frames[at].1);
    assert_eq!(behind.state, TrackState::Occluded);
    assert!(behind.probability < before.probability && behind.position_std > before.position_std);
    assert_eq!(frames[FRAMES - 1].1.state, TrackState::Tracking);
}

#[test]
fn a_push_is_noticed_and_the_object_found_again() {
    for category in [Category::Containers, Category::Tools] {
        let scene = Scene::new(&object(category), SIZE, WIDTH);
        let frames = run(&scene, Script::Pushed, &TrackSettings::default());
        assert_eq!(n_false(&scene, &frames), 0, "{category}");
        let again = frames.iter().position(|(_, r)| r.state == TrackState::Reacquired);
        assert!(again.is_some_and(|at| (20..32).contains(&at)), "{category}: {again:?}");
        assert_eq!(frames[FRAMES - 1].1.state, TrackState::Tracking);
    }
}

#[test]
fn what_is_taken_away_is_lost_and_what_comes_back_is_found() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH);
    let frames = run(&scene, Script::Removed, &TrackSettings::default());
    assert_eq!(n_false(&scene, &frames), 0);
    for (_, record) in &frames[20..35] {
        assert_eq!(record.state, TrackState::Lost);
        assert!(record.camera_from_object.is_none() && record.probability == 0.0);
    }
    let again = frames.iter().position(|(_, r)| r.state == TrackState::Reacquired);
    assert!(again.is_some_and(|at| (35..55).contains(&at)), "{again:?}");
    let frames = run(&scene, Script::Stolen, &TrackSettings::default());
    assert_eq!(n_false(&scene, &frames), 0);
    assert_eq!(frames[25].1.state, TrackState::Occluded);
    assert_eq!(frames[FRAMES - 1].1.state, TrackState::Lost);
}

#[test]
fn a_moving_camera_takes_what_is_hidden_along() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH).in_the_air();
    let world_from_object = Script::Still.moment(&scene, rotation(), 0).pose.unwrap();
    // 5 mm and 1° a frame: half a turn of a screw around the object.
    let camera_from_world = |frame: usize| {
        let t = frame as f64;
        let turn = DQuat::from_axis_angle(DVec3::Y, 1f64.to_radians() * t);
        let aside = DVec3::new(0.0, 0.002 * t, 0.001 * t);
        let middle = DVec3::new(0.0, 0.0, 0.62);
        DAffine3::from_rotation_translation(turn, middle - turn * middle + aside)
    };
    let settings = TrackSettings { init: Some(world_from_object), ..Default::default() };
    let mut tracker = Tracker::new(&scene.mesh, &settings, &Task::default()).unwrap();
    for frame in 0..40 {
        let pose = camera_from_world(frame);
        let camera = scene.camera.posed(pose).unwrap();
        let (_, rotation, translation) = pose.to_scale_rotation_translation();
        let moved = semfm_align::Sim3 { scale: 1.0, rotation, translation };
        let truth = moved * world_from_object;
        let hidden = if (15..25).contains(&frame) { 1.0 } else { 0.0 };
        let depth = scene.depth(&Moment { pose: Some(truth), hidden }, frame as u64);
        let seen = DepthFrame { depth: &depth, camera: &camera, mask: None, time_nanos: None };
        let record = tracker.step(&seen, &Task::default()).unwrap();
        let expected = match frame {
            0 => TrackState::New,
            _ if hidden > 0.0 => TrackState::Occluded,
            _ => TrackState::Tracking,
        };
        assert_eq!(record.state, expected, "frame {frame}");
        // Hidden it stands where it stood in the world, which is elsewhere before the camera.
        let off = scene.surface_error(&record.camera_from_object.unwrap(), &truth);
        assert!(off < 0.003, "frame {frame}: {off}");
    }
}

#[test]
fn a_small_object_is_followed_too() {
    // 5 cm at 62 cm: some 40 pixels of 640.
    let scene = Scene::new(&object(Category::Containers), 0.05, 640);
    for script in [Script::Still, Script::Hidden(0.5)] {
        let frames = run(&scene, script, &TrackSettings::default());
        assert_eq!(n_false(&scene, &frames), 0, "{script:?}");
        assert_eq!(frames[0].1.state, TrackState::New);
        for (moment, record) in &frames {
            let found = record.camera_from_object.expect("never lost");
            let off = scene.surface_error(&found, &moment.pose.unwrap());
            assert!(off < 0.003, "{script:?}, frame {}: {off}", record.frame);
        }
        assert_eq!(frames[FRAMES - 1].1.state, TrackState::Tracking);
    }
}

#[test]
fn without_a_pose_the_first_frames_are_searched() {
    let scene = Scene::new(&object(Category::Tools), SIZE, WIDTH);
    let truth = Script::Still.moment(&scene, rotation(), 0);
    for scale in [None, Some(1.0)] {
        let settings = TrackSettings { scale, ..Default::default() };
        let mut tracker = Tracker::new(&scene.mesh, &settings, &Task::default()).unwrap();
        let mut records = (0..3).map(|i| {
            let depth = scene.depth(&truth, i);
            let frame =
                DepthFrame { depth: &depth, camera: &scene.camera, mask: None, time_nanos: None };
            tracker.step(&frame, &Task::default()).unwrap()
        });
        let record = records.find(|record| record.state == TrackState::New);
        let found = record.expect("the object is found").camera_from_object.unwrap();
        assert!((found.scale - 1.0).abs() < 0.05, "{}", found.scale);
        assert!(scene.is_right(&found, truth.pose.as_ref()), "{scale:?}: {found:?}");
    }
}

#[test]
fn the_same_frames_give_the_same_records_at_every_thread_count() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&scene, Script::Pushed, &TrackSettings::default()))
    };
    let (one, two) = (with(1), with(2));
    assert!(one.iter().zip(&two).all(|(a, b)| a.1 == b.1));
}

#[test]
fn a_region_loses_confidence_where_the_object_is_not_as_its_mesh() {
    let scene = Scene::new(&object(Category::Containers), SIZE, WIDTH);
    // The mesh that is followed has a bump of 15 mm that the object lacks.
    let (low, high) = scene.mesh.bounds();
    let truth = Script::Still.moment(&scene, rotation(), 0).pose.unwrap();
    let eye = truth.inverse().translation;
    let middle = low.midpoint(high);
    let tip = scene
        .mesh
        .vertices()
        .iter()
        .copied()
        .max_by(|a, b| {
            let along = |p: &DVec3| (*p - middle).dot((eye - middle).normalize());
            along(a).total_cmp(&along(b))
        })
        .unwrap();
    let near: Vec<f64> =
        scene.mesh.vertices().iter().map(|p| f64::from(u8::from(p.distance(tip) < 0.03))).collect();
    let bumped = scene.mesh.vertices().iter().zip(&near);
    let towards = (eye - tip).normalize();
    let bumped = bumped.map(|(&p, &w)| p + w * 0.015 * towards).collect();
    let bumped = Mesh::new(bumped, scene.mesh.faces().to_vec()).unwrap();
    let depth: Vec<_> =
        (0..25).map(|i| scene.depth(&Moment { pose: Some(truth), hidden: 0.0 }, i)).collect();
    let confidence = |mesh: &Mesh| {
        let settings = TrackSettings { init: Some(truth), ..Default::default() };
        let tracker = Tracker::new(mesh, &settings, &Task::default()).unwrap();
        let mut tracker = tracker.with_region(&near).unwrap();
        let mut last = None;
        for depth in &depth {
            let frame = DepthFrame { depth, camera: &scene.camera, mask: None, time_nanos: None };
            last = tracker.step(&frame, &Task::default()).unwrap().region;
        }
        let refined = tracker.refined_region().unwrap().unwrap();
        (last.unwrap().confidence, refined.iter().sum::<f64>() / near.iter().sum::<f64>())
    };
    let (as_it_is, with_bump) = (confidence(&scene.mesh), confidence(&bumped));
    assert!(as_it_is.0 > 0.9 && as_it_is.1 > 0.9, "{as_it_is:?}");
    assert!(with_bump.0 < as_it_is.0 - 0.2 && with_bump.1 < as_it_is.1 - 0.2, "{with_bump:?}");
}

#[test]
fn what_is_kept_does_not_grow() {
    let scene = Scene::new(&object(Category::Containers), SIZE, 160);
    let still = Script::Still.moment(&scene, rotation(), 0);
    let images: Vec<_> = (0..4)
        .map(|i| {
            let moment = if i == 3 { Moment { hidden: 0.7, ..still } } else { still };
            scene.depth(&moment, i)
        })
        .collect();
    let settings = TrackSettings { init: still.pose, ..Default::default() };
    let mut tracker = Tracker::new(&scene.mesh, &settings, &Task::default()).unwrap();
    let mut kept = Vec::new();
    for i in 0..1000 {
        let depth = &images[i % images.len()];
        let frame = DepthFrame { depth, camera: &scene.camera, mask: None, time_nanos: None };
        tracker.step(&frame, &Task::default()).unwrap();
        kept.push(tracker.kept_bytes());
    }
    assert_eq!(kept[99], kept[999]);
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let scene = Scene::new(&object(Category::Containers), SIZE, 160);
    let other = Scene::new(&object(Category::Containers), SIZE, 320);
    let still = Script::Still.moment(&scene, rotation(), 0);
    let depth = scene.depth(&still, 0);
    let settings = TrackSettings { init: still.pose, ..Default::default() };
    let mut tracker = Tracker::new(&scene.mesh, &settings, &Task::default()).unwrap();
    let frame =
        DepthFrame { depth: &depth, camera: &scene.camera, mask: None, time_nanos: Some(7) };
    tracker.step(&frame, &Task::default()).unwrap();
    let mut words =
        |frame: &DepthFrame<'_>| tracker.step(frame, &Task::default()).unwrap_err().to_string();
    assert!(words(&frame).contains("later than 7 ns"));
    let later = DepthFrame { time_nanos: Some(8), ..frame };
    assert!(words(&DepthFrame { camera: &other.camera, ..later }).contains("320 × 240"));
    assert!(words(&DepthFrame { mask: Some(&[true]), ..later }).contains("mask"));
    let task = Task::default();
    task.cancel();
    assert!(tracker.step(&later, &task).is_err());
    for (settings, word) in [
        (TrackSettings { scale: Some(-1.0), ..Default::default() }, "scale"),
        (TrackSettings { hypotheses: 0, ..Default::default() }, "hypotheses"),
        (TrackSettings { scale: Some(2.0), init: still.pose, ..Default::default() }, "scale"),
    ] {
        let error = Tracker::new(&scene.mesh, &settings, &Task::default()).err().unwrap();
        assert!(error.to_string().contains(word), "{error}");
    }
    let tracker = Tracker::new(&scene.mesh, &TrackSettings::default(), &Task::default()).unwrap();
    assert!(tracker.with_region(&[1.0]).is_err());
}
