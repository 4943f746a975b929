//! IoU and stage times of every method on objects with known regions.
//!
//! ```text
//! python crates/semfm-fmap/examples/bench_transfer_data.py DATA OUT
//! cargo run --release -p semfm-fmap --example bench_transfer -- OUT [METHOD…]
//! ```
//!
//! Objects named `CATEGORY_…` are paired within their category, in both orders. `semfm` gets the 400
//! area-uniform points, the others the 1200 even ones. Times are medians over all pairs: `basis`
//! and `prepare` are per object and would be cached; `warm` is the rest of a transfer.
#![allow(clippy::print_stdout)] // a program, not the library

use std::collections::BTreeMap;
use std::error::Error;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use npyz::NpyFile;
use semfm_fmap::{Matching, Method, PreparedObject, Region, TransferSettings, metrics};
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, SemanticCloud, Shape, ShapeSettings, Task};

type Outcome<T> = Result<T, Box<dyn Error>>;

struct Object {
    name: String,
    shape: Arc<Shape>,
    even: Arc<SemanticCloud>,
    uniform: Arc<SemanticCloud>,
    grip: Region,
}

fn array<T: npyz::Deserialize>(folder: &Path, name: &str, what: &str) -> Outcome<(Vec<T>, usize)> {
    let file =
        NpyFile::new(BufReader::new(File::open(folder.join(format!("{name}.{what}.npy")))?))?;
    let columns = file.shape().get(1).copied().unwrap_or(1) as usize;
    Ok((file.into_vec()?, columns))
}

fn points(folder: &Path, name: &str, what: &str) -> Outcome<Vec<DVec3>> {
    Ok(array::<f64>(folder, name, what)?.0.chunks(3).map(DVec3::from_slice).collect())
}

fn cloud(folder: &Path, name: &str, tag: &str) -> Outcome<Arc<SemanticCloud>> {
    let points = points(folder, name, &format!("{tag}_points"))?;
    let (features, dim) = array::<f32>(folder, name, &format!("{tag}_features"))?;
    let n = points.len();
    Ok(Arc::new(SemanticCloud::new(points, features, dim, vec![1; n])?))
}

fn load(folder: &Path, name: &str) -> Outcome<(Object, f64)> {
    let faces =
        array::<u32>(folder, name, "faces")?.0.chunks(3).map(|f| [f[0], f[1], f[2]]).collect();
    let mesh = Mesh::new(points(folder, name, "vertices")?, faces)?;
    let grip: Vec<bool> = array::<u8>(folder, name, "grip")?.0.iter().map(|&g| g == 1).collect();
    let start = Instant::now();
    let shape = Arc::new(Shape::new(mesh, &ShapeSettings::default(), &Task::default())?);
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let (even, uniform) = (cloud(folder, name, "even")?, cloud(folder, name, "uniform")?);
    Ok((Object { name: name.into(), shape, even, uniform, grip: Region::from_mask(&grip) }, ms))
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("usage: bench_transfer FOLDER [METHOD…]")?;
    let folder = Path::new(&folder);
    let mut methods = arguments.map(|name| name.parse()).collect::<Result<Vec<Method>, _>>()?;
    if methods.is_empty() {
        methods = Method::ALL.to_vec();
    }
    let mut names: Vec<String> = std::fs::read_dir(folder)?
        .filter_map(|entry| {
            entry.ok()?.file_name().to_str()?.strip_suffix(".vertices.npy").map(String::from)
        })
        .collect();
    names.sort();
    let mut bases = Vec::new();
    let mut categories = BTreeMap::<String, Vec<Object>>::new();
    for name in &names {
        let (object, ms) = load(folder, name)?;
        bases.push(ms);
        let category = name.split('_').next().unwrap_or(name).to_string();
        categories.entry(category).or_default().push(object);
    }
    println!("basis {:.1} ms an object", median(&mut bases));
    let task = Task::default();
    for method in methods {
        let settings = TransferSettings::of(method);
        let mut prepare_ms = Vec::new();
        let mut stages = BTreeMap::<String, Vec<f64>>::new();
        let (mut warm_ms, mut all, mut line) = (Vec::new(), Vec::new(), String::new());
        for (category, objects) in &categories {
            let mut ious = Vec::new();
            let mut ready = Vec::new();
            for object in objects {
                let cloud = if method == Method::Semfm { &object.uniform } else { &object.even };
                let start = Instant::now();
                let prepared =
                    PreparedObject::new(Arc::clone(&object.shape), Arc::clone(cloud), &task)?;
                ready.push(prepared);
                prepare_ms.push(start.elapsed().as_secs_f64() * 1e3);
            }
            for (i, j) in (0..objects.len()).flat_map(|i| (0..objects.len()).map(move |j| (i, j))) {
                if i == j {
                    continue;
                }
                let start = Instant::now();
                let matching = Matching::new(&ready[i], &ready[j], &settings, &task)?;
                let answer = matching.transfer(&objects[i].grip)?;
                warm_ms.push(start.elapsed().as_secs_f64() * 1e3);
                for (stage, ms) in answer.report.stages_ms.iter() {
                    stages.entry(stage.to_owned()).or_default().push(ms);
                }
                let iou = metrics::iou(&answer.region, &objects[j].grip)?;
                if std::env::var_os("PAIRS").is_some() {
                    let (source, target) = (&objects[i].name, &objects[j].name);
                    println!("{method}\t{source}\t{target}\t{iou:.3}\t{:.3}", answer.confidence);
                }
                ious.push(iou);
            }
            line += &format!(" {category} {:.2}", ious.iter().sum::<f64>() / ious.len() as f64);
            all.extend(ious);
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        println!("{method:9} IoU {mean:.3}  {line}");
        let stages: Vec<String> =
            stages.into_iter().map(|(s, mut ms)| format!("{s} {:.1}", median(&mut ms))).collect();
        let (prepare, warm) = (median(&mut prepare_ms), median(&mut warm_ms));
        println!(
            "          ms: prepare {prepare:.1} an object, warm {warm:.1} ({})",
            stages.join(", ")
        );
    }
    Ok(())
}
