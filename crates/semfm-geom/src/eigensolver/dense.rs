//! Every eigenpair at once, for small meshes.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{Mat, MatRef, Par};

use crate::{Error, Laplacian, Result};

/// Eigenvalues (ascending) and eigenvectors (columns) of a symmetric matrix whose lower triangle is
/// read, on this thread: faer's high-level call would split the work by the global thread count and
/// round differently for each.
pub(super) fn symmetric_eigen(matrix: MatRef<'_, f64>) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = matrix.nrows();
    let mut values = Mat::<f64>::zeros(n, 1);
    let mut vectors = Mat::<f64>::zeros(n, n);
    let scratch =
        self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, Default::default());
    self_adjoint_evd(
        matrix,
        values.as_mut().col_mut(0).as_diagonal_mut(),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| Error::LinearAlgebra("the dense eigendecomposition"))?;
    Ok((values.col_as_slice(0).to_vec(), vectors))
}

/// The first k pairs of M^{-1/2} L M^{-1/2}: λ (k) and y = M^{1/2} φ (n × k).
pub(super) fn first_pairs(laplacian: &Laplacian, k: usize) -> Result<(Vec<f64>, Mat<f64>)> {
    let n = laplacian.n_vertices();
    let root: Vec<f64> = laplacian.mass.iter().map(|m| m.sqrt()).collect();
    let mut symmetric = Mat::<f64>::zeros(n, n);
    for t in laplacian.stiffness.triplet_iter() {
        symmetric[(t.row, t.col)] += t.val / (root[t.row] * root[t.col]);
    }
    let (mut values, mut vectors) = symmetric_eigen(symmetric.as_ref())?;
    values.truncate(k);
    vectors.truncate(n, k);
    Ok((values, vectors))
}
