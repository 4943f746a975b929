//! The pinhole camera: x right, y down, z forward, in the units of the object.

use semfm_geom::math::{DAffine3, DVec3};

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
    use semfm_geom::math::DMat3;

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
}
