//! Points in an order in which those near each other in space are near each other in memory.
//!
//! The cheapest collapse may be anywhere, but what it reads lies around it: on a million triangles this takes half of
//! the time of vertices in the order of a file. Pictures of such meshes are drawn in it, too.

use crate::math::{DVec3, bounds};

/// Bits of each coordinate in a Morton code.
const BITS: u32 = 16;

/// Numbers along a Morton curve (Morton, "A computer oriented geodetic data base", 1966) beside names, the places in
/// the list of points.
///
/// ```
/// use semfm_geom::{SpatialOrder, math::DVec3};
/// let order = SpatialOrder::new(&[DVec3::ONE, DVec3::ZERO]);
/// assert_eq!(order.name_of, [1, 0]);
/// ```
#[derive(Clone, Debug)]
pub struct SpatialOrder {
    /// For each number its name.
    pub name_of: Vec<u32>,
    /// For each name its number.
    pub number_of: Vec<u32>,
}

impl SpatialOrder {
    /// Sorts points; those whose places agree to a 65536th of the longest side of their box keep their order.
    pub fn new(points: &[DVec3]) -> Self {
        let (low, high) = bounds(points).unwrap_or_default();
        let side = (high - low).max_element();
        let scale = if side > 0.0 { f64::from((1 << BITS) - 1) / side } else { 0.0 };
        let mut keys: Vec<(u64, u32)> = (0..)
            .zip(points)
            .map(|(name, &p)| (morton(((p - low) * scale).to_array().map(|x| x as u64)), name))
            .collect();
        keys.sort_unstable();
        let name_of: Vec<u32> = keys.into_iter().map(|(_, name)| name).collect();
        let mut number_of = vec![0; points.len()];
        for (number, &name) in (0..).zip(&name_of) {
            number_of[name as usize] = number;
        }
        Self { name_of, number_of }
    }
}

/// The bits of three numbers in turns.
fn morton(place: [u64; 3]) -> u64 {
    (0..BITS).fold(0, |code, bit| {
        place
            .iter()
            .zip(0..)
            .fold(code, |code, (x, axis)| code | ((x >> bit & 1) << (3 * bit + axis)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_belong_together_and_neighbours_stay_near() {
        let grid: Vec<DVec3> =
            (0..4096).map(|i| DVec3::new(f64::from(i * 37 % 64), f64::from(i / 64), 0.0)).collect();
        let order = SpatialOrder::new(&grid);
        assert!((0..4096).all(|name| order.name_of[order.number_of[name] as usize] == name as u32));
        let steps = order.name_of.windows(2);
        let length: f64 = steps.map(|w| grid[w[0] as usize].distance(grid[w[1] as usize])).sum();
        assert!(length < 2.0 * 4096.0, "a step is {} long", length / 4096.0);
        assert_eq!(SpatialOrder::new(&[DVec3::ONE; 3]).name_of, [0, 1, 2]);
    }
}
