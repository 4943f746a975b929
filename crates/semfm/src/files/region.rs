//! Region files: `semfm.region/1`.

use std::path::Path;

use semfm_geom::io::{FormatError, read_json};
use semfm_geom::{Mesh, MeshIdentity, PartialMeshIdentity};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::write_json;
use crate::{Region, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.region/1";

/// A region as its file has it: the vertices that count and their weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RegionFile {
    /// `semfm.region/1`; files written by hand may leave it out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<String>,
    /// Of which mesh; whatever is given must agree with the mesh at hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<PartialMeshIdentity>,
    /// Vertex ids, 0-based.
    pub vertices: Vec<u64>,
    /// Weights in [0, 1], parallel to `vertices`; 1 where they are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<Vec<f64>>,
}

impl RegionFile {
    /// The file of a region of `mesh`.
    pub fn new(region: &Region, mesh: &Mesh) -> Self {
        let vertices = region.vertices();
        Self {
            format: Some(FORMAT.into()),
            mesh: Some(MeshIdentity::of(mesh).into()),
            weights: Some(weights_at(region, &vertices)),
            vertices: vertices.into_iter().map(u64::from).collect(),
        }
    }

    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
    }

    /// Reads the file: the region's object bare or under `"region"`.
    ///
    /// # Errors
    /// [`Error::Geom`] where it cannot be read or is not JSON, [`Error::Format`] where it lacks a
    /// field or has another format.
    ///
    /// [`Error::Geom`]: crate::Error::Geom
    /// [`Error::Format`]: crate::Error::Format
    pub fn read(path: &Path) -> Result<Self> {
        let value: Value = read_json(path)?;
        let file = Self::deserialize(value.get("region").unwrap_or(&value)).map_err(|error| {
            let expected = "an object with `vertices`, a list of vertex ids";
            FormatError::new(path, "region", expected, error.to_string())
        })?;
        match &file.format {
            Some(format) if format != FORMAT => {
                Err(FormatError::new(path, "format", FORMAT, format).into())
            }
            _ => Ok(file),
        }
    }

    /// Whether the file names `mesh` by its hash.
    pub fn names(&self, mesh: &Mesh) -> bool {
        let hash = self.mesh.as_ref().and_then(|identity| identity.hash.as_deref());
        hash == Some(&*mesh.hash().to_string())
    }

    /// The region, on the mesh that it belongs to. `path` is named in errors.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) with the field at fault: another mesh, ids beyond
    /// the mesh, weights that are missing or out of range, a region in which no vertex counts.
    pub fn region(&self, path: &Path, mesh: &Mesh) -> Result<Region> {
        if let Some(identity) = &self.mesh {
            identity.check(mesh).map_err(|error| error.in_file(path))?;
        }
        let n = mesh.n_vertices();
        if self.vertices.is_empty() {
            let expected = "at least one vertex id";
            return Err(FormatError::new(path, "vertices", expected, "an empty region").into());
        }
        if let Some(at) = self.vertices.iter().position(|&v| v >= n as u64) {
            let expected = format!("ids below {n}, the mesh's vertex count");
            let found = self.vertices[at].to_string();
            return Err(FormatError::new(path, format!("vertices[{at}]"), expected, found).into());
        }
        let mut weights = vec![0.0; n];
        match &self.weights {
            None => self.vertices.iter().for_each(|&v| weights[v as usize] = 1.0),
            Some(given) if given.len() != self.vertices.len() => {
                let expected = format!("{}, one per vertex", self.vertices.len());
                let found = given.len().to_string();
                return Err(FormatError::new(path, "weights", expected, found).into());
            }
            Some(given) => {
                for (at, (&v, &weight)) in self.vertices.iter().zip(given).enumerate() {
                    if !(0.0..=1.0).contains(&weight) {
                        let (place, found) = (format!("weights[{at}]"), weight.to_string());
                        let expected = "a number from 0 to 1";
                        return Err(FormatError::new(path, place, expected, found).into());
                    }
                    weights[v as usize] = weight;
                }
            }
        }
        let region = Region::from_weights(weights)?;
        if region.is_empty() {
            let expected = format!("at least one weight of {} or more", Region::COUNTS);
            return Err(FormatError::new(path, "weights", expected, "an empty region").into());
        }
        Ok(region)
    }
}

/// Reads a region of `mesh`: [`RegionFile::read`], then [`RegionFile::region`].
///
/// # Errors
/// Those of both; an empty region is one, for nothing can be done with it.
pub fn read_region(path: &Path, mesh: &Mesh) -> Result<Region> {
    RegionFile::read(path)?.region(path, mesh)
}

/// Writes a region file whole or not at all.
///
/// # Errors
/// [`semfm_geom::Error::Io`].
pub fn write_region(path: &Path, region: &Region, mesh: &Mesh) -> Result<()> {
    write_json(path, &RegionFile::new(region, mesh))
}

/// The weights of `vertices`.
pub(super) fn weights_at(region: &Region, vertices: &[u32]) -> Vec<f64> {
    vertices.iter().map(|&v| region.weights()[v as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    fn read(text: &str) -> Result<Region> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.json");
        std::fs::write(&path, text).unwrap();
        read_region(&path, &zoo::tetrahedron())
    }

    #[test]
    fn what_is_written_is_read_back() {
        let mesh = zoo::tetrahedron();
        let region = Region::from_weights(vec![1.0, 0.2, 0.75, 0.0]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.json");
        write_region(&path, &region, &mesh).unwrap();
        let back = read_region(&path, &mesh).unwrap();
        assert_eq!(back.weights(), [1.0, 0.0, 0.75, 0.0]);
        let error = read_region(&path, &zoo::icosphere(1)).unwrap_err().to_string();
        assert!(error.contains("r.json") && error.contains("mesh.n_vertices"), "{error}");
    }

    #[test]
    fn plain_lists_are_enough_and_faults_are_named() {
        assert_eq!(read(r#"{"vertices": [2, 0]}"#).unwrap().vertices(), [0, 2]);
        assert_eq!(read(r#"{"region": {"vertices": [1]}}"#).unwrap().vertices(), [1]);
        for (text, place) in [
            (r#"{"vertices": []}"#, "vertices"),
            (r#"{"vertices": [4]}"#, "vertices[0]"),
            (r#"{"vertices": [-1]}"#, "region"),
            (r#"{"vertices": [1], "weights": [0.5, 1]}"#, "weights"),
            (r#"{"vertices": [1], "weights": [1.5]}"#, "weights[0]"),
            (r#"{"vertices": [1], "weights": [0.1]}"#, "weights"),
            (r#"{"format": "other/1", "vertices": [1]}"#, "format"),
            (r#"{"mesh": {"hash": "blake3:0"}, "vertices": [1]}"#, "mesh.hash"),
            (r#"{"mesh": {"n_vertices": 5}, "vertices": [1]}"#, "mesh.n_vertices"),
            ("{", "line 1"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{text}: {error}");
        }
    }
}
