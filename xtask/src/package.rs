//! `cargo xtask package`: every crate as crates.io would receive it, complete and buildable.
//!
//! `cargo package` verifies each crate in a build of its own, with other profiles than the
//! workspace's, so that all dependencies would be compiled again. Here the packed crates are unpacked
//! into one workspace with our profiles and checked there.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::process::{cargo, program};
use crate::workspace::{Workspace, entries};

/// What each packed crate must hold besides its code.
const DEMANDED: [&str; 3] = ["README.md", "LICENSE-MIT", "LICENSE-APACHE"];
/// Packages that stay in the repository.
const UNPUBLISHED: [&str; 2] = ["semfm-tests", "xtask"];
/// Bytes that a packed crate may have.
const LARGEST: u64 = 4 << 20;

/// Packs every crate, looks at what is inside, and compiles what was packed.
pub fn check(workspace: &Workspace) -> Result<()> {
    let exclude: Vec<&str> = UNPUBLISHED.iter().flat_map(|name| ["--exclude", name]).collect();
    let pack = ["package", "--workspace", "--no-verify", "--allow-dirty", "--quiet"];
    let folder = workspace.built("package");
    if folder.is_dir() {
        std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    cargo(workspace, &[&pack[..], &exclude].concat()).succeed()?;

    let unpacked = workspace.built("package/unpacked");
    std::fs::create_dir_all(&unpacked).with_context(|| unpacked.display().to_string())?;
    let mut members = Vec::new();
    for archive in entries(&folder)? {
        if archive.extension().is_some_and(|kind| kind == "crate") {
            members.push(unpack(workspace, &archive, &unpacked)?);
        }
    }
    let crates = entries(&workspace.root.join("crates"))?;
    ensure!(members.len() == crates.len(), "{} of {} crates packed", members.len(), crates.len());

    write_workspace(workspace, &unpacked, &members)?;
    let manifest = unpacked.join("Cargo.toml");
    let manifest = manifest.to_str().context("the target folder's name is not UTF-8")?;
    let target = workspace.built("");
    let target = target.to_str().context("the target folder's name is not UTF-8")?;
    let check = ["check", "--offline", "--manifest-path", manifest, "--target-dir", target];
    cargo(workspace, &[&check[..], &["--workspace"]].concat()).succeed()?;
    println!("packed and compiled: {}", members.join(", "));
    Ok(())
}

/// Unpacks one crate, checks what it holds, and returns its folder's name.
fn unpack(workspace: &Workspace, archive: &Path, into: &Path) -> Result<String> {
    let name = archive.file_stem().and_then(|stem| stem.to_str()).context("a nameless crate")?;
    let bytes = archive.metadata()?.len();
    ensure!(bytes <= LARGEST, "{name} has {bytes} bytes packed, more than {LARGEST}");
    let path = |path: &Path| path.to_str().map(str::to_owned).context("a path is not UTF-8");
    let arguments = ["-xzf", &path(archive)?, "-C", &path(into)?];
    program(workspace, Path::new("tar"), &arguments).succeed()?;
    let folder = into.join(name);
    for file in DEMANDED {
        ensure!(folder.join(file).is_file(), "{name} is packed without {file}");
    }
    ensure!(!folder.join("tests/fixtures").exists(), "{name} is packed with its test fixtures");
    Ok(name.to_owned())
}

/// A workspace of the unpacked crates, which find one another by path, with our profiles.
fn write_workspace(workspace: &Workspace, folder: &Path, members: &[String]) -> Result<()> {
    let root = read(&workspace.root.join("Cargo.toml"))?;
    let profiles = root.find("[profile.dev]").context("Cargo.toml has no [profile.dev]")?;
    let mut text = String::from("[workspace]\nresolver = \"3\"\nmembers = [");
    for member in members {
        write!(text, "\"{member}\", ")?;
    }
    text.push_str("]\n\n[patch.crates-io]\n");
    for member in members {
        let name = member.rsplit_once('-').context("a packed crate without a version")?.0;
        writeln!(text, "{name} = {{ path = \"{member}\" }}")?;
    }
    text.push('\n');
    text.push_str(&root[profiles..]);
    write(&folder.join("Cargo.toml"), &text)?;
    write(&folder.join("Cargo.lock"), &read(&workspace.root.join("Cargo.lock"))?)
}

fn read(path: &PathBuf) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

fn write(path: &PathBuf, text: &str) -> Result<()> {
    std::fs::write(path, text).with_context(|| path.display().to_string())
}
