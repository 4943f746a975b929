//! Distortion by a lens, and pictures without it.
//!
//! Two models are known, in the terms and the order of OpenCV (`calib3d`): Brown's (1966) with tangential terms and,
//! where there are eight coefficients, a rational radial factor; and the equidistant one of Kannala & Brandt (2006)
//! for wide angles.

use semfm_geom::Pinhole;

use crate::{Error, Result};

/// Where a lens puts a ray, as a function of where a pinhole would.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    model: Model,
    /// Beyond this radius (tangent of the angle to the axis) the model folds back, and says nothing.
    last_radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Model {
    /// k1 k2 p1 p2 k3 k4 k5 k6.
    Brown([f64; 8]),
    /// k1 k2 k3 k4.
    Equidistant([f64; 4]),
}

/// The radius up to which a model is tried: 84° off the axis.
const WIDEST: f64 = 10.0;
const RADIUS_STEPS: usize = 2000;

/// A pixel as the sampler of a picture asks for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position {
    /// Along the width; the centre of the first pixel is at ½.
    pub u: f64,
    /// Along the height.
    pub v: f64,
}

impl Distortion {
    /// Brown's model with 4, 5 or 8 coefficients in OpenCV's order: k1 k2 p1 p2, k3, k4 k5 k6 (ROS: `plumb_bob` and
    /// `rational_polynomial`). `None` where all are 0.
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of coefficients (those of a thin prism or a tilted sensor must be 0), and
    /// for what is not finite.
    pub fn brown(coefficients: &[f64]) -> Result<Option<Self>> {
        check_finite(coefficients)?;
        let (known, further) = coefficients.split_at(coefficients.len().min(8));
        if !matches!(known.len(), 0 | 4 | 5 | 8) || further.iter().any(|&x| x != 0.0) {
            let expected = "4, 5 or 8 coefficients (k1 k2 p1 p2, k3, k4 k5 k6); undistort the pictures first \
                            (OpenCV's undistort) where the lens has a thin prism or a tilted sensor";
            return Err(Error::invalid("distortion", expected, format!("{coefficients:?}")));
        }
        let mut all = [0.0; 8];
        all[..known.len()].copy_from_slice(known);
        Ok(all.iter().any(|&x| x != 0.0).then(|| Self::of(Model::Brown(all))))
    }

    /// The equidistant model with k1 … k4 (OpenCV's `fisheye`, ROS: `equidistant`).
    ///
    /// # Errors
    /// [`Error::Invalid`] for another number of coefficients and for what is not finite.
    pub fn equidistant(coefficients: &[f64]) -> Result<Self> {
        check_finite(coefficients)?;
        let Ok(all) = <[f64; 4]>::try_from(coefficients) else {
            let found = format!("{coefficients:?}");
            return Err(Error::invalid("distortion", "4 coefficients of a fisheye lens", found));
        };
        Ok(Self::of(Model::Equidistant(all)))
    }

    fn of(model: Model) -> Self {
        let mut last_radius = WIDEST;
        let mut before = 0.0;
        for step in 1..=RADIUS_STEPS {
            let radius = WIDEST * step as f64 / RADIUS_STEPS as f64;
            let distorted = radius * model.radial_factor(radius);
            if distorted <= before {
                last_radius = WIDEST * (step - 1) as f64 / RADIUS_STEPS as f64;
                break;
            }
            before = distorted;
        }
        Self { model, last_radius }
    }

    /// Where the lens puts the ray (x, y, 1); `None` beyond the angles that the model is made for.
    pub fn distort(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let radius = x.hypot(y);
        if radius > self.last_radius {
            return None;
        }
        let factor = self.model.radial_factor(radius);
        let (mut dx, mut dy) = (0.0, 0.0);
        if let Model::Brown([_, _, p1, p2, ..]) = self.model {
            // Tangential: 2 p1 xy + p2 (r² + 2x²), p1 (r² + 2y²) + 2 p2 xy.
            let r2 = radius * radius;
            dx = 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
            dy = p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        }
        Some([x * factor + dx, y * factor + dy])
    }

    /// For each pixel of the undistorted picture (row-major) the place in the distorted one, of the same intrinsics,
    /// that shows it; `None` where none does.
    pub(crate) fn sources(&self, camera: &Pinhole) -> Vec<Option<Position>> {
        let (width, height) = (camera.width(), camera.height());
        let mut sources = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height {
            for column in 0..width {
                let ray = camera.ray_in_camera(f64::from(column) + 0.5, f64::from(row) + 0.5);
                let place = self.distort([ray.x, ray.y]).map(|[x, y]| Position {
                    u: camera.fx() * x + camera.cx(),
                    v: camera.fy() * y + camera.cy(),
                });
                let on_picture = |p: &Position| {
                    p.u >= 0.0 && p.v >= 0.0 && p.u < f64::from(width) && p.v < f64::from(height)
                };
                sources.push(place.filter(on_picture));
            }
        }
        sources
    }
}

impl Model {
    /// By how much the distance from the axis grows at radius r.
    fn radial_factor(&self, r: f64) -> f64 {
        match *self {
            // (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
            Self::Brown([k1, k2, _, _, k3, k4, k5, k6]) => {
                let r2 = r * r;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                above / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            // θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) / r with r = tan θ; 1 at the axis.
            Self::Equidistant([k1, k2, k3, k4]) => {
                if r < 1e-12 {
                    return 1.0;
                }
                let angle = r.atan();
                let a2 = angle * angle;
                angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))) / r
            }
        }
    }
}

fn check_finite(coefficients: &[f64]) -> Result<()> {
    match coefficients.iter().find(|x| !x.is_finite()) {
        Some(x) => Err(Error::invalid("distortion", "finite coefficients", x)),
        None => Ok(()),
    }
}

/// The pixels of a picture (height × width, `CHANNELS` bytes each) at `sources`, between four neighbours; black where
/// nothing shows them.
pub(crate) fn sampled<const CHANNELS: usize>(
    pixels: &[[u8; CHANNELS]],
    [width, height]: [usize; 2],
    sources: &[Option<Position>],
) -> Vec<[u8; CHANNELS]> {
    let at = |column: f64, row: f64| {
        let column = column.clamp(0.0, (width - 1) as f64) as usize;
        let row = row.clamp(0.0, (height - 1) as f64) as usize;
        pixels[row * width + column]
    };
    let sample = |place: &Option<Position>| {
        let Some(Position { u, v }) = *place else { return [0; CHANNELS] };
        let (left, top) = ((u - 0.5).floor(), (v - 0.5).floor());
        let (s, t) = (u - 0.5 - left, v - 0.5 - top);
        let corners = [
            (at(left, top), (1.0 - s) * (1.0 - t)),
            (at(left + 1.0, top), s * (1.0 - t)),
            (at(left, top + 1.0), (1.0 - s) * t),
            (at(left + 1.0, top + 1.0), s * t),
        ];
        std::array::from_fn(|c| {
            let sum: f64 = corners.iter().map(|(pixel, weight)| f64::from(pixel[c]) * weight).sum();
            sum.round() as u8
        })
    };
    sources.iter().map(sample).collect()
}

/// The values (height × width) of the pixels that hold `sources`: depths and masks are not mixed with their neighbours.
pub(crate) fn picked<T: Copy>(
    values: &[T],
    width: usize,
    sources: &[Option<Position>],
    nothing: T,
) -> Vec<T> {
    let pick = |place: &Option<Position>| match *place {
        Some(Position { u, v }) => values[v as usize * width + u as usize],
        None => nothing,
    };
    sources.iter().map(pick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::Intrinsics;
    use semfm_geom::math::DAffine3;

    fn close(found: [f64; 2], expected: [f64; 2]) -> bool {
        (0..2).all(|i| (found[i] - expected[i]).abs() < 1e-12)
    }

    #[test]
    fn rays_go_where_opencv_puts_them() {
        // Worked out by hand for (0.3, -0.2): r² = .13.
        let brown = Distortion::brown(&[0.1, -0.05, 0.01, -0.02, 0.002]).unwrap().unwrap();
        let factor = 1.0 + 0.1 * 0.13 - 0.05 * 0.0169 + 0.002 * 0.002197;
        let expected = [
            0.3 * factor + 2.0 * 0.01 * -0.06 - 0.02 * (0.13 + 0.18),
            -0.2 * factor + 0.01 * (0.13 + 0.08) + 2.0 * -0.02 * -0.06,
        ];
        assert!(close(brown.distort([0.3, -0.2]).unwrap(), expected));
        let fisheye = Distortion::equidistant(&[0.0; 4]).unwrap();
        assert!(close(fisheye.distort([1.0, 0.0]).unwrap(), [std::f64::consts::FRAC_PI_4, 0.0]));
        assert!(close(fisheye.distort([0.0, 0.0]).unwrap(), [0.0, 0.0]));
        assert!(Distortion::brown(&[0.0; 5]).unwrap().is_none());
    }

    #[test]
    fn a_model_says_nothing_beyond_where_it_folds() {
        // r (1 − r²/3) has its maximum at r = 1.
        let folding = Distortion::brown(&[-1.0 / 3.0, 0.0, 0.0, 0.0]).unwrap().unwrap();
        assert!(folding.distort([0.9, 0.0]).is_some() && folding.distort([1.1, 0.0]).is_none());
    }

    #[test]
    fn other_lenses_are_refused() {
        assert!(Distortion::brown(&[0.1, 0.1]).is_err());
        assert!(Distortion::brown(&[0.1; 12]).is_err());
        assert!(Distortion::brown(&[0.1, 0.0, 0.0, f64::NAN]).is_err());
        assert!(Distortion::equidistant(&[0.1; 5]).is_err());
    }

    #[test]
    fn a_straight_line_seen_through_the_lens_is_straight_again() {
        let intrinsics =
            Intrinsics { width: 200, height: 150, fx: 120.0, fy: 125.0, cx: 99.0, cy: 76.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let lens = Distortion::brown(&[-0.25, 0.06, 0.001, -0.002]).unwrap().unwrap();
        // What the lens shows of a world that is marked where y > .2 + .3 x: the inverse by fixed point.
        let marked: Vec<bool> = (0..200 * 150)
            .map(|i| {
                let ray = camera.ray_in_camera(f64::from(i % 200) + 0.5, f64::from(i / 200) + 0.5);
                let mut world = [ray.x, ray.y];
                for _ in 0..100 {
                    let seen = lens.distort(world).unwrap_or([ray.x, ray.y]);
                    world = [world[0] + ray.x - seen[0], world[1] + ray.y - seen[1]];
                }
                world[1] > 0.2 + 0.3 * world[0]
            })
            .collect();
        let sources = lens.sources(&camera);
        let straight = picked(&marked, 200, &sources, false);
        let mut n_wrong = 0;
        for i in 0..200 * 150 {
            let ray = camera.ray_in_camera(f64::from(i % 200) + 0.5, f64::from(i / 200) + 0.5);
            let distance = 120.0 * (ray.y - 0.2 - 0.3 * ray.x) / 1.09f64.sqrt();
            let is_seen = sources[i as usize].is_some();
            if is_seen && distance.abs() > 1.5 && straight[i as usize] != (distance > 0.0) {
                n_wrong += 1;
            }
        }
        assert_eq!(n_wrong, 0);
        let grey: Vec<[u8; 1]> = marked.iter().map(|&m| [if m { 200 } else { 0 }]).collect();
        let grey = sampled(&grey, [200, 150], &sources);
        assert!(grey.iter().zip(&straight).filter(|(g, m)| (g[0] > 100) != **m).count() < 200);
    }
}
