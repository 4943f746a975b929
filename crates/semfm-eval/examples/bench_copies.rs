//! How well a region survives the way onto changed copies of its own object, and how much answers move with noise and
//! with the seed.
//!
//! ```text
//! cargo run --release -p semfm-eval --example bench_copies -- DATA [EVERY [EVERY_PAIR]]
//! ```
//!
//! DATA is a folder as `semfm-cli eval` reads it. Of its labelled objects each EVERY-th (default 1, 0 for none) is copied,
//! and the answer is given with the vote spread everywhere and with the same surface recognised; of its
//! pairs each EVERY_PAIR-th (default 0: none) is transferred onto the target as it is, onto the target with noise of
//! 1 % of its diagonal, and with other seeds. Features are those of the built-in encoder. Objects are halved by the
//! hash of their names.
#![allow(clippy::print_stdout, reason = "the numbers are what this program is for")]

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::error::Error;
use std::path::Path;

use semfm::encoder::builtin_encoder;
use semfm::encoder::rendered_views::Coloring;
use semfm::fmap::metrics::iou;
use semfm::geom::ShapeCache;
use semfm::object_encoder::ObjectEncoder;
use semfm::{Mesh, PipelineSettings, Prepared, Region, Task, Transfer, TransferSettings, transfer};
use semfm_eval::dataset::{Dataset, ObjectEntry, folder};
use semfm_synth::Change;

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Seeds beside seed 0.
const OTHER_SEEDS: [u64; 2] = [1, 2];

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(data) = arguments.first() else {
        return Err("usage: bench_copies DATA [EVERY [EVERY_PAIR]]".into());
    };
    let number = |at: usize, or: usize| arguments.get(at).map_or(Ok(or), |text| text.parse());
    let (every, every_pair) = (number(1, 1)?, number(2, 0)?);
    let dataset = folder::open(Path::new(data))?;
    let cache = ShapeCache::of_user();
    let encoder = ObjectEncoder::new(builtin_encoder()?, &cache);
    let bench = Bench { encoder, cache, task: Task::default() };
    if every > 0 {
        bench.copies(&dataset, every)?;
    }
    if every_pair > 0 {
        bench.pairs(&dataset, every_pair)?;
    }
    Ok(())
}

struct Bench {
    encoder: ObjectEncoder,
    cache: ShapeCache,
    task: Task,
}

/// A sum of numbers and how many they are.
#[derive(Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: usize,
    least: f64,
}

impl Mean {
    fn add(&mut self, x: f64) {
        self.least = if self.count == 0 { x } else { self.least.min(x) };
        self.sum += x;
        self.count += 1;
    }

    fn value(self) -> f64 {
        self.sum / self.count as f64
    }
}

/// Means of both halves of the objects and of all.
#[derive(Clone, Copy, Default)]
struct Halves {
    of: [Mean; 2],
    all: Mean,
}

impl Halves {
    fn add(&mut self, name: &str, x: f64) {
        let half = blake3::hash(name.as_bytes()).as_bytes()[0] % 2;
        self.of[usize::from(half)].add(x);
        self.all.add(x);
    }

    fn print(&self, name: &str) {
        let [a, b] = self.of.map(Mean::value);
        let Self { all, .. } = self;
        println!("{name:34} {a:7.3} {b:7.3} {:7.3} {:7.3} {:5}", all.value(), all.least, all.count);
    }
}

impl Bench {
    fn prepare(&self, mesh: Mesh, seed: u64) -> Outcome<Prepared> {
        let settings =
            PipelineSettings { cache: self.cache.clone(), ..PipelineSettings::default() };
        let encoded = self.encoder.embed(&mesh, Coloring::Grey, &self.task)?;
        Ok(encoded.prepare(mesh, &settings.with_seed(seed), &self.task)?)
    }

    fn answer(&self, pair: [&Prepared; 2], region: &Region, seed: u64) -> Outcome<Transfer> {
        let settings = PipelineSettings::default().with_seed(seed).transfer;
        let [source, target] = pair.map(|prepared| &prepared.object);
        Ok(transfer(source, target, region, &settings, &self.task)?)
    }

    /// Each object onto changed copies of itself.
    fn copies(&self, dataset: &Dataset, every: usize) -> Outcome<()> {
        let mut means = BTreeMap::<usize, Halves>::new();
        for entry in dataset.objects.iter().step_by(every) {
            let object = entry.load()?;
            let truth = object.truth.clone();
            let source = self.prepare(object.mesh().clone(), 0)?;
            let mut row = Vec::new();
            for (i, change) in Change::ALL.into_iter().enumerate() {
                let copy = change.copy(object.mesh(), &truth.mask(), 0)?;
                let target = self.prepare(copy.mesh, 0)?;
                let found = self.answer([&source, &target], &truth, 0)?;
                let reached = iou(&found.region, &Region::from_mask(&copy.region))?;
                let without = TransferSettings { congruence: 0.0, ..TransferSettings::default() };
                let (a, b) = (&source.object, &target.object);
                let before = transfer(a, b, &truth, &without, &self.task)?.region;
                let before = iou(&before, &Region::from_mask(&copy.region))?;
                means.entry(2 * i).or_default().add(&entry.name, before);
                means.entry(2 * i + 1).or_default().add(&entry.name, reached);
                row.push(format!("{before:.3} → {reached:.3} ({:.2})", found.confidence));
            }
            println!("{:34} {}", entry.name, row.join(" "));
        }
        println!(
            "\n{:34} {:>7} {:>7} {:>7} {:>7} {:>5}",
            "IoU on copies", "half 0", "half 1", "all", "least", "n"
        );
        for (i, halves) in means {
            let after = if i % 2 == 0 { "spread" } else { "same surface" };
            halves.print(&format!("{}, {after}", Change::ALL[i / 2].name()));
        }
        Ok(())
    }

    /// Pairs with noise on the target and with other seeds.
    fn pairs(&self, dataset: &Dataset, every: usize) -> Outcome<()> {
        let pairs = dataset.groups.iter().flat_map(|group| &group.pairs).step_by(every);
        let mut kept = BTreeMap::<(usize, bool, u64), Prepared>::new();
        let mut means = BTreeMap::<&str, Halves>::new();
        for pair in pairs {
            let entries = [&dataset.objects[pair.source], &dataset.objects[pair.target]];
            let [source, target] = [entries[0].load()?, entries[1].load()?];
            let (region, truth) = (&source.truth, &target.truth);
            let noisy = Change::Noisy.copy(target.mesh(), &truth.mask(), 0)?.mesh;
            let mut prepared = |entry: &ObjectEntry, place, mesh: &Mesh, is_noisy, seed| {
                let key = (place, is_noisy, seed);
                let made = match kept.entry(key) {
                    Entry::Occupied(made) => made.get().clone(),
                    Entry::Vacant(place) => {
                        let made = self.prepare(mesh.clone(), seed);
                        place.insert(made.map_err(|e| format!("{}: {e}", entry.name))?).clone()
                    }
                };
                Ok::<Prepared, Box<dyn Error + Send + Sync>>(made)
            };
            let mut answers = Vec::new();
            for seed in [0].into_iter().chain(OTHER_SEEDS) {
                let a = prepared(entries[0], pair.source, source.mesh(), false, seed)?;
                let b = prepared(entries[1], pair.target, target.mesh(), false, seed)?;
                answers.push(self.answer([&a, &b], region, seed)?.region);
            }
            let a = prepared(entries[0], pair.source, source.mesh(), false, 0)?;
            let b = prepared(entries[1], pair.target, &noisy, true, 0)?;
            let with_noise = self.answer([&a, &b], region, 0)?.region;
            let before = iou(&answers[0], truth)?;
            let after = iou(&with_noise, truth)?;
            let moved = iou(&answers[0], &with_noise)?;
            let name = &entries[1].name;
            let mut put = |what, x| means.entry(what).or_default().add(name, x);
            put("1 true IoU", before);
            put("2 true IoU, noisy target", after);
            put("3 noisy answer to answer", moved);
            for other in &answers[1..] {
                put("4 seed: |change of IoU|", (iou(other, truth)? - before).abs());
                put("5 seed: answer to answer", iou(&answers[0], other)?);
                put("6 true IoU, other seeds", iou(other, truth)?);
            }
            println!("{:24} {:24} {before:.3} {after:.3} {moved:.3}", entries[0].name, name);
        }
        println!(
            "\n{:34} {:>7} {:>7} {:>7} {:>7} {:>5}",
            "pairs", "half 0", "half 1", "all", "least", "n"
        );
        for (name, halves) in means {
            halves.print(name);
        }
        Ok(())
    }
}
