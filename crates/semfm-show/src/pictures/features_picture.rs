//! `features.png`: the features of both surfaces, their clusters and anchors.
//!
//! One row for each object, source above. Two pictures show the lifted features, their first three
//! principal directions as red, green and blue, in one basis for both objects: equal colours are equal
//! features. The third shows the semantic clusters, each anchor in the colour of its partner and the
//! rest in grey (figure 3 of the paper).

use std::path::Path;

use semfm::files::ObjectAnchors;
use semfm::views::View;

use super::row_pictures::RowColors;
use super::sheet::{Entry, Row, Sheet};
use super::{ObjectFigure, TransferFigure};
use crate::Result;
use crate::colors::{anchor_color, cluster_color};

impl TransferFigure<'_> {
    /// Writes the sheet from pictures that [`row_pictures`](super::row_pictures::row_pictures) drew.
    pub(super) fn write_features_sheet(
        &self,
        path: &Path,
        source: &[View],
        target: &[View],
    ) -> Result<()> {
        let rows = [
            Row { title: "source".into(), pictures: source },
            Row { title: "target".into(), pictures: target },
        ];
        let anchors = self.transfer.report.anchors.iter().enumerate();
        let mut legend: Vec<Entry> = anchors
            .map(|(rank, anchor)| {
                let text = format!("anchor {}: cosine {:.2}", rank + 1, anchor.anchor.cosine);
                Entry::Swatch(anchor_color(rank as i64), text)
            })
            .collect();
        legend.push(Entry::Swatch(anchor_color(-1), "other clusters".into()));
        let text = "features: three principal components, one basis for both objects";
        legend.push(Entry::Note(text.into()));
        let columns = ["lifted features", "from another side", "clusters and anchors"];
        Sheet { columns: &columns, rows: &rows, legend: &legend }.write(path)
    }
}

impl RowColors {
    /// The features, and the clusters with their anchors.
    pub(super) fn of_features(figure: &ObjectFigure<'_>) -> Self {
        Self {
            from_two_sides: figure.onto_vertices(&figure.feature_colors),
            from_the_best: figure.onto_vertices(&cluster_colors(&figure.anchors)),
        }
    }
}

/// The colour of each cloud point's cluster.
fn cluster_colors(anchors: &ObjectAnchors) -> Vec<[f32; 3]> {
    let clusters = anchors.cluster_of_point.iter().zip(&anchors.of_point);
    clusters.map(|(&cluster, &rank)| cluster_color(cluster, rank)).collect()
}
