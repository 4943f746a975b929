//! Which mesh a file belongs to.

use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::io::FormatError;
use crate::{Mesh, MeshHash};

/// Which mesh a file was made of: written into every file that is about a mesh, and compared with
/// the mesh at hand when the file is read.
///
/// In JSON `{"hash": "blake3:…", "n_triangles": …, "n_vertices": …}`.
///
/// ```
/// use semfm_geom::{Mesh, MeshIdentity, math::DVec3};
/// let triangle = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// let larger = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 1, 2]])?;
/// let mismatch = MeshIdentity::of(&triangle).check(&larger).unwrap_err();
/// assert_eq!(mismatch.field, "mesh.n_vertices");
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct MeshIdentity {
    /// Hash of positions and triangles.
    pub hash: MeshHash,
    /// Number of triangles.
    pub n_triangles: usize,
    /// Number of vertices.
    pub n_vertices: usize,
}

impl MeshIdentity {
    /// The identity of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        Self { hash: mesh.hash(), n_triangles: mesh.n_faces(), n_vertices: mesh.n_vertices() }
    }

    /// Refuses another mesh than this one.
    ///
    /// # Errors
    /// [`MeshMismatch`] with the first field that differs.
    pub fn check(&self, mesh: &Mesh) -> Result<(), MeshMismatch> {
        check_count("mesh.n_vertices", self.n_vertices, mesh.n_vertices(), "vertices")?;
        check_count("mesh.n_triangles", self.n_triangles, mesh.n_faces(), "triangles")?;
        check_hash(self.hash, mesh)
    }
}

impl fmt::Display for MeshIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} vertices, {} triangles)", self.hash, self.n_vertices, self.n_triangles)
    }
}

/// What a file written by hand or by another program says of its mesh: any of the fields of
/// [`MeshIdentity`], each of which must agree where it is given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartialMeshIdentity {
    /// Hash of positions and triangles, as text: a hash that cannot be parsed is a mismatch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// Number of triangles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_triangles: Option<usize>,
    /// Number of vertices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n_vertices: Option<usize>,
}

impl From<MeshIdentity> for PartialMeshIdentity {
    fn from(identity: MeshIdentity) -> Self {
        let MeshIdentity { hash, n_triangles, n_vertices } = identity;
        let hash = Some(hash.to_string());
        Self { hash, n_triangles: Some(n_triangles), n_vertices: Some(n_vertices) }
    }
}

impl PartialMeshIdentity {
    /// Refuses a mesh that contradicts one of the fields.
    ///
    /// # Errors
    /// [`MeshMismatch`] with the first field that differs or is no hash.
    pub fn check(&self, mesh: &Mesh) -> Result<(), MeshMismatch> {
        if let Some(n_vertices) = self.n_vertices {
            check_count("mesh.n_vertices", n_vertices, mesh.n_vertices(), "vertices")?;
        }
        if let Some(n_triangles) = self.n_triangles {
            check_count("mesh.n_triangles", n_triangles, mesh.n_faces(), "triangles")?;
        }
        let Some(text) = &self.hash else { return Ok(()) };
        let hash = MeshHash::parse(text).ok_or_else(|| MeshMismatch {
            field: "mesh.hash",
            expected: MeshHash::FORM.into(),
            found: text.clone(),
        })?;
        check_hash(hash, mesh)
    }
}

/// A file that belongs to another mesh than the one it is used with.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: expected {expected}, found {found}")]
pub struct MeshMismatch {
    /// The field that differs: `mesh.n_vertices`, `mesh.n_triangles` or `mesh.hash`.
    pub field: &'static str,
    /// What the mesh at hand has.
    pub expected: String,
    /// What the file says.
    pub found: String,
}

impl MeshMismatch {
    /// The same as an error about the file that names the mesh.
    pub fn in_file(self, path: &Path) -> FormatError {
        FormatError::new(path, self.field, self.expected, self.found)
    }
}

fn check_count(
    field: &'static str,
    named: usize,
    has: usize,
    what: &str,
) -> Result<(), MeshMismatch> {
    if named == has {
        return Ok(());
    }
    let expected = format!("{has} {what}, as the mesh has");
    Err(MeshMismatch { field, expected, found: named.to_string() })
}

fn check_hash(named: MeshHash, mesh: &Mesh) -> Result<(), MeshMismatch> {
    let hash = mesh.hash();
    if named == hash {
        return Ok(());
    }
    let expected = format!("{hash}, the mesh given");
    Err(MeshMismatch { field: "mesh.hash", expected, found: named.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    #[test]
    fn each_field_is_compared() {
        let mesh = zoo::tetrahedron();
        let own = MeshIdentity::of(&mesh);
        own.check(&mesh).unwrap();
        let others = [
            (MeshIdentity { n_vertices: 5, ..own }, "mesh.n_vertices"),
            (MeshIdentity { n_triangles: 5, ..own }, "mesh.n_triangles"),
            (MeshIdentity { hash: zoo::icosphere(1).hash(), ..own }, "mesh.hash"),
        ];
        for (other, field) in others {
            assert_eq!(other.check(&mesh).unwrap_err().field, field);
        }
    }

    #[test]
    fn json_holds_the_hash_as_text_and_a_part_of_it_is_enough() {
        let mesh = zoo::tetrahedron();
        let text = serde_json::to_string(&MeshIdentity::of(&mesh)).unwrap();
        let hash = mesh.hash();
        assert_eq!(text, format!(r#"{{"hash":"{hash}","n_triangles":4,"n_vertices":4}}"#));
        let back: MeshIdentity = serde_json::from_str(&text).unwrap();
        assert_eq!(back, MeshIdentity::of(&mesh));

        let field = |text: &str| {
            let named: PartialMeshIdentity = serde_json::from_str(text).unwrap();
            named.check(&mesh).err().map(|mismatch| mismatch.field)
        };
        assert_eq!(field(&text), None);
        assert_eq!(field("{}"), None);
        assert_eq!(field(r#"{"n_triangles": 4}"#), None);
        assert_eq!(field(r#"{"n_triangles": 5}"#), Some("mesh.n_triangles"));
        assert_eq!(field(r#"{"hash": "blake3:0"}"#), Some("mesh.hash"));
    }
}
