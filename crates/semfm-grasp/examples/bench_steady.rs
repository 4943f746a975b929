//! How far the best grasp moves with the seed, and how many grasps noise and density leave.
//!
//! `bench_steady [--samples N] [--seeds N] [--noise SHARE] [--dense N] [--gripper NAME|URDF] MESH…` reads meshes in
//! metres; the whole surface is the region. Without `--gripper` it is three boxes. Noise is normal, on each coordinate, with a deviation of a share of the diagonal; `--dense N` cuts each
//! triangle into four, N times. One line for each seed, then the greatest distance between the middles of the best
//! grasps' contacts. Times are CPU seconds of one thread.

use std::collections::HashMap;
use std::error::Error;
use std::path::PathBuf;

use cpu_time::ProcessTime;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_geom::io::read_mesh;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};
use semfm_grasp::{
    BoxGripper, GraspObject, GraspSettings, GripperGeometry, Scene, find_grasps_with,
};
use semfm_robot::Gripper;

/// What is varied.
struct Variation {
    n_seeds: u64,
    noise: f64,
    n_cuts: usize,
    settings: GraspSettings,
    gripper: GripperGeometry,
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let settings = GraspSettings::default();
    let gripper = GripperGeometry::from_boxes(&BoxGripper::default())?;
    let mut variation = Variation { n_seeds: 5, noise: 0.0, n_cuts: 0, settings, gripper };
    let mut meshes = Vec::<PathBuf>::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or("an option lacks its value");
        match argument.as_str() {
            "--samples" => variation.settings.n_samples = value()?.parse()?,
            "--seeds" => variation.n_seeds = value()?.parse()?,
            "--noise" => variation.noise = value()?.parse()?,
            "--dense" => variation.n_cuts = value()?.parse()?,
            "--gripper" => {
                let hand = Gripper::open(&value()?, &Default::default())?;
                variation.gripper = GripperGeometry::new(&hand)?;
            }
            mesh => meshes.push(mesh.into()),
        }
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for path in &meshes {
        let mut mesh = read_mesh(path)?.mesh;
        for _ in 0..variation.n_cuts {
            mesh = cut_in_four(&mesh)?;
        }
        let mesh = noisy(&mesh, variation.noise * mesh.diagonal())?;
        pool.install(|| bench(&mesh, &variation))?;
    }
    Ok(())
}

#[allow(clippy::print_stdout)] // The numbers are what this program is for.
fn bench(mesh: &Mesh, variation: &Variation) -> Result<(), Box<dyn Error + Send + Sync>> {
    let start = ProcessTime::now();
    let object = GraspObject::from_mesh(mesh, 1.0)?;
    let prepared = start.elapsed().as_secs_f64();
    let surface = object.surface_report();
    println!(
        "{} triangles, contacts on {}, noise {:.2} mm, {prepared:.2} s to prepare",
        mesh.n_faces(),
        surface.n_triangles,
        1e3 * surface.noise
    );
    let gripper = &variation.gripper;
    let region = vec![1.0; mesh.n_vertices()];
    let mut middles = Vec::new();
    for seed in 0..variation.n_seeds {
        let settings = GraspSettings { seed, ..variation.settings.clone() };
        let start = ProcessTime::now();
        let (scene, task) = (Scene::new(), Task::default());
        let found = find_grasps_with(&object, &region, gripper, &scene, &settings, &task)?;
        let seconds = start.elapsed().as_secs_f64();
        let (n, survivors) = (found.n_candidates, found.n_survivors);
        let best = found.grasps.first().map_or(f64::NAN, |grasp| grasp.score);
        println!(
            "  seed {seed}: {survivors} survivors of {n} candidates, best {best:.3}, {seconds:.2} s"
        );
        middles.extend(found.grasps.first().map(|g| g.contacts[0].midpoint(g.contacts[1])));
    }
    let pairs = middles.iter().flat_map(|a| middles.iter().map(move |b| a.distance(*b)));
    println!("  the best moves by up to {:.1} mm", 1e3 * pairs.fold(0.0, f64::max));
    Ok(())
}

/// Each vertex moved by normal noise (twelve uniform numbers less six have a deviation of 1).
fn noisy(mesh: &Mesh, sigma: f64) -> Result<Mesh, semfm_geom::Error> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let mut shift = || DVec3::new(normal(), normal(), normal());
    let points = mesh.vertices().iter().map(|&p| p + sigma * shift()).collect();
    Mesh::new(points, mesh.faces().to_vec())
}

/// The same surface with four triangles for each.
fn cut_in_four(mesh: &Mesh) -> Result<Mesh, semfm_geom::Error> {
    let mut points = mesh.vertices().to_vec();
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push(points[a as usize].midpoint(points[b as usize]));
            points.len() as u32 - 1
        })
    };
    let mut faces = Vec::with_capacity(4 * mesh.n_faces());
    for &[a, b, c] in mesh.faces() {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Mesh::new(points, faces)
}
