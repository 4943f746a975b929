//! Pictures of results: what was carried where, what the surfaces mean, how a hand takes it.

mod exhibit;
mod grasps;
mod letters;
mod meaning;
mod sheet;
mod transfer;
mod upright;
mod viewpoints;

use semfm_geom::math::{DVec3, bounds};

pub use exhibit::Exhibit;
pub use grasps::write_grasp_picture;
pub use sheet::write_sheet;
pub use viewpoints::{Sides, paired_viewpoints, viewpoints};

pub(crate) use grasps::{SHOWN, hand_color, sides_with_hands};
pub(crate) use meaning::anchor_color;
pub(crate) use sheet::bytes;

/// Side of each picture in pixels.
const SIDE: u32 = 420;
/// Colour without and with full weight, as sRGB in 0..1.
pub(crate) const PLAIN: [f32; 3] = [0.78, 0.78, 0.78];
pub(crate) const MARKED: [f32; 3] = [0.86, 0.16, 0.16];

/// The colour of each weight: grey to red. One half is where [`regions::painted`] draws its line.
///
/// [`regions::painted`]: crate::regions::painted
pub fn weight_colors(weights: &[f64]) -> Vec<[f32; 3]> {
    let mix = |w: f32| std::array::from_fn(|c| PLAIN[c] + w * (MARKED[c] - PLAIN[c]));
    weights.iter().map(|&w| mix(w.clamp(0.0, 1.0) as f32)).collect()
}

/// Positions as colours: x, y, z over the bounding box.
pub fn position_colors(points: &[DVec3]) -> Vec<[f32; 3]> {
    let Some((low, high)) = bounds(points) else { return Vec::new() };
    let extent = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
    let color = |&p: &DVec3| ((p - low) / extent * 0.8 + 0.15).as_vec3().to_array();
    points.iter().map(color).collect()
}
