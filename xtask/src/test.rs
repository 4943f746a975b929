//! `cargo xtask test`: every test there is, from a bare checkout.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};

use crate::process::{Process, cargo, program};
use crate::python::{ALL_TESTS, TESTS, environment};
use crate::tally::{CargoTest, Pytest, Tally};
use crate::workspace::{Workspace, is_benchmark};

/// Runs everything and sums up. A step that cannot be done counts as one failure and stops no
/// other.
///
/// Where `CI` is `true` and the shared data are there, a test that did not find them has failed.
pub fn run(workspace: &Workspace, full: bool) -> Tally {
    let mut tally = Tally::default();
    let mut step = |name: &str, work: &dyn Fn() -> Result<Tally>| {
        println!("== {name}");
        let start = Instant::now();
        let mut done = work().unwrap_or_else(|error| {
            eprintln!("error: {name}: {error:#}");
            Tally::default().closed(false)
        });
        if done.failed > 0 && done.failures.is_empty() {
            done.failures.push(format!("{name}: the runner itself"));
        }
        tally.add(done);
        println!("-- {name}: {} s", start.elapsed().as_secs());
    };
    let needs = if full { ALL_TESTS } else { TESTS };
    step("python environment", &|| environment(workspace, needs).map(|_| Tally::default()));
    let steps = Steps { workspace, full };
    step("rust", &|| steps.rust());
    step("examples", &|| steps.examples());
    step("python", &|| steps.python());
    step("rust files read by python", &|| steps.files_read_by_python());
    if std::env::var("CI").is_ok_and(|ci| ci == "true") && workspace.shared().is_some() {
        tally.demand_shared_data();
    }
    for reason in &tally.reasons {
        println!("{reason}");
    }
    for name in &tally.failures {
        println!("FAILED: {name}");
    }
    tally
}

struct Steps<'a> {
    workspace: &'a Workspace,
    full: bool,
}

impl Steps<'_> {
    /// Unit, integration and doc tests. All targets are built first, so that the tests through the
    /// binary, the examples below and Python find the programs of this very checkout.
    fn rust(&self) -> Result<Tally> {
        cargo(self.workspace, &["build", "--workspace", "--all-targets"]).succeed()?;
        let mut reader = CargoTest::default();
        let arguments = ["test", "--workspace", "--no-fail-fast", "--", "--show-output"];
        let succeeded = self
            .with_settings(cargo(self.workspace, &arguments))?
            .stream(|line| reader.read(line))?;
        Ok(reader.end(succeeded))
    }

    /// The facade's example programs, which must run without arguments; its benchmarks need some.
    fn examples(&self) -> Result<Tally> {
        let mut tally = Tally::default();
        let names = self.workspace.examples("crates/semfm/examples")?;
        for name in names.into_iter().filter(|name| !is_benchmark(name)) {
            println!("example {name}");
            let path = self.workspace.built("debug/examples").join(&name);
            let worked = program(self.workspace, &path, &[]).succeed();
            if let Err(error) = &worked {
                eprintln!("error: {error:#}");
            }
            tally.count(&name, worked.is_ok());
        }
        Ok(tally)
    }

    fn python(&self) -> Result<Tally> {
        let full: &[&str] = if self.full { &["--full"] } else { &[] };
        self.pytest("python/tests", full, None)
    }

    /// Files of every kind, written by Rust, read with Python's own MCAP and protobuf packages.
    fn files_read_by_python(&self) -> Result<Tally> {
        let samples = self.workspace.built("semfm-samples");
        let samples_text = samples.to_str().context("the target folder's name is not UTF-8")?;
        for example in ["write_sample_files", "write_sample_scene"] {
            let writer = self.workspace.built("debug/examples").join(example);
            program(self.workspace, &writer, &[samples_text]).succeed()?;
        }
        self.pytest("crates/semfm-views/tests/check_mcap.py", &[], Some(&samples))
    }

    fn pytest(&self, tests: &str, more: &[&str], samples: Option<&Path>) -> Result<Tally> {
        let python = self.workspace.root.join(".venv/bin/python");
        let arguments = [&["-m", "pytest", "-ra", "--durations=10", tests], more].concat();
        let mut process = self
            .with_settings(program(self.workspace, &python, &arguments))?
            .env("SEMFM_CLI", self.workspace.built("debug/semfm-cli"));
        if let Some(samples) = samples {
            process = process.env("SEMFM_SAMPLES", samples);
        }
        let mut reader = Pytest::default();
        let succeeded = process.stream(|line| reader.read(line))?;
        Ok(reader.end(succeeded))
    }

    /// What every runner is told: whether this is the full run, and that `semfm-embed` is the one in
    /// `.venv`.
    fn with_settings(&self, process: Process) -> Result<Process> {
        let system = std::env::var_os("PATH").unwrap_or_default();
        let ours = [self.workspace.root.join(".venv/bin")];
        let path = std::env::join_paths(ours.into_iter().chain(std::env::split_paths(&system)))?;
        let process = process.env("PATH", path);
        Ok(if self.full { process.env("SEMFM_FULL", "1") } else { process })
    }
}
