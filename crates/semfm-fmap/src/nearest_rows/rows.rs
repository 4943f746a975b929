//! Rows put together from the columns of one or two matrices.

use std::borrow::Cow;

use faer::MatRef;

use crate::{Error, Result};

/// The numbers of a column.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    pub mean: f64,
    pub least: f64,
    pub greatest: f64,
}

impl Range {
    fn of(numbers: impl ExactSizeIterator<Item = f64>) -> Self {
        let n = numbers.len().max(1) as f64;
        let (mut sum, mut least, mut greatest) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        for x in numbers {
            sum += x;
            least = if x < least { x } else { least };
            greatest = if x > greatest { x } else { greatest };
        }
        Self { mean: sum / n, least, greatest }
    }

    /// At least as far as any number from `from`; NaN where one is.
    pub fn farthest(&self, from: f64) -> f64 {
        (self.greatest - from).max(from - self.least) + 0.0 * self.mean
    }
}

/// Rows put together from the columns of one or two matrices, without copying them:
/// \[left, scale · right\], on some rows or on all.
#[derive(Clone, Debug)]
pub(crate) struct Rows<'a> {
    /// One column each, and what it is multiplied by.
    columns: Vec<(Cow<'a, [f64]>, f64)>,
    /// Which rows; `None` for all.
    ids: Option<&'a [u32]>,
    n_rows: usize,
}

impl<'a> Rows<'a> {
    pub fn of(matrix: MatRef<'a, f64>) -> Self {
        let rows = Self { columns: Vec::new(), ids: None, n_rows: matrix.nrows() };
        rows.beside(matrix, 1.0)
    }

    /// The same rows continued by those of another matrix, scaled.
    pub fn beside(mut self, matrix: MatRef<'a, f64>, scale: f64) -> Self {
        assert_eq!(matrix.nrows(), self.n_rows, "one row beside one row");
        self.columns.extend(matrix.col_iter().map(|column| match column.try_as_col_major() {
            Some(column) => (Cow::Borrowed(column.as_slice()), scale),
            None => (Cow::Owned(column.iter().copied().collect()), scale),
        }));
        self
    }

    /// Only the rows with these ids, in that order.
    pub fn chosen(mut self, ids: &'a [u32]) -> Self {
        self.ids = Some(ids);
        self
    }

    pub fn len(&self) -> usize {
        self.ids.map_or(self.n_rows, <[u32]>::len)
    }

    pub fn n_columns(&self) -> usize {
        self.columns.len()
    }

    /// The numbers of row `i`.
    pub fn row(&self, i: usize) -> impl Iterator<Item = f64> {
        let row = self.row_id(i);
        self.columns.iter().map(move |(column, scale)| scale * column[row])
    }

    /// A column of the matrix behind the rows, and what its numbers are multiplied by.
    pub fn column(&self, c: usize) -> (&[f64], f64) {
        let (column, scale) = &self.columns[c];
        (column, *scale)
    }

    /// Where some rows stand in the matrix.
    pub fn row_ids(&self, rows: &[u32]) -> Vec<u32> {
        rows.iter().map(|&row| self.row_id(row as usize) as u32).collect()
    }

    /// Number `c` of some rows.
    pub fn entries(&self, c: usize, rows: &[u32]) -> impl Iterator<Item = f64> {
        let (column, scale) = &self.columns[c];
        rows.iter().map(move |&i| scale * column[self.row_id(i as usize)])
    }

    fn row_id(&self, i: usize) -> usize {
        self.ids.map_or(i, |ids| ids[i] as usize)
    }

    /// What there is in each column.
    pub fn ranges(&self) -> Vec<Range> {
        let columns = self.columns.iter();
        columns
            .map(|(column, scale)| match self.ids {
                None => Range::of(column.iter().map(|x| scale * x)),
                Some(ids) => Range::of(ids.iter().map(|&i| scale * column[i as usize])),
            })
            .collect()
    }

    /// Checks that every chosen row holds finite numbers alone.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] with the first that is not.
    pub fn check_finite(&self, what: &'static str) -> Result<()> {
        for c in 0..self.n_columns() {
            let column = &self.columns[c].0;
            let bad = (0..self.len()).find(|&i| !column[self.row_id(i)].is_finite());
            if let Some(i) = bad {
                let found = format!("{} in row {i}, column {c}", column[self.row_id(i)]);
                return Error::out_of_range(what, "finite numbers", found);
            }
        }
        Ok(())
    }
}
