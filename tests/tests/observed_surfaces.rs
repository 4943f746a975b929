//! From pictures of a depth camera to an object, and on to a region and grasps, through the binary.

use std::collections::BTreeSet;
use std::path::Path;

use semfm::Mesh;
use semfm::files::read_region;
use semfm::geom::io::{read_mesh, read_points, write_json, write_mesh};
use semfm::geom::math::DVec3;
use semfm::observe::{Observation, write_bop};
use semfm_tests::rgbd::{Frame, container, iou};
use semfm_tests::sample::text;
use semfm_tests::shell::{json, run};
use serde_json::json;

/// The words of `surface` with the files of a folder.
fn surface(folder: &Path, out: &Path, more: &[&str]) -> Vec<String> {
    let at = |name: &str| text(&folder.join(name));
    let mut words: Vec<String> = ["surface", "--color"].map(Into::into).into();
    words.extend([at("c.png"), "--depth".into(), at("d.png"), "--intrinsics".into(), at("K.json")]);
    words.extend(["--mask".into(), at("m.png"), "-o".into(), text(out)]);
    words.extend(more.iter().map(|&word| word.to_owned()));
    words
}

#[test]
fn two_pictures_become_a_region_and_grasps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (mug, kettle) = (container(0), container(1));
    write_mesh(at("mug.obj"), &mug.mesh).unwrap();
    let grip: Vec<usize> = (0..mug.region.len()).filter(|&v| mug.region[v]).collect();
    write_json(at("grip.json"), &json!({ "vertices": grip })).unwrap();
    // From a side on which the kettle's grip is seen.
    let frame = Frame::new(&kettle.mesh, side_of(&kettle.mesh, &kettle.region));
    frame.write(&at("kettle"));
    let made = run(&surface(&at("kettle"), &at("seen"), &["--json"]));
    assert_eq!(made.code, Some(0), "{}", made.err);
    let report = json(&at("seen/surface.json"));
    assert_eq!(
        (&report["format"], &report["views"]),
        (&"semfm.surface/1".into(), &"surface".into())
    );
    assert!(report["n_around"].as_u64().unwrap() > 1000, "the wall: {report}");
    let seen = read_mesh(at("seen/surface.ply")).unwrap();
    assert!(!seen.appearance.is_plain(), "in the picture's colours");
    // Every vertex lies on the object.
    let truth = semfm::geom::SurfaceIndex::new(&frame.mesh).unwrap();
    for &p in seen.mesh.vertices() {
        assert!(truth.closest(p).unwrap().distance < 2e-3, "{p}");
    }
    let (mesh, out) = (text(&at("seen/surface.ply")), text(&at("out")));
    let (source, grip) = (text(&at("mug.obj")), text(&at("grip.json")));
    let embeddings = text(&at("seen/surface.emb.mcap"));
    let around = text(&at("seen/around.ply"));
    let transfer = run(&[
        "transfer",
        &source,
        &mesh,
        "--region",
        &grip,
        "-o",
        &out,
        "--target-embeddings",
        &embeddings,
        "--no-pictures",
        "--no-cache",
        "--gripper",
        "franka",
        "--metres",
        "--scene",
        &around,
        "--unseen",
        "0.05",
    ]);
    assert!(matches!(transfer.code, Some(0 | 1)), "{}", transfer.err);
    let region = read_region(&at("out/region.json"), &seen.mesh).unwrap();
    let truth = frame.region_on(&kettle.region, &seen.mesh);
    let found = iou(&region, &truth);
    assert!(found > 0.4, "{found}");
    assert!(at("out/grasps.json").exists());
    // The same region, marked in the picture.
    let views = format!("{}#000", text(&at("seen/surface.views.mcap")));
    let mask = text(&at("kettle/m.png"));
    let marked =
        run(&["region", &mesh, "-o", &text(&at("all.json")), "--mask", &mask, "--view", &views]);
    assert_eq!(marked.code, Some(0), "{}", marked.err);
    let all = read_region(&at("all.json"), &seen.mesh).unwrap();
    assert!(all.vertices().len() as f64 > 0.95 * seen.mesh.n_vertices() as f64);
}

/// A horizontal direction from which a region stands out to the side.
fn side_of(mesh: &semfm::Mesh, region: &[bool]) -> DVec3 {
    let mean = |inside: bool| {
        let points = mesh.vertices().iter().zip(region).filter(|(_, r)| **r == inside);
        let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(sum, n), (p, _)| (sum + *p, n + 1.0));
        sum / n
    };
    let out = mean(true) - mean(false);
    out.any_orthonormal_vector() + 0.3 * out.normalize()
}

#[test]
fn one_object_with_embeddings_is_matched_by_who_made_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mug = container(0);
    write_mesh(at("mug.obj"), &mug.mesh).unwrap();
    let grip: Vec<usize> = (0..mug.region.len()).filter(|&v| mug.region[v]).collect();
    write_json(at("grip.json"), &json!({ "vertices": grip })).unwrap();
    let (mesh, grip) = (text(&at("mug.obj")), text(&at("grip.json")));
    let embeddings = text(&at("mug.emb.mcap"));
    let made = run(&["embed", &mesh, "-o", &embeddings, "--no-cache"]);
    assert_eq!(made.code, Some(0), "{}", made.err);
    let transfer = |out: &str, more: &[&str]| {
        let out = text(&at(out));
        let mut words =
            vec!["transfer", &mesh, &mesh, "--region", &grip, "-o", &out, "--only", "region"];
        words.extend(more);
        run(&words)
    };
    assert_eq!(transfer("plain", &[]).code, Some(0));
    for (out, option) in [("a", "--source-embeddings"), ("b", "--target-embeddings")] {
        let one = transfer(out, &[option, &embeddings]);
        assert_eq!(one.code, Some(0), "{}", one.err);
        let [found, plain] =
            [out, "plain"].map(|out| json(&at(out).join("region.json"))["vertices"].clone());
        assert_eq!(found, plain);
    }
    let both = ["--source-embeddings", &embeddings, "--target-embeddings", &embeddings];
    let refused = transfer("c", &[&both[..], &["--encoder", "builtin"]].concat());
    assert!(refused.code == Some(2) && refused.err.contains("--encoder"), "{}", refused.err);
}

#[test]
fn frames_of_several_sides_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let kettle = container(1);
    let sides = [[1.0, 0.2, 0.3], [-1.0, -0.3, 0.2], [0.2, 1.0, -0.2], [0.1, -1.0, 0.3]];
    let frames = sides.map(|side| Frame::new(&kettle.mesh, DVec3::from_array(side)));
    let mut seen: Vec<Observation> = frames.iter().map(Frame::observation).collect();
    // The object in its own frame, metres.
    let object_from_camera = frames[0].camera_from_object.inverse();
    let points = frames[0].mesh.vertices().iter();
    let points = points.map(|&p| object_from_camera.transform_point3(p)).collect();
    let truth = Mesh::new(points, kettle.mesh.faces().to_vec()).unwrap();
    // Of one frame nobody knows where in it the object is.
    let without_mask = Observation::new(*seen[0].camera())
        .with_color(seen[0].color().unwrap().to_vec())
        .and_then(|frame| frame.with_depth(seen[0].depth().unwrap().clone()))
        .unwrap();
    seen.insert(1, without_mask.clone());
    write_bop(&at("scene"), &seen).unwrap();
    let merge = |scene: &str, out: &str, more: &[&str]| {
        let (scene, out) = (text(&at(scene)), text(&at(out)));
        let words = ["surface", &scene, "--merge", "-o", &out, "--no-embeddings"];
        run(&[&words[..], more].concat())
    };
    let made = merge("scene", "merged", &[]);
    assert_eq!(made.code, Some(0), "{}", made.err);
    assert!(made.err.contains("frame 1 is left out"), "{}", made.err);
    let report = json(&at("merged/surface.json"));
    assert!(report["pixels"].is_null() && report["cameras"].as_array().unwrap().len() == 4);
    let merged = read_mesh(at("merged/surface.ply")).unwrap().mesh;
    let index = semfm::geom::SurfaceIndex::new(&truth).unwrap();
    let off = merged.vertices().iter().map(|&p| index.closest(p).unwrap().distance);
    let off = off.fold(0.0, f64::max);
    assert!(off < 0.006, "{off}: the wall is no object");
    let ([low, high], [from, to]) = (<[DVec3; 2]>::from(merged.bounds()), truth.bounds().into());
    assert!((high - low - (to - from)).length() < 0.01, "all sides of it");
    let one = merge("scene", "one", &["--most", "1"]);
    assert_eq!(one.code, Some(0), "{}", one.err);
    assert_eq!(json(&at("one/surface.json"))["frame"], "world");
    let one = read_mesh(at("one/surface.ply")).unwrap().mesh;
    let off = one.vertices().iter().map(|&p| index.closest(p).unwrap().distance);
    let off = off.fold(0.0, f64::max);
    assert!(off < 0.006, "{off}: it is in the frame of the poses, too");
    assert!(merged.area() > 1.7 * one.area(), "{} of {}", merged.area(), one.area());
    // No point stands twice around it, though several frames saw it.
    let around = read_points(at("merged/around.ply")).unwrap().points;
    let cubes = around.iter().map(|&p| (p / 0.004).floor().as_i64vec3().to_array());
    assert_eq!(cubes.collect::<BTreeSet<_>>().len(), around.len());
    for (scene, more, word) in [
        ("scene", &["--object", "cup"][..], "cup"),
        ("scene", &["--vertices", "500"], "--vertices"),
        ("scene", &["--fixed-frame", "map"], "BOP scene"),
        ("scene#0", &[], "without a frame's number"),
    ] {
        let refused = merge(scene, "x", more);
        assert_eq!(refused.code, Some(2), "{word}: {}", refused.err);
        assert!(refused.err.contains(word), "{word}: {}", refused.err);
    }
}

#[test]
fn one_frame_of_a_scene_is_a_surface_and_is_aligned() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let kettle = container(1);
    let frame = Frame::new(&kettle.mesh, DVec3::new(1.0, 0.3, 0.4));
    frame.write(&at("kettle"));
    let folder_text = text(&at("scene"));
    let words = |name: &str| text(&at("kettle").join(name));
    let scene = run(&[
        "frames",
        "--color",
        &words("c.png"),
        "--depth",
        &words("d.png"),
        "--intrinsics",
        &words("K.json"),
        "--mask",
        &words("m.png"),
        "-o",
        &folder_text,
    ]);
    assert_eq!(scene.code, Some(0), "{}", scene.err);
    let out = text(&at("seen"));
    let one = run(&["surface", &format!("{folder_text}#0"), "-o", &out, "--no-embeddings"]);
    assert_eq!(one.code, Some(0), "{}", one.err);
    let merged = run(&[
        "surface",
        &folder_text,
        "--merge",
        "-o",
        &text(&at("merged")),
        "--views",
        "pictures",
    ]);
    assert_eq!(merged.code, Some(0), "{}", merged.err);
    let report = json(&at("merged/surface.json"));
    assert!(report["pixels"].is_object(), "one frame needs no merging");
    let missing = run(&["surface", &format!("{folder_text}#3"), "-o", &out]);
    assert!(missing.code == Some(2) && missing.err.contains("#3"), "{}", missing.err);
    // Align reads the same frame.
    write_mesh(at("kettle.obj"), &kettle.mesh).unwrap();
    let aligned = run(&[
        "align",
        &text(&at("kettle.obj")),
        "--frame",
        &folder_text,
        "-o",
        &text(&at("aligned.json")),
        "--starts",
        "60",
    ]);
    assert!(matches!(aligned.code, Some(0 | 1)), "{}", aligned.err);
    let scale = json(&at("aligned.json"))["scale"].as_f64().unwrap();
    assert!((scale / 0.25 - 1.0).abs() < 0.1, "{scale}: {}", aligned.err);
}

#[test]
fn what_is_no_surface_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    Frame::new(&container(0).mesh, DVec3::X).write(&at("mug"));
    let mask = text(&at("mug/m.png"));
    let ids = format!("{mask}#255");
    for (more, word) in [
        (vec!["--mask", &ids], "--object"),
        (vec!["--object", "cup"], "cup"),
        (vec!["--smooth", "99"], "--smooth"),
        (vec!["--vertices", "3"], "--vertices"),
        (vec!["--views", "mesh"], "pictures"),
        (vec!["--merge"], "source"),
        (vec!["--color-topic", "/rgb"], "--color-topic"),
        (vec!["--max-gap", "0.1"], "--max-gap"),
        (vec!["--most", "2"], "--merge"),
    ] {
        let refused = run(&surface(&at("mug"), &at("x"), &more));
        assert_eq!(refused.code, Some(2), "{more:?}");
        assert!(refused.err.to_lowercase().contains(word), "{word}: {}", refused.err);
    }
    assert!(!at("x").exists(), "nothing half written");
    // A closed mesh has no unseen side.
    write_mesh(at("mug.obj"), &container(0).mesh).unwrap();
    write_json(at("r.json"), &json!({ "vertices": [0, 1, 2] })).unwrap();
    let [mesh, region, out] = ["mug.obj", "r.json", "g.json"].map(|name| text(&at(name)));
    let refused = run(&[
        "grasp",
        &mesh,
        "--region",
        &region,
        "--gripper",
        "franka",
        "--scale",
        "0.25",
        "-o",
        &out,
        "--unseen",
        "0.05",
    ]);
    assert!(refused.code == Some(2) && refused.err.contains("closed mesh"), "{}", refused.err);
}
