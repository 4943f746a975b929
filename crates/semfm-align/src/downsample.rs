//! Fewer points, spread evenly, each with the normal of its surroundings.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

use nalgebra::{Matrix3, SymmetricEigen};
use semfm_geom::math::DVec3;

use crate::extent::order_statistic;

/// Cells that hold points; with as many, those around a place span about a sixth of an object.
const N_CELLS: usize = 400;

/// Points that a cell holds on average, at least.
const PER_CELL: usize = 6;

/// Fewer points than this around a place say nothing about its normal.
const FOR_A_NORMAL: f64 = 5.0;

/// A point of the cloud and the unit normal of the surface it lies on, of either sign; `None`
/// where the surroundings are no surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SampledPoint {
    pub point: DVec3,
    pub normal: Option<DVec3>,
}

/// `n_wanted` of the points (all of them where there are fewer), themselves and not means, so that a
/// clean cloud stays clean. The normals are those of planes through all points of the 27 cells
/// around (PCA).
///
/// The points are listed cell by cell, cells in the order of their first points, and every so many
/// is taken: each is as likely as any other, and they are spread like the cloud. One point for each
/// cell would be more even, but biased: noise that crosses into a cell of its own would count as
/// much as the many that stayed (measured on thirty views of ten objects: scales too small by 1.4
/// standard deviations on average, against .4 now).
pub(crate) fn downsample(points: &[DVec3], n_wanted: usize) -> Vec<SampledPoint> {
    let n_cells = N_CELLS.min(points.len() / PER_CELL).max(1);
    let grid = Grid::with_about(points, n_cells);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); grid.cells.len()];
    for (id, &cell) in grid.cell_of.iter().enumerate() {
        members[cell as usize].push(id as u32);
    }
    let n = n_wanted.min(points.len());
    let mut sampled = Vec::with_capacity(n);
    let mut before = 0;
    for (cell, ids) in members.iter().enumerate() {
        // Of the first m points, ⌈m n / all⌉ are taken.
        let [first, end] = [before, before + ids.len()].map(|m| (m * n).div_ceil(points.len()));
        let taken = first..end;
        if !taken.is_empty() {
            let normal = grid.normal(cell);
            sampled.extend(taken.map(|i| {
                let id = ids[i * points.len() / n - before];
                SampledPoint { point: points[id as usize], normal }
            }));
        }
        before += ids.len();
    }
    sampled
}

/// Sums over the points of one cell, taken from the cell's first point for precision.
#[derive(Clone, Debug)]
struct Cell {
    place: [i32; 3],
    origin: DVec3,
    n: f64,
    sum: DVec3,
    /// xx, yy, zz, xy, xz, yz of the offsets from `origin`.
    products: [f64; 6],
}

struct Grid {
    cells: Vec<Cell>,
    ids: HashMap<u64, u32, Mixed>,
    cell_of: Vec<u32>,
}

impl Grid {
    /// The grid whose number of occupied cells is near `n_cells`.
    fn with_about(points: &[DVec3], n_cells: usize) -> Self {
        // A surface of the cloud's size takes about size² / edge² cells.
        let mut edge = typical_size(points) / (n_cells as f64).sqrt();
        for _ in 0..3 {
            let found = occupied(points, edge);
            let ratio = found as f64 / n_cells as f64;
            if (0.8..1.25).contains(&ratio) {
                break;
            }
            edge *= ratio.sqrt();
        }
        Self::new(points, edge)
    }

    fn new(points: &[DVec3], edge: f64) -> Self {
        let mut grid = Self {
            cells: Vec::new(),
            ids: HashMap::default(),
            cell_of: Vec::with_capacity(points.len()),
        };
        for &point in points {
            let place = place(point, edge);
            let id = *grid.ids.entry(key(place)).or_insert_with(|| {
                let sum = DVec3::ZERO;
                grid.cells.push(Cell { place, origin: point, n: 0.0, sum, products: [0.0; 6] });
                grid.cells.len() as u32 - 1
            });
            let cell = &mut grid.cells[id as usize];
            let d = point - cell.origin;
            cell.n += 1.0;
            cell.sum += point;
            let products = [d.x * d.x, d.y * d.y, d.z * d.z, d.x * d.y, d.x * d.z, d.y * d.z];
            cell.products.iter_mut().zip(products).for_each(|(sum, x)| *sum += x);
            grid.cell_of.push(id);
        }
        grid
    }

    /// Normal of the plane through all points of the 27 cells around `cell`: the eigenvector with the
    /// least eigenvalue of
    ///
    /// > Σ = ⟨d dᵀ⟩ − ⟨d⟩⟨d⟩ᵀ
    ///
    /// over their offsets d from this cell's origin. A neighbour has kept its sums S = Σ e and
    /// P = Σ e eᵀ over offsets e from its own origin, m away: d = e + m, so that
    ///
    /// > Σ d dᵀ = P + m Sᵀ + S mᵀ + n m mᵀ
    fn normal(&self, cell: usize) -> Option<DVec3> {
        let here = &self.cells[cell];
        let (mut n, mut sum, mut products) = (0.0, DVec3::ZERO, [0.0; 6]);
        for i in 0..27 {
            let place = std::array::from_fn(|k| here.place[k] + (i / 3i32.pow(k as u32)) % 3 - 1);
            let Some(&id) = self.ids.get(&key(place)) else { continue };
            let cell = &self.cells[id as usize];
            // Offsets from this cell's origin instead of the neighbour's own.
            let move_by = cell.origin - here.origin;
            let own = cell.sum - cell.n * cell.origin;
            n += cell.n;
            sum += own + cell.n * move_by;
            for (slot, (i, j)) in
                [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate()
            {
                products[slot] += cell.products[slot]
                    + move_by[i] * own[j]
                    + own[i] * move_by[j]
                    + cell.n * move_by[i] * move_by[j];
            }
        }
        if n < FOR_A_NORMAL {
            return None;
        }
        let mean = sum / n;
        let [xx, yy, zz, xy, xz, yz] = products.map(|x| x / n);
        let covariance = Matrix3::new(
            xx - mean.x * mean.x,
            xy - mean.x * mean.y,
            xz - mean.x * mean.z,
            xy - mean.x * mean.y,
            yy - mean.y * mean.y,
            yz - mean.y * mean.z,
            xz - mean.x * mean.z,
            yz - mean.y * mean.z,
            zz - mean.z * mean.z,
        );
        let eigen = SymmetricEigen::new(covariance);
        let least = eigen.eigenvalues.imin();
        let column = eigen.eigenvectors.column(least);
        // Points on a line have no normal: their two small eigenvalues are alike.
        let mut values: [f64; 3] = eigen.eigenvalues.into();
        values.sort_by(f64::total_cmp);
        let is_surface = values[1] > 4.0 * values[0].max(0.0) && values[1] > 1e-6 * values[2];
        is_surface.then(|| DVec3::new(column[0], column[1], column[2]).normalize_or_zero())
    }
}

/// Cells along each axis that have keys of their own, either way from the origin; what lies beyond
/// shares the outermost.
const FARTHEST: f64 = 1_000_000.0;

fn place(point: DVec3, edge: f64) -> [i32; 3] {
    // `as` takes NaN, which 0 · ∞ could make, to 0.
    (point / edge).floor().to_array().map(|x| x.clamp(-FARTHEST, FARTHEST) as i32)
}

/// 21 bits for each axis.
fn key(place: [i32; 3]) -> u64 {
    place.iter().fold(0, |key, &x| key << 21 | (i64::from(x) + (1 << 20)) as u64)
}

fn occupied(points: &[DVec3], edge: f64) -> usize {
    points.iter().map(|&p| key(place(p, edge))).collect::<HashSet<_, Mixed>>().len()
}

/// A hash for keys of one number, several times faster than the standard one, whose protection
/// against chosen keys is of no use here: the worst cloud only makes its own search slow.
#[derive(Default)]
struct Mixer(u64);

type Mixed = BuildHasherDefault<Mixer>;

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    /// The finaliser of SplitMix64 (Steele, Lea & Flood 2014).
    fn write_u64(&mut self, key: u64) {
        let z = (self.0 ^ key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        self.0 = z ^ z >> 31;
    }
}

/// A length that a few far points do not change: twice the median distance from the median point.
/// Positive, whatever the points.
fn typical_size(points: &[DVec3]) -> f64 {
    let every = points.len().div_ceil(4096);
    let some: Vec<DVec3> = points.iter().step_by(every).copied().collect();
    let centre = std::array::from_fn(|k| median(some.iter().map(|p| p[k]).collect()));
    let centre = DVec3::from_array(centre);
    let size = 2.0 * median(some.iter().map(|p| p.distance(centre)).collect());
    // All points on one spot: any length will do that is not 0.
    size.max(1e-9 * (1.0 + centre.length()))
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    order_statistic(&mut values, middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::{sampling::sample_uniform, zoo};

    #[test]
    fn points_of_a_sphere_stay_themselves_and_get_its_normals() {
        let cloud: Vec<DVec3> = sample_uniform(&zoo::icosphere(4), 20_000, 1)
            .unwrap()
            .iter()
            .map(|s| s.point)
            .collect();
        let sampled = downsample(&cloud, 800);
        assert_eq!(sampled.len(), 800);
        for p in &sampled {
            let cosine = p.normal.unwrap().dot(p.point.normalize()).abs();
            assert!(cosine > 0.95, "{cosine}");
            assert!(cloud.contains(&p.point));
        }
    }

    #[test]
    fn few_points_a_line_and_a_far_point_are_accepted() {
        assert_eq!(downsample(&[DVec3::ONE; 40], 100).len(), 40);
        assert_eq!(downsample(&[DVec3::ONE], 100).len(), 1);
        let line: Vec<DVec3> = (0..200).map(|i| f64::from(i) * DVec3::X).collect();
        assert!(downsample(&line, 50).iter().all(|p| p.normal.is_none()));
        let mut far = line;
        far.push(1e300 * DVec3::Y);
        assert_eq!(downsample(&far, 50).len(), 50);
    }
}
