//! Plans, shortens, rounds, times and replays planning problems, each on one thread.
//!
//! `plan_problems FOLDER OUT [--every N] [--seed S]` reads what `bench/planning_problems.py unpack` wrote and writes one line
//! of JSON a problem to OUT, for `bench/planning.py`. What was counted goes to stderr.

mod problem_pipeline;
mod problems;

use std::error::Error;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use problem_pipeline::{Milliseconds, Outcome, Pipeline, Solution};
use problems::{Problem, ProblemRobot, Problems};
use semfm::motion::{Curve, Retimed, path_length};
use serde_json::{Map, Value, json};

struct Arguments {
    folder: PathBuf,
    out: PathBuf,
    every: usize,
    seed: u64,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let mut paths = Vec::new();
    let (mut every, mut seed) = (1, 0);
    while let Some(word) = words.next() {
        let mut number = || words.next().ok_or(format!("{word} needs a number"));
        match word.as_str() {
            "--every" => every = number()?.parse()?,
            "--seed" => seed = number()?.parse()?,
            _ => paths.push(PathBuf::from(word)),
        }
    }
    let [folder, out] = <[PathBuf; 2]>::try_from(paths)
        .map_err(|_| "expected FOLDER OUT [--every N] [--seed S]")?;
    Ok(Arguments { folder, out, every, seed })
}

fn outcome_json(problem: &Problem, outcome: &Outcome) -> Value {
    let name = &problem.name;
    match outcome {
        Outcome::OutOfLimits => json!({ "problem": name, "outcome": "out of limits" }),
        Outcome::NotFree => json!({ "problem": name, "outcome": "not free" }),
        Outcome::NotFound { planned, ms } => {
            json!({ "problem": name, "outcome": format!("{planned:?}"), "ms": stages_json(ms) })
        }
        Outcome::Solved(solution) => {
            let Solution { near, found, short, curve, timed, violation, ms } = &**solution;
            json!({
                "problem": name,
                "outcome": "path",
                "near": near,
                "ms": stages_json(ms),
                "iterations": found.iterations,
                "n_nodes": found.n_nodes,
                "found_length": found.length(),
                "length": path_length(short),
                "curve": curve_json(curve),
                "trajectory": trajectory_json(timed),
                "violation": violation.as_ref().map(ToString::to_string),
            })
        }
    }
}

fn stages_json(ms: &Milliseconds) -> Map<String, Value> {
    ms.iter().map(|&(stage, ms)| (stage.to_owned(), json!(ms))).collect()
}

fn curve_json(curve: &Curve) -> Value {
    let pieces: Vec<Value> = curve
        .coefficients()
        .into_iter()
        .map(|piece| {
            json!({ "start": piece.start, "value": piece.value, "slope": piece.slope, "curvature": piece.curvature })
        })
        .collect();
    json!({ "length": curve.length(), "n_stops": curve.stops().len(), "pieces": pieces })
}

fn trajectory_json(timed: &Retimed) -> Value {
    let points: Vec<Value> = timed
        .points
        .iter()
        .map(|point| json!([point.time, point.positions, point.velocities]))
        .collect();
    json!({ "fastest": timed.fastest, "duration": timed.duration(), "deviation": timed.deviation, "points": points })
}

#[allow(clippy::print_stderr)] // The answers are what this program is for.
fn main() -> Result<(), Box<dyn Error>> {
    let Arguments { folder, out, every, seed } = arguments()?;
    let path = Problems::path(&folder);
    let content = Problems::read(&folder)?;
    let robot = ProblemRobot::read(&folder, &content)?;
    let pipeline = Pipeline::new(&robot)?;
    let mut out = BufWriter::new(std::fs::File::create(&out)?);
    let limits: Vec<[f64; 2]> =
        pipeline.limits.joints().iter().map(|joint| [joint.velocity, joint.acceleration]).collect();
    writeln!(out, "{}", json!({ "limits": limits, "seed": seed, "every": every }))?;
    let mut counts = std::collections::BTreeMap::<String, usize>::new();
    for problem in content.problems.iter().step_by(every) {
        let answer = outcome_json(problem, &pipeline.solve(problem, &path, seed)?);
        let outcome = answer["outcome"].as_str().unwrap_or_default();
        let violated = if answer["violation"].is_string() { ", violated" } else { "" };
        *counts.entry(format!("{outcome}{violated}")).or_default() += 1;
        writeln!(out, "{answer}")?;
    }
    out.flush()?;
    for (outcome, count) in counts {
        eprintln!("{outcome}: {count}");
    }
    Ok(())
}
