//! Results to be looked at.
//!
//! - [`write_transfer`] writes everything that a transfer leaves behind: the files for programs (by
//!   [`semfm::output`]), the pictures and the scene for Foxglove.
//! - [`TransferFigure`], [`write_grasp_picture`] and [`write_sheet`] draw pictures (PNG).
//! - [`groups_of_paths`] and [`write_page`] make one HTML page with an interactive viewer.
//!
//! Nothing below this crate draws: a robot build takes `semfm` alone.

mod error;
#[cfg(feature = "mcap")]
mod foxglove;
mod page;
mod pictures;
mod transfer_files;

pub use error::{Error, Result};
pub use page::{Group, Layer, Paint, Panel, Picture, groups_of_paths, write_page};
pub use pictures::{
    Sides, TransferFigure, paired_viewpoints, position_colors, viewpoints, write_grasp_picture,
    write_sheet,
};
pub use transfer_files::write_transfer;
