//! A surface with a colour per vertex, and how it is drawn.

use semfm::geom::{Mesh, Pinhole, Task};
use semfm::views::{RenderSettings, SurfaceColor, View, render};

use super::WeightedMesh;
use crate::Result;
use crate::colors::weight_colors;
use crate::surface::Surface;

/// Samples along each side of a pixel.
const SUPERSAMPLING: u32 = 3;

/// A surface with a colour per vertex.
#[derive(Clone, Default)]
pub(super) struct Painted {
    pub surface: Surface,
    pub colors: Vec<[f32; 3]>,
}

impl Painted {
    /// An object in the colours of its weights.
    pub(super) fn object(object: WeightedMesh<'_>) -> Self {
        let vertices = object.mesh.vertices().to_vec();
        let surface = Surface { vertices, faces: object.mesh.faces().to_vec() };
        Self { surface, colors: weight_colors(object.weights) }
    }

    /// Adds a surface of one colour.
    pub(super) fn add(&mut self, surface: &Surface, color: [f32; 3]) {
        self.surface.add(surface);
        self.colors.resize(self.surface.vertices.len(), color);
    }

    pub(super) fn mesh(&self) -> Result<Mesh> {
        Ok(Mesh::new(self.surface.vertices.clone(), self.surface.faces.clone())?)
    }

    pub(super) fn rendered(&self, camera: Pinhole, edges: f64, task: &Task) -> Result<View> {
        let settings = RenderSettings { supersampling: SUPERSAMPLING, edges, ..Default::default() };
        let colors = SurfaceColor::Vertices(&self.colors);
        let mut views = render(&self.mesh()?, &colors, &[camera], &settings, task)?;
        Ok(views.remove(0))
    }
}
