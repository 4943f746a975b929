//! Nearest neighbours between the rows of two matrices, by blocked products.
//!
//! In 20 to 200 dimensions a k-d tree visits most of its leaves, while ‖q − p‖² = ‖q‖² + ‖p‖² − 2 q·p
//! turns the search into matrix products. They run in f32, which finds the winner up to rounding;
//! rows within the rounding bound of the winner are compared again in f64, so the answer is exact.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// Queries per product. Fewer repack the points too often, more push the scores out of the L2 cache.
const QUERY_BLOCK: usize = 96;
/// Points per product: 96 × 2048 scores fill 768 kB.
const POINT_BLOCK: usize = 2048;
/// Rows transposed together.
const STRIP: usize = 64;
/// Scores looked at together: a group whose largest is beaten is never read again.
const GROUP: usize = 32;

/// For each row of `queries` (q × k) the nearest row of `points` (p × k), ties to the lowest row.
///
/// Both matrices must have the same number of columns, `points` at least one row. The answer is
/// that of exact f64 distances and does not depend on the number of threads.
pub fn nearest_rows(queries: MatRef<'_, f64>, points: MatRef<'_, f64>) -> Vec<u32> {
    assert_eq!(queries.ncols(), points.ncols(), "one space for both");
    assert!(points.nrows() > 0, "a nearest row needs rows");
    let search = Search::new(queries, points);
    let starts: Vec<usize> = (0..queries.nrows()).step_by(QUERY_BLOCK).collect();
    let found: Vec<Vec<u32>> = starts.par_iter().map(|&start| search.block(start)).collect();
    found.concat()
}

/// The two matrices as the products want them. Distances do not change under a common shift, so
/// the points are centred first: that keeps the rounding bound small.
struct Search<'a> {
    queries: MatRef<'a, f64>,
    points: MatRef<'a, f64>,
    /// Queries, centred, and a last row of ones (k + 1 × q).
    queries32: Mat<f32>,
    /// Points, centred, and a last row of −‖p‖²/2 (k + 1 × p): the product with a query is its score.
    points32: Mat<f32>,
    longest_point: f32,
}

impl<'a> Search<'a> {
    fn new(queries: MatRef<'a, f64>, points: MatRef<'a, f64>) -> Self {
        let k = points.ncols();
        let mean: Vec<f64> =
            (0..k).map(|c| points.col(c).iter().sum::<f64>() / points.nrows() as f64).collect();
        let centred = |rows: MatRef<'_, f64>| {
            let mut out = Mat::<f32>::zeros(k + 1, rows.nrows());
            // Transposed in strips that stay in the L1 cache.
            for start in (0..rows.nrows()).step_by(STRIP) {
                let n = STRIP.min(rows.nrows() - start);
                let mut strip = out.as_mut().subcols_mut(start, n);
                for c in 0..k {
                    for (i, x) in rows.col(c).subrows(start, n).iter().enumerate() {
                        strip[(c, i)] = (x - mean[c]) as f32;
                    }
                }
            }
            out
        };
        let (mut queries32, mut points32) = (centred(queries), centred(points));
        queries32.row_mut(k).fill(1.0);
        let mut longest = 0.0f32;
        for i in 0..points.nrows() {
            let square: f32 = points32.col(i).iter().map(|x| x * x).sum();
            points32[(k, i)] = -0.5 * square;
            longest = longest.max(square);
        }
        Self { queries, points, queries32, points32, longest_point: longest.sqrt() }
    }

    /// Answers for the queries `start .. start + QUERY_BLOCK`.
    fn block(&self, start: usize) -> Vec<u32> {
        let k = self.points32.nrows();
        let n = QUERY_BLOCK.min(self.queries32.ncols() - start);
        let queries = self.queries32.as_ref().subcols(start, n);
        let slack: Vec<f32> = (0..n)
            .map(|j| {
                // Rounding of a (k + 1)-term product: |error| ≤ (k + 2) u Σ|aᵢ bᵢ|, Cauchy–Schwarz.
                let length = queries.col(j).iter().take(k - 1).map(|x| x * x).sum::<f32>().sqrt();
                let scale = length * self.longest_point + 0.5 * self.longest_point.powi(2);
                2.0 * (k + 2) as f32 * f32::EPSILON * scale
            })
            .collect();
        let mut best = vec![f32::NEG_INFINITY; n];
        let mut close: Vec<Vec<(f32, u32)>> = vec![Vec::new(); n];
        let mut scores = Mat::<f32>::zeros(POINT_BLOCK.min(self.points32.ncols()), n);
        for first in (0..self.points32.ncols()).step_by(POINT_BLOCK) {
            let m = POINT_BLOCK.min(self.points32.ncols() - first);
            let points = self.points32.as_ref().subcols(first, m);
            let mut block = scores.as_mut().subrows_mut(0, m);
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
        let (a, b) = (self.queries.row(query), self.points.row(point as usize));
        a.iter().zip(b.iter()).map(|(x, y)| (x - y) * (x - y)).sum()
    }
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
        for (g, group) in self.scores.chunks(GROUP).enumerate() {
            let top = largest(group);
            if top < *self.best - self.slack {
                continue;
            }
            *self.best = if top > *self.best { top } else { *self.best };
            for (i, &score) in group.iter().enumerate() {
                if score >= *self.best - self.slack {
                    self.close.push((score, self.first + (g * GROUP + i) as u32));
                }
            }
        }
    }
}

/// Largest of a group, eight lanes at a time (a plain `f32::max` fold cannot be reordered).
#[inline(always)]
fn largest(group: &[f32]) -> f32 {
    let mut lanes = [f32::NEG_INFINITY; 8];
    let (eights, rest) = group.as_chunks::<8>();
    for eight in eights {
        for (lane, &x) in lanes.iter_mut().zip(eight) {
            *lane = if x > *lane { x } else { *lane };
        }
    }
    let larger = |a: f32, &b: &f32| if b > a { b } else { a };
    rest.iter().fold(lanes.iter().fold(f32::NEG_INFINITY, larger), larger)
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
            let distance = |p: usize| (queries.row(q) - points.row(p)).squared_norm_l2();
            let nearest = (0..2500).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap();
            assert_eq!(answer as usize, nearest);
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
