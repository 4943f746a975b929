//! Views that once gave a pose with more confidence than they held, through the shell.

use std::path::{Path, PathBuf};

use semfm::geom::io::{PointCloud, read_points};
use semfm::observe::{MaskedPicture, read_mask};
use semfm_tests::shell::{Answer, json, run, shared};
use serde_json::Value;

/// What `align` writes about a mesh in what is observed.
fn aligned(mesh: &Path, observed: &[String], output: &Path) -> (Answer, Value) {
    let mut arguments = vec!["align".to_owned(), text(mesh), "-o".to_owned(), text(output)];
    arguments.extend_from_slice(observed);
    let answer = run(&arguments);
    let written = if output.exists() { json(output) } else { Value::Null };
    (answer, written)
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

/// The depth image and the mask of a view.
fn view(folder: &Path, n: usize) -> Vec<String> {
    let file = |name: String| text(&folder.join(name));
    vec![
        "--depth".into(),
        file(format!("d{n}.png")),
        "--intrinsics".into(),
        file("K.json".into()),
        "--mask".into(),
        file(format!("m{n}.png")),
    ]
}

/// The heading is open: to be checked, with the axis, and a standard deviation near π.
fn assert_open_heading(answer: &Answer, written: &Value, what: &str) {
    assert_eq!(answer.code, Some(0), "{what}: {answer:?}");
    assert_eq!(written["verdict"], "check", "{what}: {written}");
    assert!(written["rotation_std"].as_f64().unwrap() > 2.5, "{what}: {written}");
    assert!(written["undetermined"][0]["axis"].is_array(), "{what}: {written}");
}

#[test]
fn a_mug_whose_handle_is_hidden_has_an_open_heading() {
    let Some(folder) = shared("cases/align_hidden_handle") else { return };
    let out = tempfile::tempdir().unwrap();
    for n in 0..4 {
        let output = out.path().join(format!("{n}.json"));
        let (answer, written) = aligned(&folder.join("mug64.ply"), &view(&folder, n), &output);
        assert_open_heading(&answer, &written, &format!("view {n}"));
    }
}

/// The same points in another order, some of them twice.
fn shuffled(cloud: &PointCloud, step: usize) -> Vec<usize> {
    let n = cloud.points.len();
    let mut order: Vec<usize> = (0..n).map(|i| (i * step) % n).collect();
    order.extend(0..n / 7);
    order
}

#[test]
fn the_order_of_a_cloud_s_points_changes_nothing() {
    let Some(folder) = shared("cases/align_hidden_handle") else { return };
    let out = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { out.path().join(name) };
    let cloud = folder.join("cloud_few_handle_points.ply");
    let points = read_points(&cloud).unwrap();
    let mut poses = Vec::new();
    for step in [1, 7, 1013] {
        let path = at(&format!("{step}.ply"));
        let lines: Vec<String> = shuffled(&points, step)
            .into_iter()
            .map(|i| points.points[i])
            .map(|p| format!("{} {} {}\n", p.x, p.y, p.z))
            .collect();
        let header = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\nend_header\n",
            lines.len()
        );
        std::fs::write(&path, header + &lines.concat()).unwrap();
        let observed = ["--cloud".to_owned(), text(&path)];
        let (answer, written) =
            aligned(&folder.join("mug64.ply"), &observed, &at(&format!("{step}.json")));
        assert_eq!(answer.code, Some(0), "{answer:?}");
        poses.push((written["verdict"].clone(), written["camera_from_object"].clone()));
    }
    assert!(poses.iter().all(|pose| *pose == poses[0]), "{poses:?}");
}

#[test]
fn a_vessel_of_thin_walls_keeps_its_size() {
    let Some(folder) = shared("cases/align_thin_vessel") else { return };
    let out = tempfile::tempdir().unwrap();
    let observed =
        ["--cloud".to_owned(), text(&folder.join("wall2_cloud.ply")), "--many-views".to_owned()];
    let output = out.path().join("aligned.json");
    let (answer, written) = aligned(&folder.join("wall2.ply"), &observed, &output);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    let scale = written["scale"].as_f64().unwrap();
    assert!((scale - 1.0).abs() < 0.002, "{scale}");
}

#[test]
fn a_mask_is_its_alpha_and_marks_something() {
    let Some(masks) = shared("cases/masks") else { return };
    let Some(mugs) = shared("cases/align_hidden_handle") else { return };
    let out = tempfile::tempdir().unwrap();
    let size = image::open(mugs.join("d0.png")).unwrap();
    let (width, height) = (size.width(), size.height());
    for (name, alpha) in [("nothing.png", 0u8), ("everything.png", 255)] {
        let mask = out.path().join(name);
        let bright = if alpha == 0 { 0 } else { 255 };
        image::GrayImage::from_pixel(width, height, image::Luma([bright])).save(&mask).unwrap();
        let mut observed = view(&mugs, 0);
        observed[5] = text(&mask);
        let output = out.path().join("never.json");
        let (answer, written) = aligned(&mugs.join("mug64.ply"), &observed, &output);
        assert_eq!((answer.code, written), (Some(2), Value::Null), "{name}: {answer:?}");
        assert!(answer.err.contains(name), "{answer:?}");
    }
    let path = masks.join("mask_rgba.png");
    let (width, height) = image::image_dimensions(&path).unwrap();
    let of = MaskedPicture { width, height, name: "the depth image" };
    let mask = read_mask(&path, of).unwrap();
    let marked = mask.iter().filter(|&&inside| inside).count();
    assert!(marked > 0 && marked < mask.len(), "{marked} of {}", mask.len());
}
