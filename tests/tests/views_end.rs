//! `views` ends as it should, whatever graphics drivers are installed: a driver that draws on the CPU has
//! threads of its own, and one that outlives `main` may take the process down with it at exit.
//!
//! A death in a hundred runs is met by 2,000 of them: of the default renderer with `SEMFM_FULL=1`, of a
//! driver, where a run takes ten times as long, with `SEMFM_DRIVER_RUNS=2000`. Without, a sample.
#![allow(clippy::print_stderr)]

use std::path::Path;

use semfm_tests::shell::run;

const ALL_RUNS: usize = 2000;
const SAMPLE: usize = 40;

const TETRAHEDRON: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

fn default_runs() -> usize {
    if std::env::var_os("SEMFM_FULL").is_some_and(|full| full == "1") { ALL_RUNS } else { SAMPLE }
}

fn driver_runs() -> usize {
    let asked = std::env::var("SEMFM_DRIVER_RUNS").ok();
    asked.map_or(SAMPLE, |runs| runs.parse().expect("SEMFM_DRIVER_RUNS: a number of runs"))
}

/// Runs `views` `n_runs` times and gives the runs that did not end with 0.
fn deaths(folder: &Path, n_runs: usize, more: &[&str]) -> Vec<String> {
    let (mesh, output) = (folder.join("t.obj"), folder.join("t.views.mcap"));
    std::fs::write(&mesh, TETRAHEDRON).unwrap();
    let mut arguments = vec!["views", mesh.to_str().unwrap(), "-o", output.to_str().unwrap()];
    arguments.extend(["--count", "2", "--size", "32", "--quiet"]);
    arguments.extend(more);
    let ends = (0..n_runs).map(|i| (i, run(&arguments)));
    ends.filter(|(_, answer)| answer.code != Some(0))
        .map(|(i, answer)| format!("run {i}: {answer:?}"))
        .collect()
}

#[test]
fn no_run_of_the_default_renderer_dies_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let n_runs = default_runs();
    let deaths = deaths(folder.path(), n_runs, &[]);
    assert!(deaths.is_empty(), "{} of {n_runs} runs died: {deaths:?}", deaths.len());
}

#[test]
fn no_run_on_a_driver_dies_at_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let n_runs = driver_runs();
    let deaths = deaths(folder.path(), n_runs, &["--renderer", "gpu"]);
    if deaths.len() == n_runs && deaths[0].contains("no graphics adapter") {
        eprintln!("SKIPPED: no graphics driver");
        return;
    }
    assert!(deaths.is_empty(), "{} of {n_runs} runs died: {deaths:?}", deaths.len());
}
