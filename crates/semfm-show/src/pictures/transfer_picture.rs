//! `transfer.png`: the source with its region and the target with what was found.
//!
//! One row for each object, source above, seen from the same two sides. The first two pictures show
//! the region in red; the third paints the source by position and takes the colours to the target with
//! the point map, so that equal colours are matched places.

use std::path::Path;

use semfm::Task;
use semfm::views::{RenderSettings, SurfaceColor, View, render};

use super::sheet::{Entry, Row, Sheet};
use super::{ObjectFigure, TransferFigure, Viewpoints};
use crate::Result;
use crate::colors::weight_colors;

impl TransferFigure<'_> {
    /// Writes the picture of the transfer.
    ///
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
    /// cancelled.
    pub fn write_transfer_picture(&self, path: &Path, task: &Task) -> Result<()> {
        let (source, target) =
            rayon::join(|| pictures(&self.source, task), || pictures(&self.target, task));
        let (source, target) = (source?, target?);
        let rows = [
            Row { title: "source: the demonstrated region".into(), pictures: &source },
            Row { title: format!("target: {}", self.verdict_line()), pictures: &target },
        ];
        let columns = ["region", "from another side", "colour transfer"];
        Sheet { columns: &columns, rows: &rows, legend: &self.legend() }.write(path)
    }

    fn legend(&self) -> Vec<Entry> {
        let mut legend = vec![
            Entry::Weights,
            Entry::Note("colour transfer: equal colours, matched places".into()),
        ];
        let others: Vec<String> = self
            .transfer
            .hypotheses
            .iter()
            .skip(1)
            .map(|hypothesis| format!("{:.0} %", 100.0 * hypothesis.probability))
            .collect();
        if !others.is_empty() {
            legend.push(Entry::Note(format!("other places it may belong: {}", others.join(", "))));
        }
        legend
    }
}

/// The three pictures of one object.
fn pictures(figure: &ObjectFigure<'_>, task: &Task) -> Result<Vec<View>> {
    let Viewpoints { best, other, .. } = figure.viewpoints;
    let (mesh, light) = (figure.mesh(), RenderSettings::default());
    let weights = weight_colors(figure.weights);
    let mut pictures =
        render(mesh, &SurfaceColor::Vertices(&weights), &[best, other], &light, task)?;
    let matches = SurfaceColor::Vertices(&figure.match_colors);
    pictures.extend(render(mesh, &matches, &[best], &light, task)?);
    Ok(pictures)
}
