//! Motions to be looked at: bodies at their frames, an animated model, and the folder of a plan.

mod animated_glb;
mod bodies;
mod frame_tracks;
mod plan_folder;

pub use animated_glb::write_animated_glb;
pub use plan_folder::{PLAN_FILES, write_plan, write_plan_folder, write_plan_picture};

pub(crate) use bodies::{Body, BodyKind, MotionBodies, affine_of};
pub(crate) use frame_tracks::{FrameTracks, continuous};
