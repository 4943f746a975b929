//! From a grasp to a motion: collision-free, timed paths of robot arms.
//!
//! Lengths are metres, angles radians, times seconds.

mod cartesian;
mod collision;
mod error;
mod gates;
mod hand;
mod motion_planner;
mod motion_request;
mod planning;
mod reach;
mod step_checks;
mod timed_motion;
mod timing;
mod trajectory;

pub use cartesian::LineSettings;
pub use collision::{
    AttachedBody, CollisionBody, CollisionChecker, CollisionModel, CollisionSettings, Scene,
    SkipReason, SkippedPair,
};
pub use error::{Error, Result};
pub use gates::{Ending, Gate, GateCount, GraspOutcome, Obstruction, gate_table};
pub use hand::{Hand, HandPart, TargetGrasp};
pub use motion_planner::MotionPlanner;
pub use motion_request::{
    GraspMotion, MotionAnswer, MotionRequest, MotionSettings, NearestMiss, StartContact,
    TargetObject,
};
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use parry3d_f64::math::Pose;
pub use planning::{
    BlendSettings, Contact, Curve, CurveCoefficients, JointRange, JointSpace, PlanSettings,
    Planned, PlannedPath, ShortenSettings, Validity, blend, path_length, plan_path, shorten,
};
pub use timing::{
    CheckSettings, JointMotionLimit, MotionLimits, RetimeSettings, Retimed, Violation,
    ViolationKind, check_trajectory, retime,
};
pub use trajectory::{Segment, SegmentKind, Trajectory, TrajectoryPoint};
