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
        arguments.extend(["--samples".into(), "300".into()]);
        if !more.contains(&"--gripper") {
            arguments.extend(["--gripper".into(), "franka".into()]);
        }
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
    let numbers = [
        "/grasps/widths",
        "/grasps/openings",
        "/grasps/contact_widths",
        "/grasps/command_widths",
        "/grasps/scores",
    ];
    assert_eq!((report.n_messages, topics.len(), topics.contains(&POSES_TOPIC)), (6, 6, true));
    assert!(numbers.iter().all(|topic| topics.contains(topic)), "{topics:?}");
    let isaac = mug.scaled("grasps.yaml", &["--format", "isaac"]);
    assert_eq!(isaac.code, Some(0), "{isaac:?}");
    let text = std::fs::read_to_string(mug.at("grasps.yaml")).unwrap();
    assert!(text.starts_with("format: isaac_grasp\nformat_version: 1.0\n"), "{text}");
    assert!(text.contains("\"panda_finger_joint1\": 0.") && text.contains("orientation: {w: "));
    assert!(text.contains("gripper_frame: \"panda_link8\""), "{text}");
    let robotiq = mug.scaled("robotiq.yaml", &["--format", "isaac", "--gripper", "robotiq-2f85"]);
    assert_eq!(robotiq.code, Some(0), "{robotiq:?}");
    let text = std::fs::read_to_string(mug.at("robotiq.yaml")).unwrap();
    assert!(text.contains("gripper_frame: \"robotiq_arg2f_base_link\""), "{text}");
    // 0 is open and .8 closed: both positions lie between, the pressing one nearer to closed.
    let positions: Vec<f64> = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("\"finger_joint\": ")?.parse().ok())
        .collect();
    assert!(!positions.is_empty() && positions.len().is_multiple_of(2), "{text}");
    assert!(
        positions.chunks(2).all(|p| p[0] > p[1] && (0.0..0.81).contains(&p[0])),
        "{positions:?}"
    );
}

#[test]
fn the_keys_of_the_file_are_these() {
    let mug = Mug::new();
    let pose = json!({
        "camera_from_object": Sim3 {
            scale: mug.scale.parse().unwrap(),
            rotation: DQuat::from_scaled_axis(DVec3::new(1.6, 0.9, -0.5)),
            translation: DVec3::new(0.02, -0.01, 0.6),
        }.to_rows(),
    });
    std::fs::write(mug.at("aligned.json"), pose.to_string()).unwrap();
    let answer = mug.grasp("grasps.json", &["--aligned", "@aligned.json"]);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let file = json_file(&mug.at("grasps.json"));
    let has = |value: &Value, keys: &[&str]| {
        for key in keys {
            assert!(value.get(key).is_some(), "no `{key}`");
        }
    };
    has(
        &file,
        &["format", "mesh", "object_scale", "camera_from_object", "gripper", "grasps", "rejected"],
    );
    has(&file, &["nearest_miss", "n_candidates", "n_survivors", "object_size", "size_to_opening"]);
    has(&file["nearest_miss"], &["reason", "explanation", "by", "unit", "advice", "options"]);
    let point = |value: &Value| DVec3::from_array([0, 1, 2].map(|i| value[i].as_f64().unwrap()));
    let ([x, y, z], origin) = self::pose(&file["camera_from_object"]);
    for grasp in file["grasps"].as_array().unwrap() {
        has(grasp, &["object_from_tcp", "camera_from_tcp", "flange_from_tcp", "frame", "position"]);
        has(
            grasp,
            &["quaternion_xyzw", "width", "contact_width", "command_width", "opening", "terms"],
        );
        assert_eq!(grasp["contact_frame"], "object");
        let [width, contact, command] =
            ["width", "contact_width", "command_width"].map(|key| grasp[key].as_f64().unwrap());
        assert!(command < contact && command < width && contact < width + 1e-4);
        for i in 0..2 {
            let (p, n) = (point(&grasp["contacts"][i]), point(&grasp["normals"][i]));
            let turned = |v: DVec3| x * v.x + y * v.y + z * v.z;
            assert!((turned(p) + origin).distance(point(&grasp["camera_contacts"][i])) < 1e-9);
            assert!(turned(n).distance(point(&grasp["camera_normals"][i])) < 1e-9);
        }
    }
}

#[test]
fn a_refused_pose_gives_no_grasps_and_an_uncertain_one_keeps_the_hand_away() {
    let mug = Mug::new();
    let write = |verdict: &str, position_std: f64| {
        let pose = Sim3 {
            scale: mug.scale.parse().unwrap(),
            rotation: DQuat::IDENTITY,
            translation: DVec3::new(0.0, 0.0, 0.6),
        };
        let aligned = json!({
            "camera_from_object": pose.to_rows(), "verdict": verdict, "reasons": ["half of it is hidden"],
            "position_std_m": position_std,
        });
        std::fs::write(mug.at("aligned.json"), aligned.to_string()).unwrap();
    };
    write("refuse", 0.0);
    let refused = mug.grasp("never.json", &["--aligned", "@aligned.json"]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(refused.err.contains("half of it is hidden") && refused.err.contains("--use-refused"));
    assert!(!mug.at("never.json").exists());
    let used = mug.grasp("used.json", &["--aligned", "@aligned.json", "--use-refused"]);
    assert_eq!(used.code, Some(0), "{used:?}");
    let room = |name: &str| {
        let file = json_file(&mug.at(name));
        let grasps = file["grasps"].as_array().unwrap().clone();
        let room =
            grasps.iter().map(|g| g["opening"].as_f64().unwrap() - g["width"].as_f64().unwrap());
        room.fold(f64::INFINITY, f64::min)
    };
    write("check", 0.004);
    let warned = mug.grasp("warned.json", &["--aligned", "@aligned.json"]);
    assert_eq!(warned.code, Some(0), "{warned:?}");
    assert!(warned.err.contains("`check`") && warned.err.contains("4.0 mm"), "{}", warned.err);
    assert!(room("warned.json") > 2.0 * 0.0038, "{}", room("warned.json"));
}

#[test]
fn where_nothing_survives_the_reasons_are_told() {
    let mug = Mug::new();
    let answer = mug.scaled("none.json", &["--width-range", "0,0.001"]);
    assert_eq!(answer.code, Some(1), "{answer:?}");
    for words in ["nearest miss", "--width-range", "opening of 80 mm", "shortest side"] {
        assert!(answer.err.contains(words), "no `{words}`: {}", answer.err);
    }
    let file = json_file(&mug.at("none.json"));
    assert_eq!(file["grasps"], json!([]));
    assert!(file["rejected"]["width"].as_u64() > Some(0), "{}", file["rejected"]);
    assert_eq!(file["nearest_miss"]["unit"], "m");
    assert_eq!(file["nearest_miss"]["reason"], "width");
    assert!(file["size_to_opening"].as_f64() > Some(0.0));
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
    std::fs::write(mug.at("three.urdf"), hand_of_three_fingers()).unwrap();
    for (gripper, word) in [
        ("barrett".to_owned(), "robotiq-2f85"),
        ("barrett".to_owned(), "suction cups and hands of three or more fingers are not covered"),
        (text("broken.urdf"), "broken.urdf"),
        (text("three.urdf"), "three.urdf: no gripper found: expected two fingers"),
        (text("three.urdf"), "suction cups and hands of three or more fingers are not covered"),
    ] {
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

/// Three equal fingers around a palm that close on its middle, as URDF.
fn hand_of_three_fingers() -> String {
    let mut urdf = "<robot name='three'><link name='palm'/>".to_owned();
    for i in 0..3 {
        let turn = f64::from(i) * std::f64::consts::TAU / 3.0;
        let (sin, cos) = turn.sin_cos();
        urdf += &format!(
            "<link name='finger_{i}'><collision><geometry><box size='0.02 0.01 0.06'/></geometry></collision></link>
            <joint name='drive_{i}' type='prismatic'><parent link='palm'/><child link='finger_{i}'/>
              <origin xyz='{} {} 0' rpy='0 0 {turn}'/><axis xyz='0 1 0'/>
              <limit lower='0' upper='0.04' effort='1' velocity='1'/></joint>",
            0.05 * sin,
            -0.05 * cos
        );
    }
    urdf + "</robot>"
}
