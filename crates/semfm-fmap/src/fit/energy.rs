//! The terms that a functional map may be asked to make small, as one quadratic form.
//!
//! E(C) = ‖C A − B‖² + μ s Σ mᵢⱼ Cᵢⱼ² + ν s' Σ_d ‖C S_d − T_d C‖², with
//! A, B the descriptors in the two bases, mᵢⱼ = (λ_target,i − λ_source,j)² scaled to a maximum of 1
//! (commutation with the Laplacian), S_d = Φᵀ M diag(f_d) Φ the multiplication by descriptor d
//! (Nogneng & Ovsjanikov 2017). The scales s and s' make μ and ν free of units.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use semfm_geom::Eigenbasis;

/// The quadratic energy of a functional map (k_target × k_source).
pub(super) struct Energy {
    /// A Aᵀ (k_source × k_source).
    pub gram: Mat<f64>,
    /// B Aᵀ (k_target × k_source): the energy is least where [`apply`](Self::apply) gives this.
    pub right: Mat<f64>,
    /// μ s mᵢⱼ (k_target × k_source), zero where not asked for.
    pub mask: Mat<f64>,
    /// Pairs (S_d, T_d) of multiplication operators, scaled by √(ν s').
    pub multipliers: Vec<(Mat<f64>, Mat<f64>)>,
}

impl Energy {
    pub fn new(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Self {
        let mask = Mat::zeros(b.nrows(), a.nrows());
        Self { gram: a * a.transpose(), right: b * a.transpose(), mask, multipliers: Vec::new() }
    }

    /// Adds μ ‖C Λ_source − Λ_target C‖², scaled by the mean of A Aᵀ's diagonal.
    pub fn commute_with_laplacian(&mut self, mu: f64, source: &Eigenbasis, target: &Eigenbasis) {
        let (k_target, k_source) = (self.mask.nrows(), self.mask.ncols());
        let gap = |i: usize, j: usize| (target.values[i] - source.values[j]).powi(2);
        let mut largest = f64::MIN_POSITIVE;
        for j in 0..k_source {
            for i in 0..k_target {
                largest = largest.max(gap(i, j));
            }
        }
        let scale = mu * self.mean_diagonal() / largest;
        self.mask = Mat::from_fn(k_target, k_source, |i, j| scale * gap(i, j));
    }

    /// Adds ν Σ ‖C S_d − T_d C‖² for the descriptors (k × p) of both sides, scaled so that a map
    /// that ignores it pays about as much as for the descriptors themselves.
    pub fn commute_with_descriptors(
        &mut self,
        nu: f64,
        (a, b): (MatRef<'_, f64>, MatRef<'_, f64>),
        source: &Eigenbasis,
        target: &Eigenbasis,
    ) {
        let pairs: Vec<(Mat<f64>, Mat<f64>)> = (0..a.ncols())
            .map(|d| (multiplication(a, d, source), multiplication(b, d, target)))
            .collect();
        let size: f64 = pairs.iter().map(|(s, t)| s.squared_norm_l2() + t.squared_norm_l2()).sum();
        let mean = size / (2 * self.mask.nrows()) as f64;
        let root = (nu * self.mean_diagonal() / mean.max(f64::MIN_POSITIVE)).sqrt();
        let scaled = |m: Mat<f64>| m * faer::Scale(root);
        self.multipliers = pairs.into_iter().map(|(s, t)| (scaled(s), scaled(t))).collect();
    }

    pub fn mean_diagonal(&self) -> f64 {
        let k = self.gram.nrows();
        (0..k).map(|i| self.gram[(i, i)]).sum::<f64>() / k as f64
    }

    /// Half the gradient's linear part: C ↦ C A Aᵀ + mask ∘ C + Σ (R Sᵀ − Tᵀ R), R = C S − T C.
    pub fn apply(&self, c: MatRef<'_, f64>) -> Mat<f64> {
        let mut out = c * &self.gram;
        for j in 0..c.ncols() {
            for i in 0..c.nrows() {
                out[(i, j)] += self.mask[(i, j)] * c[(i, j)];
            }
        }
        for (s, t) in &self.multipliers {
            let residual = c * s - t * c;
            matmul(out.as_mut(), Accum::Add, residual.as_ref(), s.transpose(), 1.0, Par::Seq);
            matmul(out.as_mut(), Accum::Add, t.transpose(), residual.as_ref(), -1.0, Par::Seq);
        }
        out
    }
}

/// Φᵀ M diag(Φ a) Φ (k × k): multiplication by the function with coefficients `a`, column `d`.
fn multiplication(coefficients: MatRef<'_, f64>, d: usize, basis: &Eigenbasis) -> Mat<f64> {
    let k = coefficients.nrows();
    let function = basis.first(k) * coefficients.col(d);
    let mut weighted = basis.first(k).to_owned();
    for c in 0..k {
        for ((x, f), m) in weighted.col_mut(c).iter_mut().zip(function.iter()).zip(&basis.mass) {
            *x *= f * m;
        }
    }
    basis.first(k).transpose() * weighted
}
