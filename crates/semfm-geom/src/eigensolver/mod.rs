//! The first eigenpairs of a Laplacian.
//!
//! Constants first (`nullspace`), then block Lanczos (`lanczos`) on the shift-inverted operator
//! (`shift_invert`), then proof that nothing is wrong or missing (`check`). Small meshes are
//! solved densely (`dense`).

mod check;
mod dense;
mod lanczos;
mod nullspace;
mod orthogonalise;
mod row_panels;
mod shift_invert;

use faer::Mat;
use serde::Serialize;

use self::check::{last_gap, missed_below};
use self::lanczos::{Plan, Ritz};
use self::shift_invert::ShiftInvert;
use crate::{Eigenbasis, Error, Laplacian, Result, Task};

pub(crate) use self::orthogonalise::orthonormality_error;

/// Up to this many vertices per pair asked the dense solver is used.
const DENSE_VERTICES_PER_PAIR: usize = 4;

/// Up to this many vertices the dense solver takes no longer than a factorisation is worth.
const DENSE_VERTICES: usize = 200;

/// Columns of a Lanczos block. 12 and 16 use the memory's bandwidth better but need 15 and 30 % more
/// solves, which outweighs it at every size tried (10k and 50k vertices, k = 60 and 200).
const BLOCK: usize = 8;

/// Krylov dimension per wanted pair at which to restart, beside eight blocks. A search that never
/// restarts ends at 2.7 to 3.5; from 1.8 up the time is the same, the memory is not.
const KRYLOV_PER_WANTED: usize = 2;

/// Share of the tolerance granted to the Lanczos iteration; the rest is for rounding.
const ITERATION_SHARE: f64 = 0.5;

/// Searches for missed eigenpairs after which the solver gives up.
const MOST_SEARCHES: usize = 50;

/// Largest deviation from ΦᵀMΦ = I accepted: eight digits below what any user of a basis needs,
/// four above what the solver reaches.
const ORTHONORMALITY_TOLERANCE: f64 = 1e-10;

/// How the eigenbasis is computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EigenSettings {
    /// Largest relative residual accepted, from [`EigenSettings::LEAST_TOLERANCE`] to 1.
    pub tolerance: f64,
    /// Seed of the starting block.
    pub seed: u64,
}

impl EigenSettings {
    /// What double precision reaches on even triangles; the solver would search for less without end.
    pub const LEAST_TOLERANCE: f64 = 1e-13;
}

impl Default for EigenSettings {
    fn default() -> Self {
        Self { tolerance: 1e-8, seed: 0 }
    }
}

/// The first `k` eigenpairs of `stiffness φ = λ mass φ`, ascending.
///
/// Three things are verified before a basis is returned. Each residual ‖Lφ − λMφ‖_{M⁻¹} is at most
/// `tolerance` · max(λ, 1/area), so each value is one of the spectrum; ΦᵀMΦ = I, so no pair is
/// there twice; and a count of the negative pivots of L − τM (Sylvester's law of inertia), with τ
/// just below the last cluster of values, finds as many eigenvalues as were computed below τ, so
/// none was missed. Among values that agree to six digits at the very end of the list, which
/// members of their eigenspace come first is arbitrary.
///
/// Signs are fixed by the entry of largest magnitude, the first of them where several tie: it is
/// positive. On a mesh of several components the constant comes first, then functions constant on
/// each component, largest components first. The same settings give the same bytes at every thread
/// count: the work runs on the calling thread.
///
/// ```
/// use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
/// use semfm_geom::{Mesh, Task, laplacian::cotan_laplacian, math::DVec3};
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
/// let tetrahedron = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
/// let laplacian = cotan_laplacian(&tetrahedron)?;
/// let basis = eigenbasis(&laplacian, 4, &EigenSettings::default(), &Task::default())?;
/// assert!(basis.values[0] == 0.0 && basis.values[1] > 1.0);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
///
/// # Errors
/// [`Error::TooManyEigenpairs`] for k above the vertex count, [`Error::OutOfRange`] for k = 0 and for a tolerance out of
/// its range, [`Error::NotConverged`] where a verification fails, [`Error::NotPositiveDefinite`] where the
/// stiffness has an eigenvalue below −1/area, [`Error::Cancelled`].
pub fn eigenbasis(
    laplacian: &Laplacian,
    k: usize,
    settings: &EigenSettings,
    task: &Task,
) -> Result<Eigenbasis> {
    crate::keep_faer_sequential();
    let n_vertices = laplacian.n_vertices();
    if k == 0 {
        let (expected, found) = ("1 or more".to_owned(), "0".to_owned());
        return Err(Error::OutOfRange { what: "number of eigenpairs", expected, found });
    }
    let least = EigenSettings::LEAST_TOLERANCE;
    if !(least..=1.0).contains(&settings.tolerance) {
        let (expected, found) = (format!("{least:e} to 1"), settings.tolerance.to_string());
        return Err(Error::OutOfRange { what: "tolerance of the eigenpairs", expected, found });
    }
    if k > n_vertices {
        return Err(Error::TooManyEigenpairs { asked: k, n_vertices });
    }
    task.step("eigenbasis", 0, k)?;
    let root_mass: Vec<f64> = laplacian.mass.iter().map(|m| m.sqrt()).collect();
    let mut kernel = nullspace::kernel(laplacian, k);
    scale_rows(&mut kernel, |i| root_mass[i]);
    let (values, mut vectors) = if kernel.ncols() == k {
        (vec![0.0; k], kernel)
    } else if n_vertices <= DENSE_VERTICES.max(DENSE_VERTICES_PER_PAIR * k) {
        dense::first_pairs(laplacian, kernel.as_ref(), k)?
    } else {
        iterate(laplacian, kernel, k, settings, task)?
    };
    let orthonormality = orthonormality_error(vectors.as_ref());
    if orthonormality.is_nan() || orthonormality > ORTHONORMALITY_TOLERANCE {
        return Err(Error::LinearAlgebra("the eigensolver: its vectors are not orthonormal"));
    }
    scale_rows(&mut vectors, |i| 1.0 / root_mass[i]);
    fix_signs(&mut vectors);
    finish(laplacian, values, vectors, settings)
}

/// Shift-invert Lanczos, repeated on the complement of what was found until nothing is missing.
///
/// `kernel` (n × c) and the vectors returned (n × k) are M^{1/2} φ.
fn iterate(
    laplacian: &Laplacian,
    kernel: Mat<f64>,
    k: usize,
    settings: &EigenSettings,
    task: &Task,
) -> Result<(Vec<f64>, Mat<f64>)> {
    let scale = 1.0 / laplacian.mass.iter().sum::<f64>();
    let mut analysis = None;
    let mut values = vec![0.0; kernel.ncols()];
    let mut vectors = kernel;
    let mut wanted = k - values.len();
    for search in 0..MOST_SEARCHES {
        let operator = ShiftInvert::new(laplacian, analysis.as_ref())?;
        task.check()?;
        let plan = plan(laplacian.n_vertices(), vectors.ncols(), wanted, settings, search);
        let Ritz { mus, vectors: found } =
            lanczos::largest_pairs(&operator, vectors.as_ref(), &plan, task)?;
        values.extend(mus.iter().map(|&mu| operator.eigenvalue(mu).max(0.0)));
        // The count needs as much memory as the factor, which is made again in the rare case that one is missing.
        let analysis = analysis.insert(operator.factor.analysis().clone());
        drop(operator);
        (values, vectors) = merge(values, vectors, found, k);
        let missed = match last_gap(&values, scale) {
            None => 0,
            Some(gap) => missed_below(gap, laplacian, analysis.symbolic())?,
        };
        if missed == 0 {
            return Ok((values, vectors));
        }
        wanted = missed;
    }
    Err(Error::LinearAlgebra("the eigensolver: eigenpairs are missing"))
}

/// Dimensions and blocks for a search of `wanted` pairs beside `n_deflated` known ones.
fn plan(
    n: usize,
    n_deflated: usize,
    wanted: usize,
    settings: &EigenSettings,
    search: usize,
) -> Plan {
    let enough = KRYLOV_PER_WANTED * wanted + 8 * BLOCK;
    let max_dimension = enough.min(n - n_deflated) / BLOCK * BLOCK;
    Plan {
        wanted,
        block: BLOCK,
        max_dimension,
        tolerance: ITERATION_SHARE * settings.tolerance,
        seed: settings.seed.wrapping_add(search as u64),
    }
}

/// The k pairs of smallest value among the known and the found ones, ascending.
///
/// `values` names the known pairs first, then the found ones.
fn merge(values: Vec<f64>, known: Mat<f64>, found: Mat<f64>, k: usize) -> (Vec<f64>, Mat<f64>) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b])); // stable
    order.truncate(k);
    let mut vectors = Mat::zeros(known.nrows(), k);
    for (mut to, &from) in vectors.col_iter_mut().zip(&order) {
        match from.checked_sub(known.ncols()) {
            None => to.copy_from(known.col(from)),
            Some(new) => to.copy_from(found.col(new)),
        }
    }
    (order.into_iter().map(|i| values[i]).collect(), vectors)
}

fn scale_rows(matrix: &mut Mat<f64>, factor: impl Fn(usize) -> f64) {
    for j in 0..matrix.ncols() {
        for (i, value) in matrix.col_as_slice_mut(j).iter_mut().enumerate() {
            *value *= factor(i);
        }
    }
}

/// Makes the entry of largest magnitude in each column positive.
fn fix_signs(functions: &mut Mat<f64>) {
    for j in 0..functions.ncols() {
        let column = functions.col_as_slice_mut(j);
        let largest =
            column.iter().fold(0.0f64, |best, &v| if v.abs() > best.abs() { v } else { best });
        if largest < 0.0 {
            column.iter_mut().for_each(|v| *v = -*v);
        }
    }
}

/// Measures the residuals and refuses what is beyond the tolerance.
fn finish(
    laplacian: &Laplacian,
    values: Vec<f64>,
    functions: Mat<f64>,
    settings: &EigenSettings,
) -> Result<Eigenbasis> {
    let scale = 1.0 / laplacian.mass.iter().sum::<f64>();
    let mut relative = Vec::with_capacity(values.len());
    for (residual, lambda) in
        check::residuals(laplacian, &values, functions.as_ref()).iter().zip(&values)
    {
        let size = lambda.max(scale);
        relative.push(residual.norm / size);
        // Slivers can make L so large that no vector satisfies the equation to the tolerance in
        // double precision; such a pair passes when rounding explains its residual.
        let accepted = residual.norm <= settings.tolerance * size + residual.rounding;
        if !accepted {
            return Err(Error::NotConverged {
                residual: residual.norm / size,
                tolerance: settings.tolerance,
                restarts: 0,
            });
        }
    }
    Ok(Eigenbasis { values, functions, mass: laplacian.mass.clone(), residuals: relative })
}

#[cfg(test)]
mod tests;
