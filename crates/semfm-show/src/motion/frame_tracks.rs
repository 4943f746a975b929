//! Where the frames of a motion stand over time, sampled once for everything that shows it.

use semfm::motion::TrajectoryPoint;
use semfm::robot::Pose;
use semfm::{MotionScene, PlannedMotion};

/// Between two samples, seconds: 50 a second look smooth.
const STEP: f64 = 0.02;
/// Most samples: a minute and a half at the full rate.
const MOST: usize = 4500;

/// Samples of a motion, evenly from its start to its end.
#[derive(Clone, Debug)]
pub(crate) struct FrameTracks {
    /// The arm at each sample.
    pub points: Vec<TrajectoryPoint>,
    /// Poses of the frames in their parents' frames (samples × frames).
    pub poses: Vec<Vec<Pose>>,
}

impl FrameTracks {
    pub(crate) fn new(motion: &PlannedMotion) -> Self {
        let times = motion.times(STEP, MOST).into_iter();
        let points: Vec<TrajectoryPoint> =
            times.filter_map(|time| motion.trajectory.at(time)).collect();
        let poses =
            points.iter().map(|point| motion.scene.poses(&motion.state_of(point))).collect();
        Self { points, poses }
    }

    /// Whether a frame moves in its parent's.
    pub(crate) fn moves(&self, frame: usize) -> bool {
        self.poses.iter().any(|poses| poses[frame] != self.poses[0][frame])
    }

    /// The frame's pose in its parent's over time, see [`continuous`].
    pub(crate) fn track(&self, frame: usize) -> Vec<Pose> {
        continuous(self.poses.iter().map(|poses| poses[frame]))
    }

    /// Poses in the base link's frame (samples × frames).
    pub(crate) fn in_base(&self, scene: &MotionScene) -> Vec<Vec<Pose>> {
        let frames = scene.frames();
        self.poses.iter().map(|poses| scene.in_base(&frames, poses)).collect()
    }
}

/// Poses whose rotations have the sign that is nearer to the one before: between two of them, numbers may be mixed.
pub(crate) fn continuous(poses: impl Iterator<Item = Pose>) -> Vec<Pose> {
    let mut track: Vec<Pose> = Vec::new();
    for pose in poses {
        let turned = track.last().is_some_and(|last| last.rotation.dot(pose.rotation) < 0.0);
        let rotation = if turned { -pose.rotation } else { pose.rotation };
        track.push(Pose::from_parts(pose.translation, rotation));
    }
    track
}
