//! Twenty published planning problems an arm: which states are free, that all problems are solved, and that the motions
//! keep their limits and touch nothing.
//!
//! MotionBenchMaker (Chamzas et al. 2022), every 35th of 700 problems, unpacked by `bench/planning_problems.py`. All of
//! them, with other programs beside ours: `bench/planning.py`.

#[path = "../examples/problem_pipeline/mod.rs"]
mod problem_pipeline;
#[path = "../examples/problems/mod.rs"]
mod problems;

use std::path::{Path, PathBuf};
use std::process::Command;

use problem_pipeline::{Outcome, Pipeline, Solution};
use problems::{ProblemRobot, Problems};
use semfm::motion::{CollisionChecker, TrajectoryPoint, path_length};

const EVERY: &str = "35";
const N_PROBLEMS: usize = 20;
/// Rounding by which a limit may be passed, as a share.
const ROUNDING: f64 = 1e-9;

/// What pinocchio 4.1.0 with coal 3.0.3 says on the meshes as they are (`bench/planning_problems.py judge`): of these
/// problems every start and goal is free and within limits, and the state halfway between them touches in those named.
struct Expected {
    robot: &'static str,
    halfway_touching: &'static [&'static str],
    /// Mean length of the paths, radians: VAMP publishes 5.2 and 6.8 for all problems, and a tenth more is the goal.
    mean_length: f64,
}

#[test]
fn valid_problems_of_the_panda_are_solved() {
    check(&Expected {
        robot: "panda",
        halfway_touching: &[
            "bookshelf_small_panda/0071",
            "bookshelf_thin_panda/0011",
            "bookshelf_thin_panda/0046",
            "box_panda/0016",
            "box_panda/0086",
            "cage_panda/0021",
            "cage_panda/0056",
            "cage_panda/0091",
            "table_under_pick_panda/0066",
        ],
        mean_length: 5.2 * 1.1,
    });
}

#[test]
fn valid_problems_of_the_ur5_are_solved() {
    check(&Expected {
        robot: "ur5",
        halfway_touching: &[
            "bookshelf_tall_ur5/0041",
            "table_under_pick_ur5/0031",
            "table_under_pick_ur5/0066",
        ],
        mean_length: 6.8 * 1.1,
    });
}

fn check(expected: &Expected) {
    let Some(cache) = unpacked() else { return };
    let folder = cache.path().join(expected.robot);
    let problems = Problems::read(&folder).unwrap();
    assert_eq!(problems.problems.len(), N_PROBLEMS);
    let pipeline = Pipeline::new(&ProblemRobot::read(&folder, &problems).unwrap()).unwrap();
    let path = Problems::path(&folder);
    let (mut halfway_touching, mut lengths) = (Vec::new(), Vec::new());
    for problem in &problems.problems {
        let name = problem.name.as_str();
        let checker = pipeline.checker(problem, &path).unwrap();
        let halves = problem.start.iter().zip(&problem.goal);
        let halfway: Vec<f64> = halves.map(|(start, goal)| 0.5 * (start + goal)).collect();
        if !checker.is_free(&halfway) {
            halfway_touching.push(name);
        }
        match pipeline.solve(problem, &path, 0).unwrap() {
            Outcome::NotFree => panic!("{name}: start or goal touches"),
            Outcome::OutOfLimits => panic!("{name}: start or goal is out of limits"),
            Outcome::NotFound { planned, .. } => panic!("{name}: {planned:?}"),
            Outcome::Solved(solution) => {
                keeps_its_promises(name, &solution, &checker, &pipeline);
                let points = &solution.timed.points;
                assert_eq!(points[0].positions, problem.start, "{name}");
                let end = &points[points.len() - 1].positions;
                assert!(pipeline.space.distance(end, &problem.goal) < 1e-9, "{name}");
                lengths.push(path_length(&solution.short));
            }
        }
    }
    assert_eq!(halfway_touching, expected.halfway_touching);
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    assert!(mean <= expected.mean_length, "{mean} rad");
}

/// At every millisecond the motion is within limits and free; between, no joint goes far enough to pass through anything.
fn keeps_its_promises(
    name: &str,
    solution: &Solution,
    checker: &CollisionChecker,
    pipeline: &Pipeline,
) {
    assert_eq!(solution.violation.as_ref().map(ToString::to_string), None, "{name}");
    for edge in solution.short.windows(2) {
        // A hundredth of a radian apart: the check of motions does not look at these states.
        let n = (path_length(edge) / 0.01).ceil() as usize;
        for i in 0..=n {
            let share = i as f64 / n.max(1) as f64;
            let q: Vec<f64> =
                edge[0].iter().zip(&edge[1]).map(|(a, b)| a + share * (b - a)).collect();
            assert!(checker.is_free(&q), "{name}: {:?}", checker.first_contact(&q));
        }
    }
    let points = &solution.timed.points;
    let duration = points[points.len() - 1].time;
    let mut part = 0;
    for millisecond in 0..=(duration * 1e3).ceil() as usize {
        let time = (millisecond as f64 * 1e-3).min(duration);
        while part + 2 < points.len() && points[part + 1].time < time {
            part += 1;
        }
        let state = cubic(&points[part], &points[part + 1], time);
        pipeline.space.check(name, &state.positions).unwrap();
        for (j, limit) in pipeline.limits.joints().iter().enumerate() {
            let (v, a) = (state.velocities[j].abs(), state.accelerations[j].abs());
            assert!(v <= limit.velocity * (1.0 + ROUNDING), "{name}: {v} rad/s at {time} s");
            assert!(a <= limit.acceleration * (1.0 + ROUNDING), "{name}: {a} rad/s² at {time} s");
        }
        assert!(checker.is_free(&state.positions), "{name}: touching at {time} s");
    }
    let ends = [&points[0], &points[points.len() - 1]];
    assert!(ends.iter().all(|point| point.velocities.iter().all(|&v| v == 0.0)), "{name}");
    assert!(points.windows(2).all(|pair| pair[1].time > pair[0].time), "{name}");
}

/// State of the cubic of positions and velocities (Hermite) between two points: `docs/formats.md` says that a controller
/// follows it, and this is not the code that the planner evaluates it by.
fn cubic(from: &TrajectoryPoint, to: &TrajectoryPoint, time: f64) -> TrajectoryPoint {
    let h = to.time - from.time;
    let s = (time - from.time) / h;
    let mut state = from.clone();
    state.time = time;
    for j in 0..from.positions.len() {
        let (p0, p1) = (from.positions[j], to.positions[j]);
        let (m0, m1) = (h * from.velocities[j], h * to.velocities[j]);
        // p(s) = c0 + c1 s + c2 s² + c3 s³
        let (c2, c3) = (3.0 * (p1 - p0) - 2.0 * m0 - m1, 2.0 * (p0 - p1) + m0 + m1);
        state.positions[j] = p0 + s * (m0 + s * (c2 + s * c3));
        state.velocities[j] = (m0 + s * (2.0 * c2 + s * 3.0 * c3)) / h;
        state.accelerations[j] = (2.0 * c2 + s * 6.0 * c3) / (h * h);
    }
    state
}

/// The problems of both arms; where the data or a Python with numpy and PyYAML is absent, says that the test is skipped.
#[allow(clippy::print_stderr)]
fn unpacked() -> Option<tempfile::TempDir> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shared = std::env::var_os("SEMFM_SHARED").map_or(root.join("../shared"), PathBuf::from);
    let data = shared.join("data/planning/motion_bench_maker");
    if !data.exists() {
        eprintln!("SKIPPED: no shared data at {}; set SEMFM_SHARED", data.display());
        return None;
    }
    let python = || Command::new("python3");
    let can_read = python().args(["-c", "import numpy, yaml"]).output();
    if !can_read.is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: no python3 with numpy and PyYAML, which read the problems");
        return None;
    }
    let cache = tempfile::tempdir().unwrap();
    let output = python()
        .arg(root.join("bench/planning_problems.py"))
        .arg("unpack")
        .args([&data, &cache.path().to_owned()])
        .args(["--every", EVERY])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(cache)
}
