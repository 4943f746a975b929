//! Sparse Cholesky factorisation, made once and asked for many solutions.

mod panels;

use std::fmt;
use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::{MatMut, Par, Side};

use self::panels::Panels;
use crate::{Error, Result};

/// The factorisation P A Pᵀ = R Rᵀ of a symmetric positive definite sparse matrix A (n × n).
///
/// P is the approximate-minimum-degree ordering (Amestoy, Davis & Duff 1996); R is stored by
/// supernodes (Chen, Davis, Hager & Rajamanickam 2008). Ordering and factorisation are faer's, the
/// solves are ours. Everything runs on the calling thread: a triangular solve with a few
/// right-hand sides is too short to share, so parallel callers share out shapes or blocks instead.
///
/// ```
/// use faer::sparse::{SparseColMat, Triplet};
/// use semfm_geom::SparseCholesky;
/// let path = [(0, 0, 2.0), (1, 1, 2.0), (0, 1, -1.0), (1, 0, -1.0)];
/// let a = SparseColMat::<usize, f64>::try_new_from_triplets(
///     2, 2, &path.map(|(i, j, v)| Triplet::new(i, j, v)))?;
/// let factor = SparseCholesky::new(a.as_ref())?;
/// let mut x = faer::mat![[1.0], [0.0]];
/// factor.solve_in_place(x.as_mut());
/// assert!((x[(0, 0)] - 2.0 / 3.0).abs() < 1e-15 && (x[(1, 0)] - 1.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SparseCholesky {
    analysis: CholeskyAnalysis,
    panels: Panels,
}

/// What the sparsity pattern of a matrix alone says of its factor: the order of the unknowns and what is filled.
/// Made once, it serves every matrix of this pattern; a clone costs nothing.
#[derive(Clone)]
pub struct CholeskyAnalysis {
    symbolic: Arc<SymbolicCholesky<usize>>,
}

/// Below zero, because faer's own `FORCE_SUPERNODAL` (zero) still stores a diagonal matrix by columns.
const ALWAYS_SUPERNODAL: SupernodalThreshold = SupernodalThreshold(-1.0);

/// faer's own failures: no memory, or a factor of another layout than was asked for.
const FAILED: Error = Error::LinearAlgebra("the sparse Cholesky factorisation");

/// Right-hand sides solved together: their numbers for one unknown fill a cache line.
const LANES: usize = 8;

impl SparseCholesky {
    /// Factorises `matrix` (n × n), of which only the lower triangle is read.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] with the row of `matrix` at which a pivot was not positive;
    /// [`Error::Length`] for a matrix that is not square; [`Error::LinearAlgebra`] where the
    /// factor does not fit into memory.
    pub fn new(matrix: SparseColMatRef<'_, usize, f64>) -> Result<Self> {
        Self::with_analysis(&CholeskyAnalysis::new(matrix)?, matrix)
    }

    /// The same for a matrix whose sparsity pattern was analysed before.
    ///
    /// # Errors
    /// As [`SparseCholesky::new`].
    ///
    /// # Panics
    /// Where the matrix has another pattern than the one that was analysed.
    pub fn with_analysis(
        analysis: &CholeskyAnalysis,
        matrix: SparseColMatRef<'_, usize, f64>,
    ) -> Result<Self> {
        let symbolic = analysis.symbolic();
        assert_eq!(symbolic.nrows(), matrix.nrows(), "one pattern");
        let SymbolicCholeskyRaw::Supernodal(nodes) = symbolic.raw() else {
            return Err(FAILED);
        };
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let outcome = symbolic.factorize_numeric_llt(
            &mut values,
            matrix,
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        if let Err(NonPositivePivot { index }) = outcome {
            let row = symbolic.perm().map_or(index, |perm| perm.arrays().0[index]);
            return Err(Error::NotPositiveDefinite { what: "the sparse matrix", row });
        }
        let panels = Panels::new(nodes, values);
        Ok(Self { analysis: analysis.clone(), panels })
    }

    /// Number of rows n.
    pub fn n_rows(&self) -> usize {
        self.analysis.symbolic.nrows()
    }

    /// The analysis of the sparsity pattern, for further factorisations of like matrices.
    pub fn analysis(&self) -> &CholeskyAnalysis {
        &self.analysis
    }

    /// Numbers stored in the factor R, fill-in and supernodal padding included.
    pub fn n_stored(&self) -> usize {
        self.panels.n_stored()
    }

    /// Replaces the right-hand sides (n × any number of columns) by the solutions A⁻¹ rhs.
    ///
    /// Columns are solved eight at a time; eight together cost about twice as much as one alone.
    ///
    /// # Panics
    /// Where `rhs` has another number of rows than the matrix.
    pub fn solve_in_place(&self, rhs: MatMut<'_, f64>) {
        assert_eq!(rhs.nrows(), self.n_rows(), "one row per unknown");
        let mut rest = rhs;
        while rest.ncols() > 0 {
            let width = rest.ncols().min(LANES);
            let (columns, others) = rest.split_at_col_mut(width);
            match width {
                1 => self.solve_lanes::<1>(columns),
                2..=4 => self.solve_lanes::<4>(columns),
                _ => self.solve_lanes::<LANES>(columns),
            }
            rest = others;
        }
    }

    /// Solves for at most N columns; lanes left over carry zeros.
    fn solve_lanes<const N: usize>(&self, columns: MatMut<'_, f64>) {
        let n = self.n_rows();
        let identity: Vec<usize>;
        let order = match self.analysis.symbolic.perm() {
            Some(perm) => perm.arrays().0,
            None => {
                identity = (0..n).collect();
                &identity
            }
        };
        let mut lanes = vec![[0.0; N]; n];
        for (j, column) in columns.as_ref().col_iter().enumerate() {
            for (x, &row) in lanes.iter_mut().zip(order) {
                x[j] = column[row];
            }
        }
        self.panels.solve(&mut lanes);
        for (j, mut column) in columns.col_iter_mut().enumerate() {
            for (x, &row) in lanes.iter().zip(order) {
                column[row] = x[j];
            }
        }
    }
}

impl CholeskyAnalysis {
    /// Analyses the lower triangle of `matrix` (n × n).
    ///
    /// # Errors
    /// [`Error::Length`] for a matrix that is not square; [`Error::LinearAlgebra`] where there is no memory.
    pub fn new(matrix: SparseColMatRef<'_, usize, f64>) -> Result<Self> {
        if matrix.nrows() != matrix.ncols() {
            let (expected, found) = (matrix.nrows(), matrix.ncols());
            return Err(Error::Length { what: "columns of a square matrix", expected, found });
        }
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: ALWAYS_SUPERNODAL,
            ..Default::default()
        };
        let (pattern, order) = (matrix.symbolic(), SymmetricOrdering::Amd);
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, order, parameters);
        Ok(Self { symbolic: Arc::new(symbolic.map_err(|_| FAILED)?) })
    }

    pub(crate) fn symbolic(&self) -> &SymbolicCholesky<usize> {
        &self.symbolic
    }
}

impl fmt::Debug for CholeskyAnalysis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CholeskyAnalysis")
            .field("n", &self.symbolic.nrows())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use faer::sparse::{SparseColMat, Triplet};
    use faer::{Mat, mat};

    use super::*;

    /// Five-point Laplacian of a `side × side` grid, plus `shift` on the diagonal.
    fn grid(side: usize, shift: f64) -> SparseColMat<usize, f64> {
        let n = side * side;
        let mut triplets = Vec::new();
        for i in 0..n {
            triplets.push(Triplet::new(i, i, shift));
            let right = (i % side + 1 < side).then_some(i + 1);
            let below = (i + side < n).then_some(i + side);
            for j in [right, below].into_iter().flatten() {
                let square = [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)];
                triplets.extend(square.map(|(r, c, v)| Triplet::new(r, c, v)));
            }
        }
        SparseColMat::try_new_from_triplets(n, n, &triplets).unwrap()
    }

    #[test]
    fn solutions_satisfy_the_equations_for_one_and_many_right_hand_sides() {
        for (side, columns) in [(1, 1), (3, 1), (7, 5), (12, 3), (90, 19)] {
            let a = grid(side, 0.1);
            let factor = SparseCholesky::new(a.as_ref()).unwrap();
            let rhs = Mat::from_fn(side * side, columns, |i, j| ((7 * i + 13 * j) % 101) as f64);
            let mut x = rhs.clone();
            factor.solve_in_place(x.as_mut());
            let residual = (&a * &x - &rhs).norm_max() / rhs.norm_max().max(1.0);
            assert!(residual < 1e-12, "residual {residual:.1e} on the {side}×{side} grid");
        }
    }

    #[test]
    fn the_row_of_a_bad_pivot_is_named_in_the_callers_order() {
        let mut triplets: Vec<_> = (0..9).map(|i| Triplet::new(i, i, 1.0)).collect();
        triplets[5] = Triplet::new(5, 5, -1.0);
        let a = SparseColMat::<usize, f64>::try_new_from_triplets(9, 9, &triplets).unwrap();
        match SparseCholesky::new(a.as_ref()) {
            Err(Error::NotPositiveDefinite { row, .. }) => assert_eq!(row, 5),
            other => panic!("expected NotPositiveDefinite, found {other:?}"),
        }
    }

    #[test]
    fn a_singular_and_an_oblong_matrix_are_refused() {
        let a = grid(1, 0.0);
        assert!(matches!(
            SparseCholesky::new(a.as_ref()),
            Err(Error::NotPositiveDefinite { row: 0, .. })
        ));
        let oblong =
            SparseColMat::<usize, f64>::try_new_from_triplets(2, 3, &[Triplet::new(0, 0, 1.0)])
                .unwrap();
        assert!(matches!(SparseCholesky::new(oblong.as_ref()), Err(Error::Length { .. })));
    }

    #[test]
    fn the_upper_triangle_is_not_read() {
        let lower = [Triplet::new(0, 0, 4.0), Triplet::new(1, 0, 2.0), Triplet::new(1, 1, 3.0)];
        let a = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &lower).unwrap();
        let mut x = mat![[8.0], [7.0]];
        SparseCholesky::new(a.as_ref()).unwrap().solve_in_place(x.as_mut());
        assert!((x - mat![[1.25], [1.5]]).norm_max() < 1e-15);
    }
}
