//! Grasps through the binary: in a region, in metres, in files for others, and reasons for none.

use std::path::PathBuf;

use semfm::Region;
use semfm::align::Sim3;
use semfm::files::write_region;
use semfm::geom::io::write_mesh;
use semfm::geom::math::{DQuat, DVec3};
use semfm::views::mcap::{POSES_TOPIC, inspect};
use semfm_synth::{Category, ObjectSettings, make_object};
use semfm_tests::shell::{Answer, json as json_file, run};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A procedural mug of 20 cm from corner to corner, with its handle as the region.
struct Mug {
    folder: TempDir,
    scale: String,
}

impl Mug {
    fn new() -> Self {
        let object = make_object(Category::Containers, 0, &ObjectSettings::default()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        write_mesh(folder.path().join("mug.obj"), &object.mesh).unwrap();
        write_region(
            &folder.path().join("grip.json"),
            &Region::from_mask(&object.region),
            &object.mesh,
        )
        .unwrap();
        Self { folder, scale: format!("{}", 0.2 / object.mesh.diagonal()) }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn grasp(&self, output: &str, more: &[&str]) -> Answer {
        let text = |name: &str| self.at(name).to_str().unwrap().to_owned();
        let mut arguments = vec!["grasp".to_owned(), text("mug.obj")];
        arguments.extend(["--region".into(), text("grip.json"), "-o".into(), text(output)]);
        arguments.extend(["--gripper".into(), "franka".into(), "--samples".into(), "300".into()]);
        arguments.extend(more.iter().map(|&word| match word.strip_prefix('@') {
            Some(name) => text(name),
            None => word.to_owned(),
        }));
        run(&arguments)
    }

    fn scaled(&self, output: &str, more: &[&str]) -> Answer {
        self.grasp(output, &[&["--scale", &self.scale], more].concat())
    }
}

/// The rotation and the position of a 4 × 4 matrix.
fn pose(rows: &Value) -> ([DVec3; 3], DVec3) {
    let at = |i: usize, j: usize| rows[i][j].as_f64().unwrap();
    let column = |j: usize| DVec3::new(at(0, j), at(1, j), at(2, j));
    ([column(0), column(1), column(2)], column(3))
}

#[test]
fn a_handle_is_grasped_and_the_file_says_all() {
    let mug = Mug::new();
    let answer = mug.scaled("grasps.json", &["--picture", "@grasps.png"]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let file = json_file(&mug.at("grasps.json"));
    assert_eq!(file["format"], "semfm.grasps/1");
    assert_eq!(file["gripper"]["name"], "franka");
    let grasps = file["grasps"].as_array().unwrap();
    assert!(!grasps.is_empty());
    let scores: Vec<f64> = grasps.iter().map(|g| g["score"].as_f64().unwrap()).collect();
    assert!(scores.iter().all(|&score| score <= scores[0]), "the best comes first: {scores:?}");
    for grasp in grasps {
        let (axes, tcp) = pose(&grasp["object_from_tcp"]);
        assert!((axes[0].cross(axes[1]) - axes[2]).length() < 1e-9);
        let width = grasp["width"].as_f64().unwrap();
        assert!((0.0..=0.08).contains(&width));
        // The contacts lie on both sides of the TCP along the closing axis, about a width apart.
        let contacts: Vec<DVec3> = grasp["contacts"]
            .as_array()
            .unwrap()
            .iter()
            .map(|p| DVec3::from_array([0, 1, 2].map(|i| p[i].as_f64().unwrap())))
            .collect();
        let apart = (contacts[1] - contacts[0]).dot(axes[1]);
        assert!((apart - width).abs() < 3e-3, "{apart} {width}");
        assert!(contacts.iter().all(|c| (*c - tcp).length() < 0.06));
        let parts = file["gripper"]["parts"].as_array().unwrap().len();
        assert_eq!(grasp["hand"]["closed"].as_array().unwrap().len(), parts);
        assert!(grasp["camera_from_tcp"].is_null());
    }
    assert!(mug.at("grasps.png").is_file());
    let threads = mug.scaled("again.json", &["--threads", "1"]);
    assert_eq!(threads.code, Some(0));
    let bytes = |name: &str| std::fs::read(mug.at(name)).unwrap();
    assert_eq!(bytes("grasps.json"), bytes("again.json"), "the same at every thread count");
}

#[test]
fn the_chain_to_the_camera_is_one_multiplication() {
    let mug = Mug::new();
    let scale: f64 = mug.scale.parse().unwrap();
    let camera_from_object = Sim3 {
        scale,
        rotation: DQuat::from_scaled_axis(DVec3::new(1.6, 0.9, -0.5)),
        translation: DVec3::new(0.02, -0.01, 0.6),
    };
    let aligned = json!({
        "format": "semfm.aligned/1", "camera_from_object": camera_from_object.to_rows(), "scale": scale,
    });
    std::fs::write(mug.at("aligned.json"), aligned.to_string()).unwrap();
    let answer = mug.grasp("grasps.json", &["--aligned", "@aligned.json"]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let file = json_file(&mug.at("grasps.json"));
    let rigid = camera_from_object.rigid();
    for grasp in file["grasps"].as_array().unwrap() {
        let ((_, in_object), (_, in_camera)) =
            (pose(&grasp["object_from_tcp"]), pose(&grasp["camera_from_tcp"]));
        assert!((rigid * in_object).distance(in_camera) < 1e-9);
        assert_eq!(grasp["frame"], "camera");
    }
}

#[test]
fn other_programs_get_their_own_files() {
    let mug = Mug::new();
    let ros2 = mug.scaled("grasps.mcap", &["--format", "ros2"]);
    assert_eq!(ros2.code, Some(0), "{ros2:?}");
    let report = inspect(&mug.at("grasps.mcap")).unwrap();
    let topics: Vec<&str> = report.channels.iter().map(|channel| channel.topic.as_str()).collect();
    let numbers = ["/grasps/widths", "/grasps/openings", "/grasps/scores"];
    assert_eq!((report.n_messages, topics.len(), topics.contains(&POSES_TOPIC)), (4, 4, true));
    assert!(numbers.iter().all(|topic| topics.contains(topic)), "{topics:?}");
    let isaac = mug.scaled("grasps.yaml", &["--format", "isaac"]);
    assert_eq!(isaac.code, Some(0), "{isaac:?}");
    let text = std::fs::read_to_string(mug.at("grasps.yaml")).unwrap();
    assert!(text.starts_with("format: isaac_grasp\nformat_version: 1.0\n"), "{text}");
    assert!(text.contains("\"panda_finger_joint1\": 0.") && text.contains("orientation: {w: "));
}

#[test]
fn where_nothing_survives_the_reasons_are_told() {
    let mug = Mug::new();
    let answer = mug.scaled("none.json", &["--width-range", "0,0.001"]);
    assert_eq!(answer.code, Some(1), "{answer:?}");
    assert!(answer.err.contains("nearest miss"), "{}", answer.err);
    let file = json_file(&mug.at("none.json"));
    assert_eq!(file["grasps"], json!([]));
    assert!(file["rejected"]["width"].as_u64() > Some(0), "{}", file["rejected"]);
    assert_eq!(file["nearest_miss"]["unit"], "m");
}

#[test]
fn what_is_missing_is_named() {
    let mug = Mug::new();
    std::fs::write(mug.at("broken.urdf"), "<robot name='x'><link name='a'/>").unwrap();
    for (more, words) in [
        (vec![], vec!["--metres", "--scale", "--aligned"]),
        (vec!["--scale", "-1"], vec!["scale"]),
        (vec!["--scale", "1", "--metres"], vec!["--scale"]),
        (vec!["--metres", "--table", "0,0,0"], vec!["X,Y,Z,NX,NY,NZ"]),
        (vec!["--metres", "--scene", "@no.ply"], vec!["no.ply"]),
        (vec!["--metres", "--friction", "0"], vec!["friction"]),
        (vec!["--metres", "--package", "robot"], vec!["NAME=FOLDER"]),
        (vec!["--aligned", "@no.json"], vec!["no.json"]),
    ] {
        let answer = mug.grasp("never.json", &more);
        assert_eq!(answer.code, Some(2), "{more:?}: {answer:?}");
        for word in words {
            assert!(answer.err.contains(word), "{more:?}: {}", answer.err);
        }
        assert!(!mug.at("never.json").exists());
    }
    let text = |name: &str| mug.at(name).to_str().unwrap().to_owned();
    for (gripper, word) in
        [("barrett".to_owned(), "robotiq-2f85"), (text("broken.urdf"), "broken.urdf")]
    {
        let (mesh, region, out) = (text("mug.obj"), text("grip.json"), text("never.json"));
        let answer = run(&[
            "grasp",
            &mesh,
            "--region",
            &region,
            "-o",
            &out,
            "--metres",
            "--gripper",
            &gripper,
        ]);
        assert_eq!(answer.code, Some(2), "{answer:?}");
        assert!(answer.err.contains(word), "{}", answer.err);
    }
}
