//! A tall basis, stored so that products with a narrow block stream through memory.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};

/// Rows of a panel: a multiple of the 48 rows that faer's product handles at a time, few enough for
/// some hundred columns to fit a core's second-level cache. 256 rows take 5 to 10 % longer, 512 and
/// 1024 about the same; one panel of all rows takes 10 to 20 % longer and, since it cannot be freed
/// piece by piece, twice the memory.
const PANEL_ROWS: usize = 384;

/// A matrix (n × capacity) cut into panels of rows, each stored column after column by itself.
///
/// All sums run over the panels in order on the calling thread: the same bytes every time.
pub(super) struct RowPanels {
    panels: Vec<Mat<f64>>,
    n_rows: usize,
}

impl RowPanels {
    /// Zeros (n × capacity).
    pub fn new(n_rows: usize, capacity: usize) -> Self {
        let heights = (0..n_rows).step_by(PANEL_ROWS).map(|row| PANEL_ROWS.min(n_rows - row));
        Self { panels: heights.map(|height| Mat::zeros(height, capacity)).collect(), n_rows }
    }

    fn with_first_rows(&self) -> impl Iterator<Item = (usize, &Mat<f64>)> {
        self.panels.iter().enumerate().map(|(p, panel)| (p * PANEL_ROWS, panel))
    }

    /// Overwrites the columns from `start` on by those of `block` (n × b).
    pub fn store(&mut self, start: usize, block: MatRef<'_, f64>) {
        for (p, panel) in self.panels.iter_mut().enumerate() {
            let rows = block.subrows(p * PANEL_ROWS, panel.nrows());
            panel.as_mut().subcols_mut(start, block.ncols()).copy_from(rows);
        }
    }

    /// Copies the columns from `start` on to `block` (n × b).
    pub fn load(&self, start: usize, mut block: MatMut<'_, f64>) {
        for (row, panel) in self.with_first_rows() {
            let columns = panel.as_ref().subcols(start, block.ncols());
            block.as_mut().subrows_mut(row, panel.nrows()).copy_from(columns);
        }
    }

    /// Takes out of `block` (n × b) its components along the orthonormal `columns`, and returns
    /// them (columns × b): one pass of classical Gram–Schmidt.
    pub fn project_out(&self, columns: Range<usize>, block: &mut Mat<f64>) -> Mat<f64> {
        let (start, count) = (columns.start, columns.len());
        // Wᵀ V rather than Vᵀ W: the product then rearranges the small factor, not the large one.
        let mut transposed = Mat::zeros(block.ncols(), count);
        for (row, panel) in self.with_first_rows() {
            let v = panel.as_ref().subcols(start, count);
            let w_t = block.as_ref().subrows(row, panel.nrows()).transpose();
            matmul(transposed.as_mut(), Accum::Add, w_t, v, 1.0, Par::Seq);
        }
        let components = transposed.transpose().to_owned();
        for (row, panel) in self.with_first_rows() {
            let v = panel.as_ref().subcols(start, count);
            let rows = block.as_mut().subrows_mut(row, panel.nrows());
            matmul(rows, Accum::Add, v, components.as_ref(), -1.0, Par::Seq);
        }
        components
    }

    /// Replaces the `columns` V by their combinations V S, S (columns × fewer), in place.
    pub fn rotate(&mut self, columns: Range<usize>, combinations: MatRef<'_, f64>) {
        let mut rotated = Mat::zeros(PANEL_ROWS, combinations.ncols());
        for panel in &mut self.panels {
            let mut rows = rotated.as_mut().subrows_mut(0, panel.nrows());
            let v = panel.as_ref().subcols(columns.start, columns.len());
            matmul(rows.as_mut(), Accum::Replace, v, combinations, 1.0, Par::Seq);
            let mut target = panel.as_mut().subcols_mut(columns.start, combinations.ncols());
            target.copy_from(rows);
        }
    }

    /// The combinations V S (n × fewer) of the `columns` V as an ordinary matrix. Each panel becomes its
    /// combinations first, so that basis and result are never both in memory as a whole.
    pub fn into_combinations(
        self,
        columns: Range<usize>,
        combinations: MatRef<'_, f64>,
    ) -> Mat<f64> {
        let combine = |panel: Mat<f64>| {
            let mut rows = Mat::zeros(panel.nrows(), combinations.ncols());
            let v = panel.as_ref().subcols(columns.start, columns.len());
            matmul(rows.as_mut(), Accum::Replace, v, combinations, 1.0, Par::Seq);
            rows
        };
        // In place in the list: a panel is freed before the next is combined.
        let mut panels = self.panels;
        for panel in &mut panels {
            *panel = combine(std::mem::replace(panel, Mat::zeros(0, 0)));
        }
        let mut result = Mat::zeros(self.n_rows, combinations.ncols());
        for (p, panel) in panels.into_iter().enumerate() {
            result.as_mut().subrows_mut(p * PANEL_ROWS, panel.nrows()).copy_from(panel);
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 700 rows: a whole panel and a piece. Column j is the unit vector e_{100 j}.
    fn unit_vectors() -> RowPanels {
        let mut basis = RowPanels::new(700, 7);
        basis.store(0, Mat::from_fn(700, 7, |i, j| f64::from(u8::from(i == 100 * j))).as_ref());
        basis
    }

    #[test]
    fn components_along_the_chosen_columns_are_taken_out_and_returned() {
        let mut block = Mat::from_fn(700, 2, |i, j| (i + j) as f64);
        let components = unit_vectors().project_out(1..6, &mut block);
        assert_eq!(components, Mat::from_fn(5, 2, |i, j| (100 * (i + 1) + j) as f64));
        for i in 0..700 {
            let taken = i % 100 == 0 && (1..6).contains(&(i / 100));
            assert_eq!(block[(i, 0)], if taken { 0.0 } else { i as f64 });
        }
    }

    #[test]
    fn rotating_in_place_and_reading_out_combine_alike() {
        let combinations = Mat::from_fn(5, 2, |i, j| (3 * i + j) as f64 - 4.0);
        let mut rotated = unit_vectors();
        rotated.rotate(2..7, combinations.as_ref());
        let mut in_place = Mat::zeros(700, 2);
        rotated.load(2, in_place.as_mut());
        assert_eq!(in_place, unit_vectors().into_combinations(2..7, combinations.as_ref()));
        assert_eq!(in_place[(300, 1)], 0.0);
    }
}
