//! Mesh files: OBJ, OFF, PLY, STL and glTF, read strictly and written whole.
//!
//! Vertex ids are 0-based and mean the mesh as read: OBJ, OFF and PLY in file order and count; STL
//! by bitwise-distinct corners in order of first appearance; glTF by its default scene's nodes,
//! depth first, one copy per instance, transforms applied. A region is a set of vertex ids, so a
//! reader that merges, splits or sorts vertices would be wrong, however pretty its meshes.
//!
//! Files are hostile until proven otherwise: a count is believed only after the file was found
//! long enough to hold it, references are checked before they are followed, and nothing outside the
//! file's own folder is opened.

pub mod appearance;
mod atomic;
mod gltf;
mod image;
mod input;
mod obj;
mod off;
mod pcd;
mod ply;
mod polygon;
mod stl;
mod text;
mod write;

use std::path::Path;

pub use self::appearance::{Appearance, Material};
pub use self::atomic::{replace_atomically, write_atomically};
pub use self::image::{Texture, Wrap};
use self::input::{Input, quote, read_file};
pub use self::write::{Paint, write_mesh, write_painted_mesh};
use crate::math::DVec3;
use crate::{Error, Mesh, Result};

/// The formats that meshes are read from and written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ.
    Obj,
    /// Geomview's Object File Format.
    Off,
    /// Stanford's Polygon File Format.
    Ply,
    /// Stereolithography, ascii or binary.
    Stl,
    /// glTF 2.0 as JSON.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
}

impl MeshFormat {
    /// The format that a file's extension names, in any case; `None` for another extension.
    pub fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "off" => Some(Self::Off),
            "ply" => Some(Self::Ply),
            "stl" => Some(Self::Stl),
            "gltf" => Some(Self::Gltf),
            "glb" => Some(Self::Glb),
            _ => None,
        }
    }

    /// The format that the first bytes of a file show; OBJ and binary STL show none.
    fn from_content(bytes: &[u8]) -> Option<Self> {
        let text = bytes.trim_ascii_start();
        let is_off =
            || text.split(|b| !b.is_ascii_uppercase()).next().is_some_and(|w| w.ends_with(b"OFF"));
        match text {
            _ if bytes.starts_with(b"glTF") => Some(Self::Glb),
            _ if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") => Some(Self::Ply),
            _ if text.starts_with(b"solid") => Some(Self::Stl),
            _ if text.starts_with(b"{") => Some(Self::Gltf),
            _ if is_off() => Some(Self::Off),
            _ => None,
        }
    }
}

/// A mesh as its file has it.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// The mesh, polygons cut to triangles.
    pub mesh: Mesh,
    /// Faces in the file, before cutting; points and edges among them do not count.
    pub n_faces: usize,
    /// Colours and images.
    pub appearance: Appearance,
    /// The format it was in.
    pub format: MeshFormat,
}

/// Points as their file has them, for observed clouds and scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct PointCloud {
    /// Positions (n).
    pub points: Vec<DVec3>,
    /// RGBA in sRGB (n), where the file has them.
    pub colors: Option<Vec<[u8; 4]>>,
}

/// What a reader hands over, before the mesh is checked.
struct MeshParts {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    n_faces: usize,
    appearance: Appearance,
}

/// Reads a mesh: OBJ, OFF, PLY, STL, glTF or GLB, by extension and, where that is unknown, by the
/// first bytes.
///
/// Images that are broken, missing or too large leave a note in [`Appearance::notes`]; they do not
/// make the geometry unreadable.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the line, byte or element where the file breaks its
/// format; [`Error::InFile`] where it holds no mesh (points without faces, say).
pub fn read_mesh(path: impl AsRef<Path>) -> Result<MeshFile> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let input = Input { path, bytes: &bytes };
    let format = format_of(input)?;
    let parts = match format {
        MeshFormat::Obj => obj::read(input)?,
        MeshFormat::Off => off::read(input)?,
        MeshFormat::Ply => ply::read(input)?,
        MeshFormat::Stl => stl::read(input)?,
        MeshFormat::Gltf | MeshFormat::Glb => gltf::read(input)?,
    };
    let mesh = Mesh::new(parts.vertices, parts.faces).map_err(|cause| input.wrap(cause))?;
    Ok(MeshFile { mesh, n_faces: parts.n_faces, appearance: parts.appearance, format })
}

/// Reads the vertices of a file as points: a file without faces is fine here. PLY, OBJ and OFF give
/// all their vertices; of STL and glTF the mesh is read. PCD files (ascii, binary, compressed) hold
/// nothing but points; those marked as no return (NaN) are left out.
///
/// # Errors
/// As [`read_mesh`]; [`Error::InFile`] for a file without a point or with one that is not finite.
pub fn read_points(path: impl AsRef<Path>) -> Result<PointCloud> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let input = Input { path, bytes: &bytes };
    let cloud = if pcd::is_pcd(input) { pcd::read_points(input)? } else { vertices_of(input)? };
    if cloud.points.is_empty() {
        return Err(input.error("whole file", "at least one point", "none"));
    }
    if let Some(vertex) = cloud.points.iter().position(|p| !p.is_finite()) {
        let p = cloud.points[vertex];
        return Err(input.wrap(Error::NotFinite { vertex, x: p.x, y: p.y, z: p.z }));
    }
    Ok(cloud)
}

fn vertices_of(input: Input<'_>) -> Result<PointCloud> {
    match format_of(input)? {
        MeshFormat::Obj => obj::read_points(input),
        MeshFormat::Off => off::read_points(input),
        MeshFormat::Ply => ply::read_points(input),
        MeshFormat::Stl | MeshFormat::Gltf | MeshFormat::Glb => {
            let file = read_mesh(input.path)?;
            let points = file.mesh.vertices().to_vec();
            Ok(PointCloud { points, colors: file.appearance.vertex_colors })
        }
    }
}

fn format_of(input: Input<'_>) -> Result<MeshFormat> {
    if input.bytes.is_empty() {
        return Err(input.error("byte 0", "a mesh", "an empty file"));
    }
    match (MeshFormat::from_path(input.path), MeshFormat::from_content(input.bytes)) {
        // The two forms of glTF are told apart by their first bytes alone.
        (Some(MeshFormat::Gltf), Some(MeshFormat::Glb)) => Ok(MeshFormat::Glb),
        (Some(format), _) | (None, Some(format)) => Ok(format),
        (None, None) => {
            let found = quote(&input.bytes[..input.bytes.len().min(16)]);
            Err(input.error("byte 0", "an obj, off, ply, stl, gltf or glb file", found))
        }
    }
}
