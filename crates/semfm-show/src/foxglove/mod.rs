//! Scenes for Foxglove and viewers like it, as MCAP files: coloured meshes, point clouds, labels, lines
//! and pictures, in frames that stand side by side; and motions, in frames that move.

mod items;
mod layout;
mod messages;
mod motion_scene;
mod point_cloud;
mod scene;
mod transfer_scene;

pub use items::{
    NamedNumbers, SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers,
    ScenePicture, ScenePoint, ScenePoints, Severity,
};
pub use point_cloud::{ColoredPoints, read_cloud};
pub use scene::FoxgloveScene;

pub(crate) use motion_scene::write_motion_scene;
pub(crate) use transfer_scene::write_transfer_scene;
