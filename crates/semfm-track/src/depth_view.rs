//! A depth image asked by points of the camera's frame.

use semfm_align::DepthImage;
use semfm_geom::Pinhole;
use semfm_geom::math::DVec3;

/// A depth image with the camera that took it, in the camera's frame.
#[derive(Clone, Copy)]
pub(crate) struct DepthView<'a> {
    pub depth: &'a DepthImage,
    focal: [f64; 2],
    middle: [f64; 2],
}

/// What was measured at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pixel {
    /// Beyond the border of the image.
    Outside,
    /// Nothing came back.
    NoReturn,
    /// Depth along the camera's axis, metres.
    Depth(f64),
}

impl<'a> DepthView<'a> {
    /// The camera must have the size of the image.
    pub fn new(depth: &'a DepthImage, camera: &Pinhole) -> Self {
        let (focal, middle) = ([camera.fx(), camera.fy()], [camera.cx(), camera.cy()]);
        Self { depth, focal, middle }
    }

    /// Pixels per metre at a depth of one metre, along x.
    pub fn focal(&self) -> f64 {
        self.focal[0]
    }

    /// Where a point is seen, in pixels; `None` behind the camera.
    pub fn project(&self, p: DVec3) -> Option<[f64; 2]> {
        let inverse = 1.0 / p.z;
        let uv = [
            self.focal[0] * p.x * inverse + self.middle[0],
            self.focal[1] * p.y * inverse + self.middle[1],
        ];
        (p.z > 1e-6).then_some(uv)
    }

    /// How a small motion of a point moves it on the image, pixels.
    pub fn image_motion(&self, p: DVec3, motion: DVec3) -> [f64; 2] {
        let inverse = 1.0 / p.z;
        [
            self.focal[0] * inverse * (motion.x - p.x * inverse * motion.z),
            self.focal[1] * inverse * (motion.y - p.y * inverse * motion.z),
        ]
    }

    /// What the pixel at a position measured.
    pub fn at(&self, [u, v]: [f64; 2]) -> Pixel {
        let (width, height) = (self.depth.width(), self.depth.height());
        if !(u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
            return Pixel::Outside;
        }
        match self.depth.metres()[v as usize * width + u as usize] {
            z if z > 0.0 => Pixel::Depth(f64::from(z)),
            _ => Pixel::NoReturn,
        }
    }

    /// The point that the pixel at a position measured, if its depth is `z`.
    pub fn point(&self, [u, v]: [f64; 2], z: f64) -> DVec3 {
        let ray = |x: f64, k: usize| (x.floor() + 0.5 - self.middle[k]) / self.focal[k];
        DVec3::new(z * ray(u, 0), z * ray(v, 1), z)
    }

    /// The nearest of the depths in the 3 × 3 pixels around a position to `z`; at an outline half a pixel decides between
    /// the object and what is behind it.
    pub fn nearest_depth(&self, at: [f64; 2], z: f64) -> Pixel {
        let mut best = self.at(at);
        let mut distance = match best {
            Pixel::Outside => return best,
            Pixel::NoReturn => f64::INFINITY,
            Pixel::Depth(depth) => (depth - z).abs(),
        };
        for k in 0..9 {
            let around = [at[0] + f64::from(k % 3 - 1), at[1] + f64::from(k / 3 - 1)];
            if let Pixel::Depth(depth) = self.at(around)
                && (depth - z).abs() < distance
            {
                (best, distance) = (Pixel::Depth(depth), (depth - z).abs());
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Intrinsics;
    use semfm_geom::math::DAffine3;

    #[test]
    fn a_pixel_is_seen_where_its_point_lies_and_a_motion_moves_it_as_predicted() {
        let intrinsics = Intrinsics { width: 4, height: 3, fx: 40.0, fy: 41.0, cx: 2.0, cy: 1.4 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let mut metres = vec![1.0f32; 12];
        (metres[5], metres[6]) = (0.0, 0.5);
        let depth = DepthImage::new(4, 3, metres).unwrap();
        let view = DepthView::new(&depth, &camera);
        assert_eq!(view.at([1.5, 1.5]), Pixel::NoReturn);
        assert_eq!(view.at([4.0, 0.5]), Pixel::Outside);
        assert_eq!(view.nearest_depth([1.5, 1.5], 0.55), Pixel::Depth(0.5));
        let p = view.point([2.2, 1.9], 0.5);
        assert!(
            view.project(p).unwrap().iter().zip([2.5, 1.5]).all(|(a, b)| (a - b).abs() < 1e-12)
        );
        let motion = DVec3::new(1e-6, -2e-6, 3e-6);
        let (a, b) = (view.project(p).unwrap(), view.project(p + motion).unwrap());
        let moved = view.image_motion(p, motion);
        assert!((0..2).all(|k| (b[k] - a[k] - moved[k]).abs() < 1e-8));
        assert!(view.project(-p).is_none());
    }
}
