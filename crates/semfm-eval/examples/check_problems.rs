//! Which starts and goals of planning problems, and states halfway between them, are free, and how long a look takes.
//!
//! `check_problems FOLDER` reads what `bench/planning_problems.py unpack` wrote and prints one line of JSON a state:
//! `{"problem": …, "state": "start", "free": …, "contacts": [[a, b, depth], …]}`. Times go to stderr.

mod problems;

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use problems::{ProblemRobot, Problems};
use semfm::motion::{CollisionChecker, CollisionSettings};

#[allow(clippy::print_stdout, clippy::print_stderr)] // The answers are what this program is for.
fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("the folder of a robot is missing")?);
    let content = Problems::read(&folder)?;
    let robot = ProblemRobot::read(&folder, &content)?;
    let begun = Instant::now();
    let model = robot.model(CollisionSettings::default().contact)?;
    eprintln!(
        "model: {:.2} s, {} pairs",
        begun.elapsed().as_secs_f64(),
        model.checked_pairs().len()
    );
    for (name, body) in model.bodies() {
        eprintln!("  {name}: {} pieces, {} spheres", body.n_pieces(), body.n_spheres());
    }
    model.notes().iter().for_each(|note| eprintln!("  {note}"));
    let model = Arc::new(model);
    let mut times = Times::default();
    for problem in &content.problems {
        let scene = problem.scene.contents(&Problems::path(&folder))?.scene;
        let checker = CollisionChecker::new(model.clone(), scene)?;
        let halves = problem.start.iter().zip(&problem.goal);
        let middle: Vec<f64> = halves.map(|(a, b)| (a + b) / 2.0).collect();
        for (state, q) in [("start", &problem.start), ("goal", &problem.goal), ("middle", &middle)]
        {
            let contacts: Vec<_> = checker
                .contacts(q)
                .into_iter()
                .map(|contact| serde_json::json!([contact.a, contact.b, contact.depth]))
                .collect();
            let free = checker.is_free(q);
            let line = serde_json::json!({
                "problem": problem.name, "state": state, "free": free, "contacts": contacts,
            });
            println!("{line}");
        }
        times.measure(&checker, &problem.start, &problem.goal);
    }
    times.print();
    Ok(())
}

fn add(total: &mut (f64, u32), seconds: f64) {
    total.0 += seconds;
    total.1 += 1;
}

/// The answer, and the least seconds of five runs: other programs disturb some.
fn best_of<T>(work: impl Fn() -> T) -> (T, f64) {
    let run = || {
        let begun = Instant::now();
        let answer = std::hint::black_box(work());
        (answer, begun.elapsed().as_secs_f64())
    };
    let first = run();
    (1..5).map(|_| run()).fold(first, |best, next| if next.1 < best.1 { next } else { best })
}

/// Seconds and counts of looks on the straight way from start to goal.
#[derive(Default)]
struct Times {
    free: (f64, u32),
    touching: (f64, u32),
    clearance: (f64, u32),
    motion_free: (f64, u32),
    motion_touching: (f64, u32),
}

impl Times {
    fn measure(&mut self, checker: &CollisionChecker, start: &[f64], goal: &[f64]) {
        const N: u32 = 20;
        let at = |share: f64| -> Vec<f64> {
            start.iter().zip(goal).map(|(a, b)| a + share * (b - a)).collect()
        };
        let states: Vec<Vec<f64>> = (0..=N).map(|i| at(f64::from(i) / f64::from(N))).collect();
        for pair in states.windows(2) {
            let (is_free, seconds) = best_of(|| checker.is_free(&pair[0]));
            add(if is_free { &mut self.free } else { &mut self.touching }, seconds);
            let (_, seconds) = best_of(|| checker.clearance(&pair[0]));
            add(&mut self.clearance, seconds);
            let (is_free, seconds) = best_of(|| checker.motion_is_free(&pair[0], &pair[1]));
            let total = if is_free { &mut self.motion_free } else { &mut self.motion_touching };
            add(total, seconds);
        }
    }

    #[allow(clippy::print_stderr)]
    fn print(&self) {
        for (what, (seconds, n)) in [
            ("is_free, free", self.free),
            ("is_free, touching", self.touching),
            ("clearance", self.clearance),
            ("motion_is_free on a 20th of the way, free", self.motion_free),
            ("motion_is_free on a 20th of the way, touching", self.motion_touching),
        ] {
            eprintln!("{what}: {:.2} us mean of {n}", 1e6 * seconds / f64::from(n.max(1)));
        }
    }
}
