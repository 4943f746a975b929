//! A hand brought to the depth that a camera measured.

use semfm_geom::math::{DAffine3, DVec3};

use super::Hand;
use crate::observation::{Mask, Observation};
use crate::{Error, Result};

/// Pixels to a cell in which the nearest point hides those behind it.
const CELL: usize = 6;
/// A point is on the visible side within this of the nearest of its cell, metres.
const VISIBLE_WITHIN: f64 = 0.01;
/// What lies this far behind the visible side of a hand is another part of the body, metres.
const HAND_DEPTH: f64 = 0.06;
/// Fewer measured points settle no depth.
const LEAST_MEASURED: usize = 10;

/// How a hand was brought to its measured depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandShift {
    /// Metres along the camera's axis.
    pub along_axis: f64,
    /// How far the measured depths differ from the moved hand (median of the differences' absolute values), metres.
    pub residual: f64,
    /// By how much the hand's width changed: far from 1, the focal length or the hand's size is wrong.
    pub scale: f64,
    /// Points that were measured.
    pub n_measured: usize,
}

impl Hand {
    /// The hand at the depth that a camera measured under its mask. Each point keeps the pixel at which it was seen, by a
    /// camera of the focal length `hand_focal` with its axis in the middle of the picture (that of the observation where
    /// none is given), and its depth relative to the others: pose estimators know a hand's shape and its place in the
    /// picture, and guess the distance, with a focal length of some thousand pixels at times.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an observation without depth, a hand behind the camera, a focal length that is not positive,
    /// and where fewer than 10 visible points have a measured depth under the mask.
    pub fn at_measured_depth(
        &self,
        seen: &Observation,
        mask: &Mask,
        hand_focal: Option<f64>,
    ) -> Result<(Self, HandShift)> {
        let depth = seen.depth().ok_or_else(|| Error::invalid("observation", "depth", "none"))?;
        let camera = seen.camera().posed(DAffine3::IDENTITY)?;
        let [width, height] = seen.size();
        if let Some(focal) = hand_focal.filter(|f| !(*f > 0.0 && f.is_finite())) {
            return Err(Error::invalid(
                "focal length of the hand",
                "a positive number of pixels",
                focal,
            ));
        }
        let pixel = |p: &DVec3| match hand_focal {
            Some(f) => [f * p.x / p.z + 0.5 * width as f64, f * p.y / p.z + 0.5 * height as f64],
            None => {
                let seen = camera.project(*p);
                [seen.u, seen.v]
            }
        };
        let visible = self.visible_points(&pixel, [width, height])?;
        let measured = |&(v, column, row): &(usize, usize, usize)| {
            let z = depth.at(column, row).filter(|_| mask.marked[row * width + column])?;
            Some(f64::from(z) - self.points[v].z)
        };
        let mut differences: Vec<f64> = visible.iter().filter_map(measured).collect();
        if differences.len() < LEAST_MEASURED {
            let expected =
                format!("at least {LEAST_MEASURED} visible points with a depth under the mask");
            let found = format!("{} of {}", differences.len(), visible.len());
            return Err(Error::invalid("depth of the hand", expected, found));
        }
        let n_measured = differences.len();
        let along_axis = median(&mut differences);
        let mut off: Vec<f64> = differences.iter().map(|d| (d - along_axis).abs()).collect();
        let residual = median(&mut off);
        let place = |p: &DVec3| {
            let [u, v] = pixel(p);
            (p.z + along_axis) * camera.ray_in_camera(u, v)
        };
        let points: Vec<DVec3> = self.points.iter().map(place).collect();
        let spread = |points: &[DVec3]| {
            let middle = points.iter().sum::<DVec3>() / points.len() as f64;
            points.iter().map(|p| (p - middle).truncate().length()).sum::<f64>()
        };
        let scale = spread(&points) / spread(&self.points).max(f64::MIN_POSITIVE);
        let moved = Self { points, ..self.clone() };
        Ok((moved, HandShift { along_axis, residual, scale, n_measured }))
    }

    /// Points on the visible side, each with its column and row.
    fn visible_points(
        &self,
        pixel: &impl Fn(&DVec3) -> [f64; 2],
        [width, height]: [usize; 2],
    ) -> Result<Vec<(usize, usize, usize)>> {
        if let Some(at) = self.points.iter().position(|p| p.z <= 0.0) {
            let expected = "a hand before the camera, z > 0 (x right, y down, z forward)";
            return Err(Error::invalid(format!("hand, point {at}"), expected, self.points[at]));
        }
        let on_picture = |(v, p): (usize, &DVec3)| {
            let [u, w] = pixel(p);
            let inside = u >= 0.0 && w >= 0.0 && u < width as f64 && w < height as f64;
            inside.then_some((v, u as usize, w as usize))
        };
        let all: Vec<(usize, usize, usize)> =
            self.points.iter().enumerate().filter_map(on_picture).collect();
        let n_across = width / CELL + 1;
        let cell = |column: usize, row: usize| row / CELL * n_across + column / CELL;
        let mut nearest = vec![f64::INFINITY; n_across * (height / CELL + 1)];
        for &(v, column, row) in &all {
            let nearest = &mut nearest[cell(column, row)];
            *nearest = nearest.min(self.points[v].z);
        }
        let is_visible = |&(v, column, row): &(usize, usize, usize)| {
            self.points[v].z <= nearest[cell(column, row)] + VISIBLE_WITHIN
        };
        Ok(all.into_iter().filter(is_visible).collect())
    }
}

/// Ids of the points that a camera sees inside a mask, or within a hand's depth behind.
pub(super) fn under_mask(hand: &Hand, seen: &Observation, mask: &Mask) -> Result<Vec<u32>> {
    let camera = seen.camera().posed(DAffine3::IDENTITY)?;
    let [width, height] = seen.size();
    let n_across = width / CELL + 1;
    let mut nearest = vec![f64::INFINITY; n_across * (height / CELL + 1)];
    let mut inside = Vec::new();
    for (v, &p) in hand.points.iter().enumerate() {
        let place = camera.project(p);
        let (u, w) = (place.u, place.v);
        let on_picture =
            place.z > 0.0 && u >= 0.0 && w >= 0.0 && u < width as f64 && w < height as f64;
        if !on_picture {
            continue;
        }
        let cell = w as usize / CELL * n_across + u as usize / CELL;
        nearest[cell] = nearest[cell].min(place.z);
        if mask.marked[w as usize * width + u as usize] {
            inside.push((v as u32, cell, place.z));
        }
    }
    let is_near = |&(_, cell, z): &(u32, usize, f64)| z <= nearest[cell] + HAND_DEPTH;
    let ids: Vec<u32> = inside.iter().filter(|entry| is_near(entry)).map(|entry| entry.0).collect();
    if ids.len() < 3 {
        return Err(Error::invalid("mask of the hand", "points of the body under it", ids.len()));
    }
    Ok(ids)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::{Intrinsics, Pinhole, zoo};

    const WIDTH: usize = 320;
    const HEIGHT: usize = 240;

    /// A ball of 8 cm at 0.6 m: how a camera sees it, and itself.
    fn scene() -> (Observation, Hand) {
        let intrinsics =
            Intrinsics { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let centre = DVec3::new(0.02, -0.03, 0.6);
        let hit = |i: usize| {
            let ray = camera.ray_in_camera((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5);
            let (a, b) = (ray.length_squared(), ray.dot(centre));
            let inside = b * b - a * (centre.length_squared() - 0.0016);
            (inside > 0.0).then(|| ((b - inside.sqrt()) / a) as f32)
        };
        let hits: Vec<Option<f32>> = (0..WIDTH * HEIGHT).map(hit).collect();
        let depth = hits.iter().map(|hit| hit.unwrap_or(1.0)).collect();
        let depth = DepthImage::new(WIDTH, HEIGHT, depth).unwrap();
        let mask = hits.iter().map(Option::is_some).collect();
        let seen =
            Observation::new(camera).with_depth(depth).unwrap().with_mask("hand", mask).unwrap();
        let ball = zoo::icosphere(3);
        let points = ball.vertices().iter().map(|p| centre + 0.04 * *p).collect();
        (seen, Hand::new(points, ball.faces().to_vec()).unwrap())
    }

    fn farthest(a: &Hand, b: &Hand) -> f64 {
        a.points().iter().zip(b.points()).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
    }

    #[test]
    fn a_hand_at_the_wrong_distance_comes_to_the_measured_one() {
        let (seen, truth) = scene();
        let mask = &seen.masks()[0];
        for off in [-0.1, 0.05, 0.3] {
            // Seen at the same pixels, but farther away: wider by as much.
            let wrong = truth.points().iter().map(|p| p * ((p.z + off) / p.z)).collect();
            let wrong = Hand::new(wrong, truth.faces().to_vec()).unwrap();
            let (moved, shift) = wrong.at_measured_depth(&seen, mask, None).unwrap();
            assert!(farthest(&moved, &truth) < 0.004, "{off}: {}", farthest(&moved, &truth));
            assert!((shift.along_axis + off).abs() < 0.003 && shift.residual < 0.003, "{shift:?}");
        }
        // HaMeR's own focal length: ten times the camera's puts the hand ten times as far, of the same size.
        let far = truth
            .points()
            .iter()
            .map(|p| DVec3::new(p.x / p.z * 6.0 / 10.0, p.y / p.z * 6.0 / 10.0, p.z + 5.4));
        let far: Vec<DVec3> =
            far.map(|p| DVec3::new(p.x * p.z / 6.0, p.y * p.z / 6.0, p.z)).collect();
        let far = Hand::new(far, truth.faces().to_vec()).unwrap();
        let (moved, shift) = far.at_measured_depth(&seen, mask, Some(3000.0)).unwrap();
        assert!(farthest(&moved, &truth) < 0.004, "{} {shift:?}", farthest(&moved, &truth));
    }

    #[test]
    fn what_cannot_be_measured_is_said() {
        let (seen, hand) = scene();
        let nowhere = Mask { name: "hand".into(), marked: vec![false; WIDTH * HEIGHT] };
        let words = |hand: &Hand, mask, focal| {
            hand.at_measured_depth(&seen, mask, focal).unwrap_err().to_string()
        };
        assert!(words(&hand, &nowhere, None).contains("0 of"));
        let behind = hand.transformed(&DAffine3::from_translation(-DVec3::Z));
        assert!(words(&behind, &seen.masks()[0], None).contains("z > 0"));
        assert!(words(&hand, &seen.masks()[0], Some(0.0)).contains("focal"));
    }

    #[test]
    fn a_mask_cuts_the_hand_from_a_body() {
        let (seen, hand) = scene();
        // A wall of points half a metre behind.
        let wall = (0..400).map(|i| {
            DVec3::new(f64::from(i % 20) / 40.0 - 0.25, f64::from(i / 20) / 40.0 - 0.25, 1.1)
        });
        let all: Vec<DVec3> = hand.points().iter().copied().chain(wall).collect();
        let body = Hand::new(all, hand.faces().to_vec()).unwrap();
        let cut = body.cut_by(&seen, &seen.masks()[0]).unwrap();
        assert!(cut.points().iter().all(|p| p.z < 0.7) && cut.points().len() > 300);
        assert!(cut.faces().len() > 500);
    }
}
