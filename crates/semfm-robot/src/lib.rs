//! Robot descriptions and parallel-jaw grippers.
//!
//! [`urdf`] reads robot descriptions under limits and gives links and joints as plain data. A
//! [`Gripper`] comes from such a description or from a built-in parameter set. Its frame (TCP) has
//! its origin between the finger pads, +z along the approach and y along the closing direction;
//! lengths are metres, angles radians.

mod error;
pub mod gripper;
pub mod urdf;

pub use error::{Error, Result};
pub use gripper::Gripper;
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use parry3d_f64::math::Pose;
