//! One HTML page that holds results and the viewer for them, and needs no network.
//!
//! Meshes stand side by side, with layers of colour to choose from. Where a point map joins the
//! first to the second, pointing at one highlights the matched place of the other. The viewer
//! (`viewer/*.js`) is ours and draws with WebGL 2.

mod data;
mod document;
mod encoding;
mod grasps;
mod group;
mod mesh;
mod motion;
mod paths;
mod section;
mod transfer_folder;
#[cfg(feature = "mcap")]
mod views;

pub use document::{write_page, write_page_with};
pub use grasps::Hands;
pub use group::{Fact, Group, Layer, LegendEntry, Panel, Picture, VertexColors};
pub use motion::Motion;
pub use paths::groups_of_paths;
pub use section::{Figure, Section, Table};
