//! The pinhole camera: x right, y down, z forward, in the units of the object.

use semfm_geom::math::{DAffine3, DMat3, DVec3};

use crate::{Error, Result};

/// Largest width or height of an image, in pixels.
pub const MAX_IMAGE_SIDE: u32 = 8192;

/// How far the pose's rotation may be from orthonormal: cameras read from f32 files pass.
const ROTATION_TOLERANCE: f64 = 1e-5;

/// A pinhole camera without distortion, posed in the object's frame.
///
/// A point projects to `u = fx·x/z + cx`, `v = fy·y/z + cy` in pixels; pixel (column c, row r)
/// covers u in [c, c+1), v in [r, r+1), so its centre is at (c + ½, r + ½).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels.
    pub cx: f64,
    /// Principal point, y, in pixels.
    pub cy: f64,
    /// Rigid motion from the object's frame to the camera's.
    pub camera_from_object: DAffine3,
}

impl Camera {
    /// Checks that the camera can take pictures: sides of 1 to [`MAX_IMAGE_SIDE`] pixels, finite
    /// numbers, positive focal lengths, a rotation without mirroring. `name` leads the message.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the field.
    pub fn check(&self, name: &str) -> Result<()> {
        let refuse = |field: &str, expected: &str, found: String| {
            Err(Error::invalid(format!("{name}: {field}"), expected, found))
        };
        for (field, side) in [("width", self.width), ("height", self.height)] {
            if !(1..=MAX_IMAGE_SIDE).contains(&side) {
                return refuse(field, &format!("1 to {MAX_IMAGE_SIDE} pixels"), side.to_string());
            }
        }
        for (field, focal) in [("fx", self.fx), ("fy", self.fy)] {
            if !(focal > 0.0 && focal.is_finite()) {
                return refuse(field, "a positive focal length in pixels", focal.to_string());
            }
        }
        for (field, centre) in [("cx", self.cx), ("cy", self.cy)] {
            if !centre.is_finite() {
                return refuse(field, "a finite number of pixels", centre.to_string());
            }
        }
        if !self.camera_from_object.translation.is_finite() {
            let found = self.camera_from_object.translation.to_string();
            return refuse("position", "finite numbers", found);
        }
        let turn = self.camera_from_object.matrix3;
        let defect = (turn * turn.transpose() - DMat3::IDENTITY).to_cols_array();
        let orthonormal = defect.iter().all(|x| x.abs() <= ROTATION_TOLERANCE);
        if !(orthonormal && turn.determinant() > 0.0) {
            return refuse("pose", "a rotation (orthonormal, determinant 1)", turn.to_string());
        }
        Ok(())
    }

    /// Pixel (u, v) and depth z of a point in the object's frame; the pixel is meaningless for z ≤ 0.
    pub fn project(&self, point: DVec3) -> (f64, f64, f64) {
        let p = self.camera_from_object.transform_point3(point);
        (self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy, p.z)
    }

    /// Where the camera stands, in the object's frame.
    pub fn eye(&self) -> DVec3 {
        self.camera_from_object.inverse().translation
    }

    /// Direction (object's frame, scaled so that its depth is 1) through pixel position (u, v).
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        let direction = DVec3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0);
        self.camera_from_object.matrix3.transpose() * direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_ray_projects_back_onto_its_pixel() {
        let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.3);
        let pose = DAffine3::from_mat3_translation(turn, DVec3::new(0.1, -0.2, 3.0));
        let camera = Camera {
            width: 64,
            height: 48,
            fx: 70.0,
            fy: 71.0,
            cx: 31.0,
            cy: 25.0,
            camera_from_object: pose,
        };
        let (u, v, z) = camera.project(camera.eye() + 2.5 * camera.ray(10.5, 40.25));
        assert!((u - 10.5).abs() < 1e-9 && (v - 40.25).abs() < 1e-9 && (z - 2.5).abs() < 1e-9);
    }

    #[test]
    fn a_camera_that_cannot_see_says_why() {
        let pose = DAffine3::from_translation(DVec3::Z);
        let camera = Camera {
            width: 64,
            height: 48,
            fx: 70.0,
            fy: 71.0,
            cx: 31.0,
            cy: 25.0,
            camera_from_object: pose,
        };
        assert!(camera.check("view 0").is_ok());
        let mut mirrored = camera;
        mirrored.camera_from_object.matrix3.x_axis = -DVec3::X;
        for (broken, name) in [
            (Camera { width: 0, ..camera }, "view 3: width"),
            (Camera { height: 8193, ..camera }, "view 3: height"),
            (Camera { fx: f64::NAN, ..camera }, "view 3: fx"),
            (Camera { cy: f64::INFINITY, ..camera }, "view 3: cy"),
            (mirrored, "view 3: pose"),
        ] {
            let message = broken.check("view 3").unwrap_err().to_string();
            assert!(message.starts_with(name), "{message}");
        }
    }
}
