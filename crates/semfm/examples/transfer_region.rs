//! Two meshes, a feature vector for each vertex, a region: where is that region on the other mesh?
//!
//! Without arguments the program makes two tools of its own, a short thick one and a long thin one,
//! marks the first one's grip and looks for it on the second:
//!
//! `cargo run --release -p semfm --example transfer_region`
//!
//! With your own files (features as text, one row per vertex, as `numpy.savetxt` writes them):
//!
//! `… -- SOURCE.obj SOURCE.txt TARGET.ply TARGET.txt REGION.json FOLDER`
#![allow(clippy::print_stdout, reason = "the answer is what this program is for")]

use std::error::Error;
use std::path::Path;

use semfm::files::{Provenance, TransferResult, read_region, write_transfer};
use semfm::geom::io::read_mesh;
use semfm::geom::zoo::icosphere;
use semfm::{FeatureSource, Mesh, PipelineSettings, Region, Task, Verdict, prepare, transfer};

/// An object as it is given.
struct Object {
    mesh: Mesh,
    /// A feature vector for each vertex (n × d, row-major).
    features: Vec<f32>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        [] => {
            let (source, target) = (tool(1.5, 0.6)?, tool(3.0, 0.3)?);
            let grip = Region::from_mask(&grip_of(&source.mesh));
            run(source, target, &grip, None)
        }
        [source, source_features, target, target_features, region, folder] => {
            let source = read_object(source, source_features)?;
            let target = read_object(target, target_features)?;
            let region = read_region(Path::new(region), &source.mesh)?;
            run(source, target, &region, Some(Path::new(folder)))
        }
        _ => {
            Err("usage: SOURCE SOURCE.txt TARGET TARGET.txt REGION.json FOLDER, or nothing".into())
        }
    }
}

/// The whole of SemFM in three calls: prepare, prepare, transfer.
fn run(
    source: Object,
    target: Object,
    region: &Region,
    folder: Option<&Path>,
) -> Result<(), Box<dyn Error>> {
    let (settings, task) = (PipelineSettings::default(), Task::default());
    let features = FeatureSource::PerVertex(&source.features);
    let source = prepare(source.mesh, features, &settings, &task)?;
    let features = FeatureSource::PerVertex(&target.features);
    let target = prepare(target.mesh, features, &settings, &task)?;
    let found = transfer(&source.object, &target.object, region, &settings.transfer, &task)?;

    let (inside, of) = (found.region.vertices().len(), found.region.n_vertices());
    println!("{inside} of {of} vertices, confidence {:.2}", found.confidence);
    match found.verdict {
        Verdict::Accept => println!("accept: plan a grasp there"),
        Verdict::Check => println!("check: let a person look first"),
        Verdict::Refuse => println!("refuse: demonstrate on an object that is more alike"),
    }
    if let Some(folder) = folder {
        let (source, target, provenance) = (&source, &target, &Provenance::default());
        let result = TransferResult { source, target, region, transfer: &found, provenance };
        for path in write_transfer(folder, &result, &task)? {
            println!("{}", path.display());
        }
    }
    Ok(())
}

/// A tool along x: a sphere whose one half is drawn out to a handle of this length and thickness.
/// Its features stand for those of an encoder: they tell handle from head, smoothly.
fn tool(length: f64, thickness: f64) -> Result<Object, Box<dyn Error>> {
    let sphere = icosphere(4);
    let drawn_out = sphere.vertices().iter().map(|&p| {
        let narrow = if p.x < 0.0 { 1.0 + (thickness - 1.0) * (-3.0 * p.x).min(1.0) } else { 1.0 };
        semfm::geom::math::DVec3::new(
            if p.x < 0.0 { p.x * length } else { p.x },
            p.y * narrow,
            p.z * narrow,
        )
    });
    let mesh = Mesh::new(drawn_out.collect(), sphere.faces().to_vec())?;
    let near = |x: f64, centre: f64| (-8.0 * (x - centre).powi(2)).exp() as f32;
    let places = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let features = sphere.vertices().iter().flat_map(|p| places.map(|centre| near(p.x, centre)));
    Ok(Object { mesh, features: features.collect() })
}

/// The outer half of the handle.
fn grip_of(tool: &Mesh) -> Vec<bool> {
    let end = tool.vertices().iter().map(|p| p.x).fold(0.0, f64::min);
    tool.vertices().iter().map(|p| p.x < 0.5 * end).collect()
}

fn read_object(mesh: &str, features: &str) -> Result<Object, Box<dyn Error>> {
    Ok(Object { mesh: read_mesh(mesh)?.mesh, features: read_features(features)? })
}

fn read_features(path: &str) -> Result<Vec<f32>, Box<dyn Error>> {
    let text = std::fs::read_to_string(path).map_err(|error| format!("{path}: {error}"))?;
    let number =
        |word: &str| word.parse().map_err(|error| format!("{path}: `{word}`: {error}").into());
    text.split_whitespace().map(number).collect()
}
