//! The facade without its default features: it compiles, and it pulls in neither MCAP nor a GPU nor
//! pictures. `semfm-show` compiles without MCAP, too. Encoders of others are compiled where they are asked
//! for, in the shell, too, and then pass their tests.

use anyhow::{Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// Crates that a robot build must not see: files of views, rendering on a GPU, pictures and pages.
const ABSENT: [&str; 6] = ["mcap", "foxglove", "prost", "wgpu", "base64", "semfm-show"];

/// The runtime of the feature `onnx`.
const ONNX_RUNTIME: &str = "rten";

/// Checks `semfm` and `semfm-show` with `--no-default-features`, and `semfm-encoder` with `onnx` and
/// `siglip`.
pub fn check(workspace: &Workspace) -> Result<()> {
    let facade = ["-p", "semfm", "--no-default-features"];
    let built = built_crates(workspace, &facade)?;
    let found: Vec<&str> =
        ABSENT.into_iter().filter(|&absent| built.iter().any(|name| name == absent)).collect();
    ensure!(
        found.is_empty(),
        "semfm without default features still depends on {}",
        found.join(", ")
    );
    cargo(workspace, &[&["check"], &facade[..]].concat()).succeed()?;
    cargo(workspace, &["check", "-p", "semfm-show", "--no-default-features"]).succeed()?;

    let has_runtime = |selection: &[&str]| -> Result<bool> {
        Ok(built_crates(workspace, selection)?.iter().any(|name| name == ONNX_RUNTIME))
    };
    ensure!(
        !has_runtime(&["--workspace"])?,
        "{ONNX_RUNTIME} is compiled though nobody asked for it"
    );
    let shell = ["-p", "semfm-cli", "--features", "onnx,siglip"];
    ensure!(has_runtime(&shell)?, "the feature `onnx` of semfm-cli does not reach semfm-encoder");
    // Of the whole workspace, so that all but a few crates are those of the tests that follow.
    let encoders = "semfm-encoder/onnx,semfm-encoder/siglip";
    let tests = ["test", "--workspace", "--features", encoders, "--test", "pretrained"];
    cargo(workspace, &tests).succeed()
}

/// Names of the crates that are compiled into a selection of packages.
fn built_crates(workspace: &Workspace, selection: &[&str]) -> Result<Vec<String>> {
    let tree = [&["tree", "--prefix", "none", "--edges", "normal"], selection].concat();
    let tree = cargo(workspace, &tree).output()?;
    Ok(tree.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect())
}
