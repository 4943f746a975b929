//! Cameras as Foxglove's CameraCalibration and FrameTransform, there and back.

use foxglove::messages::{CameraCalibration, FrameTransform};
use semfm_geom::math::{DAffine3, DMat3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Pinhole};

use super::super::decode::Mismatch;
use super::super::topics::{OBJECT, frame};
use super::values::{timestamp, transform};

/// How far a quaternion's length, or a matrix from a rotation, may be off: f64 text and f32
/// quaternions pass, a scale of a tenth of a per mille does not.
const RIGID_TOLERANCE: f64 = 1e-5;

/// Intrinsics of a camera whose frame is `frame_id`, at `time` in nanoseconds.
pub fn camera_calibration(frame_id: String, time: u64, camera: &Pinhole) -> CameraCalibration {
    let Intrinsics { fx, fy, cx, cy, .. } = camera.intrinsics();
    CameraCalibration {
        timestamp: Some(timestamp(time)),
        frame_id,
        width: camera.width(),
        height: camera.height(),
        distortion_model: String::new(),
        d: Vec::new(),
        k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: DMat3::IDENTITY.to_cols_array().to_vec(),
        p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

/// The pose of a camera whose frame is `child` in the frame `parent` of what it sees.
pub fn camera_transform(
    parent: &str,
    child: String,
    time: u64,
    camera: &Pinhole,
) -> FrameTransform {
    let object_from_camera = camera.camera_from_world().inverse();
    let rotation = DQuat::from_mat3(&object_from_camera.matrix3).normalize();
    transform(parent, child, time, object_from_camera.translation, rotation)
}

/// `camera_from_object` of a transform that must be rigid.
pub(in super::super) fn read_transform(message: &FrameTransform) -> Result<DAffine3, Mismatch> {
    if message.parent_frame_id != OBJECT {
        let found = format!("`{}`", message.parent_frame_id);
        return Err(Mismatch::new(format!("the parent `{OBJECT}`"), found));
    }
    let translation = message.translation.unwrap_or_default();
    let translation = DVec3::new(translation.x, translation.y, translation.z);
    let rotation = message.rotation.unwrap_or_default();
    let rotation = DQuat::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w);
    let is_rigid = (rotation.length() - 1.0).abs() < RIGID_TOLERANCE && translation.is_finite();
    if !is_rigid {
        let found = format!("translation {translation}, quaternion {rotation} (xyzw)");
        return Err(Mismatch::new("a rigid transform (finite, unit quaternion)", found));
    }
    Ok(DAffine3::from_rotation_translation(rotation.normalize(), translation).inverse())
}

/// The camera of a calibration and a pose; a lens that bends rays is refused.
pub(in super::super) fn read_camera(
    message: &CameraCalibration,
    view: usize,
    camera_from_object: DAffine3,
) -> Result<Pinhole, Mismatch> {
    if message.frame_id != frame(view) {
        let found = format!("`{}`", message.frame_id);
        return Err(Mismatch::new(format!("the frame `{}`", frame(view)), found));
    }
    if message.width == 0 || message.height == 0 {
        let found = format!("{} × {}", message.width, message.height);
        return Err(Mismatch::new("a width and a height in pixels", found));
    }
    let &[fx, skew, cx, zero, fy, cy, ..] = message.k.as_slice() else {
        return Err(Mismatch::new("9 numbers in K", message.k.len().to_string()));
    };
    let is_pinhole = message.k.len() == 9
        && message.k[6..] == [0.0, 0.0, 1.0]
        && skew == 0.0
        && zero == 0.0
        && [fx, fy].iter().all(|f| f.is_finite() && *f > 0.0)
        && [cx, cy].iter().all(|c| c.is_finite());
    if !is_pinhole {
        return Err(Mismatch::new(
            "K of a pinhole camera without skew",
            format!("{:?}", message.k),
        ));
    }
    if message.d.iter().any(|&d| d != 0.0) {
        return Err(Mismatch::new("no distortion", format!("D = {:?}", message.d)));
    }
    let identity = DMat3::IDENTITY.to_cols_array();
    if !message.r.is_empty() && message.r != identity && message.r.iter().any(|&r| r != 0.0) {
        return Err(Mismatch::new("R = identity", format!("{:?}", message.r)));
    }
    let (width, height) = (message.width, message.height);
    // Foxglove's message leaves open where a pixel's centre lies; our files count as our cameras do.
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Pinhole::with_pixel_centres_at_half(intrinsics, camera_from_object)
        .map_err(|error| Mismatch::new("a pinhole camera", error.to_string()))
}
