//! Times ZoomOut, point maps and precise maps on bases that another program wrote, so that both sides map the same bytes.
//!
//! `bench_maps FOLDER TASK REPEATS`, TASK one of `zoomout START FINAL STEP`, `sampled START FINAL STEP`, `point_map K`,
//! `precise K`, joined by colons (`zoomout:20:100:1`). FOLDER holds `source.functions.npy` (n × k, f64), `source.mass.npy`, `source.vertices.npy`,
//! `source.faces.npy`, the same of `target`, `start.npy` (the first map), `source.samples.npy` and `target.samples.npy`
//! (u32). Prints one line of JSON: medians of process CPU and wall seconds and the peak memory before and after; writes
//! the answer to `answer.npy`. The driver is `bench/maps.py`; threads are those of `RAYON_NUM_THREADS`.
#![allow(clippy::print_stdout)] // The numbers are what this program is for.

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter};
use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use faer::Mat;
use npyz::{NpyFile, WriterBuilder};
use semfm_fmap::FunctionalMap;
use semfm_fmap::zoomout::{MapSide, ZoomOutSettings, zoomout};
use semfm_geom::math::DVec3;
use semfm_geom::{Eigenbasis, Mesh, Task};

type Outcome<T> = Result<T, Box<dyn Error>>;

struct Side {
    basis: Eigenbasis,
    mesh: Mesh,
    samples: Vec<u32>,
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, task, repeats] = arguments.as_slice() else {
        return Err("usage: bench_maps FOLDER TASK REPEATS".into());
    };
    let folder = Path::new(folder);
    let (source, target) = (side(folder, "source")?, side(folder, "target")?);
    let start = FunctionalMap::new(matrix(&folder.join("start.npy"))?);
    let words: Vec<&str> = task.split(':').collect();
    let number =
        |i: usize| -> Outcome<usize> { Ok(words.get(i).ok_or("too few numbers")?.parse()?) };
    let idle = peak_megabytes();
    let mut seconds = Vec::new();
    let mut answer = Mat::zeros(0, 0);
    for _ in 0..repeats.parse::<usize>()?.max(1) {
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        answer = match words[0] {
            "zoomout" | "sampled" => {
                let map = square(&start, number(1)?)?;
                let settings = ZoomOutSettings {
                    k_start: 1,
                    k_final: number(2)?,
                    step: number(3)?,
                    feature_weight: 0.0,
                };
                let is_sampled = words[0] == "sampled";
                let (source, target) = (source.seen(is_sampled), target.seen(is_sampled));
                zoomout(map, &source, &target, &settings, &Task::default())?.matrix().to_owned()
            }
            "point_map" => {
                let map = square(&start, number(1)?)?;
                let points = map.point_map(&source.basis, &target.basis)?.source_of;
                Mat::from_fn(points.len(), 1, |i, _| f64::from(points[i]))
            }
            "precise" => {
                let map = square(&start, number(1)?)?;
                let map = map.precise_map(&source.basis, &source.mesh, &target.basis)?;
                let (faces, weights) = (map.face_of(), map.barycentric());
                Mat::from_fn(map.n_target(), 4, |i, c| match c {
                    0 => f64::from(faces[i]),
                    c => weights[i][c - 1],
                })
            }
            other => return Err(format!("no task `{other}`").into()),
        };
        seconds.push((cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64()));
    }
    seconds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (cpu, wall) = seconds[seconds.len() / 2];
    let peak = peak_megabytes();
    write(&folder.join("answer.npy"), &answer)?;
    println!(
        "{{\"cpu\": {cpu:.5}, \"wall\": {wall:.5}, \"idle_mb\": {idle:.1}, \"peak_mb\": {peak:.1}}}"
    );
    Ok(())
}

impl Side {
    fn seen(&self, is_sampled: bool) -> MapSide<'_> {
        let samples = if is_sampled { self.samples.as_slice() } else { &[] };
        MapSide { samples, ..MapSide::spectral(&self.basis) }
    }
}

/// The leading k × k block of a map.
fn square(map: &FunctionalMap, k: usize) -> Outcome<FunctionalMap> {
    if k > map.k_source() || k > map.k_target() {
        return Err(format!("start.npy is smaller than {k}").into());
    }
    Ok(FunctionalMap::new(map.matrix().submatrix(0, 0, k, k).to_owned()))
}

fn side(folder: &Path, name: &str) -> Outcome<Side> {
    let path = |what: &str| folder.join(format!("{name}.{what}.npy"));
    let functions = matrix(&path("functions"))?;
    let mass = numbers::<f64>(&path("mass"))?;
    let vertices = matrix(&path("vertices"))?;
    let faces = matrix(&path("faces"))?;
    let vertex = |i: usize| DVec3::from_array(std::array::from_fn(|c| vertices[(i, c)]));
    let face = |i: usize| std::array::from_fn(|c| faces[(i, c)] as u32);
    let mesh = Mesh::new(
        (0..vertices.nrows()).map(vertex).collect(),
        (0..faces.nrows()).map(face).collect(),
    )?;
    let k = functions.ncols();
    let basis = Eigenbasis { values: vec![0.0; k], functions, mass, residuals: vec![0.0; k] };
    Ok(Side { basis, mesh, samples: numbers(&path("samples"))? })
}

fn numbers<T: npyz::Deserialize>(path: &Path) -> Outcome<Vec<T>> {
    let file = File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(NpyFile::new(BufReader::new(file))?.into_vec()?)
}

/// A matrix in C order.
fn matrix(path: &Path) -> Outcome<Mat<f64>> {
    let file = File::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let file = NpyFile::new(BufReader::new(file))?;
    let columns = *file.shape().get(1).ok_or("a matrix has two dimensions")? as usize;
    let numbers: Vec<f64> = file.into_vec()?;
    Ok(Mat::from_fn(numbers.len() / columns.max(1), columns, |i, j| numbers[i * columns + j]))
}

fn write(path: &Path, matrix: &Mat<f64>) -> Outcome<()> {
    let shape = [matrix.nrows() as u64, matrix.ncols() as u64];
    let out = BufWriter::new(File::create(path)?);
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(out).begin_nd()?;
    writer.extend(
        (0..matrix.nrows()).flat_map(|i| (0..matrix.ncols()).map(move |j| matrix[(i, j)])),
    )?;
    Ok(writer.finish()?)
}

fn peak_megabytes() -> f64 {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |kb| kb / 1024.0)
}
