//! A memory at the shell: demonstrations are added, listed, asked and taken away.

use std::path::{Path, PathBuf};

use semfm::Region;
use semfm::files::write_region;
use semfm::geom::io::{read_mesh, write_mesh};
use semfm_synth::{Category, ObjectSettings, make_object};
use semfm_tests::shell::{Answer, json, run};
use serde_json::Value;
use tempfile::TempDir;

/// Four procedural containers, each with its region beside it.
fn containers() -> (TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let settings = ObjectSettings { n_vertices: 600, ..ObjectSettings::default() };
    let meshes = (0..4).map(|instance| {
        let object = make_object(Category::Containers, instance, &settings).unwrap();
        let path = folder.path().join(object.name()).with_extension("obj");
        write_mesh(&path, &object.mesh).unwrap();
        let mesh = read_mesh(&path).unwrap().mesh;
        let region = Region::from_mask(&object.region);
        write_region(&path.with_extension("json"), &region, &mesh).unwrap();
        path
    });
    let meshes = meshes.collect();
    (folder, meshes)
}

fn remember(mesh: &Path, memory: &Path, more: &[&str]) -> Answer {
    let region = mesh.with_extension("json");
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let mut words = vec!["remember".into(), text(mesh), "--region".into(), text(&region)];
    words.extend(["--memory".into(), text(memory), "--quiet".into()]);
    words.extend(more.iter().map(|&word| word.to_owned()));
    run(&words)
}

#[test]
fn a_memory_is_filled_listed_asked_and_emptied() {
    let (folder, meshes) = containers();
    let memory = folder.path().join("memory");
    let at = memory.to_str().unwrap();
    for (mesh, name) in meshes[..3].iter().zip(["one", "two", "three"]) {
        let answer = remember(mesh, &memory, &["--name", name, "--kind", "container"]);
        assert_eq!(answer.code, Some(0), "{answer:?}");
        assert!(answer.out.contains(name), "{answer:?}");
    }
    let again = remember(&meshes[0], &memory, &["--name", "one"]);
    assert_eq!(again.code, Some(2));
    assert!(again.err.contains("--replace"), "{again:?}");
    let again = remember(&meshes[0], &memory, &["--name", "one", "--replace", "--json"]);
    assert_eq!(again.code, Some(0), "{again:?}");
    let told: Value = serde_json::from_str(&again.out).unwrap();
    assert_eq!(told["n_entries"], 3);

    let listed = run(&["info", "--json", at]);
    assert_eq!(listed.code, Some(0), "{listed:?}");
    let about: Value = serde_json::from_str(&listed.out).unwrap();
    assert_eq!((about["kind"].as_str(), about["n_entries"].as_u64()), (Some("memory"), Some(3)));
    let names: Vec<&str> =
        about["entries"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["one", "three", "two"]);
    assert!(run(&["info", at]).out.contains("container"));

    let out = folder.path().join("out");
    let (target, to) = (meshes[3].to_str().unwrap(), out.to_str().unwrap());
    let answer = run(&["transfer", target, "--memory", at, "-o", to, "--quiet", "--json"]);
    assert!(matches!(answer.code, Some(0 | 1)), "{answer:?}");
    let told: Value = serde_json::from_str(&answer.out).unwrap();
    assert_eq!(told["answers"].as_array().unwrap().len(), 3);
    let report = json(&out.join("report.json"));
    assert_eq!(report["format"], "semfm.memory_report/1");
    let shares = report["answers"].as_array().unwrap().iter();
    let total: f64 = shares.map(|said| said["share"].as_f64().unwrap()).sum();
    assert!((total - 1.0).abs() < 1e-9, "{total}");
    for name in ["region.json", "target.ply", "target.glb", "memory.png"] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let region = json(&out.join("region.json"));
    assert_eq!(region["format"], "semfm.region/1");

    for name in ["one", "two", "three"] {
        let answer = run(&["remember", "--forget", name, "--memory", at]);
        assert_eq!(answer.code, Some(0), "{answer:?}");
    }
    let empty = run(&["transfer", target, "--memory", at, "-o", to, "--quiet"]);
    assert_eq!(empty.code, Some(2));
    assert!(empty.err.contains("semfm-cli remember"), "{empty:?}");
}

#[test]
fn what_does_not_go_with_a_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let cases: [&[&str]; 4] = [
        &["transfer", "mug.obj", "kettle.obj", "--memory", "m", "-o", "out"],
        &["transfer", "mug.obj", "--memory", "m", "-o", "out", "--gripper", "franka"],
        &["transfer", "mug.obj", "-o", "out"],
        &["remember", "mug.obj", "--memory", "m"],
    ];
    for words in cases {
        let answer = run(words);
        assert_eq!(answer.code, Some(2), "{words:?}: {answer:?}");
    }
    let none = run(&["transfer", "mug.obj", "--memory", &at("nowhere"), "-o", &at("out")]);
    assert_eq!(none.code, Some(2));
    assert!(none.err.contains("nothing there") && none.err.contains("remember"), "{none:?}");
    assert!(!folder.path().join("out").exists());
}
