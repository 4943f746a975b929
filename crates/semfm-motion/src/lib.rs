//! From a grasp to a motion: collision-free, timed paths of robot arms.
//!
//! Lengths are metres, angles radians, times seconds.

mod error;
mod trajectory;

pub use error::{Error, Result};
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use parry3d_f64::math::Pose;
pub use trajectory::{Segment, SegmentKind, Trajectory, TrajectoryPoint};
