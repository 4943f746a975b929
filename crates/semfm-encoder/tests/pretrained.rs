//! Pretrained networks in this process against what `semfm-embed` makes of the same pictures
//! (`fixtures/make.py`), and files that somebody damaged or made up.
#![cfg(any(feature = "onnx", feature = "siglip"))]
#![allow(clippy::print_stderr)] // A check that was skipped says so.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use semfm_encoder::rendered_views::{Coloring, RenderedObject, ViewSettings};
use semfm_encoder::{EncodedViews, Encoder, OpenSettings, open_encoder};
use semfm_geom::{Mesh, Task, zoo};
use semfm_views::{Renderer, RigSettings};
use serde::Deserialize;

/// What Python makes of a picture.
#[derive(Deserialize)]
struct Recorded {
    size: u32,
    rolls: u32,
    grid: [usize; 2],
    rect: [f32; 4],
    dim: usize,
    coverage: Vec<u8>,
    data: Vec<f32>,
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn recorded(encoder: &str) -> Vec<Recorded> {
    let json = std::fs::read(fixture("tokens.json")).unwrap();
    let mut all: BTreeMap<String, Vec<Recorded>> = serde_json::from_slice(&json).unwrap();
    all.remove(encoder).unwrap()
}

fn open(path: &Path) -> semfm_encoder::Result<std::sync::Arc<dyn Encoder>> {
    open_encoder(path.to_str().unwrap(), &OpenSettings::default())
}

/// An object with one view per size, whose pictures and outlines are those of `make.py`.
fn pictures(mesh: &Mesh, size: u32, count: usize) -> RenderedObject<'_> {
    let rig = RigSettings { count, size, ..RigSettings::default() };
    let settings = ViewSettings { rig, coloring: Coloring::Grey, ..ViewSettings::default() };
    let mut object =
        RenderedObject::new(mesh, &settings, &Renderer::cpu(), &Task::default()).unwrap();
    for view in &mut object.views {
        let n = (size * size) as usize;
        view.rgb = (0..n)
            .flat_map(|i| [(i * 37 % 256) as u8, (i * i % 251) as u8, 255 * u8::from(i % 3 == 0)])
            .collect();
        let size = size as i32;
        let from_centre = |at: i32| 2 * at + 1 - size;
        let on_object = |i: i32| {
            let (x, y) = (from_centre(i % size), from_centre(i / size));
            x * x + y * y <= size * size
        };
        view.triangles = (0..size * size).map(|i| i32::from(on_object(i)) - 1).collect();
    }
    object
}

fn encoded(encoder: &dyn Encoder, size: u32, count: usize, rolls: u32) -> EncodedViews {
    let mesh = zoo::icosphere(1);
    encoder.encode(&[pictures(&mesh, size, count)], rolls, &Task::default()).unwrap().remove(0)
}

/// Holds an encoder against the record of `name`: every number within `tolerance`.
fn agrees(encoder: &dyn Encoder, name: &str, tolerance: f32) {
    for recorded in recorded(name) {
        let found = encoded(encoder, recorded.size, 1, recorded.rolls);
        let patches = &found.views[0].patches;
        let grid = patches.grid();
        assert_eq!([grid.rows, grid.cols], recorded.grid);
        for (edge, expected) in grid.rect.iter().zip(recorded.rect) {
            assert!((edge - expected).abs() < 1e-5, "{edge} {expected}");
        }
        assert_eq!((patches.dim(), found.rolls), (recorded.dim, recorded.rolls));
        assert_eq!(patches.coverage(), recorded.coverage);
        let largest = patches
            .data()
            .iter()
            .zip(&recorded.data)
            .map(|(x, expected)| (x - expected).abs())
            .fold(0.0, f32::max);
        let Recorded { size, rolls, .. } = recorded;
        assert!(largest < tolerance, "{name}, {size} px, {rolls} rolls: off by {largest}");
    }
}

/// The same files in a folder of their own, some changed.
fn copy_of(names: &[&str], change: impl Fn(&str, Vec<u8>) -> Vec<u8>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        let to = folder.path().join(Path::new(name).file_name().unwrap());
        std::fs::write(to, change(name, std::fs::read(fixture(name)).unwrap())).unwrap();
    }
    folder
}

/// Cut short at some places and with bytes changed at others; each with what was done.
fn damaged(bytes: &[u8], n: usize) -> Vec<(String, Vec<u8>)> {
    let mut made = Vec::new();
    for i in 0..n {
        let at = i * bytes.len() / n;
        made.push((format!("cut at {at}"), bytes[..at].to_vec()));
        for byte in [0x00, 0x7f, 0xff] {
            let mut changed = bytes.to_vec();
            changed[at] = byte;
            made.push((format!("byte {at} made {byte}"), changed));
        }
    }
    made
}

/// Opens and, where that succeeds, runs what may be damaged: answers and errors alike will do.
fn try_all(path: &Path) -> bool {
    let Ok(encoder) = open(path) else { return false };
    let mesh = zoo::icosphere(1);
    encoder.encode(&[pictures(&mesh, 32, 1)], 1, &Task::default()).is_ok()
}

#[cfg(feature = "onnx")]
mod onnx {
    use super::*;

    const FILES: [&str; 5] =
        ["tiny.json", "tiny.onnx", "external.json", "external.onnx", "external.data"];

    #[test]
    fn tokens_are_those_of_onnxruntime() {
        for name in ["tiny.json", "external.json"] {
            let encoder = open(&fixture(name)).unwrap();
            assert_eq!(encoder.identity().name, name);
            // Unit vectors by sums of up to 72 terms in f32.
            agrees(&*encoder, "tiny.json", 2e-6);
        }
    }

    #[test]
    fn the_numbers_do_not_depend_on_threads_or_company() {
        let [one, three] = [1, 3].map(|threads| {
            let settings = OpenSettings { threads, quiet: true };
            let encoder = open_encoder(fixture("tiny.json").to_str().unwrap(), &settings).unwrap();
            encoded(&*encoder, 32, 5, 2)
        });
        assert_eq!(one, three);
    }

    #[test]
    fn the_version_is_that_of_description_network_and_weights() {
        let hash =
            |folder: &Path, name: &str| open(&folder.join(name)).unwrap().content_hash().unwrap();
        let same = copy_of(&FILES, |_, bytes| bytes);
        for (name, file) in [
            ("tiny.json", "tiny.json"),
            ("tiny.json", "tiny.onnx"),
            ("external.json", "external.data"),
        ] {
            let original = hash(&fixture(""), name);
            assert_eq!(hash(same.path(), name), original);
            let other = copy_of(&FILES, |this, bytes| match this == file {
                true if file == "tiny.json" => replaced(&bytes, b"0.25", b"0.26"),
                // In the middle of the network lie weights.
                true => changed(bytes, |bytes| {
                    let middle = bytes.len() / 8 * 4;
                    bytes[middle] ^= 1;
                }),
                false => bytes,
            });
            assert_ne!(hash(other.path(), name), original, "{file}");
        }
        let version = open(&fixture("tiny.json")).unwrap().identity().version;
        let digits = version.strip_prefix("rten-").and_then(|v| v.split_once('+')).unwrap().1;
        assert_eq!(digits, &hash(&fixture(""), "tiny.json")[..12]);
    }

    #[test]
    fn a_network_that_is_not_as_described_is_refused_by_name() {
        for (from, to, reason) in [
            (r#""input": "image""#, r#""input": "picture""#, "`picture`"),
            (r#""s4d""#, r#""s8""#, "`s8`"),
            (r#""onnx": "tiny.onnx""#, r#""onnx": "nowhere.onnx""#, "nowhere.onnx"),
            (r#""onnx": "tiny.onnx""#, r#""onnx": "tiny.json""#, "ONNX"),
        ] {
            let folder = copy_of(&FILES, |name, bytes| match name {
                "tiny.json" => String::from_utf8(bytes).unwrap().replace(from, to).into_bytes(),
                _ => bytes,
            });
            let error = open(&folder.path().join("tiny.json")).unwrap_err().to_string();
            assert!(error.contains(reason), "{to}: {error}");
        }
        // What shows when it runs.
        for (from, to, reason) in [
            (r#""patch": 4"#, r#""patch": 8"#, "4 × 4 tokens"),
            (r#""output_layout": "NCHW""#, r#""output_layout": "NHWC""#, "NHWC"),
            (r#""layout": "NCHW""#, r#""layout": "NHWC""#, "tiny.onnx"),
        ] {
            let folder = copy_of(&FILES, |name, bytes| match name {
                "tiny.json" => String::from_utf8(bytes).unwrap().replacen(from, to, 1).into_bytes(),
                _ => bytes,
            });
            let encoder = open(&folder.path().join("tiny.json")).unwrap();
            let mesh = zoo::icosphere(1);
            let error = encoder.encode(&[pictures(&mesh, 32, 1)], 1, &Task::default());
            let error = error.unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains("semfm-embed"), "{to}: {error}");
        }
    }

    #[test]
    fn damaged_networks_are_errors() {
        let bytes = std::fs::read(fixture("tiny.onnx")).unwrap();
        let folder = copy_of(&FILES, |_, bytes| bytes);
        let mut n_answers = 0;
        let all = damaged(&bytes, 150);
        for (_, changed) in &all {
            std::fs::write(folder.path().join("tiny.onnx"), changed).unwrap();
            n_answers += usize::from(try_all(&folder.path().join("tiny.json")));
        }
        // A byte of a weight changes numbers, not more.
        assert!(n_answers > 0 && n_answers < all.len(), "{n_answers} of {}", all.len());
    }

    #[test]
    fn weights_that_are_cut_short_or_elsewhere_are_errors() {
        let folder = copy_of(&FILES, |name, mut bytes| {
            if name == "external.data" {
                bytes.truncate(100);
            }
            bytes
        });
        let error = open(&folder.path().join("external.json")).unwrap_err().to_string();
        assert!(error.contains("external.onnx"), "{error}");
        std::fs::remove_file(folder.path().join("external.data")).unwrap();
        assert!(open(&folder.path().join("external.json")).is_err());
        // As long as the name that it stands for.
        let folder = copy_of(&FILES, |name, bytes| match name {
            "external.onnx" => replaced(&bytes, b"external.data", b"../../../data"),
            _ => bytes,
        });
        let error = open(&folder.path().join("external.json")).unwrap_err().to_string();
        assert!(error.contains("inside the folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_of_the_folder_are_refused() {
        for name in ["external.data", "external.onnx"] {
            let folder = copy_of(&FILES, |_, bytes| bytes);
            let path = folder.path().join(name);
            std::fs::remove_file(&path).unwrap();
            std::os::unix::fs::symlink(fixture(name), &path).unwrap();
            let error = open(&folder.path().join("external.json")).unwrap_err().to_string();
            assert!(error.contains("inside the folder"), "{name}: {error}");
        }
    }

    fn changed(mut bytes: Vec<u8>, change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
        change(&mut bytes);
        bytes
    }

    fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
        let mut made = bytes.to_vec();
        for at in 0..=made.len() - from.len() {
            if made[at..].starts_with(from) {
                made[at..at + to.len()].copy_from_slice(to);
            }
        }
        made
    }

    /// MobileNetV2 on views of a mesh: as many tokens as it says, of the length that it says.
    #[test]
    fn a_real_network_runs() {
        let Some(json) = mobilenet() else { return };
        let encoder = open(&json).unwrap();
        let found = encoded(&*encoder, 224, 2, 1);
        let patches = &found.views[0].patches;
        assert_eq!((patches.n_patches(), patches.dim()), (196, 416));
        assert_eq!(found.views[0].patches.data(), found.views[1].patches.data());
    }

    fn mobilenet() -> Option<PathBuf> {
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
        let shared = std::env::var_os("SEMFM_SHARED").map_or(beside, PathBuf::from);
        let json = shared.join("encoder/mobilenet_v2_features.json");
        if !json.exists() {
            eprintln!("SKIPPED: no MobileNetV2 at {}; set SEMFM_SHARED", json.display());
            return None;
        }
        Some(json)
    }
}

#[cfg(feature = "siglip")]
mod siglip {
    use super::*;

    const FILES: [&str; 3] =
        ["siglip/config.json", "siglip/preprocessor_config.json", "siglip/model.safetensors"];

    #[test]
    fn tokens_are_those_of_transformers() {
        let encoder = open(&fixture("siglip")).unwrap();
        assert_eq!(encoder.identity().name, "siglip");
        // Unit vectors; tokens that were normalised twice a layer in f32.
        agrees(&*encoder, "siglip", 1e-5);
    }

    #[test]
    fn the_numbers_do_not_depend_on_threads() {
        let [one, two] = [1, 2].map(|threads| {
            let settings = OpenSettings { threads, quiet: true };
            let encoder = open_encoder(fixture("siglip").to_str().unwrap(), &settings).unwrap();
            encoded(&*encoder, 40, 5, 4)
        });
        assert_eq!(one, two);
    }

    #[test]
    fn the_version_is_that_of_sizes_processor_and_vision_weights() {
        let hash = |folder: &Path| open(folder).unwrap().content_hash().unwrap();
        let original = hash(&fixture("siglip"));
        let same = copy_of(&FILES, |_, bytes| bytes);
        assert_eq!(hash(same.path()).len(), 64);
        for (file, from, to) in [
            ("siglip/config.json", "1e-06", "1e-05"),
            ("siglip/preprocessor_config.json", "\"resample\": 3", "\"resample\": 2"),
        ] {
            let other = copy_of(&FILES, |name, bytes| match name == file {
                true => String::from_utf8(bytes).unwrap().replace(from, to).into_bytes(),
                false => bytes,
            });
            assert_ne!(hash(other.path()), original, "{file}");
        }
        // The last tensor in the order of names is the vision tower's.
        let other = copy_of(&FILES, |name, mut bytes| {
            if name.ends_with("safetensors") {
                *bytes.last_mut().unwrap() ^= 1;
            }
            bytes
        });
        assert_ne!(hash(other.path()), original);
    }

    #[test]
    fn damaged_checkpoints_are_errors() {
        let bytes = std::fs::read(fixture("siglip/model.safetensors")).unwrap();
        let folder = copy_of(&FILES, |_, bytes| bytes);
        let mut n_answers = 0;
        let all = damaged(&bytes, 150);
        for (_, changed) in &all {
            std::fs::write(folder.path().join("model.safetensors"), changed).unwrap();
            n_answers += usize::from(try_all(folder.path()));
        }
        assert!(n_answers > 0 && n_answers < all.len(), "{n_answers} of {}", all.len());
    }

    #[test]
    fn weights_of_another_shape_are_named() {
        for (from, to, reason) in [
            (r#""hidden_size": 8"#, r#""hidden_size": 16"#, "patch_embedding"),
            (r#""num_hidden_layers": 2"#, r#""num_hidden_layers": 3"#, "layers.2"),
            (r#""patch_size": 7"#, r#""patch_size": 8"#, "patch_embedding"),
            (r#""image_size": 32"#, r#""image_size": 48"#, "preprocessor_config.json"),
        ] {
            let folder = copy_of(&FILES, |name, bytes| match name {
                "siglip/config.json" => {
                    String::from_utf8(bytes).unwrap().replace(from, to).into_bytes()
                }
                _ => bytes,
            });
            let error = open(folder.path()).unwrap_err().to_string();
            assert!(error.contains(reason), "{to}: {error}");
        }
    }
}
