//! The functional map that agrees with the descriptors.

mod energy;

use faer::linalg::solvers::Solve;
use faer::{Mat, MatRef, Side};
use semfm_geom::{Eigenbasis, Task};
use serde::{Deserialize, Serialize};

use self::energy::Energy;
use crate::functional_map::check_size;
use crate::{Error, FunctionalMap, Result};

/// Singular values below this share of the largest count as zero in the minimum-norm solution.
const RANK_CUTOFF: f64 = 1e-12;
/// Added to the normal equations of a regularised fit, which may still be singular at μ → 0.
const FLOOR: f64 = 1e-9;
/// Relative residual at which the conjugate gradients stop, and their limit.
const CG_TOLERANCE: f64 = 1e-10;
const CG_LIMIT: usize = 2000;

/// What is asked of C besides the descriptors. Both weights are relative to the descriptor term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FitSettings {
    /// μ: commutation with the Laplacian, ‖C Λ_source − Λ_target C‖².
    pub laplacian: f64,
    /// ν: commutation with multiplication by each descriptor (Nogneng & Ovsjanikov 2017).
    pub descriptors: f64,
}

/// A fitted map and how well it was determined.
#[derive(Clone, Debug)]
pub struct Fit {
    /// C (k_target × k_source).
    pub map: FunctionalMap,
    /// What a report says about it.
    pub report: FitReport,
}

/// How well the descriptors determined the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Size k of the map (k × k).
    pub k: usize,
    /// Number of descriptors.
    pub n_descriptors: usize,
    /// Rank of the source descriptors: the rank of C where nothing else was asked for.
    pub rank: usize,
    /// Whether C is the minimum-norm one among many that fit equally well.
    pub minimum_norm: bool,
    /// ‖C A − B‖ / ‖B‖.
    pub residual: f64,
    /// Conjugate-gradient iterations, 0 for a direct solution.
    pub iterations: usize,
}

/// Finds C (k × k) of least ‖C A − B‖² (+ regularisers) for the descriptors A, B (k × p), given as
/// coefficients in the two bases.
///
/// Without a regulariser and with fewer descriptors than eigenfunctions the problem has many
/// solutions; the answer is then the minimum-norm one, B A⁺, which is what the paper's equation
/// gives for its two anchors. With the Laplacian alone the rows separate and are solved one by
/// one; with descriptor commutation they do not, and conjugate gradients solve for all of C.
///
/// # Errors
/// [`Error::Length`] where A and B differ in shape, [`Error::BasisTooSmall`],
/// [`Error::OutOfRange`] for negative weights, [`Error::LinearAlgebra`], cancellation.
pub fn fit(
    (a, b): (MatRef<'_, f64>, MatRef<'_, f64>),
    source: &Eigenbasis,
    target: &Eigenbasis,
    settings: &FitSettings,
    task: &Task,
) -> Result<Fit> {
    semfm_geom::algebra::keep_sequential();
    Error::length("descriptors of the target", a.ncols(), b.ncols())?;
    Error::length("coefficients per descriptor of the target", a.nrows(), b.nrows())?;
    check_size("the descriptors", a.nrows(), source, target)?;
    if !(settings.laplacian >= 0.0 && settings.descriptors >= 0.0) {
        let found = format!("{} and {}", settings.laplacian, settings.descriptors);
        return Error::out_of_range("fit weights", "numbers of at least 0", found);
    }
    let failed = |_| Error::LinearAlgebra("the singular values of the descriptors");
    let singular = a.thin_svd().map_err(failed)?;
    let largest = singular.S().column_vector().iter().fold(0.0f64, |m, &s| m.max(s));
    let keep = |s: f64| s > RANK_CUTOFF * largest;
    let rank = singular.S().column_vector().iter().filter(|&&s| keep(s)).count();

    let bare = settings.laplacian == 0.0 && settings.descriptors == 0.0;
    let (matrix, iterations) = if bare {
        // C = B A⁺ = B V Σ⁺ Uᵀ
        let mut coefficients = b * singular.V(); // (k × rank)
        for (j, &s) in singular.S().column_vector().iter().enumerate() {
            let scale = if keep(s) { s.recip() } else { 0.0 };
            coefficients.col_mut(j).iter_mut().for_each(|x| *x *= scale);
        }
        (coefficients * singular.U().transpose(), 0)
    } else {
        let mut energy = Energy::new(a, b);
        if settings.laplacian > 0.0 {
            energy.commute_with_laplacian(settings.laplacian, source, target);
        }
        let by_rows = solve_by_rows(&energy)?;
        if settings.descriptors > 0.0 {
            energy.commute_with_descriptors(settings.descriptors, (a, b), source, target);
            conjugate_gradients(&energy, by_rows, task)?
        } else {
            (by_rows, 0)
        }
    };
    let misfit = (&matrix * a - b).norm_l2() / b.norm_l2().max(f64::MIN_POSITIVE);
    let report = FitReport {
        k: a.nrows(),
        n_descriptors: a.ncols(),
        rank,
        minimum_norm: bare && rank < a.nrows(),
        residual: misfit,
        iterations,
    };
    Ok(Fit { map: FunctionalMap::new(matrix), report })
}

/// Row i of C solves (A Aᵀ + diag(maskᵢ) + floor) cᵢ = (B Aᵀ)ᵢ.
fn solve_by_rows(energy: &Energy) -> Result<Mat<f64>> {
    let (k_target, k_source) = (energy.right.nrows(), energy.right.ncols());
    let mut matrix = Mat::zeros(k_target, k_source);
    for i in 0..k_target {
        let mut system = energy.gram.clone();
        (0..k_source).for_each(|j| system[(j, j)] += energy.mask[(i, j)] + FLOOR);
        let factor =
            system.llt(Side::Lower).map_err(|_| Error::LinearAlgebra("the regularised fit"))?;
        let row = factor.solve(energy.right.row(i).transpose());
        matrix.row_mut(i).copy_from(row.transpose());
    }
    Ok(matrix)
}

/// Minimises the whole energy from `start`, preconditioned by the diagonal.
fn conjugate_gradients(energy: &Energy, start: Mat<f64>, task: &Task) -> Result<(Mat<f64>, usize)> {
    let (k_target, k_source) = (start.nrows(), start.ncols());
    let diagonal = Mat::from_fn(k_target, k_source, |i, j| {
        let commute: f64 = energy
            .multipliers
            .iter()
            .map(|(s, t)| {
                s.row(j).squared_norm_l2() + t.col(i).squared_norm_l2()
                    - 2.0 * s[(j, j)] * t[(i, i)]
            })
            .sum();
        energy.gram[(j, j)] + energy.mask[(i, j)] + commute + FLOOR
    });
    let apply = |c: &Mat<f64>| energy.apply(c.as_ref()) + c * faer::Scale(FLOOR);
    let precondition =
        |r: &Mat<f64>| Mat::from_fn(k_target, k_source, |i, j| r[(i, j)] / diagonal[(i, j)]);
    let inner = |x: &Mat<f64>, y: &Mat<f64>| -> f64 {
        (0..k_source).map(|j| x.col(j).transpose() * y.col(j)).sum()
    };
    let mut c = start;
    let mut residual = &energy.right - apply(&c);
    let goal = CG_TOLERANCE * energy.right.norm_l2();
    let mut direction = precondition(&residual);
    let mut size = inner(&residual, &direction);
    for iteration in 0..CG_LIMIT {
        if residual.norm_l2() <= goal {
            return Ok((c, iteration));
        }
        task.step("fit", iteration, CG_LIMIT)?;
        let image = apply(&direction);
        let step = size / inner(&direction, &image);
        c += &direction * faer::Scale(step);
        residual -= &image * faer::Scale(step);
        let conditioned = precondition(&residual);
        let next = inner(&residual, &conditioned);
        direction = conditioned + &direction * faer::Scale(next / size);
        size = next;
    }
    Ok((c, CG_LIMIT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pair::tests::{blob, shape};

    /// Two descriptors on the same shape, of rank 2 in a basis of 12.
    fn two_bumps(basis: &Eigenbasis) -> Mat<f64> {
        Mat::from_fn(12, 2, |i, j| {
            ((i + 1) as f64 * (j + 1) as f64).sin() * (-0.01 * basis.values[i]).exp()
        })
    }

    #[test]
    fn two_descriptors_give_the_minimum_norm_map_of_rank_two() {
        let shape = shape(&blob(1.0), 12);
        let basis = shape.basis();
        let a = two_bumps(basis);
        let b = Mat::from_fn(12, 2, |i, j| a[(i, 1 - j)]);
        let fit =
            fit((a.as_ref(), b.as_ref()), basis, basis, &FitSettings::default(), &Task::default())
                .unwrap();
        assert!(fit.report.minimum_norm && fit.report.rank == 2 && fit.report.residual < 1e-12);
        // Minimum norm: C lives on the span of A, so C (I − A A⁺) = 0.
        let c = fit.map.matrix();
        let a_gram = a.transpose() * &a;
        let inverse = a_gram.llt(Side::Lower).unwrap().solve(a.transpose());
        let outside = c - c * &a * inverse;
        assert!(outside.norm_l2() < 1e-10, "{}", outside.norm_l2());
    }

    #[test]
    fn regularisers_turn_descriptors_of_one_shape_into_the_identity() {
        let shape = shape(&blob(1.0), 12);
        let basis = shape.basis();
        let a = two_bumps(basis);
        for settings in [
            FitSettings { laplacian: 1e-3, descriptors: 0.0 },
            FitSettings { laplacian: 1e-3, descriptors: 1e-2 },
        ] {
            let fit =
                fit((a.as_ref(), a.as_ref()), basis, basis, &settings, &Task::default()).unwrap();
            let c = fit.map.matrix();
            let off: f64 = (0..12).map(|i| (c[(i, i)] - 1.0).abs()).fold(0.0, f64::max);
            assert!(off < 0.05, "diagonal is off by {off} with {settings:?}");
            assert!(!fit.report.minimum_norm);
            assert!(fit.report.iterations < CG_LIMIT);
        }
    }

    #[test]
    fn the_solution_has_no_gradient() {
        let (one, other) = (shape(&blob(1.0), 8), shape(&blob(1.6), 8));
        let a = two_bumps(shape(&blob(1.0), 12).basis()).subrows(0, 8).to_owned();
        let b = Mat::from_fn(8, 2, |i, j| a[(i, j)] * 1.1 + 0.02 * (i as f64).cos());
        let settings = FitSettings { laplacian: 0.01, descriptors: 0.1 };
        let fit =
            fit((a.as_ref(), b.as_ref()), one.basis(), other.basis(), &settings, &Task::default())
                .unwrap();
        let mut energy = Energy::new(a.as_ref(), b.as_ref());
        energy.commute_with_laplacian(0.01, one.basis(), other.basis());
        energy.commute_with_descriptors(0.1, (a.as_ref(), b.as_ref()), one.basis(), other.basis());
        let value = |c: &Mat<f64>| {
            let descriptors = (c * &a - &b).squared_norm_l2();
            let mask: f64 = (0..8)
                .flat_map(|i| (0..8).map(move |j| (i, j)))
                .map(|(i, j)| energy.mask[(i, j)] * c[(i, j)].powi(2))
                .sum();
            let commute: f64 =
                energy.multipliers.iter().map(|(s, t)| (c * s - t * c).squared_norm_l2()).sum();
            descriptors + mask + commute
        };
        let best = fit.map.matrix().to_owned();
        let least = value(&best);
        for (i, j) in [(0, 0), (3, 5), (7, 1)] {
            for h in [-1e-3, 1e-3] {
                let mut moved = best.clone();
                moved[(i, j)] += h;
                assert!(value(&moved) > least - 1e-9, "moving C[{i}, {j}] by {h} helps");
            }
        }
    }
}
