//! Depth images and the camera that took them.

use semfm_geom::math::DVec3;

use crate::{Error, Result};

/// A pinhole camera without distortion: a point projects to `u = fx·x/z + cx`, `v = fy·y/z + cy`
/// in pixels, where pixel (column c, row r) has its centre at (c, r), as calibration tools count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x, in pixels.
    pub fx: f64,
    /// Focal length along y, in pixels.
    pub fy: f64,
    /// Principal point, x, in pixels.
    pub cx: f64,
    /// Principal point, y, in pixels.
    pub cy: f64,
}

impl Intrinsics {
    /// Checks that focal lengths are positive and all numbers finite.
    ///
    /// # Errors
    /// [`Error::OutOfRange`], naming the number.
    pub fn check(&self) -> Result<()> {
        for (what, value) in [("fx", self.fx), ("fy", self.fy)] {
            if !(value > 0.0 && value.is_finite()) {
                let expected = "a positive focal length in pixels".into();
                return Err(Error::OutOfRange { what, expected, found: value.to_string() });
            }
        }
        for (what, value) in [("cx", self.cx), ("cy", self.cy)] {
            if !value.is_finite() {
                let expected = "a finite number of pixels".into();
                return Err(Error::OutOfRange { what, expected, found: value.to_string() });
            }
        }
        Ok(())
    }

    /// Direction through a pixel's centre, scaled so that its depth is 1.
    pub fn ray(&self, column: f64, row: f64) -> DVec3 {
        DVec3::new((column - self.cx) / self.fx, (row - self.cy) / self.fy, 1.0)
    }
}

/// Depth along the camera's axis in metres (height × width, row-major), 0 where nothing came back.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

impl DepthImage {
    /// Checks the length; what is negative or not finite counts as no return (0).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the array does not fit the size or holds no depth at all.
    pub fn new(width: usize, height: usize, mut depth: Vec<f32>) -> Result<Self> {
        if width.checked_mul(height) != Some(depth.len()) || depth.is_empty() {
            let expected = format!("{width} × {height} depths, at least one");
            let found = depth.len().to_string();
            return Err(Error::OutOfRange { what: "depth image", expected, found });
        }
        for z in &mut depth {
            if !(z.is_finite() && *z > 0.0) {
                *z = 0.0;
            }
        }
        if depth.iter().all(|&z| z == 0.0) {
            let expected = "at least one pixel with a depth".into();
            let found = format!("{} pixels without", depth.len());
            return Err(Error::OutOfRange { what: "depth image", expected, found });
        }
        Ok(Self { width, height, depth })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The points of the pixels that have a depth, in the camera's frame, metres: those inside the
    /// mask (the object), and those outside (what else is there).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a mask of another size, or one under which no pixel has a depth.
    pub fn points(
        &self,
        intrinsics: &Intrinsics,
        mask: Option<&[bool]>,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>)> {
        intrinsics.check()?;
        if let Some(mask) = mask.filter(|mask| mask.len() != self.depth.len()) {
            let expected = format!("{} pixels, as the depth image", self.depth.len());
            let found = mask.len().to_string();
            return Err(Error::OutOfRange { what: "mask", expected, found });
        }
        let (mut object, mut context) = (Vec::new(), Vec::new());
        for (pixel, &z) in self.depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
            let (column, row) = ((pixel % self.width) as f64, (pixel / self.width) as f64);
            let point = f64::from(z) * intrinsics.ray(column, row);
            if mask.is_none_or(|mask| mask[pixel]) { &mut object } else { &mut context }
                .push(point);
        }
        if object.is_empty() {
            let expected = "at least one pixel with a depth under the mask".into();
            return Err(Error::OutOfRange { what: "mask", expected, found: "none".into() });
        }
        Ok((object, context))
    }

    /// Tangents of what the image covers: least and greatest x/z, least and greatest y/z.
    pub(crate) fn window(&self, intrinsics: &Intrinsics) -> [f64; 4] {
        let low = intrinsics.ray(-0.5, -0.5);
        let high = intrinsics.ray(self.width as f64 - 0.5, self.height as f64 - 0.5);
        [low.x, high.x, low.y, high.y]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { fx: 100.0, fy: 110.0, cx: 1.0, cy: 0.5 };

    #[test]
    fn pixels_become_points_and_the_mask_parts_them() {
        let image = DepthImage::new(3, 2, vec![0.0, 1.0, 2.0, f32::NAN, -1.0, 0.5]).unwrap();
        let mask = [true, true, false, true, true, true];
        let (object, context) = image.points(&CAMERA, Some(&mask)).unwrap();
        assert_eq!(object.len(), 2);
        assert!(object[0].distance(DVec3::new(0.0, -0.5 / 110.0, 1.0)) < 1e-15);
        assert!(context[0].distance(2.0 * DVec3::new(0.01, -0.5 / 110.0, 1.0)) < 1e-15);
    }

    #[test]
    fn images_and_masks_without_depth_are_refused() {
        let image = DepthImage::new(2, 1, vec![0.0, 1.0]).unwrap();
        let words = |result: Result<()>| result.unwrap_err().to_string();
        assert!(words(DepthImage::new(2, 1, vec![0.0; 2]).map(drop)).contains("2 pixels without"));
        assert!(words(DepthImage::new(2, 2, vec![1.0; 3]).map(drop)).contains("found 3"));
        assert!(words(image.points(&CAMERA, Some(&[true, false])).map(drop)).contains("mask"));
        assert!(words(image.points(&CAMERA, Some(&[true; 3])).map(drop)).contains("2 pixels"));
        let flat = Intrinsics { fx: 0.0, ..CAMERA };
        assert!(words(image.points(&flat, None).map(drop)).contains("fx"));
    }
}
