//! The pinhole camera.
//!
//! Two conventions are in use for where a pixel lies. This workspace counts as renderers do: pixel
//! (column c, row r) covers u in [c, c + 1) and v in [r, r + 1), and **the centre of pixel (0, 0) is
//! at (½, ½)**. Calibration tools (OpenCV, ROS `CameraInfo`, a `K.json`) put that centre at (0, 0);
//! their principal point is converted when a camera is made of it, by the constructor whose name
//! says so. Taking one for the other moves every ray by half a pixel.

use crate::math::{DAffine3, DMat3, DVec3};
use crate::{Error, Result};

/// How far the pose's rotation may be from orthonormal: cameras read from f32 files pass.
const ROTATION_TOLERANCE: f64 = 1e-5;

/// Size and intrinsic numbers of a camera as a file or a device gives them. Where a pixel's centre
/// lies is not said here, but by the constructor of [`Pinhole`] that takes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
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
}

/// Where a camera sees a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelDepth {
    /// Position along the image's width, in pixels.
    pub u: f64,
    /// Position along the image's height, downwards, in pixels.
    pub v: f64,
    /// Depth along the camera's axis; u and v mean nothing where it is not positive.
    pub z: f64,
}

/// A pinhole camera without distortion: axes x right, y down, z forward, in the units of the world.
///
/// A point (x, y, z) of the camera's frame projects to
///
/// > u = fx·x/z + cx,  v = fy·y/z + cy
///
/// in pixels, where the centre of pixel (0, 0) is at (½, ½). The world is the frame that the camera
/// stands in: an object's in rendered views, the camera's own where the pose is the identity.
///
/// A value of this type is proof of at least one pixel, finite numbers, positive focal lengths, and
/// a pose that is a rotation and a shift.
///
/// ```
/// use semfm_geom::math::{DAffine3, DVec3};
/// use semfm_geom::{Intrinsics, Pinhole};
/// // The middle of an image of 640 × 480 pixels, as the two conventions write it.
/// let drawn = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
/// let calibrated = Intrinsics { cx: 319.5, cy: 239.5, ..drawn };
/// let camera = Pinhole::with_pixel_centres_at_half(drawn, DAffine3::IDENTITY)?;
/// assert_eq!(camera, Pinhole::with_pixel_centres_at_integers(calibrated, DAffine3::IDENTITY)?);
/// assert_eq!(camera.project(DVec3::new(0.0, 0.0, 2.0)).u, 320.0);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    intrinsics: Intrinsics,
    camera_from_world: DAffine3,
}

impl Pinhole {
    /// A camera whose numbers count as ours do: the centre of pixel (0, 0) is at (½, ½).
    ///
    /// # Errors
    /// [`Error::OutOfRange`], naming the number: a side without pixels, a focal length that is not
    /// positive, a number that is not finite, a pose that is no rotation and shift.
    pub fn with_pixel_centres_at_half(
        intrinsics: Intrinsics,
        camera_from_world: DAffine3,
    ) -> Result<Self> {
        check_intrinsics(&intrinsics)?;
        check_pose(&camera_from_world)?;
        Ok(Self { intrinsics, camera_from_world })
    }

    /// A camera whose numbers come from a calibration (OpenCV, ROS `CameraInfo`, `K.json`), in which
    /// the centre of pixel (0, 0) is at (0, 0): half a pixel is added to its principal point.
    ///
    /// # Errors
    /// As [`with_pixel_centres_at_half`](Self::with_pixel_centres_at_half): [`Error::OutOfRange`].
    pub fn with_pixel_centres_at_integers(
        intrinsics: Intrinsics,
        camera_from_world: DAffine3,
    ) -> Result<Self> {
        let (cx, cy) = (intrinsics.cx + 0.5, intrinsics.cy + 0.5);
        Self::with_pixel_centres_at_half(Intrinsics { cx, cy, ..intrinsics }, camera_from_world)
    }

    /// The same camera with another pose.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the pose is no rotation and shift.
    pub fn posed(self, camera_from_world: DAffine3) -> Result<Self> {
        check_pose(&camera_from_world)?;
        Ok(Self { camera_from_world, ..self })
    }

    /// Image width in pixels.
    pub fn width(&self) -> u32 {
        self.intrinsics.width
    }

    /// Image height in pixels.
    pub fn height(&self) -> u32 {
        self.intrinsics.height
    }

    /// Focal length along x, in pixels.
    pub fn fx(&self) -> f64 {
        self.intrinsics.fx
    }

    /// Focal length along y, in pixels.
    pub fn fy(&self) -> f64 {
        self.intrinsics.fy
    }

    /// Principal point, x, in pixels; the centre of the first pixel is at ½.
    pub fn cx(&self) -> f64 {
        self.intrinsics.cx
    }

    /// Principal point, y, in pixels; the centre of the first pixel is at ½.
    pub fn cy(&self) -> f64 {
        self.intrinsics.cy
    }

    /// Size and intrinsic numbers, with the centre of pixel (0, 0) at (½, ½).
    pub fn intrinsics(&self) -> Intrinsics {
        self.intrinsics
    }

    /// Rigid motion from the world's frame to the camera's.
    pub fn camera_from_world(&self) -> DAffine3 {
        self.camera_from_world
    }

    /// Where the camera sees a point of the world.
    pub fn project(&self, point: DVec3) -> PixelDepth {
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let p = self.camera_from_world.transform_point3(point);
        PixelDepth { u: fx * p.x / p.z + cx, v: fy * p.y / p.z + cy, z: p.z }
    }

    /// The point of the world that the camera sees at a pixel position and depth: undoes
    /// [`project`](Self::project).
    pub fn unproject(&self, PixelDepth { u, v, z }: PixelDepth) -> DVec3 {
        self.camera_from_world.inverse().transform_point3(z * self.ray_in_camera(u, v))
    }

    /// Where the camera stands, in the world's frame.
    pub fn eye(&self) -> DVec3 {
        self.camera_from_world.inverse().translation
    }

    /// Direction (world's frame, scaled so that its depth is 1) through pixel position (u, v).
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        self.camera_from_world.matrix3.transpose() * self.ray_in_camera(u, v)
    }

    /// Direction (the camera's own frame, scaled so that its depth is 1) through pixel position
    /// (u, v).
    pub fn ray_in_camera(&self, u: f64, v: f64) -> DVec3 {
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        DVec3::new((u - cx) / fx, (v - cy) / fy, 1.0)
    }
}

fn check_intrinsics(intrinsics: &Intrinsics) -> Result<()> {
    let Intrinsics { width, height, fx, fy, cx, cy } = *intrinsics;
    for (what, side) in [("camera: width", width), ("camera: height", height)] {
        if side == 0 {
            return Err(out_of_range(what, "at least 1 pixel", side.to_string()));
        }
    }
    for (what, focal) in [("camera: fx", fx), ("camera: fy", fy)] {
        if !(focal > 0.0 && focal.is_finite()) {
            let expected = "a positive focal length in pixels";
            return Err(out_of_range(what, expected, focal.to_string()));
        }
    }
    for (what, centre) in [("camera: cx", cx), ("camera: cy", cy)] {
        if !centre.is_finite() {
            return Err(out_of_range(what, "a finite number of pixels", centre.to_string()));
        }
    }
    Ok(())
}

fn check_pose(camera_from_world: &DAffine3) -> Result<()> {
    let DAffine3 { matrix3: turn, translation } = *camera_from_world;
    if !translation.is_finite() {
        return Err(out_of_range("camera: position", "finite numbers", translation.to_string()));
    }
    let defect = (turn * turn.transpose() - DMat3::IDENTITY).to_cols_array();
    let orthonormal = defect.iter().all(|x| x.abs() <= ROTATION_TOLERANCE);
    if !(orthonormal && turn.determinant() > 0.0) {
        let expected = "a rotation (orthonormal, determinant 1)";
        let rows = [0, 1, 2].map(|i| turn.row(i).to_array());
        return Err(out_of_range("camera: pose", expected, format!("the rows {rows:?}")));
    }
    Ok(())
}

fn out_of_range(what: &'static str, expected: &str, found: String) -> Error {
    Error::OutOfRange { what, expected: expected.to_owned(), found }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTRINSICS: Intrinsics =
        Intrinsics { width: 64, height: 48, fx: 70.0, fy: 71.0, cx: 31.0, cy: 25.0 };

    #[test]
    fn a_pixel_ray_projects_back_onto_its_pixel() {
        let turn = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.3);
        let pose = DAffine3::from_mat3_translation(turn, DVec3::new(0.1, -0.2, 3.0));
        let camera = Pinhole::with_pixel_centres_at_half(INTRINSICS, pose).unwrap();
        let PixelDepth { u, v, z } = camera.project(camera.eye() + 2.5 * camera.ray(10.5, 40.25));
        assert!((u - 10.5).abs() < 1e-9 && (v - 40.25).abs() < 1e-9 && (z - 2.5).abs() < 1e-9);
        let point = DVec3::new(0.3, -0.4, 0.2);
        assert!(camera.unproject(camera.project(point)).distance(point) < 1e-12);
    }

    #[test]
    fn a_calibrations_pixel_centre_is_ours_half_a_pixel_on() {
        let camera =
            Pinhole::with_pixel_centres_at_integers(INTRINSICS, DAffine3::IDENTITY).unwrap();
        // OpenCV's pixel (c, r) looks along ((c − cx)/fx, (r − cy)/fy, 1); its centre is (c + ½, r + ½) here.
        let ray = camera.ray(12.5, 7.5);
        assert_eq!(ray, DVec3::new((12.0 - 31.0) / 70.0, (7.0 - 25.0) / 71.0, 1.0));
        assert_eq!((camera.cx(), camera.cy()), (31.5, 25.5));
    }

    #[test]
    fn a_camera_that_cannot_see_says_why() {
        let pose = DAffine3::from_translation(DVec3::Z);
        assert!(Pinhole::with_pixel_centres_at_half(INTRINSICS, pose).is_ok());
        let mut mirrored = pose;
        mirrored.matrix3.x_axis = -DVec3::X;
        let lost = DAffine3::from_translation(DVec3::splat(f64::NAN));
        for (intrinsics, pose, name) in [
            (Intrinsics { width: 0, ..INTRINSICS }, pose, "camera: width"),
            (Intrinsics { height: 0, ..INTRINSICS }, pose, "camera: height"),
            (Intrinsics { fx: f64::NAN, ..INTRINSICS }, pose, "camera: fx"),
            (Intrinsics { cy: f64::INFINITY, ..INTRINSICS }, pose, "camera: cy"),
            (INTRINSICS, mirrored, "camera: pose"),
            (INTRINSICS, lost, "camera: position"),
        ] {
            let error = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap_err();
            assert!(error.to_string().starts_with(name), "{error}");
        }
        let mut turned = DAffine3::IDENTITY;
        turned.matrix3 = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(7.0, 0.0, 1.0));
        let error = Pinhole::with_pixel_centres_at_half(INTRINSICS, turned).unwrap_err();
        let rows = "[[1.0, 0.0, 7.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]";
        assert!(error.to_string().contains(rows), "{error}");
    }
}
