//! What a camera saw of the object, made ready for the search.

use semfm_geom::math::DVec3;
use semfm_geom::{Pinhole, PointIndex};

use crate::depth_image::{DepthImage, ImageBounds};
use crate::downsample::downsample;
use crate::extent::{Extent, ViewAxes};
use crate::silhouette::Silhouette;
use crate::{Error, Result};

/// Points that the final pose is computed from. With 1 mm of noise the scale's standard deviation
/// is then about .1 %; twice as many cost twice the time and gain 30 %.
const N_POINTS: usize = 600;

/// Fewer points cannot hold seven unknowns against noise.
const LEAST_POINTS: usize = 30;

/// Observed points in the camera's frame (x right, y down, z forward, metres), downsampled, with
/// normals and with the silhouette they make. Prepared once for many models.
#[derive(Debug)]
pub struct Observation {
    pub(crate) points: Vec<DVec3>,
    /// Unit, towards the viewpoint where there is one.
    pub(crate) normals: Vec<DVec3>,
    pub(crate) coverage: Coverage,
    extent: Extent,
    axes: ViewAxes,
    n_given: usize,
}

/// What tells whether a piece of the model should have been seen.
#[derive(Debug)]
pub(crate) enum Coverage {
    /// One view: the depth along each line of sight.
    SingleView(Silhouette),
    /// A cloud put together from many views: all of the surface should be near some point.
    AllAround { index: PointIndex, spacing: f64 },
}

/// What one view saw, in the camera's frame.
struct View<'a> {
    /// Points of the object.
    object: &'a [DVec3],
    /// Points of anything else.
    context: &'a [DVec3],
    viewpoint: DVec3,
    /// Beyond these nothing can be seen; `None` where they are not known.
    bounds: Option<ImageBounds>,
}

impl Observation {
    /// A cloud seen from one place: from the frame's origin, or from `viewpoint`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 30 points, a coordinate that is not finite, points
    /// all on one spot, or a viewpoint among the points.
    pub fn from_view(points: &[DVec3], viewpoint: DVec3) -> Result<Self> {
        Self::from_one_view(&View { object: points, context: &[], viewpoint, bounds: None })
    }

    /// A cloud put together from many views: every side of the object may be in it.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 30 points, a coordinate that is not finite, or points
    /// all on one spot.
    pub fn from_many_views(points: &[DVec3]) -> Result<Self> {
        check_points(points)?;
        let (kept, mut normals): (Vec<_>, Vec<_>) =
            downsample(points, N_POINTS).into_iter().map(|p| (p.point, p.normal)).unzip();
        let axes = ViewAxes::along(DVec3::Z);
        let extent = extent(&kept, axes)?;
        // Which way is out is not known; away from the middle is right more often than not.
        let middle: DVec3 = kept.iter().sum::<DVec3>() / kept.len() as f64;
        for (normal, point) in normals.iter_mut().zip(&kept) {
            let out = *point - middle;
            *normal = Some(normal.map_or(out.normalize_or(DVec3::Z), |n| n * n.dot(out).signum()));
        }
        let spacing = extent.diameter() / (kept.len() as f64).sqrt();
        let coverage = Coverage::AllAround { index: PointIndex::new(&kept)?, spacing };
        let normals = normals.into_iter().flatten().collect();
        Ok(Self { points: kept, normals, coverage, extent, axes, n_given: points.len() })
    }

    /// A depth image and the camera that took it: the pixels under `mask` (all, where there is none)
    /// show the object, the others what stands before or behind it. The camera's own pose plays no
    /// part, since everything is in its frame.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a camera or a mask that does not fit the image, fewer than 30
    /// pixels with a depth under the mask, or points all on one spot.
    pub fn from_depth(image: &DepthImage, camera: &Pinhole, mask: Option<&[bool]>) -> Result<Self> {
        let points = image.points(camera, mask)?;
        Self::from_one_view(&View {
            object: &points.object,
            context: &points.context,
            viewpoint: DVec3::ZERO,
            bounds: Some(image.bounds(camera)),
        })
    }

    fn from_one_view(view: &View<'_>) -> Result<Self> {
        let View { object, context, viewpoint, bounds } = *view;
        check_points(object)?;
        let sampled = downsample(object, N_POINTS);
        let middle: DVec3 = sampled.iter().map(|p| p.point).sum::<DVec3>() / sampled.len() as f64;
        if !viewpoint.is_finite() || middle.distance(viewpoint) <= 0.0 {
            let expected = "a finite place apart from the points".into();
            let found = viewpoint.to_string();
            return Err(Error::OutOfRange { what: "viewpoint", expected, found });
        }
        let kept: Vec<DVec3> = sampled.iter().map(|p| p.point).collect();
        let normals = sampled
            .iter()
            .map(|p| {
                let back = (viewpoint - p.point).normalize_or(DVec3::NEG_Z);
                p.normal.map_or(back, |n| if n.dot(back) < 0.0 { -n } else { n })
            })
            .collect();
        let axes = ViewAxes::along(middle - viewpoint);
        let extent = extent(&kept, axes)?;
        let silhouette = Silhouette::new(object, context, viewpoint, axes, bounds);
        let coverage = Coverage::SingleView(silhouette);
        Ok(Self { points: kept, normals, coverage, extent, axes, n_given: object.len() })
    }

    /// Number of points given.
    pub fn n_points(&self) -> usize {
        self.n_given
    }

    /// Robust diameter of the cloud in metres.
    pub fn diameter(&self) -> f64 {
        self.extent.diameter()
    }

    pub(crate) fn extent(&self) -> Extent {
        self.extent
    }

    pub(crate) fn axes(&self) -> ViewAxes {
        self.axes
    }

    pub(crate) fn all_around(&self) -> bool {
        matches!(self.coverage, Coverage::AllAround { .. })
    }

    /// Ids of about `n` points, spread over all of them.
    pub(crate) fn subset(&self, n: usize) -> Vec<u32> {
        let all = self.points.len();
        let n = n.min(all);
        (0..n).map(|i| (i * all / n) as u32).collect()
    }
}

fn check_points(points: &[DVec3]) -> Result<()> {
    if points.len() < LEAST_POINTS {
        let expected = format!("at least {LEAST_POINTS} points");
        let found = points.len().to_string();
        return Err(Error::OutOfRange { what: "observed cloud", expected, found });
    }
    if let Some(id) = points.iter().position(|p| !p.is_finite()) {
        let (expected, found) =
            ("finite coordinates".into(), format!("{} at point {id}", points[id]));
        return Err(Error::OutOfRange { what: "observed cloud", expected, found });
    }
    Ok(())
}

fn extent(points: &[DVec3], axes: ViewAxes) -> Result<Extent> {
    Extent::of(points, axes).filter(|extent| extent.diameter() > 0.0).ok_or_else(|| {
        let expected = "points that are apart from each other".into();
        Error::OutOfRange { what: "observed cloud", expected, found: "all on one spot".into() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch() -> Vec<DVec3> {
        (0..900).map(|i| DVec3::new(f64::from(i % 30), f64::from(i / 30), 50.0) / 100.0).collect()
    }

    #[test]
    fn normals_look_at_the_viewpoint() {
        let seen = Observation::from_view(&patch(), DVec3::ZERO).unwrap();
        assert!(seen.normals.iter().all(|n| n.z < -0.99));
        let seen = Observation::from_view(&patch(), DVec3::Z).unwrap();
        assert!(seen.normals.iter().all(|n| n.z > 0.99));
    }

    #[test]
    fn clouds_that_show_nothing_are_refused() {
        let mut broken = patch();
        broken[7].y = f64::NAN;
        for (points, word) in [
            (vec![], "found 0"),
            (patch()[..29].to_vec(), "found 29"),
            (vec![DVec3::ONE; 100], "one spot"),
            (broken, "point 7"),
        ] {
            let error = Observation::from_view(&points, DVec3::ZERO).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
            assert!(Observation::from_many_views(&points).is_err());
        }
    }
}
