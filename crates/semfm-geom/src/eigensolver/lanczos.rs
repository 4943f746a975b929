//! Block Lanczos with thick restarts: the largest eigenpairs of a symmetric operator.

use faer::{Mat, MatRef};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::dense::symmetric_eigen;
use super::orthogonalise::{Orthonormaliser, product, random_block};
use super::row_panels::RowPanels;
use super::shift_invert::ShiftInvert;
use crate::{Error, Result, Task};

/// Restarts after which the search is given up; a mesh's spectrum takes 0 to 4.
const MOST_RESTARTS: usize = 60;

/// What to look for, and in how many dimensions.
pub(super) struct Plan {
    /// Pairs wanted.
    pub wanted: usize,
    /// Columns b of a block.
    pub block: usize,
    /// Krylov dimension at which to restart.
    pub max_dimension: usize,
    /// Largest ‖A⁻¹y − μy‖ / μ accepted.
    pub tolerance: f64,
    /// Seed of the starting block.
    pub seed: u64,
}

/// Eigenpairs of A⁻¹, the largest first.
pub(super) struct Ritz {
    /// μ, descending.
    pub mus: Vec<f64>,
    /// Orthonormal vectors y (n × wanted), orthogonal to the deflated ones.
    pub vectors: Mat<f64>,
}

/// The largest `plan.wanted` eigenpairs of `operator` on the complement of the orthonormal columns
/// `deflated` (n × d), which must span an invariant subspace.
///
/// Block Lanczos (Golub & Underwood 1977) restarted thickly (Wu & Simon 2000). Each block is
/// orthogonalised twice: against the two blocks it couples with, which removes what is large, and
/// against the whole basis, which removes what rounding brought back. The order (local pass, QR,
/// full pass, QR) keeps both orthonormality errors at rounding level and needs half the work of two
/// full passes.
pub(super) fn largest_pairs(
    operator: &ShiftInvert,
    deflated: MatRef<'_, f64>,
    plan: &Plan,
    task: &Task,
) -> Result<Ritz> {
    let mut krylov = Krylov::start(operator, deflated, plan);
    let mut schedule = Schedule::new(plan);
    let mut restarts = 0;
    loop {
        let full = krylov.expanded + 2 * plan.block > plan.max_dimension;
        if !full && krylov.expanded < schedule.next_check {
            krylov.expand();
            task.step("eigenbasis", krylov.expanded.min(plan.wanted), plan.wanted)?;
            continue;
        }
        let projection = krylov.project()?;
        let worst = projection.worst_error(plan.wanted);
        if worst <= plan.tolerance {
            return Ok(krylov.ritz(projection, plan.wanted));
        }
        if full {
            if restarts == MOST_RESTARTS {
                let tolerance = plan.tolerance;
                return Err(Error::NotConverged { residual: worst, tolerance, restarts });
            }
            restarts += 1;
            krylov.restart(&projection, plan);
        }
        schedule.plan_next(krylov.expanded, worst, plan);
    }
}

/// When to pay for the next Rayleigh–Ritz step.
///
/// Errors fall geometrically once the space is rich enough, so two checks predict the third.
struct Schedule {
    next_check: usize,
    last: Option<(usize, f64)>,
}

impl Schedule {
    /// Digits gained per block before anything was measured; too low only costs an extra check.
    const DIGITS_PER_BLOCK: f64 = 1.0;

    fn new(plan: &Plan) -> Self {
        Self { next_check: plan.wanted * 5 / 2 + 6 * plan.block, last: None }
    }

    fn plan_next(&mut self, dimension: usize, worst: f64, plan: &Plan) {
        let missing = (worst / plan.tolerance).log10();
        let rate = match self.last {
            Some((before, error)) if dimension > before && error > worst => {
                (error / worst).log10() * plan.block as f64 / (dimension - before) as f64
            }
            _ => Self::DIGITS_PER_BLOCK,
        };
        let blocks = (missing / rate.max(0.25)).ceil().clamp(1.0, 6.0) as usize;
        self.last = Some((dimension, worst));
        self.next_check = dimension + blocks * plan.block;
    }
}

/// An orthonormal basis V of a block Krylov space and the operator's projection onto it:
/// A⁻¹ V = V T + Q R Eᵀ, with T symmetric, Q the block to be expanded next and E the last b columns
/// of the identity.
struct Krylov<'a> {
    operator: &'a ShiftInvert,
    /// [deflated | V | Q | free] (n × (d + max_dimension)).
    basis: RowPanels,
    n_deflated: usize,
    /// Columns of V.
    expanded: usize,
    /// The first columns of V that are Ritz vectors of the last restart.
    kept: usize,
    /// T, in the upper left corner (expanded × expanded).
    projected: Mat<f64>,
    /// R (b × b).
    coupling: Mat<f64>,
    block: Mat<f64>,
    work: Orthonormaliser,
}

impl<'a> Krylov<'a> {
    fn start(operator: &'a ShiftInvert, deflated: MatRef<'_, f64>, plan: &Plan) -> Self {
        let (n, d, b) = (deflated.nrows(), deflated.ncols(), plan.block);
        let mut random = ChaCha8Rng::seed_from_u64(plan.seed);
        let mut block = random_block(n, b, &mut random);
        // One application to the noise before it becomes a basis block: its rough part would
        // occupy b columns and contribute nothing.
        operator.apply(&mut block);
        let mut krylov = Self {
            operator,
            basis: RowPanels::new(n, d + plan.max_dimension),
            n_deflated: d,
            expanded: 0,
            kept: 0,
            projected: Mat::zeros(plan.max_dimension, plan.max_dimension),
            coupling: Mat::zeros(b, b),
            block,
            work: Orthonormaliser::new(n, b, 0.0, random),
        };
        krylov.basis.store(0, deflated);
        krylov.complete_block(2);
        // ‖A⁻¹‖ ≤ 1/s: what the operator leaves below this is rounding.
        krylov.work.negligible = 1e-15 / operator.shift;
        krylov
    }

    /// Applies the operator to Q and appends Q to V.
    fn expand(&mut self) {
        let (d, m, b) = (self.n_deflated, self.expanded, self.block.ncols());
        self.basis.load(d + m, self.block.as_mut());
        self.operator.apply(&mut self.block);
        // A block couples with itself and the one before; the first after a restart, with all kept.
        let from = if m == self.kept { 0 } else { m - b };
        let components = self.basis.project_out(d + from..d + m + b, &mut self.block);
        for j in 0..b {
            for i in 0..components.nrows() {
                self.projected[(from + i, m + j)] = components[(i, j)];
                self.projected[(m + j, from + i)] = components[(i, j)];
            }
        }
        self.expanded = m + b;
        self.coupling = self.complete_block(1);
    }

    /// Makes `block` orthonormal and orthogonal to deflated and V, and stores it as the new Q.
    /// Returns R, for which the block as it came is Q R + (something in V).
    fn complete_block(&mut self, passes: usize) -> Mat<f64> {
        let occupied = self.n_deflated + self.expanded;
        let clear = |block: &mut Mat<f64>| {
            self.basis.project_out(0..occupied, block);
        };
        let mut r = self.work.orthonormalise(&mut self.block, &clear);
        for _ in 0..passes {
            clear(&mut self.block);
            let again = self.work.orthonormalise(&mut self.block, &clear);
            let mut both = Mat::zeros(r.nrows(), r.ncols());
            product(both.as_mut(), again.as_ref(), r.as_ref());
            r = both;
        }
        self.basis.store(occupied, self.block.as_ref());
        r
    }

    /// Rayleigh–Ritz: the eigenpairs of T, and how far each is from one of A⁻¹.
    fn project(&self) -> Result<Projection> {
        let (m, b) = (self.expanded, self.block.ncols());
        let (ascending, vectors) = symmetric_eigen(self.projected.as_ref().submatrix(0, 0, m, m))?;
        let mus: Vec<f64> = ascending.into_iter().rev().collect();
        let vectors = vectors.reverse_cols().to_owned();
        let mut residuals = Mat::zeros(b, m);
        product(residuals.as_mut(), self.coupling.as_ref(), vectors.as_ref().subrows(m - b, b));
        Ok(Projection { mus, vectors, residuals })
    }

    /// Replaces V by its best Ritz vectors; Q stays the block to be expanded next.
    fn restart(&mut self, projection: &Projection, plan: &Plan) {
        let (d, m, b) = (self.n_deflated, self.expanded, self.block.ncols());
        // Space for at least two blocks must remain; half of the unwanted vectors is a middle
        // between forgetting what was learnt and having to orthogonalise against it.
        let keep = (plan.wanted + (m - plan.wanted.min(m)) / 2).min(m - 2 * b);
        let combination = projection.vectors.as_ref().subcols(0, keep);
        self.basis.load(d + m, self.block.as_mut());
        self.basis.rotate(d..d + m, combination);
        self.basis.store(d + keep, self.block.as_ref());
        self.projected.fill(0.0);
        for (i, &mu) in projection.mus[..keep].iter().enumerate() {
            self.projected[(i, i)] = mu;
        }
        (self.expanded, self.kept) = (keep, keep);
    }

    /// The converged vectors, each after one more application of the operator, which costs no
    /// solve: A⁻¹ y / μ = y + Q (R Eᵀ s) / μ for y = V s (the purification of Nour-Omid, Parlett,
    /// Ericsson & Jensen 1987). It damps the rough part of the error, so that the residual of
    /// L φ = λ M φ is no larger than that of A⁻¹ y = μ y; orthonormality suffers only in the square
    /// of the error.
    fn ritz(self, projection: Projection, wanted: usize) -> Ritz {
        let (d, m, b) = (self.n_deflated, self.expanded, self.block.ncols());
        let combination = Mat::from_fn(m + b, wanted, |i, j| {
            if i < m {
                projection.vectors[(i, j)]
            } else {
                projection.residuals[(i - m, j)] / projection.mus[j]
            }
        });
        let vectors = self.basis.into_combinations(d..d + m + b, combination.as_ref());
        let mut mus = projection.mus;
        mus.truncate(wanted);
        Ritz { mus, vectors }
    }
}

/// Eigenpairs of T.
struct Projection {
    /// μ (m), descending.
    mus: Vec<f64>,
    /// Coefficients s on V (m × m), one column each.
    vectors: Mat<f64>,
    /// R Eᵀ s (b × m): the residual of each Ritz pair, in terms of Q.
    residuals: Mat<f64>,
}

impl Projection {
    /// Largest ‖A⁻¹y − μy‖ / μ among the first `wanted` pairs.
    fn worst_error(&self, wanted: usize) -> f64 {
        if self.mus.len() < wanted {
            return f64::INFINITY;
        }
        (0..wanted).map(|j| self.residuals.col(j).norm_l2() / self.mus[j].abs()).fold(0.0, f64::max)
    }
}
