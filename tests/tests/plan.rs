//! From grasps to a motion through the binary: the hand arrives where the grasp says, and what keeps it from that is told.

use std::path::PathBuf;

use semfm::Region;
use semfm::files::write_region;
use semfm::geom::io::write_mesh;
use semfm::geom::math::{DQuat, DVec3};
use semfm::robot::{Arm, ArmSettings, Pose, RobotDescription};
use semfm_synth::{Category, ObjectSettings, arm_urdf, make_object};
use semfm_tests::shell::{Answer, json, run};
use serde_json::Value;
use tempfile::TempDir;

/// Where the object stands before the arm, metres.
const PLACE: DVec3 = DVec3::new(0.5, 0.0, 0.2);
const START: &str = "0,-0.35,0,1.9,0,1.55,0";

/// A mug, grasps of its handle, and our own arm.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        Self::with_gripper("franka")
    }

    fn with_gripper(gripper: &str) -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        let object = make_object(Category::Containers, 0, &ObjectSettings::default()).unwrap();
        write_mesh(bench.at("mug.obj"), &object.mesh).unwrap();
        let region = Region::from_mask(&object.region);
        write_region(&bench.at("grip.json"), &region, &object.mesh).unwrap();
        std::fs::write(bench.at("arm.urdf"), arm_urdf()).unwrap();
        let scale = (0.2 / object.mesh.diagonal()).to_string();
        let made = bench.run(&[
            "grasp",
            "@mug.obj",
            "--region",
            "@grip.json",
            "--gripper",
            gripper,
            "--samples",
            "300",
            "--scale",
            &scale,
            "-o",
            "@grasps.json",
        ]);
        assert_eq!(made.code, Some(0), "{}", made.err);
        bench
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs the binary; `@NAME` is a file of the folder.
    fn run(&self, words: &[&str]) -> Answer {
        let whole = |word: &&str| match word.strip_prefix('@') {
            Some(name) => self.at(name).to_str().unwrap().to_owned(),
            None => (*word).to_owned(),
        };
        run(&words.iter().map(whole).collect::<Vec<_>>())
    }

    fn plan(&self, place: DVec3, more: &[&str]) -> Answer {
        let place = format!("{},{},{},0,0,0,1", place.x, place.y, place.z);
        let words = [
            "plan",
            "--robot",
            "@arm.urdf",
            "--grasps",
            "@grasps.json",
            "--object",
            "@mug.obj",
            "--base-from-object",
            &place,
            "-o",
            "@plan",
        ];
        self.run(&[&words, more].concat())
    }
}

fn pose(rows: &Value) -> Pose {
    let at = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
    let column = |j: usize| DVec3::new(at(0, j), at(1, j), at(2, j));
    let turn = semfm::geom::math::DMat3::from_cols(column(0), column(1), column(2));
    Pose::from_parts(column(3), DQuat::from_mat3(&turn))
}

#[test]
fn the_hand_arrives_at_the_grasp_and_stays_within_limits() {
    let bench = Bench::new();
    let answer = bench.plan(PLACE, &["--tip", "flange", "--start", START]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    for name in ["trajectory.mcap", "metadata.yaml", "scene.mcap", "motion.glb", "motion.png"] {
        assert!(bench.at("plan").join(name).is_file(), "{name}");
    }

    let motion = json(&bench.at("plan/trajectory.json"));
    let grasps = json(&bench.at("grasps.json"));
    let grasp = &grasps["grasps"][motion["grasp"].as_u64().unwrap() as usize];
    let robot = RobotDescription::read(bench.at("arm.urdf")).unwrap().tree().unwrap();
    let settings = ArmSettings { tip: Some("flange".into()), ..Default::default() };
    let arm = Arm::new(robot.into(), &settings).unwrap();
    let kinds = ["to_pre_grasp", "approach", "close", "lift"];
    let segments = motion["segments"].as_array().unwrap();
    assert_eq!(segments.iter().map(|s| s["kind"].as_str().unwrap()).collect::<Vec<_>>(), kinds);
    for point in segments.iter().flat_map(|segment| segment["points"].as_array().unwrap()) {
        let q: Vec<f64> = serde_json::from_value(point["positions"].clone()).unwrap();
        arm.check_positions("point", &q).unwrap();
    }

    // Where the fingers close, the point between the pads is the grasp's.
    let last = segments[1]["points"].as_array().unwrap().last().unwrap();
    let q: Vec<f64> = serde_json::from_value(last["positions"].clone()).unwrap();
    let found = arm.base_from_tip(&q) * pose(&grasp["flange_from_tcp"]);
    let wanted = Pose::from_translation(PLACE) * pose(&grasp["object_from_tcp"]);
    assert!(found.translation.distance(wanted.translation) < 2e-3, "{found:?} for {wanted:?}");
    // The hand may be turned half way round its approach axis.
    assert!((found.rotation * DVec3::Z).dot(wanted.rotation * DVec3::Z) > 0.9999);
}

#[test]
fn what_cannot_be_reached_is_no_answer_and_says_which_gate() {
    let bench = Bench::new();
    let far = bench.plan(DVec3::new(4.0, 0.0, 0.2), &["--tip", "flange", "--start", START]);
    assert_eq!(far.code, Some(1), "{}", far.err);
    let plan = json(&bench.at("plan/plan.json"));
    assert_eq!(plan["gates"][0]["gate"], "reach");
    assert!(!bench.at("plan/trajectory.json").exists());
}

#[test]
fn a_tip_that_the_hand_cannot_sit_on_is_refused_or_told() {
    let bench = Bench::with_gripper("@arm.urdf");
    for (tip, start, says) in [
        // Joints beyond it would count as the hand's.
        ("link4", "0,-0.35,0,1.9", ["joint5", "`flange`"].as_slice()),
        // The fingers of the description are elsewhere, and another link fits.
        ("link7", START, &["60 mm", "`flange`"]),
    ] {
        let answer = bench.plan(PLACE, &["--tip", tip, "--start", start]);
        assert_eq!(answer.code, Some(2), "{tip}: {}{}", answer.out, answer.err);
        assert!(says.iter().all(|word| answer.err.contains(word)), "{tip}: {}", answer.err);
        assert!(!bench.at("plan").exists());
    }
    // What was assumed stands in the files, too.
    let answer = bench.plan(PLACE, &["--tip", "flange", "--start", START]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    for name in ["plan.json", "trajectory.json"] {
        let notes = json(&bench.at("plan").join(name))["notes"].to_string();
        assert!(notes.contains("acceleration") && notes.contains("left_finger"), "{name}: {notes}");
        assert!(!notes.contains("mounted"), "{name}: {notes}");
    }
    // A gripper that is not the description's own closes elsewhere than its fingers do.
    let bench = Bench::new();
    let answer = bench.plan(PLACE, &["--tip", "flange", "--start", START]);
    assert_eq!(answer.code, Some(0), "{}", answer.err);
    assert!(answer.err.contains("a hand of its own"), "{}", answer.err);
}

#[test]
fn unsound_requests_are_refused_and_leave_nothing() {
    let bench = Bench::new();
    for (more, says) in [
        (vec!["--start", START], "--tip"),
        (vec!["--tip", "flang", "--start", START], "flange"),
        (vec!["--tip", "flange", "--start", "9,0,0,0,0,0,0"], "joint1"),
        (vec!["--tip", "flange", "--start", "nan,0,0,0,0,0,0"], "start"),
        (vec!["--tip", "flange"], "--start"),
    ] {
        let answer = bench.plan(PLACE, &more);
        assert_eq!(answer.code, Some(2), "{more:?}: {}{}", answer.out, answer.err);
        assert!(answer.err.contains(says), "{more:?}: {}", answer.err);
        assert!(!bench.at("plan").exists(), "{more:?}");
    }
    // A link whose mesh is missing would move unchecked.
    let pieces: Vec<String> = arm_urdf().split("<cylinder").map(str::to_owned).collect();
    let after_tag = |piece: &String| piece[piece.find("/>").unwrap() + 2..].to_owned();
    let rest: Vec<String> = pieces[1..].iter().map(after_tag).collect();
    let with_mesh = [&pieces[..1], &rest].concat().join("<mesh filename=\"gone.stl\"/>");
    std::fs::write(bench.at("arm.urdf"), with_mesh).unwrap();
    let answer = bench.plan(PLACE, &["--tip", "flange", "--start", START]);
    assert_eq!(answer.code, Some(2), "{}", answer.err);
    assert!(answer.err.contains("gone.stl") || answer.err.contains("missing"), "{}", answer.err);
}
