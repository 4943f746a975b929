//! The built binary, and the data that only some machines have.
#![allow(clippy::print_stderr)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// The built `semfm-cli`, beside the tests that are running.
///
/// # Panics
/// Where it was not built: `cargo test --workspace` builds it.
pub fn semfm_cli() -> Command {
    let test = std::env::current_exe().expect("a running test has a path");
    let folder =
        test.parent().and_then(Path::parent).expect("tests run from target/<profile>/deps");
    let program = folder.join(format!("semfm-cli{}", std::env::consts::EXE_SUFFIX));
    assert!(program.is_file(), "{} is not built: run `cargo test --workspace`", program.display());
    let mut command = Command::new(program);
    command.env("SEMFM_CACHE", std::env::temp_dir().join("semfm-tests-cache"));
    command
}

/// What a run answered: exit code, stdout, stderr.
#[derive(Debug)]
pub struct Answer {
    /// Exit code, `None` where a signal ended it.
    pub code: Option<i32>,
    /// Data.
    pub out: String,
    /// Messages.
    pub err: String,
}

/// Runs `semfm-cli` with `arguments`.
///
/// # Panics
/// Where the program cannot be started.
pub fn run<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Answer {
    answer(semfm_cli().args(arguments).output().expect("the built binary starts"))
}

/// The content of a JSON file.
///
/// # Panics
/// Where it cannot be read.
pub fn json(path: &Path) -> Value {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Mean IoU of a method over all pairs, from the results of `eval`.
///
/// # Panics
/// Where the results have none.
pub fn mean_iou(results: &Value, method: &str) -> f64 {
    let mut summaries = results["summaries"].as_array().expect("summaries").iter();
    let summary = summaries.find(|s| s["scope"] == "all" && s["method"] == method);
    summary.and_then(|s| s["mean"].as_f64()).unwrap_or_else(|| panic!("no mean of {method}"))
}

/// An output as text.
pub fn answer(output: Output) -> Answer {
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    Answer { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// The folder of shared data, where it is at hand; else says so and gives `None`.
pub fn shared(what: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("SEMFM_SHARED").map_or_else(beside, PathBuf::from).join(what);
    if folder.exists() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no shared data at {}; set SEMFM_SHARED", folder.display());
    None
}
