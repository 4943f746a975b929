//! One subcommand for each job of the CI; `cargo xtask` without a word lists them.
//!
//! All jobs build the whole workspace with one profile and one selection of packages: any other
//! selection changes the features of shared dependencies, and cargo would build them again.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that talks to a shell")]

#[cfg(test)]
mod docs;
mod duplicates;
mod features;
mod package;
mod peers;
mod pictures;
mod process;
mod python;
mod tally;
mod test;
mod wheel;
mod workspace;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, bail};

use crate::process::cargo;
use crate::tally::Tally;
use crate::workspace::{Workspace, is_benchmark};

const USAGE: &str = "\
cargo xtask test [--full]   every test, Rust and Python; --full adds the encoders on PyTorch
cargo xtask fmt             formatting, without changing anything
cargo xtask lint            clippy on all targets, warnings are errors
cargo xtask doc             the documentation, warnings are errors
cargo xtask features        the facade without its default features
cargo xtask package         every crate packed as for crates.io, and compiled from what was packed
cargo xtask deny            one version of each crate whose types cross our borders
cargo xtask corpus          the readers against the corpus of bad files, where it is at hand
cargo xtask stubs           writes the type stubs of the Python package anew
cargo xtask wheel           builds the wheel (release) and checks its size and how fast it imports
cargo xtask pictures        makes the README's pictures anew, in a browser where there is one
cargo xtask bench           builds the benchmark programs (release) and names them
cargo xtask bench peers     runs those beside other libraries, in an environment made for them (hours)
cargo xtask ci              fmt, deny, lint, doc, features, package, then test --full";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match run(&words) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the job passed; an error where it could not be done at all.
fn run(words: &[&str]) -> Result<bool> {
    let workspace = Workspace::find()?;
    match words {
        [] | ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            Ok(true)
        }
        ["test"] => Ok(end_with(&test::run(&workspace, false))),
        ["test", "--full"] => Ok(end_with(&test::run(&workspace, true))),
        ["ci"] => Ok(ci(&workspace)),
        ["bench", "peers"] => peers::run(&workspace).map(|()| true),
        [job] => match JOBS.iter().find(|(name, _)| name == job) {
            Some((_, work)) => work(&workspace).map(|()| true),
            None => bail!("no job `{job}`\n{USAGE}"),
        },
        _ => bail!("cannot read `{}`\n{USAGE}", words.join(" ")),
    }
}

type Job = fn(&Workspace) -> Result<()>;

const JOBS: [(&str, Job); 11] = [
    ("fmt", |workspace| cargo(workspace, &["fmt", "--all", "--check"]).succeed()),
    ("lint", |workspace| {
        let arguments = ["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"];
        cargo(workspace, &arguments).succeed()
    }),
    ("doc", |workspace| {
        cargo(workspace, &["doc", "--workspace", "--no-deps"])
            .env("RUSTDOCFLAGS", "-D warnings")
            .succeed()
    }),
    ("features", features::check),
    ("package", package::check),
    ("deny", duplicates::check),
    ("corpus", |workspace| {
        let arguments = ["test", "--workspace", "--test", "corpus*", "--", "--show-output"];
        cargo(workspace, &arguments).succeed()
    }),
    ("stubs", python::stubs),
    ("wheel", wheel::check),
    ("bench", bench),
    ("pictures", pictures::make),
];

/// What CI runs before the tests, cheapest first.
const BEFORE_TESTS: [&str; 6] = ["fmt", "deny", "lint", "doc", "features", "package"];

/// All jobs, the tests last so that their summary is the last line; a failed job stops no other.
fn ci(workspace: &Workspace) -> bool {
    let failed = std::thread::scope(|scope| {
        // Gigabytes to fetch, which the network can do while cargo builds.
        let packages = scope.spawn(|| python::groups(workspace, python::ALL_TESTS));
        let failed = before_tests(workspace);
        match packages.join() {
            Ok(Ok(())) => {}
            // The tests' first step tries once more, and counts.
            Ok(Err(error)) => eprintln!("Python's packages: {error:#}"),
            Err(_) => eprintln!("Python's packages: the installing thread stopped"),
        }
        failed
    });
    println!("== test --full");
    let tally = test::run(workspace, true);
    if !failed.is_empty() {
        println!("failed before the tests: {}", failed.join(", "));
    }
    end_with(&tally) && failed.is_empty()
}

/// Names of the jobs before the tests that failed.
fn before_tests(workspace: &Workspace) -> Vec<&'static str> {
    let mut failed = Vec::new();
    let jobs = BEFORE_TESTS.iter().filter_map(|name| JOBS.iter().find(|(job, _)| job == name));
    for (name, work) in jobs {
        println!("== {name}");
        let start = Instant::now();
        if let Err(error) = work(workspace) {
            eprintln!("error: {name}: {error:#}");
            failed.push(*name);
        }
        println!("-- {name}: {} s", start.elapsed().as_secs());
    }
    failed
}

/// Prints the summary, last of all, and says whether everything passed.
fn end_with(tally: &Tally) -> bool {
    println!("{tally}");
    tally.failed == 0 && tally.passed > 0
}

fn bench(workspace: &Workspace) -> Result<()> {
    cargo(workspace, &["build", "--release", "--workspace", "--examples"]).succeed()?;
    println!("built, each says how it is called:");
    for program in workspace.examples("crates/*/examples")? {
        if is_benchmark(&program) {
            println!("  {}", workspace.built("release/examples").join(program).display());
        }
    }
    Ok(())
}
