//! `cargo xtask wheel`: the wheel as users get it, built for release.

use anyhow::{Context, Result, bail, ensure};

use crate::process::program;
use crate::python::{TESTS, environment};
use crate::workspace::Workspace;

/// Bytes that a wheel may have.
const LARGEST: u64 = 15 << 20;
/// Milliseconds that `import semfm` may take, the best of [`TRIES`].
const SLOWEST_MS: f64 = 200.0;
const TRIES: usize = 5;

/// Builds the wheel into `target/wheels`, and measures it in a fresh environment.
pub fn check(workspace: &Workspace) -> Result<()> {
    let python = environment(workspace, TESTS)?.join("python");
    let folder = workspace.built("wheels");
    let folder_text = folder.to_str().context("the target folder's name is not UTF-8")?;
    let arguments = ["-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder_text, "."];
    program(workspace, &python, &arguments).succeed()?;
    let newest = folder
        .read_dir()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|kind| kind == "whl"))
        .max_by_key(|path| path.metadata().and_then(|about| about.modified()).ok());
    let Some(wheel) = newest else { bail!("no wheel in {}", folder.display()) };
    let bytes = wheel.metadata()?.len();
    println!("{}: {:.1} MB", wheel.display(), bytes as f64 / 1e6);
    ensure!(bytes <= LARGEST, "the wheel has {bytes} bytes, more than {LARGEST}");

    let fresh = workspace.built("wheel-venv");
    let fresh_text = fresh.to_str().context("the target folder's name is not UTF-8")?;
    program(workspace, &python, &["-m", "venv", "--clear", fresh_text]).succeed()?;
    let python = fresh.join("bin/python");
    let wheel_text = wheel.to_str().context("the wheel's name is not UTF-8")?;
    let arguments = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel_text];
    program(workspace, &python, &arguments).succeed()?;
    let times = (0..TRIES).map(|_| {
        let code = "import time; t = time.perf_counter(); import semfm; \
                    print((time.perf_counter() - t) * 1e3)";
        Ok(program(workspace, &python, &["-c", code]).output()?.trim().parse::<f64>()?)
    });
    let best = times.collect::<Result<Vec<f64>>>()?.into_iter().fold(f64::INFINITY, f64::min);
    println!("import semfm: {best:.0} ms");
    ensure!(best <= SLOWEST_MS, "importing takes {best:.0} ms, more than {SLOWEST_MS}");
    Ok(())
}
