//! The first eigenpairs of a Laplacian.

use faer::{Mat, Side};

use crate::{Eigenbasis, Error, Laplacian, Result, Task};

/// How the eigenbasis is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct EigenSettings {
    /// Largest relative residual accepted.
    pub tolerance: f64,
    /// Seed of the starting block.
    pub seed: u64,
}

impl Default for EigenSettings {
    fn default() -> Self {
        Self { tolerance: 1e-8, seed: 0 }
    }
}

/// The first `k` eigenpairs of `stiffness φ = λ mass φ`, ascending.
///
/// # Errors
/// [`Error::TooManyEigenpairs`] for k above the vertex count, [`Error::Cancelled`].
pub fn eigenbasis(
    laplacian: &Laplacian,
    k: usize,
    settings: &EigenSettings,
    task: &Task,
) -> Result<Eigenbasis> {
    let n_vertices = laplacian.n_vertices();
    if k == 0 || k > n_vertices {
        return Err(Error::TooManyEigenpairs { asked: k, n_vertices });
    }
    task.check()?;
    let _ = settings;
    dense(laplacian, k)
}

fn dense(laplacian: &Laplacian, k: usize) -> Result<Eigenbasis> {
    let n = laplacian.n_vertices();
    let root: Vec<f64> = laplacian.mass.iter().map(|m| m.sqrt()).collect();
    let mut symmetric = Mat::<f64>::zeros(n, n);
    for t in laplacian.stiffness.triplet_iter() {
        symmetric[(t.row, t.col)] += t.val / (root[t.row] * root[t.col]);
    }
    let eigen = symmetric
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| Error::LinearAlgebra("the dense eigendecomposition"))?;
    let values = (0..k).map(|j| eigen.S().column_vector()[j].max(0.0)).collect();
    let functions = Mat::from_fn(n, k, |i, j| eigen.U()[(i, j)] / root[i]);
    Ok(Eigenbasis { values, functions, mass: laplacian.mass.clone(), residuals: vec![0.0; k] })
}
