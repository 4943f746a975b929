//! What is done to a planning problem: plan, shorten, round, time, replay.
#![allow(dead_code)] // The example and the test read different parts of it.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use cpu_time::ThreadTime;
use semfm::motion::{
    BlendSettings, CheckSettings, CollisionChecker, CollisionModel, CollisionSettings, Curve,
    JointMotionLimit, JointRange, JointSpace, MotionLimits, PlanSettings, Planned, PlannedPath,
    RetimeSettings, Retimed, ShortenSettings, Violation, blend, check_trajectory, plan_path,
    retime, shorten,
};

use crate::problems::{Problem, ProblemRobot};

/// Distance that plans keep from obstacles, metres; where the start or the goal is nearer, they keep the checker's own.
const MARGIN: f64 = 2e-3;

/// What all problems of a robot share.
pub struct Pipeline {
    pub space: JointSpace,
    pub limits: MotionLimits,
    /// By its own contact distance, and by [`MARGIN`].
    models: [Arc<CollisionModel>; 2],
}

/// What became of a problem.
pub enum Outcome {
    /// The start or the goal is out of limits.
    OutOfLimits,
    /// Something touches at the start or the goal.
    NotFree,
    NotFound {
        planned: Planned,
        ms: Milliseconds,
    },
    Solved(Box<Solution>),
}

pub struct Solution {
    /// Start or goal is nearer to something than [`MARGIN`].
    pub near: bool,
    pub found: PlannedPath,
    pub short: Vec<Vec<f64>>,
    pub curve: Curve,
    pub timed: Retimed,
    pub violation: Option<Violation>,
    pub ms: Milliseconds,
}

/// Stages by name with their times on a processor.
pub type Milliseconds = Vec<(&'static str, f64)>;

impl Pipeline {
    pub fn new(robot: &ProblemRobot) -> Result<Self, Box<dyn Error>> {
        let joints = robot.arm.joints();
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
            space: JointSpace::new(joints.iter().map(range).collect())?,
            limits: MotionLimits::new(joints.iter().map(limit).collect())?,
            models: [model(CollisionSettings::default().contact)?, model(MARGIN)?],
        })
    }

    /// The checker of a problem's scene, by the contact distance of the robot's own.
    pub fn checker(
        &self,
        problem: &Problem,
        path: &Path,
    ) -> Result<CollisionChecker, Box<dyn Error>> {
        let scene = problem.scene.contents(path)?.scene;
        Ok(CollisionChecker::new(self.models[0].clone(), scene)?)
    }

    /// Solves a problem of the file at `path`.
    pub fn solve(
        &self,
        problem: &Problem,
        path: &Path,
        seed: u64,
    ) -> Result<Outcome, Box<dyn Error>> {
        let exact = self.checker(problem, path)?;
        let [start, goal] = [&problem.start, &problem.goal];
        if [start, goal].iter().any(|q| self.space.check("state", q).is_err()) {
            return Ok(Outcome::OutOfLimits);
        }
        if !exact.is_free(start) || !exact.is_free(goal) {
            return Ok(Outcome::NotFree);
        }
        let wide = exact.with_model(self.models[1].clone())?;
        let near = !wide.is_free(start) || !wide.is_free(goal);
        let checker = if near { &exact } else { &wide };

        let mut ms = Milliseconds::new();
        let settings = PlanSettings { seed, ..Default::default() };
        let planned = timed(&mut ms, "plan", || {
            plan_path(&self.space, checker, start, std::slice::from_ref(goal), &settings)
        })?;
        let Planned::Path(found) = planned else {
            return Ok(Outcome::NotFound { planned, ms });
        };
        let settings = ShortenSettings { seed, ..Default::default() };
        let short = timed(&mut ms, "shorten", || shorten(checker, &found.waypoints, &settings));
        let curve = timed(&mut ms, "blend", || blend(checker, &short, &BlendSettings::default()))?;
        let settings = RetimeSettings::default();
        let motion = timed(&mut ms, "retime", || retime(&curve, &self.limits, 0.0, &settings))?;
        let settings = CheckSettings::default();
        let violation = timed(&mut ms, "check", || {
            check_trajectory(&self.space, &exact, &self.limits, &motion.points, &settings)
        })?;
        let solution = Solution { near, found, short, curve, timed: motion, violation, ms };
        Ok(Outcome::Solved(Box::new(solution)))
    }
}

/// Times `work` by the CPU time of this thread.
fn timed<T>(ms: &mut Milliseconds, stage: &'static str, work: impl FnOnce() -> T) -> T {
    let start = ThreadTime::now();
    let answer = work();
    ms.push((stage, 1e3 * start.elapsed().as_secs_f64()));
    answer
}
