//! Collision-free paths in the space of joint values: search, shortening, rounding of corners.
//!
//! Nothing here knows a robot: [`Validity`] says which joint values are free, [`JointSpace`] which there are.

pub(crate) mod bisection;
mod blend;
mod curve;
mod edges;
pub(crate) mod joint_space;
mod rrt_connect;
mod sample_window;
mod shorten;
#[cfg(test)]
pub(crate) mod test_worlds;
#[cfg(test)]
mod tests;
mod tree;
mod validity;

pub use blend::{BlendSettings, blend};
pub(crate) use curve::CurvePiece;
pub use curve::{Curve, CurveCoefficients};
pub use joint_space::{JointRange, JointSpace};
pub use rrt_connect::{PlanSettings, Planned, PlannedPath, path_length, plan_path};
pub use shorten::{ShortenSettings, shorten};
pub use validity::{Contact, Validity};
