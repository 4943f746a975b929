//! `meaning.png`: what the two surfaces mean to the encoder.
//!
//! One row for each object, source above. Two pictures show the lifted features, their first three
//! principal directions as red, green and blue, in one basis for both objects: equal colours mean
//! the same. The third shows the semantic clusters, each anchor in the colour of its partner and
//! the rest in grey (figure 3 of the paper).

use std::path::Path;

use semfm_fmap::clusters::spectral_clusters;
use semfm_fmap::features::{CentredFeatures, JointFeatures};
use semfm_geom::{PointIndex, SemanticCloud, Task};
use semfm_views::{Paint, RenderSettings, View, render};

use super::{SIDE, viewpoints, write_sheet};
use crate::{PreparedObject, Region, Result, Transfer};

/// Features have unit RMS length: this much on each side of grey shows all but the outliers.
const SPREAD: f64 = 1.5;
/// Colours of the anchors, best first, told apart by colour-blind people, too (Okabe & Ito 2008).
const ANCHORS: [[f32; 3]; 6] = [
    [0.84, 0.37, 0.00],
    [0.00, 0.45, 0.70],
    [0.00, 0.62, 0.45],
    [0.80, 0.47, 0.65],
    [0.94, 0.89, 0.26],
    [0.34, 0.71, 0.91],
];
/// Clusters that are no anchors, by turns.
const REST: [[f32; 3]; 2] = [[0.82; 3], [0.68; 3]];

/// Writes the picture.
///
/// # Errors
/// Whatever clustering, rendering or writing reports.
pub fn write_meaning_picture(
    path: &Path,
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    transfer: &Transfer,
    task: &Task,
) -> Result<()> {
    let [source_meaning, target_meaning] = meaning_colors(&source.cloud, &target.cloud)?;
    let anchors = anchors_of_points(source, target, transfer, task)?;
    let mut pictures = row(source, region.weights(), &source_meaning, &anchors[0], task)?;
    pictures.extend(row(target, transfer.weights(), &target_meaning, &anchors[1], task)?);
    write_sheet(path, &pictures, 3)
}

/// The first three principal directions of the pair's features as colours of the clouds' points, in
/// one basis.
pub(crate) fn meaning_colors(
    source: &SemanticCloud,
    target: &SemanticCloud,
) -> Result<[Vec<[f32; 3]>; 2]> {
    let (source, target) = (CentredFeatures::new(source)?, CentredFeatures::new(target)?);
    let joint = JointFeatures::new(&source, &target, 3)?;
    let colors = |features: faer::MatRef<'_, f64>| {
        let channel = |i: usize, c: usize| {
            let value = if c < features.ncols() { features[(i, c)] } else { 0.0 };
            (value / (2.0 * SPREAD) + 0.5).clamp(0.0, 1.0) as f32
        };
        (0..features.nrows()).map(|i| std::array::from_fn(|c| channel(i, c))).collect()
    };
    Ok([colors(joint.source.as_ref()), colors(joint.target.as_ref())])
}

/// For each cloud point, source's and target's, the cluster it belongs to and the anchor that is.
pub(crate) type AnchorOfPoint = (u32, Option<usize>);

/// The clusters are made anew: they are a picture's matter, and cost some ten milliseconds.
pub(crate) fn anchors_of_points(
    source: &PreparedObject,
    target: &PreparedObject,
    transfer: &Transfer,
    task: &Task,
) -> Result<[Vec<AnchorOfPoint>; 2]> {
    let (settings, anchors) = (&transfer.report.settings.clusters, &transfer.report.anchors);
    let of = |object: &PreparedObject, side: fn(&semfm_fmap::Anchor) -> u32| {
        let clusters = spectral_clusters(&object.cloud, settings, task)?;
        let anchor = |label: u32| anchors.iter().position(|a| side(&a.anchor) == label);
        Result::Ok(clusters.labels().iter().map(|&label| (label, anchor(label))).collect())
    };
    Ok([of(source, |a| a.source)?, of(target, |a| a.target)?])
}

/// What belongs to the cloud point nearest to each vertex of the mesh as read.
pub(crate) fn by_vertex<T: Copy>(object: &PreparedObject, of_point: &[T]) -> Result<Vec<T>> {
    let index = PointIndex::new(object.cloud.points())?;
    let vertices = object.shape.original().vertices();
    Ok(vertices.iter().map(|&p| of_point[index.nearest(p).0]).collect())
}

/// The colour of an anchor by its rank, of what is none by a negative one.
pub(crate) fn anchor_color(rank: i64) -> [f32; 3] {
    usize::try_from(rank).map_or(REST[0], |rank| ANCHORS[rank % ANCHORS.len()])
}

fn row(
    object: &PreparedObject,
    weights: &[f64],
    meaning: &[[f32; 3]],
    anchors: &[AnchorOfPoint],
    task: &Task,
) -> Result<Vec<View>> {
    let mesh = object.shape.original();
    let [best, other] = viewpoints(mesh, weights, SIDE, task)?;
    let paint = |&(label, anchor): &AnchorOfPoint| match anchor {
        Some(rank) => anchor_color(rank as i64),
        None => REST[label as usize % REST.len()],
    };
    let parts: Vec<[f32; 3]> = anchors.iter().map(paint).collect();
    let (meaning, parts) = (by_vertex(object, meaning)?, by_vertex(object, &parts)?);
    let light = RenderSettings::default();
    let mut pictures = render(mesh, &Paint::Vertices(&meaning), &[best, other], &light, task)?;
    pictures.extend(render(mesh, &Paint::Vertices(&parts), &[best], &light, task)?);
    Ok(pictures)
}
