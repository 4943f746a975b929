//! Contact of a hand that is off: the region found, against the true one. A hand of capsules closes its fingers around an
//! object of `shared/data/objects` until each of them touches; it is then moved by an error, and, in some rows, seen by a
//! depth camera with noise. Writes one line of JSON for each row.
//!
//! `cargo run --release -p semfm-observe --example bench_contact [FOLDER OF OBJECTS]`

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the numbers are what this program is for"
)]

mod capsule_hand;

use std::path::{Path, PathBuf};

use capsule_hand::{GraspedObject, grasp};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_align::DepthImage;
use semfm_geom::io::read_mesh;
use semfm_geom::math::{DAffine3, DMat3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, Task};
use semfm_observe::{ContactSettings, Hand, Observation, find_contact, merge_contacts};
use semfm_views::{RenderSettings, SurfaceColor, render};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Objects and their largest extent in metres, as things of their kind have it.
const OBJECTS: [(&str, f64); 12] = [
    ("1_tools_handles/bm_hammer.obj", 0.30),
    ("1_tools_handles/ycb_hammer.obj", 0.33),
    ("4_water_containers/bm_mug.obj", 0.13),
    ("4_water_containers/bm_teapot.obj", 0.25),
    ("4_water_containers/psb_cup_21.obj", 0.13),
    ("4_water_containers/psb_cup_27.obj", 0.13),
    ("3_cutting_tools/ycb_knife.obj", 0.22),
    ("3_cutting_tools/bm_saw.obj", 0.40),
    ("3_cutting_tools/bm_dagger.obj", 0.30),
    ("5_controllers/", 0.16),
    ("6_scissor_tools/", 0.18),
    ("2_shoes/", 0.28),
];

/// Grasps of each object, each with its own error.
const N_GRASPS: u64 = 2;

fn main() -> Outcome<()> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from).unwrap_or_else(|| {
        let shared =
            std::env::var_os("SEMFM_SHARED").map(PathBuf::from).unwrap_or("../shared".into());
        shared.join("data/objects")
    });
    let mut rows: Vec<(&'static str, Vec<f64>)> = Vec::new();
    for (name, size) in OBJECTS {
        let Some(path) = object(&folder, name) else {
            eprintln!("SKIPPED: no shared object {name}");
            continue;
        };
        let mesh = sized(&read_mesh(&path)?.mesh, size)?;
        for seed in 0..N_GRASPS {
            let Some(scene) = grasp(&mesh, seed)? else { continue };
            let measured = measure(&mesh, &scene, seed)?;
            eprintln!("{name} {seed}: {measured:.2?}");
            for (row, iou) in measured {
                match rows.iter_mut().find(|(name, _)| *name == row) {
                    Some((_, values)) => values.push(iou),
                    None => rows.push((row, vec![iou])),
                }
            }
        }
    }
    for (row, mut values) in rows {
        values.sort_by(f64::total_cmp);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let at = |q: f64| values[((values.len() - 1) as f64 * q) as usize];
        let line = serde_json::json!({
            "row": row, "n": values.len(), "mean": round(mean), "median": round(at(0.5)), "p10": round(at(0.1)),
        });
        println!("{line}");
    }
    Ok(())
}

fn round(x: f64) -> f64 {
    (x * 1000.0).round() / 1000.0
}

/// A file, or the first mesh of a folder.
fn object(folder: &Path, name: &str) -> Option<PathBuf> {
    let path = folder.join(name);
    if !name.ends_with('/') {
        return path.exists().then_some(path);
    }
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&path).ok()?.flatten().map(|e| e.path()).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "obj"));
    files.sort();
    files.into_iter().next()
}

/// The mesh around the origin with its longest side `size`.
fn sized(mesh: &Mesh, size: f64) -> Outcome<Mesh> {
    let (low, high) = mesh.bounds();
    let (middle, scale) = ((low + high) / 2.0, size / (high - low).max_element());
    let vertices = mesh.vertices().iter().map(|p| scale * (*p - middle)).collect();
    Ok(Mesh::new(vertices, mesh.faces().to_vec())?)
}

/// Intersection over union in areas.
fn iou(mesh: &Mesh, a: &[f64], b: &[f64]) -> f64 {
    let areas = mesh.vertex_areas();
    let (mut both, mut either) = (0.0, 0.0);
    for v in 0..areas.len() {
        let (a, b) = (a[v] >= 0.5, b[v] >= 0.5);
        both += if a && b { areas[v] } else { 0.0 };
        either += if a || b { areas[v] } else { 0.0 };
    }
    if either > 0.0 { both / either } else { 0.0 }
}

fn direction(random: &mut ChaCha8Rng) -> DVec3 {
    loop {
        let p = DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
        if p.length() < 1.0 && p.length() > 1e-3 {
            return p.normalize();
        }
    }
}

fn measure(mesh: &Mesh, scene: &GraspedObject, seed: u64) -> Outcome<Vec<(&'static str, f64)>> {
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    let still = ContactSettings { along_ray: 0.0, across_ray: 0.0, ..Default::default() };
    let Ok(truth) = find_contact(mesh, &scene.hand, &still) else { return Ok(Vec::new()) };
    let (eye, camera) = camera(scene, &mut random)?;
    let settings = ContactSettings { viewpoint: Some(eye), ..Default::default() };
    let found = |hand: &Hand, settings: &ContactSettings| {
        find_contact(mesh, hand, settings).map_or(0.0, |c| iou(mesh, &c.weights, &truth.weights))
    };
    let shifted = |by: DVec3| scene.hand.transformed(&DAffine3::from_translation(by));
    let middle = scene.hand.points().iter().sum::<DVec3>() / scene.hand.points().len() as f64;
    let mut rows = Vec::new();
    let any = direction(&mut random);
    let ray = (middle - eye).normalize() * if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
    for (row, by) in [
        ("no error", DVec3::ZERO),
        ("5 mm, any direction", 0.005 * any),
        ("5 mm along the ray", 0.005 * ray),
        ("10 mm along the ray", 0.010 * ray),
    ] {
        rows.push((row, found(&shifted(by), &settings)));
    }
    rows.push(("5 mm, any direction, not moved", found(&shifted(0.005 * any), &still)));
    rows.push(("10 mm along the ray, not moved", found(&shifted(0.010 * ray), &still)));
    // Turned by 5° about its middle, too.
    let turn = DQuat::from_axis_angle(direction(&mut random), 5f64.to_radians());
    let about = DAffine3::from_rotation_translation(turn, middle + 0.005 * any - turn * middle);
    rows.push(("5 mm and 5°", found(&scene.hand.transformed(&about), &settings)));
    // Five frames of one grasp, each with an error of its own.
    let frames: Vec<_> = (0..5)
        .filter_map(|_| {
            find_contact(mesh, &shifted(0.005 * direction(&mut random)), &settings).ok()
        })
        .collect();
    let merged = merge_contacts(&frames).map_or(0.0, |weights| iou(mesh, &weights, &truth.weights));
    rows.push(("5 mm, five frames merged", merged));
    rows.extend(through_the_camera(mesh, scene, &camera, &settings, &truth.weights, &mut random)?);
    Ok(rows)
}

/// A camera at .6 m that looks at the hand, with the eye where the back of the hand is seen.
fn camera(scene: &GraspedObject, random: &mut ChaCha8Rng) -> Outcome<(DVec3, Pinhole)> {
    let towards = (scene.back + 0.5 * direction(random)).normalize();
    let middle = scene.hand.points().iter().sum::<DVec3>() / scene.hand.points().len() as f64;
    let eye = middle + 0.6 * towards;
    let z = -towards;
    let x = z.any_orthonormal_vector();
    let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
    let pose = DAffine3::from_mat3_translation(rotation, -(rotation * eye));
    let intrinsics =
        Intrinsics { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
    Ok((eye, Pinhole::with_pixel_centres_at_half(intrinsics, pose)?))
}

/// What a depth camera sees of hand and object: noise of 0.2 % of the depth, 5 % of the pixels without a return; the hand as a
/// network gives it, 8 cm too far along its rays, brought back by the depth; and from its mask alone.
fn through_the_camera(
    mesh: &Mesh,
    scene: &GraspedObject,
    camera: &Pinhole,
    settings: &ContactSettings,
    truth: &[f64],
    random: &mut ChaCha8Rng,
) -> Outcome<Vec<(&'static str, f64)>> {
    let n = mesh.n_vertices() as u32;
    let faces = scene.hand.faces().iter().map(|face| face.map(|v| v + n));
    let both = Mesh::new(
        mesh.vertices().iter().chain(scene.hand.points()).copied().collect(),
        mesh.faces().iter().copied().chain(faces).collect(),
    )?;
    let plain =
        RenderSettings { occlusion: 0.0, edges: 0.0, supersampling: 1, ..Default::default() };
    let views = render(&both, &SurfaceColor::default(), &[*camera], &plain, &Task::default())?;
    let view = &views[0];
    let n_object = mesh.n_faces() as i32;
    let mask: Vec<bool> = view.triangles.iter().map(|&t| t >= n_object).collect();
    let noisy = view.depth.iter().map(|&z| {
        let noise: f64 = (0..4).map(|_| random.random_range(-1.0..1.0)).sum::<f64>() * 0.87;
        let is_lost = random.random_range(0.0..1.0) < 0.05;
        if z.is_finite() && z > 0.0 && !is_lost { z * (1.0 + 0.002 * noise as f32) } else { 0.0 }
    });
    let depth = DepthImage::new(640, 480, noisy.collect())?;
    let own = camera.posed(DAffine3::IDENTITY)?;
    let seen = Observation::new(own).with_depth(depth)?.with_mask("hand", mask)?;
    let mask = &seen.masks()[0];
    let camera_from_object = camera.camera_from_world();
    let in_object = |hand: &Hand| hand.transformed(&camera_from_object.inverse());
    let find = |hand: &Hand| {
        let found = find_contact(mesh, &in_object(hand), settings);
        found.map_or(0.0, |c| iou(mesh, &c.weights, truth))
    };
    let hand = scene.hand.transformed(&camera_from_object);
    let far = hand.points().iter().map(|p| p * ((p.z + 0.08) / p.z)).collect();
    let far = Hand::new(far, hand.faces().to_vec())?;
    let measured = far.at_measured_depth(&seen, mask, None);
    Ok(vec![
        ("8 cm too far, at its measured depth", measured.map_or(0.0, |(hand, _)| find(&hand))),
        ("its mask and depth alone", Hand::from_mask(&seen, mask).map_or(0.0, |hand| find(&hand))),
    ])
}
