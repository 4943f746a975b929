//! What stands in a scene's JSON files.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::FormatError;
use semfm_geom::math::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::MM;
use crate::Result;

/// `scene_camera.json`: the camera of each image.
pub(super) type SceneCameras = BTreeMap<String, CameraRecord>;

/// `scene_gt.json`: the objects of each image.
pub(super) type SceneObjects = BTreeMap<String, Vec<ObjectRecord>>;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct CameraRecord {
    #[serde(rename = "cam_K")]
    pub k: [f64; 9],
    /// Millimetres of one unit of depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_scale: Option<f64>,
    #[serde(rename = "cam_R_w2c", skip_serializing_if = "Option::is_none")]
    pub camera_from_world_rotation: Option<[f64; 9]>,
    #[serde(rename = "cam_t_w2c", skip_serializing_if = "Option::is_none")]
    pub camera_from_world_mm: Option<[f64; 3]>,
    /// Ours: when it was, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_nanos: Option<u64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ObjectRecord {
    #[serde(rename = "cam_R_m2c")]
    pub camera_from_object_rotation: [f64; 9],
    #[serde(rename = "cam_t_m2c")]
    pub camera_from_object_mm: [f64; 3],
    pub obj_id: u32,
}

/// How far the rows of a rotation may be from orthonormal: annotations are rounded to six digits, some to four.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A motion out of its rotation (row by row) and its shift in millimetres. Rounded rotations are made orthonormal.
pub(super) fn motion(
    path: &Path,
    place: &str,
    rows: [f64; 9],
    shift_mm: [f64; 3],
) -> Result<DAffine3> {
    let rotation = DMat3::from_cols_array(&rows).transpose();
    let off = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    let is_rotation =
        off.iter().all(|x| x.abs() < ROTATION_TOLERANCE) && rotation.determinant() > 0.0;
    let shift = DVec3::from_array(shift_mm) / MM;
    if !(is_rotation && shift.is_finite()) {
        let expected = "the nine numbers of a rotation and a shift in millimetres";
        let found = format!("{rows:?} and {shift_mm:?}");
        return Err(FormatError::new(path, place, expected, found).into());
    }
    let x = rotation.x_axis.normalize();
    let y = (rotation.y_axis - x * x.dot(rotation.y_axis)).normalize();
    let turn = DMat3::from_cols(x, y, x.cross(y));
    Ok(DAffine3::from_mat3_translation(turn, shift))
}

/// The rotation row by row and the shift in millimetres.
pub(super) fn rows_and_mm(motion: &DAffine3) -> ([f64; 9], [f64; 3]) {
    (motion.matrix3.transpose().to_cols_array(), (motion.translation * MM).to_array())
}
