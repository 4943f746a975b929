//! The truncated Laplace–Beltrami eigenbasis of a shape.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use crate::eigensolver::orthonormality_error;

/// Vertices at a time in a projection: their eigenfunctions, times the mass, stay in the cache.
const PROJECTED: usize = 512;

/// The first k eigenpairs of `L φ = λ M φ`, ascending, orthonormal for the lumped mass M.
#[derive(Clone, Debug)]
pub struct Eigenbasis {
    /// Eigenvalues λ (k), ascending, never negative.
    pub values: Vec<f64>,
    /// Eigenfunctions Φ (n × k), one column each, Φᵀ M Φ = I.
    pub functions: Mat<f64>,
    /// Lumped mass M (n), the diagonal.
    pub mass: Vec<f64>,
    /// Relative residuals ‖L φ − λ M φ‖_{M⁻¹} / max(λ, 1 / area) (k). The area is 1 in a `Shape`;
    /// dividing by it makes the number independent of the mesh's units.
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

    /// Largest entry of |Φᵀ M Φ − I|: how far from orthonormal the basis is.
    pub fn orthonormality_error(&self) -> f64 {
        let mut weighted = self.functions.clone();
        for j in 0..self.k() {
            let column = weighted.col_as_slice_mut(j).iter_mut();
            column.zip(&self.mass).for_each(|(phi, m)| *phi *= m.sqrt());
        }
        orthonormality_error(weighted.as_ref())
    }

    /// Coefficients Φᵀ M f (k) of a function f (n) on the vertices.
    ///
    /// # Panics
    /// Where `function` has not one value per vertex.
    pub fn project(&self, function: &[f64]) -> Vec<f64> {
        let f = MatRef::from_column_major_slice(function, function.len(), 1);
        self.project_all(f).col_as_slice(0).to_vec()
    }

    /// Coefficients Φᵀ M F (k × p) of p functions F (n × p), one column each.
    ///
    /// # Panics
    /// Where `functions` has not one row per vertex.
    pub fn project_all(&self, functions: MatRef<'_, f64>) -> Mat<f64> {
        self.project_first(self.k(), functions)
    }

    /// Coefficients (k × p) of p functions F (n × p) in the first `k` eigenfunctions alone.
    ///
    /// # Panics
    /// Where `functions` has not one row per vertex, or there are fewer eigenfunctions.
    pub fn project_first(&self, k: usize, functions: MatRef<'_, f64>) -> Mat<f64> {
        assert_eq!(functions.nrows(), self.n_vertices(), "one value per vertex");
        let phi = self.first(k);
        let mut coefficients = Mat::zeros(k, functions.ncols());
        for first in (0..functions.nrows()).step_by(PROJECTED) {
            let n = PROJECTED.min(functions.nrows() - first);
            let mut weighted = phi.subrows(first, n).to_owned();
            let mass = &self.mass[first..first + n];
            for j in 0..k {
                let column = weighted.col_as_slice_mut(j).iter_mut();
                column.zip(mass).for_each(|(phi, m)| *phi *= m);
            }
            let (phi_t, f) = (weighted.transpose(), functions.subrows(first, n));
            matmul(coefficients.as_mut(), Accum::Add, phi_t, f, 1.0, Par::Seq);
        }
        coefficients
    }

    /// The function Φ a (n) with coefficients `a` (at most k of them).
    ///
    /// # Panics
    /// Where there are more coefficients than eigenfunctions.
    pub fn reconstruct(&self, coefficients: &[f64]) -> Vec<f64> {
        let a = MatRef::from_column_major_slice(coefficients, coefficients.len(), 1);
        self.reconstruct_all(a).col_as_slice(0).to_vec()
    }

    /// The functions Φ A (n × p) with coefficients A (at most k rows × p), one column each.
    ///
    /// # Panics
    /// Where there are more coefficients than eigenfunctions.
    pub fn reconstruct_all(&self, coefficients: MatRef<'_, f64>) -> Mat<f64> {
        assert!(coefficients.nrows() <= self.k(), "at most one coefficient per eigenfunction");
        let mut functions = Mat::zeros(self.n_vertices(), coefficients.ncols());
        let phi = self.first(coefficients.nrows());
        matmul(functions.as_mut(), Accum::Replace, phi, coefficients, 1.0, Par::Seq);
        functions
    }

    /// Heat diffusion exp(−tΔ) f on the truncated basis: exp(−tλᵢ) on each coefficient.
    ///
    /// `t` is relative to the units of the basis, which a shape scales to
    /// area 1.
    pub fn diffuse(&self, function: &[f64], t: f64) -> Vec<f64> {
        let f = MatRef::from_column_major_slice(function, function.len(), 1);
        self.diffuse_all(f, t).col_as_slice(0).to_vec()
    }

    /// [`diffuse`](Self::diffuse) for p functions F (n × p), one column each.
    pub fn diffuse_all(&self, functions: MatRef<'_, f64>, t: f64) -> Mat<f64> {
        let mut coefficients = self.project_all(functions);
        for j in 0..coefficients.ncols() {
            let column = coefficients.col_as_slice_mut(j).iter_mut();
            column.zip(&self.values).for_each(|(a, lambda)| *a *= (-t * lambda).exp());
        }
        self.reconstruct_all(coefficients.as_ref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eigensolver::{EigenSettings, eigenbasis};
    use crate::laplacian::cotan_laplacian;
    use crate::math::DVec3;
    use crate::{Mesh, Task};

    fn octahedron() -> Eigenbasis {
        let axes = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let faces =
            (0..4).flat_map(|i| [[i, (i + 1) % 4, 4], [(i + 1) % 4, i, 5]]).collect::<Vec<_>>();
        let laplacian = cotan_laplacian(&Mesh::new(axes.to_vec(), faces).unwrap()).unwrap();
        eigenbasis(&laplacian, 6, &EigenSettings::default(), &Task::default()).unwrap()
    }

    #[test]
    fn a_full_basis_gives_every_function_back() {
        let basis = octahedron();
        assert!(basis.orthonormality_error() < 1e-14);
        let f = [3.0, -1.0, 4.0, 1.0, -5.0, 9.0];
        let back = basis.reconstruct(&basis.project(&f));
        assert!(f.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    #[test]
    fn diffusion_keeps_the_integral_and_ends_in_the_mean() {
        let basis = octahedron();
        let f = [3.0, -1.0, 4.0, 1.0, -5.0, 9.0];
        let [before, after] = [f.to_vec(), basis.diffuse(&f, 0.1)]
            .map(|f| f.iter().zip(&basis.mass).map(|(f, m)| f * m).sum::<f64>());
        assert!((after - before).abs() < 1e-12);
        let mean = before / basis.mass.iter().sum::<f64>();
        assert!(basis.diffuse(&f, 1e3).iter().all(|v| (v - mean).abs() < 1e-12));
    }

    #[test]
    fn the_first_coefficients_are_those_of_all() {
        let mesh = crate::zoo::icosphere(3); // more vertices than are projected at a time
        let laplacian = cotan_laplacian(&mesh).unwrap();
        let basis = eigenbasis(&laplacian, 6, &EigenSettings::default(), &Task::default()).unwrap();
        let n = basis.n_vertices();
        assert!(n > PROJECTED);
        let f = Mat::from_fn(n, 2, |i, j| ((7 * i + 11 * j) as f64).sin());
        let all = basis.project_all(f.as_ref());
        let first = basis.project_first(4, f.as_ref());
        for j in 0..2 {
            for i in 0..6 {
                let sum: f64 =
                    (0..n).map(|v| basis.functions[(v, i)] * basis.mass[v] * f[(v, j)]).sum();
                assert!((all[(i, j)] - sum).abs() < 1e-12, "{i} {j}");
                assert!(i >= 4 || (first[(i, j)] - sum).abs() < 1e-12, "{i} {j}");
            }
        }
        // Row-major functions, as NumPy has them, are read where they lie.
        let rows: Vec<f64> = (0..2 * n).map(|at| f[(at / 2, at % 2)]).collect();
        let view = MatRef::from_row_major_slice(&rows, n, 2);
        assert!((basis.project_first(4, view) - &first).norm_max() < 1e-14);
    }

    #[test]
    fn many_functions_at_once_give_what_one_at_a_time_gives() {
        let basis = octahedron();
        let f = Mat::from_fn(6, 3, |i, j| ((5 * i + 3 * j) % 7) as f64);
        let all = basis.diffuse_all(f.as_ref(), 0.05);
        for j in 0..3 {
            let one = basis.diffuse(f.col_as_slice(j), 0.05);
            assert!(one.iter().enumerate().all(|(i, v)| (v - all[(i, j)]).abs() < 1e-13));
        }
    }
}
