//! Foxglove's well-known messages made of our types, and read back.
//!
//! Only what several files need stands here; a message that one kind of file has alone is made where
//! that file is written.

mod camera;
mod mesh;
mod picture;
mod values;

pub use camera::{camera_calibration, camera_transform};
pub(super) use camera::{read_camera, read_transform};
pub use mesh::{Colors, MeshEntity, find_mesh, read_mesh};
pub(super) use picture::decode_png;
pub use picture::picture;
pub use values::{color, point, pose_at, scene_entity, timestamp, transform};
