//! Aligns the cases that `bench/align.py` renders: one JSON line each, with the pose and the time.
//!
//! `RAYON_NUM_THREADS=1 cargo run --release -p semfm-align --example bench_align -- CASES.tsv`
//!
//! A line of CASES.tsv: mesh file, cloud file (x, y, z as little-endian f64), sixteen numbers of an
//! initial pose or `-`, separated by tabs.
#![allow(clippy::print_stdout)]

use std::collections::HashMap;
use std::path::Path;

use cpu_time::ProcessTime;
use semfm_align::{AlignModel, AlignSettings, ObservedCloud, Sim3, align_model};
use semfm_geom::io::read_mesh;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    let list = std::env::args().nth(1).ok_or("usage: bench_align CASES.tsv")?;
    let mut meshes: HashMap<String, Mesh> = HashMap::new();
    for line in std::fs::read_to_string(list)?.lines() {
        let [mesh, cloud, init] = line.split('\t').collect::<Vec<_>>()[..] else {
            return Err(format!("expected mesh, cloud and pose, found `{line}`").into());
        };
        if !meshes.contains_key(mesh) {
            meshes.insert(mesh.to_owned(), read_mesh(mesh)?.mesh);
        }
        println!("{}", one(&meshes[mesh], &points(Path::new(cloud))?, init)?);
    }
    Ok(())
}

fn one(mesh: &Mesh, cloud: &[DVec3], init: &str) -> Result<serde_json::Value> {
    let task = Task::default();
    let settings = AlignSettings { init: pose(init)?, ..AlignSettings::default() };
    let (model, model_ms) = timed(|| AlignModel::new(mesh, 0, &task))?;
    let (observed, observe_ms) = timed(|| ObservedCloud::from_view(cloud, DVec3::ZERO))?;
    let (found, solve_ms) = timed(|| align_model(&model, &observed, &settings, &task))?;
    Ok(serde_json::json!({
        "camera_from_object": found.camera_from_object.to_rows(),
        "scale_std": found.scale_std,
        "rotation_std": found.rotation_std,
        "residual_m": found.residual_m,
        "inlier_share": found.inlier_share,
        "visibility": found.visibility,
        "rival": found.rival,
        "verdict": found.verdict,
        "reasons": found.reasons,
        "n_starts": found.n_starts,
        "iterations": found.iterations,
        "stages_ms": found.stages_ms,
        "model_ms": model_ms,
        "observe_ms": observe_ms,
        "solve_ms": solve_ms,
    }))
}

/// The answer and the CPU milliseconds of all threads.
fn timed<T>(work: impl FnOnce() -> semfm_align::Result<T>) -> Result<(T, f64)> {
    let start = ProcessTime::now();
    let answer = work()?;
    Ok((answer, start.elapsed().as_secs_f64() * 1e3))
}

fn points(path: &Path) -> Result<Vec<DVec3>> {
    let bytes = std::fs::read(path)?;
    let numbers: Vec<f64> = bytes
        .chunks_exact(8)
        .map(|eight| Ok(f64::from_le_bytes(eight.try_into()?)))
        .collect::<Result<_>>()?;
    Ok(numbers.chunks_exact(3).map(DVec3::from_slice).collect())
}

fn pose(text: &str) -> Result<Option<Sim3>> {
    if text == "-" {
        return Ok(None);
    }
    let numbers: Vec<f64> =
        text.split_whitespace().map(str::parse).collect::<std::result::Result<_, _>>()?;
    let rows: Vec<[f64; 4]> =
        numbers.chunks_exact(4).filter_map(|row| row.try_into().ok()).collect();
    let rows = rows.try_into().map_err(|_| format!("expected sixteen numbers, found `{text}`"))?;
    Ok(Some(Sim3::from_rows(rows)?))
}
