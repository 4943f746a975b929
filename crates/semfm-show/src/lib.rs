//! Results to be looked at.
//!
//! - [`write_transfer`] writes everything that a transfer leaves behind: the files for programs (by
//!   [`semfm::files`]), the pictures and the scene for Foxglove.
//! - [`TransferFigure`], [`write_grasp_picture`] and [`write_sheet`] draw pictures (PNG).
//! - [`write_plan_folder`] writes a motion for programs, for ROS 2, for viewers and for people.
//! - [`Photo`] and [`contact_picture`] draw what was found over what a camera saw, and what a hand touched.
//! - [`groups_of_paths`] and [`write_page`] make one HTML page with an interactive viewer.
//! - `foxglove` (feature `mcap`) holds scenes for Foxglove.
//! - [`colors`] is the one table of colours, [`html`] the pieces that every page is made of.
//!
//! Nothing below this crate draws: a robot build takes `semfm` alone.

pub mod colors;
mod error;
#[cfg(feature = "mcap")]
pub mod foxglove;
mod hand;
pub mod html;
#[cfg(feature = "mcap")]
mod memory_files;
mod motion;
mod page;
mod pictures;
mod surface;
mod transfer_files;

pub use error::{Error, Result};
#[cfg(feature = "mcap")]
pub use memory_files::write_memory_transfer;
pub use motion::{
    PLAN_FILES, write_animated_glb, write_plan, write_plan_folder, write_plan_picture,
};
pub use page::{
    Fact, Figure, Group, Hands, Layer, LegendEntry, Motion, Panel, Picture, Section, Table,
    VertexColors, groups_of_paths, write_page, write_page_with,
};
#[cfg(feature = "mcap")]
pub use pictures::write_memory_picture;
pub use pictures::{
    NearMiss, Photo, RgbPicture, TintedMask, TransferFigure, Viewpoints, contact_picture,
    viewpoints, write_grasp_picture, write_miss_picture, write_motion_picture, write_sheet,
};
pub use transfer_files::{TRANSFER_FILES, TransferFiles, write_transfer};
