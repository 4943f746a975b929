//! `meaning.png`: the features of both surfaces, their clusters and anchors.
//!
//! One row for each object, source above. Two pictures show the lifted features, their first three
//! principal directions as red, green and blue, in one basis for both objects: equal colours mean
//! the same. The third shows the semantic clusters, each anchor in the colour of its partner and
//! the rest in grey (figure 3 of the paper).

use std::path::Path;

use semfm::fmap::PreparedObject;
use semfm::fmap::features::JointFeatures;
use semfm::geom::Task;
use semfm::output::ObjectAnchors;
use semfm::views::{Paint, RenderSettings, View, render};

use super::sheet::{Entry, Row, Sheet};
use super::transfer_figure::by_vertex;
use super::{Sides, TransferFigure};
use crate::Result;

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

impl TransferFigure<'_> {
    /// Writes the picture of the features, clusters and anchors.
    ///
    /// # Errors
    /// Whatever rendering or writing reports.
    pub fn write_features_picture(&self, path: &Path, task: &Task) -> Result<()> {
        let [source, target] = [0, 1].map(|side| self.feature_pictures(side, task));
        let (source, target) = (source?, target?);
        let rows = [
            Row { title: "source".into(), pictures: &source },
            Row { title: "target".into(), pictures: &target },
        ];
        let mut legend: Vec<Entry> = self
            .transfer
            .report
            .anchors
            .iter()
            .enumerate()
            .map(|(rank, anchor)| {
                let words = format!("anchor {}: cosine {:.2}", rank + 1, anchor.anchor.cosine);
                Entry::Swatch(anchor_color(rank as i64), words)
            })
            .collect();
        legend.push(Entry::Swatch(REST[0], "other clusters".into()));
        let words = "features: three principal components, one basis for both objects";
        legend.push(Entry::Words(words.into()));
        let columns = ["lifted features", "from another side", "clusters and anchors"];
        Sheet { columns: &columns, rows: &rows, legend: &legend }.write(path)
    }

    fn feature_pictures(&self, side: usize, task: &Task) -> Result<Vec<View>> {
        let (object, Sides { best, other, .. }) = (self.objects()[side], self.sides[side]);
        let clusters = by_vertex(object, &cluster_colors(&self.anchors[side]));
        let features = by_vertex(object, &self.feature_colors[side]);
        let (mesh, light) = (object.shape.original(), RenderSettings::default());
        let mut pictures = render(mesh, &Paint::Vertices(&features), &[best, other], &light, task)?;
        pictures.extend(render(mesh, &Paint::Vertices(&clusters), &[best], &light, task)?);
        Ok(pictures)
    }
}

/// The first three principal directions of the pair's features as colours of the clouds' points, in
/// one basis.
pub(super) fn feature_colors(
    source: &PreparedObject,
    target: &PreparedObject,
) -> Result<[Vec<[f32; 3]>; 2]> {
    let joint = JointFeatures::new(source.features(), target.features(), 3)?;
    let colors = |features: faer::MatRef<'_, f64>| {
        let channel = |i: usize, c: usize| {
            let value = if c < features.ncols() { features[(i, c)] } else { 0.0 };
            (value / (2.0 * SPREAD) + 0.5).clamp(0.0, 1.0) as f32
        };
        (0..features.nrows()).map(|i| std::array::from_fn(|c| channel(i, c))).collect()
    };
    Ok([colors(joint.source.as_ref()), colors(joint.target.as_ref())])
}

/// The colour of each cloud point: that of the anchor that its cluster is, grey without.
fn cluster_colors(anchors: &ObjectAnchors) -> Vec<[f32; 3]> {
    let clusters = anchors.cluster_of_point.iter();
    let color = |(&cluster, &rank): (&u32, &i64)| match rank {
        -1 => REST[cluster as usize % REST.len()],
        rank => anchor_color(rank),
    };
    clusters.zip(&anchors.of_point).map(color).collect()
}

/// The colour of an anchor by its rank, of what is none by a negative one.
pub(crate) fn anchor_color(rank: i64) -> [f32; 3] {
    usize::try_from(rank).map_or(REST[0], |rank| ANCHORS[rank % ANCHORS.len()])
}
