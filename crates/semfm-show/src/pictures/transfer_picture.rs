//! `transfer.png`: the source with its region and the target with what was found.
//!
//! One row for each object, source above, seen from the same two sides. The first two pictures show
//! the region in red; the third paints the source by position and takes the colours to the target with
//! the point map, so that equal colours are matched places.

use std::path::Path;

use semfm::Task;
use semfm::views::View;

use super::row_pictures::{RowColors, row_pictures};
use super::sheet::{Entry, Row, Sheet};
use super::{ObjectFigure, TransferFigure};
use crate::Result;
use crate::colors::weight_colors;

impl TransferFigure<'_> {
    /// Writes the picture of the transfer.
    ///
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
    /// cancelled.
    pub fn write_transfer_picture(&self, path: &Path, task: &Task) -> Result<()> {
        let row = |figure| row_pictures(figure, &[RowColors::of_transfer(figure)], task);
        let (source, target) = rayon::join(|| row(&self.source), || row(&self.target));
        self.write_transfer_sheet(path, &source?[0], &target?[0])
    }

    /// Writes the sheet from pictures that [`row_pictures`] drew.
    pub(super) fn write_transfer_sheet(
        &self,
        path: &Path,
        source: &[View],
        target: &[View],
    ) -> Result<()> {
        let rows = [
            Row { title: "source: the demonstrated region".into(), pictures: source },
            Row { title: format!("target: {}", self.verdict_line()), pictures: target },
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

impl RowColors {
    /// The region, and what is matched to what.
    pub(super) fn of_transfer(figure: &ObjectFigure<'_>) -> Self {
        Self {
            from_two_sides: weight_colors(figure.weights),
            from_the_best: figure.match_colors.clone(),
        }
    }
}
