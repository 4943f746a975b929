//! The functional map that agrees with the descriptors.

mod energy;
mod joint;
mod operators;
mod orientation;
mod solve;

use faer::{Mat, MatRef};
use semfm_geom::{Eigenbasis, Task};
use serde::{Deserialize, Serialize};

use self::energy::{Directions, Energy, multiplications};
pub use self::orientation::OrientedSurface;
use self::orientation::turns;
use crate::functional_map::check_size;
use crate::{Error, FunctionalMap, Result};

/// Singular values below this share of the largest count as zero in the minimum-norm solution.
const RANK_CUTOFF: f64 = 1e-12;

/// Regularisers of C beside the descriptors. All weights are relative to the descriptor term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FitSettings {
    /// μ: commutation with the Laplacian, ‖C Λ_source − Λ_target C‖².
    pub laplacian: f64,
    /// ν: commutation with multiplication by each descriptor (Nogneng & Ovsjanikov 2017).
    pub descriptors: f64,
    /// ω: commutation with the turned gradient of each descriptor, which keeps the two sides of a
    /// surface apart (Ren et al. 2018). Needs an [`OrientedSurface`] on both sides.
    pub orientation: f64,
    /// Whether the orientation is to be reversed instead of preserved: left to right.
    pub reversing: bool,
}

/// One shape and what is known of it, as a fit reads them.
#[derive(Clone, Copy, Debug)]
pub struct FitSide<'a> {
    /// Its eigenbasis (n × k_basis).
    pub basis: &'a Eigenbasis,
    /// The descriptors as coefficients in the basis (k × p).
    pub descriptors: MatRef<'a, f64>,
    /// The triangles on its n vertices; needed where the orientation matters.
    pub surface: Option<&'a OrientedSurface>,
}

impl<'a> FitSide<'a> {
    /// A shape whose orientation does not matter.
    pub fn new(basis: &'a Eigenbasis, descriptors: MatRef<'a, f64>) -> Self {
        Self { basis, descriptors, surface: None }
    }
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
    /// Rank of the source descriptors: the rank of C without regularisers.
    pub rank: usize,
    /// Whether C is the minimum-norm one among many that fit equally well.
    pub minimum_norm: bool,
    /// ‖C A − B‖ / ‖B‖.
    pub residual: f64,
    /// Conjugate-gradient iterations, 0 for a direct solution.
    pub iterations: usize,
}

/// Finds C (k × k) of least ‖C A − B‖² (+ regularisers) for the descriptors A of the source and B of
/// the target (k × p each).
///
/// Without a regulariser and with fewer descriptors than eigenfunctions the problem has many
/// solutions; the answer is then the minimum-norm one, B A⁺, which is what the paper's equation
/// gives for its two anchors. With the Laplacian alone the rows separate and are solved one by
/// one; with operators to commute with they do not, and conjugate gradients solve for all of C.
///
/// # Errors
/// [`Error::Length`] where A and B differ in shape or a surface is not that of its basis,
/// [`Error::BasisTooSmall`], [`Error::OutOfRange`] for negative weights, for an orientation without
/// surfaces and for surfaces wound against each other, [`Error::LinearAlgebra`], [`Error::Geom`] on
/// cancellation.
pub fn fit(
    source: FitSide<'_>,
    target: FitSide<'_>,
    settings: &FitSettings,
    task: &Task,
) -> Result<Fit> {
    semfm_geom::keep_faer_sequential();
    check(&source, &target, settings)?;
    let (a, b) = (source.descriptors, target.descriptors);
    let bare = settings.weights() == [0.0; 3];
    let solution =
        if bare { minimum_norm(a, b)? } else { regularised(&source, &target, settings, task)? };
    let Solution { matrix, rank, iterations } = solution;
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

impl FitSettings {
    /// μ, ν and ω.
    fn weights(&self) -> [f64; 3] {
        [self.laplacian, self.descriptors, self.orientation]
    }
}

/// C before it is wrapped.
struct Solution {
    /// C (k_target × k_source).
    matrix: Mat<f64>,
    /// Rank of the source's descriptors.
    rank: usize,
    /// Conjugate-gradient iterations.
    iterations: usize,
}

fn check(source: &FitSide<'_>, target: &FitSide<'_>, settings: &FitSettings) -> Result<()> {
    let (a, b) = (source.descriptors, target.descriptors);
    Error::length("descriptors of the target", a.ncols(), b.ncols())?;
    Error::length("coefficients per descriptor of the target", a.nrows(), b.nrows())?;
    check_size("the descriptors", a.nrows(), source.basis, target.basis)?;
    if a.nrows() == 0 {
        return Error::out_of_range("coefficients per descriptor", "at least 1", 0);
    }
    let weights = settings.weights();
    if !weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite()) {
        let found = weights.map(|weight| weight.to_string()).join(", ");
        return Error::out_of_range("fit weights", "finite numbers of at least 0", found);
    }
    Ok(())
}

/// C = B A⁺ = B V Σ⁺ Uᵀ with A = U Σ Vᵀ
fn minimum_norm(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Result<Solution> {
    let singular = a.thin_svd().map_err(|_| SINGULAR_VALUES)?;
    let values: Vec<f64> = singular.S().column_vector().iter().copied().collect();
    let least = least_counted(&values);
    let mut coefficients = b * singular.V(); // (k × rank)
    for (j, &s) in values.iter().enumerate() {
        let scale = if s > least { s.recip() } else { 0.0 };
        coefficients.col_mut(j).iter_mut().for_each(|x| *x *= scale);
    }
    let matrix = coefficients * singular.U().transpose();
    Ok(Solution { matrix, rank: count_above(&values, least), iterations: 0 })
}

/// C of least energy, with every regulariser that has a weight.
fn regularised(
    source: &FitSide<'_>,
    target: &FitSide<'_>,
    settings: &FitSettings,
    task: &Task,
) -> Result<Solution> {
    let surfaces = surfaces(source, target, settings)?;
    let (a, b) = (source.descriptors, target.descriptors);
    let values = a.singular_values().map_err(|_| SINGULAR_VALUES)?;
    let rank = count_above(&values, least_counted(&values));
    let mut energy = Energy::new(a, b);
    if settings.laplacian > 0.0 {
        energy.commute_with_laplacian(settings.laplacian, source.basis, target.basis);
    }
    if settings.descriptors == 0.0 && settings.orientation == 0.0 {
        return Ok(Solution { matrix: solve::by_rows(&energy)?, rank, iterations: 0 });
    }
    let directions = Directions::principal(a, b)?;
    let (a, b) = (directions.source.as_ref(), directions.target.as_ref());
    if settings.descriptors > 0.0 {
        let (s, t) = (multiplications(a, source.basis), multiplications(b, target.basis));
        energy.commute_with_multiplications(settings.descriptors, s, t);
    }
    if let Some(Surfaces { source: on_source, target: on_target }) = surfaces {
        let (s, mut t) = (turns(a, source.basis, on_source), turns(b, target.basis, on_target));
        if settings.reversing {
            t.scale(-1.0);
        }
        energy.commute_with(settings.orientation, s, t);
    }
    let solved = solve::conjugate_gradients(&energy, task)?;
    Ok(Solution { matrix: solved.matrix, rank, iterations: solved.iterations })
}

/// The triangles of both sides, where the orientation matters.
struct Surfaces<'a> {
    source: &'a OrientedSurface,
    target: &'a OrientedSurface,
}

fn surfaces<'a>(
    source: &FitSide<'a>,
    target: &FitSide<'a>,
    settings: &FitSettings,
) -> Result<Option<Surfaces<'a>>> {
    if settings.orientation == 0.0 {
        return Ok(None);
    }
    let (Some(on_source), Some(on_target)) = (source.surface, target.surface) else {
        let expected = "0 where a side has no triangles";
        return Error::out_of_range("weight of orientation", expected, settings.orientation);
    };
    let (n_source, n_target) = (source.basis.n_vertices(), target.basis.n_vertices());
    Error::length("vertices of the source's surface", n_source, on_source.n_vertices())?;
    Error::length("vertices of the target's surface", n_target, on_target.n_vertices())?;
    on_source.check_winding(on_target)?;
    Ok(Some(Surfaces { source: on_source, target: on_target }))
}

const SINGULAR_VALUES: Error = Error::LinearAlgebra("the singular values of the descriptors");

/// What a singular value must exceed to count.
fn least_counted(values: &[f64]) -> f64 {
    RANK_CUTOFF * values.iter().fold(0.0f64, |m, &s| m.max(s))
}

fn count_above(values: &[f64], least: f64) -> usize {
    values.iter().filter(|&&s| s > least).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::solve::CG_LIMIT;
    use crate::test_objects::{blob, shape};
    use faer::Side;
    use faer::linalg::solvers::Solve;
    use semfm_geom::Shape;

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
        let fit = fit(
            FitSide::new(basis, a.as_ref()),
            FitSide::new(basis, b.as_ref()),
            &FitSettings::default(),
            &Task::default(),
        )
        .unwrap();
        assert!(fit.report.minimum_norm && fit.report.rank == 2 && fit.report.residual < 1e-12);
        // Minimum norm: the rows of C lie in the span of A, so C (I − A A⁺) = 0.
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
            FitSettings { laplacian: 1e-3, ..Default::default() },
            FitSettings { laplacian: 1e-3, descriptors: 1e-2, ..Default::default() },
        ] {
            let side = FitSide::new(basis, a.as_ref());
            let fit = fit(side, side, &settings, &Task::default()).unwrap();
            let c = fit.map.matrix();
            let off: f64 = (0..12).map(|i| (c[(i, i)] - 1.0).abs()).fold(0.0, f64::max);
            assert!(off < 0.05, "diagonal is off by {off} with {settings:?}");
            assert!(!fit.report.minimum_norm);
            assert!(fit.report.iterations < CG_LIMIT);
        }
    }

    /// Operator d of a shape for descriptors given as coefficients (k × p).
    type Family = fn(&Shape, &Mat<f64>, usize) -> Mat<f64>;

    /// Descriptor d on the vertices (n × 1).
    fn function(shape: &Shape, coefficients: &Mat<f64>, d: usize) -> Mat<f64> {
        shape.basis().reconstruct_all(coefficients.as_ref().subcols(d, 1))
    }

    /// Σ_v m_v f_v φᵢ(v) φⱼ(v)
    fn multiplication(shape: &Shape, coefficients: &Mat<f64>, d: usize) -> Mat<f64> {
        let (f, basis) = (function(shape, coefficients, d), shape.basis());
        let (k, phi) = (coefficients.nrows(), &basis.functions);
        Mat::from_fn(k, k, |i, j| {
            let terms = (0..basis.n_vertices())
                .map(|v| basis.mass[v] * f[(v, 0)] * (phi[(v, i)] * phi[(v, j)]));
            terms.sum()
        })
    }

    /// ∫ f dφⱼ ∧ dφᵢ
    fn turn(shape: &Shape, coefficients: &Mat<f64>, d: usize) -> Mat<f64> {
        let (f, phi) = (function(shape, coefficients, d), &shape.basis().functions);
        let k = coefficients.nrows();
        Mat::from_fn(k, k, |i, j| {
            let terms = shape.mesh().faces().iter().map(|ids| {
                let [a, b, c] = ids.map(|v| v as usize);
                let mean = (f[(a, 0)] + f[(b, 0)] + f[(c, 0)]) / 3.0;
                let [[i_b, i_c], [j_b, j_c]] =
                    [i, j].map(|of| [phi[(b, of)] - phi[(a, of)], phi[(c, of)] - phi[(a, of)]]);
                mean * 0.5 * (j_b * i_c - j_c * i_b)
            });
            terms.sum()
        })
    }

    /// Normal equations for the entries of C, column by column (k² × k²).
    struct System(Mat<f64>);

    impl System {
        /// Adds weight · (C ↦ L C Rᵀ), which is R ⊗ L.
        fn add(&mut self, left: &Mat<f64>, right: &Mat<f64>, weight: f64) {
            let k = left.nrows();
            for at in 0..k * k {
                for to in 0..k * k {
                    let factor = right[(at / k, to / k)] * left[(at % k, to % k)];
                    self.0[(at, to)] += weight * factor;
                }
            }
        }

        /// Adds weight · Σ ‖C S_d − T_d C‖²
        fn commute(&mut self, s: &[Mat<f64>], t: &[Mat<f64>], weight: f64) {
            let k = self.0.nrows().isqrt();
            let identity = Mat::<f64>::identity(k, k);
            let size: f64 = s.iter().chain(t).map(Mat::squared_norm_l2).sum();
            let weight = weight / (size / (2 * k) as f64);
            for (s, t) in s.iter().zip(t) {
                self.add(&identity, &(s * s.transpose()), weight);
                self.add(&(t.transpose() * t), &identity, weight);
                self.add(t, s, -weight);
                self.add(&t.transpose().to_owned(), &s.transpose().to_owned(), -weight);
            }
        }
    }

    /// Entry by entry from the definitions, descriptor by descriptor, solved as one dense system.
    fn dense_reference(
        a: &Mat<f64>,
        b: &Mat<f64>,
        source: &Shape,
        target: &Shape,
        settings: &FitSettings,
    ) -> Mat<f64> {
        let (k, p) = (a.nrows(), a.ncols());
        let unit = a.squared_norm_l2() / k as f64;
        let mut system = System(Mat::zeros(k * k, k * k));
        system.add(&Mat::identity(k, k), &(a * a.transpose()), 1.0);
        let sign = if settings.reversing { -1.0 } else { 1.0 };
        let families: [(f64, Family, f64); 2] =
            [(settings.descriptors, multiplication, 1.0), (settings.orientation, turn, sign)];
        for (weight, of, sign) in families {
            let s: Vec<_> = (0..p).map(|d| of(source, a, d)).collect();
            let t: Vec<_> = (0..p).map(|d| of(target, b, d) * faer::Scale(sign)).collect();
            system.commute(&s, &t, weight * unit);
        }
        let System(mut system) = system;
        let gaps: Vec<f64> = (0..k * k)
            .map(|at| (target.basis().values[at % k] - source.basis().values[at / k]).powi(2))
            .collect();
        let largest = gaps.iter().fold(0.0, |m: f64, &gap| m.max(gap));
        for (at, gap) in gaps.iter().enumerate() {
            system[(at, at)] += settings.laplacian * unit * gap / largest + 1e-9;
        }
        let right = b * a.transpose();
        let right = Mat::from_fn(k * k, 1, |at, _| right[(at % k, at / k)]);
        let c = system.llt(Side::Lower).unwrap().solve(&right);
        Mat::from_fn(k, k, |i, j| c[(i + k * j, 0)])
    }

    #[test]
    fn the_map_is_that_of_the_dense_normal_equations() {
        let (source, target) = (shape(&blob(1.0), 9), shape(&blob(1.6), 9));
        let surfaces = [&source, &target].map(|s| OrientedSurface::new(s.mesh()).unwrap());
        for p in [2, 5, 30] {
            let a = Mat::from_fn(9, p, |i, j| ((3 * i + 7 * j * j) as f64).sin());
            let b = Mat::from_fn(9, p, |i, j| a[(i, j)] * 1.1 + 0.1 * ((i * j) as f64).cos());
            for (descriptors, orientation, reversing) in
                [(0.0, 0.0, false), (0.3, 0.0, false), (0.0, 0.2, false), (0.5, 0.2, true)]
            {
                let settings = FitSettings { laplacian: 0.01, descriptors, orientation, reversing };
                let on_source = FitSide {
                    surface: Some(&surfaces[0]),
                    ..FitSide::new(source.basis(), a.as_ref())
                };
                let on_target = FitSide {
                    surface: Some(&surfaces[1]),
                    ..FitSide::new(target.basis(), b.as_ref())
                };
                let found = fit(on_source, on_target, &settings, &Task::default()).unwrap();
                let expected = dense_reference(&a, &b, &source, &target, &settings);
                let apart = (found.map.matrix() - &expected).norm_l2() / expected.norm_l2();
                assert!(apart < 1e-8, "{p} descriptors, {settings:?}: {apart:.1e}");
                let direct = descriptors == 0.0 && orientation == 0.0;
                assert_eq!(found.report.iterations == 0, direct, "{settings:?}");
            }
        }
    }

    #[test]
    fn orientation_without_triangles_and_negative_weights_are_refused() {
        let shape = shape(&blob(1.0), 12);
        let basis = shape.basis();
        let a = two_bumps(basis);
        let side = FitSide::new(basis, a.as_ref());
        for settings in [
            FitSettings { orientation: 1.0, ..Default::default() },
            FitSettings { descriptors: -1.0, ..Default::default() },
            FitSettings { laplacian: f64::NAN, ..Default::default() },
        ] {
            let error = fit(side, side, &settings, &Task::default()).unwrap_err();
            assert!(matches!(error, Error::OutOfRange { .. }), "{error}");
        }
        // A surface of other vertices is not that of the basis.
        let ball = semfm_geom::zoo::icosphere(1);
        let surface = OrientedSurface::new(&ball).unwrap();
        let side = FitSide { surface: Some(&surface), ..side };
        let settings = FitSettings { orientation: 1.0, ..Default::default() };
        let error = fit(side, side, &settings, &Task::default()).unwrap_err();
        assert!(matches!(error, Error::Length { .. }), "{error}");
    }
}
