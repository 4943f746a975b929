//! Cleaning and simplification on real objects. Skipped, loudly, where the objects are not there.
#![allow(clippy::print_stderr)]

use std::path::{Path, PathBuf};

use semfm_geom::clean::{CleanSettings, clean};
use semfm_geom::simplify::{SimplifySettings, simplify};
use semfm_geom::{Mesh, Task, math::DVec3};

fn shared() -> Option<PathBuf> {
    let root = std::env::var_os("SEMFM_SHARED")
        .map(PathBuf::from)
        .unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let found = root.join("data/objects").is_dir();
    if !found {
        eprintln!("SKIPPED: no real objects under {}", root.display());
    }
    found.then_some(root)
}

/// Vertices and triangles of an OBJ without anything else, which is what these files are.
fn read_obj(path: &Path) -> Mesh {
    let text = std::fs::read_to_string(path).unwrap();
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let x: Vec<f64> = words.take(3).map(|w| w.parse().unwrap()).collect();
                vertices.push(DVec3::new(x[0], x[1], x[2]));
            }
            Some("f") => {
                let ids: Vec<u32> = words
                    .map(|w| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1)
                    .collect();
                faces.extend((2..ids.len()).map(|k| [ids[0], ids[k - 1], ids[k]]));
            }
            _ => {}
        }
    }
    Mesh::new(vertices, faces).unwrap()
}

fn quality(mesh: &Mesh) -> (f64, f64, f64) {
    let mut q: Vec<f64> = (0..mesh.n_faces())
        .map(|f| {
            let [a, b, c] = mesh.corners(f);
            let l = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
            if l > 0.0 { 4.0 * 3f64.sqrt() * mesh.face_area(f) / l } else { 0.0 }
        })
        .collect();
    q.sort_by(f64::total_cmp);
    let bad = q.iter().filter(|&&q| q < 0.2).count() as f64 / q.len() as f64;
    let areas = mesh.vertex_areas();
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let sd = (areas.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / areas.len() as f64).sqrt();
    (q[q.len() / 2], bad, sd / mean)
}

#[test]
fn survey() {
    let Some(root) = shared() else { return };
    let mut files: Vec<PathBuf> = Vec::new();
    for group in std::fs::read_dir(root.join("data/objects")).unwrap() {
        let group = group.unwrap().path();
        if group.is_dir() && !group.ends_with("textured") {
            files.extend(std::fs::read_dir(group).unwrap().map(|f| f.unwrap().path()));
        }
    }
    files.retain(|f| f.extension().is_some_and(|e| e == "obj"));
    files.sort();
    let only = std::env::var("ONLY").unwrap_or_default();
    files.retain(|f| f.to_str().unwrap().contains(&only));
    for file in files {
        let mesh = read_obj(&file);
        let cleaned = clean(&mesh, &CleanSettings::default()).unwrap();
        let start = std::time::Instant::now();
        let settings = SimplifySettings {
            target_vertices: std::env::var("TARGET").map_or(10_000, |t| t.parse().unwrap()),
            ..Default::default()
        };
        let simple = simplify(&cleaned.mesh, &settings, &Task::default()).unwrap();
        let ms = start.elapsed().as_millis();
        let name = file.file_stem().unwrap().to_string_lossy();
        eprintln!("{name}: {}", cleaned.report);
        let Some(simple) = simple else { continue };
        let r = &simple.report;
        let (a, b) = (quality(&cleaned.mesh), quality(&simple.mesh));
        eprintln!(
            "   {} -> {} ({} tries, {ms} ms) hausdorff {:.4} components {} -> {} euler {} -> {}; \
             quality median {:.2} -> {:.2}, bad {:.3} -> {:.3}, area cv {:.2} -> {:.2}",
            r.n_vertices_before,
            r.n_vertices,
            r.attempts,
            r.distance,
            r.topology_before.n_components,
            r.topology.n_components,
            r.topology_before.euler,
            r.topology.euler,
            a.0,
            b.0,
            a.1,
            b.1,
            a.2,
            b.2
        );
    }
}
