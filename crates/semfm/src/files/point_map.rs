//! `point_map.json`: which vertex of the source each vertex of the target is matched to, and what
//! lies on both. Format `semfm.point_map/1`.

use std::path::Path;

use semfm_geom::io::{FormatError, read_json};
use semfm_geom::{Mesh, MeshHash};
use serde::{Deserialize, Serialize};

use super::write_json;
use crate::Result;

/// The format that is written.
pub(super) const FORMAT: &str = "semfm.point_map/1";

/// A point map as its file has it. All arrays are parallel to the vertices of a mesh as read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointMapFile {
    /// `semfm.point_map/1`.
    pub format: String,
    /// Hash of the source's mesh.
    pub source: MeshHash,
    /// Hash of the target's mesh.
    pub target: MeshHash,
    /// The source vertex matched to each target vertex (n_target).
    pub source_of: Vec<u32>,
    /// Rank of the anchor at each source vertex, best first; −1 outside of all (n_source).
    pub source_anchor: Vec<i64>,
    /// Rank of the anchor at each target vertex (n_target).
    pub target_anchor: Vec<i64>,
    /// Weight of the demonstrated region at each source vertex, to four digits (n_source).
    pub source_weight: Vec<f64>,
    /// Weight of the transferred region at each target vertex, to four digits (n_target).
    pub target_weight: Vec<f64>,
}

impl PointMapFile {
    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }

    /// Reads the file.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or lacks a field,
    /// [`Error::Format`](crate::Error::Format) for another format.
    pub fn read(path: &Path) -> Result<Self> {
        let file: Self = read_json(path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        Ok(file)
    }

    /// Refuses arrays of other lengths than the meshes, and ids beyond the source. `path` is named
    /// in errors.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) with the array at fault.
    pub fn check(&self, path: &Path, source: &Mesh, target: &Mesh) -> Result<()> {
        let (n_source, n_target) = (source.n_vertices(), target.n_vertices());
        let lengths = [
            ("source_of", self.source_of.len(), n_target),
            ("source_anchor", self.source_anchor.len(), n_source),
            ("target_anchor", self.target_anchor.len(), n_target),
            ("source_weight", self.source_weight.len(), n_source),
            ("target_weight", self.target_weight.len(), n_target),
        ];
        for (name, found, n) in lengths {
            if found != n {
                let expected = format!("{n} numbers, one per vertex");
                return Err(FormatError::new(path, name, expected, found.to_string()).into());
            }
        }
        match self.source_of.iter().find(|&&v| v as usize >= n_source) {
            Some(v) => {
                let expected = format!("ids below {n_source}");
                Err(FormatError::new(path, "source_of", expected, v.to_string()).into())
            }
            None => Ok(()),
        }
    }
}
