//! Poses of things that do not change their size, such as a camera's in the frame of a robot's base.

use std::path::Path;

use parry3d_f64::math::Pose;
use semfm_align::Sim3;
use semfm_geom::io::{FormatError, read_json};
use semfm_geom::math::{DAffine3, DMat3};
use serde::Deserialize;
use serde_json::Value;

use super::MatrixRows;
use crate::Result;

/// Farthest from 1 that the scale of a pose may be, as far as [`Sim3::from_rows`] lets rotations be from one:
/// calibrations round their numbers, and four digits pass.
const SCALE_TOLERANCE: f64 = 1e-4;

/// Reads a rigid pose: a bare 4 × 4 matrix, rows first, or an object with it in the field `name` (such as
/// `base_from_camera`).
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where the file cannot be read or is not JSON;
/// [`Error::Format`](crate::Error::Format) for what is no rotation with a translation.
pub fn read_rigid_pose(path: &Path, name: &str) -> Result<Pose> {
    let value: Value = read_json(path)?;
    let (place, rows) = match value.get(name) {
        Some(rows) => (name, rows),
        None => ("matrix", &value),
    };
    let expected = format!("a 4 × 4 matrix, or an object with it in the field `{name}`");
    let rows = MatrixRows::deserialize(rows)
        .map_err(|error| FormatError::new(path, place, expected, error.to_string()))?;
    let expected = "rows of a rotation and a translation in metres";
    let pose = rigid_pose(rows);
    Ok(pose.map_err(|found| FormatError::new(path, place, expected, found))?)
}

/// Reads where a camera stood: [`read_rigid_pose`] of `camera_from_world`.
///
/// # Errors
/// As [`read_rigid_pose`].
pub fn read_camera_pose(path: &Path) -> Result<DAffine3> {
    let pose = read_rigid_pose(path, "camera_from_world")?;
    Ok(DAffine3::from_mat3_translation(DMat3::from_quat(pose.rotation), pose.translation))
}

/// The rotation and translation of a 4 × 4 matrix, rows first, points as columns, whose scale is 1 to within 1e-4.
///
/// # Errors
/// What was found in its place, in words.
pub fn rigid_pose(rows: MatrixRows) -> std::result::Result<Pose, String> {
    let motion = Sim3::from_rows(rows).map_err(|error| error.to_string())?;
    if (motion.scale - 1.0).abs() > SCALE_TOLERANCE {
        return Err(format!("a scale of {}", motion.scale));
    }
    Ok(motion.rigid())
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DQuat;

    use super::*;

    fn read(text: &str) -> Result<Pose> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pose.json");
        std::fs::write(&path, text).unwrap();
        read_rigid_pose(&path, "base_from_camera")
    }

    const POSE: &str = "[[0,-1,0,1],[1,0,0,2],[0,0,1,0.5],[0,0,0,1]]";

    #[test]
    fn bare_and_named_matrices_are_poses() {
        let bare = read(POSE).unwrap();
        assert_eq!(bare.translation.to_array(), [1.0, 2.0, 0.5]);
        assert_eq!(read(&format!("{{\"base_from_camera\": {POSE}}}")).unwrap(), bare);
    }

    #[test]
    fn four_digits_are_enough() {
        let turn = [[0.8660, -0.5, 0.0], [0.4330, 0.75, -0.5], [0.25, 0.4330, 0.8660]];
        let pose = rigid_pose([
            [turn[0][0], turn[0][1], turn[0][2], 0.1],
            [turn[1][0], turn[1][1], turn[1][2], 0.2],
            [turn[2][0], turn[2][1], turn[2][2], 0.3],
            [0.0, 0.0, 0.0, 1.0],
        ]);
        // 30° about z, then 30° about x.
        let found = pose.unwrap().rotation;
        let half = std::f64::consts::FRAC_PI_6;
        let expected = DQuat::from_rotation_x(half) * DQuat::from_rotation_z(half);
        assert!(found.angle_between(expected) < 1e-3);
    }

    #[test]
    fn what_is_no_rigid_pose_is_refused() {
        for text in [
            POSE.replace("-1,0,1", "-2,0,1").as_str(),   // sheared
            "[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]", // scaled
            "[[1]]",
            "{\"base_from_object\": 3}",
            "{",
        ] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
