//! How many of the grasps that are there the search finds, against dense sampling.
//!
//! `bench_recall [--samples N] [--spread N] [--near SHARE] [--points N] MESH…` reads meshes in metres. The reference knows
//! nothing of the sampler: points uniform on the surface, grippers that close along the normal or 15°
//! beside it, 24 approaches, 3 depths; each pose is examined like any other, and those that pass are
//! the grasps that are there. One counts as found where a grasp of the search lies within 1 cm and
//! 15°, a gripper and the same gripper with its fingers exchanged being one.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use parry3d_f64::math::{Pose, Rotation};
use semfm_geom::io::read_mesh;
use semfm_geom::math::{DMat3, DQuat, DVec3};
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, SurfaceIndex, Task};
use semfm_grasp::{
    BoxGripper, Grasp, GraspDistance, GraspObject, GraspSettings, GripperGeometry, PoseToExamine,
    Scene, Separation, examine_poses, find_grasps_with,
};

const APPROACHES: usize = 24;
const NEAR: (f64, f64) = (0.01, 15.0);

#[allow(clippy::print_stdout)] // The numbers are what this program is for.
fn main() -> Result<(), Box<dyn Error>> {
    let mut settings = GraspSettings::default();
    let (mut points, mut meshes) = (300, Vec::<PathBuf>::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or("an option lacks its value");
        match argument.as_str() {
            "--samples" => settings.n_samples = value()?.parse()?,
            "--spread" => settings.neighbour_rounds = value()?.parse()?,
            "--near" => {
                settings.separation = Separation {
                    translation: NEAR.0 * value()?.parse::<f64>()?,
                    rotation: settings.separation.rotation,
                };
                settings.separation.rotation *= settings.separation.translation / NEAR.0;
            }
            "--points" => points = value()?.parse()?,
            mesh => meshes.push(mesh.into()),
        }
    }
    println!("object               poses   good survivors recall returned recall");
    for path in &meshes {
        recall(path, points, &settings)?;
    }
    Ok(())
}

#[allow(clippy::print_stdout)]
fn recall(path: &Path, points: usize, settings: &GraspSettings) -> Result<(), Box<dyn Error>> {
    let mesh = read_mesh(path)?.mesh;
    let object = GraspObject::from_mesh(&mesh, 1.0)?;
    let gripper = GripperGeometry::from_boxes(&BoxGripper::default())?;
    let (region, scene) = (vec![1.0; mesh.n_vertices()], Scene::new());
    let poses = dense_poses(&mesh, &gripper, points)?;
    let good: Vec<Grasp> = examine_poses(&object, &region, &gripper, &scene, settings, &poses)?
        .into_iter()
        .filter_map(Result::ok)
        .collect();
    // Merging nothing leaves neighbours without a distance: survivors are those of the samples.
    let merge_nothing = Separation { translation: 0.0, rotation: 0.0 };
    let mut found = Vec::new();
    for separation in [merge_nothing, settings.separation] {
        let neighbour_rounds =
            if separation == merge_nothing { 0 } else { settings.neighbour_rounds };
        let top = usize::MAX;
        let all = GraspSettings { separation, neighbour_rounds, top, ..settings.clone() };
        let task = Task::default();
        found.push(find_grasps_with(&object, &region, &gripper, &scene, &all, &task)?.grasps);
    }
    let [survivors, returned] = [&found[0], &found[1]];
    println!(
        "{:<18} {:>7} {:>6} {:>9} {:>6.3} {:>8} {:>6.3}",
        path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy(),
        poses.len(),
        good.len(),
        survivors.len(),
        share(&good, survivors),
        returned.len(),
        share(&good, returned)
    );
    Ok(())
}

fn share(good: &[Grasp], found: &[Grasp]) -> f64 {
    let hits = good.iter().filter(|good| found.iter().any(|found| are_near(good, found)));
    hits.count() as f64 / good.len().max(1) as f64
}

fn are_near(a: &Grasp, b: &Grasp) -> bool {
    let apart = GraspDistance::between(&a.object_from_tcp, &b.object_from_tcp);
    apart.translation <= NEAR.0 && apart.rotation <= NEAR.1.to_radians()
}

/// Grippers whose pads lie at a surface point and at the next surface behind it.
fn dense_poses(
    mesh: &Mesh,
    gripper: &GripperGeometry,
    points: usize,
) -> Result<Vec<PoseToExamine>, Box<dyn Error>> {
    let surface = SurfaceIndex::new(mesh)?;
    let mut poses = Vec::new();
    for (i, sample) in sample_uniform(mesh, points, 4711)?.iter().enumerate() {
        let beside = sample.normal.any_orthonormal_vector();
        for tilt in [0.0, 15f64.to_radians()] {
            let about = DQuat::from_axis_angle(sample.normal, i as f64);
            let closing = DQuat::from_axis_angle(about * beside, tilt) * -sample.normal;
            let Some(hit) = surface.first_hit(sample.point + 1e-5 * closing, closing) else {
                continue;
            };
            if hit.t > *gripper.opening().end() {
                continue;
            }
            for k in 0..APPROACHES {
                let turn = DQuat::from_axis_angle(closing, TAU * k as f64 / APPROACHES as f64);
                let approach = turn * closing.any_orthonormal_vector();
                let axes = DMat3::from_cols(closing.cross(approach), closing, approach);
                for depth in [-0.006, 0.0, 0.006] {
                    let place: DVec3 = sample.point + closing * (hit.t / 2.0) + approach * depth;
                    let object_from_tcp = Pose::from_parts(place, Rotation::from_mat3(&axes));
                    poses.push(PoseToExamine { object_from_tcp, width: hit.t });
                }
            }
        }
    }
    Ok(poses)
}
