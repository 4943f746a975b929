//! The verdict on every mesh of the shared corpus, where that corpus is at hand.
//!
//! `corpus/MANIFEST.tsv` says for each file whether it is to be accepted, and with how many vertices,
//! faces and triangles, or refused. Where the manifest contradicts the specification of the format,
//! `tests/corpus_disputed.tsv` says so with the reason, and this test holds us to our own verdict.
#![allow(clippy::print_stderr)]

use std::collections::HashMap;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use semfm_geom::connectivity::MeshReport;
use semfm_geom::io::{MeshFile, read_mesh, read_points};

fn corpus() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("SEMFM_SHARED").map_or(beside, PathBuf::from).join("corpus");
    if folder.join("MANIFEST.tsv").is_file() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no shared corpus at {}; set SEMFM_SHARED", folder.display());
    None
}

/// Path, special features and expected verdict of each mesh.
fn rows(corpus: &Path) -> Vec<[String; 3]> {
    let manifest = std::fs::read_to_string(corpus.join("MANIFEST.tsv")).unwrap();
    manifest
        .lines()
        .filter(|line| line.starts_with("mesh/"))
        .map(|line| {
            let columns: Vec<_> = line.split('\t').collect();
            [columns[0], columns[3], columns[4]].map(String::from)
        })
        .collect()
}

/// Our verdicts where they differ from the manifest's, by path.
fn disputed() -> HashMap<String, String> {
    include_str!("corpus_disputed.tsv")
        .lines()
        .skip(1)
        .map(|line| {
            let columns: Vec<_> = line.split('\t').collect();
            assert_eq!(columns.len(), 4, "{line}");
            (columns[0].to_owned(), columns[2].to_owned())
        })
        .collect()
}

/// The number after `key=`, unless words follow that change its meaning.
fn number(text: &str, key: &str) -> Option<usize> {
    let word = text.split([' ', ';']).find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
    word?.trim_end_matches(',').parse().ok()
}

fn satisfies(expected: &str, read: &Result<MeshFile, semfm_geom::Error>) -> bool {
    let (verdict, counted) = expected.split_once(" [reference counter: ").unwrap_or((expected, ""));
    verdict.split(" or ").any(|verdict| match read {
        _ if verdict.starts_with("any verdict") => true,
        Err(_) => verdict.starts_with("refuse"),
        Ok(_) if !verdict.starts_with("accept") => false,
        Ok(file) => {
            // The counts in brackets are exact where there are any.
            let counts =
                if counted.starts_with("accept") { counted.trim_end_matches(']') } else { verdict };
            let same = |key, found| number(counts, key).is_none_or(|expected| expected == found);
            same("v", file.mesh.n_vertices())
                && same("f", file.n_faces)
                && same("tri", file.mesh.n_faces())
        }
    })
}

fn describe(read: &Result<MeshFile, semfm_geom::Error>) -> String {
    match read {
        Ok(file) => {
            let (v, tri) = (file.mesh.n_vertices(), file.mesh.n_faces());
            format!("accept v={v} f={} tri={tri}", file.n_faces)
        }
        Err(error) => format!("refuse: {error} [{}]", error.code()),
    }
}

#[test]
fn every_mesh_gets_its_verdict() {
    let Some(corpus) = corpus() else { return };
    let disputed = disputed();
    let mut failures = Vec::new();
    for [path, _, expected] in rows(&corpus) {
        let start = Instant::now();
        let Ok(read) = catch_unwind(|| read_mesh(corpus.join(&path))) else {
            failures.push(format!("{path}: panicked"));
            continue;
        };
        let _ = catch_unwind(|| read_points(corpus.join(&path)))
            .unwrap_or_else(|_| panic!("{path}: panicked as points"));
        // Half a second for two readings in a test profile, on files of a megabyte or two at most.
        if start.elapsed() > Duration::from_secs(2) {
            failures.push(format!("{path}: took {:?}", start.elapsed()));
        }
        if std::env::var_os("SEMFM_VERBOSE").is_some() {
            eprintln!("{path}\t{}", describe(&read));
            if let Ok(file) = &read
                && !file.appearance.notes.is_empty()
            {
                eprintln!("    notes {:?}", file.appearance.notes);
            }
        }
        let verdict = disputed.get(&path).unwrap_or(&expected);
        if !satisfies(verdict, &read) {
            failures.push(format!("{path}: expected {verdict}; {}", describe(&read)));
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn the_report_agrees_with_the_features_in_the_manifest() {
    let Some(corpus) = corpus() else { return };
    let mut failures = Vec::new();
    for [path, special, expected] in rows(&corpus) {
        let Ok(file) = read_mesh(corpus.join(&path)) else { continue };
        // Files whose features were counted at all.
        if !expected.starts_with("accept v=")
            || !expected.contains("tri=")
            || path.ends_with("gltf")
            || path.contains("/synth/")
        {
            continue;
        }
        // The manifest counts vertices at one place apart.
        let report = MeshReport::as_stored(&file.mesh);
        let features = [
            ("boundary-edges", report.boundary_edges, 0),
            ("nonmanifold-edges", report.non_manifold_edges, 0),
            ("components", report.components, 1),
            ("isolated", report.isolated_vertices, 0),
            ("degenerate", report.degenerate_faces, 0),
            ("duplicate-positions", report.duplicate_positions, 0),
        ];
        for (key, found, default) in features {
            let expected = number(&special, key).unwrap_or(default);
            // The manifest fans every polygon. A fan of a concave one has triangles that are degenerate
            // or lie over each other; cutting it as it is can only save them.
            let fanned = special.contains("polygons");
            let folded = fanned && number(&special, "nonmanifold-edges").is_some();
            let saved = match key {
                "degenerate" => fanned && found < expected,
                "nonmanifold-edges" => folded && found < expected,
                "boundary-edges" => folded && report.non_manifold_edges == 0,
                _ => false,
            };
            if found != expected && !saved {
                failures.push(format!("{path}: {key}={expected}, found {found}"));
            }
        }
    }
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}
