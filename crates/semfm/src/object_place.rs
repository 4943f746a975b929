//! Where an object stands before an arm, as callers tell it.

use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3};

use crate::files::GraspsFile;
use crate::{Error, Result};

/// Where an object stands, told in either way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectPlace {
    /// The object, in metres, in the frame of the arm's base.
    Object(Pose),
    /// The camera that the grasps were found with, in the frame of the arm's base.
    Camera(Pose),
}

impl ObjectPlace {
    /// Where the object of some grasps stands in the frame of the arm's base.
    ///
    /// # Errors
    /// As [`GraspsFile::camera_pose`], where the camera's place was told.
    pub fn base_from_object(&self, grasps: &GraspsFile) -> Result<Pose> {
        match *self {
            Self::Object(base_from_object) => Ok(base_from_object),
            Self::Camera(base_from_camera) => Ok(base_from_camera * grasps.camera_pose()?),
        }
    }
}

/// As far from 1 a quaternion's length may be: written with four digits, a unit quaternion is this close to one.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// A pose of 6 or 7 numbers: x, y, z in metres, then a quaternion x, y, z, w, or roll, pitch and yaw in radians about the
/// fixed axes x, y, z.
///
/// # Errors
/// [`Error::Invalid`] for another count, a number that is not finite, and a quaternion whose length is not 1.
pub fn pose_of_numbers(numbers: &[f64]) -> Result<Pose> {
    let invalid = |expected: &str, found: String| Error::invalid("pose", expected, found);
    if numbers.iter().any(|x| !x.is_finite()) {
        return Err(invalid("finite numbers", format!("{numbers:?}")));
    }
    let (position, rotation) = match *numbers {
        [x, y, z, roll, pitch, yaw] => {
            let about_z = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch);
            ([x, y, z], about_z * DQuat::from_rotation_x(roll))
        }
        [x, y, z, qx, qy, qz, qw] => {
            let quaternion = DQuat::from_xyzw(qx, qy, qz, qw);
            if (quaternion.length() - 1.0).abs() > LENGTH_TOLERANCE {
                return Err(invalid("a quaternion of length 1", quaternion.length().to_string()));
            }
            ([x, y, z], quaternion.normalize())
        }
        _ => return Err(invalid("6 or 7 numbers", numbers.len().to_string())),
    };
    Ok(Pose::from_parts(DVec3::from_array(position), rotation))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn numbers_are_poses_by_quaternion_and_by_angles() {
        let half = 0.5f64.sqrt();
        let by_quaternion = pose_of_numbers(&[1.0, -2.0, 3.0, half, 0.0, 0.0, half]).unwrap();
        let by_angles = pose_of_numbers(&[1.0, -2.0, 3.0, FRAC_PI_2, 0.0, 0.0]).unwrap();
        assert!((by_quaternion.inverse() * by_angles).rotation.xyz().length() < 1e-12);
        assert_eq!(by_angles.translation, DVec3::new(1.0, -2.0, 3.0));
        for wrong in [&[0.0; 5][..], &[0.0; 7], &[f64::NAN; 6], &[0.0; 8]] {
            assert!(pose_of_numbers(wrong).is_err(), "{wrong:?}");
        }
    }
}
