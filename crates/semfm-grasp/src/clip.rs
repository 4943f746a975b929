//! Polygons cut by planes across an axis, with a weight that varies linearly over them.

use semfm_geom::math::DVec3;

/// A triangle cut by the six sides of a box has at most nine corners.
const MOST: usize = 10;

/// A convex planar polygon; each corner has a position and a weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polygon {
    corners: [(DVec3, f64); MOST],
    n: usize,
}

/// The plane `sign · p[axis] = bound`.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    sign: f64,
    bound: f64,
}

impl Plane {
    /// Signed distance from the plane, positive on the side that is cut off.
    fn height(self, p: DVec3) -> f64 {
        self.sign * p[self.axis] - self.bound
    }
}

impl Polygon {
    /// A triangle with the weights of its corners.
    pub(crate) fn triangle(points: [DVec3; 3], weights: [f64; 3]) -> Self {
        let mut corners = [(DVec3::ZERO, 0.0); MOST];
        for k in 0..3 {
            corners[k] = (points[k], weights[k]);
        }
        Self { corners, n: 3 }
    }

    /// Corners with their weights.
    pub(crate) fn corners(&self) -> &[(DVec3, f64)] {
        &self.corners[..self.n]
    }

    /// Keeps the part where `sign · p[axis] ≤ bound` (Sutherland & Hodgman 1974).
    pub(crate) fn clip(&mut self, axis: usize, sign: f64, bound: f64) {
        let plane = Plane { axis, sign, bound };
        if self.corners().iter().all(|c| plane.height(c.0) <= 0.0) {
            return;
        }
        let (old, n) = (self.corners, self.n);
        self.n = 0;
        for i in 0..n {
            let (a, b) = (old[i], old[(i + 1) % n]);
            let (ha, hb) = (plane.height(a.0), plane.height(b.0));
            if ha <= 0.0 {
                self.push(a);
            }
            if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
                let t = ha / (ha - hb);
                let mut p = a.0.lerp(b.0, t);
                p[axis] = sign * bound;
                self.push((p, a.1 + t * (b.1 - a.1)));
            }
        }
    }

    /// The triangles of the fan around the first corner.
    pub(crate) fn fan(&self) -> impl Iterator<Item = [(DVec3, f64); 3]> + '_ {
        (2..self.n.max(2)).map(|i| [self.corners[0], self.corners[i - 1], self.corners[i]])
    }

    fn push(&mut self, corner: (DVec3, f64)) {
        // Rounding could add a corner to a sliver; losing one there loses no area.
        if self.n < MOST {
            self.corners[self.n] = corner;
            self.n += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &Polygon) -> f64 {
        polygon.fan().map(|[a, b, c]| (b.0 - a.0).cross(c.0 - a.0).length() / 2.0).sum()
    }

    #[test]
    fn cuts_add_up_and_weights_stay_linear() {
        let points = [DVec3::ZERO, DVec3::new(2.0, 0.0, 1.0), DVec3::new(0.0, 2.0, 3.0)];
        let weights = points.map(|p| 0.3 * p.x - 0.2 * p.y + 0.1);
        let whole = Polygon::triangle(points, weights);
        let mut sum = 0.0;
        for sign in [-1.0, 1.0] {
            let mut part = whole;
            part.clip(0, sign, sign * 0.7);
            part.clip(2, 1.0, 9.0);
            sum += area(&part);
            for &(p, w) in part.corners() {
                assert!(sign * p.x <= sign * 0.7 + 1e-12);
                assert!((w - (0.3 * p.x - 0.2 * p.y + 0.1)).abs() < 1e-12);
            }
        }
        assert!((sum - area(&whole)).abs() < 1e-12);
        let mut none = whole;
        none.clip(1, 1.0, -1.0);
        assert!(none.corners().is_empty() && none.fan().next().is_none());
    }
}
