//! `trajectory.json`: format `semfm.trajectory/1`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::io::{FormatError, read_file, read_json, read_mesh};
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, MeshHash, MeshIdentity};
use semfm_motion::{Segment, Trajectory};
use semfm_robot::{Geometry, Robot, RobotDescription};
use serde::{Deserialize, Serialize};

use super::grasps::{PartRecord, rows};
use super::rigid_pose::rigid_pose;
use super::trajectory_check::check_segments;
use super::{MatrixRows, write_json};
use crate::{
    Error, FingerJoint, MotionObject, MotionObstacle, MotionRobot, MotionScene, MountedHand,
    ObstacleShape, PlannedMotion, Result,
};

/// The format that is written.
pub const FORMAT: &str = "semfm.trajectory/1";

/// The file of an object's mesh that came from none, in the folder of the trajectory.
pub const OBJECT_FILE: &str = "planned_object.ply";

/// A motion as its file has it. Poses are 4 × 4 matrices, rows first, in the frame of the arm's base link; lengths are
/// metres, angles radians, times seconds. The robot's description and the object's mesh are named with their hashes,
/// relative to the file's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryFile {
    /// `semfm.trajectory/1`.
    pub format: String,
    /// The arm's joints, from base to tip.
    pub joint_names: Vec<String>,
    /// The segments in order; each begins at the time and in the state in which the one before ends.
    pub segments: Vec<Segment>,
    /// The robot.
    pub robot: MotionRobotRecord,
    /// A hand that is no part of the robot's description.
    pub hand: Option<MountedHandRecord>,
    /// What is grasped.
    pub object: Option<MotionObjectRecord>,
    /// What else stands there.
    #[serde(default)]
    pub obstacles: Vec<ObstacleRecord>,
    /// Which grasp is carried out: its place in the file of grasps, from 0.
    pub grasp: Option<usize>,
    /// What was found or assumed, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// The robot of a [`TrajectoryFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionRobotRecord {
    /// Its name.
    pub name: String,
    /// Its description (URDF), relative to the folder of the trajectory.
    pub file: String,
    /// Hash of the description's bytes, written as that of a mesh.
    pub hash: MeshHash,
    /// Folders of `package://NAME/…`, relative to the folder of the trajectory.
    #[serde(default)]
    pub packages: BTreeMap<String, String>,
    /// The link whose frame everything stands in.
    pub base: String,
    /// The last link of the arm.
    pub tip: String,
    /// Positions of joints outside the arm.
    #[serde(default)]
    pub fixed: BTreeMap<String, f64>,
    /// Joints of fingers.
    #[serde(default)]
    pub fingers: Vec<FingerRecord>,
}

/// A finger's joint of a [`MotionRobotRecord`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FingerRecord {
    /// Its name.
    pub joint: String,
    /// Distances between the pads, ascending, and positions, in pairs.
    pub positions: Vec<[f64; 2]>,
}

/// The hand of a [`TrajectoryFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MountedHandRecord {
    /// Name of the gripper.
    pub name: String,
    /// Its parts.
    pub parts: Vec<PartRecord>,
    /// Distances between the pads, ascending.
    pub openings: Vec<f64>,
    /// For each of these, the pose of each part in the frame of the arm's tip.
    pub tip_from_part: Vec<Vec<MatrixRows>>,
}

/// The object of a [`TrajectoryFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionObjectRecord {
    /// Its mesh, relative to the folder of the trajectory.
    pub file: String,
    /// Which mesh that is.
    pub mesh: MeshIdentity,
    /// Metres per unit of the mesh.
    pub scale: f64,
    /// Where it stands, scaled to metres, before it is lifted.
    pub base_from_object: MatrixRows,
}

/// An obstacle of a [`TrajectoryFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ObstacleRecord {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub base_from_obstacle: MatrixRows,
    /// Its shape.
    pub shape: ShapeRecord,
}

/// The shape of an [`ObstacleRecord`], in its own frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ShapeRecord {
    /// A box around the origin.
    Box {
        /// Lengths along x, y and z.
        size: [f64; 3],
    },
    /// A cylinder around the origin, along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// A cylinder with half spheres at its ends, along z.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length between the centres of the half spheres.
        length: f64,
    },
    /// A ball around the origin.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A surface.
    Mesh {
        /// Corners.
        vertices: Vec<[f64; 3]>,
        /// Triangles.
        faces: Vec<[u32; 3]>,
    },
    /// Observed points.
    Points {
        /// Positions.
        points: Vec<[f64; 3]>,
    },
    /// Everything below z = 0.
    HalfSpace,
}

impl TrajectoryFile {
    /// The file of a motion that will stand in `folder`. Reads the robot's description for its hash. An object without a
    /// file is named [`OBJECT_FILE`].
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where the description cannot be read; [`Error::Invalid`] for an obstacle that is the
    /// name of a mesh file.
    pub fn new(motion: &PlannedMotion, folder: &Path) -> Result<Self> {
        let MotionScene { robot, hand, object, obstacles } = &motion.scene;
        Ok(Self {
            format: FORMAT.into(),
            joint_names: motion.trajectory.joint_names.clone(),
            segments: motion.trajectory.segments.clone(),
            robot: MotionRobotRecord::new(robot, folder)?,
            hand: hand.as_ref().map(MountedHandRecord::new),
            object: object.as_ref().map(|object| MotionObjectRecord {
                file: object
                    .file
                    .as_ref()
                    .map_or_else(|| OBJECT_FILE.into(), |file| relative(file, folder)),
                mesh: MeshIdentity::of(&object.mesh),
                scale: object.scale,
                base_from_object: rows(object.base_from_object),
            }),
            obstacles: obstacles.iter().map(ObstacleRecord::new).collect::<Result<_>>()?,
            grasp: motion.grasp,
            notes: motion.notes.clone(),
        })
    }

    /// Reads a trajectory and checks it: lists of one length, finite numbers, times that rise from 0, segments that
    /// follow one another without a gap and begin and end at rest.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not of this form,
    /// [`Error::Format`](crate::Error::Format) with the place at fault.
    pub fn read(path: &Path) -> Result<Self> {
        let file: Self = read_json(path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        check_segments(path, &file.joint_names, &file.segments)?;
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
}

/// Reads `trajectory.json` with the robot and the object that it names.
///
/// # Errors
/// As [`TrajectoryFile::read`]; [`Error::Robot`](crate::Error::Robot) and [`Error::Geom`](crate::Error::Geom) where the
/// robot's description or the object's mesh cannot be read; [`Error::Format`](crate::Error::Format) where one of them is
/// another than the trajectory was made with, or lacks a joint or link that it names.
pub fn read_motion(path: &Path) -> Result<PlannedMotion> {
    let file = TrajectoryFile::read(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let robot = file.robot.read(path, folder, &file.joint_names)?;
    let hand = file.hand.map(|hand| hand.read(path)).transpose()?;
    let object = file.object.map(|object| object.read(path, folder)).transpose()?;
    let obstacles: Result<Vec<MotionObstacle>> =
        file.obstacles.into_iter().enumerate().map(|(i, o)| o.read(path, i)).collect();
    Ok(PlannedMotion {
        scene: MotionScene { robot, hand, object, obstacles: obstacles? },
        trajectory: Trajectory { joint_names: file.joint_names, segments: file.segments },
        grasp: file.grasp,
        notes: file.notes,
    })
}

impl MotionRobotRecord {
    fn new(robot: &MotionRobot, folder: &Path) -> Result<Self> {
        let links = &robot.robot.links;
        let packages = robot.packages.iter();
        Ok(Self {
            name: robot.robot.name.clone(),
            file: relative(&robot.urdf, folder),
            hash: hash_of(&read_file(&robot.urdf)?),
            packages: packages.map(|(name, at)| (name.clone(), relative(at, folder))).collect(),
            base: links[robot.base].name.clone(),
            tip: links[robot.tip].name.clone(),
            fixed: robot.fixed.clone(),
            fingers: robot
                .fingers
                .iter()
                .map(|finger| FingerRecord {
                    joint: finger.name().into(),
                    positions: finger.table().to_vec(),
                })
                .collect(),
        })
    }

    fn read(self, path: &Path, folder: &Path, joint_names: &[String]) -> Result<MotionRobot> {
        let urdf = folder.join(&self.file);
        let bytes = read_file(&urdf)?;
        let found = hash_of(&bytes);
        if found != self.hash {
            let expected = format!("{}, which the motion was planned with", self.hash);
            let found = format!("{found} in {} (plan again)", urdf.display());
            return Err(FormatError::new(path, "robot.hash", expected, found).into());
        }
        let robot = RobotDescription::parse(&bytes, &urdf)?.tree()?;
        let named = joint_names.iter().chain(self.fixed.keys());
        for name in named.chain(self.fingers.iter().map(|finger| &finger.joint)) {
            let joint = robot.joint(name);
            if !joint.is_some_and(|joint| robot.joints[joint].kind.has_position()) {
                let expected = format!("joints of {} that turn or slide", robot.name);
                return Err(FormatError::new(path, "robot", expected, format!("`{name}`")).into());
            }
        }
        let (base, tip) =
            (link(path, &robot, "base", &self.base)?, link(path, &robot, "tip", &self.tip)?);
        let fingers = self.fingers.into_iter().map(|FingerRecord { joint, positions }| {
            check_finite(path, "robot.fingers", positions.as_flattened())?;
            FingerJoint::new(&joint, positions)
                .ok_or_else(|| FormatError::new(path, "robot.fingers", "positions", "none").into())
        });
        let fixed: Vec<f64> = self.fixed.values().copied().collect();
        check_finite(path, "robot.fixed", &fixed)?;
        let packages = self.packages.into_iter();
        Ok(MotionRobot {
            fingers: fingers.collect::<Result<_>>()?,
            robot: Arc::new(robot),
            urdf,
            packages: packages.map(|(name, at)| (name, folder.join(at))).collect(),
            base,
            tip,
            fixed: self.fixed,
        })
    }
}

fn link(path: &Path, robot: &Robot, what: &str, name: &str) -> Result<usize> {
    robot.link(name).ok_or_else(|| {
        let expected = format!("a link of {}", robot.name);
        FormatError::new(path, format!("robot.{what}"), expected, format!("`{name}`")).into()
    })
}

impl MountedHandRecord {
    fn new(hand: &MountedHand) -> Self {
        let poses = hand.tip_from_part.iter();
        Self {
            name: hand.name.clone(),
            parts: hand.parts.clone(),
            openings: hand.openings.clone(),
            tip_from_part: poses.map(|poses| poses.iter().copied().map(rows).collect()).collect(),
        }
    }

    fn read(self, path: &Path) -> Result<MountedHand> {
        let n = self.parts.len();
        let is_table = self.tip_from_part.len() == self.openings.len()
            && !self.openings.is_empty()
            && self.tip_from_part.iter().all(|poses| poses.len() == n);
        if !is_table {
            let expected =
                format!("at least one opening, and for each a pose of each of {n} parts");
            let found = format!("{} openings", self.openings.len());
            return Err(FormatError::new(path, "hand.tip_from_part", expected, found).into());
        }
        check_finite(path, "hand.openings", &self.openings)?;
        for hull in self.parts.iter().flat_map(|part| &part.hulls) {
            check_finite(path, "hand.parts", hull.as_flattened())?;
        }
        let read = |rows: &MatrixRows| pose(path, "hand.tip_from_part", *rows);
        let poses = self.tip_from_part.iter().map(|poses| poses.iter().map(read).collect());
        Ok(MountedHand {
            tip_from_part: poses.collect::<Result<_>>()?,
            name: self.name,
            parts: self.parts,
            openings: self.openings,
        })
    }
}

impl MotionObjectRecord {
    fn read(self, path: &Path, folder: &Path) -> Result<MotionObject> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            let found = self.scale.to_string();
            return Err(FormatError::new(path, "object.scale", "a positive number", found).into());
        }
        let file = folder.join(&self.file);
        let mesh = read_mesh(&file)?.mesh;
        self.mesh.check(&mesh).map_err(|error| error.in_file(path))?;
        let base_from_object = pose(path, "object.base_from_object", self.base_from_object)?;
        Ok(MotionObject {
            mesh: Arc::new(mesh),
            file: Some(file),
            scale: self.scale,
            base_from_object,
        })
    }
}

impl ObstacleRecord {
    fn new(obstacle: &MotionObstacle) -> Result<Self> {
        let points = |points: &[DVec3]| points.iter().map(|p| p.to_array()).collect();
        let shape = match &obstacle.shape {
            ObstacleShape::Primitive(Geometry::Box { size }) => {
                ShapeRecord::Box { size: size.to_array() }
            }
            &ObstacleShape::Primitive(Geometry::Cylinder { radius, length }) => {
                ShapeRecord::Cylinder { radius, length }
            }
            &ObstacleShape::Primitive(Geometry::Capsule { radius, length }) => {
                ShapeRecord::Capsule { radius, length }
            }
            &ObstacleShape::Primitive(Geometry::Sphere { radius }) => {
                ShapeRecord::Sphere { radius }
            }
            ObstacleShape::Primitive(other) => {
                let what = format!("obstacle `{}`", obstacle.name);
                let found = format!("{other:?}");
                return Err(Error::invalid(what, "a primitive, or a mesh that was read", found));
            }
            ObstacleShape::Mesh(mesh) => ShapeRecord::Mesh {
                vertices: points(mesh.vertices()),
                faces: mesh.faces().to_vec(),
            },
            ObstacleShape::Points(cloud) => ShapeRecord::Points { points: points(cloud) },
            ObstacleShape::HalfSpace => ShapeRecord::HalfSpace,
        };
        let base_from_obstacle = rows(obstacle.base_from_obstacle);
        Ok(Self { name: obstacle.name.clone(), base_from_obstacle, shape })
    }

    /// The `i`-th obstacle of a file.
    fn read(self, path: &Path, i: usize) -> Result<MotionObstacle> {
        let place = format!("obstacles[{i}]");
        let numbers = self.shape.numbers();
        check_finite(path, &place, &numbers)?;
        if self.shape.is_primitive() && numbers.iter().any(|&x| x < 0.0) {
            return Err(FormatError::new(path, place, "lengths of at least 0", "less").into());
        }
        let points = |points: Vec<[f64; 3]>| points.into_iter().map(DVec3::from_array).collect();
        let shape = match self.shape {
            ShapeRecord::Box { size } => {
                ObstacleShape::Primitive(Geometry::Box { size: DVec3::from_array(size) })
            }
            ShapeRecord::Cylinder { radius, length } => {
                ObstacleShape::Primitive(Geometry::Cylinder { radius, length })
            }
            ShapeRecord::Capsule { radius, length } => {
                ObstacleShape::Primitive(Geometry::Capsule { radius, length })
            }
            ShapeRecord::Sphere { radius } => ObstacleShape::Primitive(Geometry::Sphere { radius }),
            ShapeRecord::Mesh { vertices, faces } => {
                let mesh = Mesh::new(points(vertices), faces).map_err(|error| {
                    FormatError::new(path, &place, "a sound mesh", error.to_string())
                })?;
                ObstacleShape::Mesh(Arc::new(mesh))
            }
            ShapeRecord::Points { points: cloud } => ObstacleShape::Points(points(cloud)),
            ShapeRecord::HalfSpace => ObstacleShape::HalfSpace,
        };
        let base_from_obstacle = pose(path, &place, self.base_from_obstacle)?;
        Ok(MotionObstacle { name: self.name, base_from_obstacle, shape })
    }
}

impl ShapeRecord {
    fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Box { size } => size.to_vec(),
            &Self::Cylinder { radius, length } | &Self::Capsule { radius, length } => {
                vec![radius, length]
            }
            &Self::Sphere { radius } => vec![radius],
            Self::Mesh { vertices: points, .. } | Self::Points { points } => {
                points.as_flattened().to_vec()
            }
            Self::HalfSpace => Vec::new(),
        }
    }

    fn is_primitive(&self) -> bool {
        !matches!(self, Self::Mesh { .. } | Self::Points { .. } | Self::HalfSpace)
    }
}

fn check_finite(path: &Path, place: &str, numbers: &[f64]) -> Result<()> {
    match numbers.iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(x) => Err(FormatError::new(path, place, "finite numbers", x.to_string()).into()),
    }
}

/// A rotation and a translation.
fn pose(path: &Path, place: &str, rows: MatrixRows) -> Result<Pose> {
    let expected = "rows of a rotation and a translation";
    Ok(rigid_pose(rows).map_err(|found| FormatError::new(path, place, expected, found))?)
}

fn hash_of(bytes: &[u8]) -> MeshHash {
    MeshHash(*blake3::hash(bytes).as_bytes())
}

/// A path as a file in `folder` names it: relative, with `/`; absolute where there is no way from one to the other.
pub(super) fn relative(path: &Path, folder: &Path) -> String {
    let absolute = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path));
    let (Ok(file), Ok(from)) = (absolute(path), absolute(folder)) else {
        return path.to_string_lossy().into_owned();
    };
    let parts = |path: &Path| -> Vec<PathBuf> {
        path.components().map(|part| PathBuf::from(part.as_os_str())).collect()
    };
    let (file_parts, from_parts) = (parts(&file), parts(&from));
    let n_common = file_parts.iter().zip(&from_parts).take_while(|(a, b)| a == b).count();
    let is_same_volume = n_common > 0
        && !from.components().skip(n_common).any(|part| matches!(part, Component::Prefix(_)));
    if !is_same_volume {
        return file.to_string_lossy().into_owned();
    }
    let up = std::iter::repeat_n("..".to_owned(), from_parts.len() - n_common);
    let down = file_parts[n_common..].iter().map(|part| part.to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<String>>().join("/")
}

/// Names that are not empty, each once.
pub(super) fn check_names(path: &Path, names: &[String]) -> Result<()> {
    let mut seen = BTreeSet::new();
    match names.iter().find(|name| name.is_empty() || !seen.insert(name.as_str())) {
        None if names.is_empty() => {
            Err(FormatError::new(path, "joint_names", "at least one joint", "none").into())
        }
        None => Ok(()),
        Some(name) => {
            let found = format!("`{name}`");
            Err(FormatError::new(path, "joint_names", "names, each once", found).into())
        }
    }
}
