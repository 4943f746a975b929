//! Frames and hands through the binary.

use std::path::Path;

use image::{GrayImage, ImageBuffer, Luma};
use semfm::Mesh;
use semfm::geom::io::write_mesh;
use semfm::geom::math::DVec3;
use semfm::geom::zoo::icosphere;
use semfm_tests::shell::{json, run, shared};

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

#[test]
fn files_become_a_scene_a_bag_and_a_scene_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    image::RgbImage::from_fn(8, 6, |x, y| image::Rgb([x as u8, y as u8, 9]))
        .save(at("c.png"))
        .unwrap();
    let depth =
        ImageBuffer::from_fn(8, 6, |x, y| Luma([if x == 0 { 65535u16 } else { 500 + y as u16 }]));
    depth.save(at("d.png")).unwrap();
    GrayImage::from_fn(8, 6, |x, _| Luma([if x > 4 { 255 } else { 0 }])).save(at("m.png")).unwrap();
    std::fs::write(at("K.json"), r#"{"fx": 50, "fy": 50, "cx": 3.5, "cy": 2.5}"#).unwrap();
    let made = run(&[
        "frames",
        "--color",
        &at("c.png"),
        "--depth",
        &at("d.png"),
        "--intrinsics",
        &at("K.json"),
        "--mask",
        &at("m.png"),
        "-o",
        &at("scene"),
    ]);
    assert_eq!(made.code, Some(0), "{}", made.err);
    let bag = run(&["frames", &at("scene"), "-o", &at("seen.mcap")]);
    assert_eq!(bag.code, Some(0), "{}", bag.err);
    let again = run(&["frames", &at("seen.mcap"), "-o", &at("again"), "--fixed-frame", "world"]);
    assert_eq!(again.code, Some(0), "{}", again.err);
    assert!(again.err.contains("/camera/depth/image_rect"), "{}", again.err);
    let read = |name: &str| image::open(folder.path().join(name)).unwrap();
    assert_eq!(read("again/depth/000000.png"), read("scene/depth/000000.png"));
    assert_eq!(read("again/rgb/000000.png"), read("c.png"));
    let camera = |name: &str| {
        json(&folder.path().join(name).join("scene_camera.json"))["0"]["cam_K"].clone()
    };
    assert_eq!(camera("again"), camera("scene"));
    for (arguments, word) in [
        (vec!["frames", &at("d.png"), "-o", &at("x")], "MCAP"),
        (vec!["frames", &at("seen.mcap"), "-o", &at("scene")], "empty"),
        (
            vec!["frames", &at("seen.mcap"), "-o", &at("x"), "--fixed-frame", "map"],
            "camera → world",
        ),
        (vec!["frames", "-o", &at("x")], "--color"),
        (vec!["frames", &at("scene"), "-o", &at("x"), "--mask", &at("m.png")], "--mask"),
        (vec!["frames", &at("scene"), "-o", &at("x"), "--depth-scale", "9"], "--depth"),
        (vec!["frames", &at("scene"), "-o", &at("x"), "--max-gap", "1"], "BOP scene"),
        (
            vec![
                "frames",
                "--color",
                &at("c.png"),
                "--intrinsics",
                &at("K.json"),
                "-o",
                &at("x"),
                "--every",
                "2",
            ],
            "--every",
        ),
        (
            vec![
                "frames",
                "--color",
                &at("c.png"),
                "--intrinsics",
                &at("K.json"),
                "-o",
                &at("x"),
                "--fixed-frame",
                "map",
            ],
            "--fixed-frame",
        ),
    ] {
        let refused = run(&arguments);
        assert_eq!(refused.code, Some(2), "{word}");
        assert!(refused.err.contains(word), "{word}: {}", refused.err);
    }
    assert!(!folder.path().join("x").exists(), "nothing half written");
}

#[test]
fn a_hand_marks_what_it_touches_and_says_with_what() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let ball = icosphere(5);
    let sized = |radius: f64, middle: DVec3| {
        let points = ball.vertices().iter().map(|p| middle + radius * *p).collect();
        Mesh::new(points, ball.faces().to_vec()).unwrap()
    };
    write_mesh(at("ball.obj"), &sized(0.05, DVec3::ZERO)).unwrap();
    // OpenGL's axes would be taken for granted if all of the hand were behind the origin: it is beside it.
    write_mesh(at("hand.obj"), &sized(0.03, DVec3::new(0.0815, 0.0, 0.0))).unwrap();
    write_mesh(at("far.obj"), &sized(0.03, DVec3::new(0.3, 0.0, 0.0))).unwrap();
    write_mesh(at("body.obj"), &sized(0.8, DVec3::new(0.3, 0.0, 0.0))).unwrap();
    let marked =
        run(&["region", &at("ball.obj"), "-o", &at("r.json"), "--hand", &at("hand.obj"), "--json"]);
    assert_eq!(marked.code, Some(0), "{}", marked.err);
    let report: serde_json::Value = serde_json::from_str(&marked.out).unwrap();
    assert_eq!(report["format"], "semfm.contact/1");
    assert!(report["frames"][0]["area_mm2"].as_f64().unwrap() > 100.0, "{report}");
    let region = json(Path::new(&at("r.json")));
    let vertices = region["vertices"].as_array().unwrap();
    assert!(!vertices.is_empty());
    for v in vertices {
        assert!(ball.vertices()[v.as_u64().unwrap() as usize].x > 0.6);
    }
    let both = run(&[
        "region",
        &at("ball.obj"),
        "-o",
        &at("r2.json"),
        "--hand",
        &at("hand.obj"),
        "--hand",
        &at("hand.obj"),
    ]);
    assert!(both.code == Some(0) && both.err.contains("hand 2"), "{}", both.err);
    for (hand, more, word) in [
        ("far.obj", vec![], "one frame"),
        ("body.obj", vec![], "whole body"),
        ("hand.obj", vec!["--near", "0,0,0", "--radius", "1"], "cannot be used"),
        ("gone.obj", vec![], "gone.obj"),
    ] {
        let (ball, out, hand) = (at("ball.obj"), at("x.json"), at(hand));
        let mut arguments = vec!["region", &ball, "-o", &out, "--hand", &hand];
        arguments.extend(more);
        let refused = run(&arguments);
        assert_eq!(refused.code, Some(2));
        assert!(refused.err.contains(word), "{word}: {}", refused.err);
    }
}

#[test]
fn a_body_of_sam_3d_is_cut_to_what_its_mask_shows() {
    let Some(folder) = shared("data/hands/sam3d_body") else { return };
    let out = tempfile::tempdir().unwrap();
    let body = text(&folder.join("human.ply"));
    let object = text(&out.path().join("ball.obj"));
    write_mesh(&object, &icosphere(2)).unwrap();
    // A whole body is no hand.
    let path = text(&out.path().join("r.json"));
    let refused = run(&["region", &object, "-o", &path, "--hand", &body]);
    assert!(refused.code == Some(2) && refused.err.contains("--hand-vertices"), "{}", refused.err);
}
