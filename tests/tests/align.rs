//! A rendered scene with known truth, through the binary: depth image in, metres and pose out.

use std::path::PathBuf;

use image::{GrayImage, ImageBuffer, Luma};
use semfm::align::Sim3;
use semfm::files::read_aligned;
use semfm::geom::io::{read_points, write_mesh};
use semfm::geom::math::{DAffine3, DMat3, DQuat, DVec3};
use semfm::geom::{Intrinsics, Pinhole};
use semfm::views::{RenderSettings, SurfaceColor, render};
use semfm::{Mesh, Task};
use semfm_synth::{Category, ObjectSettings, make_object};
use semfm_tests::shell::{Answer, json as json_file, run, shared};
use serde_json::{Value, json};
use tempfile::TempDir;

const SIZE: (u32, u32) = (320, 240);
/// Units of the depth image to the metre.
const PER_METRE: f64 = 10_000.0;

struct Scene {
    folder: TempDir,
    mesh: Mesh,
    truth: Sim3,
}

impl Scene {
    /// A procedural mug in units of its own, 12 cm tall, before a wall and partly behind a pole.
    fn new() -> Self {
        let settings = ObjectSettings::default();
        let mesh = make_object(Category::Containers, 0, &settings).unwrap().mesh;
        let (centre, radius) = mesh.bounding_sphere();
        let rotation = DQuat::from_scaled_axis(DVec3::new(1.6, 0.9, -0.5));
        let scale = 0.07 / radius;
        let translation = DVec3::new(0.02, -0.01, 0.45) - scale * (rotation * centre);
        let truth = Sim3 { scale, rotation, translation };
        let folder = tempfile::tempdir().unwrap();
        let scene = Self { folder, mesh, truth };
        write_mesh(scene.at("mug.obj"), &scene.mesh).unwrap();
        scene.render();
        scene
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.at(name).to_str().unwrap().to_owned()
    }

    fn render(&self) {
        let metric = self.mesh.vertices().iter().map(|&p| self.truth.apply(p)).collect();
        let metric = Mesh::new(metric, self.mesh.faces().to_vec()).unwrap();
        let camera = Pinhole::with_pixel_centres_at_half(
            Intrinsics {
                width: SIZE.0,
                height: SIZE.1,
                fx: 420.0,
                fy: 420.0,
                cx: 160.0,
                cy: 120.0,
            },
            DAffine3::from_mat3(DMat3::IDENTITY),
        )
        .unwrap();
        let settings = RenderSettings::default();
        let view =
            render(&metric, &SurfaceColor::GREY, &[camera], &settings, &Task::default()).unwrap();
        let (mut depth, mut mask) = (Vec::new(), Vec::new());
        for (pixel, &z) in view[0].depth.iter().enumerate() {
            let pole = (120..128).contains(&(pixel as u32 % SIZE.0));
            let seen = if pole { 0.3 } else { f64::from(z).min(0.8) };
            depth.push((seen * PER_METRE).round() as u16);
            mask.push(if z.is_finite() && !pole { 255u8 } else { 0 });
        }
        let depth: ImageBuffer<Luma<u16>, _> =
            ImageBuffer::from_raw(SIZE.0, SIZE.1, depth).unwrap();
        depth.save(self.at("depth.png")).unwrap();
        GrayImage::from_raw(SIZE.0, SIZE.1, mask).unwrap().save(self.at("mask.png")).unwrap();
        // Our cameras count pixels by their corners, calibration files by their centres.
        self.write(
            "K.json",
            &json!({"K": [420.0, 0, 159.5, 0, 420.0, 119.5, 0, 0, 1],
            "width": SIZE.0, "height": SIZE.1}),
        );
    }

    fn write(&self, name: &str, value: &Value) -> PathBuf {
        std::fs::write(self.at(name), value.to_string()).unwrap();
        self.at(name)
    }

    fn align(&self, more: &[&str]) -> Answer {
        let mut arguments = vec!["align".to_owned(), self.text("mug.obj")];
        arguments.extend(["-o".into(), self.text("aligned.json")]);
        arguments.extend(more.iter().map(|&word| match word.strip_prefix('@') {
            Some(name) => self.text(name),
            None => word.to_owned(),
        }));
        run(&arguments)
    }

    /// Largest distance between true and found places, metres.
    fn error(&self, found: &Sim3) -> f64 {
        let vertices = self.mesh.vertices().iter();
        vertices.map(|&p| self.truth.apply(p).distance(found.apply(p))).fold(0.0, f64::max)
    }
}

const DEPTH: [&str; 8] = [
    "--depth",
    "@depth.png",
    "--depth-scale",
    "10000",
    "--intrinsics",
    "@K.json",
    "--mask",
    "@mask.png",
];

#[test]
fn a_rendered_mug_is_found_in_metres_and_the_chain_to_the_gripper_is_one_multiplication() {
    let scene = Scene::new();
    let answer = scene.align(&DEPTH);
    assert_eq!(answer.code, Some(0), "{answer:?}");
    assert_eq!(answer.out.trim(), scene.text("aligned.json"));
    let found = read_aligned(&scene.at("aligned.json"), Some(&scene.mesh)).unwrap();
    // A tenth of a millimetre is what the depth image counts in.
    let pose = found.camera_from_object;
    assert!(scene.error(&pose) < 5e-4, "{} {answer:?}", scene.error(&pose));
    assert!((pose.scale / scene.truth.scale - 1.0).abs() < 2e-3, "{answer:?}");

    // A grasp at the handle, in metres of the scaled object, lands where the truth has it.
    let place = scene.mesh.vertices()[17];
    let scaled =
        Sim3 { scale: 1.0, rotation: DQuat::from_rotation_z(0.8), translation: pose.scale * place };
    let camera_from_tcp = pose.rigid() * scaled.rigid();
    assert!(camera_from_tcp.translation.distance(scene.truth.apply(place)) < 5e-4);

    let file = json_file(&scene.at("aligned.json"));
    assert_eq!(file["format"], "semfm.aligned/1");
    let rows: [[f64; 4]; 4] = serde_json::from_value(file["camera_from_object"].clone()).unwrap();
    for (told, read) in rows.iter().flatten().zip(pose.to_rows().iter().flatten()) {
        assert!((told - read).abs() < 1e-14, "{told} and {read}");
    }
    for key in ["scale", "scale_std", "residual_m", "verdict", "visibility", "stages_ms", "mesh"] {
        assert!(!file[key].is_null(), "aligned.json lacks {key}");
    }

    // The pose is a guess for the next picture, and --threads changes nothing.
    scene.write("init.json", &file);
    for threads in ["1", "2"] {
        let mut arguments = DEPTH.to_vec();
        arguments.extend(["--init", "@init.json", "--threads", threads, "--quiet"]);
        assert_eq!(scene.align(&arguments).code, Some(0));
        let again = json_file(&scene.at("aligned.json"));
        let rows: [[f64; 4]; 4] =
            serde_json::from_value(again["camera_from_object"].clone()).unwrap();
        assert!(scene.error(&Sim3::from_rows(rows).unwrap()) < 5e-4);
        if threads == "2" {
            let before = json_file(&scene.at("one.json"));
            assert_eq!(again["camera_from_object"], before["camera_from_object"]);
        }
        scene.write("one.json", &again);
    }
}

#[test]
fn a_cloud_tells_as_much_and_a_wrong_scale_is_refused_but_written() {
    let scene = Scene::new();
    let pixels = image::open(scene.at("depth.png")).unwrap().into_luma16();
    let mask = image::open(scene.at("mask.png")).unwrap().into_luma8();
    let points: Vec<DVec3> = pixels
        .enumerate_pixels()
        .filter(|&(x, y, _)| mask.get_pixel(x, y).0[0] > 0)
        .map(|(x, y, z)| {
            let ray =
                DVec3::new((f64::from(x) - 159.5) / 420.0, (f64::from(y) - 119.5) / 420.0, 1.0);
            f64::from(z.0[0]) / PER_METRE * ray
        })
        .collect();
    let mut pcd = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {0}\nHEIGHT 1\n\
         POINTS {0}\nDATA ascii\n",
        points.len()
    );
    points.iter().for_each(|p| pcd += &format!("{} {} {}\n", p.x, p.y, p.z));
    std::fs::write(scene.at("seen.pcd"), pcd).unwrap();
    let told = scene.align(&["--cloud", "@seen.pcd", "--json"]);
    assert_eq!(told.code, Some(0), "{told:?}");
    let value: Value = serde_json::from_str(&told.out).unwrap();
    let rows: [[f64; 4]; 4] = serde_json::from_value(value["camera_from_object"].clone()).unwrap();
    assert!(scene.error(&Sim3::from_rows(rows).unwrap()) < 1e-3, "{told:?}");

    let wrong = format!("{},{}", 2.5 * scene.truth.scale, 4.0 * scene.truth.scale);
    std::fs::remove_file(scene.at("aligned.json")).unwrap();
    let refused = scene.align(&["--cloud", "@seen.pcd", "--scale-range", &wrong]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert_eq!(json_file(&scene.at("aligned.json"))["verdict"], "refuse");
}

#[test]
fn bad_input_is_named_and_nothing_is_written() {
    let scene = Scene::new();
    let put = |name: &str, text: &str| std::fs::write(scene.at(name), text).unwrap();
    put(
        "empty.ply",
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
    );
    put("few.obj", "v 0 0 1\nv 1 0 1\n");
    put("nan.obj", &(0..50).map(|i| format!("v {i} 0 nan\n")).collect::<String>());
    put(
        "short.pcd",
        "# .PCD v0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 9\nHEIGHT 1\nPOINTS 9\nDATA binary\n123",
    );
    put("skew.json", r#"{"K": [420, 3, 159.5, 0, 420, 119.5, 0, 0, 1]}"#);
    put("half.json", r#"{"fx": 420, "fy": 420, "cx": 159.5}"#);
    put("other.json", r#"{"fx": 420, "fy": 420, "cx": 159.5, "cy": 119.5, "width": 640}"#);
    put("shear.json", "[[1,0.5,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]");
    GrayImage::new(8, 8).save(scene.at("small.png")).unwrap();
    GrayImage::new(SIZE.0, SIZE.1).save(scene.at("dark.png")).unwrap();
    ImageBuffer::<Luma<u16>, Vec<u16>>::new(SIZE.0, SIZE.1).save(scene.at("zero.png")).unwrap();
    let camera = ["--intrinsics", "@K.json"];
    let with = |depth: &'static str, more: &[&'static str]| {
        [&["--depth", depth], &camera[..], more].concat()
    };
    let unlike = |camera: &'static str| vec!["--depth", "@depth.png", "--intrinsics", camera];
    for (arguments, words) in [
        (vec!["--cloud", "@empty.ply"], vec!["empty.ply", "point"]),
        (vec!["--cloud", "@few.obj"], vec!["few.obj", "at least 30 points", "2"]),
        (vec!["--cloud", "@nan.obj"], vec!["nan.obj", "at least one point"]),
        (vec!["--cloud", "@short.pcd"], vec!["short.pcd", "9 points"]),
        (vec!["--cloud", "@gone.ply"], vec!["gone.ply"]),
        (vec!["--depth", "@depth.png"], vec!["--intrinsics"]),
        (vec![], vec!["--cloud"]),
        (with("@zero.png", &[]), vec!["zero.png", "depth"]),
        (with("@dark.png", &[]), vec!["dark.png", "16-bit"]),
        (with("@depth.png", &["--mask", "@small.png"]), vec!["small.png", "320 × 240", "8 × 8"]),
        (with("@depth.png", &["--mask", "@dark.png"]), vec!["dark.png", "bright"]),
        (with("@depth.png", &["--depth-scale", "-1"]), vec!["depth scale", "-1"]),
        (with("@depth.png", &["--init", "@shear.json"]), vec!["shear.json", "matrix"]),
        (with("@depth.png", &["--scale-range", "2,1"]), vec!["scale range", "2, 1"]),
        (with("@depth.png", &["--scale-range", "2"]), vec!["--scale-range", "`2`"]),
        (with("@depth.png", &["--starts", "0"]), vec!["starts", "0"]),
        (unlike("@skew.json"), vec!["skew.json", "K"]),
        (unlike("@half.json"), vec!["half.json", "cy"]),
        (unlike("@other.json"), vec!["other.json", "width", "320", "640"]),
    ] {
        let answer = scene.align(&arguments);
        assert_eq!(answer.code, Some(2), "{arguments:?}: {answer:?}");
        for word in words {
            assert!(
                answer.err.contains(word),
                "{arguments:?}: `{word}` is missing in: {}",
                answer.err
            );
        }
        assert!(!answer.err.contains("panicked"), "{arguments:?}: {}", answer.err);
        assert!(!scene.at("aligned.json").exists(), "{arguments:?} wrote something");
    }
}

#[test]
fn real_point_clouds_are_read_whole() {
    let Some(clouds) = shared("data/clouds") else { return };
    for (name, n) in [("krylon.pcd", 4467), ("table_mug.pcd", 104_444)] {
        let cloud = read_points(clouds.join(name)).unwrap();
        assert_eq!(cloud.points.len(), n, "{name}");
        assert!(cloud.points.iter().all(|p| p.is_finite() && p.length() < 10.0), "{name}");
    }
}
