//! The Laplace–Beltrami operator of a mesh, as a stiffness matrix and a lumped mass.

mod cotan;

use faer::sparse::SparseColMat;

pub use cotan::cotan_laplacian;

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
