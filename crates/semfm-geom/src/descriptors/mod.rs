//! Descriptors of a vertex by the spectrum alone: the same before and after an isometry.

mod hks;
mod wks;

pub use hks::{HksSettings, hks};
pub use wks::{WksSettings, landmark_wks, wks};

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};

use crate::{Eigenbasis, Error, Result};

/// Eigenvalues up to this share of the largest, or of 1 / area where that is more, count as zero:
/// one for each connected piece, up to the solver's residual (1e-8).
const ZERO: f64 = 1e-7;

/// Smallest and largest eigenvalue that is not zero.
struct Spectrum {
    smallest: f64,
    largest: f64,
}

/// The range of the eigenvalues, or why there is none.
fn spectrum(basis: &Eigenbasis) -> Result<Spectrum> {
    let largest = basis.values.iter().copied().fold(0.0, f64::max);
    let zero = ZERO * largest.max(1.0 / basis.mass.iter().sum::<f64>());
    let smallest = basis.values.iter().copied().find(|&value| value > zero);
    smallest.map(|smallest| Spectrum { smallest, largest }).ok_or_else(|| Error::OutOfRange {
        what: "eigenbasis of a descriptor",
        expected: "an eigenvalue above zero".into(),
        found: format!("{} pairs, the largest with {largest}", basis.k()),
    })
}

/// Σₖ `weights`[k, p] φₖ(x)² / Σₖ `weights`[k, p] for every vertex x (n × p).
fn weighted_squares(basis: &Eigenbasis, mut weights: Mat<f64>) -> Mat<f64> {
    for j in 0..weights.ncols() {
        let column = weights.col_as_slice_mut(j);
        let total: f64 = column.iter().sum();
        column.iter_mut().for_each(|weight| *weight /= total);
    }
    let squares =
        Mat::from_fn(basis.n_vertices(), basis.k(), |i, j| basis.functions[(i, j)].powi(2));
    let mut descriptors = Mat::zeros(basis.n_vertices(), weights.ncols());
    matmul(descriptors.as_mut(), Accum::Replace, squares.as_ref(), weights.as_ref(), 1.0, Par::Seq);
    descriptors
}

/// `n` numbers from `first` to `last`, both included.
fn evenly(first: f64, last: f64, n: usize) -> impl Iterator<Item = f64> {
    let step = (last - first) / (n.max(2) - 1) as f64;
    (0..n).map(move |i| first + step * i as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eigensolver::{EigenSettings, eigenbasis};
    use crate::laplacian::{LaplacianKind, laplacian};
    use crate::{Mesh, Task, zoo};

    fn basis(mesh: &Mesh, k: usize) -> Eigenbasis {
        let laplacian = laplacian(mesh, LaplacianKind::Tufted).unwrap();
        eigenbasis(&laplacian, k, &EigenSettings::default(), &Task::default()).unwrap()
    }

    #[test]
    fn every_mesh_of_the_zoo_has_finite_descriptors() {
        for (name, mesh) in zoo::all() {
            let basis = basis(&mesh, 20.min(mesh.n_vertices()));
            let [wks, hks] =
                [wks(&basis, &WksSettings::default()), hks(&basis, &HksSettings::default())]
                    .map(|d| d.unwrap());
            assert_eq!((wks.nrows(), wks.ncols()), (mesh.n_vertices(), 100), "{name}");
            for column in wks.col_iter().chain(hks.col_iter()) {
                assert!(column.iter().all(|d| d.is_finite() && *d >= 0.0), "{name}");
            }
        }
    }

    #[test]
    fn the_landmark_kernel_is_the_signature_at_the_landmark_itself() {
        let torus = zoo::torus(20, 10);
        let basis = basis(&torus, 30);
        let settings = WksSettings { n_energies: 12 };
        let signature = wks(&basis, &settings).unwrap();
        let kernel = landmark_wks(&basis, &[7, 40], &settings).unwrap();
        assert_eq!((kernel.nrows(), kernel.ncols()), (torus.n_vertices(), 24));
        for e in 0..12 {
            assert!((kernel[(7, e)] - signature[(7, e)]).abs() < 1e-12);
            assert!((kernel[(40, 12 + e)] - signature[(40, e)]).abs() < 1e-12);
            assert!((kernel[(40, e)] - kernel[(7, 12 + e)]).abs() < 1e-12, "not symmetric");
        }
        assert!(landmark_wks(&basis, &[u32::MAX], &settings).is_err());
    }

    #[test]
    fn descriptors_know_no_sign_and_no_rigid_motion() {
        let torus = zoo::torus(20, 10);
        // Cut inside a gap of the spectrum, where the sum over an eigenspace is the mesh's own.
        let first = basis(&torus, 30);
        let k = (12..30).max_by(|&a, &b| gap(&first, a).total_cmp(&gap(&first, b))).unwrap();
        let turn = crate::math::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.4);
        let turned = torus.vertices().iter().map(|&p| turn * p).collect();
        let turned = Mesh::new(turned, torus.faces().to_vec()).unwrap();
        for descriptor in [
            |b: &Eigenbasis| wks(b, &WksSettings::default()).unwrap(),
            |b: &Eigenbasis| hks(b, &HksSettings::default()).unwrap(),
        ] {
            let difference = descriptor(&basis(&torus, k)) - descriptor(&basis(&turned, k));
            assert!(difference.norm_max() < 1e-6, "{:.1e}", difference.norm_max());
        }
    }

    fn gap(basis: &Eigenbasis, k: usize) -> f64 {
        basis.values[k] - basis.values[k - 1]
    }

    #[test]
    fn constants_alone_describe_nothing() {
        let basis = basis(&zoo::tetrahedron(), 1);
        assert!(matches!(wks(&basis, &WksSettings::default()), Err(Error::OutOfRange { .. })));
    }
}
