//! How far a point is from the planes that a vertex stands for (Garland & Heckbert 1997).

use crate::math::DVec3;

/// Sum of squared distances to planes, weighted by area: pᵀ A p + 2 bᵀ p + c.
#[derive(Clone, Copy)]
pub(super) struct Quadric {
    /// A, symmetric: its diagonal, and xy, xz, yz.
    diagonal: DVec3,
    mixed: DVec3,
    b: DVec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    pub(super) const ZERO: Self =
        Self { diagonal: DVec3::ZERO, mixed: DVec3::ZERO, b: DVec3::ZERO, c: 0.0, weight: 0.0 };

    /// The plane through `point`; the length of `normal` is the weight.
    pub(super) fn add_plane(&mut self, normal: DVec3, point: DVec3) {
        let weight = normal.length();
        if weight <= 0.0 {
            return;
        }
        let unit = normal / weight;
        let offset = -unit.dot(point);
        let DVec3 { x, y, z } = unit;
        self.diagonal += unit * unit * weight;
        self.mixed += DVec3::new(x * y, x * z, y * z) * weight;
        self.b += unit * offset * weight;
        self.c += offset * offset * weight;
        self.weight += weight;
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.diagonal += other.diagonal;
        self.mixed += other.mixed;
        self.b += other.b;
        self.c += other.c;
        self.weight += other.weight;
    }

    /// Mean squared distance of `point` from the planes.
    pub(super) fn squared_distance(&self, point: DVec3) -> f64 {
        if self.weight <= 0.0 {
            return 0.0;
        }
        let (DVec3 { x: xx, y: yy, z: zz }, DVec3 { x: xy, y: xz, z: yz }) =
            (self.diagonal, self.mixed);
        let DVec3 { x, y, z } = point;
        let image = DVec3::new(
            xx * x + xy * y + xz * z,
            xy * x + yy * y + yz * z,
            xz * x + yz * y + zz * z,
        );
        let sum = point.dot(image) + 2.0 * self.b.dot(point) + self.c;
        sum.max(0.0) / self.weight
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_is_the_mean_over_the_planes_weighted_by_area() {
        let mut quadric = Quadric::ZERO;
        assert_eq!(quadric.squared_distance(DVec3::ONE), 0.0);
        quadric.add_plane(3.0 * DVec3::X, DVec3::ZERO);
        let mut other = Quadric::ZERO;
        other.add_plane(DVec3::Y, 2.0 * DVec3::Y);
        quadric.add(&other);
        // One from the first plane, three from the second.
        let found = quadric.squared_distance(DVec3::new(1.0, -1.0, 5.0));
        assert!((found - (3.0 * 1.0 + 9.0) / 4.0).abs() < 1e-12);
    }
}
