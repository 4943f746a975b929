//! The Laplace–Beltrami operator of a mesh, as a stiffness matrix and a lumped mass.
//!
//! [`laplacian`] builds the kind that is asked for, by default the intrinsic Delaunay Laplacian of the *tufted cover* (Sharp & Crane 2020), which holds on open, non-manifold and
//! sliver-ridden meshes alike. [`point_cloud_laplacian`] does the same without triangles, and
//! [`bridge`] joins what lies in several pieces.
//!
//! The steps of [`tufted_laplacian`]: glue two copies of every triangle and mollify
//! (`tufted_cover`) → flip to Delaunay (`intrinsic`) → cotangents → matrix (`assembly`).

mod assembly;
mod bridges;
mod cotan;
mod intrinsic;
mod labelled_tree;
mod local_delaunay;
mod planar_triangle;
mod point_cloud;
mod tufted;
mod tufted_cover;

use faer::sparse::SparseColMat;
use serde::Serialize;

pub(crate) use bridges::components;
pub use bridges::{BridgeSettings, BridgedLaplacian, bridge};
pub use cotan::cotan_laplacian;
pub(crate) use planar_triangle::{PlanarTriangle, laplacian_and_triangles};
pub use point_cloud::{CloudSettings, point_cloud_laplacian};
pub use tufted::{TuftedSettings, tufted_laplacian};

use crate::{Mesh, Result};

/// Stiffness and lumped mass of a surface: `L = M⁻¹ · stiffness` is the Laplace–Beltrami operator.
///
/// `stiffness` (n × n) is symmetric with both triangles stored, positive semidefinite (not
/// negative, as in part of the literature), its rows sum to zero. `mass` (n) is the diagonal of M,
/// positive, and adds up to the surface area.
#[derive(Clone, Debug)]
pub struct Laplacian {
    /// Positive semidefinite stiffness (n × n).
    pub stiffness: SparseColMat<usize, f64>,
    /// Lumped mass (n).
    pub mass: Vec<f64>,
}

impl Laplacian {
    /// Number of vertices n.
    pub fn n_vertices(&self) -> usize {
        self.mass.len()
    }
}

/// Which discretisation of the Laplace–Beltrami operator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LaplacianKind {
    /// Intrinsic Delaunay on the tufted cover, mollified ([`tufted_laplacian`]).
    #[default]
    Tufted,
    /// Cotangents of the triangles as they are ([`cotan_laplacian`]).
    Cotan,
}

/// The Laplacian of a mesh, of the asked kind, with that kind's default settings.
///
/// ```
/// use semfm_geom::{Mesh, laplacian::{LaplacianKind, laplacian}, math::DVec3};
/// let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
/// let square = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]])?;
/// let laplacian = laplacian(&square, LaplacianKind::default())?;
/// assert!((laplacian.mass.iter().sum::<f64>() - 1.0).abs() < 1e-4);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
///
/// # Errors
/// [`NoArea`](crate::Error::NoArea) where every triangle is degenerate.
pub fn laplacian(mesh: &Mesh, kind: LaplacianKind) -> Result<Laplacian> {
    match kind {
        LaplacianKind::Tufted => tufted_laplacian(mesh, &TuftedSettings::default()),
        LaplacianKind::Cotan => cotan_laplacian(mesh),
    }
}

/// Share of the mean that a vertex without area gets as its mass, so that M stays invertible.
const EMPTY_MASS: f64 = 1e-12;

/// Raises masses that are zero to [`EMPTY_MASS`] of the mean.
fn fill_empty_masses(mass: &mut [f64]) {
    let mean = mass.iter().sum::<f64>() / mass.len() as f64;
    mass.iter_mut().for_each(|m| *m = m.max(EMPTY_MASS * mean));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;
    use faer::Mat;

    /// What every Laplacian promises, checked entry by entry.
    fn check_promises(name: &str, laplacian: &Laplacian) {
        let n = laplacian.n_vertices();
        let (mut dense, mut scale) = (Mat::<f64>::zeros(n, n), 0.0f64);
        for t in laplacian.stiffness.triplet_iter() {
            dense[(t.row, t.col)] += t.val;
            scale = scale.max(t.val.abs());
        }
        for i in 0..n {
            let row_sum: f64 = (0..n).map(|j| dense[(i, j)]).sum();
            assert!(row_sum.abs() <= 1e-12 * scale, "{name}: row {i} sums to {row_sum:.1e}");
            (0..i).for_each(|j| assert_eq!(dense[(i, j)], dense[(j, i)], "{name}: ({i}, {j})"));
        }
        let eigen = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
        assert!(
            eigen[0] >= -1e-12 * scale * n as f64,
            "{name}: smallest eigenvalue {:.1e}",
            eigen[0]
        );
        assert!(laplacian.mass.iter().all(|&m| m > 0.0), "{name}: a mass is not positive");
    }

    #[test]
    fn both_kinds_keep_their_promises_over_the_zoo() {
        for (name, mesh) in zoo::all() {
            for kind in [LaplacianKind::Tufted, LaplacianKind::Cotan] {
                let laplacian = laplacian(&mesh, kind).unwrap();
                check_promises(name, &laplacian);
                let (total, area) = (laplacian.mass.iter().sum::<f64>(), mesh.area());
                // Mollification lengthens every edge by as little as it can: at most 1e-5 of the
                // mean edge, which the million-to-one slivers feel most.
                assert!(
                    (total / area - 1.0).abs() < 1e-3,
                    "{name} {kind:?}: mass {total}, area {area}"
                );
            }
        }
    }

    #[test]
    fn each_connected_piece_has_one_constant_and_no_more() {
        for (name, mesh) in zoo::all() {
            let laplacian = laplacian(&mesh, LaplacianKind::Tufted).unwrap();
            let n = laplacian.n_vertices();
            let root: Vec<f64> = laplacian.mass.iter().map(|m| m.sqrt()).collect();
            let pieces = bridges::components(n, &laplacian.stiffness).count;
            // Vertices without mass would hide the scale of the spectrum.
            let keep: Vec<usize> =
                (0..n).filter(|&i| laplacian.mass[i] > 1e-6 * mesh.area() / n as f64).collect();
            let isolated = n - keep.len();
            let mut dense = Mat::<f64>::zeros(keep.len(), keep.len());
            for (a, &i) in keep.iter().enumerate() {
                for (b, &j) in keep.iter().enumerate() {
                    let value = laplacian.stiffness.get(i, j).copied().unwrap_or(0.0);
                    dense[(a, b)] = value / (root[i] * root[j]);
                }
            }
            let eigen = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
            let zeros =
                eigen.iter().filter(|&&value| value < 1e-9 * eigen[eigen.len() - 1]).count();
            assert_eq!(zeros, pieces - isolated, "{name}: null space against pieces with area");
        }
    }
}
