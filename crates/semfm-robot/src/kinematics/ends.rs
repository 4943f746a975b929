//! Which links an arm begins and ends at.

use parry3d_f64::math::Pose;
use semfm_geom::suggestion::unknown_name;

use crate::joint::JointKind;
use crate::robot::Robot;
use crate::{Error, Result};

/// A chain of this many joints that move by themselves counts as an arm, a shorter one at the end of an arm as a finger.
const MIN_ARM_JOINTS: usize = 4;

/// What names of a single joint that closes a hand, and of its link, contain.
const FINGER_NAMES: [&str; 4] = ["finger", "jaw", "gripper", "knuckle"];

/// Frames that descriptions put at the end of an arm, the preferred first: ends of names in lower case. `tool0` and
/// `flange` are those of ROS REP 199, the others are what Franka, Kinova and Universal Robots call theirs.
const TIP_NAMES: [&str; 8] = [
    "tool0",
    "flange",
    "ee_link",
    "end_effector_link",
    "end_effector",
    "tcp",
    "tool",
    "gripper_frame",
];

/// The links at both ends of a chain, and what was assumed on the way.
pub(super) struct Ends {
    pub base: usize,
    pub tip: usize,
    /// Where the path begins, in the base's frame: they differ where the base is a frame beside the chain.
    pub base_from_start: Pose,
    /// Joints from base to tip.
    pub path: Vec<usize>,
    pub notes: Vec<String>,
}

/// Finds what is not given.
pub(super) fn find(robot: &Robot, base: Option<&str>, tip: Option<&str>) -> Result<Ends> {
    let mut notes = Vec::new();
    let base_link = match base {
        Some(name) => link(robot, "base", name)?,
        None => robot.root,
    };
    if base.is_none() {
        notes.push(format!("base: the root link `{}`", robot.links[base_link].name));
    }
    let tip_link = match tip {
        Some(name) => link(robot, "tip", name)?,
        None => {
            let tip = find_tip(robot, base_link)?;
            notes.push(format!("tip: link `{}`, found", robot.links[tip].name));
            tip
        }
    };
    let path = path(robot, base_link, tip_link)?;
    let start = path.first().map_or(tip_link, |&joint| robot.joints[joint].parent);
    // Both are one rigid body, so positions do not matter.
    let poses = robot.link_poses(&[]);
    let base_from_start = poses[base_link].inverse() * poses[start];
    Ok(Ends { base: base_link, tip: tip_link, base_from_start, path, notes })
}

fn link(robot: &Robot, what: &str, name: &str) -> Result<usize> {
    robot.link(name).ok_or_else(|| Error::Arm {
        what: what.into(),
        expected: "a link of the robot".into(),
        found: unknown_name(name, robot.links.iter().map(|link| link.name.as_str())),
    })
}

/// Joints from base to tip. The base may be any link that is fixed to one on the way from the root to the tip.
fn path(robot: &Robot, base: usize, tip: usize) -> Result<Vec<usize>> {
    let mut joint_to = vec![None; robot.links.len()];
    robot.joints.iter().enumerate().for_each(|(i, joint)| joint_to[joint.child] = Some(i));
    let fixed_to = rigid_bodies(robot);
    let (mut path, mut at) = (Vec::new(), tip);
    while fixed_to[at] != fixed_to[base] {
        let Some(joint) = joint_to[at] else {
            let [base, tip] = [base, tip].map(|link| &robot.links[link].name);
            return Err(Error::Arm {
                what: format!("tip `{tip}`"),
                expected: format!("a link that joints lead to from the base `{base}`"),
                found: "a link on another branch, or nearer the root".into(),
            });
        };
        path.push(joint);
        at = robot.joints[joint].parent;
    }
    path.reverse();
    for &joint in &path {
        let joint = &robot.joints[joint];
        if matches!(joint.kind, JointKind::Floating | JointKind::Planar | JointKind::Spherical) {
            return Err(Error::Arm {
                what: format!("joint `{}`", joint.name),
                expected: "joints that turn about one axis or slide along one from base to tip"
                    .into(),
                found: format!(
                    "a joint that moves freely; name a base beyond it, such as `{}`",
                    robot.links[joint.child].name
                ),
            });
        }
    }
    Ok(path)
}

/// For each link, the top link of all that is fixed to it by joints of the type `fixed`. [`Robot::bodies`] also joins
/// what may float.
fn rigid_bodies(robot: &Robot) -> Vec<usize> {
    let mut bodies: Vec<usize> = (0..robot.links.len()).collect();
    for joint in robot.joints.iter().filter(|joint| joint.kind == JointKind::Fixed) {
        bodies[joint.child] = bodies[joint.parent];
    }
    bodies
}

/// The end of the one arm: from the base along the joints, as long as one of them leads on to an arm.
fn find_tip(robot: &Robot, base: usize) -> Result<usize> {
    let longest = longest_chains(robot);
    let bodies = robot.bodies();
    let mut moving_on = vec![Vec::new(); robot.links.len()];
    for (i, joint) in robot.joints.iter().enumerate().filter(|(_, j)| j.kind.has_position()) {
        moving_on[bodies[joint.parent]].push(i);
    }
    let mut body = bodies[base];
    loop {
        let moving = &moving_on[body];
        // Joints from here on, this one included.
        let counts = |&joint: &usize| {
            let joint = &robot.joints[joint];
            longest[joint.child] + usize::from(joint.mimic.is_none())
        };
        let arms: Vec<usize> =
            moving.iter().copied().filter(|joint| counts(joint) >= MIN_ARM_JOINTS).collect();
        match (moving.as_slice(), arms.as_slice()) {
            (_, [only]) => body = robot.joints[*only].child,
            (_, [_, _, ..]) => return Err(several_arms(robot, &arms)),
            ([only], []) if !is_finger(robot, *only) => body = robot.joints[*only].child,
            _ => break,
        }
    }
    if body == bodies[base] {
        return Err(Error::Arm {
            what: format!("robot `{}`", robot.name),
            expected: "an arm: a chain of joints that move".into(),
            found: "none that leads on from the base; name a `tip`".into(),
        });
    }
    Ok(tip_of_body(robot, &bodies, body))
}

/// Whether a joint is by its name, or that of its link, the one that closes a hand.
fn is_finger(robot: &Robot, joint: usize) -> bool {
    let joint = &robot.joints[joint];
    [&joint.name, &robot.links[joint.child].name].iter().any(|name| {
        let name = name.to_ascii_lowercase();
        FINGER_NAMES.iter().any(|finger| name.contains(finger))
    })
}

fn several_arms(robot: &Robot, joints: &[usize]) -> Error {
    let names: Vec<String> =
        joints.iter().take(8).map(|&joint| format!("`{}`", robot.joints[joint].name)).collect();
    Error::Arm {
        what: format!("robot `{}`", robot.name),
        expected: "one arm, or a `tip` that says which is meant".into(),
        found: format!("{} arms that begin at joints {}", joints.len(), names.join(", ")),
    }
}

/// For each link, the most joints on a way outwards that move by themselves.
fn longest_chains(robot: &Robot) -> Vec<usize> {
    let mut longest = vec![0; robot.links.len()];
    for joint in robot.joints.iter().rev() {
        let moves = joint.kind.has_position() && joint.mimic.is_none();
        longest[joint.parent] =
            longest[joint.parent].max(longest[joint.child] + usize::from(moves));
    }
    longest
}

/// The frame of an arm's last body that is meant as its end: by name, else the one that fingers move on, else the one
/// farthest from where the body begins.
fn tip_of_body(robot: &Robot, bodies: &[usize], body: usize) -> usize {
    let links = || (0..robot.links.len()).filter(|&link| bodies[link] == body);
    for ending in TIP_NAMES {
        let named =
            links().find(|&link| robot.links[link].name.to_ascii_lowercase().ends_with(ending));
        if let Some(link) = named {
            return link;
        }
    }
    let moving = robot.joints.iter().filter(|joint| joint.kind.has_position());
    if let Some(finger) = moving.into_iter().find(|joint| bodies[joint.parent] == body) {
        return finger.parent;
    }
    let mut depth = vec![0_usize; robot.links.len()];
    for joint in robot.joints.iter().filter(|joint| !joint.kind.has_position()) {
        depth[joint.child] = depth[joint.parent] + 1;
    }
    // The first of the deepest.
    links().min_by_key(|&link| (std::cmp::Reverse(depth[link]), link)).unwrap_or(body)
}
