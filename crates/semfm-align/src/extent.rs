//! Where most points of a cloud lie, along the axes of a line of sight.

use semfm_geom::math::DVec3;

/// Share of the points that each border of a robust extent leaves outside.
const OUTSIDE: f64 = 0.04;

/// Axes of a line of sight: unit vectors, orthogonal to each other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewAxes {
    pub right: DVec3,
    pub down: DVec3,
    pub forward: DVec3,
}

impl ViewAxes {
    /// Looking along `forward`, which need not be a unit vector.
    pub fn along(forward: DVec3) -> Self {
        let forward = forward.try_normalize().unwrap_or(DVec3::Z);
        let (right, down) = forward.any_orthonormal_pair();
        Self { right, down, forward }
    }

    /// Right, down, forward.
    pub fn to_array(self) -> [DVec3; 3] {
        [self.right, self.down, self.forward]
    }
}

/// Where most points lie, along the axes of a line of sight: robust borders across it, the median
/// along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub centre: [f64; 3],
    pub size: [f64; 3],
}

impl Extent {
    /// `None` without points.
    pub fn of(points: &[DVec3], axes: ViewAxes) -> Option<Self> {
        let mut extent = Self { centre: [0.0; 3], size: [0.0; 3] };
        for (k, axis) in axes.to_array().into_iter().enumerate() {
            let mut along: Vec<f64> = points.iter().map(|p| p.dot(axis)).collect();
            let outside = (OUTSIDE * along.len() as f64) as usize;
            let last = along.len().checked_sub(1)?;
            let low = order_statistic(&mut along, outside);
            let middle = order_statistic(&mut along, last / 2);
            let high = order_statistic(&mut along, last - outside);
            extent.centre[k] = if k < 2 { (low + high) / 2.0 } else { middle };
            extent.size[k] = high - low;
        }
        Some(extent)
    }

    /// Diagonal of the three sizes.
    pub fn diameter(&self) -> f64 {
        diagonal(&self.size)
    }

    /// Diagonal of the two sizes across the line of sight.
    pub fn width(&self) -> f64 {
        diagonal(&self.size[..2])
    }
}

fn diagonal(sizes: &[f64]) -> f64 {
    sizes.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The value at `place` once the values are in ascending order; they are reordered.
pub(crate) fn order_statistic(values: &mut [f64], place: usize) -> f64 {
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_far_points_do_not_change_the_extent() {
        let axes = ViewAxes { right: DVec3::X, down: DVec3::Y, forward: DVec3::Z };
        let mut points: Vec<DVec3> =
            (0..=100).map(|i| DVec3::new(f64::from(i), 2.0 * f64::from(i), 5.0)).collect();
        points.push(DVec3::splat(1e6));
        let extent = Extent::of(&points, axes).unwrap();
        assert_eq!(extent.centre[2], 5.0);
        assert!((extent.size[0] - 93.0).abs() < 1.5 && (extent.size[1] - 186.0).abs() < 3.0);
        assert!(Extent::of(&[], axes).is_none());
    }
}
