//! Points spread over a surface: uniform by area, or as far from each other as they can be.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::math::DVec3;
use crate::{Error, Mesh, Result};

/// One point on a mesh: where it is, on which triangle, and the triangle's unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Triangle id.
    pub face: u32,
    /// Position.
    pub point: DVec3,
    /// Unit normal of the triangle.
    pub normal: DVec3,
}

/// `n` independent points, uniform by area (two uniforms per point, Osada et al. 2002, eq. 1).
///
/// The same seed gives the same points on every machine.
///
/// # Errors
/// [`Error::NoArea`] where every triangle is degenerate.
pub fn sample_uniform(mesh: &Mesh, n: usize, seed: u64) -> Result<Vec<SurfaceSample>> {
    let mut total = 0.0;
    let cumulative: Vec<f64> = (0..mesh.n_faces())
        .map(|face| {
            total += mesh.face_area(face);
            total
        })
        .collect();
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::NoArea { n_faces: mesh.n_faces() });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    Ok((0..n).map(|_| sample_one(mesh, &cumulative, &mut rng)).collect())
}

fn sample_one(mesh: &Mesh, cumulative: &[f64], rng: &mut impl Rng) -> SurfaceSample {
    let total = cumulative[cumulative.len() - 1];
    let pick = rng.random::<f64>() * total;
    // The first face whose cumulative area exceeds the pick has area, so it has a normal.
    let face = cumulative.partition_point(|&sum| sum <= pick).min(cumulative.len() - 1);
    let [a, b, c] = mesh.corners(face);
    let (u, v) = (rng.random::<f64>().sqrt(), rng.random::<f64>());
    let point = (1.0 - u) * a + u * (1.0 - v) * b + u * v * c;
    SurfaceSample {
        face: face as u32,
        point,
        normal: mesh.face_normal_scaled(face).normalize_or_zero(),
    }
}

/// `n` farthest-point samples out of `6 n` area-uniform ones: near-even cover of the surface.
///
/// # Errors
/// [`Error::NoArea`] where every triangle is degenerate.
pub fn sample_even(mesh: &Mesh, n: usize, seed: u64) -> Result<Vec<SurfaceSample>> {
    let dense = sample_uniform(mesh, 6 * n, seed)?;
    let points: Vec<DVec3> = dense.iter().map(|sample| sample.point).collect();
    Ok(farthest_points(&points, n).into_iter().map(|i| dense[i as usize]).collect())
}

/// Ids of `n` points (all of them where there are fewer), each the farthest from those before it,
/// starting with point 0 (Gonzalez 1985). Ties go to the lowest id.
///
/// Points lie in boxes that know how far their farthest is: a new point is compared with those of a box only where
/// the box is nearer than that (Han, Wang, Xu, Yan & Zhang, QuickFPS, 2023).
pub fn farthest_points(points: &[DVec3], n: usize) -> Vec<u32> {
    let n = n.min(points.len());
    let mut ids: Vec<u32> = (0..points.len() as u32).collect();
    let mut boxes = Vec::new();
    split_into_boxes(points, &mut ids, &mut boxes);
    let mut chosen = Vec::with_capacity(n);
    let mut next = 0;
    while chosen.len() < n {
        chosen.push(next);
        let newest = points[next as usize];
        let (mut farthest, mut id) = (f64::NEG_INFINITY, u32::MAX);
        for part in &mut boxes {
            part.add(next, newest);
            if part.farthest > farthest || (part.farthest == farthest && part.id < id) {
                (farthest, id) = (part.farthest, part.id);
            }
        }
        next = id;
    }
    chosen
}

/// Points of a box. Around 16 to 64 the time is the same.
const BOX_POINTS: usize = 32;

/// Some points that lie close together.
struct PointBox {
    low: DVec3,
    high: DVec3,
    /// Ids, ascending, with positions and squared distances to the nearest chosen point (−∞ for one that is chosen).
    points: Vec<(u32, DVec3, f64)>,
    /// Squared distance of the farthest, and its id.
    farthest: f64,
    id: u32,
}

impl PointBox {
    fn new(points: &[DVec3], ids: &mut [u32]) -> Self {
        ids.sort_unstable();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &id in &*ids {
            (low, high) = (low.min(points[id as usize]), high.max(points[id as usize]));
        }
        let points = ids.iter().map(|&id| (id, points[id as usize], f64::INFINITY)).collect();
        Self { low, high, points, farthest: f64::INFINITY, id: ids[0] }
    }

    /// Takes account of a point that was chosen.
    fn add(&mut self, newest: u32, at: DVec3) {
        // Rounding is monotonic, so this is at most the distance of any point in the box, to the last bit.
        let nearest_place = at.clamp(self.low, self.high);
        if at.distance_squared(nearest_place) > self.farthest {
            return;
        }
        (self.farthest, self.id) = (f64::NEG_INFINITY, u32::MAX);
        for (id, point, distance) in &mut self.points {
            *distance = if *id == newest {
                f64::NEG_INFINITY
            } else {
                distance.min(point.distance_squared(at))
            };
            if *distance > self.farthest {
                (self.farthest, self.id) = (*distance, *id);
            }
        }
    }
}

/// Halves the points along the longest side of their box until the parts are small.
fn split_into_boxes(points: &[DVec3], ids: &mut [u32], boxes: &mut Vec<PointBox>) {
    if ids.is_empty() {
        return;
    }
    if ids.len() <= BOX_POINTS {
        boxes.push(PointBox::new(points, ids));
        return;
    }
    let first = points[ids[0] as usize];
    let (low, high) = ids.iter().fold((first, first), |(low, high), &id| {
        (low.min(points[id as usize]), high.max(points[id as usize]))
    });
    let axis = (high - low).max_position();
    let half = ids.len() / 2;
    ids.select_nth_unstable_by(half, |&i, &j| {
        points[i as usize][axis].total_cmp(&points[j as usize][axis])
    });
    let (left, right) = ids.split_at_mut(half);
    split_into_boxes(points, left, boxes);
    split_into_boxes(points, right, boxes);
}

/// `count` unit vectors spread evenly over the sphere along a golden-angle spiral, from +z down to
/// −z and never exactly at a pole (offset Fibonacci lattice, González 2010).
pub fn fibonacci_directions(count: usize) -> impl Iterator<Item = DVec3> {
    let golden_turn = std::f64::consts::PI * (1.0 + 5f64.sqrt());
    (0..count).map(move |i| {
        let i = i as f64 + 0.5;
        let z = 1.0 - 2.0 * i / count as f64;
        let (sin, cos) = (golden_turn * i).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        DVec3::new(ring * cos, ring * sin, z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_square() -> Mesh {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    #[test]
    fn uniform_samples_fill_a_square_evenly() {
        let samples = sample_uniform(&unit_square(), 4000, 1).unwrap();
        let left = samples.iter().filter(|s| s.point.x < 0.25).count();
        assert!((900..1100).contains(&left), "a quarter of the area got {left} of 4000 samples");
    }

    #[test]
    fn farthest_points_never_repeat_even_on_one_spot() {
        let mut chosen = farthest_points(&[DVec3::ONE; 20], 12);
        chosen.sort_unstable();
        chosen.dedup();
        assert_eq!(chosen.len(), 12);
    }

    #[test]
    fn the_points_are_those_of_a_full_search_ties_included() {
        let samples = sample_uniform(&unit_square(), 700, 5).unwrap();
        let grid = (0..400).map(|i| DVec3::new(f64::from(i % 20), f64::from(i / 20), 0.0));
        let sets: [Vec<DVec3>; 2] = [samples.iter().map(|s| s.point).collect(), grid.collect()];
        for points in sets {
            let found = farthest_points(&points, 300);
            for (k, &id) in found.iter().enumerate().skip(1) {
                let distance = |p: DVec3| {
                    let chosen = found[..k].iter().map(|&j| points[j as usize]);
                    chosen.map(|q| p.distance_squared(q)).fold(f64::INFINITY, f64::min)
                };
                let best = (0..points.len()).fold(0, |best, i| {
                    if distance(points[i]) > distance(points[best]) { i } else { best }
                });
                assert_eq!(id as usize, best, "point {k}");
            }
        }
    }

    #[test]
    fn even_samples_keep_their_distance() {
        let even = sample_even(&unit_square(), 100, 3).unwrap();
        let closest = (0..100)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| even[i].point.distance(even[j].point))
            .fold(f64::INFINITY, f64::min);
        assert!(closest > 0.06, "two of 100 even samples are {closest} apart");
    }
}
