//! Mesh files, read strictly and written whole; [`MeshFormat`] is the table of their formats.
//!
//! Vertex ids are 0-based and mean the mesh as read: OBJ, OFF and PLY in file order and count; STL
//! by bitwise-distinct corners in order of first appearance; glTF by its default scene's nodes,
//! depth first, one copy per instance, transforms applied. A region is a set of vertex ids, so a
//! reader that merges, splits or sorts vertices would be wrong, however pretty its meshes.
//!
//! No file is trusted: a count is believed only after the file was found
//! long enough to hold it, references are checked before they are followed, and nothing outside the
//! file's own folder is opened.

pub mod appearance;
mod atomic;
mod blocks;
mod contents;
mod format_error;
mod format_row;
mod gltf;
mod image;
mod input;
mod input_files;
mod json;
mod mesh_format;
mod obj;
mod off;
mod pcd;
mod ply;
mod polygon;
mod polygon_with_holes;
mod printable;
mod read_files;
mod staged_folder;
mod stl;
mod target;
mod temporary;
mod text;
mod vertex_attributes;
mod write;

use std::path::Path;

pub use self::appearance::{Appearance, Material};
pub use self::atomic::{replace_atomically, write_atomically};
pub use self::contents::foreign_kind;
pub use self::format_error::FormatError;
pub use self::gltf::{GlbNode, write_glb};
pub use self::image::{Texture, Wrap};
use self::input::Input;
pub use self::input::{open_file, read_at_most, read_file};
pub use self::input_files::{is_same_file, refuse_input, refuse_to_overwrite};
pub use self::json::{json_of, read_json, write_json, write_json_pretty};
pub use self::mesh_format::MeshFormat;
pub use self::printable::{printable, printable_name};
pub use self::read_files::ReadFiles;
pub use self::staged_folder::{StagedFolder, shown_path};
pub use self::target::{check_output, is_stdout};
pub use self::temporary::{TEMPORARY_PREFIX, remove_left_behind};
pub use self::vertex_attributes::VertexAttributes;
pub use self::write::{write_mesh, write_mesh_in_node, write_mesh_with_attributes};
use crate::math::DVec3;
use crate::{Error, Mesh, Result};

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

/// Reads a mesh in any format of [`MeshFormat::ALL`], told by extension and, where that is unknown,
/// by the first bytes.
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
    mesh_of(input, MeshFormat::of(input)?)
}

fn mesh_of(input: Input<'_>, format: MeshFormat) -> Result<MeshFile> {
    let read = |input: Input<'_>| {
        let parts = (format.row().read)(input)?;
        let mesh = Mesh::new(parts.vertices, parts.faces).map_err(|cause| input.wrap(cause))?;
        Ok(MeshFile { mesh, n_faces: parts.n_faces, appearance: parts.appearance, format })
    };
    read(input).map_err(|error| format.misnamed(input).unwrap_or(error))
}

/// Reads the vertices of a file as points: a file without faces is fine here. PLY, OBJ and OFF give
/// all their vertices; of the other formats the mesh is read. PCD files (ascii, binary, compressed) hold
/// nothing but points. A point with a coordinate that is no number (NaN) is where a camera saw nothing: it
/// is left out, in every format.
///
/// # Errors
/// As [`read_mesh`]; [`Error::InFile`] for a file without a point or with one that is not finite.
pub fn read_points(path: impl AsRef<Path>) -> Result<PointCloud> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let input = Input { path, bytes: &bytes };
    points_of(input)
}

/// What a file of unknown contents holds.
#[derive(Clone, Debug)]
pub enum MeshOrPoints {
    /// A surface.
    Mesh(MeshFile),
    /// Points without faces.
    Points(PointCloud),
}

/// Reads a mesh as [`read_mesh`] does, or the points of a file that has no faces.
///
/// # Errors
/// As [`read_mesh`] and [`read_points`].
pub fn read_mesh_or_points(path: impl AsRef<Path>) -> Result<MeshOrPoints> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let input = Input { path, bytes: &bytes };
    if pcd::is_pcd(input) {
        return Ok(MeshOrPoints::Points(points_of(input)?));
    }
    let format = MeshFormat::of(input)?;
    match mesh_of(input, format) {
        Err(Error::InFile { cause, .. }) if matches!(*cause, Error::EmptyMesh { .. }) => {
            Ok(MeshOrPoints::Points(points_of(input)?))
        }
        mesh => Ok(MeshOrPoints::Mesh(mesh?)),
    }
}

fn points_of(input: Input<'_>) -> Result<PointCloud> {
    let cloud = if pcd::is_pcd(input) {
        let named = |error| input.misnamed("a point cloud (.pcd)", "pcd").unwrap_or(error);
        pcd::read_points(input).map_err(named)?
    } else {
        vertices_of(input)?
    };
    let cloud = without_nan(cloud);
    if cloud.points.is_empty() {
        return Err(input.error("whole file", "at least one point", "none"));
    }
    Error::check_points(&cloud.points).map_err(|cause| input.wrap(cause))?;
    Ok(cloud)
}

/// The points of which every coordinate is a number, with their colours.
fn without_nan(mut cloud: PointCloud) -> PointCloud {
    let is_seen: Vec<bool> = cloud.points.iter().map(|p| !p.is_nan()).collect();
    if is_seen.contains(&false) {
        let mut keep = is_seen.iter();
        cloud.points.retain(|_| keep.next().is_some_and(|seen| *seen));
        if let Some(colors) = &mut cloud.colors {
            let mut keep = is_seen.iter();
            colors.retain(|_| keep.next().is_some_and(|seen| *seen));
        }
    }
    cloud
}

fn vertices_of(input: Input<'_>) -> Result<PointCloud> {
    let format = MeshFormat::of(input)?;
    if let Some(read_points) = format.row().read_points {
        let cloud = read_points(input).and_then(|cloud| match cloud.points.is_empty() {
            true => Err(input.error("whole file", "at least one point", "none")),
            false => Ok(cloud),
        });
        return cloud.map_err(|error| format.misnamed(input).unwrap_or(error));
    }
    let file = mesh_of(input, format)?;
    Ok(PointCloud { points: file.mesh.vertices().to_vec(), colors: file.appearance.vertex_colors })
}
