//! Every eigenpair at once, for small meshes.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

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

/// The first k pairs of M^{-1/2} L M^{-1/2}: λ (k) and y = M^{1/2} φ (n × k), of which `kernel`
/// (n × c) holds the first c exactly.
///
/// The kernel is moved to the far end of the spectrum before the rest is computed, so that a vector
/// of nearly no eigenvalue cannot mix with it.
pub(super) fn first_pairs(
    laplacian: &Laplacian,
    kernel: MatRef<'_, f64>,
    k: usize,
) -> Result<(Vec<f64>, Mat<f64>)> {
    let (n, c) = (laplacian.n_vertices(), kernel.ncols());
    let root: Vec<f64> = laplacian.mass.iter().map(|m| m.sqrt()).collect();
    let mut symmetric = Mat::<f64>::zeros(n, n);
    let mut row_sums = vec![0.0; n];
    for t in laplacian.stiffness.triplet_iter() {
        let entry = t.val / (root[t.row] * root[t.col]);
        symmetric[(t.row, t.col)] += entry;
        row_sums[t.row] += entry.abs();
    }
    // Gershgorin: no eigenvalue lies beyond the largest row sum; twice that touches none of them.
    let beyond = 2.0 * row_sums.iter().copied().fold(0.0, f64::max);
    matmul(symmetric.as_mut(), Accum::Add, kernel, kernel.transpose(), beyond, Par::Seq);
    let (values, vectors) = symmetric_eigen(symmetric.as_ref())?;
    let values = std::iter::repeat_n(0.0, c).chain(values).take(k).collect();
    let mut first = Mat::zeros(n, k);
    first.as_mut().subcols_mut(0, c).copy_from(kernel);
    first.as_mut().subcols_mut(c, k - c).copy_from(vectors.subcols(0, k - c));
    Ok((values, first))
}

#[cfg(test)]
mod tests {
    use faer::sparse::{SparseColMat, Triplet};

    use crate::eigensolver::{EigenSettings, eigenbasis};
    use crate::{Laplacian, Task};

    #[test]
    fn pieces_that_hang_by_a_thread_do_not_mix_with_the_constant() {
        // Two stiff pairs joined by almost nothing: 0 and 1e-13 are hardly two eigenvalues.
        let edges = [(0, 1, 1.0), (2, 3, 1.0), (1, 2, 1e-13)];
        let triplets = edges.iter().flat_map(|&(i, j, w)| {
            [(i, i, w), (j, j, w), (i, j, -w), (j, i, -w)].map(|(i, j, w)| Triplet::new(i, j, w))
        });
        let triplets: Vec<_> = triplets.collect();
        let stiffness = SparseColMat::try_new_from_triplets(4, 4, &triplets).unwrap();
        let laplacian = Laplacian { stiffness, mass: vec![0.25; 4] };
        let basis = eigenbasis(&laplacian, 4, &EigenSettings::default(), &Task::default()).unwrap();
        assert!(basis.orthonormality_error() < 1e-12);
        assert!((0..4).all(|v| (basis.functions[(v, 0)].abs() - 1.0).abs() < 1e-12));
    }
}
