//! The tables of `demo.toml`. Every key that is not named here is refused; `template.toml` explains each.

use std::collections::BTreeMap;
use std::path::PathBuf;

use semfm::{Method, Rule};
use serde::{Deserialize, Serialize};

use super::values::{PoseValue, StartValue, TableValue};

/// The demonstrated object and what touched it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Demonstration {
    /// The mesh of the demonstrated object; without one the object is what the camera saw of it under the mask of its frame.
    pub mesh: Option<PathBuf>,
    /// A region that is there already.
    pub region: Option<PathBuf>,
    /// A contact in the mesh's frame and units, with `radius`.
    pub near: Option<[f64; 3]>,
    /// Geodesic radius around the contact, in the mesh's units.
    pub radius: Option<f64>,
    /// Complete what one camera saw to the part that it belongs to.
    #[serde(default)]
    pub grow: bool,
    /// Go on with a pose whose verdict is `refuse`.
    #[serde(default)]
    pub use_refused: bool,
    /// How the mesh is found in the pictures.
    #[serde(default)]
    pub align: AlignTable,
    /// What a camera saw: pictures of one grasp, which are merged.
    #[serde(default)]
    pub frames: Vec<DemonstrationFrame>,
}

/// What a camera saw of the demonstration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemonstrationFrame {
    /// The colour picture; for the page, and where there is no depth for the size of the masks.
    pub color: Option<PathBuf>,
    /// The depth image.
    pub depth: Option<PathBuf>,
    /// Units of the depth to the metre.
    pub depth_scale: Option<f64>,
    /// The camera.
    pub intrinsics: Option<PathBuf>,
    /// The mask of the object, `FILE` or `FILE#LABEL`.
    pub mask: Option<PathBuf>,
    /// How the mesh stands before the camera, where that is known.
    pub aligned: Option<PathBuf>,
    /// A guess of it, from which the search starts.
    pub init: Option<PathBuf>,
    /// The mask of the hand.
    pub hand_mask: Option<PathBuf>,
    /// A reconstructed hand.
    pub hand: Option<PathBuf>,
    /// Ids of the hand's vertices, where the file is a whole body.
    pub hand_vertices: Option<PathBuf>,
    /// The hand stands in its file as in a mirror.
    #[serde(default)]
    pub hand_mirror: bool,
    /// Focal length in pixels that the hand was made with, where it is not the camera's.
    pub hand_focal: Option<f64>,
    /// The mask of the region itself, in place of a hand.
    pub region_mask: Option<PathBuf>,
}

/// The object to act on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Its mesh; without one the object is what the camera saw of it under the mask of its frame.
    pub mesh: Option<PathBuf>,
    /// Metres per unit of the mesh, where there is no picture of it.
    pub scale: Option<f64>,
    /// How it stands before a camera, where that is known.
    pub aligned: Option<PathBuf>,
    /// Go on with a pose whose verdict is `refuse`.
    #[serde(default)]
    pub use_refused: bool,
    /// How the mesh is found in the picture.
    #[serde(default)]
    pub align: AlignTable,
    /// What a camera saw of it.
    pub frame: Option<TargetFrame>,
}

/// What a camera saw of the target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetFrame {
    /// The colour picture, for the page.
    pub color: Option<PathBuf>,
    /// The depth image.
    pub depth: Option<PathBuf>,
    /// Units of the depth to the metre.
    pub depth_scale: Option<f64>,
    /// The camera.
    pub intrinsics: Option<PathBuf>,
    /// The mask of the object.
    pub mask: Option<PathBuf>,
    /// A guess of its pose, from which the search starts.
    pub init: Option<PathBuf>,
}

/// The search for a mesh in a depth image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlignTable {
    /// Least and greatest scale, metres per unit of the mesh.
    pub scale_range: Option<[f64; 2]>,
    /// Rotations to start from where there is no guess.
    pub starts: Option<usize>,
}

/// How the region travels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TransferTable {
    /// The method.
    pub method: Method,
    /// How a map carries the region.
    pub rule: Rule,
    /// The encoder of the features; the built-in one where none is named.
    pub encoder: Option<String>,
    /// Rotations of each view that the encoder averages.
    pub rolls: Option<u32>,
    /// Embeddings of the source's views, with `target_embeddings`.
    pub source_embeddings: Option<PathBuf>,
    /// Embeddings of the target's views.
    pub target_embeddings: Option<PathBuf>,
    /// Features of the source's vertices, with `target_features`.
    pub source_features: Option<PathBuf>,
    /// Features of the target's vertices.
    pub target_features: Option<PathBuf>,
    /// Larger meshes are simplified to this many vertices; 0 keeps them all.
    pub working_vertices: Option<usize>,
    /// Eigenpairs of each shape.
    pub k: Option<usize>,
    /// Whether prepared shapes and embeddings are kept between runs.
    pub cache: bool,
}

impl Default for TransferTable {
    fn default() -> Self {
        Self {
            method: Method::default(),
            rule: Rule::default(),
            encoder: None,
            rolls: None,
            source_embeddings: None,
            target_embeddings: None,
            source_features: None,
            target_features: None,
            working_vertices: None,
            k: None,
            cache: true,
        }
    }
}

/// Grasps in the region. Places and directions are in the camera's frame where the target's pose is known, else in the
/// frame of its mesh in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspTable {
    /// A built-in gripper's name, or a URDF.
    pub gripper: String,
    /// Folders of the packages that it names.
    #[serde(default)]
    pub packages: BTreeMap<String, PathBuf>,
    /// Grasps to return.
    pub top: Option<usize>,
    /// Points of the region from which candidates are grown.
    pub samples: Option<usize>,
    /// Share of the score that grasps may give up to differ from each other.
    pub diversity: Option<f64>,
    /// Friction between pad and object.
    pub friction: Option<f64>,
    /// Mass of the object, kilograms.
    pub mass: Option<f64>,
    /// Force with which each pad presses, newtons.
    pub grip_force: Option<f64>,
    /// Least and largest distance between the closed pads, metres.
    pub width_range: Option<[f64; 2]>,
    /// Middle of the allowed directions of approach.
    pub approach: Option<[f64; 3]>,
    /// Half-angle around it, degrees.
    pub approach_cone: Option<f64>,
    /// The direction in which the demonstrator's hand came.
    pub demonstrated: Option<[f64; 3]>,
    /// Least distance of the open gripper to everything, metres.
    pub clearance: Option<f64>,
    /// Share of each pad's contact that must lie in the region.
    pub pad_in_region: Option<f64>,
    /// The table below the object.
    pub table: Option<TableValue>,
    /// Metres behind a surface that one camera saw which the gripper keeps out of; not beside a mesh whose pose is known.
    pub unseen: Option<f64>,
    /// What stands around: meshes and point clouds.
    #[serde(default)]
    pub scene: Vec<PathBuf>,
}

/// The arm that carries a grasp out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotTable {
    /// Its description.
    pub urdf: PathBuf,
    /// The chain that is meant as the arm, named states.
    pub srdf: Option<PathBuf>,
    /// Limits of its joints.
    pub limits: Option<PathBuf>,
    /// Folders of the packages that it names.
    #[serde(default)]
    pub packages: BTreeMap<String, PathBuf>,
    /// The link in whose frame poses are told.
    pub base: Option<String>,
    /// The link that the gripper's flange sits on.
    pub tip: Option<String>,
    /// The TCP of the closed hand in the frame of the tip.
    pub tip_from_tcp: Option<PoseValue>,
    /// Where the motion starts.
    pub start: Option<StartValue>,
    /// Where the camera of the target's picture stands in the frame of the base.
    pub base_from_camera: Option<PoseValue>,
    /// Where the object, in metres, stands in the frame of the base.
    pub base_from_object: Option<PoseValue>,
    /// What stands around the arm, in the frame of its base.
    #[serde(default)]
    pub scene: Vec<PathBuf>,
    /// Share of the joints' velocity limits that is used.
    pub speed: Option<f64>,
    /// The same on straight ways.
    pub line_speed: Option<f64>,
    /// Length of the straight way to the grasp, metres.
    pub approach_length: Option<f64>,
    /// Height of the straight way up, metres.
    pub lift_height: Option<f64>,
}
