//! Pictures of results: what was carried where, and how a hand takes it.

mod grasps;
pub(crate) mod meaning;
mod transfer;

use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use semfm_geom::math::{DVec3, bounds};
use semfm_geom::{Mesh, Task};
use semfm_views::{Camera, Paint, RenderSettings, RigSettings, View, render, rig};

pub use grasps::write_grasp_picture;
pub use meaning::write_meaning_picture;
pub use transfer::write_picture;

use crate::{Error, Region, Result};

/// Side of each picture in pixels.
const SIDE: u32 = 420;
/// Side of the small pictures that the viewpoints are chosen by.
const SCOUT: u32 = 96;
/// The second viewpoint looks from at least this far round (cosine): nearer shows the same again,
/// farther leaves too few to choose from.
const OTHER_SIDE: f64 = 0.3;
/// Colour without and with full weight, as sRGB in 0..1.
const PLAIN: [f32; 3] = [0.78, 0.78, 0.78];
const MARKED: [f32; 3] = [0.86, 0.16, 0.16];

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

/// From where the region shows the most pixels, and the best view from another side; both for
/// pictures of `side` pixels.
///
/// # Errors
/// Whatever rendering reports.
pub fn viewpoints(mesh: &Mesh, weights: &[f64], side: u32, task: &Task) -> Result<[Camera; 2]> {
    let scouts = rig(mesh, &RigSettings { size: SCOUT, count: 24, ..Default::default() })?;
    let full = rig(mesh, &RigSettings { size: side, count: 24, ..Default::default() })?;
    let views = render(mesh, &Paint::default(), &scouts, &RenderSettings::default(), task)?;
    let shown: Vec<usize> = views
        .iter()
        .map(|view| {
            let inside = |&t: &i32| {
                usize::try_from(t).is_ok_and(|t| {
                    mesh.faces()[t].iter().any(|&v| weights[v as usize] >= Region::COUNTS)
                })
            };
            // A region hidden from everywhere still deserves the fullest view of the object.
            let object = view.triangles.iter().filter(|&&t| t >= 0).count();
            1000 * view.triangles.iter().filter(|t| inside(t)).count() + object
        })
        .collect();
    let best = (0..full.len()).max_by_key(|&i| (shown[i], std::cmp::Reverse(i))).unwrap_or(0);
    let forward = |i: usize| full[i].camera_from_object.matrix3.row(2);
    let other = (0..full.len())
        .filter(|&i| forward(i).dot(forward(best)) < OTHER_SIDE)
        .max_by_key(|&i| (shown[i], std::cmp::Reverse(i)))
        .unwrap_or(best);
    Ok([full[best], full[other]])
}

/// Writes pictures of one size as one PNG, in rows of `columns` (at least 1), whole or not at all.
///
/// # Errors
/// [`Error::Invalid`] for no pictures or pictures of several sizes, [`semfm_geom::Error::Io`].
pub fn write_sheet(path: &Path, pictures: &[View], columns: usize) -> Result<()> {
    let size = |view: &View| (view.camera.width, view.camera.height);
    let Some((side, height)) = pictures.first().map(size) else {
        return Err(Error::invalid("pictures of a sheet", "at least one", "none"));
    };
    if let Some(other) = pictures.iter().find(|view| size(view) != (side, height)) {
        let expected = format!("{side} × {height} pixels each");
        return Err(Error::invalid("pictures of a sheet", expected, format!("{:?}", size(other))));
    }
    let columns = columns.clamp(1, pictures.len());
    let (line, n_rows) = (3 * side as usize, pictures.len().div_ceil(columns));
    let (width, total) = (columns as u32 * side, n_rows as u32 * height);
    let mut sheet = vec![u8::MAX; columns * line * total as usize];
    for (k, view) in pictures.iter().enumerate() {
        let (row, column) = (k / columns, k % columns);
        for (y, pixels) in view.rgb.chunks_exact(line).enumerate() {
            let start = ((row * height as usize + y) * columns + column) * line;
            sheet[start..start + line].copy_from_slice(pixels);
        }
    }
    semfm_geom::io::write_atomically(path, |out| {
        PngEncoder::new(out)
            .write_image(&sheet, width, total, ExtendedColorType::Rgb8)
            .map_err(std::io::Error::other)
    })?;
    Ok(())
}
