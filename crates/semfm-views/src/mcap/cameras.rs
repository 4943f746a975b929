//! Gathers the cameras of a file from its `/views/NNN/camera` and `/tf` messages.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::messages::{CameraCalibration, FrameTransform};
use semfm_geom::Pinhole;
use semfm_geom::math::{DAffine3, DMat3};

use super::decode::{check_count, decode, insert_once, topic_error};
use super::messages::{read_camera, read_transform};
use super::reader::Message;
use super::topics::{TF, parse_frame, topic};
use crate::{Error, Result};

/// Calibrations and poses seen so far, by view.
#[derive(Default)]
pub(super) struct Cameras {
    calibrations: BTreeMap<usize, CameraCalibration>,
    poses: BTreeMap<usize, DAffine3>,
}

impl Cameras {
    /// Takes a camera message of a view.
    pub fn calibration(&mut self, path: &Path, view: usize, message: &Message<'_>) -> Result<()> {
        let calibration = decode(path, message, "foxglove.CameraCalibration")?;
        insert_once(&mut self.calibrations, view, calibration, path, message)
    }

    /// Takes a transform; frames that are not those of views are none of ours.
    pub fn transform(&mut self, path: &Path, message: &Message<'_>) -> Result<()> {
        let transform: FrameTransform = decode(path, message, "foxglove.FrameTransform")?;
        let Some(view) = parse_frame(&transform.child_frame_id) else { return Ok(()) };
        let pose =
            read_transform(&transform).map_err(|mismatch| mismatch.in_message(path, message))?;
        insert_once(&mut self.poses, view, pose, path, message)
    }

    /// One camera for each of the views 0 to `n_views` − 1, all of the size that the file names.
    pub fn finish(&self, path: &Path, n_views: usize, size: (u32, u32)) -> Result<Vec<Pinhole>> {
        check_count(path, "/views/NNN/camera", n_views, self.calibrations.len())?;
        check_count(path, TF, n_views, self.poses.len())?;
        (0..n_views).map(|view| self.camera(path, view, size)).collect()
    }

    /// The camera of one view.
    pub fn camera(&self, path: &Path, view: usize, size: (u32, u32)) -> Result<Pinhole> {
        let camera_topic = topic(view, "camera");
        let calibration = self
            .calibrations
            .get(&view)
            .ok_or_else(|| topic_error(path, &camera_topic, "one message", "none"))?;
        let pose = self.poses.get(&view).ok_or_else(|| {
            topic_error(path, TF, &format!("a transform of view {view:03}"), "none")
        })?;
        let camera = read_camera(calibration, view, *pose)
            .map_err(|mismatch| mismatch.on_topic(path, &camera_topic))?;
        if (camera.width(), camera.height()) != size {
            let expected = format!("{} × {} pixels, as the metadata say", size.0, size.1);
            let found = format!("{} × {}", camera.width(), camera.height());
            return Err(topic_error(path, &camera_topic, &expected, found));
        }
        Ok(camera)
    }
}

/// How far a rotation may be from orthonormal to be written: a file holds a unit quaternion, which
/// would bend what is farther off.
const WRITABLE_ROTATION: f64 = 1e-9;

/// Refuses a camera whose pose a quaternion cannot hold.
pub(super) fn check_camera(view: usize, camera: &Pinhole) -> Result<()> {
    let rotation = camera.camera_from_world().matrix3;
    let off = (rotation.transpose() * rotation) - DMat3::IDENTITY;
    let largest = off.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    if largest < WRITABLE_ROTATION {
        return Ok(());
    }
    Err(Error::Invalid {
        what: format!("camera of view {view:03}"),
        expected: format!("a rotation, orthonormal to {WRITABLE_ROTATION:e}"),
        found: rotation.to_string(),
    })
}
