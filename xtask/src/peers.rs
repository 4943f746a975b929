//! Every benchmark beside other libraries, in an environment of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::process::{cargo, program};
use crate::workspace::Workspace;

/// The libraries that we are measured beside, at the versions that the goals were set with.
const PEERS: [&str; 5] =
    ["numpy", "scipy", "pyfmaps==1.3.1", "robust_laplacian==1.1.0", "potpourri3d==1.4.0"];
/// The folder of the virtual environment.
const ENVIRONMENT: &str = ".venv-peers";
/// Meshes of the shared data for Laplacians and geodesics.
const MESHES: [&str; 2] = ["data/ycb/mug/textured.obj", "data/ycb/hammer/textured.obj"];

/// A benchmark: `bench/<script>` is given the example program and what `arguments` says.
struct Benchmark {
    script: &'static str,
    example: &'static str,
    package: &'static str,
    /// Whether meshes follow.
    takes_meshes: bool,
}

const BENCHMARKS: [Benchmark; 3] = [
    Benchmark {
        script: "bench/laplacian.py",
        example: "bench_laplacian",
        package: "semfm-geom",
        takes_meshes: true,
    },
    Benchmark {
        script: "bench/eigen.py",
        example: "bench_eigen",
        package: "semfm-geom",
        takes_meshes: false,
    },
    Benchmark {
        script: "bench/maps.py",
        example: "bench_maps",
        package: "semfm-fmap",
        takes_meshes: false,
    },
];

/// Builds the programs, makes the environment and runs one benchmark after the other. A benchmark that fails stops no
/// other.
pub fn run(workspace: &Workspace) -> Result<()> {
    let python = environment(workspace)?;
    let mut failed = Vec::new();
    for benchmark in &BENCHMARKS {
        println!("== {}", benchmark.script);
        if let Err(error) = benchmark.run(workspace, &python) {
            eprintln!("error: {}: {error:#}", benchmark.script);
            failed.push(benchmark.script);
        }
    }
    if failed.is_empty() { Ok(()) } else { bail!("failed: {}", failed.join(", ")) }
}

impl Benchmark {
    fn run(&self, workspace: &Workspace, python: &Path) -> Result<()> {
        let build = ["build", "--release", "-p", self.package, "--example", self.example];
        cargo(workspace, &build).succeed()?;
        let example = workspace.built("release/examples").join(self.example);
        let mut arguments = vec![self.script.to_owned(), text(&example)?];
        if self.takes_meshes {
            let Some(shared) = workspace.shared() else {
                eprintln!("skipped: no shared data with meshes to measure on");
                return Ok(());
            };
            for mesh in MESHES {
                arguments.push(text(&shared.join(mesh))?);
            }
        }
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let shared = workspace.shared().unwrap_or_else(|| workspace.root.join("../shared"));
        program(workspace, python, &arguments).env("SEMFM_SHARED", shared).succeed()
    }
}

/// Python with the peers, made where it is not there.
fn environment(workspace: &Workspace) -> Result<PathBuf> {
    let python = workspace.root.join(ENVIRONMENT).join("bin/python");
    let imports = "import pyFM, robust_laplacian, potpourri3d, scipy";
    if !program(workspace, &python, &["-c", imports]).works() {
        program(workspace, Path::new("python3"), &["-m", "venv", "--clear", ENVIRONMENT])
            .succeed()?;
        let mut arguments = vec!["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
        arguments.extend(PEERS);
        program(workspace, &python, &arguments).succeed()?;
    }
    Ok(python)
}

fn text(path: &Path) -> Result<String> {
    Ok(path.to_str().with_context(|| format!("{} is no text", path.display()))?.to_owned())
}
