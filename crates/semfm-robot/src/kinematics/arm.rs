//! An arm: the joints between a base and a tip, with limits and kinematics on flat arrays.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::suggestion::unknown_name;

use super::arm_joint::{ArmJoint, DEFAULT_ACCELERATION, DEFAULT_VELOCITY};
use super::chain::{Chain, Follows};
use super::cholesky;
use super::ends;
use crate::joint_limits_file::JointLimitsFile;
use crate::robot::Robot;
use crate::{Error, Result};

/// By how much a position may pass a limit and still count as within, radians or metres: files round their numbers.
const LIMIT_SLACK: f64 = 1e-9;

/// Most joints of an arm: arrays grow with their square.
const MAX_JOINTS: usize = 100;

/// What a description does not say. The default finds base and tip by itself.
#[derive(Clone, Debug, Default)]
pub struct ArmSettings {
    /// The link in whose frame poses are told, on the way to the tip or fixed to a link there; by default the root.
    pub base: Option<String>,
    /// The link that the arm moves; by default the end of the one chain of joints from the base, a frame that is named
    /// as such (`tool0`, `flange`, …) where there is one.
    pub tip: Option<String>,
    /// Limits that take the place of the description's, and accelerations, which it cannot tell.
    pub limits: Option<JointLimitsFile>,
    /// Positions of joints outside the chain by name, such as fingers; others stand at zero, or at the limit next to it.
    pub fixed: Vec<(String, f64)>,
}

/// A serial chain of a robot's joints from a base link to a tip link. A list of joint values holds one number for each
/// of [`Arm::joints`]: radians or metres. Poses are told in the base link's frame.
#[derive(Clone, Debug)]
pub struct Arm {
    robot: Arc<Robot>,
    base: usize,
    tip: usize,
    joints: Vec<ArmJoint>,
    /// One for each joint of the robot.
    follows: Vec<Follows>,
    chain: Chain,
    notes: Vec<String>,
}

impl Arm {
    /// The arm between two links of a robot.
    ///
    /// # Errors
    /// [`Error::Arm`] for names of links or joints that the robot does not have; where no tip is given and there is no
    /// arm, or several; where joints do not lead from base to tip, or one of them moves freely; for limits that are
    /// crossed; and for a fixed position of a joint that the arm moves.
    pub fn new(robot: Arc<Robot>, settings: &ArmSettings) -> Result<Self> {
        let ends = ends::find(&robot, settings.base.as_deref(), settings.tip.as_deref())?;
        let mut notes = ends.notes;
        let variables = variables(&robot, &ends.path);
        if !(1..=MAX_JOINTS).contains(&variables.len()) {
            let [base, tip] = [ends.base, ends.tip].map(|link| &robot.links[link].name);
            return Err(Error::Arm {
                what: format!("chain from `{base}` to `{tip}`"),
                expected: format!("1 to {MAX_JOINTS} joints that move"),
                found: variables.len().to_string(),
            });
        }
        let positions = fixed_positions(&robot, &variables, &settings.fixed)?;
        let follows = follows(&robot, &variables, &positions);
        let joints = joints(&robot, &variables, settings.limits.as_ref(), &mut notes)?;
        let chain = Chain::new(&robot, ends.base_from_start, &ends.path, &follows);
        Ok(Self { base: ends.base, tip: ends.tip, joints, follows, chain, notes, robot })
    }

    /// The robot that it is part of.
    pub fn robot(&self) -> &Arc<Robot> {
        &self.robot
    }

    /// The link in whose frame poses are told.
    pub fn base(&self) -> usize {
        self.base
    }

    /// The link that it moves.
    pub fn tip(&self) -> usize {
        self.tip
    }

    /// Its joints, base to tip: the order of every list of joint values.
    pub fn joints(&self) -> &[ArmJoint] {
        &self.joints
    }

    /// Number of joints.
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// What was found or assumed, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The chain for kinematics of this crate.
    pub(crate) fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Where the tip is. `q`: one value a joint, not checked against limits.
    ///
    /// # Panics
    /// Where `q` is shorter than the list of joints.
    pub fn base_from_tip(&self, q: &[f64]) -> Pose {
        self.chain.tip(q).pose()
    }

    /// Where every link of the robot is; joints outside the chain stand where the settings put them, mimics follow.
    /// `base_from_link` is made as long as the list of links, so that a caller may use it again.
    ///
    /// # Panics
    /// Where `q` is shorter than the list of joints.
    pub fn link_poses(&self, q: &[f64], base_from_link: &mut Vec<Pose>) {
        base_from_link.clear();
        base_from_link.resize(self.robot.links.len(), Pose::IDENTITY);
        // First in the root's frame.
        for (joint, follows) in self.robot.joints.iter().zip(&self.follows) {
            base_from_link[joint.child] = base_from_link[joint.parent]
                * joint.parent_from_joint
                * joint.motion(follows.position(q));
        }
        if self.base != self.robot.root {
            let base_from_root = base_from_link[self.base].inverse();
            base_from_link.iter_mut().for_each(|pose| *pose = base_from_root * *pose);
        }
    }

    /// How fast the tip moves for each joint: `jacobian` (6 × n, row-major), linear above angular velocity of the tip's
    /// frame, in the base's frame.
    ///
    /// # Panics
    /// Where `q` is shorter than the list of joints or `jacobian` has not 6 × n numbers.
    pub fn jacobian(&self, q: &[f64], jacobian: &mut [f64]) {
        assert_eq!(jacobian.len(), 6 * self.n_joints(), "6 × n numbers");
        self.chain.tip_with_jacobian(&q[..self.n_joints()], jacobian);
    }

    /// How easily the tip moves in every direction: the product of the Jacobian's singular values, m³ for six joints
    /// and more; zero at a singular position.
    ///
    /// > √det(J Jᵀ), or √det(Jᵀ J) for fewer than six joints
    ///
    /// Yoshikawa 1985, "Manipulability of robotic mechanisms", eq. 6.
    ///
    /// # Panics
    /// Where `q` is shorter than the list of joints.
    pub fn manipulability(&self, q: &[f64]) -> f64 {
        let n = self.n_joints();
        let mut jacobian = vec![0.0; 6 * n];
        self.jacobian(q, &mut jacobian);
        let size = n.min(6);
        let mut gram = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                gram[i * size + j] = if n >= 6 {
                    (0..n).map(|k| jacobian[i * n + k] * jacobian[j * n + k]).sum()
                } else {
                    (0..6).map(|k| jacobian[k * n + i] * jacobian[k * n + j]).sum()
                };
            }
        }
        if !cholesky::factor(&mut gram, size) {
            return 0.0;
        }
        (0..size).map(|i| gram[i * (size + 1)]).product()
    }

    /// How far the joint that is closest to a limit stands from it, as a share of half its range: 1 in the middle and
    /// for joints without limits, 0 at a limit, below 0 beyond.
    pub fn limit_margin(&self, q: &[f64]) -> f64 {
        let margin = |(joint, q): (&ArmJoint, &f64)| {
            let half = 0.5 * (joint.upper - joint.lower);
            let least = (q - joint.lower).min(joint.upper - q);
            match half {
                _ if half.is_infinite() => 1.0,
                _ if half > 0.0 => least / half,
                _ => 0.0,
            }
        };
        self.joints.iter().zip(q).map(margin).fold(1.0, f64::min)
    }

    /// Checks joint values that come from outside; `what` names them in the message.
    ///
    /// # Errors
    /// [`Error::Arm`] where their number is not that of the joints, or one is not finite or outside its limits.
    pub fn check_positions(&self, what: &str, q: &[f64]) -> Result<()> {
        let error = |what: String, expected: String, found: String| {
            Err(Error::Arm { what, expected, found })
        };
        if q.len() != self.n_joints() {
            let names: Vec<&str> = self.joints.iter().map(|joint| joint.name.as_str()).collect();
            let expected = format!("{} joint values ({})", self.n_joints(), names.join(", "));
            return error(what.into(), expected, q.len().to_string());
        }
        for (joint, &position) in self.joints.iter().zip(q) {
            let what = format!("{what}: joint `{}`", joint.name);
            let ArmJoint { lower, upper, .. } = *joint;
            if !position.is_finite() {
                return error(what, "a finite number".into(), position.to_string());
            }
            if position < lower - LIMIT_SLACK || position > upper + LIMIT_SLACK {
                return error(what, format!("{lower} to {upper}"), position.to_string());
            }
        }
        Ok(())
    }
}

/// The joints that move the path by themselves, in the order in which they first do.
fn variables(robot: &Robot, path: &[usize]) -> Vec<usize> {
    let leaders = robot.leaders();
    let (mut variables, mut known) = (Vec::new(), vec![false; robot.joints.len()]);
    for &joint in path {
        let leader = leaders[joint];
        let moves = [joint, leader].iter().all(|&j| robot.joints[j].kind.has_position());
        if moves && !std::mem::replace(&mut known[leader], true) {
            variables.push(leader);
        }
    }
    variables
}

/// A position for each joint of the robot outside the chain: given, or zero, or the limit next to zero.
fn fixed_positions(
    robot: &Robot,
    variables: &[usize],
    given: &[(String, f64)],
) -> Result<Vec<f64>> {
    let mut positions: Vec<f64> = robot
        .joints
        .iter()
        .map(|joint| {
            joint.limits.position.map_or(0.0, |[lower, upper]| 0.0_f64.max(lower).min(upper))
        })
        .collect();
    for (name, position) in given {
        let error = |expected: &str, found: String| Error::Arm {
            what: format!("fixed position of `{name}`"),
            expected: expected.into(),
            found,
        };
        let Some(index) = robot.joint(name) else {
            let names = robot.joints.iter().map(|joint| joint.name.as_str());
            return Err(error("a joint of the robot", unknown_name(name, names)));
        };
        let joint = &robot.joints[index];
        if variables.contains(&index) {
            return Err(error("a joint outside the chain", "one that the arm moves".into()));
        }
        if joint.mimic.is_some() || !joint.kind.has_position() {
            let found = "one that follows another or has no position".into();
            return Err(error("a joint that moves by itself", found));
        }
        let [lower, upper] = joint.limits.position.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        if !position.is_finite()
            || *position < lower - LIMIT_SLACK
            || *position > upper + LIMIT_SLACK
        {
            return Err(error(&format!("{lower} to {upper}"), position.to_string()));
        }
        positions[index] = *position;
    }
    Ok(positions)
}

/// How each joint of the robot follows the arm's. Chains of mimics end: that was checked when the file was read.
fn follows(robot: &Robot, variables: &[usize], positions: &[f64]) -> Vec<Follows> {
    // Along a chain of mimics both factors are affine in the leader's position, so two positions tell them.
    let leaders = robot.leaders();
    let at = |leader_position: f64| {
        let led: Vec<f64> = vec![leader_position; robot.joints.len()];
        robot.with_mimics(&led)
    };
    let (zero, one) = (at(0.0), at(1.0));
    (0..robot.joints.len())
        .map(|joint| {
            let (multiplier, offset) = (one[joint] - zero[joint], zero[joint]);
            let leader = leaders[joint];
            match variables.iter().position(|&variable| variable == leader) {
                Some(variable) => Follows { variable: Some(variable), multiplier, offset },
                None => {
                    let offset = multiplier * positions[leader] + offset;
                    Follows { variable: None, multiplier: 0.0, offset }
                }
            }
        })
        .collect()
}

fn joints(
    robot: &Robot,
    variables: &[usize],
    file: Option<&JointLimitsFile>,
    notes: &mut Vec<String>,
) -> Result<Vec<ArmJoint>> {
    let unknown: Vec<&str> = file
        .into_iter()
        .flat_map(|file| file.joints.keys())
        .filter(|name| robot.joint(name).is_none())
        .map(String::as_str)
        .collect();
    if !unknown.is_empty() {
        let names = unknown.join(", ");
        notes.push(format!("joints of the limits file that the robot does not have: {names}"));
    }
    let (mut joints, mut no_velocity, mut no_acceleration) = (Vec::new(), Vec::new(), Vec::new());
    for &index in variables {
        let joint = &robot.joints[index];
        let told = file.and_then(|file| file.joints.get(&joint.name)).copied().unwrap_or_default();
        if told.velocity.or(joint.limits.velocity).is_none() {
            no_velocity.push(joint.name.as_str());
        }
        if told.acceleration.is_none() {
            no_acceleration.push(joint.name.as_str());
        }
        joints.push(ArmJoint::new(index, joint, &told, notes)?);
    }
    for (what, names, default) in [
        ("velocity", no_velocity, DEFAULT_VELOCITY),
        ("acceleration", no_acceleration, DEFAULT_ACCELERATION),
    ] {
        if !names.is_empty() {
            let names = names.join(", ");
            notes.push(format!(
                "{what} limit {default:.1} assumed, since no file tells one: {names}"
            ));
        }
    }
    Ok(joints)
}
