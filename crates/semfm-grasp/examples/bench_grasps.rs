//! Times the search for grasps on mesh files: candidates and finished grasps per second and core.
//!
//! `bench_grasps [--samples N] [--threads N] [--small METRES] [--gripper NAME|URDF] MESH…` reads meshes in metres and
//! prints one row for each: the whole surface as the region, and where `--small` is given also a
//! patch of that radius around the vertex farthest from the centre of mass. Without `--gripper` it is three boxes.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use cpu_time::ProcessTime;
use semfm_geom::Task;
use semfm_geom::io::read_mesh;
use semfm_geom::math::DVec3;
use semfm_grasp::{
    BoxGripper, GraspObject, GraspSettings, GripperGeometry, Scene, find_grasps_with,
};
use semfm_robot::Gripper;

#[allow(clippy::print_stdout)] // The numbers are what this program is for.
fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let mut settings = GraspSettings::default();
    let (mut threads, mut small, mut meshes) = (1, None, Vec::<PathBuf>::new());
    let mut gripper = GripperGeometry::from_boxes(&BoxGripper::default())?;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or("an option lacks its value");
        match argument.as_str() {
            "--samples" => settings.n_samples = value()?.parse()?,
            "--threads" => threads = value()?.parse()?,
            "--small" => small = Some(value()?.parse::<f64>()?),
            "--gripper" => {
                gripper = GripperGeometry::new(&Gripper::open(&value()?, &Default::default())?)?;
            }
            mesh => meshes.push(mesh.into()),
        }
    }
    if meshes.is_empty() {
        return Err("usage: bench_grasps [--samples N] [--threads N] [--small METRES] \
                    [--gripper NAME|URDF] MESH…"
            .into());
    }
    println!(
        "object              region prepare_s candidates survivors seconds cand/s/core grasps/s/core returned  refused"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    for path in &meshes {
        pool.install(|| bench(path, &gripper, small, threads, &settings))?;
    }
    Ok(())
}

#[allow(clippy::print_stdout)]
fn bench(
    path: &Path,
    gripper: &GripperGeometry,
    small: Option<f64>,
    threads: usize,
    settings: &GraspSettings,
) -> Result<(), Box<dyn Error + Send + Sync>> {
    let mesh = read_mesh(path)?.mesh;
    let start = Instant::now();
    let object = GraspObject::from_mesh(&mesh, 1.0)?;
    let prepared = start.elapsed().as_secs_f64();
    let mut regions = vec![("whole", vec![1.0; mesh.n_vertices()])];
    if let Some(radius) = small {
        regions.push(("small", far_patch(mesh.vertices(), object.centre_of_mass(), radius)));
    }
    for (name, region) in regions {
        let start = (Instant::now(), ProcessTime::now());
        let found =
            find_grasps_with(&object, &region, gripper, &Scene::new(), settings, &Task::default())?;
        // On one thread its own CPU time counts: a busy machine changes nothing then.
        let seconds = match threads {
            1 => start.1.elapsed().as_secs_f64(),
            _ => start.0.elapsed().as_secs_f64(),
        };
        let rate = |n: usize| n as f64 / seconds / threads as f64;
        let refused: Vec<String> =
            found.rejected.iter().map(|(reason, n)| format!("{}={n}", reason.name())).collect();
        println!(
            "{:<20}{name:<6} {prepared:>8.2} {:>10} {:>9} {seconds:>7.2} {:>11.0} {:>13.0} {:>8}  {}",
            label(path),
            found.n_candidates,
            found.n_survivors,
            rate(found.n_candidates),
            rate(found.n_survivors),
            found.grasps.len(),
            refused.join(" ")
        );
    }
    Ok(())
}

/// Weight 1 within `radius` of the vertex farthest from the centre of mass, 0 elsewhere.
fn far_patch(vertices: &[DVec3], centre: DVec3, radius: f64) -> Vec<f64> {
    let farther = |a: &&DVec3, b: &&DVec3| a.distance(centre).total_cmp(&b.distance(centre));
    let tip = vertices.iter().max_by(farther).copied().unwrap_or_default();
    vertices.iter().map(|p| f64::from(u8::from(p.distance(tip) <= radius))).collect()
}

/// The folder's name for a file called `textured.obj`, otherwise the file's.
fn label(path: &Path) -> String {
    let stem = |p: &Path| p.file_stem().map(|s| s.to_string_lossy().into_owned());
    match stem(path) {
        Some(name) if name != "textured" => name,
        _ => path.parent().and_then(stem).unwrap_or_default(),
    }
}
