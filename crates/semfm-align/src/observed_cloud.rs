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

/// An object larger than this (metres), or farther away, is none that a hand takes: rather, the points
/// count millimetres.
const LARGEST: f64 = 10.0;
const FARTHEST: f64 = 50.0;

/// An object smaller than this (metres) is below what any depth camera resolves.
const SMALLEST: f64 = 0.0005;

/// Fewer points cannot hold seven unknowns against noise.
const LEAST_POINTS: usize = 30;

/// Observed points in the camera's frame (x right, y down, z forward, metres), downsampled, with
/// normals and with the silhouette they make. Prepared once for many models.
#[derive(Debug)]
pub struct ObservedCloud {
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

impl ObservedCloud {
    /// A cloud seen from one place, metres. A viewpoint at the origin says that the frame is the camera's
    /// own (x right, y down, z forward), in which nothing that it sees lies behind it; in any other
    /// frame the viewpoint is where the camera stood.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 30 points, a coordinate that is not finite, points
    /// all on one spot, a viewpoint among the points, points behind a camera at the origin, and a
    /// cloud that is too large, too far away or too small for one of an object in metres.
    pub fn from_view(points: &[DVec3], viewpoint: DVec3) -> Result<Self> {
        Self::from_one_view(&View { object: points, context: &[], viewpoint, bounds: None })
    }

    /// A cloud put together from many views: every side of the object may be in it.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 30 points, a coordinate that is not finite, points
    /// all on one spot, and a cloud that is too large or too small for one of an object in metres.
    pub fn from_many_views(points: &[DVec3]) -> Result<Self> {
        check_points(points)?;
        let (kept, mut normals): (Vec<_>, Vec<_>) = downsample(&in_order(points), N_POINTS)
            .into_iter()
            .map(|p| (p.point, p.normal))
            .unzip();
        let axes = ViewAxes::along(DVec3::Z);
        let extent = extent(&kept, axes)?;
        check_metres(&extent, None)?;
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
        if viewpoint == DVec3::ZERO {
            check_in_front(object)?;
        }
        let n_given = object.len();
        let object = &in_order(object);
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
        check_metres(&extent, Some(middle.distance(viewpoint)))?;
        let silhouette = Silhouette::new(object, context, viewpoint, axes, bounds);
        let coverage = Coverage::SingleView(silhouette);
        Ok(Self { points: kept, normals, coverage, extent, axes, n_given })
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

/// The points in an order of their own, each once: neither the order in which they were given nor
/// what was given twice has a part in the answer.
fn in_order(points: &[DVec3]) -> Vec<DVec3> {
    let mut points = points.to_vec();
    points.sort_unstable_by(|a, b| {
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    });
    points.dedup();
    points
}

fn check_points(points: &[DVec3]) -> Result<()> {
    if points.len() < LEAST_POINTS {
        let expected = format!("at least {LEAST_POINTS} points");
        let found = points.len().to_string();
        return Err(Error::OutOfRange { what: "observed cloud", expected, found });
    }
    // Beyond this, squares of differences leave the range of numbers.
    let usable = |p: &DVec3| p.is_finite() && p.abs().max_element() < 1e100;
    if let Some(id) = points.iter().position(|p| !usable(p)) {
        let (expected, found) = (
            "finite coordinates below 1e100 (leave points without a return away)".into(),
            format!("{} at point {id}", points[id]),
        );
        return Err(Error::OutOfRange { what: "observed cloud", expected, found });
    }
    Ok(())
}

/// Refuses points behind a camera that looks along z from the origin.
fn check_in_front(points: &[DVec3]) -> Result<()> {
    let behind = points.iter().filter(|p| p.z <= 0.0).count();
    if behind == 0 {
        return Ok(());
    }
    let expected = "points before the camera, z > 0 (x right, y down, z forward): turn a cloud of \
                    another frame into the camera's, or name the viewpoint in its frame";
    let found = format!("{behind} of {} with z ≤ 0", points.len());
    Err(Error::OutOfRange { what: "observed cloud", expected: expected.into(), found })
}

/// Refuses what cannot be an object in metres: its size, and its distance from the viewpoint where
/// that is known.
fn check_metres(extent: &Extent, distance: Option<f64>) -> Result<()> {
    let size = extent.diameter();
    let far = distance.filter(|&distance| distance > FARTHEST);
    let (expected, found) = if size > LARGEST {
        (format!("at most {LARGEST} m"), format!("{size:.4} m across: is this in millimetres?"))
    } else if let Some(far) = far {
        let found = format!("{far:.4} m from the viewpoint: is this in millimetres?");
        (format!("an object at most {FARTHEST} m away"), found)
    } else if size < SMALLEST {
        let found =
            format!("{size:.1e} m across: is its unit right? For a depth image, --depth-scale");
        (format!("at least {SMALLEST} m"), found)
    } else {
        return Ok(());
    };
    Err(Error::OutOfRange { what: "observed cloud", expected, found })
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
        let seen = ObservedCloud::from_view(&patch(), DVec3::ZERO).unwrap();
        assert!(seen.normals.iter().all(|n| n.z < -0.99));
        let seen = ObservedCloud::from_view(&patch(), DVec3::Z).unwrap();
        assert!(seen.normals.iter().all(|n| n.z > 0.99));
    }

    #[test]
    fn neither_order_nor_repetition_has_a_part() {
        let points = patch();
        let shuffled: Vec<DVec3> = (0..900).map(|i| points[i * 7 % 900]).collect();
        let repeated = [&shuffled[..], &points[..450]].concat();
        let of = |points: &[DVec3]| ObservedCloud::from_view(points, DVec3::ZERO).unwrap().points;
        assert_eq!(of(&points), of(&shuffled));
        assert_eq!(of(&points), of(&repeated));
    }

    #[test]
    fn a_cloud_in_another_unit_or_behind_the_camera_is_asked_about() {
        let scaled = |factor: f64| patch().iter().map(|p| factor * p).collect::<Vec<DVec3>>();
        let far: Vec<DVec3> = patch().iter().map(|p| p + 60.0 * DVec3::Z).collect();
        for (points, words) in [
            (scaled(1000.0), "in millimetres?"),
            (scaled(1e80), "in millimetres?"),
            (far, "in millimetres?"),
            (scaled(1e-5), "unit"),
            (scaled(-1.0), "900 of 900"),
            (scaled(1e120), "point 0"),
        ] {
            let error = ObservedCloud::from_view(&points, DVec3::ZERO).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert!(ObservedCloud::from_many_views(&scaled(1000.0)).is_err());
        // In a frame of its own, a cloud may lie on any side of the origin.
        assert!(ObservedCloud::from_view(&scaled(-1.0), DVec3::new(0.1, 0.1, 0.3)).is_ok());
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
            let error = ObservedCloud::from_view(&points, DVec3::ZERO).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
            assert!(ObservedCloud::from_many_views(&points).is_err());
        }
    }
}
