//! A mesh made ready for maps: cleaned, simplified, with its eigenbasis.

use crate::eigensolver::{EigenSettings, eigenbasis};
use crate::laplacian::cotan_laplacian;
use crate::{Eigenbasis, Error, Mesh, Result, Task};

/// How a [`Shape`] is prepared.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeSettings {
    /// Eigenpairs k; clipped to what the mesh allows.
    pub k: usize,
    /// Simplify above this many vertices; 0 keeps them all.
    pub working_vertices: usize,
}

impl Default for ShapeSettings {
    fn default() -> Self {
        Self { k: 60, working_vertices: 10_000 }
    }
}

/// The cleaned, simplified mesh that maps are computed on, in the units of the original, and the
/// index maps both ways.
#[derive(Clone, Debug)]
pub struct WorkingMesh {
    /// The working mesh itself (n_working vertices).
    pub mesh: Mesh,
    /// For each vertex of the original (n), the nearest working vertex.
    pub of_original: Vec<u32>,
    /// For each working vertex, the original vertex nearest to it.
    pub to_original: Vec<u32>,
}

/// Mesh + working mesh + eigenbasis: built once, shared by reference.
///
/// The basis is that of the working mesh scaled to area 1, so eigenvalues and diffusion times are
/// relative; positions keep the units of the original.
#[derive(Clone, Debug)]
pub struct Shape {
    original: Mesh,
    working: WorkingMesh,
    basis: Eigenbasis,
}

impl Shape {
    /// Prepares a mesh.
    ///
    /// # Errors
    /// [`Error::NoArea`], whatever the eigensolver reports, [`Error::Cancelled`].
    pub fn new(original: Mesh, settings: &ShapeSettings, task: &Task) -> Result<Self> {
        let ids: Vec<u32> = (0..original.n_vertices() as u32).collect();
        let working =
            WorkingMesh { mesh: original.clone(), of_original: ids.clone(), to_original: ids };
        let side = working.mesh.area().sqrt();
        if side <= 0.0 {
            return Err(Error::NoArea { n_faces: original.n_faces() });
        }
        let scaled = working.mesh.vertices().iter().map(|&p| p / side).collect();
        let laplacian = cotan_laplacian(&Mesh::new(scaled, working.mesh.faces().to_vec())?)?;
        let k = settings.k.min(working.mesh.n_vertices());
        let basis = eigenbasis(&laplacian, k, &EigenSettings::default(), task)?;
        Ok(Self { original, working, basis })
    }

    /// The mesh as the caller gave it.
    pub fn original(&self) -> &Mesh {
        &self.original
    }

    /// The working mesh and its index maps.
    pub fn working(&self) -> &WorkingMesh {
        &self.working
    }

    /// The mesh that maps are computed on (n_working vertices, units of the original).
    pub fn mesh(&self) -> &Mesh {
        &self.working.mesh
    }

    /// Eigenbasis of the working mesh at area 1 (n_working × k).
    pub fn basis(&self) -> &Eigenbasis {
        &self.basis
    }

    /// √area of the working mesh, in the units of the original: the length that becomes 1.
    pub fn unit(&self) -> f64 {
        self.working.mesh.area().sqrt()
    }

    /// Values on the working vertices, carried onto the original's vertices.
    pub fn onto_original(&self, values: &[f64]) -> Vec<f64> {
        self.working.of_original.iter().map(|&i| values[i as usize]).collect()
    }

    /// Values on the original's vertices, carried onto the working vertices.
    pub fn onto_working(&self, values: &[f64]) -> Vec<f64> {
        self.working.to_original.iter().map(|&i| values[i as usize]).collect()
    }
}
