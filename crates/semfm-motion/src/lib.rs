//! From a grasp to a motion: collision-free, timed paths of robot arms.
//!
//! Lengths are metres, angles radians, times seconds.

mod collision;
mod error;
mod gates;
mod hand;
mod planning;
mod trajectory;

pub use collision::{
    AttachedBody, CollisionBody, CollisionChecker, CollisionModel, CollisionSettings, Scene, SkipReason,
    SkippedPair,
};
pub use error::{Error, Result};
pub use gates::{Ending, Gate, GateCount, GraspOutcome, Obstruction, gate_table};
pub use hand::{Hand, HandPart, TargetGrasp};
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use parry3d_f64::math::Pose;
pub use planning::{
    BlendSettings, Contact, Curve, CurveCoefficients, JointRange, JointSpace, PlanSettings, Planned, PlannedPath,
    ShortenSettings, Validity, blend, path_length, plan_path, shorten,
};
pub use trajectory::{Segment, SegmentKind, Trajectory, TrajectoryPoint};
