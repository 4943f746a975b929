//! A timed motion: positions, velocities and accelerations of joints over time.

use serde::{Deserialize, Serialize};

/// What an arm does over time, in segments that follow one another without a gap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trajectory {
    /// The arm's joints, from base to tip; the order of every list of joint values.
    pub joint_names: Vec<String>,
    /// The segments in order; each begins at the time and in the state in which the one before ends.
    pub segments: Vec<Segment>,
}

/// A part of a trajectory with one purpose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// What it is for.
    pub kind: SegmentKind,
    /// At least two, times strictly rising; the first and the last at rest. Between two points each joint follows the
    /// cubic polynomial that their positions and velocities determine.
    pub points: Vec<TrajectoryPoint>,
}

/// What a segment is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmentKind {
    /// Through free space from the start to before the grasp, hand open.
    ToPreGrasp,
    /// Straight along the approach direction to the grasp.
    Approach,
    /// The arm stands, the fingers close.
    Close,
    /// Straight up with the object.
    Lift,
}

/// The state of an arm at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryPoint {
    /// Seconds since the trajectory began.
    pub time: f64,
    /// Radians or metres, one a joint.
    pub positions: Vec<f64>,
    /// Per second.
    pub velocities: Vec<f64>,
    /// Per second squared.
    pub accelerations: Vec<f64>,
    /// Distance between the finger pads, metres.
    pub opening: f64,
}
