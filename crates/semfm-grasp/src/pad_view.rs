//! What two closed pads see of the object: for each a grid of surface points.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use crate::contact::Closing;
use crate::gripper_geometry::GripperGeometry;
use crate::object::{GraspObject, Surface};
use crate::solid::Solid;

/// Cells across the pad. At 12, a cell of the Franka hand's pad is 1.5 mm wide: half as many move the
/// pressure's centre on a rounded handle by a tenth of the pad, twice as many by a hundredth.
const CELLS: f64 = 12.0;

/// How deep behind a pad the surface is looked at, metres: what a turn by 20° brings to a pad of 18 mm.
const DEPTH: f64 = 6e-3;

/// How far beside a pad the surface is looked at, in cells: what a turn brings under it.
const BESIDE: f64 = 2.0;

/// Grids of surface points below two closed pads, in the frame of the TCP, metres.
#[derive(Clone, Debug)]
pub(crate) struct PadView {
    /// For each cell the point that its pad would meet first, the pad at -y first; cells below which
    /// there is nothing are left out.
    pub(crate) points: [Vec<DVec3>; 2],
    /// Area of a cell, m².
    pub(crate) cell_area: f64,
    /// Half of the pad's extent along x and z, metres.
    pub(crate) half_pad: [f64; 2],
}

/// Side of a cell below a pad of that extent, metres.
pub(crate) fn cell_side(object: &GraspObject, pad: [f64; 2]) -> f64 {
    match object.surface() {
        Surface::Mesh { .. } => pad[0] / CELLS,
        // A cell below the spacing of the points would be empty.
        Surface::Cloud { spacing, .. } => (pad[0] / CELLS).max(*spacing),
    }
}

impl PadView {
    /// What pads see that have closed on `object`.
    pub(crate) fn new(object: &GraspObject, gripper: &GripperGeometry, closing: &Closing) -> Self {
        let half_pad = gripper.pad().map(|extent| extent / 2.0);
        let cell = cell_side(object, gripper.pad());
        let mut grid = Grid::new(half_pad.map(|half| half + BESIDE * cell), cell, closing.width);
        let half = DVec3::new(grid.half[0], closing.width / 2.0 + 1e-6, grid.half[1]);
        let Pose { rotation, translation } = closing.tcp;
        let solid = Solid::oriented_box(Pose::from_parts(translation, rotation), half);
        let tree = &object.touched().tree;
        for item in tree.near(&solid, 0.0) {
            let corners = tree.corners(item).map(|p| solid.local(p));
            match object.surface() {
                Surface::Mesh { .. } => grid.add_triangle(corners),
                Surface::Cloud { .. } => grid.add_point(corners[0]),
            }
        }
        Self { points: grid.points(), cell_area: cell * cell, half_pad }
    }

    /// Whether a point (TCP frame) lies in front of the pads.
    pub(crate) fn before_pad(&self, p: DVec3) -> bool {
        p.x.abs() <= self.half_pad[0] && p.z.abs() <= self.half_pad[1]
    }
}

/// For each cell the least and the largest y of the surface, within [`DEPTH`] of either pad.
struct Grid {
    half: [f64; 2],
    cell: f64,
    n: [usize; 2],
    width: f64,
    /// Rows along x, NaN where there is nothing.
    first: [Vec<f64>; 2],
}

impl Grid {
    /// Cells of about `cell` over ± `half`.
    fn new(half: [f64; 2], cell: f64, width: f64) -> Self {
        let n = half.map(|half| ((2.0 * half / cell).round() as usize).max(1));
        let nothing = vec![f64::NAN; n[0] * n[1]];
        Self { half, cell, n, width, first: [nothing.clone(), nothing] }
    }

    /// Middle of a cell along one axis.
    fn middle(&self, axis: usize, i: usize) -> f64 {
        (i as f64 + 0.5) * self.cell - self.n[axis] as f64 * self.cell / 2.0
    }

    /// Cells whose middles lie within [low, high] along one axis.
    fn cells(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let n = self.n[axis];
        let at = |x: f64| x / self.cell + n as f64 / 2.0 - 0.5;
        // Rounded up, and rounded down plus one; a negative number becomes 0.
        let (low, beyond) = (at(low).max(0.0), at(high) + 1.0);
        let from = low as usize;
        from + usize::from((from as f64) < low)..(beyond as usize).min(n)
    }

    /// Whether all of [low, high] along the closing axis is farther than [`DEPTH`] behind either pad, or before it.
    fn is_out_of_sight(&self, low: f64, high: f64) -> bool {
        let behind = self.width / 2.0 - DEPTH;
        (low > -behind && high < behind) || low.max(-high) > self.width / 2.0 + 1e-6
    }

    fn add(&mut self, i: usize, k: usize, y: f64) {
        let at = i * self.n[1] + k;
        let to_pad = [y + self.width / 2.0, self.width / 2.0 - y];
        for (side, distance) in to_pad.into_iter().enumerate() {
            let known = self.first[side][at];
            let nearer = known.is_nan() || if side == 0 { y < known } else { y > known };
            if (-1e-6..=DEPTH).contains(&distance) && nearer {
                self.first[side][at] = y;
            }
        }
    }

    fn add_point(&mut self, p: DVec3) {
        let place = [p.x, p.z];
        let [i, k] =
            [0, 1].map(|axis| (place[axis] / self.cell + self.n[axis] as f64 / 2.0).floor());
        if i >= 0.0 && k >= 0.0 && (i as usize) < self.n[0] && (k as usize) < self.n[1] {
            self.add(i as usize, k as usize, p.y);
        }
    }

    /// The cells whose middles a triangle covers, by barycentric coordinates in the plane of the pad.
    fn add_triangle(&mut self, [a, b, c]: [DVec3; 3]) {
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let (columns, rows) = (self.cells(0, low.x, high.x), self.cells(1, low.z, high.z));
        if columns.is_empty() || rows.is_empty() || self.is_out_of_sight(low.y, high.y) {
            return;
        }
        let (ab, ac) = (b - a, c - a);
        let det = ab.x * ac.z - ab.z * ac.x;
        if det.abs() < 1e-16 {
            return; // seen from its edge
        }
        let inverse = 1.0 / det;
        for i in columns {
            let x = self.middle(0, i) - a.x;
            for k in rows.clone() {
                let z = self.middle(1, k) - a.z;
                let u = (x * ac.z - z * ac.x) * inverse;
                let v = (ab.x * z - ab.z * x) * inverse;
                if u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 {
                    self.add(i, k, a.y + u * ab.y + v * ac.y);
                }
            }
        }
    }

    fn points(&self) -> [Vec<DVec3>; 2] {
        [0, 1].map(|side| {
            let cells = (0..self.n[0]).flat_map(|i| (0..self.n[1]).map(move |k| (i, k)));
            cells
                .filter(|(i, k)| !self.first[side][i * self.n[1] + k].is_nan())
                .map(|(i, k)| {
                    let y = self.first[side][i * self.n[1] + k];
                    DVec3::new(self.middle(0, i), y, self.middle(1, k))
                })
                .collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::close;
    use crate::gripper_geometry::BoxGripper;
    use crate::object::Region;
    use crate::test_meshes::cylinder;

    #[test]
    fn a_cylinder_is_seen_as_it_is() {
        let object = GraspObject::from_mesh(&cylinder(0.02, 0.1, 512), 1.0).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let closing =
            close(&object, &region, &gripper, &Pose::IDENTITY, [-0.02, 0.02], 1.5e-3).unwrap();
        let view = PadView::new(&object, &gripper, &closing);
        for (points, side) in view.points.iter().zip([-1.0, 1.0]) {
            let n_before = points.iter().filter(|p| view.before_pad(**p)).count();
            assert_eq!(n_before, 144, "the whole pad has the cylinder before it");
            for p in points {
                assert!((p.y - side * (4e-4 - p.x * p.x).sqrt()).abs() < 2e-5, "{p}");
            }
        }
        assert!((view.cell_area - 2.25e-6).abs() < 1e-12);
    }
}
