//! Triangular solves on a supernodal factor, eight right-hand sides at a time.

use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use pulp::Arch;

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

/// sum −= l · x on every lane.
#[inline(always)]
fn subtract<const N: usize>(sum: &mut Lanes<N>, l: f64, x: &Lanes<N>) {
    for (s, x) in sum.iter_mut().zip(x) {
        *s -= l * x;
    }
}

#[inline(always)]
fn scale<const N: usize>(x: &mut Lanes<N>, by: f64) {
    x.iter_mut().for_each(|x| *x *= by);
}

impl Panels {
    /// Copies faer's factor, whose panels lie column after column.
    pub fn new(factor: SupernodalLltRef<'_, usize, f64>) -> Self {
        let n_panels = factor.symbolic().n_supernodes();
        let mut all = Self {
            panels: Vec::with_capacity(n_panels),
            rows: Vec::new(),
            values: Vec::with_capacity(factor.values().len()),
        };
        for s in 0..n_panels {
            let node = factor.supernode(s);
            let (numbers, below) = (node.val(), node.pattern());
            all.panels.push(Panel {
                first: node.start(),
                width: numbers.ncols(),
                rows: (all.rows.len(), below.len()),
                values: all.values.len(),
            });
            all.rows.extend(below.iter().map(|&row| row as u32));
            for i in 0..numbers.nrows() {
                all.values.extend((0..numbers.ncols()).map(|j| match i == j {
                    true => 1.0 / numbers[(i, j)],
                    false => numbers[(i, j)],
                }));
            }
        }
        all
    }

    /// Numbers stored.
    pub fn n_stored(&self) -> usize {
        self.values.len()
    }

    /// Replaces `x` (n rows of N lanes, in the order of the factor) by (R Rᵀ)⁻¹ x.
    pub fn solve<const N: usize>(&self, x: &mut [Lanes<N>]) {
        // The best instructions of the machine at hand; products and sums stay apart, so that the
        // answer does not depend on which they are.
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for panel in &self.panels {
                    self.forward(panel, x);
                }
                for panel in self.panels.iter().rev() {
                    self.backward(panel, x);
                }
            },
        );
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
    fn forward<const N: usize>(&self, panel: &Panel, x: &mut [Lanes<N>]) {
        let w = panel.width;
        let (triangle, below, rows) = self.parts(panel);
        let (head, tail) = x.split_at_mut(panel.first + w);
        let mine = &mut head[panel.first..];
        for (i, row) in triangle.chunks_exact(w).enumerate() {
            let (solved, open) = mine.split_at_mut(i);
            let mut sum = open[0];
            for (y, &l) in solved.iter().zip(row) {
                subtract(&mut sum, l, y);
            }
            scale(&mut sum, row[i]);
            open[0] = sum;
        }
        let offset = panel.first + w;
        let mut quads = below.chunks_exact(4 * w).zip(rows.chunks_exact(4));
        for (l, ids) in &mut quads {
            let at = [0, 1, 2, 3].map(|q| ids[q] as usize - offset);
            let mut sums = at.map(|row| tail[row]);
            let ((l0, l1), (l2, l3)) = (l[..2 * w].split_at(w), l[2 * w..].split_at(w));
            for ((((y, &l0), &l1), &l2), &l3) in mine.iter().zip(l0).zip(l1).zip(l2).zip(l3) {
                subtract(&mut sums[0], l0, y);
                subtract(&mut sums[1], l1, y);
                subtract(&mut sums[2], l2, y);
                subtract(&mut sums[3], l3, y);
            }
            for (row, sum) in at.into_iter().zip(sums) {
                tail[row] = sum;
            }
        }
        let left = rows.len() / 4 * 4;
        for (l, &id) in below[left * w..].chunks_exact(w).zip(&rows[left..]) {
            let sum = &mut tail[id as usize - offset];
            for (y, &l) in mine.iter().zip(l) {
                subtract(sum, l, y);
            }
        }
    }

    /// Rᵀ z = x on the panel's unknowns, given those below.
    #[inline(always)]
    fn backward<const N: usize>(&self, panel: &Panel, x: &mut [Lanes<N>]) {
        let w = panel.width;
        let (triangle, below, rows) = self.parts(panel);
        let (head, tail) = x.split_at_mut(panel.first + w);
        let mine = &mut head[panel.first..];
        let offset = panel.first + w;
        for (l, ids) in below.chunks_exact(4 * w).zip(rows.chunks_exact(4)) {
            let z = [0, 1, 2, 3].map(|q| tail[ids[q] as usize - offset]);
            let ((l0, l1), (l2, l3)) = (l[..2 * w].split_at(w), l[2 * w..].split_at(w));
            for ((((sum, &l0), &l1), &l2), &l3) in mine.iter_mut().zip(l0).zip(l1).zip(l2).zip(l3) {
                subtract(sum, l0, &z[0]);
                subtract(sum, l1, &z[1]);
                subtract(sum, l2, &z[2]);
                subtract(sum, l3, &z[3]);
            }
        }
        let left = rows.len() / 4 * 4;
        for (l, &id) in below[left * w..].chunks_exact(w).zip(&rows[left..]) {
            let z = tail[id as usize - offset];
            for (sum, &l) in mine.iter_mut().zip(l) {
                subtract(sum, l, &z);
            }
        }
        for (i, row) in triangle.chunks_exact(w).enumerate().rev() {
            let (open, solved) = mine.split_at_mut(i);
            scale(&mut solved[0], row[i]);
            let z = solved[0];
            for (sum, &l) in open.iter_mut().zip(row) {
                subtract(sum, l, &z);
            }
        }
    }
}
