//! `transfer.png`: the source with its region and the target with what arrived, side by side.
//!
//! One row for each object, source above. The first two pictures show the region in red from where
//! it is seen best and from another side; the third paints the source by position and carries the
//! colours over with the point map, so that equal colours are matched places.

use std::path::Path;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use semfm_geom::math::{DVec3, bounds};
use semfm_geom::{Mesh, Task};
use semfm_views::{Camera, Paint, RenderSettings, RigSettings, View, render, rig};

use crate::{PreparedObject, Region, Result, Transfer};

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

/// Writes the picture of a transfer.
///
/// # Errors
/// Whatever rendering or writing reports.
pub fn write_picture(
    path: &Path,
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    transfer: &Transfer,
    task: &Task,
) -> Result<()> {
    let (source, target) = (source.shape.original(), target.shape.original());
    let source_places = position_colors(source.vertices());
    let matched: Vec<[f32; 3]> =
        transfer.point_map.source_of.iter().map(|&v| source_places[v as usize]).collect();
    let mut pictures = row(source, region.weights(), &source_places, task)?;
    pictures.extend(row(target, transfer.weights(), &matched, task)?);
    let sheet = sheet(&pictures, 3);
    let (width, height) = (3 * SIDE, 2 * SIDE);
    semfm_geom::io::write_atomically(path, |out| {
        PngEncoder::new(out)
            .write_image(&sheet, width, height, ExtendedColorType::Rgb8)
            .map_err(std::io::Error::other)
    })?;
    Ok(())
}

/// The three pictures of one object.
fn row(mesh: &Mesh, weights: &[f64], places: &[[f32; 3]], task: &Task) -> Result<Vec<View>> {
    let [best, other] = viewpoints(mesh, weights, SIDE, task)?;
    let marked = weight_colors(weights);
    let light = RenderSettings::default();
    let mut pictures = render(mesh, &Paint::Vertices(&marked), &[best, other], &light, task)?;
    pictures.extend(render(mesh, &Paint::Vertices(places), &[best], &light, task)?);
    Ok(pictures)
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

/// Pictures of equal size in rows of `columns`.
fn sheet(pictures: &[View], columns: usize) -> Vec<u8> {
    let line = 3 * SIDE as usize;
    pictures
        .chunks(columns)
        .flat_map(|row| {
            (0..SIDE as usize).flat_map(move |y| {
                row.iter().flat_map(move |view| &view.rgb[y * line..(y + 1) * line])
            })
        })
        .copied()
        .collect()
}
