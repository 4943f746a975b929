//! Colours and numbers that are written at the vertices of a mesh.

use crate::{Error, Mesh, Result};

/// What is written at the vertices of a mesh besides their positions.
#[derive(Clone, Copy, Debug, Default)]
pub struct VertexAttributes<'a> {
    /// RGBA in sRGB for each vertex (n).
    pub colors: Option<&'a [[u8; 4]]>,
    /// Named numbers for each vertex (n each), as `weight`: properties of a PLY, attributes `_WEIGHT`
    /// of a GLB, both in 32 bits. Names are ASCII letters, digits and underscores.
    pub scalars: &'a [(&'a str, &'a [f64])],
}

impl VertexAttributes<'_> {
    /// Refuses lengths other than the mesh's vertex count, and names that no format can hold.
    pub(super) fn check(&self, mesh: &Mesh) -> Result<()> {
        let n_vertices = mesh.n_vertices();
        if let Some(colors) = self.colors {
            Error::check_length("vertex colours", n_vertices, colors.len())?;
        }
        for (name, values) in self.scalars {
            Error::check_length("vertex numbers", n_vertices, values.len())?;
            let taken = matches!(*name, "x" | "y" | "z" | "red" | "green" | "blue" | "alpha");
            let plain = name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
            if name.is_empty() || taken || !plain {
                let expected = "letters, digits and underscores";
                return Err(refused("name of vertex numbers", expected, name));
            }
        }
        Ok(())
    }
}

/// An error about what is to be written.
pub(super) fn refused(what: &'static str, expected: &str, found: impl std::fmt::Display) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found: found.to_string() }
}
