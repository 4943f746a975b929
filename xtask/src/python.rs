//! The virtual environment `.venv` with the sidecar and what its tests need.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::process::program;
use crate::workspace::Workspace;

/// Makes `.venv` where it is not there, installs the sidecar with `extras` where something changed
/// since, and returns the folder of its programs.
pub fn environment(workspace: &Workspace, extras: &str) -> Result<PathBuf> {
    let folder = workspace.root.join(".venv");
    let programs = folder.join("bin");
    let python = programs.join("python");
    let system = Path::new("python3");
    if !program(workspace, &python, &["-c", "import pip"]).works() {
        if !program(workspace, system, &["-c", "import sys; assert sys.version_info >= (3, 9)"])
            .works()
        {
            bail!("Python 3.9 or newer is missing: apt-get install python3 python3-venv");
        }
        if !program(workspace, system, &["-c", "import venv, ensurepip"]).works() {
            bail!("Python's venv is missing: apt-get install python3-venv");
        }
        program(workspace, system, &["-m", "venv", "--clear", ".venv"]).succeed()?;
    }
    let (stamp, installed) = (folder.join("installed"), stamp_of(workspace, extras)?);
    if std::fs::read_to_string(&stamp).is_ok_and(|found| found == installed) {
        return Ok(programs);
    }
    let package = format!(".[{extras}]");
    let arguments =
        ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", package.as_str()];
    println!("pip install '{package}'");
    program(workspace, &python, &arguments).succeed()?;
    std::fs::write(&stamp, installed).with_context(|| stamp.display().to_string())?;
    Ok(programs)
}

/// Extras and content of the package, so that nothing is installed twice.
fn stamp_of(workspace: &Workspace, extras: &str) -> Result<String> {
    let mut files = vec![workspace.root.join("pyproject.toml")];
    let mut folders = vec![workspace.root.join("python/semfm")];
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir().with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|kind| kind == "py") {
                files.push(path);
            }
        }
    }
    files.sort();
    let mut hasher = DefaultHasher::new();
    for path in files {
        path.hash(&mut hasher);
        std::fs::read(&path).with_context(|| path.display().to_string())?.hash(&mut hasher);
    }
    Ok(format!("{extras} {:016x}", hasher.finish()))
}
