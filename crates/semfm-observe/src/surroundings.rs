//! What a camera saw beside an object.

use std::collections::BTreeSet;

use semfm_geom::math::{DAffine3, DVec3, bounds};

use crate::merged_surface::MaskedFrame;
use crate::observation::{Mask, Observation};
use crate::surface::trimmed;
use crate::{Error, Result};

/// Pixels next to the mask that are left out: the outline of a mask is drawn to a few pixels, and a point of the object among
/// the surroundings would keep a gripper away from it.
const BESIDE_MASK: usize = 3;
/// Of all points in a cube of this side, metres, one is kept.
const SPACING: f64 = 0.004;
/// What is farther away from the object, metres, is in no gripper's way.
const FARTHEST: f64 = 0.4;

impl Observation {
    /// Points of what else the camera saw near the object under a mask (camera's frame, metres), as obstacles of grasps: at
    /// most one in each cube of 4 mm, within .4 m of the object, none of the three pixels beside the mask. None may be left.
    ///
    /// # Errors
    /// As [`points`](Observation::points).
    pub fn surroundings(&self, mask: &Mask) -> Result<Vec<DVec3>> {
        let object = self.points(Some(mask))?.object;
        let Some((low, high)) = bounds(&object) else {
            return Err(Error::invalid("mask", "at least one point under it", "none"));
        };
        let (low, high) = (low - FARTHEST, high + FARTHEST);
        // All that is not near the mask: its complement, trimmed.
        let outside: Vec<bool> = mask.marked.iter().map(|marked| !marked).collect();
        let outside = trimmed(&outside, self.size()[0], BESIDE_MASK);
        let mut cubes = BTreeSet::new();
        let kept = self.pixels_of_points()?.filter(|(pixel, p)| {
            let is_outside = pixel.is_some_and(|pixel| outside[pixel]);
            let is_near = p.cmpge(low).all() && p.cmple(high).all();
            is_outside && is_near && cubes.insert(cube(*p))
        });
        Ok(kept.map(|(_, p)| p).collect())
    }

    /// Each point that was seen, in the camera's frame, with its pixel.
    fn pixels_of_points(&self) -> Result<Box<dyn Iterator<Item = (Option<usize>, DVec3)> + '_>> {
        let camera = self.camera().posed(DAffine3::IDENTITY)?;
        let [width, height] = self.size();
        if let Some(depth) = self.depth() {
            let points = depth.metres().iter().enumerate().filter(|(_, z)| **z > 0.0);
            return Ok(Box::new(points.map(move |(pixel, &z)| {
                let (column, row) = ((pixel % width) as f64, (pixel / width) as f64);
                let ray = camera.ray_in_camera(column + 0.5, row + 0.5);
                (Some(pixel), f64::from(z) * ray)
            })));
        }
        let cloud = self.cloud().unwrap_or_default();
        Ok(Box::new(cloud.iter().map(move |&p| {
            let seen = camera.project(p);
            let on_picture = seen.z > 0.0
                && (0.0..width as f64).contains(&seen.u)
                && (0.0..height as f64).contains(&seen.v);
            (on_picture.then(|| seen.v as usize * width + seen.u as usize), p)
        })))
    }
}

/// The [surroundings](Observation::surroundings) of an object that several frames saw, in the frame in which their cameras'
/// poses are given, metres: at most one point in each cube of 4 mm, though several frames saw it. Frames without a mask of the
/// object have none.
///
/// # Errors
/// As [`Observation::surroundings`].
pub fn merged_surroundings(frames: &[MaskedFrame<'_>]) -> Result<Vec<DVec3>> {
    let (mut cubes, mut merged) = (BTreeSet::new(), Vec::new());
    for MaskedFrame { seen, mask } in frames {
        let Some(mask) = mask else { continue };
        let world_from_camera = seen.camera().camera_from_world().inverse();
        let points = seen.surroundings(mask)?;
        let points = points.into_iter().map(|p| world_from_camera.transform_point3(p));
        merged.extend(points.filter(|p| cubes.insert(cube(*p))));
    }
    Ok(merged)
}

/// The cube of [`SPACING`] that a point lies in.
fn cube(p: DVec3) -> [i64; 3] {
    (p / SPACING).floor().as_i64vec3().to_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::{Intrinsics, Pinhole};

    #[test]
    fn the_object_and_its_outline_are_no_surroundings() {
        let intrinsics =
            Intrinsics { width: 80, height: 60, fx: 80.0, fy: 80.0, cx: 40.0, cy: 30.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let is_object = |i: usize| (30..50).contains(&(i % 80)) && (20..40).contains(&(i / 80));
        let is_far = |i: usize| i % 80 < 5;
        let depth = |i: usize| {
            if is_object(i) {
                0.5
            } else if is_far(i) {
                3.0
            } else {
                0.6
            }
        };
        let depths: Vec<f32> = (0..4800).map(depth).collect();
        let seen = Observation::new(camera)
            .with_depth(DepthImage::new(80, 60, depths).unwrap())
            .and_then(|seen| seen.with_mask("box", (0..4800).map(is_object).collect()))
            .unwrap();
        let found = seen.surroundings(&seen.masks()[0]).unwrap();
        assert!(
            found.iter().all(|p| (p.z - 0.6).abs() < 1e-6),
            "neither the object nor what is far"
        );
        // 75 × 60 pixels near, less the mask with three around it (corners rounded).
        let n_outside = 75 * 60 - 26 * 26;
        assert!((n_outside..n_outside + 30).contains(&found.len()), "{}", found.len());
        let frame = MaskedFrame { seen: &seen, mask: seen.masks().first() };
        let unmasked = MaskedFrame { mask: None, ..frame };
        assert_eq!(merged_surroundings(&[frame, unmasked, frame]).unwrap(), found, "each once");
        let cloud = seen.points(None).unwrap().object;
        let by_cloud = Observation::new(camera)
            .with_cloud(cloud)
            .and_then(|cloud| cloud.with_mask("box", seen.masks()[0].marked.clone()))
            .unwrap();
        assert_eq!(by_cloud.surroundings(&by_cloud.masks()[0]).unwrap().len(), found.len());
    }
}
