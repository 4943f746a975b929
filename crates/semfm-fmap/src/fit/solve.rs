//! The map of least energy: row by row where rows separate, by conjugate gradients where they do not.

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Mat, MatRef, Side};
use semfm_geom::Task;

use super::energy::Energy;
use super::joint::nearly_diagonal;
use crate::{Error, Result};

/// Relative residual at which the conjugate gradients stop, and their limit.
const CG_TOLERANCE: f64 = 1e-10;
pub(super) const CG_LIMIT: usize = 2000;
/// Added to the blocks of the preconditioner, relative to their mean diagonal: they are positive
/// definite, but some only by what is added to the normal equations.
const BLOCK_SHIFT: f64 = 1e-11;

const FAILED: Error = Error::LinearAlgebra("the preconditioner of the fit");

/// Row i of C solves (A Aᵀ + diag(maskᵢ) + δ I) cᵢ = (B Aᵀ)ᵢ, without operators.
pub(super) fn by_rows(energy: &Energy) -> Result<Mat<f64>> {
    let (k_target, k_source) = (energy.right.nrows(), energy.right.ncols());
    let mut matrix = Mat::zeros(k_target, k_source);
    for i in 0..k_target {
        let mut system = energy.on_source.clone();
        (0..k_source).for_each(|j| system[(j, j)] += energy.mask[(i, j)]);
        let factor =
            system.llt(Side::Lower).map_err(|_| Error::LinearAlgebra("the regularised fit"))?;
        let row = factor.solve(energy.right.row(i).transpose());
        matrix.row_mut(i).copy_from(row.transpose());
    }
    Ok(matrix)
}

/// Where the conjugate gradients stopped.
pub(super) struct Solved {
    /// C (k_target × k_source).
    pub matrix: Mat<f64>,
    /// Iterations until then.
    pub iterations: usize,
}

/// Minimises the whole energy.
pub(super) fn conjugate_gradients(energy: &Energy, task: &Task) -> Result<Solved> {
    let preconditioner = RowBlocks::new(energy)?;
    let mut c = preconditioner.apply(energy.right.as_ref());
    let mut residual = &energy.right - energy.apply(&c);
    let goal = CG_TOLERANCE * energy.right.norm_l2();
    let mut direction = preconditioner.apply(residual.as_ref());
    let mut size = inner(&residual, &direction);
    for iteration in 0..CG_LIMIT {
        if residual.norm_l2() <= goal {
            return Ok(Solved { matrix: c, iterations: iteration });
        }
        if !size.is_finite() {
            return Err(Error::LinearAlgebra("the regularised fit"));
        }
        task.step("fit", iteration, CG_LIMIT)?;
        let image = energy.apply(&direction);
        let step = size / inner(&direction, &image);
        c += &direction * faer::Scale(step);
        residual -= &image * faer::Scale(step);
        let conditioned = preconditioner.apply(residual.as_ref());
        let next = inner(&residual, &conditioned);
        direction = conditioned + &direction * faer::Scale(next / size);
        size = next;
    }
    Ok(Solved { matrix: c, iterations: CG_LIMIT })
}

/// Σ xᵢⱼ yᵢⱼ
fn inner(x: &Mat<f64>, y: &Mat<f64>) -> f64 {
    (0..x.ncols()).map(|j| x.col(j).transpose() * y.col(j)).sum()
}

/// The inverse of the energy's blocks that belong to single rows of Vᵀ C, where V nearly
/// diagonalises the target's operators: what couples the rows is then small. On wave kernel
/// signatures (k = 50) of two people this takes 27 iterations where the energy's diagonal takes 300.
struct RowBlocks {
    /// V (k_target × k_target).
    rotation: Mat<f64>,
    /// Inverse of each block (k_source × k_source).
    inverses: Vec<Mat<f64>>,
}

impl RowBlocks {
    fn new(energy: &Energy) -> Result<Self> {
        let rotation = nearly_diagonal(&energy.multipliers)?;
        let blocks = energy.row_blocks(rotation.as_ref()).into_iter().map(|mut block| {
            let k = block.nrows();
            let mean = (0..k).map(|j| block[(j, j)]).sum::<f64>() / k as f64;
            (0..k).for_each(|j| block[(j, j)] += BLOCK_SHIFT * mean);
            Ok(block.llt(Side::Lower).map_err(|_| FAILED)?.inverse())
        });
        Ok(Self { inverses: blocks.collect::<Result<_>>()?, rotation })
    }

    fn apply(&self, residual: MatRef<'_, f64>) -> Mat<f64> {
        // Rows as columns: they are contiguous.
        let mut rows = residual.transpose() * &self.rotation; // (k_source × k_target)
        for (i, inverse) in self.inverses.iter().enumerate() {
            let row = inverse * rows.col(i);
            rows.col_mut(i).copy_from(row);
        }
        &self.rotation * rows.transpose()
    }
}
