//! `scene.json`: what stands around an arm.

use std::path::{Component, Path, PathBuf};

use parry3d_f64::math::Pose;
use semfm_geom::io::{FormatError, MeshOrPoints, read_json, read_mesh, read_mesh_or_points};
use semfm_geom::math::{DQuat, DVec3};
use semfm_robot::Geometry;
use serde::{Deserialize, Serialize};

use super::write_json;
use crate::{Result, SceneContents};

/// The format that is written.
pub const FORMAT: &str = "semfm.scene/1";

/// How far the length of a quaternion may be from 1: files written with three digits pass.
const LENGTH_TOLERANCE: f64 = 1e-2;

/// Obstacles around an arm, by kind, each with a name of its own. Everything stands in the frame of the arm's base
/// link; lengths are metres. Fields that are not known are refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// `semfm.scene/1`.
    pub format: String,
    /// Boxes.
    #[serde(default)]
    pub boxes: Vec<BoxRecord>,
    /// Cylinders.
    #[serde(default)]
    pub cylinders: Vec<CylinderRecord>,
    /// Balls.
    #[serde(default)]
    pub spheres: Vec<SphereRecord>,
    /// Meshes, each in a file.
    #[serde(default)]
    pub meshes: Vec<MeshRecord>,
    /// Point clouds, each in a file.
    #[serde(default)]
    pub clouds: Vec<CloudObstacleRecord>,
    /// Planes below which all is solid.
    #[serde(default)]
    pub tables: Vec<TablePlaneRecord>,
}

/// A box around its own origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxRecord {
    /// Its name.
    pub name: String,
    /// Lengths along x, y and z.
    pub size: [f64; 3],
    /// Where its centre is.
    pub position: [f64; 3],
    /// How it is turned.
    #[serde(default = "unturned")]
    pub quaternion_xyzw: [f64; 4],
}

/// A cylinder around its own origin, along its z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CylinderRecord {
    /// Its name.
    pub name: String,
    /// Radius.
    pub radius: f64,
    /// Full length.
    pub length: f64,
    /// Where its centre is.
    pub position: [f64; 3],
    /// How it is turned.
    #[serde(default = "unturned")]
    pub quaternion_xyzw: [f64; 4],
}

/// A ball.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SphereRecord {
    /// Its name.
    pub name: String,
    /// Radius.
    pub radius: f64,
    /// Where its centre is.
    pub position: [f64; 3],
}

/// A mesh; where it is watertight, its inside is solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshRecord {
    /// Its name.
    pub name: String,
    /// Its file, in the folder of the scene or below.
    pub file: String,
    /// Metres per unit of the mesh.
    #[serde(default = "one")]
    pub scale: f64,
    /// Where its origin is.
    #[serde(default)]
    pub position: [f64; 3],
    /// How it is turned.
    #[serde(default = "unturned")]
    pub quaternion_xyzw: [f64; 4],
}

/// Observed points, in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloudObstacleRecord {
    /// Its name.
    pub name: String,
    /// Its file (PLY, PCD, …), in the folder of the scene or below.
    pub file: String,
    /// Distance that is kept from each point.
    pub margin: f64,
    /// Where its origin is.
    #[serde(default)]
    pub position: [f64; 3],
    /// How it is turned.
    #[serde(default = "unturned")]
    pub quaternion_xyzw: [f64; 4],
}

/// A table: everything below a plane is solid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TablePlaneRecord {
    /// Its name.
    pub name: String,
    /// A point of the plane.
    pub point: [f64; 3],
    /// Away from the table, at any length.
    #[serde(default = "upwards")]
    pub normal: [f64; 3],
}

fn unturned() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn upwards() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn one() -> f64 {
    1.0
}

impl Default for BoxRecord {
    fn default() -> Self {
        let (name, size, position) = (String::new(), [0.0; 3], [0.0; 3]);
        Self { name, size, position, quaternion_xyzw: unturned() }
    }
}

impl SceneFile {
    /// A scene without anything.
    pub fn new() -> Self {
        Self { format: FORMAT.into(), ..Self::default() }
    }

    /// Reads the file alone, not what it names.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is not of this form (an unknown field, too),
    /// [`Error::Format`](crate::Error::Format) for another format.
    pub fn read(path: &Path) -> Result<Self> {
        let file: Self = read_json(path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        Ok(file)
    }

    /// Its JSON.
    pub fn to_json(&self) -> serde_json::Value {
        super::to_json(self)
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }

    /// The scene, meshes and clouds read from the folder of `path`, where this file is or will be.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) with the place at fault: numbers that are not finite, negative lengths,
    /// a quaternion whose length is not 1, a file outside the folder. [`Error::Geom`](crate::Error::Geom) for a mesh or
    /// cloud that cannot be read, [`Error::Motion`](crate::Error::Motion) for a name that occurs twice.
    pub fn contents(&self, path: &Path) -> Result<SceneContents> {
        let mut reading = Reading { path, contents: SceneContents::new() };
        for (i, record) in self.boxes.iter().enumerate() {
            let at = reading.pose(("boxes", i), record.position, record.quaternion_xyzw)?;
            let size = DVec3::from_array(record.size);
            reading.primitive(("boxes", i), &record.name, Geometry::Box { size }, at)?;
        }
        for (i, record) in self.cylinders.iter().enumerate() {
            let at = reading.pose(("cylinders", i), record.position, record.quaternion_xyzw)?;
            let shape = Geometry::Cylinder { radius: record.radius, length: record.length };
            reading.primitive(("cylinders", i), &record.name, shape, at)?;
        }
        for (i, record) in self.spheres.iter().enumerate() {
            let at = reading.pose(("spheres", i), record.position, unturned())?;
            let shape = Geometry::Sphere { radius: record.radius };
            reading.primitive(("spheres", i), &record.name, shape, at)?;
        }
        for (i, record) in self.meshes.iter().enumerate() {
            let at = reading.pose(("meshes", i), record.position, record.quaternion_xyzw)?;
            reading.mesh(i, record, at)?;
        }
        for (i, record) in self.clouds.iter().enumerate() {
            let at = reading.pose(("clouds", i), record.position, record.quaternion_xyzw)?;
            reading.cloud(i, record, at)?;
        }
        for TablePlaneRecord { name, point, normal } in &self.tables {
            let [point, normal] = [*point, *normal].map(DVec3::from_array);
            reading.add(|contents| contents.with_table(name, point, normal))?;
        }
        Ok(reading.contents)
    }
}

/// Reads a scene with the meshes and clouds that it names.
///
/// # Errors
/// As [`SceneFile::read`] and [`SceneFile::contents`].
pub fn read_scene(path: &Path) -> Result<SceneContents> {
    SceneFile::read(path)?.contents(path)
}

/// What was read so far.
struct Reading<'a> {
    path: &'a Path,
    contents: SceneContents,
}

impl Reading<'_> {
    fn pose(
        &self,
        (list, i): (&str, usize),
        position: [f64; 3],
        quaternion: [f64; 4],
    ) -> Result<Pose> {
        let turn = DQuat::from_array(quaternion);
        let position = DVec3::from_array(position);
        let is_sound = (turn.length() - 1.0).abs() <= LENGTH_TOLERANCE && position.is_finite();
        if !is_sound {
            let place = format!("{list}[{i}]");
            let expected = "a finite position and a quaternion of length 1";
            let found = format!("{position} and {turn}");
            return Err(FormatError::new(self.path, place, expected, found).into());
        }
        Ok(Pose::from_parts(position, turn.normalize()))
    }

    fn primitive(
        &mut self,
        (list, i): (&str, usize),
        name: &str,
        shape: Geometry,
        at: Pose,
    ) -> Result<()> {
        let sizes = match shape {
            Geometry::Box { size } => size.to_array(),
            Geometry::Cylinder { radius, length } => [radius, length, 0.0],
            Geometry::Sphere { radius } => [radius, 0.0, 0.0],
            _ => [0.0; 3],
        };
        if let Some(size) = sizes.iter().find(|size| !(**size >= 0.0 && size.is_finite())) {
            let (place, expected) = (format!("{list}[{i}]"), "finite lengths of at least 0");
            return Err(FormatError::new(self.path, place, expected, size.to_string()).into());
        }
        self.add(|contents| contents.with_primitive(name, &shape, at))
    }

    fn mesh(&mut self, i: usize, record: &MeshRecord, at: Pose) -> Result<()> {
        let mesh = read_mesh(self.file(&format!("meshes[{i}]"), &record.file)?)?.mesh;
        self.add(|contents| contents.with_mesh(&record.name, &mesh, record.scale, at))
    }

    fn cloud(&mut self, i: usize, record: &CloudObstacleRecord, at: Pose) -> Result<()> {
        let points = match read_mesh_or_points(self.file(&format!("clouds[{i}]"), &record.file)?)? {
            MeshOrPoints::Points(cloud) => cloud.points,
            // A mesh may stand for its vertices.
            MeshOrPoints::Mesh(file) => file.mesh.vertices().to_vec(),
        };
        self.add(|contents| contents.with_cloud(&record.name, points, record.margin, at))
    }

    /// What was read so far, with one obstacle more.
    fn add(&mut self, with: impl FnOnce(SceneContents) -> Result<SceneContents>) -> Result<()> {
        self.contents = with(std::mem::take(&mut self.contents))?;
        Ok(())
    }

    /// A file that the scene names: inside of its folder, links followed.
    fn file(&self, place: &str, name: &str) -> Result<PathBuf> {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let is_plain = Path::new(name)
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        let outside = || {
            let expected = "a file in the folder of the scene or below";
            FormatError::new(self.path, format!("{place}.file"), expected, name)
        };
        if name.is_empty() || !is_plain {
            return Err(outside().into());
        }
        let file = folder.join(name);
        // What is not there is reported by whoever reads it.
        if let (Ok(file), Ok(folder)) = (file.canonicalize(), folder.canonicalize())
            && !file.starts_with(folder)
        {
            return Err(outside().into());
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<SceneContents> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tri.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
            .unwrap();
        let path = folder.path().join("scene.json");
        std::fs::write(&path, text).unwrap();
        read_scene(&path)
    }

    #[test]
    fn every_kind_of_obstacle_is_read() {
        let contents = read(
            r#"{"format": "semfm.scene/1",
                "boxes": [{"name": "shelf", "size": [1, 0.3, 0.02], "position": [0.5, 0, 0.4]}],
                "cylinders": [{"name": "can", "radius": 0.03, "length": 0.1, "position": [0.5, 0, 0.5],
                               "quaternion_xyzw": [0, 0.7071, 0, 0.7071]}],
                "spheres": [{"name": "ball", "radius": 0.1, "position": [0, 1, 0]}],
                "meshes": [{"name": "sheet", "file": "tri.off", "scale": 0.1}],
                "clouds": [{"name": "seen", "file": "tri.off", "margin": 0.01, "position": [1, 0, 0]}],
                "tables": [{"name": "table", "point": [0, 0, -0.1]}]}"#,
        )
        .unwrap();
        let names: Vec<&str> = contents.scene.names().collect();
        assert_eq!(names, ["shelf", "can", "ball", "sheet", "seen", "table"]);
        assert_eq!(contents.obstacles.len(), 6);
        let turn = contents.obstacles[1].base_from_obstacle.rotation;
        assert!((turn.length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.json");
        let shelf = BoxRecord { name: "shelf".into(), size: [0.1; 3], ..Default::default() };
        let file = SceneFile { boxes: vec![shelf], ..SceneFile::new() };
        file.write(&path).unwrap();
        assert_eq!(SceneFile::read(&path).unwrap(), file);
    }

    #[test]
    fn faults_are_named() {
        let with = |more: &str| format!(r#"{{"format": "semfm.scene/1", {more}}}"#);
        let shelf = r#""name": "shelf", "size": [1, 1, 1], "position": [0, 0, 0]"#;
        for (text, words) in [
            (r#"{"format": "semfm.region/1"}"#.into(), "semfm.scene/1"),
            (with(r#""boxen": []"#), "boxen"),
            (with(&format!(r#""boxes": [{{{shelf}, "colour": 1}}]"#)), "colour"),
            (with(&format!(r#""boxes": [{{{}}}]"#, shelf.replace("[1,", "[-1,"))), "boxes[0]"),
            (
                with(&format!(r#""boxes": [{{{shelf}, "quaternion_xyzw": [0, 0, 0, 2]}}]"#)),
                "boxes[0]",
            ),
            (with(&format!(r#""boxes": [{{{shelf}}}, {{{shelf}}}]"#)), "shelf"),
            (with(r#""meshes": [{"name": "m", "file": "../tri.off"}]"#), "meshes[0].file"),
            (with(r#""meshes": [{"name": "m", "file": "/etc/passwd"}]"#), "meshes[0].file"),
            (with(r#""meshes": [{"name": "m", "file": "none.off"}]"#), "none.off"),
            (with(r#""meshes": [{"name": "m", "file": "tri.off", "scale": 0}]"#), "scale"),
            (with(r#""clouds": [{"name": "c", "file": "tri.off", "margin": -1}]"#), "margin"),
            (
                with(r#""tables": [{"name": "t", "point": [0, 0, 0], "normal": [0, 0, 0]}]"#),
                "normal",
            ),
        ] {
            let error = read(&text).unwrap_err();
            let mut said = error.to_string();
            let mut cause = std::error::Error::source(&error);
            while let Some(inner) = cause {
                said += &format!(": {inner}");
                cause = inner.source();
            }
            assert!(said.contains(words), "{text}: {said}");
        }
    }
}
