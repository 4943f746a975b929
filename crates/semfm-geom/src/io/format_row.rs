//! What the file of a mesh format provides for the table of formats.

use std::io::Write;

use super::input::Input;
use super::{Appearance, PointCloud, VertexAttributes};
use crate::math::DVec3;
use crate::{Mesh, Result};

/// What there is to know of one format.
pub(super) struct FormatRow {
    /// In lower case, as in files and messages.
    pub name: &'static str,
    /// In lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// A few words for people who do not know the name.
    pub summary: &'static str,
    /// Whether the first bytes of a file show that it is of this format and of no other.
    pub recognise: fn(&[u8]) -> bool,
    /// Reads vertices, triangles and colours.
    pub read: fn(Input<'_>) -> Result<MeshParts>,
    /// Reads the vertices of a file that needs no faces; without it, they are those of the mesh.
    pub read_points: Option<fn(Input<'_>) -> Result<PointCloud>>,
    /// Writes it, if at all.
    pub writer: Option<FormatWriter>,
}

/// How one format is written, and what it can hold.
pub(super) struct FormatWriter {
    /// Writes the whole file; what is given was found to fit.
    pub write: fn(&mut dyn Write, &Mesh, &VertexAttributes<'_>) -> std::io::Result<()>,
    /// Whether it has colours of vertices.
    pub holds_colors: bool,
    /// Whether it has named numbers of vertices.
    pub holds_scalars: bool,
    /// Whether coordinates are rounded to 32 bits.
    pub is_single_precision: bool,
}

/// What a reader hands over, before the mesh is checked.
pub(super) struct MeshParts {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
    pub n_faces: usize,
    pub appearance: Appearance,
}
