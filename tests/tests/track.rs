//! An object followed through a bag, through the binary.

use std::path::Path;

use semfm::Mesh;
use semfm::align::DepthImage;
use semfm::files::{RegionFile, TRACK_POSE_TOPIC, TRACK_REGION_TOPIC, TrackLine};
use semfm::geom::io::write_mesh;
use semfm::geom::math::{DAffine3, DVec3};
use semfm::geom::zoo::icosphere;
use semfm::geom::{Intrinsics, Pinhole};
use semfm::observe::{Observation, write_bag, write_bop};
use semfm::views::mcap::inspect;
use semfm_tests::shell::{json, run};

/// Half axes of the object, metres.
const AXES: DVec3 = DVec3::new(0.04, 0.06, 0.09);

/// Where its middle is in a frame; `None` while it is away.
fn middle(frame: usize) -> Option<DVec3> {
    let away = (6..9).contains(&frame);
    (!away).then(|| DVec3::new(0.004 * frame as f64, 0.0, 0.5))
}

/// An ellipsoid before a wall, as a depth camera sees it.
fn seen(frame: usize) -> Observation {
    let intrinsics =
        Intrinsics { width: 160, height: 120, fx: 150.0, fy: 150.0, cx: 80.0, cy: 60.0 };
    let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
    let depth = (0..160 * 120).map(|i| {
        let ray = camera.ray_in_camera(f64::from(i % 160) + 0.5, f64::from(i / 160) + 0.5);
        let Some(middle) = middle(frame) else { return 1.0 };
        let (ray, middle) = (ray / AXES, middle / AXES);
        let (a, b, c) = (ray.dot(ray), ray.dot(middle), middle.dot(middle) - 1.0);
        let inside = b * b - a * c;
        (if inside > 0.0 { (b - inside.sqrt()) / a } else { 1.0 }) as f32
    });
    let depth = DepthImage::new(160, 120, depth.collect()).unwrap();
    let mut seen = Observation::new(camera).with_depth(depth).unwrap();
    seen.time_nanos = Some(2_000_000_000 + 33_000_000 * frame as u64);
    seen
}

fn lines(path: &Path) -> Vec<TrackLine> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_bag_becomes_lines_a_bag_and_a_region() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let at = |name: &str| path(name).to_str().unwrap().to_owned();
    let ball = icosphere(4);
    let points = ball.vertices().iter().map(|&p| p * AXES).collect();
    let mesh = Mesh::new(points, ball.faces().to_vec()).unwrap();
    write_mesh(path("mesh.obj"), &mesh).unwrap();
    let frames: Vec<Observation> = (0..12).map(seen).collect();
    write_bag(&path("seen.mcap"), &frames).unwrap();
    let region = RegionFile {
        format: None,
        mesh: None,
        vertices: (0..mesh.n_vertices() as u64)
            .filter(|&v| mesh.vertices()[v as usize].z < -0.06)
            .collect(),
        weights: None,
    };
    std::fs::write(path("region.json"), region.to_json().to_string()).unwrap();
    let (mesh_file, bag, output) = (at("mesh.obj"), at("seen.mcap"), at("track.jsonl"));
    let (region_file, written, refined) = (at("region.json"), at("track.mcap"), at("refined.json"));
    let made = run(&[
        "track",
        &mesh_file,
        &bag,
        "-o",
        &output,
        "--scale",
        "1",
        "--region",
        &region_file,
        "--refined",
        &refined,
        "--mcap",
        &written,
    ]);
    assert_eq!(made.code, Some(0), "{}", made.err);
    assert!(made.err.contains("frame 6: lost") && made.err.contains("12 frames"), "{}", made.err);
    let found = lines(&path("track.jsonl"));
    assert_eq!(found.len(), 12);
    for (frame, line) in found.iter().enumerate() {
        let states: &[&str] = match frame {
            0 => &["new"],
            6..9 => &["lost"],
            // Found again within three frames.
            9..11 => &["lost", "reacquired", "tracking"],
            _ => &["tracking", "reacquired"],
        };
        assert!(states.contains(&line.state.as_str()), "frame {frame}: {}", line.state);
        assert_eq!(line.time_nanos, frames[frame].time_nanos);
        assert_eq!(line.camera_from_object.is_none(), line.state == "lost");
        if let (Some(rows), Some(middle)) = (line.camera_from_object, middle(frame)) {
            let place = DVec3::new(rows[0][3], rows[1][3], rows[2][3]);
            assert!(place.distance(middle) < 0.004, "frame {frame}: {place}");
        }
    }
    assert_eq!(found.iter().filter(|line| line.state == "reacquired").count(), 1);
    let n_poses = found.iter().filter(|line| line.camera_from_object.is_some()).count() as u64;
    let told = found[11].region.as_ref().unwrap();
    assert!(told.confidence > 0.8 && told.observed_share > 0.5, "{told:?}");
    assert!(json(&path("refined.json"))["weights"].as_array().is_some());
    let report = inspect(&path("track.mcap")).unwrap();
    let count = |topic: &str| {
        report.channels.iter().find(|channel| channel.topic == topic).map(|c| c.n_messages)
    };
    assert_eq!((count(TRACK_POSE_TOPIC), count("/track/state")), (Some(n_poses), Some(12)));
    assert_eq!((count("/tf"), count(TRACK_REGION_TOPIC)), (Some(n_poses), Some(1)));
    // To stdout, the same lines.
    let piped = run(&["track", &mesh_file, &bag, "-o", "-", "--scale", "1", "--quiet"]);
    assert_eq!((piped.code, piped.out.lines().count()), (Some(0), 12));
}

#[test]
fn a_frame_without_depth_shows_nothing_and_does_not_end_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let at = |name: &str| path(name).to_str().unwrap().to_owned();
    let ball = icosphere(4);
    let points = ball.vertices().iter().map(|&p| p * AXES).collect();
    write_mesh(path("mesh.obj"), &Mesh::new(points, ball.faces().to_vec()).unwrap()).unwrap();
    let without_depth = |frame: usize| {
        let empty = DepthImage::new(160, 120, vec![0.0; 160 * 120]).unwrap();
        let mut none = Observation::new(*seen(frame).camera()).with_depth(empty).unwrap();
        none.time_nanos = seen(frame).time_nanos;
        none
    };
    // The object goes in frame 6.
    let is_empty = |frame: usize| frame == 2 || frame == 4;
    let frame = |i: usize| if is_empty(i) { without_depth(i) } else { seen(i) };
    let frames: Vec<Observation> = (0..6).map(frame).collect();
    write_bag(&path("seen.mcap"), &frames).unwrap();
    write_bop(&path("scene"), &frames).unwrap();
    for source in ["seen.mcap", "scene"] {
        let output = at("track.jsonl");
        let made = run(&["track", &at("mesh.obj"), &at(source), "-o", &output, "--scale", "1"]);
        assert_eq!(made.code, Some(0), "{source}: {}", made.err);
        assert!(made.err.contains("frame 2: the depth image is empty"), "{}", made.err);
        assert_eq!(made.err.matches("is empty").count(), 1, "{}", made.err);
        let found = lines(&path("track.jsonl"));
        assert_eq!(found.len(), 6);
        let states: Vec<&str> = found.iter().map(|line| line.state.as_str()).collect();
        assert_eq!(states[..5], ["new", "tracking", "lost", "reacquired", "lost"], "{source}");
    }
}

#[test]
fn what_cannot_be_followed_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let at = |name: &str| path(name).to_str().unwrap().to_owned();
    write_mesh(path("mesh.obj"), &icosphere(2)).unwrap();
    let frames: Vec<Observation> = (0..3).map(seen).collect();
    write_bag(&path("seen.mcap"), &frames).unwrap();
    let bytes = std::fs::read(path("seen.mcap")).unwrap();
    std::fs::write(path("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    let color = Observation::new(*frames[0].camera()).with_color(vec![[9; 3]; 160 * 120]).unwrap();
    write_bag(&path("color.mcap"), &[color]).unwrap();
    write_bop(&path("scene"), &frames).unwrap();
    let (mesh, seen_bag, lines) = (at("mesh.obj"), at("seen.mcap"), at("track.jsonl"));
    let scene = at("scene");
    for (arguments, word) in [
        (vec!["track", &mesh, &at("cut.mcap"), "-o", &lines], "cut"),
        (vec!["track", &mesh, &at("color.mcap"), "-o", &lines], "colour alone"),
        (vec!["track", &mesh, &seen_bag, "-o", &lines, "--scale", "-1"], "scale"),
        (vec!["track", &mesh, &seen_bag, "-o", &lines, "--object", "cup"], "cup"),
        (vec!["track", &mesh, &seen_bag, "-o", &lines, "--fixed-frame", "map"], "camera → world"),
        (vec!["track", &mesh, &seen_bag, "-o", &seen_bag], "seen.mcap"),
        (vec!["track", &mesh, &seen_bag, "-o", &lines, "--mcap", &lines], "own"),
        (vec!["track", &mesh, &seen_bag, "-o", &lines, "--camera-frame", "eye"], "--mcap"),
        (vec!["track", &mesh, &scene, "-o", &lines, "--fixed-frame", "map"], "BOP scene"),
    ] {
        let refused = run(&arguments);
        assert_eq!(refused.code, Some(2), "{word}");
        assert!(refused.err.contains(word), "{word}: {}", refused.err);
    }
    // A ball of two metres is in no frame.
    let nowhere = run(&["track", &mesh, &seen_bag, "-o", &lines, "--scale", "1"]);
    assert_eq!(nowhere.code, Some(1), "{}", nowhere.err);
    assert!(nowhere.err.contains("3 frames: 3 lost"), "{}", nowhere.err);
}
