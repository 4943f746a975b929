//! One version of each crate whose types cross our borders.
//!
//! With `cargo-deny` at hand, `deny.toml` decides, licences and sources included. Without it, which
//! is the case on a fresh machine (building it takes longer than our tests), only the rule that
//! breaks builds is checked, here.

use std::collections::BTreeSet;

use anyhow::{Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// The same ones as in `deny.toml`.
const SINGLE: [&str; 6] = ["faer", "glam", "glamx", "nalgebra", "parry3d", "parry3d-f64"];

/// `cargo deny check`, or our own look at what cargo builds. Not at `Cargo.lock`: that also lists
/// crates behind features of our dependencies that nobody turned on.
pub fn check(workspace: &Workspace) -> Result<()> {
    if cargo(workspace, &["deny", "--version"]).works() {
        return cargo(workspace, &["deny", "check", "bans", "licenses", "sources"]).succeed();
    }
    println!("no cargo-deny here: checking duplicate versions only, not licences and sources");
    let tree = ["tree", "--workspace", "--target", "all", "--prefix", "none", "--format", "{p}"];
    let doubled = doubled(&cargo(workspace, &tree).output()?);
    ensure!(doubled.is_empty(), "more than one version of {}", doubled.join(", "));
    println!("at most one version each of {}", SINGLE.join(", "));
    Ok(())
}

/// Those of [`SINGLE`] that a listing (`name vVERSION` a line) holds in several versions.
fn doubled(tree: &str) -> Vec<String> {
    let packages: BTreeSet<(&str, &str)> = tree
        .lines()
        .filter_map(|line| {
            let mut words = line.split_whitespace();
            Some((words.next()?, words.next()?.strip_prefix('v')?))
        })
        .collect();
    let versions = |name: &str| -> Vec<&str> {
        packages.iter().filter(|(of, _)| *of == name).map(|(_, version)| *version).collect()
    };
    SINGLE
        .iter()
        .map(|name| (name, versions(name)))
        .filter(|(_, versions)| versions.len() > 1)
        .map(|(name, versions)| format!("{name} ({})", versions.join(", ")))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::Workspace;

    #[test]
    fn two_versions_are_found() {
        let tree = "glam v0.33.12\nsyn v1.0.0\nglam v0.34.2 (*)\nsyn v2.0.0\n\nglam v0.33.12\n";
        assert_eq!(doubled(tree), ["glam (0.33.12, 0.34.2)"]);
    }

    #[test]
    fn deny_toml_names_the_same_crates() {
        let path = Workspace::find().unwrap().root.join("deny.toml");
        let text = std::fs::read_to_string(path).unwrap();
        for name in SINGLE {
            let rule = format!("crate = \"{name}\", deny-multiple-versions = true");
            assert!(text.contains(&rule), "{rule}");
        }
        assert_eq!(text.matches("deny-multiple-versions").count(), SINGLE.len());
    }
}
