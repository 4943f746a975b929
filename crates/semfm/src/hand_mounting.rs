//! Whether the hand of the grasps sits where the robot's files let a hand sit.
//!
//! A wrong tip is no error of any file: the hand would be planned with elsewhere than it is bolted to. What can be known
//! is asked for: which joints lie beyond the tip, where the fingers of the description are, where the SRDF says that a
//! hand is mounted, and which frame of the last body is called a flange.

use std::f64::consts::PI;

use parry3d_f64::math::Pose;
use semfm_geom::math::DQuat;
use semfm_robot::{Arm, ArmSettings, Gripper, GripperSettings};

use crate::files::GripperRecord;
use crate::{Error, Result, RobotArm};

/// Farthest that the TCP of the grasps may be from that between the description's own fingers, metres and radians.
/// Where a pad's middle is taken to be differs: the TCP of the built-in Franka Hand is 18 mm from the middle of the pads
/// that the Panda's meshes show. A wrong frame is off by more than the length of a flange or by an eighth of a turn
/// (`panda_link8` and `panda_hand`).
const FAR: Offset = Offset { metres: 0.03, radians: 0.35 };
/// Frames that stand so close are the same.
const SAME: Offset = Offset { metres: 1e-3, radians: 0.02 };

/// How far two frames are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Offset {
    metres: f64,
    radians: f64,
}

/// A closed hand at the tip of an arm.
pub(crate) struct Mounting<'a> {
    /// The gripper.
    pub gripper: &'a GripperRecord,
    /// The TCP in the gripper's flange.
    pub flange_from_tcp: Pose,
    /// The TCP in the frame of the arm's tip: the same where the tip is the flange.
    pub tip_from_tcp: Pose,
}

/// Refuses a tip that the hand cannot sit on, and tells in words what is doubtful.
///
/// # Errors
/// [`Error::Invalid`] where joints of the arm lie beyond the tip, and where the description has the fingers of this very
/// gripper elsewhere.
pub(crate) fn check_mounting(arm: &RobotArm, mounting: &Mounting<'_>) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    let found = found_end(arm.arm());
    if let Some(found) = &found {
        notes.extend(check_joints_beyond(arm.arm(), found)?);
    }
    match own_hand(arm) {
        Some(own) => notes.extend(check_own_hand(arm, mounting, &own)?),
        None => notes.extend(other_frames(arm, found.as_ref())),
    }
    Ok(notes)
}

/// The arm from the same base to the end that is found without being told; `None` where there is no one end.
fn found_end(arm: &Arm) -> Option<Arm> {
    let base = Some(link_name(arm, arm.base()).to_owned());
    Arm::new(arm.robot().clone(), &ArmSettings { base, ..Default::default() }).ok()
}

/// Joints of the arm that is found beyond the tip: the hand would stand for the links that they move. A single one may
/// close a hand.
fn check_joints_beyond(arm: &Arm, found: &Arm) -> Result<Option<String>> {
    let beyond: Vec<&str> = found
        .joints()
        .iter()
        .filter(|joint| arm.joints().iter().all(|own| own.index != joint.index))
        .map(|joint| joint.name.as_str())
        .collect();
    let (tip, end) = (link_name(arm, arm.tip()), link_name(found, found.tip()));
    let before: Vec<&str> = arm
        .joints()
        .iter()
        .filter(|joint| found.joints().iter().all(|other| other.index != joint.index))
        .map(|joint| joint.name.as_str())
        .collect();
    match beyond.as_slice() {
        [] if before.is_empty() => Ok(None),
        [] => Ok(Some(format!(
            "{} moves with the arm, since the tip is `{tip}`: without being told, the arm ends on the body of `{end}`",
            before.join(", ")
        ))),
        [joint] => Ok(Some(format!(
            "joint `{joint}` lies beyond the tip `{tip}`: what it moves counts as part of the hand; if it is one of the \
             arm's, the tip is on the body of `{end}`"
        ))),
        joints => {
            let expected = format!("a link at the end of the arm, on the body of `{end}`");
            let found = format!("joints of the arm beyond it: {}", joints.join(", "));
            Err(Error::invalid(format!("tip `{tip}`"), expected, found))
        }
    }
}

/// The hand that is part of the description, its flange at the arm's tip; `None` where there is none there.
fn own_hand(arm: &RobotArm) -> Option<Gripper> {
    let chain = arm.arm();
    let robot = chain.robot();
    let (bodies, leaders) = (robot.bodies(), robot.leaders());
    let is_finger = |(i, joint): (usize, &semfm_robot::Joint)| {
        joint.kind.has_position()
            && bodies[joint.parent] == bodies[chain.tip()]
            && chain.joints().iter().all(|own| own.index != leaders[i])
    };
    if !robot.joints.iter().enumerate().any(is_finger) {
        return None;
    }
    let settings = GripperSettings {
        flange: Some(link_name(chain, chain.tip()).to_owned()),
        packages: arm.packages().clone(),
        ..Default::default()
    };
    Gripper::from_urdf(arm.urdf(), &settings).ok()
}

/// Compares where the grasps' hand closes with where the description's own does.
fn check_own_hand(
    arm: &RobotArm,
    mounting: &Mounting<'_>,
    own: &Gripper,
) -> Result<Option<String>> {
    let Mounting { gripper, flange_from_tcp, tip_from_tcp } = *mounting;
    let apart = Offset::up_to_half_turn(tip_from_tcp, own.flange_from_tcp);
    if apart.is_within(FAR) {
        return Ok(None);
    }
    let chain = arm.arm();
    let (tip, name) = (link_name(chain, chain.tip()), &gripper.name);
    let robot = chain.robot();
    let mut joints = gripper.joints.iter();
    if !joints.any(|finger| robot.joint(&finger.joint).is_some()) {
        return Ok(Some(format!(
            "the description has a hand of its own, which closes {apart} from where `{name}` on `{tip}` does: its \
             fingers are left out, its palm is not"
        )));
    }
    // A frame of the same body from which the gripper's flange would lead to the right place.
    let poses = robot.link_poses(&[]);
    let bodies = robot.bodies();
    let body = bodies[chain.tip()];
    let fits = |&link: &usize| {
        let link_from_tcp = poses[link].inverse() * poses[chain.tip()] * own.flange_from_tcp;
        let apart = Offset::up_to_half_turn(flange_from_tcp, link_from_tcp);
        bodies[link] == body && apart.is_within(FAR)
    };
    let expected = match (0..robot.links.len()).find(fits) {
        Some(link) => format!("the link that its flange sits on: `{}`", robot.links[link].name),
        None => "the link that its flange sits on, or tip_from_tcp".into(),
    };
    let found = format!("a hand that closes {apart} from where its own fingers do in the URDF");
    Err(Error::invalid(format!("gripper `{name}` on tip `{tip}`"), expected, found))
}

/// Where neither fingers nor anything else tells where the hand sits: frames that are meant for it by the SRDF or by
/// their names, and stand otherwise.
fn other_frames(arm: &RobotArm, found: Option<&Arm>) -> Option<String> {
    let chain = arm.arm();
    let robot = chain.robot();
    let poses = robot.link_poses(&[]);
    let apart = |link: usize| Offset::between(poses[chain.tip()], poses[link]);
    let tip = link_name(chain, chain.tip());
    let hands = arm.opened().srdf.iter().flat_map(|srdf| &srdf.end_effectors);
    let hands: Vec<_> = hands.filter(|hand| is_of_arm(chain, hand.parent_link)).collect();
    if let Some(hand) = hands.first() {
        if hands.iter().any(|hand| apart(hand.parent_link).is_within(SAME)) {
            return None;
        }
        let parent = &robot.links[hand.parent_link].name;
        let bodies = robot.bodies();
        let how = match bodies[hand.parent_link] == bodies[chain.tip()] {
            true => format!("which is {} from it", apart(hand.parent_link)),
            false => "which is on another body".into(),
        };
        return Some(format!(
            "the hand is mounted on `{tip}`; the SRDF mounts `{}` on `{parent}`, {how}",
            hand.name
        ));
    }
    let end = found?.tip();
    let is_same = apart(end).is_within(SAME);
    (!is_same && robot.body_of(end) == robot.body_of(chain.tip())).then(|| {
        let flange = &robot.links[end].name;
        format!(
            "the hand is mounted on `{tip}`; `{flange}`, on the same body, is {} from it",
            apart(end)
        )
    })
}

/// Whether a link is on one of the bodies that the arm moves.
fn is_of_arm(arm: &Arm, link: usize) -> bool {
    let robot = arm.robot();
    let bodies = robot.bodies();
    arm.joints().iter().any(|joint| bodies[robot.joints[joint.index].child] == bodies[link])
}

fn link_name(arm: &Arm, link: usize) -> &str {
    &arm.robot().links[link].name
}

impl Offset {
    fn between(a: Pose, b: Pose) -> Self {
        let a_from_b = a.inverse() * b;
        let turn = a_from_b.rotation.normalize();
        let radians = 2.0 * turn.xyz().length().atan2(turn.w.abs());
        Self { metres: a_from_b.translation.length(), radians }
    }

    /// A hand of two jaws closes at the same place when it is turned half way round.
    fn up_to_half_turn(a: Pose, b: Pose) -> Self {
        let half_turn = Pose::from_rotation(DQuat::from_rotation_z(PI));
        let (plain, turned) = (Self::between(a, b), Self::between(a * half_turn, b));
        if turned.radians < plain.radians { turned } else { plain }
    }

    fn is_within(self, other: Self) -> bool {
        self.metres <= other.metres && self.radians <= other.radians
    }
}

impl std::fmt::Display for Offset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.0} mm and {:.0}°", 1e3 * self.metres, self.radians.to_degrees())
    }
}
