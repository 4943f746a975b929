//! What is verified about a basis before it is handed out.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};
use faer::{MatRef, Par, Side};

use super::shift_invert::shifted;
use crate::{Error, Laplacian, Result};

/// Eigenvalues closer than this, relative to their size, are not told apart by a count.
const CLUSTER_WIDTH: f64 = 1e-6;

/// A gap in the spectrum, and how many eigenvalues must lie below it if none was missed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SpectralGap {
    /// Largest value below the gap.
    pub below: f64,
    /// Smallest value above it.
    pub above: f64,
    /// Pairs found below it.
    pub expected: usize,
}

/// The last gap among `values` (ascending) that is wider than a cluster: the highest place at which
/// counting makes sense. `None` where all values are one cluster.
///
/// Above the gap remain at most the members of the cluster that ends the list; within a cluster
/// any choice of members is as good as any other.
pub(super) fn last_gap(values: &[f64], scale: f64) -> Option<SpectralGap> {
    (1..values.len()).rev().find_map(|j| {
        let (below, above) = (values[j - 1], values[j]);
        let wide = above - below > CLUSTER_WIDTH * above.max(scale);
        wide.then_some(SpectralGap { below, above, expected: j })
    })
}

/// How many eigenvalues below the gap were not found.
///
/// The count is taken in the middle of the gap, and elsewhere in it where the middle gives none or
/// one that contradicts the pairs at hand: without pivoting, a factorisation of an indefinite
/// matrix can break down by bad luck.
///
/// # Errors
/// [`Error::LinearAlgebra`] where no place in the gap gives a possible count.
pub(super) fn missed_below(
    gap: SpectralGap,
    laplacian: &Laplacian,
    symbolic: &SymbolicCholesky<usize>,
) -> Result<usize> {
    for share in [0.5, 0.3, 0.7] {
        let tau = gap.below + share * (gap.above - gap.below);
        if let Some(below) = count_below(laplacian, symbolic, tau)?
            && below >= gap.expected
        {
            return Ok(below - gap.expected);
        }
    }
    Err(Error::LinearAlgebra("the eigensolver's count of eigenvalues"))
}

/// Number of eigenvalues of L φ = λ M φ below `tau`.
///
/// Sylvester's law of inertia: L − τM = P R D Rᵀ Pᵀ has as many negative pivots D as there are
/// eigenvalues below τ. `symbolic` is the analysis of any shifted L, so the cost is one numeric
/// factorisation. `None` where a pivot vanishes, which happens only for τ at an eigenvalue of a
/// leading block.
fn count_below(
    laplacian: &Laplacian,
    symbolic: &SymbolicCholesky<usize>,
    tau: f64,
) -> Result<Option<usize>> {
    let matrix = shifted(laplacian, -tau)?;
    let mut values = vec![0.0; symbolic.len_val()];
    let scratch = symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default());
    let factorised = symbolic.factorize_numeric_ldlt(
        &mut values,
        matrix.as_ref(),
        Side::Lower,
        Default::default(),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    );
    if factorised.is_err() {
        return Ok(None);
    }
    let pivots: Vec<f64> = match symbolic.raw() {
        // The diagonal opens each column.
        SymbolicCholeskyRaw::Simplicial(columns) => {
            columns.col_ptr()[..columns.ncols()].iter().map(|&start| values[start]).collect()
        }
        // A supernode is a dense panel, columns first, whose top square holds its diagonal.
        SymbolicCholeskyRaw::Supernodal(nodes) => (0..nodes.n_supernodes())
            .flat_map(|s| {
                let width = nodes.supernode_end()[s] - nodes.supernode_begin()[s];
                let start = nodes.col_ptr_for_val()[s];
                let height = (nodes.col_ptr_for_val()[s + 1] - start) / width;
                (0..width).map(move |j| start + j * (height + 1))
            })
            .map(|position| values[position])
            .collect(),
    };
    let sound = pivots.iter().all(|pivot| pivot.is_finite() && *pivot != 0.0);
    Ok(sound.then(|| pivots.iter().filter(|&&pivot| pivot < 0.0).count()))
}

/// ‖L φ − λ M φ‖_{M⁻¹} of one pair, and the part of it that the rounding of its own evaluation
/// can explain.
pub(super) struct Residual {
    /// The norm.
    pub norm: f64,
    /// Bound on the rounding error in it: 4 ε ‖ |L| |φ| + λ M |φ| ‖_{M⁻¹}.
    pub rounding: f64,
}

/// The residual of each pair (k).
pub(super) fn residuals(
    laplacian: &Laplacian,
    values: &[f64],
    functions: MatRef<'_, f64>,
) -> Vec<Residual> {
    let pairs = values.iter().enumerate();
    pairs
        .map(|(j, &lambda)| match functions.col(j).try_as_col_major() {
            Some(column) => residual(laplacian, lambda, column.as_slice()),
            None => {
                residual(laplacian, lambda, &functions.col(j).iter().copied().collect::<Vec<_>>())
            }
        })
        .collect()
}

/// The residual of the pair (λ, φ), from r = L φ − λ M φ and its bound, vertex by vertex:
/// ‖r‖²_{M⁻¹} = Σᵢ rᵢ² / mᵢ.
fn residual(laplacian: &Laplacian, lambda: f64, phi: &[f64]) -> Residual {
    let stiffness = laplacian.stiffness.as_ref();
    let (mut squared, mut squared_bound) = (0.0, 0.0);
    for (i, m) in laplacian.mass.iter().enumerate() {
        let (mut sum, mut size) = (-lambda * m * phi[i], lambda * m * phi[i].abs());
        // L is symmetric, so its columns serve as rows.
        let entries = stiffness.row_idx_of_col_raw(i).iter().zip(stiffness.val_of_col(i));
        for (&row, weight) in entries {
            let term = weight * phi[row];
            sum += term;
            size += term.abs();
        }
        squared += sum * sum / m;
        squared_bound += size * size / m;
    }
    Residual { norm: squared.sqrt(), rounding: 4.0 * f64::EPSILON * squared_bound.sqrt() }
}
