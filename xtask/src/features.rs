//! The facade without its default features: it compiles, and it pulls in neither MCAP nor a GPU nor
//! pictures. `semfm-show` compiles without MCAP, too.

use anyhow::{Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// Crates that a robot build must not see: files of views, rendering on a GPU, pictures and pages.
const ABSENT: [&str; 6] = ["mcap", "foxglove", "prost", "wgpu", "base64", "semfm-show"];

/// Checks `semfm` and `semfm-show` with `--no-default-features`.
pub fn check(workspace: &Workspace) -> Result<()> {
    let facade = ["-p", "semfm", "--no-default-features"];
    let tree = [&["tree", "--prefix", "none", "--edges", "normal"], &facade[..]].concat();
    let tree = cargo(workspace, &tree).output()?;
    let found: Vec<&str> = tree
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| ABSENT.contains(name))
        .collect();
    ensure!(
        found.is_empty(),
        "semfm without default features still depends on {}",
        found.join(", ")
    );
    cargo(workspace, &[&["check"], &facade[..]].concat()).succeed()?;
    cargo(workspace, &["check", "-p", "semfm-show", "--no-default-features"]).succeed()
}
