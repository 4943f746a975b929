//! `grasps.json`: format `semfm.grasps/1`.

use std::collections::BTreeMap;
use std::path::Path;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm_align::Sim3;
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::{Mesh, MeshIdentity};
use semfm_grasp::{Grasp, GraspSettings, SurfaceReport};
use semfm_robot::{Gripper, GripperPart, Role};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::trajectory::FingerRecord;
use super::{MatrixRows, write_json};
use crate::grasp_result::{AnswerFrame, GraspResult, position_and_rotation};
use crate::motion_scene::FingerJoint;
use crate::{Error, Result, Table};

/// The format that is written.
pub const FORMAT: &str = "semfm.grasps/1";

/// Grasps as their file has them. Matrices are 4 × 4, rows first, points as columns; lengths are
/// metres; quaternions are x, y, z, w. The poses of the gripper's parts at each grasp are listed, so
/// that a grasp can be checked with nothing but this file and the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspsFile {
    /// `semfm.grasps/1`.
    pub format: String,
    /// The mesh that the grasps belong to.
    pub mesh: MeshIdentity,
    /// Metres per unit of the mesh.
    pub object_scale: f64,
    /// Where the object, scaled to metres, stands before the camera, if that is known.
    pub camera_from_object: Option<MatrixRows>,
    /// The gripper.
    pub gripper: GripperRecord,
    /// Sides of the object's box along x, y and z, metres; absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_size: Option<[f64; 3]>,
    /// The shortest of them as a share of the gripper's widest opening; absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_to_opening: Option<f64>,
    /// Where contacts were sought, if not on the mesh itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_surface: Option<WorkingSurfaceRecord>,
    /// The grasps, best first.
    pub grasps: Vec<GraspRecord>,
    /// Candidates refused, by the first thing that each failed.
    pub rejected: BTreeMap<String, usize>,
    /// Of the candidates refused for the main reason the one that missed by least.
    pub nearest_miss: Option<MissRecord>,
    /// Gripper poses examined.
    pub n_candidates: usize,
    /// Gripper poses that passed every check.
    pub n_survivors: usize,
    /// The table that the object stands on, where the program that wrote the file gave it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<TableRecord>,
    /// The settings of the search, where the program that wrote the file gave them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settings: Option<GraspSettingsRecord>,
}

/// The gripper of a [`GraspsFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GripperRecord {
    /// Its name.
    pub name: String,
    /// Least and largest distance between the pads.
    pub opening: [f64; 2],
    /// Extent of a pad along x and along z of the TCP frame.
    pub pad: [f64; 2],
    /// The TCP in the flange's frame, closed.
    pub flange_from_tcp: MatrixRows,
    /// Its rigid parts.
    pub parts: Vec<PartRecord>,
    /// The joints that open and close it, where they are known by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joints: Vec<FingerRecord>,
}

/// A rigid part of the gripper: convex hulls of point sets, in the part's own frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartRecord {
    /// The link it belongs to.
    pub link: String,
    /// What it moves with: `palm`, `left` or `right`.
    pub role: String,
    /// Corners of each convex piece.
    pub hulls: Vec<Vec<[f64; 3]>>,
}

/// One grasp of a [`GraspsFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspRecord {
    /// The TCP in the frame of the object in metres.
    pub object_from_tcp: MatrixRows,
    /// The TCP in the flange's frame at this grasp's width.
    pub flange_from_tcp: MatrixRows,
    /// The TCP in the camera's frame, where that is known.
    pub camera_from_tcp: Option<MatrixRows>,
    /// The frame of `position` and `quaternion_xyzw`.
    pub frame: AnswerFrame,
    /// Origin of the TCP.
    pub position: [f64; 3],
    /// Rotation of the TCP, w ≥ 0.
    pub quaternion_xyzw: [f64; 4],
    /// Distance between the closed pads where nothing is touched yet: the hand is free of collisions down to it.
    pub width: f64,
    /// Distance between the contacts along the closing direction: where the pads touch; absent in files of older
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_width: Option<f64>,
    /// What to command to a hand that stops at a force: below contact; absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_width: Option<f64>,
    /// Distance between the pads on the way in.
    pub opening: f64,
    /// The frame of `contacts` and `normals`: always the object's in metres.
    #[serde(default = "object_frame")]
    pub contact_frame: AnswerFrame,
    /// One contact for each pad, in the object's frame.
    pub contacts: [[f64; 3]; 2],
    /// The object's unit normal at each contact, in the object's frame.
    pub normals: [[f64; 3]; 2],
    /// The contacts in the camera's frame, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_contacts: Option<[[f64; 3]; 2]>,
    /// The normals in the camera's frame, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_normals: Option<[[f64; 3]; 2]>,
    /// Ferrari and Canny's ε.
    pub epsilon: f64,
    /// Angle by which the object turns while the pads close, radians; 0 in files of older versions.
    #[serde(default)]
    pub closing_turn: f64,
    /// The probability that the grasp holds, times what is asked beyond that; without a mass, as for .3 kg.
    pub score: f64,
    /// The probability that the grasp holds; absent where no mass was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<f64>,
    /// The terms of the score, each 0 to 1.
    pub terms: BTreeMap<String, f64>,
    /// Where the object's pose leaves something open: the share of the other poses that fit as well under
    /// which both contacts still lie on the object and in the region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pose_share: Option<f64>,
    /// Poses of the gripper's parts.
    pub hand: HandRecord,
}

/// Poses of the gripper's parts at a grasp, in the TCP's frame of the closed gripper, in the order
/// of [`GripperRecord::parts`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandRecord {
    /// At the grasp's width.
    pub closed: Vec<MatrixRows>,
    /// At the grasp's opening, the flange where it is when the fingers close.
    pub open: Vec<MatrixRows>,
}

/// The surface that contacts were sought on, where the mesh is very dense or noisy. Collisions are with the mesh itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkingSurfaceRecord {
    /// Its triangles.
    pub n_triangles: usize,
    /// Whether it has fewer triangles than the mesh. Every grasp was then examined on the mesh itself, too.
    pub simplified: bool,
    /// Deviation of the mesh's noise along the normal, metres. Above 0 contacts and normals are those of a smooth
    /// surface, and `width` is where the first points of the mesh stop the pads.
    pub noise: f64,
}

impl WorkingSurfaceRecord {
    /// `None` for the mesh itself.
    fn of(surface: &SurfaceReport) -> Option<Self> {
        let SurfaceReport { n_triangles, is_simplified: simplified, noise, .. } = *surface;
        (simplified || noise > 0.0).then_some(Self { n_triangles, simplified, noise })
    }
}

fn object_frame() -> AnswerFrame {
    AnswerFrame::Object
}

/// The candidate that failed by least.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissRecord {
    /// Name of what it failed.
    pub reason: String,
    /// The same in words.
    pub explanation: String,
    /// By how much.
    pub by: f64,
    /// Unit of `by`.
    pub unit: String,
    /// What to do about it, in words.
    #[serde(default)]
    pub advice: String,
    /// Names of the options that would change it, the likeliest first.
    #[serde(default)]
    pub options: Vec<String>,
    /// The TCP in the frame of the object in metres.
    pub object_from_tcp: MatrixRows,
}

/// A table of a [`GraspsFile`], in the frame of the object in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableRecord {
    /// A point of its top.
    pub point: [f64; 3],
    /// Unit normal, away from the table.
    pub normal: [f64; 3],
}

/// The settings of a search as `grasps.json` has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspSettingsRecord {
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// Friction coefficient between pad and object.
    pub friction: f64,
    /// Force with which each pad presses; 30 in files of older versions.
    #[serde(default = "usual_force")]
    pub grip_force: f64,
    /// Mass of the object in kilograms, where it was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Points of the region from which candidates were grown.
    pub n_samples: usize,
    /// Version of the program.
    pub version: String,
}

/// What `grip_force` was where files did not tell it.
fn usual_force() -> f64 {
    GraspSettings::default().grip_force
}

impl GraspsFile {
    /// The file of a result, without table and settings.
    pub fn new(result: &GraspResult<'_>) -> Self {
        let found = result.found;
        let rejected =
            found.rejected.iter().map(|(reason, count)| (reason.name().to_owned(), count));
        Self {
            format: FORMAT.into(),
            mesh: MeshIdentity::of(result.mesh),
            object_scale: result.object_scale,
            camera_from_object: result.camera_from_object.map(rows),
            gripper: GripperRecord::new(result.gripper),
            object_size: Some(result.size().sides),
            size_to_opening: Some(result.size_to_opening()),
            working_surface: WorkingSurfaceRecord::of(&found.surface),
            grasps: found.grasps.iter().map(|grasp| GraspRecord::new(result, grasp)).collect(),
            rejected: rejected.collect(),
            nearest_miss: found.nearest_miss.as_ref().map(|miss| MissRecord {
                reason: miss.reason.name().into(),
                explanation: miss.reason.explanation().into(),
                by: miss.by,
                unit: miss.reason.unit().into(),
                advice: miss.reason.advice().into(),
                options: miss.reason.options().iter().map(|&name| name.to_owned()).collect(),
                object_from_tcp: rows(miss.grasp.object_from_tcp),
            }),
            n_candidates: found.n_candidates,
            n_survivors: found.n_survivors,
            table: None,
            settings: None,
        }
    }

    /// With the table that the object stands on, in its frame, metres.
    pub fn with_table(mut self, table: Option<Table>) -> Self {
        self.table = table.map(|Table { point, normal }| TableRecord {
            point: point.to_array(),
            normal: normal.to_array(),
        });
        self
    }

    /// With what [`GraspProblem::shares_of_poses`](crate::GraspProblem::shares_of_poses) tells of each
    /// grasp.
    pub fn with_pose_shares(mut self, shares: &[f64]) -> Self {
        for (grasp, &share) in self.grasps.iter_mut().zip(shares) {
            grasp.pose_share = Some(share);
        }
        self
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

    /// Reads the grasps of `mesh`.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not of this format,
    /// [`Error::Format`](crate::Error::Format) for another format, another mesh, a scale that is not
    /// positive, and a hand with other poses than one for each part.
    pub fn read(path: &Path, mesh: &Mesh) -> Result<Self> {
        let file = Self::read_alone(path)?;
        file.mesh.check(mesh).map_err(|error| error.in_file(path))?;
        Ok(file)
    }

    /// Reads grasps of a mesh that is not at hand.
    ///
    /// # Errors
    /// As [`GraspsFile::read`], but for the mesh.
    pub fn read_alone(path: &Path) -> Result<Self> {
        let file: Self = read_json(path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        if !(file.object_scale > 0.0 && file.object_scale.is_finite()) {
            let found = file.object_scale.to_string();
            return Err(FormatError::new(path, "object_scale", "a positive number", found).into());
        }
        let n_parts = file.gripper.parts.len();
        for (i, grasp) in file.grasps.iter().enumerate() {
            for (name, poses) in [("closed", &grasp.hand.closed), ("open", &grasp.hand.open)] {
                if poses.len() != n_parts {
                    let place = format!("grasps[{i}].hand.{name}");
                    let expected = format!("{n_parts} poses, one for each part of the gripper");
                    let found = poses.len().to_string();
                    return Err(FormatError::new(path, place, expected, found).into());
                }
            }
        }
        Ok(file)
    }
}

impl GraspsFile {
    /// Where the object stood before the camera.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the grasps were not found before a camera, or the pose is none.
    pub fn camera_pose(&self) -> Result<Pose> {
        let expected = "the pose of the object before the camera (grasp … --aligned)";
        let rows = self.camera_from_object.ok_or_else(|| {
            let found = "none: tell where the object stands with base_from_object";
            Error::invalid("camera_from_object of the grasps", expected, found)
        })?;
        let invalid = |error: semfm_align::Error| {
            Error::invalid("camera_from_object of the grasps", expected, error.to_string())
        };
        Ok(Sim3::from_rows(rows).map_err(invalid)?.rigid())
    }
}

impl GraspRecord {
    fn new(result: &GraspResult<'_>, grasp: &Grasp) -> Self {
        let (frame, pose) = (result.frame(), result.in_frame(grasp.object_from_tcp));
        let (position, rotation) = position_and_rotation(pose);
        let terms = grasp.terms.iter().map(|&(name, value)| (name.to_owned(), value));
        let gripper = result.gripper;
        Self {
            object_from_tcp: rows(grasp.object_from_tcp),
            flange_from_tcp: rows(gripper.flange_from_tcp_at(grasp.width)),
            camera_from_tcp: result.camera_from_object.map(|_| rows(pose)),
            frame,
            position: position.to_array(),
            quaternion_xyzw: rotation.to_array(),
            width: grasp.width,
            contact_width: Some(grasp.contact_width()),
            command_width: Some(result.command_width(grasp)),
            opening: grasp.opening,
            contact_frame: AnswerFrame::Object,
            contacts: grasp.contacts.map(|point| point.to_array()),
            normals: grasp.normals.map(|normal| normal.to_array()),
            camera_contacts: result
                .camera_from_object
                .map(|camera| grasp.contacts.map(|point| (camera * point).to_array())),
            camera_normals: result
                .camera_from_object
                .map(|camera| grasp.normals.map(|n| (camera.rotation * n).to_array())),
            epsilon: grasp.epsilon,
            closing_turn: grasp.closing_turn,
            score: grasp.score,
            hold: grasp.hold,
            terms: terms.collect(),
            pose_share: None,
            hand: HandRecord {
                closed: parts_at(gripper, grasp.width, grasp.width),
                open: parts_at(gripper, grasp.width, grasp.opening),
            },
        }
    }
}

/// Poses of the parts at `width`, in the TCP's frame of the gripper closed to `closed`: the robot
/// holds the flange still while the fingers close, and a linkage moves the pads along z, so the
/// open gripper has a TCP of its own, seen here from that of the closed one.
fn parts_at(gripper: &Gripper, closed: f64, width: f64) -> Vec<MatrixRows> {
    let tcp_from_tcp =
        gripper.flange_from_tcp_at(closed).inverse() * gripper.flange_from_tcp_at(width);
    let parts = gripper.parts_at(width).into_iter();
    parts.map(|posed| rows(tcp_from_tcp * posed.tcp_from_part)).collect()
}

impl GripperRecord {
    fn new(gripper: &Gripper) -> Self {
        Self {
            name: gripper.name.clone(),
            opening: [*gripper.opening.start(), *gripper.opening.end()],
            pad: gripper.pad,
            flange_from_tcp: rows(gripper.flange_from_tcp),
            parts: gripper.parts.iter().map(PartRecord::new).collect(),
            joints: FingerJoint::of(gripper).iter().map(finger_record).collect(),
        }
    }
}

fn finger_record(finger: &FingerJoint) -> FingerRecord {
    FingerRecord { joint: finger.name().into(), positions: finger.table().to_vec() }
}

impl PartRecord {
    pub(crate) fn new(part: &GripperPart) -> Self {
        let role = match part.role {
            Role::Palm => "palm",
            Role::Left => "left",
            Role::Right => "right",
        };
        let mut hulls = Vec::new();
        add_hulls(&*part.shape, Pose::IDENTITY, &mut hulls);
        Self { link: part.link.clone(), role: role.into(), hulls }
    }
}

/// The corners of each convex piece of a shape.
fn add_hulls(shape: &dyn Shape, pose: Pose, hulls: &mut Vec<Vec<[f64; 3]>>) {
    let corners = match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.to_trimesh().0,
        TypedShape::ConvexPolyhedron(hull) => hull.points().to_vec(),
        TypedShape::Compound(compound) => {
            for (part_pose, part) in compound.shapes() {
                add_hulls(&**part, pose * *part_pose, hulls);
            }
            return;
        }
        _ => return,
    };
    hulls.push(corners.into_iter().map(|p| (pose * p).to_array()).collect());
}

pub(super) fn rows(pose: Pose) -> MatrixRows {
    pose.to_mat4().transpose().to_cols_array_2d()
}
