//! The terms that a functional map may be asked to make small, as one quadratic form.
//!
//! E(C) = ‖C A − B‖² + μ s Σ mᵢⱼ Cᵢⱼ² + ν s' Σ_d ‖C S_d − T_d C‖² + ω s'' Σ_d ‖C O_d − P_d C‖², with
//! A, B the descriptors in the two bases, mᵢⱼ = (λ_target,i − λ_source,j)² scaled to a maximum of 1
//! (commutation with the Laplacian), S_d = Φᵀ M diag(f_d) Φ the multiplication by descriptor d
//! (Nogneng & Ovsjanikov 2017), O_d the turn of its gradient (`orientation`). The scales make μ, ν
//! and ω free of units.
//!
//! Operators depend on descriptors linearly, so the sums over d stay the same when descriptors are
//! mixed by an orthogonal matrix, on both sides alike: a hundred wave kernel signatures become the
//! twenty or thirty directions that they span.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use semfm_geom::Eigenbasis;

use super::operators::{Operators, Parity, Terms};
use crate::{Error, Result};

/// Directions of the descriptors whose squares sum to less than this share of all are left out of
/// the operators: less than rounding makes of the normal equations.
const NEGLIGIBLE: f64 = 1e-14;
/// δ, added to the normal equations, which may still be singular at μ → 0.
const SHIFT: f64 = 1e-9;

/// The quadratic energy of a functional map (k_target × k_source).
pub(super) struct Energy {
    /// What C is multiplied by from the right: A Aᵀ + Σ S Sᵀ + δ I (k_source × k_source).
    pub on_source: Mat<f64>,
    /// What C is multiplied by from the left: Σ Tᵀ T (k_target × k_target).
    on_target: Mat<f64>,
    /// B Aᵀ (k_target × k_source): the energy is least where [`apply`](Self::apply) gives this.
    pub right: Mat<f64>,
    /// μ s mᵢⱼ (k_target × k_source), zero without that term.
    pub mask: Mat<f64>,
    /// The target's multiplications T_d, scaled.
    pub multipliers: Operators,
    /// All the target's operators.
    of_target: Operators,
    /// The rows of all the source's operators: column d + r l is row l of S_d (k_source × r k_source).
    of_source: Mat<f64>,
    /// Mean of A Aᵀ's diagonal.
    unit: f64,
}

impl Energy {
    pub fn new(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Self {
        let (k_target, k_source) = (b.nrows(), a.nrows());
        let mut on_source = a * a.transpose();
        let unit = (0..k_source).map(|i| on_source[(i, i)]).sum::<f64>() / k_source as f64;
        (0..k_source).for_each(|i| on_source[(i, i)] += SHIFT);
        Self {
            on_source,
            on_target: Mat::zeros(k_target, k_target),
            right: b * a.transpose(),
            mask: Mat::zeros(k_target, k_source),
            multipliers: Operators::none(k_target),
            of_target: Operators::none(k_target),
            of_source: Mat::zeros(k_source, 0),
            unit,
        }
    }

    /// Adds μ ‖C Λ_source − Λ_target C‖², scaled by the mean of A Aᵀ's diagonal.
    pub fn commute_with_laplacian(&mut self, mu: f64, source: &Eigenbasis, target: &Eigenbasis) {
        let (k_target, k_source) = (self.mask.nrows(), self.mask.ncols());
        // (λ_target,i − λ_source,j)²
        let gaps =
            Mat::from_fn(k_target, k_source, |i, j| (target.values[i] - source.values[j]).powi(2));
        let largest = gaps.norm_max().max(f64::MIN_POSITIVE);
        let scale = mu * self.unit / largest;
        self.mask = Mat::from_fn(k_target, k_source, |i, j| scale * gaps[(i, j)]);
    }

    /// Adds ν Σ ‖C S_d − T_d C‖² for the multiplications by descriptors.
    pub fn commute_with_multiplications(&mut self, nu: f64, s: Operators, t: Operators) {
        self.multipliers = self.commute_with(nu, s, t);
    }

    /// Adds `weight` Σ ‖C S_d − T_d C‖² for operators of both sides that are symmetric or
    /// antisymmetric alike, scaled so that a map that ignores them costs about as much as the
    /// descriptors themselves. Returns the target's, scaled.
    pub fn commute_with(&mut self, weight: f64, mut s: Operators, mut t: Operators) -> Operators {
        let (k_target, k_source, r) = (t.k(), s.k(), s.len());
        let mean = (s.square() + t.square()) / (2 * k_target) as f64;
        let root = (weight * self.unit / mean.max(f64::MIN_POSITIVE)).sqrt();
        s.scale(root);
        t.scale(root);
        let (s_all, t_all) = (s.side_by_side(), t.side_by_side());
        // S Sᵀ and Tᵀ T = T Tᵀ.
        matmul(self.on_source.as_mut(), Accum::Add, s_all, s_all.transpose(), 1.0, Par::Seq);
        matmul(self.on_target.as_mut(), Accum::Add, t_all, t_all.transpose(), 1.0, Par::Seq);
        let before = self.of_target.len();
        self.of_target = std::mem::replace(&mut self.of_target, Operators::none(k_target)).and(&t);
        let (old, all) = (&self.of_source, before + r);
        self.of_source = Mat::from_fn(k_source, all * k_source, |m, column| {
            let (d, l) = (column % all, column / all);
            if d < before { old[(m, d + before * l)] } else { s.of(d - before)[(l, m)] }
        });
        t
    }

    /// Half the gradient's linear part: C ↦ C (A Aᵀ + δ I) + mask ∘ C + Σ (R Sᵀ − Tᵀ R) with
    /// R = C S − T C, where Tᵀ C S = T C Sᵀ.
    pub fn apply(&self, c: &Mat<f64>) -> Mat<f64> {
        let (k_target, k_source, r) = (c.nrows(), c.ncols(), self.of_target.len());
        let mut out = c * &self.on_source;
        for j in 0..k_source {
            let masked = self.mask.col_as_slice(j).iter().zip(c.col_as_slice(j));
            out.col_as_slice_mut(j).iter_mut().zip(masked).for_each(|(x, (m, c))| *x += m * c);
        }
        if r > 0 {
            matmul(out.as_mut(), Accum::Add, self.on_target.as_ref(), c.as_ref(), 1.0, Par::Seq);
            // Column d + r l of C Sᵀ is column l of C S_dᵀ, so the same memory read with columns of
            // k_target r numbers has the C S_dᵀ below each other.
            let mut memory = vec![0.0; k_target * r * k_source];
            let wide = MatMut::from_column_major_slice_mut(&mut memory, k_target, r * k_source);
            let (c, s) = (c.as_ref(), self.of_source.as_ref());
            matmul(wide, Accum::Replace, c, s, 1.0, Par::Seq);
            let tall = MatRef::from_column_major_slice(&memory, k_target * r, k_source);
            let t = self.of_target.side_by_side();
            matmul(out.as_mut(), Accum::Add, t, tall, -2.0, Par::Seq);
        }
        out
    }

    /// The block of [`apply`](Self::apply) that takes row i of Vᵀ C to row i of Vᵀ (its image), for
    /// each i: k_target matrices (k_source × k_source).
    pub fn row_blocks(&self, rotation: MatRef<'_, f64>) -> Vec<Mat<f64>> {
        let (k_target, k_source, r) = (rotation.nrows(), self.mask.ncols(), self.of_target.len());
        let v = rotation;
        let on_target = rotated_diagonal(self.on_target.as_ref(), v);
        let of_target: Vec<Vec<f64>> =
            self.of_target.iter().map(|matrix| rotated_diagonal(matrix, v)).collect();
        let squares = Mat::from_fn(k_target, k_target, |i, j| v[(j, i)].powi(2));
        let mask = squares * &self.mask; // (k_target × k_source)
        let weights = Mat::from_fn(r, k_target, |d, i| -2.0 * of_target[d][i]);
        // Σ_d weight S_d for every row at once: the entries of S_d below each other, d by d.
        let entries = Mat::from_fn(k_source * k_source, r, |at, d| {
            self.of_source[(at % k_source, d + r * (at / k_source))]
        });
        let mixed = entries * weights; // (k_source² × k_target)
        let blocks = (0..k_target).map(|i| {
            let mut block = self.on_source.clone();
            for (l, mixed) in mixed.col_as_slice(i).chunks_exact(k_source).enumerate() {
                block.col_as_slice_mut(l).iter_mut().zip(mixed).for_each(|(x, m)| *x += m);
                block[(l, l)] += on_target[i] + mask[(i, l)];
            }
            block
        });
        blocks.collect()
    }
}

/// The diagonal of Vᵀ M V.
fn rotated_diagonal(matrix: MatRef<'_, f64>, v: MatRef<'_, f64>) -> Vec<f64> {
    let turned = matrix * v;
    (0..v.ncols()).map(|i| v.col(i).transpose() * turned.col(i)).collect()
}

/// Descriptors of both sides, mixed alike and cut to the directions that count.
pub(super) struct Directions {
    /// Coefficients on the source (k_source × r).
    pub source: Mat<f64>,
    /// Coefficients on the target (k_target × r).
    pub target: Mat<f64>,
}

impl Directions {
    /// The principal directions of the descriptors `a` and `b` (k × p each, r ≤ p): U Σ of both
    /// sides below each other.
    pub fn principal(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Result<Self> {
        let (k_source, k_target) = (a.nrows(), b.nrows());
        let mut both = Mat::zeros(k_source + k_target, a.ncols());
        both.as_mut().subrows_mut(0, k_source).copy_from(a);
        both.as_mut().subrows_mut(k_source, k_target).copy_from(b);
        let svd = both.thin_svd().map_err(|_| FAILED)?;
        let squares: Vec<f64> = svd.S().column_vector().iter().map(|s| s * s).collect();
        let total: f64 = squares.iter().sum();
        let mut r = squares.len();
        let mut left_out = 0.0;
        while r > 0 && left_out + squares[r - 1] <= NEGLIGIBLE * total {
            left_out += squares[r - 1];
            r -= 1;
        }
        let columns =
            Mat::from_fn(k_source + k_target, r, |i, d| svd.U()[(i, d)] * squares[d].sqrt());
        Ok(Self {
            source: columns.subrows(0, k_source).to_owned(),
            target: columns.subrows(k_source, k_target).to_owned(),
        })
    }
}

const FAILED: Error = Error::LinearAlgebra("the singular values of the descriptors of both sides");

/// Φᵀ M diag(f) Φ for the functions f with these coefficients (k × r).
pub(super) fn multiplications(coefficients: MatRef<'_, f64>, basis: &Eigenbasis) -> Operators {
    let k = coefficients.nrows();
    let phi = basis.first(k);
    Operators::new(Parity::Symmetric, basis.n_vertices(), coefficients, |first, products, f| {
        let places = f.nrows();
        f.copy_from(phi.subrows(first, places));
        let mass = &basis.mass[first..first + places];
        let mut weighted = vec![0.0; places];
        let mut columns = products.col_iter_mut();
        for j in 0..k {
            let of_j = f.col_as_slice(j).iter().zip(mass);
            weighted.iter_mut().zip(of_j).for_each(|(x, (phi, m))| *x = phi * m);
            for (i, out) in (0..=j).zip(&mut columns) {
                Terms::product(out, &weighted, f.col_as_slice(i)).write();
            }
        }
    })
}
