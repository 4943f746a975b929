//! What one view saw along each line of sight, and what a pose of the model would show there.

use semfm_geom::math::{DMat3, DVec3};

use crate::depth_image::ImageBounds;
use crate::extent::{ViewAxes, order_statistic};
use crate::model::AlignModel;
use crate::oriented_point::OrientedPoint;
use crate::sim3::Sim3;
use crate::visibility::Visibility;

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

/// The same where samples count by the area that they show: less of it is left out.
const STEEP: f64 = 0.08;

/// How far behind the nearest sample in its cell of the depth buffer a sample still counts as
/// visible, in radii of the object.
const THICKNESS: f64 = 0.12;

/// Where other things were seen, the grid reaches so far beyond the object on each side, as a share of
/// its larger side: a handle that may stand behind one of them is no conflict.
const MARGIN: f64 = 0.5;

/// Shares of the tangents that the grid's lower and upper borders have below them.
const BORDERS: [f64; 2] = [0.002, 0.998];

/// An empty cell with so many neighbours (of eight) that show the object is a gap between pixels.
const FILLED_NEIGHBOURS: usize = 5;

/// Depths along the lines of sight from one viewpoint, on a grid over the observed silhouette.
#[derive(Clone, Debug)]
pub(crate) struct Silhouette {
    viewpoint: DVec3,
    axes: ViewAxes,
    low: [f64; 2],
    per_unit: f64,
    side: [usize; 2],
    /// Depths of the object in each cell.
    object: Vec<DepthRange>,
    /// Least depth of anything else in each cell.
    context: Vec<f32>,
    /// Least depth of the object in each cell and its eight neighbours.
    front: Vec<f32>,
    /// For each cell, how many cells away the nearest one is that shows the object, see
    /// [`Self::measure_gaps`].
    gaps: Vec<f32>,
    /// What the image covers, in the camera's own axes.
    bounds: Option<ImageBounds>,
}

/// Least and greatest depth.
#[derive(Clone, Copy, Debug, PartialEq)]
struct DepthRange {
    near: f32,
    far: f32,
}

impl DepthRange {
    /// Of a cell in which nothing was seen.
    const EMPTY: Self = Self { near: f32::INFINITY, far: f32::NEG_INFINITY };

    fn union(self, other: Self) -> Self {
        Self { near: self.near.min(other.near), far: self.far.max(other.far) }
    }
}

/// A point as seen from the viewpoint.
#[derive(Clone, Copy, Debug)]
struct Projected {
    /// Tangents across the line of sight: to the right, and downwards.
    uv: [f64; 2],
    /// Along the line of sight.
    depth: f64,
}

/// A sample of the model that faces the viewpoint.
struct FacingSample<'a> {
    sample: &'a OrientedPoint,
    /// In the camera's frame.
    place: DVec3,
    /// Between its normal and the line of sight.
    cosine: f64,
    projected: Projected,
}

impl Silhouette {
    /// The silhouette of `points` seen from `viewpoint`, with whatever else was seen.
    pub fn new(
        points: &[DVec3],
        context: &[DVec3],
        viewpoint: DVec3,
        axes: ViewAxes,
        bounds: Option<ImageBounds>,
    ) -> Self {
        let mut silhouette = Self {
            viewpoint,
            axes,
            low: [0.0; 2],
            per_unit: 1.0,
            side: [1; 2],
            object: Vec::new(),
            context: Vec::new(),
            front: Vec::new(),
            gaps: Vec::new(),
            bounds,
        };
        let seen: Vec<Projected> =
            points.iter().filter_map(|&point| silhouette.project(point)).collect();
        let margin = if context.is_empty() { 0.0 } else { MARGIN };
        silhouette.lay_grid(&seen, points.len(), margin);
        for &Projected { uv, depth } in &seen {
            if let Some(cell) = silhouette.cell(uv) {
                let here = DepthRange { near: depth as f32, far: depth as f32 };
                silhouette.object[cell] = silhouette.object[cell].union(here);
            }
        }
        for &point in context {
            let Some(Projected { uv, depth }) = silhouette.project(point) else { continue };
            if let Some(cell) = silhouette.cell(uv) {
                silhouette.context[cell] = silhouette.context[cell].min(depth as f32);
            }
        }
        silhouette.close_holes();
        silhouette.front = (0..silhouette.object.len()).map(|at| silhouette.front_at(at)).collect();
        silhouette.measure_gaps();
        silhouette
    }

    /// Where the camera stands.
    pub fn viewpoint(&self) -> DVec3 {
        self.viewpoint
    }

    /// How much of the surface a pose shows where the camera saw that nothing is, as a share of the
    /// area of the observed silhouette: surface in front of what was seen, or beside the silhouette
    /// and in front of whatever lies there. `width` (metres) is how far it may stand out before it
    /// counts half, one cell of the silhouette not counted.
    ///
    /// > Σ ρ(dᵢ) aᵢ / A,  ρ(d) = d²/(d² + width²)
    ///
    /// over the visible samples, each with the solid angle aᵢ of its piece of surface.
    pub fn conflict(&self, model: &AlignModel, camera_from_unit: &Sim3, width: f64) -> f64 {
        let eye = camera_from_unit.inverse().apply(self.viewpoint);
        let cell = 1.0 / self.per_unit;
        let of_sample = model.area * camera_from_unit.scale.powi(2) / model.samples.len() as f64;
        let mut sum = 0.0;
        for FacingSample { sample, place, cosine, projected: Projected { uv, depth } } in
            self.facing_samples(model, camera_from_unit, 1, STEEP)
        {
            let out = self.distance_out(uv, depth);
            if out <= 0.0
                || self.bounds.is_some_and(|bounds| !bounds.contains(place))
                || model.surface.blocked(eye, sample.point, 1e-3)
            {
                continue;
            }
            let share = out * out / (out * out + width * width);
            sum += share * cosine * of_sample / (depth * depth);
        }
        let n_cells = self.object.iter().filter(|&&range| range != DepthRange::EMPTY).count();
        sum / (n_cells.max(1) as f64 * cell * cell)
    }

    /// How far (metres) a place stands out into space that the camera looked through; 0 where it does
    /// not.
    fn distance_out(&self, uv: [f64; 2], depth: f64) -> f64 {
        let [column, row] = [0, 1].map(|k| (uv[k] - self.low[k]) * self.per_unit);
        let nearest = |x: f64, n: usize| (x.max(0.0) as usize).min(n - 1);
        let (c, r) = (nearest(column, self.side[0]), nearest(row, self.side[1]));
        let at = r * self.side[0] + c;
        let beyond = (column - c as f64 - 0.5).hypot(row - r as f64 - 0.5);
        let inside = self.cell(uv).is_some();
        if inside && depth > f64::from(self.context[at]) {
            return 0.0;
        }
        let range = self.object[at];
        if inside && range != DepthRange::EMPTY {
            return f64::from(self.front[at]) - depth;
        }
        // What stands beside the silhouette is at least so far from it across the line of sight.
        let cells = f64::from(self.gaps[at]) + if inside { 0.0 } else { beyond } - 1.0;
        cells.max(0.0) / self.per_unit * depth
    }

    /// Least depth of the object in a cell and its neighbours: at a rim before a far wall, a place may be
    /// off by a cell.
    fn front_at(&self, at: usize) -> f32 {
        let [width, height] = self.side;
        let (column, row) = (at % width, at / width);
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        rows.flat_map(|r| (column.saturating_sub(1)..(column + 2).min(width)).map(move |c| (r, c)))
            .map(|(r, c)| self.object[r * width + c].near)
            .fold(f32::INFINITY, f32::min)
    }

    /// Distances to the nearest cell that shows the object, in cells, by two sweeps with steps of 1 and
    /// √2 (Borgefors 1986).
    fn measure_gaps(&mut self) {
        let [width, height] = self.side;
        let seen = |cell: &DepthRange| if *cell == DepthRange::EMPTY { f32::INFINITY } else { 0.0 };
        let mut gaps: Vec<f32> = self.object.iter().map(seen).collect();
        let ids: Vec<usize> = (0..gaps.len()).collect();
        for (order, steps) in [
            (ids.clone(), [(-1, 0), (0, -1), (-1, -1), (1, -1)]),
            (ids.into_iter().rev().collect(), [(1, 0), (0, 1), (1, 1), (-1, 1)]),
        ] {
            for at in order {
                let (column, row) = ((at % width) as isize, (at / width) as isize);
                for (right, down) in steps {
                    let (c, r) = (column + right, row + down);
                    if c < 0 || r < 0 || c >= width as isize || r >= height as isize {
                        continue;
                    }
                    let step = if right != 0 && down != 0 { std::f32::consts::SQRT_2 } else { 1.0 };
                    gaps[at] = gaps[at].min(gaps[r as usize * width + c as usize] + step);
                }
            }
        }
        self.gaps = gaps;
    }

    /// A grid of empty cells over what was seen of the `n_points` points, wider on each side by
    /// `margin` (a share of the larger side).
    fn lay_grid(&mut self, seen: &[Projected], n_points: usize, margin: f64) {
        let [low, high] = BORDERS.map(|share| [0, 1].map(|k| border(seen, k, share)));
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1e-9));
        let n_cells = (n_points as f64 / POINTS_PER_CELL).clamp(SIDE[0].powi(2), SIDE[1].powi(2));
        self.per_unit =
            (n_cells / (size[0] * size[1])).sqrt().min(4.0 * SIDE[1] / size[0].max(size[1]));
        let beside = (margin * size[0].max(size[1]) * self.per_unit).ceil() + 1.0;
        self.low = low.map(|low| low - beside / self.per_unit);
        self.side = size.map(|size| (size * self.per_unit + 2.0 * beside).ceil() as usize);
        self.object = vec![DepthRange::EMPTY; self.side[0] * self.side[1]];
        self.context = vec![f32::INFINITY; self.object.len()];
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
    ) -> Visibility {
        let facing = self.facing_samples(model, camera_from_unit, every, GRAZING);
        let buffer = (!exact).then(|| DepthBuffer::new(self, &facing));
        let eye = camera_from_unit.inverse().apply(self.viewpoint);
        let slack = THICKNESS * camera_from_unit.scale;
        let mut visibility = Visibility::default();
        for FacingSample { sample, place, projected: Projected { uv, depth }, .. } in facing {
            let shown = match &buffer {
                None => !model.surface.blocked(eye, sample.point, 1e-3),
                Some(buffer) => depth <= buffer.nearest(self, uv) + slack,
            };
            if !shown || self.bounds.is_some_and(|bounds| !bounds.contains(place)) {
                continue;
            }
            let (object, context) = match self.cell(uv) {
                Some(cell) => (self.object[cell], f64::from(self.context[cell])),
                None => (DepthRange::EMPTY, f64::INFINITY),
            };
            let (near, far) = (f64::from(object.near), f64::from(object.far));
            if depth >= near - tolerance && depth <= far + tolerance {
                visibility.explained += 1;
            } else if (near.is_finite() && depth > far) || depth > context + tolerance {
                visibility.hidden += 1;
            } else {
                visibility.violating += 1;
            }
        }
        visibility
    }

    /// Every `every`th sample of the model, where the line of sight meets its front at this cosine or
    /// more.
    fn facing_samples<'a>(
        &self,
        model: &'a AlignModel,
        camera_from_unit: &Sim3,
        every: usize,
        grazing: f64,
    ) -> Vec<FacingSample<'a>> {
        let turn = DMat3::from_quat(camera_from_unit.rotation) * camera_from_unit.scale;
        let mut facing = Vec::with_capacity(model.samples.len() / 2);
        for sample in model.samples.iter().step_by(every) {
            let place = turn * sample.point + camera_from_unit.translation;
            let cosine = -(turn * sample.normal).dot(place - self.viewpoint)
                / (camera_from_unit.scale * place.distance(self.viewpoint));
            let cosine = if model.both_sides { cosine.abs() } else { cosine };
            if cosine < grazing {
                continue;
            }
            let Some(projected) = self.project(place) else { continue };
            facing.push(FacingSample { sample, place, cosine, projected });
        }
        facing
    }

    /// `None` behind the camera.
    fn project(&self, point: DVec3) -> Option<Projected> {
        let p = point - self.viewpoint;
        let z = p.dot(self.axes.forward);
        let uv = [p.dot(self.axes.right) / z, p.dot(self.axes.down) / z];
        (z > 0.0).then_some(Projected { uv, depth: z })
    }

    /// `None` beyond the grid.
    fn cell(&self, uv: [f64; 2]) -> Option<usize> {
        let [column, row] = [0, 1].map(|k| (uv[k] - self.low[k]) * self.per_unit);
        let [width, height] = self.side;
        let inside = column >= 0.0 && column < width as f64 && row >= 0.0 && row < height as f64;
        inside.then_some(row as usize * width + column as usize)
    }

    /// Fills the gaps between pixels, see [`FILLED_NEIGHBOURS`].
    fn close_holes(&mut self) {
        let given = self.object.clone();
        let [width, height] = self.side;
        for row in 0..height {
            for column in 0..width {
                if given[row * width + column] != DepthRange::EMPTY {
                    continue;
                }
                let around = (row.saturating_sub(1)..(row + 2).min(height)).flat_map(|r| {
                    (column.saturating_sub(1)..(column + 2).min(width)).map(move |c| r * width + c)
                });
                let filled: Vec<DepthRange> =
                    around.map(|at| given[at]).filter(|&cell| cell != DepthRange::EMPTY).collect();
                if filled.len() >= FILLED_NEIGHBOURS {
                    self.object[row * width + column] =
                        filled.into_iter().fold(DepthRange::EMPTY, DepthRange::union);
                }
            }
        }
    }
}

/// The value below which a share of the tangents along axis `k` lies; 0 without any.
fn border(seen: &[Projected], k: usize, share: f64) -> f64 {
    if seen.is_empty() {
        return 0.0;
    }
    let mut along: Vec<f64> = seen.iter().map(|projected| projected.uv[k]).collect();
    let place = (share * (along.len() - 1) as f64) as usize;
    order_statistic(&mut along, place)
}

/// The nearest sample of the model along each line of sight, on cells [`COARSER`] than the
/// silhouette's.
struct DepthBuffer {
    side: [usize; 2],
    nearest: Vec<f64>,
}

impl DepthBuffer {
    fn new(silhouette: &Silhouette, samples: &[FacingSample<'_>]) -> Self {
        let side = silhouette.side.map(|n| (n as f64 / COARSER).ceil() as usize);
        let mut buffer = Self { side, nearest: vec![f64::INFINITY; side[0] * side[1]] };
        for Projected { uv, depth } in samples.iter().map(|facing| facing.projected) {
            let cell = buffer.cell(silhouette, uv);
            buffer.nearest[cell] = buffer.nearest[cell].min(depth);
        }
        buffer
    }

    fn nearest(&self, silhouette: &Silhouette, uv: [f64; 2]) -> f64 {
        self.nearest[self.cell(silhouette, uv)]
    }

    /// What lies beyond the silhouette shares its border: it hides little of the inside.
    fn cell(&self, silhouette: &Silhouette, uv: [f64; 2]) -> usize {
        let [column, row] = [0, 1].map(|k| {
            let x = (uv[k] - silhouette.low[k]) * silhouette.per_unit / COARSER;
            (x as usize).min(self.side[k] - 1)
        });
        row * self.side[0] + column
    }
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

    fn share(silhouette: &Silhouette, model: &AlignModel, pose: &Sim3, exact: bool) -> f64 {
        silhouette.compare(model, pose, 0.003, 1, exact).share()
    }

    fn moved(pose: &Sim3, shift: DVec3, growth: f64) -> Sim3 {
        let (scale, translation) = (pose.scale * growth, pose.translation + shift);
        Sim3 { scale, translation, ..*pose }
    }

    #[test]
    fn the_true_pose_is_explained_and_others_are_not() {
        let (model, pose, points) = ball();
        let axes = ViewAxes::along(DVec3::Z);
        let seen = Silhouette::new(&points, &[], DVec3::ZERO, axes, None);
        for exact in [false, true] {
            assert!(share(&seen, &model, &pose, exact) > 0.95);
            // Beside, before, behind, inside, around what was seen.
            assert!(share(&seen, &model, &moved(&pose, 0.05 * DVec3::X, 1.0), exact) < 0.6);
            assert!(share(&seen, &model, &moved(&pose, -0.05 * DVec3::Z, 1.0), exact) < 0.4);
            assert!(share(&seen, &model, &moved(&pose, 0.2 * DVec3::Z, 1.0), exact) < 0.1);
            assert!(share(&seen, &model, &moved(&pose, DVec3::ZERO, 0.5), exact) < 0.4);
            assert!(share(&seen, &model, &moved(&pose, DVec3::ZERO, 1.8), exact) < 0.4);
        }
    }

    #[test]
    fn what_stands_before_the_object_or_beyond_the_picture_is_no_evidence() {
        let (model, pose, points) = ball();
        let axes = ViewAxes::along(DVec3::Z);
        let (left, right): (Vec<DVec3>, Vec<DVec3>) = points.iter().partition(|p| p.x < 0.0);
        let alone = Silhouette::new(&left, &[], DVec3::ZERO, axes, None);
        // The silhouette's grid ends with the left half, and so does the picture.
        let half = Some(ImageBounds { x: [-1.0, 0.0], y: [-1.0, 1.0] });
        let cut = Silhouette::new(&left, &[], DVec3::ZERO, axes, half);
        // A screen half way to the right half; the object peeps out at its far end.
        let screen: Vec<DVec3> = right.iter().map(|p| 0.7 * p).collect();
        let peeping: Vec<DVec3> =
            left.iter().chain(right.iter().filter(|p| p.x > 0.047)).copied().collect();
        let hidden = Silhouette::new(&peeping, &screen, DVec3::ZERO, axes, None);
        assert!(share(&alone, &model, &pose, true) < 0.6);
        assert!(share(&cut, &model, &pose, true) > 0.9);
        assert!(share(&hidden, &model, &pose, true) > 0.7);
    }
}
