//! Depth images.

use semfm_geom::Pinhole;
use semfm_geom::math::DVec3;

use crate::{Error, Result};

/// Depth along the camera's axis in metres (height × width, row-major), 0 where nothing came back.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

/// Points of a depth image in the camera's frame, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthPoints {
    /// Of the pixels inside the mask.
    pub object: Vec<DVec3>,
    /// Of the pixels outside: what else is there.
    pub context: Vec<DVec3>,
}

/// What an image covers, in tangents of the camera's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ImageBounds {
    /// Least and greatest x/z.
    pub x: [f64; 2],
    /// Least and greatest y/z.
    pub y: [f64; 2],
}

impl DepthImage {
    /// Checks the length; what is negative or not finite counts as no return (0). An image in which nothing came back
    /// ([`has_depth`](Self::has_depth)) is one, too: cameras send it now and then.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the array does not fit the size.
    pub fn new(width: usize, height: usize, mut depth: Vec<f32>) -> Result<Self> {
        if width.checked_mul(height) != Some(depth.len()) || depth.is_empty() {
            let expected = format!("{width} × {height} depths, at least one");
            return Err(out_of_range("depth image", expected, depth.len()));
        }
        for z in &mut depth {
            if !(z.is_finite() && *z > 0.0) {
                *z = 0.0;
            }
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

    /// Whether anything came back.
    pub fn has_depth(&self) -> bool {
        self.depth.iter().any(|&z| z > 0.0)
    }

    /// Depth of every pixel (height × width, row-major), 0 where nothing came back.
    pub fn metres(&self) -> &[f32] {
        &self.depth
    }

    /// Depth at a column and a row; `None` where nothing came back, and outside of the image.
    pub fn at(&self, column: usize, row: usize) -> Option<f32> {
        let inside = column < self.width && row < self.height;
        inside.then(|| self.depth[row * self.width + column]).filter(|&z| z > 0.0)
    }

    /// The points of the pixels that have a depth, in the camera's frame. The camera's own pose
    /// plays no part. Without a mask every pixel shows the object.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a camera of another size, a mask of another size, or one under which
    /// no pixel has a depth, and for an image without any.
    pub fn points(&self, camera: &Pinhole, mask: Option<&[bool]>) -> Result<DepthPoints> {
        if [camera.width() as usize, camera.height() as usize] != [self.width, self.height] {
            let expected = format!("{} × {} pixels, as the depth image", self.width, self.height);
            let found = format!("{} × {}", camera.width(), camera.height());
            return Err(out_of_range("camera", expected, found));
        }
        if let Some(mask) = mask.filter(|mask| mask.len() != self.depth.len()) {
            let expected = format!("{} pixels, as the depth image", self.depth.len());
            return Err(out_of_range("mask", expected, mask.len()));
        }
        if !self.has_depth() {
            let found = format!("{} pixels without", self.depth.len());
            return Err(out_of_range("depth image", "at least one pixel with a depth", found));
        }
        let mut points = DepthPoints { object: Vec::new(), context: Vec::new() };
        for (pixel, &z) in self.depth.iter().enumerate().filter(|(_, z)| **z > 0.0) {
            let (column, row) = ((pixel % self.width) as f64, (pixel / self.width) as f64);
            let point = f64::from(z) * camera.ray_in_camera(column + 0.5, row + 0.5);
            if mask.is_none_or(|mask| mask[pixel]) {
                points.object.push(point);
            } else {
                points.context.push(point);
            }
        }
        if points.object.is_empty() {
            let expected = "at least one pixel with a depth under the mask";
            return Err(out_of_range("mask", expected, "none"));
        }
        Ok(points)
    }

    /// What the image covers.
    pub(crate) fn bounds(&self, camera: &Pinhole) -> ImageBounds {
        let low = camera.ray_in_camera(0.0, 0.0);
        let high = camera.ray_in_camera(self.width as f64, self.height as f64);
        ImageBounds { x: [low.x, high.x], y: [low.y, high.y] }
    }
}

impl ImageBounds {
    /// Whether a point of the camera's frame projects into the image; false for NaN.
    pub fn contains(&self, point: DVec3) -> bool {
        let (x, y) = (point.x / point.z, point.y / point.z);
        x >= self.x[0] && x <= self.x[1] && y >= self.y[0] && y <= self.y[1]
    }
}

fn out_of_range(what: &'static str, expected: impl Into<String>, found: impl ToString) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found: found.to_string() }
}

#[cfg(test)]
mod tests {
    use semfm_geom::Intrinsics;
    use semfm_geom::math::DAffine3;

    use super::*;

    /// As a calibration tool gives it: the centre of the first pixel is at (0, 0).
    fn camera(width: u32, height: u32) -> Pinhole {
        let intrinsics = Intrinsics { width, height, fx: 100.0, fy: 110.0, cx: 1.0, cy: 0.5 };
        Pinhole::with_pixel_centres_at_integers(intrinsics, DAffine3::IDENTITY).unwrap()
    }

    #[test]
    fn pixels_become_points_and_the_mask_parts_them() {
        let image = DepthImage::new(3, 2, vec![0.0, 1.0, 2.0, f32::NAN, -1.0, 0.5]).unwrap();
        let mask = [true, true, false, true, true, true];
        let points = image.points(&camera(3, 2), Some(&mask)).unwrap();
        assert_eq!(points.object.len(), 2);
        assert!(points.object[0].distance(DVec3::new(0.0, -0.5 / 110.0, 1.0)) < 1e-15);
        let context = 2.0 * DVec3::new(0.01, -0.5 / 110.0, 1.0);
        assert!(points.context[0].distance(context) < 1e-15);
    }

    #[test]
    fn the_image_ends_half_a_pixel_beyond_the_outermost_centres() {
        let image = DepthImage::new(3, 2, vec![1.0; 6]).unwrap();
        let bounds = image.bounds(&camera(3, 2));
        assert!(
            (bounds.x[0] + 1.5 / 100.0).abs() < 1e-15 && (bounds.x[1] - 1.5 / 100.0).abs() < 1e-15
        );
        assert!(bounds.contains(DVec3::new(0.028, 0.0, 2.0)));
        assert!(!bounds.contains(DVec3::new(0.032, 0.0, 2.0)));
        assert!(!bounds.contains(DVec3::NAN));
    }

    #[test]
    fn images_and_masks_without_depth_are_refused() {
        let image = DepthImage::new(2, 1, vec![0.0, 1.0]).unwrap();
        let camera = camera(2, 1);
        let words = |result: Result<()>| result.unwrap_err().to_string();
        let empty = DepthImage::new(2, 1, vec![0.0, f32::NAN]).unwrap();
        assert!(image.has_depth() && !empty.has_depth());
        assert!(words(empty.points(&camera, None).map(drop)).contains("2 pixels without"));
        assert!(words(DepthImage::new(2, 2, vec![1.0; 3]).map(drop)).contains("found 3"));
        assert!(words(image.points(&camera, Some(&[true, false])).map(drop)).contains("mask"));
        assert!(words(image.points(&camera, Some(&[true; 3])).map(drop)).contains("2 pixels"));
        let other = super::tests::camera(3, 1);
        assert!(words(image.points(&other, None).map(drop)).contains("found 3 × 1"));
    }
}
