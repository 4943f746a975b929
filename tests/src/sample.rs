//! Two small objects with a region and features: a transfer of theirs takes a fraction of a second.

use std::path::{Path, PathBuf};

/// The files of a sample in a folder.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Where they lie.
    pub folder: PathBuf,
    /// Mesh of the source.
    pub source: PathBuf,
    /// Mesh of the target.
    pub target: PathBuf,
    /// A region on the source.
    pub region: PathBuf,
    /// Features of the source's vertices.
    pub source_features: PathBuf,
    /// Features of the target's vertices.
    pub target_features: PathBuf,
}

const RINGS: usize = 14;
const SECTORS: usize = 18;

impl Sample {
    /// Writes the files into `folder`.
    ///
    /// # Panics
    /// Where they cannot be written.
    pub fn write(folder: &Path) -> Self {
        std::fs::create_dir_all(folder).expect("a folder for the sample");
        let at = |name: &str| folder.join(name);
        let sample = Self {
            folder: folder.to_owned(),
            source: at("source.obj"),
            target: at("target.obj"),
            region: at("grip.json"),
            source_features: at("source.npy"),
            target_features: at("target.npy"),
        };
        let [source, target] = [blob(0.10), blob(0.14)];
        put(&sample.source, obj(&source));
        put(&sample.target, obj(&target));
        put(&sample.source_features, npy(&source));
        put(&sample.target_features, npy(&target));
        let grip: Vec<usize> = (0..source.len()).filter(|&v| source[v][2] > 0.03).collect();
        put(&sample.region, serde_json::json!({ "vertices": grip }).to_string());
        sample
    }

    /// `transfer` with these files into `out`, and more words.
    pub fn transfer(&self, out: &Path, more: &[&str]) -> Vec<String> {
        let mut words = vec!["transfer".to_owned(), text(&self.source), text(&self.target)];
        words.extend(["--region".into(), text(&self.region), "-o".into(), text(out)]);
        words.extend(["--source-features".into(), text(&self.source_features)]);
        words.extend(["--target-features".into(), text(&self.target_features)]);
        words.extend(["--no-cache".into(), "--quiet".into(), "-k".into(), "20".into()]);
        words.extend(more.iter().map(|&word| word.to_owned()));
        words
    }
}

/// A path as a word.
///
/// # Panics
/// Where it is not UTF-8.
pub fn text(path: &Path) -> String {
    path.to_str().expect("temporary folders have plain names").to_owned()
}

fn put(path: &Path, content: impl AsRef<[u8]>) {
    std::fs::write(path, content).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

/// Vertices of a ball of 8 cm with a lump, metres.
fn blob(lump: f64) -> Vec<[f64; 3]> {
    let mut vertices = vec![[0.0, 0.0, 0.04 + lump * 0.2]];
    for ring in 1..RINGS {
        let polar = std::f64::consts::PI * ring as f64 / RINGS as f64;
        for sector in 0..SECTORS {
            let around = std::f64::consts::TAU * sector as f64 / SECTORS as f64;
            let radius = 0.04 * (1.0 + lump * (3.0 * polar).cos() + 0.1 * around.cos());
            let (x, y) = (polar.sin() * around.cos(), polar.sin() * around.sin());
            vertices.push([radius * x, 0.8 * radius * y, radius * polar.cos()]);
        }
    }
    vertices.push([0.0, 0.0, -0.04]);
    vertices
}

fn obj(vertices: &[[f64; 3]]) -> String {
    let mut text = String::new();
    for [x, y, z] in vertices {
        text += &format!("v {x} {y} {z}\n");
    }
    let id = |ring: usize, sector: usize| 2 + (ring - 1) * SECTORS + sector % SECTORS;
    let last = vertices.len();
    for sector in 0..SECTORS {
        text += &format!("f 1 {} {}\n", id(1, sector), id(1, sector + 1));
        for ring in 1..RINGS - 1 {
            let [a, b] = [id(ring, sector), id(ring, sector + 1)];
            let [c, d] = [id(ring + 1, sector), id(ring + 1, sector + 1)];
            text += &format!("f {a} {c} {d} {b}\n");
        }
        text += &format!("f {last} {} {}\n", id(RINGS - 1, sector + 1), id(RINGS - 1, sector));
    }
    text
}

/// Positions as features, a little bent: alike places of the two objects have alike features.
fn npy(vertices: &[[f64; 3]]) -> Vec<u8> {
    let n = vertices.len();
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({n}, 4), }}");
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for [x, y, z] in vertices {
        let row = [1.0, 20.0 * x, 20.0 * y, 20.0 * z];
        bytes.extend(row.iter().flat_map(|value| (*value as f32).to_le_bytes()));
    }
    bytes
}
