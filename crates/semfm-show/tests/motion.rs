//! A motion in all its files: what each holds agrees with the trajectory.

#[path = "../examples/write_sample_motion.rs"]
#[allow(dead_code)]
mod sample;

use std::path::Path;

use semfm::files::{TrajectoryFile, read_motion};
use semfm::geom::io::read_mesh;
use semfm::geom::math::{DVec3, bounds};
use semfm::{PlannedMotion, Task};
use semfm_show::{NearMiss, PLAN_FILES, groups_of_paths, write_animated_glb, write_page};
use semfm_show::{write_miss_picture, write_plan_folder};

fn motion(folder: &Path) -> PlannedMotion {
    sample::sample_motion(folder).unwrap()
}

#[test]
fn the_folder_of_a_plan_is_whole_and_read_back_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, plan) = (motion(folder.path()), folder.path().join("plan"));
    let written = write_plan_folder(&plan, &motion, &Task::default()).unwrap();
    let names: Vec<&str> = written.iter().filter_map(|path| path.file_name()?.to_str()).collect();
    // The two that tell of grasps are not of a motion alone, and the object has a file.
    let mut expected = PLAN_FILES.to_vec();
    expected.retain(|name| !["plan.json", "miss.png", "planned_object.ply"].contains(name));
    if !cfg!(feature = "mcap") {
        expected.retain(|name| !name.ends_with(".mcap") && !name.ends_with(".yaml"));
    }
    expected.sort_unstable();
    assert_eq!(names, expected);
    let read = read_motion(&plan.join("trajectory.json")).unwrap();
    assert_eq!(read.trajectory, motion.trajectory);
    assert_eq!(read.scene.obstacles, motion.scene.obstacles);
    assert_eq!(read.scene.robot.fingers, motion.scene.robot.fingers);
    assert_eq!(read.scene.frames(), motion.scene.frames());
    for time in [0.0, 1.0, 2.5, 3.5] {
        let [a, b] = [&motion, &read].map(|m| m.scene.poses(&m.state_at(time).unwrap()));
        let off = a.iter().zip(&b).map(|(a, b)| a.translation.distance(b.translation));
        assert!(off.fold(0.0, f64::max) < 1e-12, "at {time}");
    }
    // The same bytes again.
    let bytes = || names.iter().map(|name| std::fs::read(plan.join(name)).unwrap());
    let before: Vec<Vec<u8>> = bytes().collect();
    write_plan_folder(&plan, &motion, &Task::default()).unwrap();
    assert!(bytes().eq(before), "a file differs the second time");
}

#[test]
fn an_object_without_a_file_is_written_beside_the_motion() {
    let folder = tempfile::tempdir().unwrap();
    let (mut motion, plan) = (motion(folder.path()), folder.path().join("plan"));
    motion.notes = vec!["acceleration assumed".into()];
    motion.scene.object.as_mut().unwrap().file = None;
    write_plan_folder(&plan, &motion, &Task::default()).unwrap();
    let read = read_motion(&plan.join("trajectory.json")).unwrap();
    let [a, b] = [&motion, &read].map(|m| m.scene.object.as_ref().unwrap());
    assert_eq!(a.mesh.vertices(), b.mesh.vertices());
    assert_eq!(b.file.as_ref().unwrap().file_name().unwrap(), "planned_object.ply");
    assert_eq!(read.notes, motion.notes);
    let groups = groups_of_paths(&[plan], &Task::default()).unwrap();
    assert_eq!(groups[0].notes, motion.notes);
}

#[test]
fn the_object_stands_until_it_is_lifted_and_then_keeps_its_place_in_the_hand() {
    let folder = tempfile::tempdir().unwrap();
    let motion = motion(folder.path());
    let lift = motion.lift_time().unwrap();
    let in_hand = |time: f64| {
        let state = motion.state_at(time).unwrap();
        motion.scene.base_from_tip(&state.arm, state.opening).inverse() * state.base_from_object
    };
    let at_start = motion.scene.object.as_ref().unwrap().base_from_object;
    for time in [0.0, 1.3, lift] {
        assert_eq!(motion.state_at(time).unwrap().base_from_object, at_start);
    }
    for time in [lift + 0.1, motion.trajectory.duration()] {
        let off = in_hand(time).translation.distance(in_hand(lift).translation);
        assert!(off < 1e-12, "{off}");
        assert!(motion.state_at(time).unwrap().base_from_object != at_start);
    }
}

#[test]
fn a_viewer_that_plays_no_animation_sees_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let motion = motion(folder.path());
    let path = folder.path().join("motion.glb");
    write_animated_glb(&path, &motion).unwrap();
    let mesh = read_mesh(&path).unwrap().mesh;
    let (_, high) = bounds(mesh.vertices()).unwrap();
    // The arm's tip at the start, y up: (x, z, −y).
    let state = motion.state_at(0.0).unwrap();
    let tip = motion.scene.base_from_tip(&state.arm, state.opening) * DVec3::new(0.0, 0.0, 0.1);
    let tip = DVec3::new(tip.x, tip.z, -tip.y);
    let nearest = mesh.vertices().iter().map(|p| p.distance(tip)).fold(f64::INFINITY, f64::min);
    assert!(nearest < 0.06, "{nearest}");
    assert!(high.y > 0.6 && high.y < 0.8, "{high}");
}

#[test]
fn the_page_and_the_picture_of_a_miss_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, plan) = (motion(folder.path()), folder.path().join("plan"));
    write_plan_folder(&plan, &motion, &Task::default()).unwrap();
    for path in [plan.clone(), plan.join("trajectory.json")] {
        let groups = groups_of_paths(&[path], &Task::default()).unwrap();
        assert!(groups.len() == 1 && groups[0].motion.is_some());
        write_page(&folder.path().join("page.html"), "motion", &groups).unwrap();
    }
    let miss = NearMiss {
        title: "in collision".into(),
        state: motion.state_at(1.0).unwrap(),
        pair: Some(["upper".into(), "crate".into()]),
        goal: None,
    };
    let path = folder.path().join("miss.png");
    write_miss_picture(&path, &motion.scene, &miss, &Task::default()).unwrap();
    let picture = image::open(&path).unwrap().into_rgb8();
    let n_red = picture.pixels().filter(|p| p[0] > 120 && p[1] < p[0] / 2 && p[2] < p[0] / 3);
    assert!(n_red.count() > 500, "what collides is not to be seen");
}

#[test]
fn another_robot_or_object_than_the_planned_one_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, plan) = (motion(folder.path()), folder.path().join("plan"));
    write_plan_folder(&plan, &motion, &Task::default()).unwrap();
    let path = plan.join("trajectory.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let place = |spoilt: &str| {
        std::fs::write(&path, spoilt).unwrap();
        read_motion(&path).unwrap_err().place().unwrap_or_default()
    };
    assert_eq!(place(&text.replace("\"base\":\"base\"", "\"base\":\"elsewhere\"")), "robot.base");
    assert_eq!(place(&text.replace("left_finger", "third_finger")), "robot");
    assert_eq!(place(&text.replace("semfm.trajectory/1", "semfm.trajectory/9")), "format");
    assert_eq!(place(&text.replace("\"scale\":0.001", "\"scale\":-1.0")), "object.scale");
    let urdf = folder.path().join("sample.urdf");
    let description = std::fs::read_to_string(&urdf).unwrap();
    std::fs::write(&urdf, description.replace("0.34", "0.35")).unwrap();
    assert_eq!(place(&text), "robot.hash");
    std::fs::write(&urdf, description).unwrap();
    std::fs::write(&path, &text).unwrap();
    assert!(TrajectoryFile::read(&path).is_ok() && read_motion(&path).is_ok());
}
