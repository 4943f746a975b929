//! Inverse kinematics: joint values for which the tip is at a pose.
//!
//! From `near`, then from seeded random positions, Levenberg and Marquardt's method goes downhill on what is left between
//! tip and target ([`descent`]). What arrives is turned by whole turns to be nearest to `near`, checked by forward
//! kinematics, and kept if it differs from what was found before.

mod descent;
mod distinct;
mod pose_error;
mod preference;

use std::sync::Arc;

use parry3d_f64::math::Pose;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use self::descent::Descent;
use self::distinct::{differ, nearest_turns};
use self::pose_error::PoseError;
pub use self::preference::Preference;
use super::arm::Arm;
use super::arm_joint::ArmJoint;
use super::chain::Frame;
use crate::{Error, Result};

/// Most solutions and restarts that may be asked for: some seconds.
const MAX_SOLUTIONS: usize = 1_000;
const MAX_RESTARTS: usize = 100_000;

/// Largest joint value and coordinate, radians or metres: beyond, rounding exceeds the tolerances.
const MAX_NUMBER: f64 = 1e6;

/// How inverse kinematics searches and what counts as a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct IkSettings {
    /// Of the random starts: the same seed gives the same answer.
    pub seed: u64,
    /// The search ends after this many random starts in a row that brought no new solution.
    pub restarts: usize,
    /// The search ends when this many distinct solutions are known. An arm like the UR5 has up to eight.
    pub solutions: usize,
    /// Greatest distance between tip and target, metres.
    pub position_tolerance: f64,
    /// Greatest angle between tip and target, radians.
    pub rotation_tolerance: f64,
    /// What an arm with more joints than it needs does with them.
    pub preference: Preference,
}

impl Default for IkSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            restarts: 50,
            solutions: 1,
            position_tolerance: 1e-6,
            rotation_tolerance: 1e-6,
            preference: Preference::default(),
        }
    }
}

/// Inverse kinematics of an arm; cheap to clone.
#[derive(Clone, Debug)]
pub struct InverseKinematics {
    arm: Arc<Arm>,
    settings: IkSettings,
}

/// What inverse kinematics found for a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct IkAnswer {
    /// Distinct solutions, the nearest to `near` first; empty where none was found.
    pub solutions: Vec<IkSolution>,
    /// Where no solution was found, the positions that came closest.
    pub closest: Option<IkSolution>,
    /// Descents that were made.
    pub tries: usize,
}

/// Joint values with what forward kinematics says of them.
#[derive(Clone, Debug, PartialEq)]
pub struct IkSolution {
    /// Radians or metres, one a joint, within limits.
    pub positions: Vec<f64>,
    /// Distance of the tip from the target, metres.
    pub position_error: f64,
    /// Angle between tip and target, radians.
    pub rotation_error: f64,
    /// The greatest difference of a joint from `near`, radians or metres.
    pub distance: f64,
}

impl InverseKinematics {
    /// Inverse kinematics of an arm with settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for more than 1,000 solutions or none, more than 100,000 restarts, and tolerances below
    /// 1e-10.
    pub fn new(arm: Arc<Arm>, settings: IkSettings) -> Result<Self> {
        let out_of_range = |what, expected: &str, found: String| {
            Err(Error::OutOfRange { what, expected: expected.into(), found })
        };
        if !(1..=MAX_SOLUTIONS).contains(&settings.solutions) {
            return out_of_range("solutions", "1 to 1000", settings.solutions.to_string());
        }
        if settings.restarts > MAX_RESTARTS {
            return out_of_range("restarts", "at most 100000", settings.restarts.to_string());
        }
        for (what, tolerance) in [
            ("position_tolerance", settings.position_tolerance),
            ("rotation_tolerance", settings.rotation_tolerance),
        ] {
            // Below, rounding of forward kinematics decides.
            if !(tolerance.is_finite() && tolerance >= 1e-10) {
                return out_of_range(what, "at least 1e-10", tolerance.to_string());
            }
        }
        Ok(Self { arm, settings })
    }

    /// The arm.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.arm
    }

    /// The settings.
    pub fn settings(&self) -> &IkSettings {
        &self.settings
    }

    /// Joint values that bring the tip to a pose in the base's frame. `near`: where the search begins and which
    /// solutions are preferred, one value a joint; values outside of the limits are moved to them.
    ///
    /// # Errors
    /// [`Error::Arm`] for a pose or a `near` that is not finite or beyond a million, and for a wrong number of values.
    /// That no solution was found is no error: [`IkAnswer::solutions`] is empty.
    pub fn solve(&self, base_from_tip: &Pose, near: &[f64]) -> Result<IkAnswer> {
        let target = target(base_from_tip)?;
        let near = self.start(near)?;
        let mut descent = Descent::new(&self.arm, &self.settings);
        let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
        let mut answer = IkAnswer { solutions: Vec::new(), closest: None, tries: 0 };
        let mut q = near.clone();
        let mut in_vain = 0;
        loop {
            answer.tries += 1;
            let arrived = descent.run(&target, &mut q);
            if arrived {
                descent.prefer(self.settings.preference, &target, &near, &mut q);
            }
            nearest_turns(self.arm.joints(), &near, &mut q);
            in_vain = if self.record(&target, &near, &q, &mut answer) { 0 } else { in_vain + 1 };
            if answer.solutions.len() == self.settings.solutions || in_vain > self.settings.restarts
            {
                break;
            }
            random_positions(self.arm.joints(), &mut random, &mut q);
        }
        answer.solutions.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        if !answer.solutions.is_empty() {
            answer.closest = None;
        }
        Ok(answer)
    }

    /// Where the search begins.
    fn start(&self, near: &[f64]) -> Result<Vec<f64>> {
        let joints = self.arm.joints();
        let odd = near.iter().find(|position| position.is_nan() || position.abs() > MAX_NUMBER);
        if near.len() != joints.len() || odd.is_some() {
            let found =
                odd.map_or_else(|| near.len().to_string(), |odd| format!("{odd} among them"));
            return Err(Error::Arm {
                what: "near".into(),
                expected: format!("{} joint values of at most {MAX_NUMBER:e}", joints.len()),
                found,
            });
        }
        Ok(joints.iter().zip(near).map(|(joint, q)| q.clamp(joint.lower, joint.upper)).collect())
    }

    /// Forward kinematics decides: a solution if it is within the tolerances, else perhaps the closest so far. Whether
    /// it is a new solution.
    fn record(&self, target: &Frame, near: &[f64], q: &[f64], answer: &mut IkAnswer) -> bool {
        let error = PoseError::between(&self.arm.chain().tip(q), target);
        let distance = near.iter().zip(q).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        let solution = IkSolution {
            positions: q.to_vec(),
            position_error: error.distance(),
            rotation_error: error.angle(),
            distance,
        };
        if self.is_within_tolerances(&solution) {
            let joints = self.arm.joints();
            match answer.solutions.iter_mut().find(|known| !differ(joints, &known.positions, q)) {
                Some(known) if known.distance > solution.distance => *known = solution,
                Some(_) => {}
                None => {
                    answer.solutions.push(solution);
                    return true;
                }
            }
        } else if answer
            .closest
            .as_ref()
            .is_none_or(|c| self.misses_by(&solution) < self.misses_by(c))
        {
            answer.closest = Some(solution);
        }
        false
    }

    fn is_within_tolerances(&self, solution: &IkSolution) -> bool {
        solution.position_error <= self.settings.position_tolerance
            && solution.rotation_error <= self.settings.rotation_tolerance
    }

    /// Error of a try as one number: a metre counts as a radian.
    fn misses_by(&self, solution: &IkSolution) -> f64 {
        solution.position_error.hypot(solution.rotation_error)
    }
}

/// The target as a rotation matrix and a point, if it is one.
fn target(pose: &Pose) -> Result<Frame> {
    let length = pose.rotation.length();
    let is_near = pose.translation.abs().max_element() <= MAX_NUMBER;
    if pose.is_finite() && is_near && (length - 1.0).abs() < 1e-6 {
        let unit = Pose::from_parts(pose.translation, pose.rotation.normalize());
        return Ok(Frame::from(&unit));
    }
    Err(Error::Arm {
        what: "pose".into(),
        expected: format!("coordinates of at most {MAX_NUMBER:e} and a unit quaternion"),
        found: format!("position {}, quaternion {}", pose.translation, pose.rotation),
    })
}

/// Random positions within limits; of joints that turn further than once, within the one turn around the middle.
fn random_positions(joints: &[ArmJoint], random: &mut ChaCha8Rng, q: &mut [f64]) {
    for (joint, q) in joints.iter().zip(q) {
        let [lower, upper] = joint.sampling_range();
        *q = lower + (upper - lower) * random.random::<f64>();
    }
}
