//! Families of operators on a basis, one for each of some functions, all at once.
//!
//! Both families are linear in the function f and symmetric or antisymmetric in the pair (φᵢ, φⱼ):
//! ∫ f φᵢ φⱼ, and ∫ f dφⱼ ∧ dφᵢ. So the products of pairs are formed once for a block of vertices or
//! faces and meet all the functions in one matrix product.

use faer::linalg::matmul::matmul;
use faer::{Accum, ColMut, Mat, MatRef, Par};

/// Vertices or faces at a time: 64 × 1275 products of pairs (k = 50) fill 650 kB.
const BLOCK: usize = 64;

/// r operators (k × k), all symmetric or all antisymmetric, side by side (k × k r).
#[derive(Clone, Debug)]
pub(super) struct Operators {
    matrices: Mat<f64>,
}

/// What changes when the two functions of a pair change places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parity {
    Symmetric,
    Antisymmetric,
}

impl Parity {
    /// Pairs (i, j) with i ≤ j, or i < j, in the order of their products.
    pub fn pairs(self, k: usize) -> impl Iterator<Item = (usize, usize)> {
        let diagonal = usize::from(self == Self::Symmetric);
        (0..k).flat_map(move |j| (0..j + diagonal).map(move |i| (i, j)))
    }
}

impl Operators {
    /// Operator d has the entries Σₓ f_d(x) product(x, i, j) over `n` places x, with the functions
    /// f_d = Σₗ `coefficients`[l, d] gₗ.
    ///
    /// `block` is given the first place, a matrix for the products (places × pairs, columns in the
    /// order of [`Parity::pairs`]) and for functions g (places × k).
    pub fn new(
        parity: Parity,
        n: usize,
        coefficients: MatRef<'_, f64>,
        mut block: impl FnMut(usize, &mut Mat<f64>, &mut Mat<f64>),
    ) -> Self {
        let k = coefficients.nrows();
        let n_pairs = parity.pairs(k).count();
        // Few functions are mixed where they live; many come from those of the k basis functions.
        let mixed_first = coefficients.ncols() < k;
        let q = if mixed_first { coefficients.ncols() } else { k };
        let mut entries = Mat::<f64>::zeros(n_pairs, q);
        let (mut products, mut functions) = (Mat::zeros(0, 0), Mat::zeros(0, 0));
        for first in (0..n).step_by(BLOCK) {
            let places = BLOCK.min(n - first);
            if products.nrows() != places {
                (products, functions) = (Mat::zeros(places, n_pairs), Mat::zeros(places, k));
            }
            block(first, &mut products, &mut functions);
            let mixed = mixed_first.then(|| &functions * coefficients);
            let (p, f) = (products.transpose(), mixed.as_ref().unwrap_or(&functions));
            matmul(entries.as_mut(), Accum::Add, p, f.as_ref(), 1.0, Par::Seq);
        }
        let entries = if mixed_first { entries } else { entries * coefficients };
        let mut matrices = Mat::zeros(k, k * coefficients.ncols());
        for d in 0..coefficients.ncols() {
            for ((i, j), &entry) in parity.pairs(k).zip(entries.col_as_slice(d)) {
                matrices[(i, d * k + j)] = entry;
                matrices[(j, d * k + i)] = if parity == Parity::Symmetric { entry } else { -entry };
            }
        }
        Self { matrices }
    }

    /// No operators on a basis of size `k`.
    pub fn none(k: usize) -> Self {
        Self { matrices: Mat::zeros(k, 0) }
    }

    /// Size of the basis.
    pub fn k(&self) -> usize {
        self.matrices.nrows()
    }

    /// Number of operators r.
    pub fn len(&self) -> usize {
        self.matrices.ncols() / self.k()
    }

    /// Operator `d` (k × k).
    pub fn of(&self, d: usize) -> MatRef<'_, f64> {
        self.matrices.as_ref().subcols(d * self.k(), self.k())
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = MatRef<'_, f64>> {
        (0..self.len()).map(|d| self.of(d))
    }

    /// All of them side by side (k × k r).
    pub fn side_by_side(&self) -> MatRef<'_, f64> {
        self.matrices.as_ref()
    }

    /// Σ ‖S_d‖² (Frobenius).
    pub fn square(&self) -> f64 {
        self.matrices.squared_norm_l2()
    }

    /// Multiplies all of them by a number.
    pub fn scale(&mut self, factor: f64) {
        self.matrices *= faer::Scale(factor);
    }

    /// These and others on the same basis.
    pub fn and(self, others: &Self) -> Self {
        let (here, more) = (self.matrices.ncols(), others.matrices.ncols());
        let mut matrices = Mat::zeros(self.k(), here + more);
        matrices.as_mut().subcols_mut(0, here).copy_from(&self.matrices);
        matrices.as_mut().subcols_mut(here, more).copy_from(&others.matrices);
        Self { matrices }
    }
}

/// One column of products of a pair, written with wide registers. A value and not a closure, so that
/// it is inlined where they are switched on.
pub(super) struct Terms<'a> {
    out: &'a mut [f64],
    plus: (&'a [f64], &'a [f64]),
    minus: Option<(&'a [f64], &'a [f64])>,
}

impl<'a> Terms<'a> {
    /// a b
    pub fn product(out: ColMut<'a, f64>, a: &'a [f64], b: &'a [f64]) -> Self {
        Self { out: slice(out), plus: (a, b), minus: None }
    }

    /// a b − c d
    pub fn difference(
        out: ColMut<'a, f64>,
        plus: (&'a [f64], &'a [f64]),
        minus: (&'a [f64], &'a [f64]),
    ) -> Self {
        Self { out: slice(out), plus, minus: Some(minus) }
    }

    /// Writes them.
    pub fn write(self) {
        pulp::Arch::new().dispatch(self);
    }
}

fn slice(column: ColMut<'_, f64>) -> &mut [f64] {
    column.try_as_col_major_mut().expect("a column of a matrix of ours").as_slice_mut()
}

impl pulp::WithSimd for Terms<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let pairs = self.plus.0.iter().zip(self.plus.1);
        match self.minus {
            None => self.out.iter_mut().zip(pairs).for_each(|(x, (a, b))| *x = a * b),
            Some((c, d)) => {
                let all = pairs.zip(c.iter().zip(d));
                for (x, ((a, b), (c, d))) in self.out.iter_mut().zip(all) {
                    *x = a * b - c * d;
                }
            }
        }
    }
}
