//! `aligned.json`: the pose and the metres of an object, for whoever grasps it.

use std::path::Path;

use semfm_align::{AlignSettings, Alignment, Sim3, Verdict};
use semfm_geom::io::{FormatError, read_json, write_json};
use semfm_geom::{Mesh, MeshIdentity, PartialMeshIdentity};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::{Error, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.aligned/1";

/// How far `scale` and the matrix may differ, relative: files written with six digits pass.
const SCALE_TOLERANCE: f64 = 1e-4;

/// A pose as its file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aligned {
    /// From the mesh's frame and units to the camera's frame in metres. In a robot's chain,
    /// `camera_from_tcp = camera_from_object.rigid() * object_from_tcp`.
    pub camera_from_object: Sim3,
    /// Standard deviation of the scale, metres per unit of the mesh; `None` where it is not told.
    pub scale_std: Option<f64>,
    /// Root mean square distance of the observed points to the surface, metres; `None` where it is
    /// not told.
    pub residual_m: Option<f64>,
    /// What to do with the pose; `None` where it is not told.
    pub verdict: Option<Verdict>,
}

/// An alignment of `mesh` as JSON: the pose with its uncertainty, what it was judged by, and the
/// settings that led to it.
pub fn aligned_json(found: &Alignment, mesh: &Mesh, settings: &AlignSettings) -> Value {
    let stages = found.stages_ms.iter().map(|&(name, ms)| (name.to_owned(), json!(ms)));
    json!({
        "format": FORMAT,
        "mesh": MeshIdentity::of(mesh),
        "camera_from_object": found.camera_from_object.to_rows(),
        "scale": found.camera_from_object.scale,
        "scale_std": found.scale_std,
        "rotation_std": found.rotation_std,
        "position_std_m": found.position_std,
        "residual_m": found.residual_m,
        "inlier_share": found.inlier_share,
        "visibility": found.visibility,
        "rival": found.rival,
        "verdict": found.verdict,
        "reasons": found.reasons,
        "n_starts": found.n_starts,
        "iterations": found.iterations,
        "settings": {
            "init": settings.init.map(|init| init.to_rows()),
            "scale_range": settings.scale_range,
            "starts": settings.n_starts,
            "seed": settings.seed,
        },
        "stages_ms": Value::Object(stages.collect()),
    })
}

/// Writes [`aligned_json`] whole or not at all.
///
/// # Errors
/// [`semfm_geom::Error::Io`].
pub fn write_aligned(path: &Path, value: &Value) -> Result<()> {
    Ok(write_json(path, value)?)
}

/// Reads `aligned.json`. Where it names its mesh and `mesh` is given, they must be the same.
///
/// # Errors
/// [`Error::Format`] with the field at fault.
pub fn read_aligned(path: &Path, mesh: Option<&Mesh>) -> Result<Aligned> {
    let value: Value = read_json(path)?;
    let fault = |place: &str, expected: String, found: String| {
        Error::from(FormatError::new(path, place, expected, found))
    };
    let file = AlignedFile::deserialize(&value).map_err(|error| {
        let expected = "an object with `camera_from_object`, a 4 × 4 matrix".into();
        fault("aligned", expected, error.to_string())
    })?;
    if let Some(format) = file.format.as_deref().filter(|&format| format != FORMAT) {
        return Err(fault("format", FORMAT.into(), format.into()));
    }
    if let (Some(named), Some(mesh)) = (&file.mesh, mesh) {
        named.check(mesh).map_err(|other| fault(other.field, other.expected, other.found))?;
    }
    let camera_from_object = similarity(path, "camera_from_object", file.camera_from_object)?;
    let scale = camera_from_object.scale;
    if let Some(told) = file.scale.filter(|told| (told / scale - 1.0).abs() > SCALE_TOLERANCE) {
        return Err(fault("scale", format!("{scale}, the matrix's"), told.to_string()));
    }
    for (place, number) in [("scale_std", file.scale_std), ("residual_m", file.residual_m)] {
        if let Some(number) = number.filter(|x| *x < 0.0) {
            return Err(fault(place, "a number of at least 0".into(), number.to_string()));
        }
    }
    let (scale_std, residual_m) = (file.scale_std, file.residual_m);
    Ok(Aligned { camera_from_object, scale_std, residual_m, verdict: file.verdict })
}

/// Reads an initial pose: `aligned.json`, any object with a field `camera_from_object`, or a bare
/// 4 × 4 matrix.
///
/// # Errors
/// [`Error::Format`] with the place at fault.
pub fn read_pose(path: &Path) -> Result<Sim3> {
    let value: Value = read_json(path)?;
    let (place, rows) = match value.get("camera_from_object") {
        Some(rows) => ("camera_from_object", rows),
        None => ("matrix", &value),
    };
    let rows = <[[f64; 4]; 4]>::deserialize(rows)
        .map_err(|error| FormatError::new(path, place, "a 4 × 4 matrix", error.to_string()))?;
    similarity(path, place, rows)
}

fn similarity(path: &Path, place: &str, rows: [[f64; 4]; 4]) -> Result<Sim3> {
    Sim3::from_rows(rows).map_err(|error| match error {
        semfm_align::Error::OutOfRange { expected, found, .. } => {
            FormatError::new(path, place, expected, found).into()
        }
        other => other.into(),
    })
}

#[derive(Deserialize)]
struct AlignedFile {
    format: Option<String>,
    mesh: Option<PartialMeshIdentity>,
    camera_from_object: [[f64; 4]; 4],
    scale: Option<f64>,
    scale_std: Option<f64>,
    residual_m: Option<f64>,
    verdict: Option<Verdict>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    fn read(text: &str, mesh: Option<&Mesh>) -> Result<Aligned> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("aligned.json");
        std::fs::write(&path, text).unwrap();
        read_aligned(&path, mesh)
    }

    const POSE: &str = "[[0,-2,0,1],[2,0,0,0],[0,0,2,0.5],[0,0,0,1]]";

    #[test]
    fn the_least_file_is_enough_and_a_bare_matrix_is_a_pose() {
        let aligned = read(&format!(r#"{{"camera_from_object": {POSE}}}"#), None).unwrap();
        assert!((aligned.camera_from_object.scale - 2.0).abs() < 1e-15);
        assert_eq!((aligned.verdict, aligned.scale_std), (None, None));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("init.json");
        std::fs::write(&path, POSE).unwrap();
        assert_eq!(read_pose(&path).unwrap(), aligned.camera_from_object);
    }

    #[test]
    fn faults_are_named() {
        let with = |more: &str| format!(r#"{{"camera_from_object": {POSE}, {more}}}"#);
        let mesh = zoo::tetrahedron();
        for (text, place) in [
            (with(r#""format": "semfm.region/1""#), "format"),
            (with(r#""scale": 1.5"#), "scale"),
            (with(r#""residual_m": -1"#), "residual_m"),
            (with(r#""verdict": "maybe""#), "aligned"),
            (with(r#""mesh": {"n_vertices": 5}"#), "mesh.n_vertices"),
            (r#"{"camera_from_object": [[1]]}"#.into(), "aligned"),
            (POSE.replace("[0,-2", "{\"camera_from_object\": [[0,2"), "line 1"),
            (with("\"a\": 1").replace("-2", "2"), "camera_from_object"),
            ("{".into(), "line 1"),
        ] {
            let error = read(&text, Some(&mesh)).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{text}: {error}");
        }
    }
}
