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
    /// Of some numbers times a factor.
    fn of(numbers: &[f64], factor: f64) -> Self {
        let mut lanes = Lanes {
            sums: [0.0; LANES],
            least: [f64::INFINITY; LANES],
            greatest: [f64::NEG_INFINITY; LANES],
        };
        let (whole, rest) = numbers.as_chunks::<LANES>();
        for numbers in whole {
            for (lane, x) in numbers.iter().enumerate() {
                lanes.add(lane, factor * x);
            }
        }
        rest.iter().for_each(|x| lanes.add(0, factor * x));
        Self {
            mean: lanes.sums.iter().sum::<f64>() / numbers.len().max(1) as f64,
            least: lanes.least.into_iter().fold(f64::INFINITY, f64::min),
            greatest: lanes.greatest.into_iter().fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// At least as far as any number from `from`; NaN where one is.
    pub fn farthest(&self, from: f64) -> f64 {
        (self.greatest - from).max(from - self.least) + 0.0 * self.mean
    }
}

/// Sums and comparisons that run side by side, where one after the other each would wait for the last.
struct Lanes {
    sums: [f64; LANES],
    least: [f64; LANES],
    greatest: [f64; LANES],
}

const LANES: usize = 8;

impl Lanes {
    #[inline(always)]
    fn add(&mut self, lane: usize, x: f64) {
        self.sums[lane] += x;
        self.least[lane] = if x < self.least[lane] { x } else { self.least[lane] };
        self.greatest[lane] = if x > self.greatest[lane] { x } else { self.greatest[lane] };
    }
}

/// The columns of a matrix, each with what it is multiplied by.
fn columns<'a>(matrix: MatRef<'a, f64>, scale: f64) -> impl Iterator<Item = (Cow<'a, [f64]>, f64)> {
    matrix.col_iter().map(move |column| match column.try_as_col_major() {
        Some(column) => (Cow::Borrowed(column.as_slice()), scale),
        None => (Cow::Owned(column.iter().copied().collect()), scale),
    })
}

/// Rows put together from the columns of one or two matrices (left and scale · right, in turns), without copying them, on
/// some rows or on all.
#[derive(Clone, Debug)]
pub(crate) struct Rows<'a> {
    /// One column each, and what it is multiplied by.
    columns: Vec<(Cow<'a, [f64]>, f64)>,
    /// Which rows; `None` for all.
    ids: Option<&'a [u32]>,
    /// Which of equal rows counts as the first: that of the lowest rank; `None` for that of the lowest number.
    ranks: Option<&'a [u32]>,
    n_rows: usize,
}

impl<'a> Rows<'a> {
    pub fn of(matrix: MatRef<'a, f64>) -> Self {
        let columns = columns(matrix, 1.0).collect();
        Self { columns, ids: None, ranks: None, n_rows: matrix.nrows() }
    }

    /// The same rows with the numbers of another matrix, scaled, between theirs: the columns of both take turns. Where
    /// each has its telling columns first, so have both together, and a search that looks at those first leaves more out.
    pub fn beside(mut self, matrix: MatRef<'a, f64>, scale: f64) -> Self {
        assert_eq!(matrix.nrows(), self.n_rows, "one row beside one row");
        let (mut left, mut right) = (self.columns.into_iter(), columns(matrix, scale));
        let mut both = Vec::with_capacity(left.len() + matrix.ncols());
        loop {
            let turn = [left.next(), right.next()];
            if turn.iter().all(Option::is_none) {
                break;
            }
            both.extend(turn.into_iter().flatten());
        }
        self.columns = both;
        self
    }

    /// Only the rows with these ids, in that order.
    pub fn chosen(mut self, ids: &'a [u32]) -> Self {
        self.ids = Some(ids);
        self
    }

    /// The same rows, of which that of the lowest rank (one for each) counts as the first.
    pub fn ranked(mut self, ranks: &'a [u32]) -> Self {
        self.ranks = Some(ranks);
        self
    }

    /// Where row `i` stands among equal ones.
    pub fn rank(&self, i: u32) -> u32 {
        self.ranks.map_or(i, |ranks| ranks[i as usize])
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
            .map(|(column, factor)| match self.ids {
                None => Range::of(column, *factor),
                Some(ids) => {
                    let chosen: Vec<f64> = ids.iter().map(|&i| column[i as usize]).collect();
                    Range::of(&chosen, *factor)
                }
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
