//! The graphics driver against the CPU: the same triangles, depths and colours.
//!
//! Without a driver these tests say that they were skipped; with `SEMFM_DEMAND_GPU=1`, as in CI,
//! they fail.
#![cfg(feature = "gpu")]
#![allow(clippy::print_stderr, clippy::print_stdout, reason = "tests that say what they skipped")]

mod shapes;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use semfm_geom::math::DVec3;
use semfm_geom::{Intrinsics, Mesh, Pinhole, Task};
use semfm_views::{
    Error, GpuRenderer, RenderSettings, Renderer, RendererChoice, RigSettings, SurfaceColor, View,
    render, rig,
};
use shapes::{lumpy_torus, zoo};

/// Drivers snap corners to a 256th of a pixel: that share of the pixels may see a neighbour.
const OTHER_TRIANGLE: f64 = 1e-3;

/// The environment of a machine without drivers.
const NO_DRIVERS: [(&str, &str); 2] = [
    ("VK_DRIVER_FILES", "/nonexistent.json"),
    ("VK_ICD_FILENAMES", "/nonexistent.json"), // loaders of before 2022
];

fn gpu() -> Option<&'static GpuRenderer> {
    static GPU: OnceLock<Result<GpuRenderer, Error>> = OnceLock::new();
    match GPU.get_or_init(GpuRenderer::new) {
        Ok(gpu) => Some(gpu),
        Err(error @ Error::NoGpu { .. }) if std::env::var_os("SEMFM_DEMAND_GPU").is_none() => {
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("a driver was demanded, or does not open: {error}"),
    }
}

fn both(
    gpu: &GpuRenderer,
    mesh: &Mesh,
    paint: &SurfaceColor<'_>,
    cameras: &[Pinhole],
) -> [Vec<View>; 2] {
    let (settings, task) = (RenderSettings::default(), Task::default());
    let by_gpu = gpu.render(mesh, paint, cameras, &settings, &task).unwrap();
    [by_gpu, render(mesh, paint, cameras, &settings, &task).unwrap()]
}

/// Pixels of other triangles, pixels in all; depth and colour are held against each other here.
fn compare(name: &str, [by_gpu, by_cpu]: &[Vec<View>; 2]) -> (usize, usize) {
    assert_eq!(by_gpu.len(), by_cpu.len());
    let (mut different, mut n, mut off_colour) = (0, 0, 0);
    for (a, b) in by_gpu.iter().zip(by_cpu) {
        assert_eq!((a.camera, a.rgb.len()), (b.camera, b.rgb.len()), "{name}");
        n += a.triangles.len();
        let pixels = a.triangles.iter().zip(&b.triangles).zip(a.depth.iter().zip(&b.depth));
        for ((one, other), (depth, exact)) in pixels {
            if one != other {
                different += 1;
            } else if *one >= 0 {
                let error = (depth / exact - 1.0).abs();
                // Grazing triangles: the pixel's place on them is known to the snapping only.
                assert!(error < 2e-2, "{name}: depth {depth}, exactly {exact}");
            } else {
                assert_eq!(*depth, f32::INFINITY, "{name}");
            }
        }
        off_colour += a
            .rgb
            .chunks_exact(3)
            .zip(b.rgb.chunks_exact(3))
            .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 4))
            .count();
    }
    let share = off_colour as f64 / n as f64;
    assert!(share < 0.01, "{name}: {off_colour} of {n} pixels are of another colour");
    (different, n)
}

fn cameras(mesh: &Mesh, count: usize, size: u32) -> Vec<Pinhole> {
    rig(mesh, &RigSettings { count, size, ..Default::default() }).unwrap()
}

#[test]
fn the_zoo_looks_the_same() {
    let Some(gpu) = gpu() else { return };
    let (mut different, mut n) = (0, 0);
    for (name, mesh) in zoo().into_iter().chain(semfm_geom::zoo::all()) {
        // 100 is not a multiple of 64: rows come back padded.
        let views = both(gpu, &mesh, &SurfaceColor::GREY, &cameras(&mesh, 5, 100));
        let counts = compare(name, &views);
        (different, n) = (different + counts.0, n + counts.1);
    }
    let share = different as f64 / n as f64;
    assert!(share <= OTHER_TRIANGLE, "{different} of {n} pixels see another triangle");
}

#[test]
fn every_paint_looks_the_same() {
    let Some(gpu) = gpu() else { return };
    let mesh = lumpy_torus(24);
    let shots = cameras(&mesh, 3, 129);
    let places: Vec<[f32; 3]> =
        mesh.vertices().iter().map(|p| (p.normalize() * 0.5 + 0.5).as_vec3().to_array()).collect();
    let stripes = |face: usize, w: [f64; 3]| [w[0] as f32, (face % 2) as f32, w[2] as f32];
    for (name, paint) in [
        ("vertices", SurfaceColor::Vertices(&places)),
        ("function", SurfaceColor::Surface(&stripes)),
        ("normals", SurfaceColor::Normals),
    ] {
        let (different, n) = compare(name, &both(gpu, &mesh, &paint, &shots));
        assert!(different as f64 <= OTHER_TRIANGLE * n as f64, "{name}: {different} of {n}");
    }
}

#[test]
fn views_of_several_sizes_come_back_in_order() {
    let Some(gpu) = gpu() else { return };
    let mesh = lumpy_torus(12);
    let mut mixed = cameras(&mesh, 2, 64);
    mixed.extend(cameras(&mesh, 3, 50));
    mixed.extend(cameras(&mesh, 1, 64));
    let views = both(gpu, &mesh, &SurfaceColor::GREY, &mixed);
    let (different, n) = compare("mixed", &views);
    assert!(different as f64 <= 2.0 * OTHER_TRIANGLE * n as f64);
}

#[test]
fn what_is_behind_the_camera_is_not_drawn() {
    let Some(gpu) = gpu() else { return };
    let mesh = lumpy_torus(16);
    let inside = cameras(&mesh, 1, 96).remove(0);
    // Into the middle of the hole, with triangles on all sides.
    let mut pose = inside.camera_from_world();
    pose.translation = DVec3::ZERO;
    let inside = inside.posed(pose).unwrap();
    let (different, n) = compare("inside", &both(gpu, &mesh, &SurfaceColor::GREY, &[inside]));
    assert!(different as f64 <= 5.0 * OTHER_TRIANGLE * n as f64, "{different} of {n}");
}

#[test]
fn other_settings_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let (mesh, task) = (lumpy_torus(20), Task::default());
    let mut shots = cameras(&mesh, 2, 90);
    // Cut off by the picture's right side.
    let shifted = Intrinsics { cx: shots[1].cx() + 60.0, ..shots[1].intrinsics() };
    let pose = shots[1].camera_from_world();
    shots[1] = Pinhole::with_pixel_centres_at_half(shifted, pose).unwrap();
    let background = [0.5, 0.1, 0.9];
    let mut looks: Vec<RenderSettings> = [1, 3, 4]
        .map(|supersampling| RenderSettings { supersampling, background, ..Default::default() })
        .into();
    looks.push(RenderSettings { occlusion: 1.0, ..Default::default() });
    looks.push(RenderSettings { edges: 0.8, ..Default::default() });
    for settings in looks {
        let by_gpu = gpu.render(&mesh, &SurfaceColor::GREY, &shots, &settings, &task).unwrap();
        let by_cpu = render(&mesh, &SurfaceColor::GREY, &shots, &settings, &task).unwrap();
        assert_eq!(by_gpu[0].rgb[..3], by_cpu[0].rgb[..3], "the background");
        let (different, n) = compare(&settings.to_string(), &[by_gpu, by_cpu]);
        assert!(different as f64 <= 2.0 * OTHER_TRIANGLE * n as f64, "{different} of {n}");
    }
}

#[test]
fn cancelled_work_is_an_error_and_the_next_is_done() {
    let Some(gpu) = gpu() else { return };
    let mesh = lumpy_torus(8);
    let shots = cameras(&mesh, 1, 32);
    let cancelled = Task::default();
    cancelled.cancel();
    let answer =
        gpu.render(&mesh, &SurfaceColor::GREY, &shots, &RenderSettings::default(), &cancelled);
    assert!(matches!(answer, Err(Error::Geom(semfm_geom::Error::Cancelled))), "{answer:?}");
    assert_eq!(both(gpu, &mesh, &SurfaceColor::GREY, &shots)[0].len(), 1);
}

#[test]
fn threads_may_share_a_driver() {
    let Some(gpu) = gpu() else { return };
    let mesh = lumpy_torus(16);
    let shots = cameras(&mesh, 4, 80);
    let draw = || both(gpu, &mesh, &SurfaceColor::GREY, &shots)[0].clone();
    let alone = draw();
    std::thread::scope(|scope| {
        let others: Vec<_> = (0..4).map(|_| scope.spawn(draw)).collect();
        others.into_iter().for_each(|other| assert!(other.join().unwrap() == alone));
    });
}

/// Runs in a process of its own, since drivers are looked for once.
#[test]
fn without_a_driver_the_cpu_draws_unless_a_driver_was_demanded() {
    const CHILD: &str = "SEMFM_TEST_WITHOUT_DRIVERS";
    if std::env::var_os(CHILD).is_some() {
        let refused = Renderer::open(RendererChoice::Gpu).unwrap_err();
        assert!(matches!(refused, Error::NoGpu { .. }), "{refused}");
        let message = refused.to_string();
        assert!(message.starts_with("no graphics adapter: expected a Vulkan"), "{message}");
        let automatic = Renderer::open(RendererChoice::Auto).unwrap();
        assert_eq!(automatic.name(), "CPU");
        // Where there is no graphics processor, no driver is missed.
        assert!(automatic.note().is_none_or(|note| note.contains("no graphics adapter")));
        return;
    }
    let name = "without_a_driver_the_cpu_draws_unless_a_driver_was_demanded";
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args([name, "--exact", "--nocapture"])
        .env(CHILD, "1")
        .envs(NO_DRIVERS)
        .output()
        .unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{out}{err}");
    assert!(out.contains("1 passed"), "{out}");
}

#[test]
fn real_objects_look_the_same() {
    let Some(gpu) = gpu() else { return };
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("SEMFM_SHARED").map_or_else(beside, PathBuf::from);
    let objects = shared.join("data/objects");
    let Ok(categories) = std::fs::read_dir(&objects) else {
        eprintln!("SKIPPED: no shared data at {} (set SEMFM_SHARED)", objects.display());
        return;
    };
    let listed = |folder: std::fs::ReadDir| {
        let mut paths: Vec<PathBuf> =
            folder.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
        paths.sort();
        paths
    };
    let files: Vec<PathBuf> = listed(categories)
        .iter()
        .filter_map(|category| std::fs::read_dir(category).ok())
        .flat_map(|folder| {
            let mut meshes = listed(folder);
            meshes.retain(|path| path.extension().is_some_and(|kind| kind == "obj"));
            meshes.truncate(3);
            meshes
        })
        .collect();
    assert!(files.len() >= 12, "{files:?}");
    let (mut different, mut n) = (0, 0);
    for path in &files {
        let mesh = semfm_geom::io::read_mesh(path).unwrap().mesh;
        let views = both(gpu, &mesh, &SurfaceColor::GREY, &cameras(&mesh, 4, 224));
        let counts = compare(&path.display().to_string(), &views);
        println!("{}: {} of {} pixels", path.display(), counts.0, counts.1);
        (different, n) = (different + counts.0, n + counts.1);
    }
    let share = different as f64 / n as f64;
    assert!(share <= OTHER_TRIANGLE, "{different} of {n} pixels see another triangle");
}
