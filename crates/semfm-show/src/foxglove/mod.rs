//! Scenes for Foxglove and its like.

mod transfer_scene;

pub(crate) use transfer_scene::write_transfer_scene;
