//! The nearest surface sample by table: where thousands of starts are tried, a search each is too
//! much.
//!
//! A sensor sees one side of a thin wall, and the nearest sample may lie on the other. So there are
//! six tables, one for each direction along an axis, each holding only the samples whose normal
//! leans that way; a query reads the table of its own normal's main axis.

use rayon::prelude::*;
use semfm_geom::math::{DVec3, bounds};

use crate::oriented_point::OrientedPoint;

/// Cells of one table: on a round object a cell measures about 6 % of the diagonal, well within the
/// basin of the exact search that follows, and all six tables fit the cache.
const CELLS: f64 = 8000.0;

/// A sample belongs to each table whose axis its normal leans to by at least this cosine, so that a
/// query whose normal is 20° off still finds it.
const LEAN: f64 = 0.3;

const NONE: u16 = u16::MAX;

/// The nearest sample for each cell of a grid, by the direction of its normal.
pub(crate) struct NearestTable {
    low: DVec3,
    per_unit: f64,
    dims: [usize; 3],
    /// For +x, −x, +y, −y, +z, −z: the id of a nearest sample for each cell.
    tables: [Vec<u16>; 6],
}

impl NearestTable {
    /// Tables over the samples' bounding box, widened by `margin` on each side. With `both_sides`,
    /// a normal's sign says nothing and each sample stands for both. At most 65 535 samples.
    pub fn new(samples: &[OrientedPoint], margin: f64, both_sides: bool) -> Self {
        let points: Vec<DVec3> = samples.iter().map(|s| s.point).collect();
        let (low, high) = bounds(&points).unwrap_or_default();
        let low = low - margin;
        let size = high + margin - low;
        let per_unit = (CELLS / (size.x * size.y * size.z)).cbrt();
        let dims = (size * per_unit).to_array().map(|n| (n.ceil() as usize).clamp(1, 128));
        let mut nearest = Self { low, per_unit, dims, tables: Default::default() };
        let tables: Vec<Vec<u16>> = (0..6usize)
            .into_par_iter()
            .map(|way| nearest.table(samples, |normal| leans(normal, way, both_sides)))
            .collect();
        for (slot, table) in nearest.tables.iter_mut().zip(tables) {
            *slot = table;
        }
        nearest
    }

    /// Id of a sample near `query` whose normal leans as `normal` does; the nearest one up to the
    /// width of a cell.
    pub fn nearest(&self, query: DVec3, normal: DVec3) -> Option<usize> {
        let axis = normal.abs().max_position();
        let way = 2 * axis + usize::from(normal[axis] < 0.0);
        let id = self.tables[way][self.slot(self.cell(query))];
        (id != NONE).then_some(usize::from(id))
    }

    /// Edge of a cell.
    pub fn cell_width(&self) -> f64 {
        1.0 / self.per_unit
    }

    fn cell(&self, point: DVec3) -> [usize; 3] {
        let place = (point - self.low) * self.per_unit;
        // `as` takes what lies below to 0.
        std::array::from_fn(|k| (place[k] as usize).min(self.dims[k] - 1))
    }

    fn slot(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.dims[1] + j) * self.dims[0] + i
    }

    fn centre(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        self.low + (DVec3::new(i as f64, j as f64, k as f64) + 0.5) / self.per_unit
    }

    /// Fast sweeping (Zhao 2005, without the distances): a cell takes over its neighbour's nearest
    /// sample where that is nearer than its own, in sweeps along all eight diagonals. Only samples
    /// whose normal is `wanted` are entered.
    fn table(&self, samples: &[OrientedPoint], wanted: impl Fn(DVec3) -> bool) -> Vec<u16> {
        let [nx, ny, nz] = self.dims;
        let mut table = vec![NONE; nx * ny * nz];
        let mut squared = vec![f64::INFINITY; nx * ny * nz];
        for (id, sample) in samples.iter().enumerate().filter(|(_, s)| wanted(s.normal)) {
            let cell = self.cell(sample.point);
            let at = self.slot(cell);
            let distance = self.centre(cell).distance_squared(sample.point);
            if distance < squared[at] {
                (table[at], squared[at]) = (id as u16, distance);
            }
        }
        let strides = [1, nx, nx * ny];
        for sweep in 0..8usize {
            let backward = [sweep & 1 != 0, sweep & 2 != 0, sweep & 4 != 0];
            for c in 0..nz {
                for b in 0..ny {
                    for a in 0..nx {
                        let steps = [a, b, c];
                        let cell = self.swept_cell(steps, backward);
                        let at = self.slot(cell);
                        let here = self.centre(cell);
                        for axis in 0..3 {
                            if steps[axis] == 0 {
                                continue;
                            }
                            let stride = strides[axis];
                            let from = if backward[axis] { at + stride } else { at - stride };
                            let id = table[from];
                            if id == NONE || id == table[at] {
                                continue;
                            }
                            let distance = here.distance_squared(samples[usize::from(id)].point);
                            if distance < squared[at] {
                                (table[at], squared[at]) = (id, distance);
                            }
                        }
                    }
                }
            }
        }
        table
    }

    /// The cell that a sweep reaches after so many steps along each axis.
    fn swept_cell(&self, steps: [usize; 3], backward: [bool; 3]) -> [usize; 3] {
        std::array::from_fn(|axis| {
            if backward[axis] { self.dims[axis] - 1 - steps[axis] } else { steps[axis] }
        })
    }
}

/// Whether a normal leans towards direction `way` of +x, −x, +y, −y, +z, −z.
fn leans(normal: DVec3, way: usize, both_sides: bool) -> bool {
    let sign = if way.is_multiple_of(2) { 1.0 } else { -1.0 };
    let cosine = sign * normal[way / 2];
    if both_sides { cosine.abs() >= LEAN } else { cosine >= LEAN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::{sampling::sample_uniform, zoo};

    #[test]
    fn the_table_answers_nearly_as_a_full_search_and_on_the_right_side() {
        let mesh = zoo::icosphere(3);
        let samples: Vec<OrientedPoint> = sample_uniform(&mesh, 1000, 1)
            .unwrap()
            .iter()
            .map(|s| OrientedPoint { point: s.point, normal: s.normal })
            .collect();
        let table = NearestTable::new(&samples, 0.5, false);
        for query in zoo::icosphere(2).vertices().iter().map(|p| 1.2 * p) {
            let normal = query.normalize();
            let found = samples[table.nearest(query, normal).unwrap()];
            let best = samples
                .iter()
                .filter(|s| s.normal.dot(normal) > 0.5)
                .map(|s| s.point.distance(query))
                .fold(f64::INFINITY, f64::min);
            assert!(found.point.distance(query) < best + 0.5 / table.per_unit * 3f64.sqrt() * 2.0);
            assert!(found.normal.dot(normal) > 0.0);
            // The far wall answers for a query that faces the other way.
            let behind = samples[table.nearest(query, -normal).unwrap()];
            let axis = normal.abs().max_position();
            assert!(behind.normal[axis] * normal[axis] < 0.0);
        }
    }
}
