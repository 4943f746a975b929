//! What of the object a pose shows: samples that a camera would see, and points of the outline before a far ground.

use rayon::prelude::*;
use semfm_align::Sim3;
use semfm_geom::math::DVec3;

use crate::depth_view::{DepthView, Pixel};
use crate::model::TrackModel;
use crate::motion::matrix;

/// Surface that the line of sight meets at less than this cosine is left out: whether it is seen depends on a pixel.
pub(crate) const GRAZING: f64 = 0.2;

/// How far from a place, as a share of the radius, a triangle must be to hide it.
const CLEARANCE: f64 = 0.02;

/// Points of the outline, about.
const N_OUTLINE: f64 = 140.0;

/// A place beside the outline, in pixels, at which the object itself must not stand.
const BESIDE: f64 = 3.0;

/// How far behind the outline the object's own surface must lie, as a share of the radius, for the depth to jump there.
const OWN_GAP: f64 = 0.15;

/// A place on the outline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutlinePoint {
    /// In the inner frame.
    pub point: DVec3,
    /// Unit, across the line of sight, away from the object; inner frame.
    pub outward: DVec3,
}

/// What a pose shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown {
    /// Ids of the samples that nothing of the object hides, within the image.
    pub samples: Vec<u32>,
    /// Samples that would be seen but for the border of the image.
    pub n_outside: usize,
    pub outline: Vec<OutlinePoint>,
}

impl Shown {
    /// What a pose (camera from the inner frame) shows in a camera.
    pub fn new(model: &TrackModel, view: &DepthView<'_>, pose: &Sim3) -> Self {
        let (turn, eye) = (matrix(pose), pose.inverse().translation);
        let clearance = CLEARANCE * model.radius;
        let seen = |id: u32| {
            let sample = &model.samples[id as usize];
            let to_eye = eye - sample.point;
            let cosine = sample.normal.dot(to_eye) / to_eye.length();
            let cosine = if model.both_sides { cosine.abs() } else { cosine };
            if cosine < GRAZING || model.surface.blocked(eye, sample.point, clearance) {
                return None;
            }
            let place = turn * sample.point + pose.translation;
            let inside = view.project(place).map(|at| view.at(at) != Pixel::Outside);
            Some((id, inside.unwrap_or(false)))
        };
        let ids = 0..model.samples.len() as u32;
        let seen: Vec<(u32, bool)> = ids.into_par_iter().filter_map(seen).collect();
        let samples: Vec<u32> =
            seen.iter().filter(|(_, inside)| *inside).map(|(id, _)| *id).collect();
        let n_outside = seen.len() - samples.len();
        let outline = outline(model, view, pose, eye);
        Self { samples, n_outside, outline }
    }
}

/// Points spread along the edges between triangles that face the eye and triangles that do not, where neither the object
/// hides them nor stands close behind them.
fn outline(model: &TrackModel, view: &DepthView<'_>, pose: &Sim3, eye: DVec3) -> Vec<OutlinePoint> {
    let faces_eye: Vec<bool> =
        model.facets.iter().map(|facet| facet.normal.dot(eye - facet.middle) > 0.0).collect();
    let is_rim = |faces: [u32; 2]| {
        let [a, b] = faces.map(|face| faces_eye[face as usize]);
        a != b || faces[0] == faces[1]
    };
    let rims: Vec<_> = model.edges.iter().filter(|edge| is_rim(edge.faces)).collect();
    let total: f64 = rims.iter().map(|edge| edge.ends[0].distance(edge.ends[1])).sum();
    let spacing = total / N_OUTLINE;
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Vec::new();
    }
    let mut places = Vec::new();
    let mut along = 0.5 * spacing;
    for edge in rims {
        let [a, b] = edge.ends;
        let length = a.distance(b);
        // The triangle that is seen: the outline lies away from its middle.
        let front = edge.faces.into_iter().find(|&face| faces_eye[face as usize]);
        let middle = model.facets[front.unwrap_or(edge.faces[0]) as usize].middle;
        while along < length {
            places.push((a + (b - a) * (along / length), (b - a) / length, middle));
            along += spacing;
        }
        along -= length;
    }
    let keep = |&(point, tangent, middle): &(DVec3, DVec3, DVec3)| {
        let sight = (point - eye).normalize_or(DVec3::Z);
        let across = tangent.cross(sight).try_normalize()?;
        let outward = if across.dot(middle - point) > 0.0 { -across } else { across };
        is_seen(model, view, pose, eye, point, outward).then_some(OutlinePoint { point, outward })
    };
    places.par_iter().filter_map(keep).collect()
}

/// Whether a place on the outline is seen, with nothing of the object near behind it.
fn is_seen(
    model: &TrackModel,
    view: &DepthView<'_>,
    pose: &Sim3,
    eye: DVec3,
    point: DVec3,
    outward: DVec3,
) -> bool {
    if model.surface.blocked(eye, point, CLEARANCE * model.radius) {
        return false;
    }
    let depth = pose.apply(point).z;
    let beside = point + outward * (BESIDE * depth / view.focal());
    let sight = beside - eye;
    let hit = model.surface.first_hit(eye, sight);
    hit.is_none_or(|hit| (hit.t - 1.0) * sight.length() > OWN_GAP * model.radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::math::DAffine3;
    use semfm_geom::{Intrinsics, Pinhole, Task, zoo};

    #[test]
    fn a_ball_shows_its_near_half_and_a_circle() {
        let model = TrackModel::new(&zoo::icosphere(4), 0.05, 0, &Task::default()).unwrap();
        let intrinsics =
            Intrinsics { width: 200, height: 200, fx: 300.0, fy: 300.0, cx: 100.0, cy: 100.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let depth = DepthImage::new(200, 200, vec![1.0; 40_000]).unwrap();
        let view = DepthView::new(&depth, &camera);
        let at = |x: f64| Sim3 { translation: DVec3::new(x, 0.0, 0.5), ..Sim3::IDENTITY };
        let shown = Shown::new(&model, &view, &at(0.0));
        assert!(shown.n_outside == 0 && shown.samples.len() > 400);
        for &id in &shown.samples {
            assert!(model.samples[id as usize].point.z < 0.0, "on the near side");
        }
        assert!(shown.outline.len() > 70, "{}", shown.outline.len());
        for rim in &shown.outline {
            // Of a ball of radius r at distance d, the circle lies at depth d − r²/d, and outward is radial.
            assert!((rim.point.z + 0.005).abs() < 0.004, "{}", rim.point.z);
            assert!(rim.outward.dot(rim.point.normalize()) > 0.9);
        }
        let half = Shown::new(&model, &view, &at(0.166));
        assert!(half.n_outside > 100 && half.samples.len() < shown.samples.len());
    }
}
