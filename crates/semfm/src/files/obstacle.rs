//! What stands around an object: meshes and point clouds.

use std::path::Path;

use semfm_geom::io::{MeshOrPoints, read_mesh_or_points};

use crate::{Obstacle, Result};

/// Reads a mesh, or the points of a file without faces.
///
/// # Errors
/// [`semfm_geom::Error::Io`]; [`semfm_geom::Error::Format`] where the file breaks its format;
/// [`semfm_geom::Error::InFile`] where it holds neither.
pub fn read_obstacle(path: &Path) -> Result<Obstacle> {
    Ok(match read_mesh_or_points(path)? {
        MeshOrPoints::Mesh(file) => Obstacle::Mesh(file.mesh),
        MeshOrPoints::Points(cloud) => Obstacle::Points(cloud.points),
    })
}
