//! The virtual environment `.venv` with the Python package and what its tests need.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::process::program;
use crate::workspace::Workspace;

/// What is installed beside the package: extras that users have, and groups for work on it.
#[derive(Clone, Copy)]
pub struct Needs {
    /// Names under `[project.optional-dependencies]`.
    pub extras: &'static [&'static str],
    /// Names under `[dependency-groups]`.
    pub groups: &'static [&'static str],
}

/// What the tests need that run everywhere.
pub const TESTS: Needs = Needs { extras: &["onnx"], groups: &["test"] };
/// What all tests need: torch, Ray, other people's libraries and viewers.
pub const ALL_TESTS: Needs = Needs {
    extras: &["onnx", "lite", "embed", "ray"],
    groups: &["test", "train", "notebook", "peers", "viewers"],
};

/// Makes `.venv` where it is not there, installs the package with what it `needs` where something
/// changed since, and returns the folder of its programs.
///
/// maturin compiles it with the profile and the target folder of the other jobs, and with features
/// that are those of the whole workspace, so that only PyO3 and the extension itself are new.
pub fn environment(workspace: &Workspace, needs: Needs) -> Result<PathBuf> {
    let programs = virtual_environment(workspace)?;
    let (stamp, installed) = (programs.with_file_name("installed"), stamp_of(workspace, needs)?);
    if std::fs::read_to_string(&stamp).is_ok_and(|found| found == installed) {
        return Ok(programs);
    }
    let package = format!(".[{}]", needs.extras.join(","));
    let mut arguments = PIP_INSTALL.to_vec();
    arguments.extend(["--config-settings", "build-args=--profile dev"]);
    arguments.extend(group_options(needs));
    arguments.push(&package);
    println!("pip install --group {} '{package}'", needs.groups.join(" --group "));
    program(workspace, &programs.join("python"), &arguments).succeed()?;
    std::fs::write(&stamp, installed).with_context(|| stamp.display().to_string())?;
    Ok(programs)
}

/// Installs the packages of the groups that are needed into `.venv`: most of what [`environment`] downloads, and
/// nothing that asks for a compiler, so that it may go on beside builds.
pub fn groups(workspace: &Workspace, needs: Needs) -> Result<()> {
    let python = virtual_environment(workspace)?.join("python");
    let arguments = [&PIP_INSTALL[..], &group_options(needs)].concat();
    program(workspace, &python, &arguments).succeed()
}

/// Makes `.venv` where it is not there, with a pip that knows groups; the folder of its programs.
fn virtual_environment(workspace: &Workspace) -> Result<PathBuf> {
    let programs = workspace.root.join(".venv/bin");
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
    // Debian 12 comes with pip 23, which knows no dependency groups.
    if !program(workspace, &python, &["-c", PIP_IS_NEW]).works() {
        let arguments = [&PIP_INSTALL[..], &["--upgrade", PIP]].concat();
        program(workspace, &python, &arguments).succeed()?;
    }
    Ok(programs)
}

/// pip's options for the groups that are needed.
fn group_options(needs: Needs) -> Vec<&'static str> {
    needs.groups.iter().flat_map(|&group| ["--group", group]).collect()
}

const PIP_INSTALL: [&str; 5] = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
/// The first pip with `--group`, and whether it is there.
const PIP: &str = "pip>=25.1";
const PIP_IS_NEW: &str =
    "import pip; assert tuple(map(int, pip.__version__.split('.')[:2])) >= (25, 1)";

/// Writes the type stubs of the compiled module into the sources.
pub fn stubs(workspace: &Workspace) -> Result<()> {
    let python = environment(workspace, TESTS)?.join("python");
    program(workspace, &python, &["python/tools/stubs.py"]).succeed()
}

/// What the package is made of; `typed` is the end of `py.typed`.
const SOURCES: [&str; 10] = ["py", "pyi", "rs", "toml", "typed", "md", "html", "css", "js", "wgsl"];

/// Needs and content of the package, so that nothing is installed twice.
fn stamp_of(workspace: &Workspace, needs: Needs) -> Result<String> {
    let mut files = ["pyproject.toml", "Cargo.toml", "Cargo.lock"].map(PathBuf::from).to_vec();
    files.iter_mut().for_each(|file| *file = workspace.root.join(&*file));
    let mut folders = ["python/semfm", "crates"].map(|folder| workspace.root.join(folder)).to_vec();
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir().with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path
                .extension()
                .is_some_and(|kind| SOURCES.iter().any(|source| kind == *source))
            {
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
    let words = [needs.extras, needs.groups].concat().join(",");
    Ok(format!("{words} {:016x}", hasher.finish()))
}
