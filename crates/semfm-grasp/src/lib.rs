//! Parallel-jaw grasps inside a region of a mesh or a point cloud, and the pose and scale of a
//! reconstruction in what a camera sees.
//!
//! A [`Gripper`] comes from a URDF or from a built-in parameter set. Frames, once and for all: a
//! gripper's own frame (TCP) has its origin between the finger pads, +z along the approach and y
//! along the closing direction; lengths are metres.

pub mod align;
mod error;
pub mod grasp;
pub mod gripper;
pub mod urdf;

pub use error::{Error, Result};
pub use grasp::Grasp;
pub use gripper::Gripper;
