//! An object of known shape followed through the frames of a depth camera.
//!
//! A [`Tracker`] takes depth images one after the other and says of each where the object is, how sure that is, and what
//! was seen of it ([`TrackRecord`]):
//!
//! * **First** the object is found by the global search of `semfm_align`, or given.
//! * **Then** its pose goes on from frame to frame: samples of its surface against the depth at their pixels, its outline
//!   against the jumps of the depth.
//! * **Each pose is held against the image.** Surface that should be seen and is speaks for it, surface that the camera
//!   looked through against it, and surface that something hides says nothing: an object that is hidden is not gone, and
//!   one that is gone is not tracked.
//! * **An object that is lost** is sought with a bounded number of hypotheses in each frame.
//! * **What was seen is remembered** for each place on the surface with a cap, so that old evidence decays; a region on the
//!   object gains or loses confidence by it.

mod depth_view;
mod error;
mod evidence;
mod first_pose;
mod followed;
mod foreground;
mod model;
mod motion;
mod outline;
mod probability;
mod record;
mod register;
mod search;
mod settings;
mod surface_memory;
mod tracker;
mod uncertainty;

pub use error::{Error, Result};
pub use record::{PoseEvidence, RegionRecord, TrackRecord, TrackState};
pub use settings::TrackSettings;
pub use tracker::{DepthFrame, Examined, Tracker};
