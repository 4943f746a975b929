//! Plans, shortens, rounds, times and replays planning problems, each on one thread.
//!
//! `plan_problems FOLDER OUT [--every N] [--seed S]` reads what `bench/planning_problems.py unpack` wrote and writes one line
//! of JSON a problem to OUT, for `bench/planning.py`. What was counted goes to stderr.

mod problems;

use std::error::Error;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use problems::{Problem, ProblemRobot, Problems};
use semfm::motion::{
    BlendSettings, CheckSettings, CollisionChecker, CollisionModel, CollisionSettings, Curve,
    JointMotionLimit, JointRange, JointSpace, MotionLimits, PlanSettings, Planned, RetimeSettings,
    Retimed, ShortenSettings, blend, check_trajectory, path_length, plan_path, retime, shorten,
};
use serde_json::{Value, json};

/// Distance that plans keep from obstacles, metres; where the start or the goal is nearer, they keep the checker's own.
const MARGIN: f64 = 2e-3;

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

/// What all problems of a robot share.
struct Planner {
    space: JointSpace,
    limits: MotionLimits,
    /// By its own contact distance, and by [`MARGIN`].
    models: [Arc<CollisionModel>; 2],
    seed: u64,
}

impl Planner {
    fn new(robot: &ProblemRobot, seed: u64) -> Result<Self, Box<dyn Error>> {
        let arm = &robot.arm;
        let range = |joint: &semfm::robot::ArmJoint| JointRange {
            name: joint.name.clone(),
            lower: joint.lower,
            upper: joint.upper,
        };
        let limit = |joint: &semfm::robot::ArmJoint| JointMotionLimit {
            name: joint.name.clone(),
            velocity: joint.velocity,
            acceleration: joint.acceleration,
            jerk: joint.jerk,
        };
        let model = |contact: f64| robot.model(contact).map(Arc::new);
        Ok(Self {
            space: JointSpace::new(arm.joints().iter().map(range).collect())?,
            limits: MotionLimits::new(arm.joints().iter().map(limit).collect())?,
            models: [model(CollisionSettings::default().contact)?, model(MARGIN)?],
            seed,
        })
    }

    fn solve(&self, problem: &Problem, path: &Path) -> Result<Value, Box<dyn Error>> {
        let scene = problem.scene.contents(path)?.scene;
        let exact = CollisionChecker::new(self.models[0].clone(), scene)?;
        let [start, goal] = [&problem.start, &problem.goal];
        let within = [start, goal].iter().all(|q| self.space.check("state", q).is_ok());
        if !within {
            return Ok(json!({ "problem": problem.name, "outcome": "out of limits" }));
        }
        if !exact.is_free(start) || !exact.is_free(goal) {
            return Ok(json!({ "problem": problem.name, "outcome": "not free" }));
        }
        let wide = exact.with_model(self.models[1].clone())?;
        let near = !wide.is_free(start) || !wide.is_free(goal);
        let checker = if near { &exact } else { &wide };

        let mut clock = Clock::default();
        let settings = PlanSettings { seed: self.seed, ..Default::default() };
        let planned = clock.time("plan", || {
            plan_path(&self.space, checker, start, std::slice::from_ref(goal), &settings)
        })?;
        let Planned::Path(found) = planned else {
            return Ok(
                json!({ "problem": problem.name, "outcome": format!("{planned:?}"), "ms": clock.parts }),
            );
        };
        let settings = ShortenSettings { seed: self.seed, ..Default::default() };
        let short = clock.time("shorten", || shorten(checker, &found.waypoints, &settings));
        let curve = clock.time("blend", || blend(checker, &short, &BlendSettings::default()))?;
        let timed = clock
            .time("retime", || retime(&curve, &self.limits, 0.0, &RetimeSettings::default()))?;
        let settings = CheckSettings::default();
        let violation = clock.time("check", || {
            check_trajectory(&self.space, &exact, &self.limits, &timed.points, &settings)
        })?;
        Ok(json!({
            "problem": problem.name,
            "outcome": "path",
            "near": near,
            "ms": clock.parts,
            "iterations": found.iterations,
            "n_nodes": found.n_nodes,
            "found_length": found.length(),
            "length": path_length(&short),
            "curve": curve_json(&curve),
            "trajectory": trajectory_json(&timed),
            "violation": violation.map(|violation| violation.to_string()),
        }))
    }
}

/// Milliseconds of each stage.
#[derive(Default)]
struct Clock {
    parts: serde_json::Map<String, Value>,
}

impl Clock {
    fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let answer = work();
        self.parts.insert(stage.into(), json!(1e3 * begun.elapsed().as_secs_f64()));
        answer
    }
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
    let arguments = arguments()?;
    let path = Problems::path(&arguments.folder);
    let content = Problems::read(&arguments.folder)?;
    let robot = ProblemRobot::read(&arguments.folder, &content)?;
    let planner = Planner::new(&robot, arguments.seed)?;
    let mut out = BufWriter::new(std::fs::File::create(&arguments.out)?);
    let limits: Vec<[f64; 2]> =
        planner.limits.joints().iter().map(|joint| [joint.velocity, joint.acceleration]).collect();
    writeln!(
        out,
        "{}",
        json!({ "limits": limits, "seed": arguments.seed, "every": arguments.every })
    )?;
    let mut counts = std::collections::BTreeMap::<String, usize>::new();
    for problem in content.problems.iter().step_by(arguments.every) {
        let answer = planner.solve(problem, &path)?;
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
