//! How the force of a grip is spread over a pad.

use semfm_geom::math::DVec3;

/// Stiffness of a pad, N/m³: rubber of 1.5 MPa, 3 mm thick; 30 N press a full pad of 18 mm in by .2 mm.
/// `bench/physics.py` takes the same.
pub(crate) const FOUNDATION: f64 = 5e8;

/// Mean distance of a square's points from its middle, for a side of one: (√2 + ln(1 + √2)) / 6.
const MEAN_DISTANCE: f64 = 0.3826;

/// The pressure of one pad on what lies before it, as an elastic foundation has it (Winkler 1867): at each
/// place the pressure is its stiffness times the depth to which the object stands in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pressure {
    /// How deep the object's first point stands in the pad, metres.
    pub(crate) depth: f64,
    /// Where the force acts: the mean place, weighted by pressure, in the TCP's frame.
    pub(crate) centre: DVec3,
    /// Mean distance from the centre, weighted by pressure, metres: the torque about the closing axis that
    /// friction can hold, for a unit of friction times force.
    pub(crate) radius: f64,
    /// Area that an even pressure would need for the same mean square: (Σ p)² / Σ p² cells, m².
    pub(crate) area: f64,
}

impl Pressure {
    /// The pressure on a point, spread over a cell.
    pub(crate) fn of_point(centre: DVec3, cell_area: f64) -> Self {
        let radius = MEAN_DISTANCE * cell_area.sqrt();
        Self { depth: 0.0, centre, radius, area: cell_area }
    }
}

/// What lies before a pad, to be pressed with several forces.
pub(crate) struct PressedSurface {
    points: Vec<DVec3>,
    /// Heights of the points above the pad at rest, -side · y: the pad moves against them. Ascending.
    heights: Vec<f64>,
    side: f64,
    cell_area: f64,
}

impl PressedSurface {
    /// Points before the pad that is pushed along +y (`side` -1) or -y (`side` +1); each stands for `cell_area` m².
    pub(crate) fn new(points: Vec<DVec3>, side: f64, cell_area: f64) -> Self {
        let mut heights: Vec<f64> = points.iter().map(|p| -side * p.y).collect();
        heights.sort_unstable_by(f64::total_cmp);
        Self { points, heights, side, cell_area }
    }

    /// The pressure of a force, newtons. `None` where there are no points.
    pub(crate) fn pressure(&self, force: f64) -> Option<Pressure> {
        let first = *self.heights.first()?;
        let stop = stop(&self.heights, force / (FOUNDATION * self.cell_area));
        let depth = |p: &DVec3| stop + self.side * p.y;
        let pressed = || self.points.iter().map(|p| (p, depth(p))).filter(|(_, d)| *d > 0.0);
        let (mut total, mut squares, mut moment) = (0.0, 0.0, DVec3::ZERO);
        for (p, depth) in pressed() {
            total += depth;
            squares += depth * depth;
            moment += depth * *p;
        }
        let centre = moment / total;
        let distance = |p: &DVec3| (p.x - centre.x).hypot(p.z - centre.z);
        let radius = pressed().map(|(p, depth)| depth * distance(p)).sum::<f64>() / total;
        let radius = radius.max(MEAN_DISTANCE * self.cell_area.sqrt());
        let area = total * total / squares * self.cell_area;
        Some(Pressure { depth: stop - first, centre, radius, area })
    }
}

/// The height at which Σ max(0, stop − h) is `sum`; heights ascend.
fn stop(heights: &[f64], sum: f64) -> f64 {
    let mut below = 0.0;
    for (n, &height) in heights.iter().enumerate() {
        below += height;
        let stop = (sum + below) / (n + 1) as f64;
        if heights.get(n + 1).is_none_or(|&next| stop <= next) {
            return stop;
        }
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: f64 = 1.5e-3;

    /// A pad of 12 × 12 cells before a surface of the heights `y`.
    fn surface(y: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
        let at = |i: usize| (i as f64 - 5.5) * CELL;
        let places = (0..144).map(|i| (at(i / 12), at(i % 12)));
        places.map(|(x, z)| DVec3::new(x, y(x, z), z)).collect()
    }

    fn pressed(points: Vec<DVec3>, side: f64) -> Option<Pressure> {
        PressedSurface::new(points, side, CELL * CELL).pressure(30.0)
    }

    #[test]
    fn a_flat_face_is_pressed_evenly() {
        let pressure = pressed(surface(|_, _| -0.01), -1.0).unwrap();
        let area = 0.018f64 * 0.018;
        assert!((pressure.depth - 30.0 / (FOUNDATION * area)).abs() < 1e-9);
        assert!((pressure.area - area).abs() < 1e-9);
        assert!(pressure.centre.distance(-0.01 * DVec3::Y) < 1e-9);
        let mean = 0.018 * MEAN_DISTANCE;
        assert!((pressure.radius - mean).abs() < 0.01 * mean);
    }

    #[test]
    fn a_slope_is_pressed_on_its_higher_side_on_both_pads() {
        for side in [-1.0, 1.0] {
            let slope = surface(|x, _| side * (0.01 + 0.2 * x));
            let pressure = pressed(slope, side).unwrap();
            assert!(pressure.centre.x > 3e-3, "{pressure:?}");
            // ∫ k (depth − .2 t) dt over the pressed width, times the pad's length, is the force.
            let expected = (2.0 * 0.2 * 30.0 / (FOUNDATION * 0.018)).sqrt();
            assert!((pressure.depth - expected).abs() < 0.15 * expected, "{pressure:?}");
        }
        assert!(pressed(Vec::new(), 1.0).is_none());
    }
}
