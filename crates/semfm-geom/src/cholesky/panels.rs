//! Triangular solves on a supernodal factor, eight right-hand sides at a time.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use pulp::{Arch, Simd, WithSimd};

/// A supernode: neighbouring columns of R with the same rows below them.
#[derive(Debug)]
struct Panel {
    /// First column.
    first: usize,
    /// Columns w.
    width: usize,
    /// Where its rows below the triangle start in `Panels::rows`, and how many they are.
    rows: (usize, usize),
    /// Where its numbers start in `Panels::values`.
    values: usize,
}

/// The factor R by panels, each row after row: a (w × w) triangle with the *reciprocal* diagonal,
/// then one row of w for each row below.
///
/// The right-hand sides lie row after row too, N to a row, so that one entry of R meets N numbers
/// in a register. Four rows are combined at a time: what they read of the solution is read once.
#[derive(Debug)]
pub(super) struct Panels {
    panels: Vec<Panel>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

/// N right-hand sides' worth of one unknown.
type Lanes<const N: usize> = [f64; N];

/// sum −= l · x on every lane, in one rounding where `FUSED`.
#[inline(always)]
fn subtract<const N: usize, const FUSED: bool>(sum: &mut Lanes<N>, l: f64, x: &Lanes<N>) {
    for (s, x) in sum.iter_mut().zip(x) {
        *s = if FUSED { (-l).mul_add(*x, *s) } else { *s - l * x };
    }
}

#[inline(always)]
fn scale<const N: usize>(x: &mut Lanes<N>, by: f64) {
    x.iter_mut().for_each(|x| *x *= by);
}

/// Where four rows stand below an offset. (A closure that is not inlined is compiled without the wide registers, and
/// what it returns goes through memory.)
#[inline(always)]
fn below_offset(ids: &[u32], offset: usize) -> [usize; 4] {
    [
        ids[0] as usize - offset,
        ids[1] as usize - offset,
        ids[2] as usize - offset,
        ids[3] as usize - offset,
    ]
}

impl Panels {
    /// Turns faer's factor, whose panels lie column after column, round in its place.
    pub fn new(nodes: &SymbolicSupernodalCholesky<usize>, mut values: Vec<f64>) -> Self {
        let n_panels = nodes.n_supernodes();
        let (mut panels, mut rows) = (Vec::with_capacity(n_panels), Vec::new());
        let mut columns = Vec::new();
        for s in 0..n_panels {
            let below = nodes.supernode(s).pattern();
            let first = nodes.supernode_begin()[s];
            let width = nodes.supernode_end()[s] - first;
            let start = nodes.col_ptr_for_val()[s];
            let numbers = &mut values[start..nodes.col_ptr_for_val()[s + 1]];
            columns.clear();
            columns.extend_from_slice(numbers);
            let height = columns.len() / width;
            for (i, row) in numbers.chunks_exact_mut(width).enumerate() {
                for (j, number) in row.iter_mut().enumerate() {
                    *number = columns[j * height + i];
                }
                if let Some(diagonal) = row.get_mut(i) {
                    *diagonal = 1.0 / *diagonal;
                }
            }
            panels.push(Panel { first, width, rows: (rows.len(), below.len()), values: start });
            rows.extend(below.iter().map(|&row| row as u32));
        }
        Self { panels, rows, values }
    }

    /// Numbers stored.
    pub fn n_stored(&self) -> usize {
        self.values.len()
    }

    /// Replaces `x` (n rows of N lanes, in the order of the factor) by (R Rᵀ)⁻¹ x, by the best
    /// instructions of the machine at hand.
    pub fn solve<const N: usize>(&self, x: &mut [Lanes<N>]) {
        Arch::new().dispatch(Solve { panels: self, x });
    }

    #[inline(always)]
    fn solve_with<const N: usize, const FUSED: bool>(&self, x: &mut [Lanes<N>]) {
        for panel in &self.panels {
            self.forward::<N, FUSED>(panel, x);
        }
        for panel in self.panels.iter().rev() {
            self.backward::<N, FUSED>(panel, x);
        }
    }

    /// The panel's rows of R: its triangle (w · w numbers), then those below.
    #[inline(always)]
    fn parts(&self, panel: &Panel) -> (&[f64], &[f64], &[u32]) {
        let rows = &self.rows[panel.rows.0..][..panel.rows.1];
        let numbers = &self.values[panel.values..][..panel.width * (panel.width + rows.len())];
        let (triangle, below) = numbers.split_at(panel.width * panel.width);
        (triangle, below, rows)
    }

    /// R y = x on the panel's unknowns, and their part of the equations below.
    #[inline(always)]
    fn forward<const N: usize, const FUSED: bool>(&self, panel: &Panel, x: &mut [Lanes<N>]) {
        let w = panel.width;
        let (triangle, below, rows) = self.parts(panel);
        let (head, tail) = x.split_at_mut(panel.first + w);
        let mine = &mut head[panel.first..];
        // Column by column: the rows of a column do not wait for each other.
        for j in 0..w {
            let (solved, open) = mine.split_at_mut(j + 1);
            scale(&mut solved[j], triangle[j * w + j]);
            let y = solved[j];
            for (sum, row) in open.iter_mut().zip(triangle.chunks_exact(w).skip(j + 1)) {
                subtract::<N, FUSED>(sum, row[j], &y);
            }
        }
        let offset = panel.first + w;
        let mut quads = below.chunks_exact(4 * w).zip(rows.chunks_exact(4));
        for (l, ids) in &mut quads {
            let at = below_offset(ids, offset);
            let mut sums = [tail[at[0]], tail[at[1]], tail[at[2]], tail[at[3]]];
            let ((l0, l1), (l2, l3)) = (l[..2 * w].split_at(w), l[2 * w..].split_at(w));
            for ((((y, &l0), &l1), &l2), &l3) in mine.iter().zip(l0).zip(l1).zip(l2).zip(l3) {
                subtract::<N, FUSED>(&mut sums[0], l0, y);
                subtract::<N, FUSED>(&mut sums[1], l1, y);
                subtract::<N, FUSED>(&mut sums[2], l2, y);
                subtract::<N, FUSED>(&mut sums[3], l3, y);
            }
            for (row, sum) in at.into_iter().zip(sums) {
                tail[row] = sum;
            }
        }
        let left = rows.len() / 4 * 4;
        for (l, &id) in below[left * w..].chunks_exact(w).zip(&rows[left..]) {
            let sum = &mut tail[id as usize - offset];
            for (y, &l) in mine.iter().zip(l) {
                subtract::<N, FUSED>(sum, l, y);
            }
        }
    }

    /// Rᵀ z = x on the panel's unknowns, given those below.
    #[inline(always)]
    fn backward<const N: usize, const FUSED: bool>(&self, panel: &Panel, x: &mut [Lanes<N>]) {
        let w = panel.width;
        let (triangle, below, rows) = self.parts(panel);
        let (head, tail) = x.split_at_mut(panel.first + w);
        let mine = &mut head[panel.first..];
        let offset = panel.first + w;
        for (l, ids) in below.chunks_exact(4 * w).zip(rows.chunks_exact(4)) {
            let at = below_offset(ids, offset);
            let z = [tail[at[0]], tail[at[1]], tail[at[2]], tail[at[3]]];
            let ((l0, l1), (l2, l3)) = (l[..2 * w].split_at(w), l[2 * w..].split_at(w));
            for ((((sum, &l0), &l1), &l2), &l3) in mine.iter_mut().zip(l0).zip(l1).zip(l2).zip(l3) {
                subtract::<N, FUSED>(sum, l0, &z[0]);
                subtract::<N, FUSED>(sum, l1, &z[1]);
                subtract::<N, FUSED>(sum, l2, &z[2]);
                subtract::<N, FUSED>(sum, l3, &z[3]);
            }
        }
        let left = rows.len() / 4 * 4;
        for (l, &id) in below[left * w..].chunks_exact(w).zip(&rows[left..]) {
            let z = tail[id as usize - offset];
            for (sum, &l) in mine.iter_mut().zip(l) {
                subtract::<N, FUSED>(sum, l, &z);
            }
        }
        for (i, row) in triangle.chunks_exact(w).enumerate().rev() {
            let (open, solved) = mine.split_at_mut(i);
            scale(&mut solved[0], row[i]);
            let z = solved[0];
            for (sum, &l) in open.iter_mut().zip(row) {
                subtract::<N, FUSED>(sum, l, &z);
            }
        }
    }
}

/// A solve of N right-hand sides at once.
struct Solve<'a, const N: usize> {
    panels: &'a Panels,
    x: &'a mut [Lanes<N>],
}

impl<const N: usize> WithSimd for Solve<'_, N> {
    type Output = ();

    /// Every processor with vectors of four numbers multiplies and subtracts in one instruction; where there
    /// are none, one rounding would be a call for each number.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        if S::IS_SCALAR {
            self.panels.solve_with::<N, false>(self.x);
        } else {
            self.panels.solve_with::<N, true>(self.x);
        }
    }
}
