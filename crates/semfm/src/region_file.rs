//! Region files: `semfm.region/1`, as JSON.

use std::path::Path;

use semfm_geom::io::{FormatError, read_json, write_json};
use semfm_geom::{Mesh, MeshIdentity, PartialMeshIdentity};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::{Error, Region, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.region/1";

/// Reads a region of `mesh`: `{"vertices": […], "weights": […]}`, bare or under `"region"`.
///
/// `weights` are parallel to `vertices` and default to 1. Where the file says of which mesh it is
/// (counts or hash), it must be this one.
///
/// # Errors
/// [`Error::Format`] with the field at fault; an empty region is one, for nothing can be done
/// with it.
pub fn read_region(path: &Path, mesh: &Mesh) -> Result<Region> {
    let fault = |place: &str, expected: String, found: String| {
        Error::from(FormatError::new(path, place, expected, found))
    };
    let value: Value = read_json(path)?;
    let value = value.get("region").unwrap_or(&value);
    let file = RegionFile::deserialize(value).map_err(|error| {
        fault("region", "an object with `vertices`, a list of vertex ids".into(), error.to_string())
    })?;
    if let Some(format) = file.format.as_deref().filter(|&format| format != FORMAT) {
        return Err(fault("format", FORMAT.into(), format.into()));
    }
    if let Some(named) = &file.mesh {
        named.check(mesh).map_err(|other| fault(other.field, other.expected, other.found))?;
    }
    let n = mesh.n_vertices();
    if file.vertices.is_empty() {
        return Err(fault("vertices", "at least one vertex id".into(), "an empty region".into()));
    }
    if let Some(at) = file.vertices.iter().position(|&v| v >= n as u64) {
        let expected = format!("ids below {n}, the mesh's vertex count");
        return Err(fault(&format!("vertices[{at}]"), expected, file.vertices[at].to_string()));
    }
    let mut weights = vec![0.0; n];
    match &file.weights {
        None => file.vertices.iter().for_each(|&v| weights[v as usize] = 1.0),
        Some(given) if given.len() != file.vertices.len() => {
            let expected = format!("{}, one per vertex", file.vertices.len());
            return Err(fault("weights", expected, given.len().to_string()));
        }
        Some(given) => {
            for (at, (&v, &weight)) in file.vertices.iter().zip(given).enumerate() {
                if !(0.0..=1.0).contains(&weight) {
                    let expected = "a number from 0 to 1".into();
                    return Err(fault(&format!("weights[{at}]"), expected, weight.to_string()));
                }
                weights[v as usize] = weight;
            }
        }
    }
    let region = Region::from_weights(weights)?;
    if region.is_empty() {
        let expected = format!("at least one weight of {} or more", Region::COUNTS);
        return Err(fault("weights", expected, "an empty region".into()));
    }
    Ok(region)
}

/// The region as JSON: format, mesh identity, and the vertices that count with their weights.
pub fn region_json(region: &Region, mesh: &Mesh) -> Value {
    let vertices = region.vertices();
    let weights: Vec<f64> = vertices.iter().map(|&v| region.weights()[v as usize]).collect();
    json!({ "format": FORMAT, "mesh": MeshIdentity::of(mesh), "vertices": vertices, "weights": weights })
}

/// Writes a region file whole or not at all.
///
/// # Errors
/// [`semfm_geom::Error::Io`].
pub fn write_region(path: &Path, region: &Region, mesh: &Mesh) -> Result<()> {
    Ok(write_json(path, &region_json(region, mesh))?)
}

#[derive(Deserialize)]
struct RegionFile {
    format: Option<String>,
    mesh: Option<PartialMeshIdentity>,
    vertices: Vec<u64>,
    weights: Option<Vec<f64>>,
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
