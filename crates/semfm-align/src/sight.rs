//! Lines of sight: what was seen along each, and what a pose of the model would show there.

use semfm_geom::math::{DMat3, DVec3};

use crate::model::AlignModel;
use crate::sim3::Sim3;
use crate::starts::SightFrame;

/// Points for each cell of the observed silhouette, on average over the cloud's bounding square, of
/// which an object fills about half.
const POINTS_PER_CELL: f64 = 2.0;

/// Cells along a side of the observed silhouette, at least and at most.
const SIDE: [f64; 2] = [12.0, 96.0];

/// Cells along a side of the model's own depth buffer, per side of the silhouette: its samples are
/// fewer than the observed points.
const COARSER: f64 = 3.0;

/// Surface that the line of sight meets at less than this cosine is left out: whether it is seen
/// depends on a pixel.
const GRAZING: f64 = 0.25;

/// How far behind the nearest sample in its cell of the depth buffer a sample still counts as
/// visible, in radii of the object.
const THICKNESS: f64 = 0.12;

/// The empty cell.
const NOTHING: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// Depths along the lines of sight from one viewpoint, on a grid over the observed silhouette.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    viewpoint: DVec3,
    frame: SightFrame,
    low: [f64; 2],
    per_unit: f64,
    side: [usize; 2],
    /// Least and greatest depth of the object in each cell.
    object: Vec<[f32; 2]>,
    /// Least depth of anything else in each cell.
    context: Vec<f32>,
    /// What the image covers, as tangents in the camera's own axes.
    window: Option<[f64; 4]>,
}

/// How the pieces of the model that face the camera compare with what was seen there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// Something was observed where the piece is.
    pub explained: usize,
    /// The camera looked through the piece, or saw nothing of the object there.
    pub violating: usize,
    /// Something observed stands before it.
    pub hidden: usize,
}

impl Seen {
    /// Share of the pieces that should have been seen and were. Pieces behind something count a
    /// third: a few are usual, but a model that hides altogether explains nothing.
    pub fn share(&self) -> f64 {
        let should = self.explained as f64 + self.violating as f64 + self.hidden as f64 / 3.0;
        if should > 0.0 { self.explained as f64 / should } else { 0.0 }
    }
}

impl Sight {
    /// The silhouette of `points` seen from `viewpoint`, with whatever else was seen.
    pub fn new(
        points: &[DVec3],
        context: &[DVec3],
        viewpoint: DVec3,
        frame: SightFrame,
        window: Option<[f64; 4]>,
    ) -> Self {
        let mut sight = Self {
            viewpoint,
            frame,
            low: [0.0; 2],
            per_unit: 1.0,
            side: [1; 2],
            object: Vec::new(),
            context: Vec::new(),
            window,
        };
        let seen: Vec<_> = points.iter().filter_map(|&p| sight.project(p)).collect();
        let border = |k: usize, share: f64| {
            let mut along: Vec<f64> = seen.iter().map(|(uv, _)| uv[k]).collect();
            let place = (share * (along.len().max(1) - 1) as f64) as usize;
            if along.is_empty() {
                return 0.0;
            }
            *along.select_nth_unstable_by(place, f64::total_cmp).1
        };
        let (low, high) = ([0, 1].map(|k| border(k, 0.002)), [0, 1].map(|k| border(k, 0.998)));
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1e-9));
        let n_cells =
            (points.len() as f64 / POINTS_PER_CELL).clamp(SIDE[0].powi(2), SIDE[1].powi(2));
        sight.per_unit =
            (n_cells / (size[0] * size[1])).sqrt().min(4.0 * SIDE[1] / size[0].max(size[1]));
        sight.low = [0, 1].map(|k| low[k] - 1.0 / sight.per_unit);
        sight.side = size.map(|size| (size * sight.per_unit).ceil() as usize + 2);
        sight.object = vec![NOTHING; sight.side[0] * sight.side[1]];
        sight.context = vec![f32::INFINITY; sight.object.len()];
        for &(uv, z) in &seen {
            if let Some(cell) = sight.cell(uv) {
                let [near, far] = &mut sight.object[cell];
                (*near, *far) = (near.min(z as f32), far.max(z as f32));
            }
        }
        for &point in context {
            let Some((uv, z)) = sight.project(point) else { continue };
            if let Some(cell) = sight.cell(uv) {
                sight.context[cell] = sight.context[cell].min(z as f32);
            }
        }
        sight.close_holes();
        sight
    }

    /// Compares every `every`th sample of the model with what was seen. `tolerance` in metres.
    ///
    /// With `exact`, rays tell what the model itself hides; else a depth buffer of its samples.
    pub fn compare(
        &self,
        model: &AlignModel,
        camera_from_unit: &Sim3,
        tolerance: f64,
        every: usize,
        exact: bool,
    ) -> Seen {
        let turn = DMat3::from_quat(camera_from_unit.rotation) * camera_from_unit.scale;
        let side = self.side.map(|n| (n as f64 / COARSER).ceil() as usize);
        let mut nearest = vec![f64::INFINITY; side[0] * side[1]];
        let buffer_cell = |uv: [f64; 2]| {
            // What lies beyond the silhouette shares its border: it hides little of the inside.
            let at = |k: usize| {
                let x = (uv[k] - self.low[k]) * self.per_unit / COARSER;
                (x as usize).min(side[k] - 1)
            };
            at(1) * side[0] + at(0)
        };
        let mut facing = Vec::with_capacity(model.samples.len() / 2);
        for sample in model.samples.iter().step_by(every) {
            let place = turn * sample.point + camera_from_unit.translation;
            let cosine = -(turn * sample.normal).dot(place - self.viewpoint)
                / (camera_from_unit.scale * place.distance(self.viewpoint));
            if (if model.both_sides { cosine.abs() } else { cosine }) < GRAZING {
                continue;
            }
            let Some((uv, z)) = self.project(place) else { continue };
            let slot = &mut nearest[buffer_cell(uv)];
            *slot = slot.min(z);
            facing.push((sample, place, uv, z));
        }
        let eye = exact.then(|| camera_from_unit.inverse().apply(self.viewpoint));
        let slack = THICKNESS * camera_from_unit.scale;
        let mut seen = Seen::default();
        for (sample, place, uv, z) in facing {
            let shown = match eye {
                Some(eye) => !model.surface.blocked(eye, sample.point, 1e-3),
                None => z <= nearest[buffer_cell(uv)] + slack,
            };
            if !shown || self.window.is_some_and(|w| outside(w, place)) {
                continue;
            }
            let ([near, far], context) = self
                .cell(uv)
                .map_or((NOTHING, f32::INFINITY), |cell| (self.object[cell], self.context[cell]));
            let (near, far, context) = (f64::from(near), f64::from(far), f64::from(context));
            if z >= near - tolerance && z <= far + tolerance {
                seen.explained += 1;
            } else if (near.is_finite() && z > far) || z > context + tolerance {
                seen.hidden += 1;
            } else {
                seen.violating += 1;
            }
        }
        seen
    }

    /// Tangents across the line of sight, and depth along it; `None` behind the camera.
    fn project(&self, point: DVec3) -> Option<([f64; 2], f64)> {
        let p = point - self.viewpoint;
        let z = p.dot(self.frame.forward);
        (z > 0.0).then(|| ([p.dot(self.frame.right) / z, p.dot(self.frame.down) / z], z))
    }

    fn cell(&self, uv: [f64; 2]) -> Option<usize> {
        let at = |k: usize| {
            let x = (uv[k] - self.low[k]) * self.per_unit;
            (x >= 0.0 && x < self.side[k] as f64).then_some(x as usize)
        };
        Some(at(1)? * self.side[0] + at(0)?)
    }

    /// An empty cell most of whose neighbours show the object is a gap between pixels.
    fn close_holes(&mut self) {
        const MOST: usize = 5;
        let given = self.object.clone();
        let [width, height] = self.side;
        for row in 0..height {
            for column in 0..width {
                if given[row * width + column] != NOTHING {
                    continue;
                }
                let around = (row.saturating_sub(1)..(row + 2).min(height)).flat_map(|r| {
                    (column.saturating_sub(1)..(column + 2).min(width)).map(move |c| r * width + c)
                });
                let filled: Vec<[f32; 2]> =
                    around.map(|at| given[at]).filter(|&cell| cell != NOTHING).collect();
                if filled.len() >= MOST {
                    self.object[row * width + column] = filled
                        .into_iter()
                        .fold(NOTHING, |all, one| [all[0].min(one[0]), all[1].max(one[1])]);
                }
            }
        }
    }
}

fn outside(window: [f64; 4], place: DVec3) -> bool {
    let (u, v) = (place.x / place.z, place.y / place.z);
    !(u >= window[0] && u <= window[1] && v >= window[2] && v <= window[3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::{Task, zoo};

    /// A ball of radius .05 at half a metre, the half of it that a camera at the origin sees.
    fn ball() -> (AlignModel, Sim3, Vec<DVec3>) {
        let pose = Sim3 { scale: 0.05, translation: 0.5 * DVec3::Z, ..Sim3::IDENTITY };
        let model = AlignModel::new(&zoo::icosphere(3), 0, &Task::default()).unwrap();
        let dense = zoo::icosphere(5);
        let points = dense.vertices().iter().map(|&p| pose.apply(p));
        let seen = points.filter(|p| (p - pose.translation).dot(*p) < 0.0).collect();
        (model, pose * Sim3 { scale: model_radius(), ..Sim3::IDENTITY }, seen)
    }

    fn model_radius() -> f64 {
        zoo::icosphere(3).bounding_sphere().1
    }

    fn share(sight: &Sight, model: &AlignModel, pose: &Sim3, exact: bool) -> f64 {
        sight.compare(model, pose, 0.003, 1, exact).share()
    }

    #[test]
    fn the_true_pose_is_explained_and_others_are_not() {
        let (model, pose, points) = ball();
        let frame = SightFrame::along(DVec3::Z);
        let sight = Sight::new(&points, &[], DVec3::ZERO, frame, None);
        let moved = |shift: DVec3, growth: f64| Sim3 {
            scale: pose.scale * growth,
            translation: pose.translation + shift,
            ..pose
        };
        for exact in [false, true] {
            assert!(share(&sight, &model, &pose, exact) > 0.95);
            // Beside, before, behind, inside, around what was seen.
            assert!(share(&sight, &model, &moved(0.05 * DVec3::X, 1.0), exact) < 0.6);
            assert!(share(&sight, &model, &moved(-0.05 * DVec3::Z, 1.0), exact) < 0.4);
            assert!(share(&sight, &model, &moved(0.2 * DVec3::Z, 1.0), exact) < 0.1);
            assert!(share(&sight, &model, &moved(DVec3::ZERO, 0.5), exact) < 0.4);
            assert!(share(&sight, &model, &moved(DVec3::ZERO, 1.8), exact) < 0.4);
        }
    }

    #[test]
    fn what_stands_before_the_object_or_beyond_the_picture_is_no_evidence() {
        let (model, pose, points) = ball();
        let frame = SightFrame::along(DVec3::Z);
        let (left, right): (Vec<DVec3>, Vec<DVec3>) = points.iter().partition(|p| p.x < 0.0);
        let alone = Sight::new(&left, &[], DVec3::ZERO, frame, None);
        // The silhouette's grid ends with the left half, and so does the picture.
        let half = Some([-1.0, 0.0, -1.0, 1.0]);
        let cut = Sight::new(&left, &[], DVec3::ZERO, frame, half);
        // A screen half way to the right half; the object peeps out at its far end.
        let screen: Vec<DVec3> = right.iter().map(|p| 0.7 * p).collect();
        let peeping: Vec<DVec3> =
            left.iter().chain(right.iter().filter(|p| p.x > 0.047)).copied().collect();
        let hidden = Sight::new(&peeping, &screen, DVec3::ZERO, frame, None);
        assert!(share(&alone, &model, &pose, true) < 0.6);
        assert!(share(&cut, &model, &pose, true) > 0.9);
        assert!(share(&hidden, &model, &pose, true) > 0.7);
    }
}
