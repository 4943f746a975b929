//! A motion as a ROS 2 bag: an MCAP file and the `metadata.yaml` that rosbag2 writes beside it, with messages that
//! every installation has.
//!
//! `ros2 bag play FOLDER --clock` moves the robot in RViz (with `use_sim_time`), and a controller takes the
//! trajectories as they are. Joints, links and frames have the names of the robot's description, which is sent as it is;
//! a hand that it does not know is sent as markers (`/hand`).

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use semfm_geom::io::{read_file, refuse_input, write_atomically};
use semfm_motion::TrajectoryPoint;
use semfm_views::mcap::{
    Cdr, ChannelId, ChunkCompression, METADATA_NAME, McapWriter, Ros2Message, write_mcap,
};

use super::ros2_hand::hand_markers;
use super::trajectory::FORMAT;
use crate::grasp_result::position_and_rotation;
use crate::{MotionFrame, PlannedMotion, Result, SceneState};

/// The bag's file.
pub const BAG_FILE: &str = "trajectory.mcap";
/// What rosbag2 reads first.
pub const BAG_METADATA: &str = "metadata.yaml";

/// When the bag begins: time 0 means "no time yet" to a ROS clock.
const START_NANOS: u64 = 1_000_000_000;
/// Between two messages of the joints and moving frames: 100 Hz.
const STEP_SECONDS: f64 = 0.01;
/// An hour.
const MOST_STATES: usize = 360_000;
/// Half of the span over which speeds of joints that follow others are measured, seconds.
const HALF_SPAN: f64 = 1e-4;

/// How a topic is offered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Durability {
    /// Late subscribers get the last message.
    TransientLocal,
    /// They do not.
    Volatile,
}

/// A topic of the bag.
struct Topic {
    name: &'static str,
    message: Ros2Message,
    durability: Durability,
}

const DESCRIPTION: Topic = Topic {
    name: "/robot_description",
    message: Ros2Message::String,
    durability: Durability::TransientLocal,
};
const TF_STATIC: Topic = Topic {
    name: "/tf_static",
    message: Ros2Message::TfMessage,
    durability: Durability::TransientLocal,
};
const ARM: Topic = Topic {
    name: "/joint_trajectory",
    message: Ros2Message::JointTrajectory,
    durability: Durability::TransientLocal,
};
const FINGERS: Topic = Topic {
    name: "/gripper_trajectory",
    message: Ros2Message::JointTrajectory,
    durability: Durability::TransientLocal,
};
const JOINTS: Topic = Topic {
    name: "/joint_states",
    message: Ros2Message::JointState,
    durability: Durability::Volatile,
};
const HAND: Topic = Topic {
    name: "/hand",
    message: Ros2Message::MarkerArray,
    durability: Durability::TransientLocal,
};
const TF: Topic =
    Topic { name: "/tf", message: Ros2Message::TfMessage, durability: Durability::Volatile };

/// Writes [`BAG_FILE`] and [`BAG_METADATA`] into `folder`, which is there; each whole or not at all.
///
/// # Errors
/// [`semfm_geom::Error::Io`] and [`semfm_views::Error::Io`] where the robot's description cannot be read or a file
/// cannot be written.
pub fn write_ros2_trajectory(folder: &Path, motion: &PlannedMotion) -> Result<()> {
    let description = read_file(&motion.scene.robot.urdf)?;
    let bag = Bag::new(motion, &String::from_utf8_lossy(&description));
    let (path, about) = (folder.join(BAG_FILE), folder.join(BAG_METADATA));
    refuse_input(&path)?;
    refuse_input(&about)?;
    bag.write(&path)?;
    Ok(write_atomically(&about, |out| out.write_all(bag.metadata_yaml().as_bytes()))?)
}

/// The messages of a bag.
struct Bag {
    topics: Vec<BagTopic>,
    duration_nanos: u64,
}

struct BagTopic {
    topic: Topic,
    /// Nanoseconds since the bag began, ascending, and messages in CDR.
    messages: Vec<(u64, Vec<u8>)>,
}

impl Bag {
    fn new(motion: &PlannedMotion, description: &str) -> Self {
        let mut text = Cdr::new();
        text.string(description);
        let once = |topic, message| BagTopic { topic, messages: vec![(0, message)] };
        let mut topics = vec![once(DESCRIPTION, text.into_bytes())];
        let states: Vec<TrajectoryPoint> = motion
            .times(STEP_SECONDS, MOST_STATES)
            .into_iter()
            .filter_map(|time| motion.trajectory.at(time))
            .collect();
        let frames = MovingFrames::new(motion, &states);
        topics.push(once(TF_STATIC, frames.message(&frames.still, 0, 0)));
        if let Some(hand) = &motion.scene.hand {
            topics.push(once(HAND, hand_markers(hand, &frames.frames)));
        }
        topics.push(once(ARM, arm_trajectory(motion)));
        if !motion.scene.robot.fingers.is_empty() {
            topics.push(once(FINGERS, finger_trajectory(motion)));
        }
        let timed = |message: &dyn Fn(usize, u64) -> Vec<u8>| -> Vec<(u64, Vec<u8>)> {
            let times = states.iter().map(|state| nanos(state.time)).enumerate();
            times.map(|(i, time)| (time, message(i, START_NANOS + time))).collect()
        };
        let joints = timed(&|i, stamp| joint_state(motion, &states[i], stamp));
        topics.push(BagTopic { topic: JOINTS, messages: joints });
        let moving = timed(&|i, stamp| frames.message(&frames.moving, i, stamp));
        topics.push(BagTopic { topic: TF, messages: moving });
        Self { topics, duration_nanos: nanos(motion.trajectory.duration()) }
    }

    /// Messages in the order of their times, those of one time in the order of the topics.
    fn write(&self, path: &Path) -> Result<()> {
        write_mcap(path, "ros2", ChunkCompression::Lz4, |file| {
            let entries = BTreeMap::from([("format".to_owned(), FORMAT.to_owned())]);
            file.metadata(METADATA_NAME, entries)?;
            let mut all: Vec<(u64, ChannelId, &[u8])> = Vec::new();
            for BagTopic { topic, messages } in &self.topics {
                let channel = topic.declare(file)?;
                all.extend(messages.iter().map(|(time, bytes)| (*time, channel, &bytes[..])));
            }
            all.sort_by_key(|message| message.0);
            all.iter().try_for_each(|&(time, channel, bytes)| {
                file.log_to(channel, START_NANOS + time, bytes)
            })
        })?;
        Ok(())
    }

    /// `metadata.yaml` in version 5 (Humble), which later releases read as well.
    fn metadata_yaml(&self) -> String {
        let n_messages: usize = self.topics.iter().map(|topic| topic.messages.len()).sum();
        let duration = self.duration_nanos;
        let mut text = format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    \
             nanoseconds: {duration}\n  starting_time:\n    nanoseconds_since_epoch: {START_NANOS}\n  \
             message_count: {n_messages}\n  topics_with_message_count:\n"
        );
        for BagTopic { topic, messages } in &self.topics {
            // Writing into a String does not fail.
            let _ = write!(
                text,
                "    - topic_metadata:\n        name: {}\n        type: {}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"{}\"\n      \
                 message_count: {}\n",
                topic.name,
                topic.message.name(),
                topic.qos().replace('\n', "\\n"),
                messages.len()
            );
        }
        let _ = write!(
            text,
            "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - \
             {BAG_FILE}\n  files:\n    - path: {BAG_FILE}\n      starting_time:\n        \
             nanoseconds_since_epoch: {START_NANOS}\n      duration:\n        nanoseconds: \
             {duration}\n      message_count: {n_messages}\n"
        );
        text
    }
}

impl Topic {
    fn declare(&self, file: &mut McapWriter<'_>) -> semfm_views::Result<ChannelId> {
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), self.qos())]);
        file.declare(self.name, &self.message.schema(), "cdr", &metadata)
    }

    /// The profile as rosbag2 writes it: numbers are those of `rmw/types.h`, times are "for ever".
    fn qos(&self) -> String {
        let (depth, durability) = match self.durability {
            Durability::TransientLocal => (1, 1),
            Durability::Volatile => (100, 2),
        };
        let ever = "sec: 9223372036\n    nsec: 854775807";
        format!(
            "- history: 1\n  depth: {depth}\n  reliability: 1\n  durability: {durability}\n  \
             deadline:\n    {ever}\n  lifespan:\n    {ever}\n  liveliness: 1\n  \
             liveliness_lease_duration:\n    {ever}\n  avoid_ros_namespace_conventions: false"
        )
    }
}

fn nanos(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e9).round() as u64
}

/// The arm's joints. The first point is the start at 0, times rise by at least a nanosecond, the last velocity is 0.
/// The stamp 0 asks a controller to begin at once.
fn arm_trajectory(motion: &PlannedMotion) -> Vec<u8> {
    let names = &motion.trajectory.joint_names;
    let mut points = points_once(motion);
    if let Some(last) = points.last_mut() {
        last.velocities.fill(0.0);
    }
    joint_trajectory(motion, names, points.iter())
}

/// The joints of the fingers at the times of the arm's points.
fn finger_trajectory(motion: &PlannedMotion) -> Vec<u8> {
    let fingers = &motion.scene.robot.fingers;
    let names: Vec<String> = fingers.iter().map(|finger| finger.name().to_owned()).collect();
    let points: Vec<TrajectoryPoint> = points_once(motion)
        .into_iter()
        .map(|point| TrajectoryPoint {
            positions: fingers.iter().map(|finger| finger.at(point.opening)).collect(),
            velocities: Vec::new(),
            accelerations: Vec::new(),
            ..point
        })
        .collect();
    joint_trajectory(motion, &names, points.iter())
}

/// All points in order; where two segments meet there is one.
fn points_once(motion: &PlannedMotion) -> Vec<TrajectoryPoint> {
    let mut points: Vec<TrajectoryPoint> = Vec::new();
    for point in motion.trajectory.segments.iter().flat_map(|segment| &segment.points) {
        if points.last().is_none_or(|last| nanos(point.time) > nanos(last.time)) {
            points.push(point.clone());
        }
    }
    points
}

fn joint_trajectory<'a>(
    motion: &PlannedMotion,
    names: &[String],
    points: impl ExactSizeIterator<Item = &'a TrajectoryPoint>,
) -> Vec<u8> {
    let robot = &motion.scene.robot;
    let mut cdr = Cdr::new();
    cdr.header(0, &robot.robot.links[robot.base].name);
    cdr.strings(names.iter().map(String::as_str));
    cdr.length(points.len());
    for point in points {
        for numbers in [&point.positions, &point.velocities, &point.accelerations] {
            cdr.f64s(numbers.iter().copied());
        }
        cdr.f64s(std::iter::empty()); // effort
        cdr.time(nanos(point.time));
    }
    cdr.into_bytes()
}

/// Every joint of the robot that turns or slides. Those outside the arm follow the opening or others; their speeds are
/// differences over a fifth of a millisecond.
fn joint_state(motion: &PlannedMotion, state: &TrajectoryPoint, stamp: u64) -> Vec<u8> {
    let robot = &motion.scene.robot;
    let positions = positions_of(motion, state);
    let duration = motion.trajectory.duration();
    let ends = [(state.time - HALF_SPAN).max(0.0), (state.time + HALF_SPAN).min(duration)];
    let near = ends.map(|time| motion.trajectory.at(time).map(|at| positions_of(motion, &at)));
    let velocity = |joint: usize| {
        let name = &robot.robot.joints[joint].name;
        if let Some(k) = motion.trajectory.joint_names.iter().position(|n| n == name) {
            return state.velocities[k];
        }
        match &near {
            [Some(a), Some(b)] if ends[1] > ends[0] => (b[joint] - a[joint]) / (ends[1] - ends[0]),
            _ => 0.0,
        }
    };
    let joints = robot.robot.joints.iter().enumerate();
    let shown: Vec<usize> =
        joints.filter(|(_, joint)| joint.kind.has_position()).map(|(i, _)| i).collect();
    let mut cdr = Cdr::new();
    cdr.header(stamp, "");
    cdr.strings(shown.iter().map(|&joint| robot.robot.joints[joint].name.as_str()));
    cdr.f64s(shown.iter().map(|&joint| positions[joint]));
    cdr.f64s(shown.iter().map(|&joint| velocity(joint)));
    cdr.f64s(std::iter::empty()); // effort
    cdr.into_bytes()
}

fn positions_of(motion: &PlannedMotion, state: &TrajectoryPoint) -> Vec<f64> {
    let SceneState { arm, opening, .. } = motion.state_of(state);
    motion.scene.robot.joint_positions(&arm, opening)
}

/// The frames of a motion: those that stay where they are in their parents, and those that move.
struct MovingFrames {
    frames: Vec<MotionFrame>,
    /// Poses in the parents' frames (states × frames).
    poses: Vec<Vec<parry3d_f64::math::Pose>>,
    still: Vec<usize>,
    moving: Vec<usize>,
}

impl MovingFrames {
    fn new(motion: &PlannedMotion, states: &[TrajectoryPoint]) -> Self {
        let frames = motion.scene.frames();
        let poses: Vec<_> =
            states.iter().map(|state| motion.scene.poses(&motion.state_of(state))).collect();
        let stays = |&i: &usize| poses.iter().all(|at| at[i] == poses[0][i]);
        let with_parent = (0..frames.len()).filter(|&i| frames[i].parent.is_some());
        let (still, moving) = with_parent.partition(stays);
        Self { frames, poses, still, moving }
    }

    /// Some frames at the `state`-th state as a `tf2_msgs/TFMessage`.
    fn message(&self, which: &[usize], state: usize, stamp: u64) -> Vec<u8> {
        let Some(poses) = self.poses.get(state) else { return Cdr::new().into_bytes() };
        let mut cdr = Cdr::new();
        cdr.length(which.len());
        for &i in which {
            let parent = self.frames[i].parent.map_or("", |parent| &self.frames[parent].name);
            let (position, rotation) = position_and_rotation(poses[i]);
            cdr.header(stamp, parent);
            cdr.string(&self.frames[i].name);
            cdr.pose(position, rotation);
        }
        cdr.into_bytes()
    }
}
