//! The mesh that is sought: in units of its own radius, sampled, indexed.

use std::collections::HashSet;
use std::ops::RangeInclusive;

use rayon::prelude::*;
use semfm_geom::math::DVec3;
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, SurfaceIndex, Task};

use crate::nearest_table::NearestTable;
use crate::oriented_point::OrientedPoint;
use crate::rotations::super_fibonacci;
use crate::sim3::Sim3;
use crate::{Error, Result};

/// Samples of the surface, uniform by area: about 3 % of the diagonal apart on a round object.
const N_SAMPLES: usize = 2000;

/// How far the tables of nearest samples reach beyond the object, in its radii.
const REACH: f64 = 0.4;

/// Rays that find out which way the triangles face.
const N_RAYS: usize = 128;

/// From this share of rays on that meet a front (or a back), the winding is believed.
const WOUND: f64 = 0.9;

/// 78°: a triangle that leans further away from a point's normal is another side of the object.
const LEAST_COSINE: f64 = 0.2;

/// Coordinates that the fourth powers of lengths leave within the range of numbers.
const RANGE: RangeInclusive<f64> = 1e-60..=1e60;

/// Least size of a mesh as a share of its distance from the origin: coordinates have sixteen digits.
const LEAST_SIZE: f64 = 1e-9;

/// Edge of the cells (radii) in which the corners of two copies of a triangle lie together.
const COPIES: f64 = 1e-6;

/// A mesh that observations are aligned to, prepared once for many of them.
///
/// Inside, lengths are radii of the object from the centre of its bounding box, so that any frame
/// and any unit will do. Triangles may be wound outward, inward or anyhow; the last costs the
/// distinction between the two sides of a thin wall.
pub struct AlignModel {
    /// Mesh frame from the inner one.
    pub(crate) object_from_unit: Sim3,
    pub(crate) surface: SurfaceIndex,
    /// Unit normals of the triangles, outward; zero for a degenerate triangle.
    pub(crate) normals: Vec<DVec3>,
    /// Whether the sign of a normal says nothing.
    pub(crate) both_sides: bool,
    pub(crate) samples: Vec<OrientedPoint>,
    /// Of the surface, in the inner frame.
    pub(crate) area: f64,
    pub(crate) nearest: NearestTable,
}

impl AlignModel {
    /// Prepares a mesh (about 15 ms for 16 000 triangles).
    ///
    /// # Errors
    /// [`semfm_geom::Error::NoArea`] for a mesh without area, [`semfm_geom::Error::Cancelled`].
    pub fn new(mesh: &Mesh, seed: u64, task: &Task) -> Result<Self> {
        task.check()?;
        check_range(mesh)?;
        let (centre, radius) = mesh.bounding_sphere();
        if radius <= 0.0 || mesh.area() <= 0.0 {
            return Err(semfm_geom::Error::NoArea { n_faces: mesh.n_faces() }.into());
        }
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&p| (p - centre) / radius).collect();
        let faces = without_copies(&points, mesh.faces());
        let unit = Mesh::new(points, faces)?;
        let surface = SurfaceIndex::new(&unit)?;
        task.check()?;
        let mut normals: Vec<DVec3> = (0..unit.n_faces())
            .map(|face| unit.face_normal_scaled(face).normalize_or_zero())
            .collect();
        let front = front_share(&surface, &normals);
        if front <= 1.0 - WOUND {
            normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        let both_sides = front > 1.0 - WOUND && front < WOUND;
        let samples: Vec<OrientedPoint> = sample_uniform(&unit, N_SAMPLES, seed)?
            .iter()
            .map(|s| OrientedPoint { point: s.point, normal: normals[s.face as usize] })
            .collect();
        let nearest = NearestTable::new(&samples, REACH, both_sides);
        let object_from_unit = Sim3 { scale: radius, translation: centre, ..Sim3::IDENTITY };
        let area = unit.area();
        Ok(Self { object_from_unit, surface, normals, both_sides, samples, area, nearest })
    }

    /// The nearest point of the surface within a distance, among the triangles that lean as
    /// `normal` does (or the other way, where `unsigned`), and its normal. All in the inner frame.
    pub(crate) fn closest(
        &self,
        query: DVec3,
        normal: DVec3,
        within: f64,
        unsigned: bool,
    ) -> Option<OrientedPoint> {
        let hit = self.surface.closest_among(query, within, |face| {
            agreement(self.normals[face as usize], normal, unsigned) >= LEAST_COSINE
        })?;
        Some(OrientedPoint { point: hit.point, normal: self.normals[hit.face as usize] })
    }

    /// As [`Self::closest`], from the table of samples: the nearest one up to the width of a cell.
    pub(crate) fn closest_sample(
        &self,
        query: DVec3,
        normal: DVec3,
        unsigned: bool,
    ) -> Option<OrientedPoint> {
        let sample = |normal| self.nearest.nearest(query, normal).map(|id| self.samples[id]);
        // With both sides in the table already, the second look would find the same.
        let other = (unsigned && !self.both_sides).then(|| sample(-normal)).flatten();
        let same = sample(normal);
        let squared = |s: &OrientedPoint| s.point.distance_squared(query);
        same.into_iter().chain(other).min_by(|a, b| squared(a).total_cmp(&squared(b)))
    }
}

/// Refuses coordinates whose squares leave the range of numbers, or whose differences are lost beside
/// their distance from the origin.
fn check_range(mesh: &Mesh) -> Result<()> {
    let largest = mesh.vertices().iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    let size = mesh.diagonal();
    if largest > 0.0 && !RANGE.contains(&largest) {
        let expected = format!("coordinates from {:e} to {:e}", RANGE.start(), RANGE.end());
        let found = format!("{largest:e} at most");
        return Err(Error::OutOfRange { what: "mesh", expected, found });
    }
    if size > 0.0 && size < LEAST_SIZE * largest {
        let expected = "a mesh near its own origin (move it there)".into();
        let found = format!("a size of {size:e} at a distance of {largest:e}");
        return Err(Error::OutOfRange { what: "mesh", expected, found });
    }
    Ok(())
}

/// The triangles, each once: of those whose corners lie in the same cells of a fine grid and are wound
/// alike, the first. Thousands in one place would all be asked for each point that lies near.
fn without_copies(points: &[DVec3], faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let cell =
        |vertex: u32| (points[vertex as usize] / COPIES).round().to_array().map(|x| x as i32);
    let mut seen = HashSet::with_capacity(faces.len());
    let is_new = |face: &&[u32; 3]| {
        let mut cells = face.map(cell);
        let first = (0..3).min_by_key(|&i| cells[i]).unwrap_or_default();
        cells.rotate_left(first);
        seen.insert(cells)
    };
    faces.iter().filter(is_new).copied().collect()
}

/// Cosine between two normals; its absolute value where the sign of one says nothing.
pub(crate) fn agreement(a: DVec3, b: DVec3, unsigned: bool) -> f64 {
    let cosine = a.dot(b);
    if unsigned { cosine.abs() } else { cosine }
}

impl std::fmt::Debug for AlignModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AlignModel")
            .field("n_triangles", &self.normals.len())
            .field("radius", &self.object_from_unit.scale)
            .field("both_sides", &self.both_sides)
            .finish_non_exhaustive()
    }
}

/// Of the triangles that are seen first from outside, the share whose front is seen.
fn front_share(surface: &SurfaceIndex, normals: &[DVec3]) -> f64 {
    let fronts: Vec<bool> = super_fibonacci(N_RAYS)
        .collect::<Vec<_>>()
        .par_iter()
        .filter_map(|turn| {
            // Parallel to the axis, at places spread over the middle of the object.
            let (from, aside) = (turn.mul_vec3(2.0 * DVec3::Z), turn.mul_vec3(DVec3::X) * turn.w);
            let hit = surface.first_hit(from + 0.8 * aside, -from)?;
            Some(normals[hit.face as usize].dot(from) > 0.0)
        })
        .collect();
    if fronts.is_empty() {
        // An object that no ray meets is thin all over: nothing is known.
        return 0.5;
    }
    fronts.iter().filter(|&&front| front).count() as f64 / fronts.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    /// The mesh with every `every`th triangle wound the other way.
    fn with_turned_faces(mesh: &Mesh, every: usize) -> Mesh {
        let faces = mesh.faces().iter().enumerate();
        let faces = faces
            .map(|(i, &[a, b, c])| if i % every == 0 { [a, c, b] } else { [a, b, c] })
            .collect();
        Mesh::new(mesh.vertices().to_vec(), faces).unwrap()
    }

    #[test]
    fn the_winding_is_found_out() {
        // `usize::MAX` turns the first triangle only.
        for (every, both_sides) in [(usize::MAX, false), (1, false), (2, true)] {
            let mesh = with_turned_faces(&zoo::icosphere(2), every);
            let model = AlignModel::new(&mesh, 0, &Task::default()).unwrap();
            assert_eq!(model.both_sides, both_sides);
            let outward = model.samples.iter().filter(|s| s.normal.dot(s.point) > 0.0).count();
            assert!(both_sides || outward > N_SAMPLES * 95 / 100, "{outward}");
        }
    }

    #[test]
    fn copies_of_a_triangle_are_left_out_and_both_sides_of_a_sheet_are_kept() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, 1e-8 * DVec3::X, DVec3::Z];
        let faces = [[0, 1, 2], [1, 2, 0], [3, 1, 2], [0, 2, 1], [0, 1, 4]];
        assert_eq!(without_copies(&points, &faces), [[0, 1, 2], [0, 2, 1], [0, 1, 4]]);
    }

    #[test]
    fn meshes_beyond_the_range_of_numbers_are_named() {
        let ball = zoo::icosphere(1);
        let with = |f: &dyn Fn(DVec3) -> DVec3| {
            let points = ball.vertices().iter().map(|&p| f(p)).collect();
            let mesh = Mesh::new(points, ball.faces().to_vec())?;
            AlignModel::new(&mesh, 0, &Task::default())
        };
        for factor in [1e-50, 1e-9, 1e9, 1e29] {
            assert!(with(&|p| factor * p).is_ok(), "{factor}");
        }
        for factor in [1e-100, 1e100, 1e300] {
            let error = with(&|p| factor * p).unwrap_err().to_string();
            assert!(error.contains("coordinate"), "{error}");
        }
        assert!(with(&|p| p + DVec3::splat(1e12)).is_err());
    }

    #[test]
    fn flat_and_empty_surfaces_are_told_apart() {
        let grid = AlignModel::new(&zoo::open_grid(4, 4), 0, &Task::default());
        assert!(grid.is_ok());
        let line = Mesh::new(vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], vec![[0, 1, 2]]).unwrap();
        assert!(AlignModel::new(&line, 0, &Task::default()).is_err());
        let task = Task::default();
        task.cancel();
        assert!(AlignModel::new(&zoo::icosphere(1), 0, &task).is_err());
    }
}
