//! What a motion is shown with: the robot, a hand that is no part of its description, the object and what stands
//! around it, as a tree of frames.
//!
//! Everything stands in the frame of the arm's base link ("world" of a plan), metres.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;
use semfm_robot::{DriveJoint, Geometry, Gripper, MeshPaths, Motion, Robot};

use crate::files::PartRecord;

/// Openings at which the joints and parts of a hand are tabulated: for a crank of 0.1 m over 0.8 rad the chord leaves
/// the circle by 8 µm.
const N_OPENINGS: usize = 33;

/// A robot with what it handles and what it must not touch.
#[derive(Clone, Debug)]
pub struct MotionScene {
    /// The robot.
    pub robot: MotionRobot,
    /// A hand that is no part of the robot's description.
    pub hand: Option<MountedHand>,
    /// What is grasped.
    pub object: Option<MotionObject>,
    /// What else stands there.
    pub obstacles: Vec<MotionObstacle>,
}

/// A robot, where its description and meshes are, and which part of it is the arm.
#[derive(Clone, Debug)]
pub struct MotionRobot {
    /// The kinematic tree.
    pub robot: Arc<Robot>,
    /// The file of the description.
    pub urdf: PathBuf,
    /// Folders of `package://NAME/…`.
    pub packages: BTreeMap<String, PathBuf>,
    /// The link whose frame everything stands in.
    pub base: usize,
    /// The last link of the arm, which a hand is mounted to.
    pub tip: usize,
    /// Positions of joints outside the arm, by name, radians or metres; 0 for those that are not named.
    pub fixed: BTreeMap<String, f64>,
    /// Joints of fingers that are part of the description.
    pub fingers: Vec<FingerJoint>,
}

/// A joint's position by the distance between the pads.
#[derive(Clone, Debug, PartialEq)]
pub struct FingerJoint {
    /// Distances between the pads (metres, ascending) and positions (metres or radians).
    table: Vec<[f64; 2]>,
    joint: DriveJoint,
}

/// A gripper at the tip of an arm whose description ends there.
#[derive(Clone, Debug)]
pub struct MountedHand {
    /// Name of the gripper.
    pub name: String,
    /// Its parts: convex pieces in frames of their own, metres.
    pub parts: Vec<PartRecord>,
    /// Distances between the pads at which the parts' poses are known, ascending.
    pub openings: Vec<f64>,
    /// For each of these, the pose of each part in the tip's frame (openings × parts).
    pub tip_from_part: Vec<Vec<Pose>>,
}

/// The object that is grasped.
#[derive(Clone, Debug)]
pub struct MotionObject {
    /// Its mesh, in its own units.
    pub mesh: Arc<Mesh>,
    /// The file that the mesh was read from, if it was.
    pub file: Option<PathBuf>,
    /// Metres per unit of the mesh.
    pub scale: f64,
    /// Where it stands, scaled to metres, before it is lifted.
    pub base_from_object: Pose,
}

/// Something that the arm must not touch.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionObstacle {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub base_from_obstacle: Pose,
    /// Its shape.
    pub shape: ObstacleShape,
}

/// The shape of an obstacle in its own frame, metres.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ObstacleShape {
    /// A box, cylinder, capsule or ball. A mesh file is no shape of an obstacle: its mesh is.
    Primitive(Geometry),
    /// A surface.
    Mesh(Arc<Mesh>),
    /// Observed points.
    Points(Vec<DVec3>),
    /// Everything below z = 0: a table.
    HalfSpace,
}

/// What a frame of a scene belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameOwner {
    /// A link of the robot, by its number there.
    Link(usize),
    /// A part of the mounted hand.
    HandPart(usize),
    /// The object.
    Object,
    /// An obstacle.
    Obstacle(usize),
}

/// A frame of a scene: what stands in it, and which frame it moves in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MotionFrame {
    /// Unique in the scene: the link's name, `object`, or the obstacle's name, with a number where that is taken.
    pub name: String,
    /// Number of the frame that it moves in, which stands before it; none for the robot's root.
    pub parent: Option<usize>,
    /// What it belongs to.
    pub owner: FrameOwner,
}

/// Where everything that moves stands at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneState {
    /// Names of the arm's joints and their positions, radians or metres.
    pub arm: Vec<(String, f64)>,
    /// Distance between the pads, metres.
    pub opening: f64,
    /// The object's pose.
    pub base_from_object: Pose,
}

impl MotionRobot {
    /// A robot without joints outside the arm.
    pub fn new(robot: Arc<Robot>, urdf: impl Into<PathBuf>, base: usize, tip: usize) -> Self {
        let (packages, fixed, fingers) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
        Self { robot, urdf: urdf.into(), packages, base, tip, fixed, fingers }
    }

    /// Where the meshes of its links may be.
    pub fn mesh_paths(&self) -> MeshPaths {
        MeshPaths::new(&self.urdf, &self.packages)
    }

    /// The position of every joint of the robot, mimics following, when the arm and the fingers stand so.
    pub fn joint_positions(&self, arm: &[(String, f64)], opening: f64) -> Vec<f64> {
        let arm: BTreeMap<&str, f64> = arm.iter().map(|(name, q)| (name.as_str(), *q)).collect();
        let own = self.robot.joints.iter().map(|joint| {
            let finger = self.fingers.iter().find(|finger| finger.name() == joint.name);
            arm.get(joint.name.as_str())
                .copied()
                .or_else(|| finger.map(|finger| finger.at(opening)))
                .or_else(|| self.fixed.get(&joint.name).copied())
                .unwrap_or(0.0)
        });
        self.robot.with_mimics(&own.collect::<Vec<f64>>())
    }
}

impl FingerJoint {
    /// The drive joints of a gripper that is part of the robot's description.
    pub fn of(gripper: &Gripper) -> Vec<Self> {
        let openings = openings_of(gripper);
        let table = |joint: &DriveJoint| openings.iter().map(|&w| [w, joint.at(w)]).collect();
        gripper.joints.iter().filter_map(|joint| Self::new(&joint.name, table(joint))).collect()
    }

    /// From distances between the pads and positions, in any order; `None` without any.
    pub fn new(name: &str, mut table: Vec<[f64; 2]>) -> Option<Self> {
        table.sort_by(|a, b| a[0].total_cmp(&b[0]));
        table.dedup_by(|next, kept| next[0] == kept[0]);
        let joint = DriveJoint::new(name, table.iter().map(|&[opening, q]| (opening, q)))?;
        Some(Self { table, joint })
    }

    /// The joint's name.
    pub fn name(&self) -> &str {
        &self.joint.name
    }

    /// Its position at a distance between the pads, linear between the entries of the table.
    pub fn at(&self, opening: f64) -> f64 {
        self.joint.at(opening)
    }

    /// Distances between the pads, ascending, and positions.
    pub fn table(&self) -> &[[f64; 2]] {
        &self.table
    }
}

impl MountedHand {
    /// A gripper whose flange stands so in the frame of the arm's tip.
    pub fn new(gripper: &Gripper, tip_from_flange: Pose) -> Self {
        let openings = openings_of(gripper);
        let tip_from_part = openings.iter().map(|&opening| {
            let tip_from_tcp = tip_from_flange * gripper.flange_from_tcp_at(opening);
            let parts = gripper.parts_at(opening).into_iter();
            parts.map(|posed| tip_from_tcp * posed.tcp_from_part).collect()
        });
        Self {
            name: gripper.name.clone(),
            parts: gripper.parts.iter().map(PartRecord::new).collect(),
            tip_from_part: tip_from_part.collect(),
            openings,
        }
    }

    /// The pose of each part in the tip's frame at a distance between the pads.
    pub fn poses_at(&self, opening: f64) -> Vec<Pose> {
        (0..self.parts.len())
            .map(|part| {
                let poses = self.tip_from_part.iter().map(|poses| poses[part]);
                Motion::new(self.openings.iter().copied().zip(poses)).at(opening)
            })
            .collect()
    }
}

/// Distances between the pads for a table.
fn openings_of(gripper: &Gripper) -> Vec<f64> {
    let (closed, open) = (*gripper.opening.start(), *gripper.opening.end());
    let share = |i: usize| i as f64 / (N_OPENINGS - 1) as f64;
    (0..N_OPENINGS).map(|i| closed + share(i) * (open - closed)).collect()
}

impl MotionScene {
    /// The robot alone.
    pub fn new(robot: MotionRobot) -> Self {
        Self { robot, hand: None, object: None, obstacles: Vec::new() }
    }

    /// The frames, each after the one that it moves in: links from the root outwards, then parts of the hand, the
    /// object and the obstacles.
    pub fn frames(&self) -> Vec<MotionFrame> {
        let MotionRobot { robot, base, tip, .. } = &self.robot;
        let mut names = UniqueNames::default();
        let mut frame_of = vec![0; robot.links.len()];
        let mut frames = Vec::new();
        let mut add = |name: &str, parent, owner| {
            frames.push(MotionFrame { name: names.unique(name), parent, owner });
            frames.len() - 1
        };
        frame_of[robot.root] =
            add(&robot.links[robot.root].name, None, FrameOwner::Link(robot.root));
        for joint in &robot.joints {
            let (name, parent) = (&robot.links[joint.child].name, frame_of[joint.parent]);
            frame_of[joint.child] = add(name, Some(parent), FrameOwner::Link(joint.child));
        }
        for (i, part) in self.hand.iter().flat_map(|hand| &hand.parts).enumerate() {
            add(&part.link, Some(frame_of[*tip]), FrameOwner::HandPart(i));
        }
        if self.object.is_some() {
            add("object", Some(frame_of[*base]), FrameOwner::Object);
        }
        for (i, obstacle) in self.obstacles.iter().enumerate() {
            add(&obstacle.name, Some(frame_of[*base]), FrameOwner::Obstacle(i));
        }
        frames
    }

    /// The pose of each of [`MotionScene::frames`] in its parent's frame, identity for the root.
    pub fn poses(&self, state: &SceneState) -> Vec<Pose> {
        let robot = &self.robot.robot;
        let positions = self.robot.joint_positions(&state.arm, state.opening);
        let joints = robot.joints.iter().zip(positions);
        std::iter::once(Pose::IDENTITY)
            .chain(joints.map(|(joint, q)| joint.parent_from_joint * joint.motion(q)))
            .chain(self.hand.iter().flat_map(|hand| hand.poses_at(state.opening)))
            .chain(self.object.iter().map(|_| state.base_from_object))
            .chain(self.obstacles.iter().map(|obstacle| obstacle.base_from_obstacle))
            .collect()
    }

    /// The pose of each of `frames` in the base link's frame, from `poses` in their parents' frames.
    pub fn in_base(&self, frames: &[MotionFrame], poses: &[Pose]) -> Vec<Pose> {
        let mut root_from: Vec<Pose> = Vec::with_capacity(frames.len());
        for (frame, &pose) in frames.iter().zip(poses) {
            root_from.push(frame.parent.map_or(pose, |parent| root_from[parent] * pose));
        }
        let is_base = |frame: &MotionFrame| frame.owner == FrameOwner::Link(self.robot.base);
        let base = frames.iter().position(is_base).map_or(Pose::IDENTITY, |at| root_from[at]);
        root_from.into_iter().map(|pose| base.inverse() * pose).collect()
    }

    /// The pose of the arm's tip in the base link's frame.
    pub fn base_from_tip(&self, arm: &[(String, f64)], opening: f64) -> Pose {
        let positions = self.robot.joint_positions(arm, opening);
        let poses = self.robot.robot.link_poses(&positions);
        poses[self.robot.base].inverse() * poses[self.robot.tip]
    }
}

/// Names that were given, and the next one of each kind.
#[derive(Default)]
struct UniqueNames {
    taken: BTreeSet<String>,
}

impl UniqueNames {
    /// The name, or with the first number that makes it unique.
    fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_owned();
        let mut n = 2;
        while !self.taken.insert(unique.clone()) {
            unique = format!("{name}_{n}");
            n += 1;
        }
        unique
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique() {
        let mut names = UniqueNames::default();
        let given: Vec<String> = ["a", "b", "a", "a_2", "a"].map(|n| names.unique(n)).into();
        assert_eq!(given, ["a", "b", "a_2", "a_2_2", "a_3"]);
    }

    #[test]
    fn a_mounted_hand_stands_where_its_gripper_says() {
        let gripper = Gripper::builtin("franka").unwrap();
        let tip_from_flange = Pose::translation(0.0, 0.0, 0.1);
        let hand = MountedHand::new(&gripper, tip_from_flange);
        for opening in [0.0, 0.013, 0.08] {
            let tip_from_tcp = tip_from_flange * gripper.flange_from_tcp_at(opening);
            for (found, posed) in hand.poses_at(opening).iter().zip(gripper.parts_at(opening)) {
                let expected = tip_from_tcp * posed.tcp_from_part;
                assert!(found.translation.distance(expected.translation) < 1e-12);
            }
        }
    }
}
