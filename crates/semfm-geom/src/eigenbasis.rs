//! The truncated Laplace–Beltrami eigenbasis of a shape.

use faer::{Mat, MatRef};

/// The first k eigenpairs of `L φ = λ M φ`, ascending, orthonormal for the lumped mass M.
#[derive(Clone, Debug)]
pub struct Eigenbasis {
    /// Eigenvalues λ (k), ascending, never negative.
    pub values: Vec<f64>,
    /// Eigenfunctions Φ (n × k), one column each, Φᵀ M Φ = I.
    pub functions: Mat<f64>,
    /// Lumped mass M (n), the diagonal.
    pub mass: Vec<f64>,
    /// Relative residuals ‖L φ − λ M φ‖_{M⁻¹} / max(λ, 1) (k).
    pub residuals: Vec<f64>,
}

impl Eigenbasis {
    /// Number of eigenpairs k.
    pub fn k(&self) -> usize {
        self.values.len()
    }

    /// Number of vertices n.
    pub fn n_vertices(&self) -> usize {
        self.mass.len()
    }

    /// The first `k` eigenfunctions (n × k), a view.
    pub fn first(&self, k: usize) -> MatRef<'_, f64> {
        self.functions.as_ref().subcols(0, k)
    }

    /// Coefficients Φᵀ M f (k) of a function f (n) on the vertices.
    pub fn project(&self, function: &[f64]) -> Vec<f64> {
        assert_eq!(function.len(), self.n_vertices(), "one value per vertex");
        let weighted: Vec<f64> = function.iter().zip(&self.mass).map(|(f, m)| f * m).collect();
        (0..self.k())
            .map(|j| self.functions.col(j).iter().zip(&weighted).map(|(phi, f)| phi * f).sum())
            .collect()
    }

    /// The function Φ a (n) with coefficients `a` (at most k of them).
    pub fn reconstruct(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut function = vec![0.0; self.n_vertices()];
        for (j, a) in coefficients.iter().enumerate() {
            for (f, phi) in function.iter_mut().zip(self.functions.col(j).iter()) {
                *f += a * phi;
            }
        }
        function
    }

    /// Heat diffusion exp(−tΔ) f on the truncated basis: exp(−tλᵢ) on each coefficient.
    ///
    /// `t` is relative to the units of the basis, which a shape scales to
    /// area 1.
    pub fn diffuse(&self, function: &[f64], t: f64) -> Vec<f64> {
        let mut coefficients = self.project(function);
        for (a, lambda) in coefficients.iter_mut().zip(&self.values) {
            *a *= (-t * lambda).exp();
        }
        self.reconstruct(&coefficients)
    }
}
