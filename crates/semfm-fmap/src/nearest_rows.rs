//! Nearest neighbours between the rows of two matrices, by blocked products.
//!
//! In 20 to 200 dimensions a k-d tree visits most of its leaves, while ‖q − p‖² = ‖q‖² + ‖p‖² − 2 q·p
//! turns the search into matrix products. They run in f32, which finds the winner up to rounding;
//! rows within the rounding bound of the winner are compared again in f64, so the answer is exact.

use std::borrow::Cow;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// Queries per product, at most. Fewer repack the points too often, more push the scores out of the
/// L2 cache.
const QUERY_BLOCK: usize = 192;
/// Points per product: 192 × 1024 scores fill 768 kB.
const POINT_BLOCK: usize = 1024;
/// Scores looked at together: a group whose largest is beaten is never read again.
const GROUP: usize = 128;
/// Lanes of the running maximum: four AVX2 registers.
const LANES: usize = 32;

/// For each row of `queries` (q × k) the nearest row of `points` (p × k), ties to the lowest row.
///
/// Both matrices must have the same number of columns, `points` at least one row. The answer is
/// that of exact f64 distances and does not depend on the number of threads.
pub fn nearest_rows(queries: MatRef<'_, f64>, points: MatRef<'_, f64>) -> Vec<u32> {
    Rows::of(queries).nearest_of(&Rows::of(points))
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

    fn len(&self) -> usize {
        self.ids.map_or(self.n_rows, <[u32]>::len)
    }

    fn row(&self, i: usize) -> impl Iterator<Item = f64> {
        let row = self.ids.map_or(i, |ids| ids[i] as usize);
        self.columns.iter().map(move |(column, scale)| scale * column[row])
    }

    /// For each of these rows the nearest of `points`, ties to the first.
    pub fn nearest_of(&self, points: &Rows<'_>) -> Vec<u32> {
        assert_eq!(self.columns.len(), points.columns.len(), "one space for both");
        assert!(points.len() > 0, "a nearest row needs rows");
        let search = Search::new(self, points);
        // Even blocks, an even number of them: the answer does not depend on where they are cut.
        let n_blocks = self.len().div_ceil(QUERY_BLOCK).next_multiple_of(2);
        let size = self.len().div_ceil(n_blocks).max(1);
        let starts: Vec<usize> = (0..self.len()).step_by(size).collect();
        let found: Vec<Vec<u32>> = starts
            .par_iter()
            .map_init(
                || Mat::<f32>::zeros(POINT_BLOCK.min(points.len()), size),
                |scores, &start| search.block(start, size.min(self.len() - start), scores),
            )
            .collect();
        found.concat()
    }
}

/// The two sets of rows as the products want them. Distances do not change under a common shift, so
/// the points are centred first: that keeps the rounding bound small.
struct Search<'a> {
    queries: &'a Rows<'a>,
    points: &'a Rows<'a>,
    /// Queries, centred, one per column, and a last row of ones (k + 1 × q).
    queries32: Mat<f32>,
    /// Points, centred, and a last row of −‖p‖²/2 (k + 1 × p): the product with a query is its score.
    points32: Mat<f32>,
    longest_point: f32,
}

impl<'a> Search<'a> {
    fn new(queries: &'a Rows<'a>, points: &'a Rows<'a>) -> Self {
        let k = points.columns.len();
        // Any shift will do, so the mean is taken over all rows, chosen or not.
        let columns = points.columns.iter();
        let mean: Vec<f64> = columns
            .map(|(column, scale)| scale * column.iter().sum::<f64>() / column.len() as f64)
            .collect();
        let mut longest = 0.0f32;
        let mut points32 = centred(points, &mean);
        for i in 0..points.len() {
            let column = points32.col_as_slice_mut(i);
            let square: f32 = column[..k].iter().map(|x| x * x).sum();
            column[k] = -0.5 * square;
            longest = longest.max(square);
        }
        Self {
            queries,
            points,
            queries32: centred(queries, &mean),
            points32,
            longest_point: longest.sqrt(),
        }
    }

    /// Answers for `n` queries from `start`; `scores` takes a block of products.
    fn block(&self, start: usize, n: usize, scores: &mut Mat<f32>) -> Vec<u32> {
        let k = self.points32.nrows();
        let queries = self.queries32.as_ref().subcols(start, n);
        let slack: Vec<f32> = (0..n)
            .map(|j| {
                // Rounding of a (k + 1)-term product: |error| ≤ (k + 2) u Σ|aᵢ bᵢ|, Cauchy–Schwarz.
                let query = &self.queries32.col_as_slice(start + j)[..k - 1];
                let length = query.iter().map(|x| x * x).sum::<f32>().sqrt();
                let scale = length * self.longest_point + 0.5 * self.longest_point.powi(2);
                2.0 * (k + 2) as f32 * f32::EPSILON * scale
            })
            .collect();
        let mut best = vec![f32::NEG_INFINITY; n];
        let mut close: Vec<Vec<(f32, u32)>> = vec![Vec::new(); n];
        for first in (0..self.points32.ncols()).step_by(POINT_BLOCK) {
            let m = POINT_BLOCK.min(self.points32.ncols() - first);
            let points = self.points32.as_ref().subcols(first, m);
            let mut block = scores.as_mut().submatrix_mut(0, 0, m, n);
            matmul(block.as_mut(), Accum::Replace, points.transpose(), queries, 1.0, Par::Seq);
            for j in 0..n {
                let scores = &scores.col_as_slice(j)[..m];
                let (best, close) = (&mut best[j], &mut close[j]);
                pulp::Arch::new().dispatch(Gather {
                    scores,
                    first: first as u32,
                    slack: slack[j],
                    best,
                    close,
                });
            }
        }
        (0..n).map(|j| self.decide(start + j, best[j] - slack[j], &close[j])).collect()
    }

    /// The exact winner among the points whose score reaches `cut`.
    fn decide(&self, query: usize, cut: f32, close: &[(f32, u32)]) -> u32 {
        let mut near = close.iter().filter(|(score, _)| *score >= cut).map(|&(_, i)| i);
        let first = near.next().unwrap_or(0); // only without a finite score is there none
        let mut winner = (first, None);
        for i in near {
            let current = *winner.1.get_or_insert_with(|| self.distance(query, winner.0));
            let distance = self.distance(query, i);
            if distance < current {
                winner = (i, Some(distance));
            }
        }
        winner.0
    }

    fn distance(&self, query: usize, point: u32) -> f64 {
        let rows = self.queries.row(query).zip(self.points.row(point as usize));
        rows.map(|(x, y)| (x - y) * (x - y)).sum()
    }
}

/// Rows less `mean`, one per column, in f32, and a last row of ones (k + 1 × rows).
fn centred(rows: &Rows<'_>, mean: &[f64]) -> Mat<f32> {
    let k = mean.len();
    let mut out = Mat::<f32>::zeros(k + 1, rows.len());
    for i in 0..rows.len() {
        let column = out.col_as_slice_mut(i);
        column[..k]
            .iter_mut()
            .zip(rows.row(i))
            .zip(mean)
            .for_each(|((x, r), mean)| *x = (r - mean) as f32);
        column[k] = 1.0;
    }
    out
}

/// Keeps the points whose score comes within `slack` of the best so far. A value and not a
/// closure, so that it is inlined where the wide registers are switched on.
struct Gather<'a> {
    scores: &'a [f32],
    /// Id of the first point scored.
    first: u32,
    slack: f32,
    best: &'a mut f32,
    close: &'a mut Vec<(f32, u32)>,
}

impl pulp::WithSimd for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        // Neighbouring points have neighbouring ids, so the best rises step by step along a row:
        // knowing every group's top first saves looking into all the steps.
        let mut tops = [f32::NEG_INFINITY; POINT_BLOCK.div_ceil(GROUP)];
        for (top, group) in tops.iter_mut().zip(self.scores.chunks(GROUP)) {
            *top = largest(group);
            *self.best = self.best.max(*top);
        }
        let cut = *self.best - self.slack;
        for (g, group) in self.scores.chunks(GROUP).enumerate() {
            if tops[g] >= cut {
                for (i, &score) in group.iter().enumerate() {
                    if score >= cut {
                        self.close.push((score, self.first + (g * GROUP + i) as u32));
                    }
                }
            }
        }
    }
}

/// Largest of a group, in lanes that are folded in halves (a plain `f32::max` fold cannot be
/// reordered, so it would run one by one).
#[inline(always)]
fn largest(group: &[f32]) -> f32 {
    let mut lanes = [f32::NEG_INFINITY; LANES];
    let (blocks, rest) = group.as_chunks::<LANES>();
    for block in blocks {
        lanes = std::array::from_fn(|i| lanes[i].max(block[i]));
    }
    let mut half = LANES / 2;
    while half > 0 {
        for i in 0..half {
            lanes[i] = lanes[i].max(lanes[i + half]);
        }
        half /= 2;
    }
    rest.iter().fold(lanes[0], |a, &b| a.max(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random(n: usize, k: usize, seed: u64) -> Mat<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Mat::from_fn(n, k, |_, _| rng.random::<f64>() + 5.0)
    }

    #[test]
    fn every_row_gets_its_exact_nearest() {
        let (queries, points) = (random(300, 7, 1), random(2500, 7, 2));
        let found = nearest_rows(queries.as_ref(), points.as_ref());
        for (q, &answer) in found.iter().enumerate() {
            let distances = (0..2500).map(|p| (queries.row(q) - points.row(p)).squared_norm_l2());
            let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert_eq!(answer as usize, nearest.0);
        }
    }

    #[test]
    fn ties_closer_than_f32_can_see_are_settled_and_equal_rows_go_to_the_first() {
        let mut points = random(40, 3, 3);
        let copy = points.row(11).to_owned();
        points.row_mut(30).copy_from(&copy);
        points[(20, 0)] = points[(11, 0)] + 1e-12;
        points[(20, 1)] = points[(11, 1)];
        points[(20, 2)] = points[(11, 2)];
        let queries = Mat::from_fn(2, 3, |i, c| points[([11, 20][i], c)]);
        assert_eq!(nearest_rows(queries.as_ref(), points.as_ref()), [11, 20]);
    }
}
