//! `aligned.json`: the pose and the metres of an object, for whoever grasps it.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_align::{AlignSettings, Alignment, Sim3};
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::{Mesh, MeshIdentity, PartialMeshIdentity, Verdict};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{MatrixRows, write_json};
use crate::Result;

/// The format that is written.
const FORMAT: &str = "semfm.aligned/1";

/// How far `scale` and the matrix may differ, relative: files written with six digits pass.
const SCALE_TOLERANCE: f64 = 1e-4;

/// An alignment as its file has it: the pose with its uncertainty, what it was judged by, and the
/// settings that led to it. Only the pose must be there; `null` is a number that is not known or
/// not finite.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignedFile {
    /// `semfm.aligned/1`.
    pub format: Option<String>,
    /// Of which mesh; whatever is given must agree with the mesh at hand.
    pub mesh: Option<PartialMeshIdentity>,
    /// From the mesh's frame and units to the camera's frame in metres, scale included.
    pub camera_from_object: MatrixRows,
    /// Metres per unit of the mesh: that of the matrix.
    pub scale: Option<f64>,
    /// Standard deviation of the scale, metres per unit of the mesh.
    pub scale_std: Option<f64>,
    /// Standard deviation of the rotation about its least certain axis, radians.
    pub rotation_std: Option<f64>,
    /// Standard deviation of the position in its least certain direction, metres.
    pub position_std_m: Option<f64>,
    /// Root mean square distance of the observed points to the surface, metres.
    pub residual_m: Option<f64>,
    /// Share of the observed points that lie on the model.
    pub inlier_share: Option<f64>,
    /// Of the model's side that faces the camera, the share that was seen where it is.
    pub visibility: Option<f64>,
    /// What the best pose that puts some of the surface elsewhere explains of what was seen, as a share
    /// of what this one does.
    pub rival: Option<f64>,
    /// Axes of the mesh about which the rotation is not determined.
    #[serde(default)]
    pub undetermined: Vec<UndeterminedAxisRecord>,
    /// Other values of `camera_from_object` that explain what was seen as well.
    #[serde(default)]
    pub alternatives: Vec<MatrixRows>,
    /// What to do with the pose.
    pub verdict: Option<Verdict>,
    /// What speaks against accepting it, in words.
    #[serde(default)]
    pub reasons: Vec<String>,
    /// Starts tried.
    pub n_starts: Option<usize>,
    /// Steps of the last round.
    pub iterations: Option<usize>,
    /// The settings of the search.
    pub settings: Option<AlignSettingsRecord>,
    /// Milliseconds by stage.
    #[serde(default)]
    pub stages_ms: BTreeMap<String, f64>,
}

/// An axis about which what was seen does not determine the rotation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UndeterminedAxisRecord {
    /// Unit vector in the mesh's frame.
    pub axis: [f64; 3],
    /// Ranges of turns about it that fit as well, radians; 0 is the pose itself.
    pub turns: Vec<[f64; 2]>,
}

/// The settings of a search as `aligned.json` has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AlignSettingsRecord {
    /// The initial pose.
    pub init: Option<MatrixRows>,
    /// Least and greatest scale.
    pub scale_range: Option<[f64; 2]>,
    /// Rotations to start from.
    pub starts: usize,
    /// Seed of the model's samples.
    pub seed: u64,
}

impl AlignedFile {
    /// The file of an alignment of `mesh`.
    pub fn new(found: &Alignment, mesh: &Mesh, settings: &AlignSettings) -> Self {
        let stages = found.stages_ms.iter().map(|&(name, ms)| (name.to_owned(), ms));
        Self {
            format: Some(FORMAT.into()),
            mesh: Some(MeshIdentity::of(mesh).into()),
            camera_from_object: found.camera_from_object.to_rows(),
            scale: Some(found.camera_from_object.scale),
            scale_std: Some(found.scale_std),
            rotation_std: Some(found.rotation_std),
            position_std_m: Some(found.position_std),
            residual_m: Some(found.residual_m),
            inlier_share: Some(found.inlier_share),
            visibility: Some(found.visibility),
            rival: Some(found.rival),
            undetermined: found
                .undetermined
                .iter()
                .map(|open| UndeterminedAxisRecord {
                    axis: open.axis.to_array(),
                    turns: open.turns.clone(),
                })
                .collect(),
            alternatives: found.alternatives.iter().map(Sim3::to_rows).collect(),
            verdict: Some(found.verdict),
            reasons: found.reasons.clone(),
            n_starts: Some(found.n_starts),
            iterations: Some(found.iterations),
            settings: Some(AlignSettingsRecord {
                init: settings.init.map(|init| init.to_rows()),
                scale_range: settings.scale_range,
                starts: settings.n_starts,
                seed: settings.seed,
            }),
            stages_ms: stages.collect(),
        }
    }

    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }
}

/// The pose of an object before a camera, read from a file and checked.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignedPose {
    /// From the mesh's frame and units to the camera's frame in metres. In a robot's chain,
    /// `camera_from_tcp = camera_from_object.rigid() * object_from_tcp`.
    pub camera_from_object: Sim3,
    /// Standard deviation of the scale, metres per unit of the mesh; `None` where the file does not say.
    pub scale_std: Option<f64>,
    /// Standard deviation of the rotation about its least certain axis, radians; `None` where the file does not say.
    pub rotation_std: Option<f64>,
    /// Standard deviation of the position in its least certain direction, metres; `None` where the file does not say.
    pub position_std_m: Option<f64>,
    /// Root mean square distance of the observed points to the surface, metres; `None` where the
    /// file does not say.
    pub residual_m: Option<f64>,
    /// What to do with the pose; `None` where the file does not say.
    pub verdict: Option<Verdict>,
    /// What speaks against accepting it, in words.
    pub reasons: Vec<String>,
    /// Other poses that explain what was seen as well.
    pub alternatives: Vec<Sim3>,
}

/// Reads `aligned.json`. Where it names its mesh and `mesh` is given, they must be the same.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not JSON,
/// [`Error::Format`](crate::Error::Format) with the field at fault.
pub fn read_aligned(path: &Path, mesh: Option<&Mesh>) -> Result<AlignedPose> {
    let value: Value = read_json(path)?;
    let file = AlignedFile::deserialize(&value).map_err(|error| {
        let expected = "an object with `camera_from_object`, a 4 × 4 matrix";
        FormatError::new(path, "aligned", expected, error.to_string())
    })?;
    if let Some(format) = file.format.as_deref().filter(|&format| format != FORMAT) {
        return Err(FormatError::new(path, "format", FORMAT, format).into());
    }
    if let (Some(identity), Some(mesh)) = (&file.mesh, mesh) {
        identity.check(mesh).map_err(|error| error.in_file(path))?;
    }
    AlignedPose::of_file(file, path)
}

impl AlignedPose {
    /// The pose of a file's content; `path` is for messages.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) with the field at fault.
    pub fn of_file(file: AlignedFile, path: &Path) -> Result<Self> {
        checked_pose(file, path)
    }

    /// How far (metres) points of the mesh's surface may stand from where the pose puts them, one standard deviation:
    ///
    /// > √(position² + (rotation · r)² + (scale_std · r / scale)²), r (metres) the distance of the farthest vertex
    /// > from the middle
    ///
    /// What the file does not say counts as certain.
    pub fn uncertainty(&self, mesh: &Mesh) -> f64 {
        let (low, high) = mesh.bounds();
        let middle = low.midpoint(high);
        let radius = mesh.vertices().iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let position = self.position_std_m.unwrap_or(0.0);
        let turned = self.rotation_std.unwrap_or(0.0) * radius * self.camera_from_object.scale;
        let scaled = self.scale_std.unwrap_or(0.0) * radius;
        position.hypot(turned).hypot(scaled)
    }
}

fn checked_pose(file: AlignedFile, path: &Path) -> Result<AlignedPose> {
    let camera_from_object = similarity(path, "camera_from_object", file.camera_from_object)?;
    let scale = camera_from_object.scale;
    if let Some(found) = file.scale.filter(|found| (found / scale - 1.0).abs() > SCALE_TOLERANCE) {
        let expected = format!("{scale}, the matrix's");
        return Err(FormatError::new(path, "scale", expected, found.to_string()).into());
    }
    let numbers = [
        ("scale_std", file.scale_std),
        ("rotation_std", file.rotation_std),
        ("position_std_m", file.position_std_m),
        ("residual_m", file.residual_m),
    ];
    for (place, number) in numbers {
        if let Some(number) = number.filter(|x| *x < 0.0) {
            let expected = "a number of at least 0";
            return Err(FormatError::new(path, place, expected, number.to_string()).into());
        }
    }
    let alternatives: Result<Vec<Sim3>> =
        file.alternatives.iter().map(|&rows| similarity(path, "alternatives", rows)).collect();
    Ok(AlignedPose {
        camera_from_object,
        scale_std: file.scale_std,
        rotation_std: file.rotation_std,
        position_std_m: file.position_std_m,
        residual_m: file.residual_m,
        verdict: file.verdict,
        reasons: file.reasons,
        alternatives: alternatives?,
    })
}

/// Reads an initial pose: `aligned.json`, any object with a field `camera_from_object`, or a bare
/// 4 × 4 matrix.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not JSON,
/// [`Error::Format`](crate::Error::Format) with the place at fault.
pub fn read_pose(path: &Path) -> Result<Sim3> {
    let value: Value = read_json(path)?;
    let (place, rows) = match value.get("camera_from_object") {
        Some(rows) => ("camera_from_object", rows),
        None => ("matrix", &value),
    };
    let rows = MatrixRows::deserialize(rows)
        .map_err(|error| FormatError::new(path, place, "a 4 × 4 matrix", error.to_string()))?;
    similarity(path, place, rows)
}

fn similarity(path: &Path, place: &str, rows: MatrixRows) -> Result<Sim3> {
    Sim3::from_rows(rows).map_err(|error| match error {
        semfm_align::Error::OutOfRange { expected, found, .. } => {
            FormatError::new(path, place, expected, found).into()
        }
        other => other.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    fn read(text: &str, mesh: Option<&Mesh>) -> Result<AlignedPose> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("aligned.json");
        std::fs::write(&path, text).unwrap();
        read_aligned(&path, mesh)
    }

    #[test]
    fn uncertainty_is_that_of_the_farthest_points() {
        let text = format!(
            r#"{{"camera_from_object": {POSE}, "position_std_m": 0.003, "rotation_std": 0.01, "scale_std": 0.02}}"#
        );
        let mesh = zoo::icosphere(1); // radius 1, at scale 2
        let found = read(&text, None).unwrap().uncertainty(&mesh);
        let expected = (0.003f64.powi(2) + 0.02f64.powi(2) + 0.02f64.powi(2)).sqrt();
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
        let bare = read(&format!(r#"{{"camera_from_object": {POSE}}}"#), None).unwrap();
        assert_eq!(bare.uncertainty(&mesh), 0.0);
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
