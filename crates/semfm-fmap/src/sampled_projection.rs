//! The projection of matches between samples onto a functional map.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Llt;
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::{Accum, Mat, MatRef, Par, Side};

use crate::{Error, FunctionalMap, Result};

/// Tikhonov weight per sample in the projection onto sampled eigenfunctions. Far smaller, and 600
/// samples no longer hold 50 functions apart on thin blades; larger shrinks the map.
const RIDGE: f64 = 1e-4;

/// Equations A C = B, one for each row.
pub(crate) struct Equations<'a> {
    /// A (rows × k_target).
    pub left: MatRef<'a, f64>,
    /// B (rows × k_source).
    pub right: MatRef<'a, f64>,
}

/// C of least Σ ‖Aᵢ C − Bᵢ‖² + ρ ‖C‖² over some blocks of equations, ρ = [`RIDGE`] · rows:
///
/// (Σ Aᵢᵀ Aᵢ + ρ I) C = Σ Aᵢᵀ Bᵢ
pub(crate) fn least_squares(blocks: &[Equations<'_>]) -> Result<FunctionalMap> {
    let left: Vec<_> = blocks.iter().map(|block| block.left).collect();
    let projection = SampledProjection::new(&left)?;
    Ok(projection.solve(blocks))
}

/// The left-hand side of such equations. That of fewer functions is a leading block of it, and so is its Cholesky factor,
/// so that one serves a map that grows.
pub(crate) struct SampledProjection {
    factor: Llt<f64>,
}

impl SampledProjection {
    /// From the blocks A (rows × k each).
    ///
    /// # Errors
    /// [`Error::LinearAlgebra`] where they are not finite.
    pub fn new(left: &[MatRef<'_, f64>]) -> Result<Self> {
        let k = left[0].ncols();
        let mut gram = Mat::<f64>::zeros(k, k);
        for a in left {
            matmul(gram.as_mut(), Accum::Add, a.transpose(), a, 1.0, Par::Seq);
        }
        let rows: usize = left.iter().map(MatRef::nrows).sum();
        (0..k).for_each(|i| gram[(i, i)] += RIDGE * rows as f64);
        let failed = |_| Error::LinearAlgebra("ZoomOut's projection");
        Ok(Self { factor: gram.llt(Side::Lower).map_err(failed)? })
    }

    /// C (k × k_source) from the first k columns of the blocks A and the blocks B.
    pub fn solve(&self, blocks: &[Equations<'_>]) -> FunctionalMap {
        let k = blocks[0].left.ncols();
        let mut map = Mat::<f64>::zeros(k, blocks[0].right.ncols());
        for Equations { left, right } in blocks {
            matmul(map.as_mut(), Accum::Add, left.transpose(), right, 1.0, Par::Seq);
        }
        let lower = self.factor.L().submatrix(0, 0, k, k);
        solve_lower_triangular_in_place(lower, map.as_mut(), Par::Seq);
        solve_upper_triangular_in_place(lower.transpose(), map.as_mut(), Par::Seq);
        FunctionalMap::new(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leading_block_solves_the_equations_of_fewer_functions() {
        let left = Mat::from_fn(40, 9, |i, j| ((i * j + i + 3 * j) as f64).sin());
        let right = Mat::from_fn(40, 6, |i, j| ((i * j + 2 * j) as f64).cos());
        let all = SampledProjection::new(&[left.as_ref()]).unwrap();
        let few = left.subcols(0, 6);
        let found = all.solve(&[Equations { left: few, right: right.as_ref() }]);
        // (Aᵀ A + ρ I) C = Aᵀ B
        let mut rest = few.transpose() * (few * found.matrix()) - few.transpose() * &right;
        rest += RIDGE * 40.0 * found.matrix();
        assert!(rest.norm_l2() < 1e-12, "{}", rest.norm_l2());
        let own = least_squares(&[Equations { left: few, right: right.as_ref() }]).unwrap();
        assert!((own.matrix() - found.matrix()).norm_l2() < 1e-12);
    }
}
