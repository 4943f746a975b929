//! Does faer's `partial_self_adjoint_eigen` still return a duplicated eigenvector?
//!
//! With faer 0.24.4, 200 pairs asked of a 20 000-vertex torus come back as "200 converged", with two
//! columns equal and λ_200 too small. That is why this crate has an eigensolver of its own. Run
//! this on each new faer; exit code 1 says that the fault stands.

use std::error::Error;
use std::f64::consts::TAU;
use std::process::ExitCode;

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::matrix_free::LinOp;
use faer::matrix_free::eigen::{
    PartialEigenParams, partial_self_adjoint_eigen, partial_self_adjoint_eigen_scratch,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Col, Mat, MatMut, MatRef, Par};
use semfm_geom::SparseCholesky;
use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::laplacian::cotan_laplacian;
use semfm_geom::math::DVec3;
use semfm_geom::{Laplacian, Mesh, Task};

const SHIFT: f64 = 0.01;
const PAIRS: usize = 200;

/// M^{1/2} (L + sM)⁻¹ M^{1/2}.
#[derive(Debug)]
struct ShiftInvert {
    factor: SparseCholesky,
    root: Vec<f64>,
}

impl LinOp<f64> for ShiftInvert {
    fn apply_scratch(&self, _: usize, _: Par) -> StackReq {
        StackReq::EMPTY
    }
    fn nrows(&self) -> usize {
        self.root.len()
    }
    fn ncols(&self) -> usize {
        self.root.len()
    }
    fn apply(&self, mut out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _: Par, _: &mut MemStack) {
        let weight = |out: &mut MatMut<'_, f64>| {
            for (i, root) in self.root.iter().enumerate() {
                (0..out.ncols()).for_each(|j| out[(i, j)] *= root);
            }
        };
        out.copy_from(rhs);
        weight(&mut out);
        self.factor.solve_in_place(out.as_mut());
        weight(&mut out);
    }
    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, p: Par, s: &mut MemStack) {
        self.apply(out, rhs, p, s);
    }
}

#[allow(clippy::print_stdout)] // The verdict is what this program is for.
fn main() -> Result<ExitCode, Box<dyn Error>> {
    let laplacian = torus(245, 81)?;
    let n = laplacian.n_vertices();
    let shift = laplacian.mass.iter().enumerate().map(|(i, m)| Triplet::new(i, i, SHIFT * m));
    let stored = laplacian.stiffness.triplet_iter().map(|t| Triplet::new(t.row, t.col, *t.val));
    let shifted: Vec<_> = stored.chain(shift).collect();
    let operator = ShiftInvert {
        factor: SparseCholesky::new(
            SparseColMat::try_new_from_triplets(n, n, &shifted)
                .map_err(|_| "the matrix cannot be assembled")?
                .as_ref(),
        )?,
        root: laplacian.mass.iter().map(|m| m.sqrt()).collect(),
    };
    let params = PartialEigenParams { max_restarts: 100, ..Default::default() };
    let mut random = noise(77);
    let start = Col::from_fn(n, |_| random() - 0.5);
    let (mut vectors, mut mus) = (Mat::<f64>::zeros(n, PAIRS), vec![0.0; PAIRS]);
    let scratch = partial_self_adjoint_eigen_scratch(&operator, PAIRS, Par::Seq, params);
    let found = partial_self_adjoint_eigen(
        vectors.as_mut(),
        &mut mus,
        &operator,
        start.as_ref(),
        1e-8,
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        params,
    )
    .n_converged_eigen;
    let gram = vectors.transpose() * &vectors;
    let orthonormality = (&gram - Mat::<f64>::identity(PAIRS, PAIRS)).norm_max();
    let theirs = 1.0 / mus[PAIRS - 1] - SHIFT;
    let ours = eigenbasis(&laplacian, PAIRS, &EigenSettings::default(), &Task::default())?.values
        [PAIRS - 1];
    println!("converged pairs, by faer's own count: {found} of {PAIRS}");
    println!("largest entry of |QᵀQ − I|: {orthonormality:.1e}");
    println!("λ_{PAIRS}: faer {theirs:.4}, ours (counted by inertia) {ours:.4}");
    let sound = found == PAIRS && orthonormality < 1e-6 && (theirs / ours - 1.0).abs() < 1e-6;
    println!("the fault {}", if sound { "did not show" } else { "stands" });
    Ok(if sound { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Uniform numbers from 0 to 1 (xorshift, Marsaglia 2003).
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// An irregular torus of area 1.
fn torus(around: usize, along: usize) -> Result<Laplacian, semfm_geom::Error> {
    let mut random = noise(12345);
    let at = |i: usize, j: usize| ((i % around) * along + j % along) as u32;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..around {
        for j in 0..along {
            let a = TAU * (i as f64 + 0.5 * (random() - 0.5)) / around as f64;
            let b = TAU * (j as f64 + 0.5 * (random() - 0.5)) / along as f64;
            let tube = 0.35 * (1.0 + 0.2 * (3.0 * a).sin() + 0.1 * (5.0 * b + 2.0 * a).cos());
            let ring = 1.0 + tube * b.cos();
            vertices.push(DVec3::new(ring * a.cos(), 1.3 * ring * a.sin(), tube * b.sin()));
            let [p, q, s, t] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            faces.extend([[p, q, s], [p, s, t]]);
        }
    }
    let side = Mesh::new(vertices.clone(), faces.clone())?.area().sqrt();
    cotan_laplacian(&Mesh::new(vertices.into_iter().map(|p| p / side).collect(), faces)?)
}
