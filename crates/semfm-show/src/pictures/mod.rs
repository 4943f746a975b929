//! Pictures of results: what was transferred where, the features of the surfaces, grasps.

mod features;
mod grasps;
mod sheet;
mod stroke_font;
mod transfer;
mod transfer_figure;
mod upright;
mod viewpoints;

use semfm::geom::math::{DVec3, bounds};

pub use grasps::write_grasp_picture;
pub use sheet::write_sheet;
pub use transfer_figure::TransferFigure;
pub use viewpoints::{Sides, paired_viewpoints, viewpoints};

pub(crate) use features::anchor_color;
pub(crate) use grasps::{SHOWN, hand_color, sides_with_hands};

/// Side of each picture in pixels.
const SIDE: u32 = 420;
/// Positions as colours: x, y, z over the bounding box.
pub fn position_colors(points: &[DVec3]) -> Vec<[f32; 3]> {
    let Some((low, high)) = bounds(points) else { return Vec::new() };
    let extent = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
    let color = |&p: &DVec3| ((p - low) / extent * 0.8 + 0.15).as_vec3().to_array();
    points.iter().map(color).collect()
}
