//! `transfer.png`: the source with its region and the target with what arrived.
//!
//! One row for each object, source above, seen from the same two sides. The first two pictures show
//! the region in red; the third paints the source by position and carries the colours over with the
//! point map, so that equal colours are matched places.

use std::path::Path;

use semfm::geom::{Mesh, Task};
use semfm::views::{Paint, RenderSettings, View, render};
use semfm::weight_colors::weight_colors;

use super::sheet::{Entry, Row, Sheet};
use super::{Sides, TransferFigure};
use crate::Result;

impl TransferFigure<'_> {
    /// Writes the picture of the transfer.
    ///
    /// # Errors
    /// Whatever rendering or writing reports.
    pub fn write_transfer_picture(&self, path: &Path, task: &Task) -> Result<()> {
        let [source, target] = [0, 1].map(|side| {
            let (mesh, weights) = (self.meshes()[side], self.weights()[side]);
            pictures(mesh, weights, &self.places[side], &self.sides[side], task)
        });
        let (source, target) = (source?, target?);
        let rows = [
            Row { title: "source: the demonstrated region".into(), pictures: &source },
            Row { title: format!("target: {}", self.answer()), pictures: &target },
        ];
        let mut legend = vec![
            Entry::Weights,
            Entry::Words("colour transfer: equal colours, matched places".into()),
        ];
        let others: Vec<String> = self
            .transfer
            .hypotheses
            .iter()
            .skip(1)
            .map(|hypothesis| format!("{:.0} %", 100.0 * hypothesis.probability))
            .collect();
        if !others.is_empty() {
            legend.push(Entry::Words(format!("other places it may belong: {}", others.join(", "))));
        }
        let columns = ["region", "from another side", "colour transfer"];
        Sheet { columns: &columns, rows: &rows, legend: &legend }.write(path)
    }
}

/// The three pictures of one object.
fn pictures(
    mesh: &Mesh,
    weights: &[f64],
    places: &[[f32; 3]],
    &Sides { best, other, .. }: &Sides,
    task: &Task,
) -> Result<Vec<View>> {
    let marked = weight_colors(weights);
    let light = RenderSettings::default();
    let mut pictures = render(mesh, &Paint::Vertices(&marked), &[best, other], &light, task)?;
    pictures.extend(render(mesh, &Paint::Vertices(places), &[best], &light, task)?);
    Ok(pictures)
}
