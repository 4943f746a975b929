//! Cameras as Foxglove's CameraCalibration and FrameTransform, there and back.
//!
//! View NNN has the frame `view_NNN`; its transform is the camera's pose in the frame `object`.

use foxglove::messages::{CameraCalibration, FrameTransform, Quaternion, Vector3};
use semfm_geom::math::{DAffine3, DMat3, DQuat, DVec3};
use semfm_geom::{Intrinsics, Pinhole};

use super::writer::timestamp;

/// The frame of the mesh file.
pub(super) const OBJECT: &str = "object";

/// Topic of all transforms.
pub(super) const TF: &str = "/tf";

/// How far a quaternion's length, or a matrix from a rotation, may be off: f64 text and f32
/// quaternions pass, a scale of a tenth of a per mille does not.
const RIGID_TOLERANCE: f64 = 1e-5;

/// `view_NNN`.
pub(super) fn frame(view: usize) -> String {
    format!("view_{view:03}")
}

/// `/views/NNN/WHAT`.
pub(super) fn topic(view: usize, what: &str) -> String {
    format!("/views/{view:03}/{what}")
}

/// The view and the last word of a topic `/views/NNN/WHAT`.
pub(super) fn parse_topic(topic: &str) -> Option<(usize, &str)> {
    let (number, what) = topic.strip_prefix("/views/")?.split_once('/')?;
    parse_number(number).map(|view| (view, what))
}

/// The view of a frame `view_NNN`.
pub(super) fn parse_frame(frame: &str) -> Option<usize> {
    parse_number(frame.strip_prefix("view_")?)
}

/// At least three digits, without zeros in front of more than three.
fn parse_number(text: &str) -> Option<usize> {
    let number = text.parse().ok()?;
    (format!("{number:03}") == text).then_some(number)
}

/// Intrinsics of a view's camera.
pub(super) fn calibration(view: usize, time: u64, camera: &Pinhole) -> CameraCalibration {
    calibration_in(frame(view), time, camera)
}

/// Intrinsics of a camera whose frame is `frame_id`.
pub(super) fn calibration_in(frame_id: String, time: u64, camera: &Pinhole) -> CameraCalibration {
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

/// The camera's pose in the object's frame.
pub(super) fn transform(view: usize, time: u64, camera: &Pinhole) -> FrameTransform {
    transform_in(OBJECT, frame(view), time, camera)
}

/// The pose of a camera, whose frame is `child`, in the object's frame `parent`.
pub(super) fn transform_in(
    parent: &str,
    child: String,
    time: u64,
    camera: &Pinhole,
) -> FrameTransform {
    let object_from_camera = camera.camera_from_world().inverse();
    let DVec3 { x, y, z } = object_from_camera.translation;
    let q = DQuat::from_mat3(&object_from_camera.matrix3).normalize();
    FrameTransform {
        timestamp: Some(timestamp(time)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child,
        translation: Some(Vector3 { x, y, z }),
        rotation: Some(Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }),
    }
}

/// What a message should have said and what it says.
pub(super) type Mismatch = (String, String);

/// `camera_from_object` of a transform that must be rigid.
pub(super) fn read_transform(message: &FrameTransform) -> Result<DAffine3, Mismatch> {
    if message.parent_frame_id != OBJECT {
        return Err((format!("the parent `{OBJECT}`"), format!("`{}`", message.parent_frame_id)));
    }
    let translation = message.translation.unwrap_or_default();
    let translation = DVec3::new(translation.x, translation.y, translation.z);
    let rotation = message.rotation.unwrap_or_default();
    let rotation = DQuat::from_xyzw(rotation.x, rotation.y, rotation.z, rotation.w);
    let is_rigid = (rotation.length() - 1.0).abs() < RIGID_TOLERANCE && translation.is_finite();
    if !is_rigid {
        let found = format!("translation {translation}, quaternion {rotation} (xyzw)");
        return Err(("a rigid transform (finite, unit quaternion)".to_owned(), found));
    }
    Ok(DAffine3::from_rotation_translation(rotation.normalize(), translation).inverse())
}

/// The camera of a calibration and a pose; a lens that bends rays is refused.
pub(super) fn read_camera(
    message: &CameraCalibration,
    view: usize,
    camera_from_object: DAffine3,
) -> Result<Pinhole, Mismatch> {
    let mismatch = |expected: &str, found: String| Err((expected.to_owned(), found));
    if message.frame_id != frame(view) {
        return mismatch(
            &format!("the frame `{}`", frame(view)),
            format!("`{}`", message.frame_id),
        );
    }
    if message.width == 0 || message.height == 0 {
        let found = format!("{} × {}", message.width, message.height);
        return mismatch("a width and a height in pixels", found);
    }
    let &[fx, skew, cx, zero, fy, cy, ..] = message.k.as_slice() else {
        return mismatch("9 numbers in K", message.k.len().to_string());
    };
    let is_pinhole = message.k.len() == 9
        && message.k[6..] == [0.0, 0.0, 1.0]
        && skew == 0.0
        && zero == 0.0
        && [fx, fy].iter().all(|f| f.is_finite() && *f > 0.0)
        && [cx, cy].iter().all(|c| c.is_finite());
    if !is_pinhole {
        return mismatch("K of a pinhole camera without skew", format!("{:?}", message.k));
    }
    if message.d.iter().any(|&d| d != 0.0) {
        return mismatch("no distortion", format!("D = {:?}", message.d));
    }
    let identity = DMat3::IDENTITY.to_cols_array();
    if !message.r.is_empty() && message.r != identity && message.r.iter().any(|&r| r != 0.0) {
        return mismatch("R = identity", format!("{:?}", message.r));
    }
    let (width, height) = (message.width, message.height);
    // Foxglove's message leaves open where a pixel's centre lies; our files count as our cameras do.
    let intrinsics = Intrinsics { width, height, fx, fy, cx, cy };
    Pinhole::with_pixel_centres_at_half(intrinsics, camera_from_object)
        .map_err(|error| ("a pinhole camera".to_owned(), error.to_string()))
}
