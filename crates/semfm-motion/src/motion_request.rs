//! What is asked of the planner, and what it answers.

use semfm_geom::math::DVec3;

use crate::cartesian::LineSettings;
use crate::gates::{GateCount, GraspOutcome, gate_table};
use crate::planning::{BlendSettings, Contact, PlanSettings, ShortenSettings};
use crate::{
    CollisionBody, Error, Gate, Hand, Obstruction, Pose, Result, Scene, TargetGrasp, Trajectory,
};

/// A motion that is wanted: take the object by one of the grasps and lift it. Everything stands in the frame of the
/// arm's base, metres.
#[derive(Clone, Debug)]
pub struct MotionRequest {
    /// Joint values at the start, one a joint of the arm.
    pub start: Vec<f64>,
    /// The hand at the arm's tip. Without parts only the robot's own links are checked.
    pub hand: Hand,
    /// The grasps, best first.
    pub grasps: Vec<TargetGrasp>,
    /// What is grasped; `None` where its shape is not known: then nothing keeps the arm away from it.
    pub object: Option<TargetObject>,
    /// What else stands there.
    pub scene: Scene,
    /// How it is done.
    pub settings: MotionSettings,
}

/// What is grasped.
#[derive(Clone, Debug)]
pub struct TargetObject {
    /// Its shape.
    pub body: CollisionBody,
    /// Where it stands.
    pub base_from_object: Pose,
}

/// How a motion is made. The default suits arms of about a metre.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSettings {
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// Length of the straight way to the grasp, metres.
    pub approach: f64,
    /// The straight way of the hand after it has closed, metres.
    pub lift: DVec3,
    /// Joint values wanted for each turn of the hand at a grasp.
    pub solutions: usize,
    /// Random starts of inverse kinematics for each turn of the hand at a grasp.
    pub restarts: usize,
    /// How close straight lines are followed.
    pub line: LineSettings,
    /// Grasps for which a path is searched at most; those after them are not tried any further.
    pub searches: usize,
    /// Most iterations of each search.
    pub iterations: usize,
    /// Farthest that corners of the path are cut, radians or metres of any joint.
    pub tube: f64,
    /// Share of the joints' velocity and acceleration limits that is used, above 0 and at most 1.
    pub speed: f64,
    /// The same for straight lines.
    pub line_speed: f64,
    /// Seconds in which the fingers close.
    pub close_seconds: f64,
    /// Seconds between the states at which the finished trajectory is looked at again.
    pub replay_step: f64,
}

impl Default for MotionSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            approach: 0.1,
            lift: DVec3::new(0.0, 0.0, 0.1),
            solutions: 8,
            restarts: 50,
            line: LineSettings::default(),
            searches: 8,
            iterations: PlanSettings::default().iterations,
            tube: BlendSettings::default().tube,
            speed: 1.0,
            line_speed: 0.5,
            close_seconds: 1.0,
            replay_step: 1e-3,
        }
    }
}

impl MotionSettings {
    /// Checks numbers that come from outside.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the first that is not what it should be.
    pub fn check(&self) -> Result<()> {
        let invalid = |what: &str, expected: &str, found: String| {
            Err(Error::Invalid { what: what.into(), expected: expected.into(), found })
        };
        let is_length = |x: f64| (0.0..=MAX_LINE).contains(&x);
        if !is_length(self.approach) {
            let expected = "a length from 0 to 2 m";
            return invalid("approach", expected, self.approach.to_string());
        }
        if !(self.lift.is_finite() && is_length(self.lift.length())) {
            return invalid("lift", "a way of at most 2 m", self.lift.to_string());
        }
        for (what, share) in [("speed", self.speed), ("line_speed", self.line_speed)] {
            if !(share > 0.0 && share <= 1.0) {
                return invalid(what, "a share above 0 and at most 1", share.to_string());
            }
        }
        for (what, count) in [("solutions", self.solutions), ("searches", self.searches)] {
            if count == 0 {
                return invalid(what, "at least 1", "0".into());
            }
        }
        let lengths = [
            ("line.tolerance", self.line.tolerance),
            ("line.rotation_tolerance", self.line.rotation_tolerance),
            ("line.longest_step", self.line.longest_step),
            ("line.shortest_step", self.line.shortest_step),
            ("tube", self.tube),
            ("close_seconds", self.close_seconds),
            ("replay_step", self.replay_step),
        ];
        for (what, number) in lengths {
            if !(number >= 1e-6 && number.is_finite()) {
                return invalid(what, "a number of at least 1e-6", number.to_string());
            }
        }
        Ok(())
    }

    pub(crate) fn plan(&self) -> PlanSettings {
        let defaults = PlanSettings::default();
        PlanSettings { seed: self.seed, iterations: self.iterations, ..defaults }
    }

    pub(crate) fn shorten(&self) -> ShortenSettings {
        ShortenSettings { seed: self.seed, ..Default::default() }
    }
}

/// Longest straight line, metres.
const MAX_LINE: f64 = 2.0;

/// What the planner found.
#[derive(Clone, Debug, Default)]
pub struct MotionAnswer {
    /// The motion, where there is one.
    pub motion: Option<GraspMotion>,
    /// What became of each grasp, in the order of the request.
    pub outcomes: Vec<GraspOutcome>,
    /// Where the start itself touches something.
    pub start_contact: Option<StartContact>,
    /// Of the ways that were stopped the one that came farthest, the first of those in rank.
    pub nearest_miss: Option<NearestMiss>,
}

/// A way to take a grasp that was stopped.
#[derive(Clone, Debug)]
pub struct NearestMiss {
    /// Which grasp: its place in the request, from 0.
    pub grasp: usize,
    /// The grasp, perhaps turned half way round its approach axis.
    pub target: TargetGrasp,
    /// The gate that was not passed.
    pub gate: Gate,
    /// Why.
    pub obstruction: Obstruction,
    /// Joint values where it ends: those that touch, or the best try at the grasp.
    pub positions: Vec<f64>,
}

/// A motion that carries out one of the grasps.
#[derive(Clone, Debug)]
pub struct GraspMotion {
    /// Which grasp: its place in the request, from 0.
    pub grasp: usize,
    /// The grasp as it is carried out: perhaps turned half way round its approach axis.
    pub target: TargetGrasp,
    /// How the arm moves.
    pub trajectory: Trajectory,
    /// How many states of it were looked at again.
    pub n_replayed: usize,
}

/// The start touches something.
#[derive(Clone, Debug, PartialEq)]
pub struct StartContact {
    /// The two things that are deepest in each other.
    pub contact: Contact,
    /// The nearest free joint values that were found.
    pub nearest_free: Option<Vec<f64>>,
}

impl MotionAnswer {
    /// What became of the grasps that did not become the motion: one row a gate.
    pub fn gates(&self) -> Vec<GateCount> {
        gate_table(&self.outcomes)
    }
}
