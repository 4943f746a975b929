//! Times the eigensolver on matrices that another program wrote, so that both solve the same bytes.
//!
//! `bench_eigen MATRIX K REPEATS` reads little-endian `n: i64, nnz: i64`, column pointers (n + 1,
//! i64), row indices (nnz, i64), values (nnz, f64) and masses (n, f64), and prints one line of JSON:
//! medians of wall and process CPU seconds, the worst residual, the peak memory (before and after) and λ_k. The
//! driver is `bench/eigen.py`.

use std::error::Error;
use std::fs;
use std::time::Instant;

use cpu_time::ProcessTime;
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::{Laplacian, Task};

#[allow(clippy::print_stdout)] // The numbers are what this program is for.
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, k, repeats] = arguments.as_slice() else {
        return Err("usage: bench_eigen MATRIX K REPEATS".into());
    };
    let (laplacian, k) = (read_laplacian(path)?, k.parse::<usize>()?);
    let idle = peak_megabytes();
    let mut seconds = Vec::new();
    let mut last = None;
    for _ in 0..repeats.parse::<usize>()?.max(1) {
        drop(last.take());
        let (start, cpu) = (Instant::now(), ProcessTime::now());
        last = Some(eigenbasis(&laplacian, k, &EigenSettings::default(), &Task::default())?);
        seconds.push((cpu.elapsed().as_secs_f64(), start.elapsed().as_secs_f64()));
    }
    seconds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (cpu, wall) = seconds[seconds.len() / 2];
    let basis = last.ok_or("nothing was run")?;
    let residual = basis.residuals.iter().fold(0.0f64, |worst, &r| worst.max(r));
    println!(
        "{{\"cpu\": {cpu:.4}, \"wall\": {wall:.4}, \"residual\": {residual:.3e}, \
         \"orthonormality\": {:.3e}, \"peak_mb\": {:.1}, \"idle_mb\": {idle:.1}, \"last\": {:.12e}}}",
        basis.orthonormality_error(),
        peak_megabytes(),
        basis.values[k - 1]
    );
    Ok(())
}

fn read_laplacian(path: &str) -> Result<Laplacian, Box<dyn Error>> {
    let bytes = fs::read(path)?;
    let mut words = bytes.chunks_exact(8).map(|w| [w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]]);
    let mut index = || words.next().map(|w| i64::from_le_bytes(w) as usize).ok_or("file too short");
    let (n, nnz) = (index()?, index()?);
    let pointers = (0..=n).map(|_| index()).collect::<Result<Vec<_>, _>>()?;
    let rows = (0..nnz).map(|_| index()).collect::<Result<Vec<_>, _>>()?;
    let values: Vec<f64> = words.by_ref().take(nnz).map(f64::from_le_bytes).collect();
    let mass: Vec<f64> = words.take(n).map(f64::from_le_bytes).collect();
    let symbolic = SymbolicSparseColMat::new_checked(n, n, pointers, None, rows);
    Ok(Laplacian { stiffness: SparseColMat::new(symbolic, values), mass })
}

fn peak_megabytes() -> f64 {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |kb| kb / 1024.0)
}
