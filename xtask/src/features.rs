//! The facade without its default features: it compiles, and it pulls in neither MCAP nor a GPU.

use anyhow::{Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// Crates that a robot build without files and pictures of views must not see.
const ABSENT: [&str; 4] = ["mcap", "foxglove", "prost", "wgpu"];

/// Checks `semfm --no-default-features`.
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
    cargo(workspace, &[&["check"], &facade[..]].concat()).succeed()
}
