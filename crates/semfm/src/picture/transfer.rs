//! `transfer.png`: the source with its region and the target with what arrived, side by side.
//!
//! One row for each object, source above. The first two pictures show the region in red from where
//! it is seen best and from another side; the third paints the source by position and carries the
//! colours over with the point map, so that equal colours are matched places.

use std::path::Path;

use semfm_geom::{Mesh, Task};
use semfm_views::{Paint, RenderSettings, View, render};

use super::{SIDE, position_colors, viewpoints, weight_colors, write_sheet};
use crate::{PreparedObject, Region, Result, Transfer};

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
    write_sheet(path, &pictures, 3)
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
