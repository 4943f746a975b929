//! Where the time of a whole pair goes, without encoder, reading and writing.
//!
//! ```text
//! semfm-cli demo -o demo
//! cargo run --release -p semfm --example bench_pair -- SOURCE.obj TARGET.obj REGION.json [REPEATS]
//! ```
//!
//! First the goals of speed: process CPU milliseconds on one thread, medians, with their verdicts. *Cold* is
//! lifting, shapes and matching of both objects; *prepared* is the matching of objects that were matched before;
//! a *further region* asks a match that is there; *library* is one demonstration onto one more object that was
//! matched before. Then the stages of a cold pair: wall milliseconds on one thread and on two.
#![allow(clippy::print_stdout, reason = "the numbers are what this program is for")]

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use cpu_time::ProcessTime;
use semfm::encoder::builtin_encoder;
use semfm::files::{read_region, stages_ms};
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::object_encoder::{EncodedPair, ObjectEncoder};
use semfm::{Matching, Method, PipelineSettings, Prepared, Region, Task, transfer};

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// A pair with its embeddings.
struct Pair {
    source: MeshFile,
    target: MeshFile,
    region: Region,
    embeddings: EncodedPair,
}

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (Some([source, target, region]), rest) = (arguments.first_chunk::<3>(), arguments.get(3))
    else {
        return Err("usage: bench_pair SOURCE TARGET REGION.json [REPEATS]".into());
    };
    let repeats = rest.map_or(Ok(9), |text| text.parse())?;
    let pair = read_pair([source, target, region].map(Path::new))?;
    let goals = on_threads(1, || goals(&pair, repeats))??;
    println!("{:28} {:>8} {:>8} verdict", "CPU ms, one thread", "ours", "goal");
    for Measured { name, ms, goal } in goals {
        let verdict = if ms <= goal { "reached" } else { "missed" };
        println!("{name:28} {ms:8.1} {goal:8.0} {verdict}");
    }
    let alone = on_threads(1, || stages(&pair, repeats))??;
    let both = on_threads(2, || stages(&pair, repeats))??;
    println!("\n{:28} {:>8} {:>8} {:>8}", "wall ms of a cold pair", "1 thread", "2", "speed-up");
    for (name, one) in &alone {
        let two = both.get(name).copied().unwrap_or(f64::NAN);
        println!("{name:28} {one:8.1} {two:8.1} {:8.2}", one / two);
    }
    Ok(())
}

fn read_pair([source, target, region]: [&Path; 3]) -> Outcome<Pair> {
    let (source, target) = (read_mesh(source)?, read_mesh(target)?);
    let region = read_region(region, &source.mesh)?;
    let encoder = ObjectEncoder::new(builtin_encoder()?, &ShapeCache::off());
    let embeddings = encoder.embed_pair(&source, &target, &Task::default())?;
    Ok(Pair { source, target, region, embeddings })
}

fn on_threads<T: Send>(n: usize, work: impl FnOnce() -> T + Send) -> Outcome<T> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(n).build()?.install(work))
}

impl Pair {
    /// Both objects, side by side where there are threads.
    fn prepared(&self, settings: &PipelineSettings) -> Outcome<[Prepared; 2]> {
        let task = Task::default();
        let (source, target) = rayon::join(
            || self.embeddings.source.prepare(self.source.mesh.clone(), settings, &task),
            || self.embeddings.target.prepare(self.target.mesh.clone(), settings, &task),
        );
        Ok([source?, target?])
    }
}

/// A time beside what it should be.
struct Measured {
    name: &'static str,
    ms: f64,
    goal: f64,
}

fn goals(pair: &Pair, repeats: usize) -> Outcome<Vec<Measured>> {
    let mut measured = Vec::new();
    for (method, names, goals) in [
        (
            Method::Fused,
            ["fused, cold", "fused, prepared", "fused, a further region"],
            [150.0, 50.0, 10.0],
        ),
        (
            Method::Semfm,
            ["semfm, cold", "semfm, prepared", "semfm, a further region"],
            [100.0, 50.0, 10.0],
        ),
    ] {
        let (settings, task) = (PipelineSettings::of(method), Task::default());
        let mut times = [const { Vec::new() }; 3];
        for _ in 0..repeats {
            let cold = ProcessTime::now();
            let [source, target] = pair.prepared(&settings)?;
            transfer(&source.object, &target.object, &pair.region, &settings.transfer, &task)?;
            times[0].push(cold.elapsed().as_secs_f64() * 1e3);
            let warm = ProcessTime::now();
            let matching =
                Matching::new(&source.object, &target.object, &settings.transfer, &task)?;
            matching.transfer(&pair.region)?;
            times[1].push(warm.elapsed().as_secs_f64() * 1e3);
            let further = ProcessTime::now();
            matching.transfer(&pair.region)?;
            times[2].push(further.elapsed().as_secs_f64() * 1e3);
        }
        for ((name, times), goal) in names.into_iter().zip(times).zip(goals) {
            measured.push(Measured { name, ms: median(times), goal });
        }
    }
    Ok(measured)
}

/// Medians of wall milliseconds by stage.
fn stages(pair: &Pair, repeats: usize) -> Outcome<BTreeMap<String, f64>> {
    let (settings, task) = (PipelineSettings::default(), Task::default());
    let mut times = BTreeMap::<String, Vec<f64>>::new();
    for _ in 0..repeats {
        let start = Instant::now();
        let [source, target] = pair.prepared(&settings)?;
        let prepared = start.elapsed();
        let answer =
            transfer(&source.object, &target.object, &pair.region, &settings.transfer, &task)?;
        let all = start.elapsed();
        let whole =
            [("~ both objects", prepared), ("~ matching", all - prepared), ("~ whole", all)];
        let whole = whole.map(|(name, time)| (name.to_owned(), 1e3 * time.as_secs_f64()));
        let stages = stages_ms(&source, &target, &answer);
        let of_encoder = |name: &str| name.starts_with("views_") || name.starts_with("embed_");
        let stages = stages.iter().filter(|(name, _)| !of_encoder(name));
        let stages = stages.map(|(name, ms)| (name.to_owned(), ms));
        for (name, ms) in stages.chain(whole) {
            times.entry(name).or_default().push(ms);
        }
    }
    Ok(times.into_iter().map(|(name, times)| (name, median(times))).collect())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
