//! One version of each crate whose types cross our borders.
//!
//! With `cargo-deny` at hand, `deny.toml` decides, licences and sources included. Without it, which
//! is the case on a fresh machine (building it takes longer than our tests), only the rule that
//! breaks builds is checked, here.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};

use crate::process::cargo;
use crate::workspace::Workspace;

/// The same ones as in `deny.toml`.
const SINGLE: [&str; 6] = ["faer", "glam", "glamx", "nalgebra", "parry3d", "parry3d-f64"];

/// `cargo deny check`, or our own look at `Cargo.lock`.
pub fn check(workspace: &Workspace) -> Result<()> {
    if cargo(workspace, &["deny", "--version"]).works() {
        return cargo(workspace, &["deny", "check", "bans", "licenses", "sources"]).succeed();
    }
    println!("no cargo-deny here: checking duplicate versions only, not licences and sources");
    let lock = std::fs::read_to_string(workspace.root.join("Cargo.lock")).context("Cargo.lock")?;
    let doubled = doubled(&lock);
    ensure!(doubled.is_empty(), "more than one version of {}", doubled.join(", "));
    println!("at most one version each of {}", SINGLE.join(", "));
    Ok(())
}

/// Those of [`SINGLE`] that the lock file holds in several versions.
fn doubled(lock: &str) -> Vec<String> {
    let value = |line: &str, key: &str| -> Option<String> {
        Some(line.strip_prefix(key)?.strip_prefix(" = \"")?.strip_suffix('"')?.to_owned())
    };
    let packages: BTreeSet<(String, String)> = lock
        .split("[[package]]")
        .filter_map(|package| {
            let find = |key| package.lines().find_map(|line| value(line, key));
            Some((find("name")?, find("version")?))
        })
        .collect();
    let versions = |name: &str| -> Vec<&str> {
        packages.iter().filter(|(of, _)| of == name).map(|(_, version)| version.as_str()).collect()
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
        let package = |name: &str, version: &str| {
            format!("[[package]]\nname = \"{name}\"\nversion = \"{version}\"\n\n")
        };
        let packages =
            [("glam", "0.33.12"), ("syn", "1.0.0"), ("glam", "0.34.2"), ("syn", "2.0.0")];
        let lock: String = packages.iter().map(|(name, version)| package(name, version)).collect();
        assert_eq!(doubled(&lock), ["glam (0.33.12, 0.34.2)"]);
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
