//! One version of each crate whose types cross our borders.
//!
//! With `cargo-deny` at hand, `deny.toml` decides, licences and sources included. Without it, which
//! is the case on a fresh machine (building it takes longer than our tests), only the rule that
//! breaks builds is checked, here.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// `deny.toml` names the same ones.
const SINGLE: [&str; 6] = ["faer", "glam", "glamx", "nalgebra", "parry3d", "parry3d-f64"];

/// `cargo deny check`, or our own look at `cargo tree`.
pub fn check(workspace: &Workspace) -> Result<()> {
    if cargo(workspace, &["deny", "--version"]).works() {
        return cargo(workspace, &["deny", "check", "bans", "licenses", "sources"]).succeed();
    }
    println!("no cargo-deny here: checking duplicate versions only, not licences and sources");
    let everything = ["tree", "--workspace", "--all-features", "--target", "all"];
    let flat = ["--edges", "all", "--prefix", "none", "--duplicates", "--depth", "0"];
    let tree = cargo(workspace, &[&everything[..], &flat[..]].concat()).output()?;
    let doubled = doubled(&tree);
    ensure!(doubled.is_empty(), "more than one version of {}", doubled.join(", "));
    println!("one version each of {}", SINGLE.join(", "));
    Ok(())
}

/// Those of [`SINGLE`] that stand in the list with several versions (the list also names crates
/// built twice in one version with different features).
fn doubled(tree: &str) -> Vec<String> {
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for line in tree.lines() {
        let mut words = line.split_whitespace();
        if let (Some(name), Some(version)) = (words.next(), words.next()) {
            versions.entry(name).or_default().insert(version);
        }
    }
    SINGLE
        .iter()
        .filter_map(|name| {
            let found = versions.get(name).filter(|found| found.len() > 1)?;
            let list: Vec<&str> = found.iter().copied().collect();
            Some(format!("{name} ({})", list.join(", ")))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_versions_are_found_and_two_builds_of_one_are_not() {
        let tree =
            "glam v0.33.12\nglam v0.34.2\n\nfaer v0.24.4\nfaer v0.24.4 (*)\nsyn v1.0\nsyn v2.0";
        assert_eq!(doubled(tree), ["glam (v0.33.12, v0.34.2)"]);
    }
}
