//! Times the Laplacians and geodesics of one mesh: CPU seconds of one thread, medians.
//!
//! `bench/laplacian.py` runs this beside the peers on the same arrays:
//! `bench_laplacian <folder with points.npy and faces.npy, f64> <repeats>`; one line per result,
//! `name seconds remark`.
#![allow(clippy::print_stdout)] // a program for the terminal

use std::error::Error;
use std::path::Path;

use cpu_time::ProcessTime;
use semfm_geom::geodesic::HeatGeodesics;
use semfm_geom::laplacian::{
    CloudSettings, LaplacianKind, bridge, laplacian, point_cloud_laplacian,
};
use semfm_geom::{Mesh, math::DVec3};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, repeats] = &arguments[..] else {
        return Err("usage: bench_laplacian <folder> <repeats>".into());
    };
    let repeats: usize = repeats.parse()?;
    let points: Vec<DVec3> =
        array(folder, "points")?.chunks_exact(3).map(DVec3::from_slice).collect();
    let faces = array(folder, "faces")?;
    let faces = faces.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect();
    let mesh = Mesh::new(points, faces)?;

    let tufted = laplacian(&mesh, LaplacianKind::Tufted)?;
    let geodesics = HeatGeodesics::new(&mesh, &Default::default())?;
    let bridged = bridge(&tufted, &mesh, &Default::default())?;
    let joined = format!("{} components, {} bridges", bridged.n_components, bridged.bridges.len());
    let sources: Vec<u32> = (0..16).map(|i| i * (mesh.n_vertices() as u32 - 1) / 15).collect();

    report("tufted", repeats, "", || laplacian(&mesh, LaplacianKind::Tufted).map(drop))?;
    report("cotan", repeats, "", || laplacian(&mesh, LaplacianKind::Cotan).map(drop))?;
    report("cloud", repeats, "", || {
        point_cloud_laplacian(mesh.vertices(), &CloudSettings::default()).map(drop)
    })?;
    report("bridges", repeats, &joined, || bridge(&tufted, &mesh, &Default::default()).map(drop))?;
    report("geodesics_factor", repeats, "", || {
        HeatGeodesics::new(&mesh, &Default::default()).map(drop)
    })?;
    report("geodesics_source", repeats, "", || geodesics.distances(&[0]).map(drop))?;
    report("geodesics_16_sources", repeats, "", || {
        geodesics.distances_from_each(&sources).map(drop)
    })?;
    Ok(())
}

fn array(folder: &str, name: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let bytes = std::fs::read(Path::new(folder).join(format!("{name}.npy")))?;
    Ok(npyz::NpyFile::new(&bytes[..])?.into_vec()?)
}

/// Seconds that one measurement must last: some kernels count CPU time in ticks of 4 ms.
const LONG_ENOUGH: f64 = 0.2;

/// Prints the median over `repeats` of the CPU seconds that one call of `work` takes, each
/// measured over as many calls as are long enough.
fn report(
    name: &str,
    repeats: usize,
    remark: &str,
    mut work: impl FnMut() -> semfm_geom::Result<()>,
) -> Result<(), Box<dyn Error>> {
    let mut seconds = Vec::with_capacity(repeats);
    for _ in 0..repeats {
        let (start, mut calls, mut spent) = (ProcessTime::now(), 0, 0.0);
        while spent < LONG_ENOUGH {
            work()?;
            calls += 1;
            spent = start.elapsed().as_secs_f64();
        }
        seconds.push(spent / f64::from(calls));
    }
    seconds.sort_by(f64::total_cmp);
    println!("{name} {:.6} {remark}", seconds[repeats / 2]);
    Ok(())
}
