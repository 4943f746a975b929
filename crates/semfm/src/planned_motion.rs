//! A motion with everything that is shown of it.

use parry3d_f64::math::Pose;
use semfm_motion::{SegmentKind, Trajectory, TrajectoryPoint};

use crate::{MotionScene, SceneState};

/// A trajectory of an arm, with the robot, what it handles and what stands around it.
#[derive(Clone, Debug)]
pub struct PlannedMotion {
    /// What is seen.
    pub scene: MotionScene,
    /// How the arm moves.
    pub trajectory: Trajectory,
    /// Which grasp it carries out: its place in the file of grasps, from 0.
    pub grasp: Option<usize>,
    /// What was found or assumed, in words.
    pub notes: Vec<String>,
}

impl PlannedMotion {
    /// When the object begins to move with the hand: the time at which the lift begins.
    pub fn lift_time(&self) -> Option<f64> {
        Some(self.trajectory.segment(SegmentKind::Lift)?.points.first()?.time)
    }

    /// Where everything stands at a time; `None` without any point.
    pub fn state_at(&self, time: f64) -> Option<SceneState> {
        Some(self.state_of(&self.trajectory.at(time)?))
    }

    /// Where everything stands at a state of the arm. The object moves with the hand once the lift has begun:
    ///
    /// > base_from_object = base_from_tip(t) · base_from_tip(t_lift)⁻¹ · base_from_object(0)
    pub fn state_of(&self, point: &TrajectoryPoint) -> SceneState {
        let arm = self.arm(point);
        let at_start = self.scene.object.as_ref().map_or(Pose::IDENTITY, |o| o.base_from_object);
        let lift = self.lift_time().filter(|&lift| point.time > lift);
        let grasped = lift.and_then(|lift| self.trajectory.at(lift));
        let base_from_object = grasped.map_or(at_start, |grasped| {
            let base_from_tip = self.scene.base_from_tip(&self.arm(&grasped), grasped.opening);
            let carried = base_from_tip.inverse() * at_start;
            self.scene.base_from_tip(&arm, point.opening) * carried
        });
        SceneState { arm, opening: point.opening, base_from_object }
    }

    /// Times from start to end, at most `step` seconds apart, evenly; the last is the end itself. At most `most`.
    pub fn times(&self, step: f64, most: usize) -> Vec<f64> {
        let duration = self.trajectory.duration();
        let n = ((duration / step).ceil() as usize).clamp(1, most.max(2) - 1);
        (0..=n).map(|i| if i == n { duration } else { duration * i as f64 / n as f64 }).collect()
    }

    fn arm(&self, point: &TrajectoryPoint) -> Vec<(String, f64)> {
        self.trajectory.joint_names.iter().cloned().zip(point.positions.iter().copied()).collect()
    }
}
