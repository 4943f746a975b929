//! The working mesh: what the original becomes before any map is computed, and the way back.

use rayon::prelude::*;

use crate::clean::{CleanReport, CleanSettings, Cleaned, clean};
use crate::math::DVec3;
use crate::simplify::{Simplified, SimplifyReport, SimplifySettings, simplify};
use crate::surface::{SurfaceIndex, SurfacePoint};
use crate::{Mesh, Result, Task};

/// The cleaned, simplified mesh that maps are computed on, in the units of the original, and the
/// index maps both ways.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkingMesh {
    /// The working mesh itself (n_working vertices); its vertices are vertices of the original.
    pub mesh: Mesh,
    /// For each vertex of the original (n): itself where it was kept, the vertex that it was
    /// welded to, or the nearest corner of the working triangle nearest to it.
    pub of_original: Vec<u32>,
    /// For each working vertex, the original vertex that it is; ascending.
    pub to_original: Vec<u32>,
    /// For each vertex of the original (n), the point of the working surface that stands for it.
    pub point_of_original: Vec<BarycentricPoint>,
}

/// A working mesh, and what was done to get it.
#[derive(Clone, Debug)]
pub struct PreparedWorkingMesh {
    /// The working mesh.
    pub working: WorkingMesh,
    /// What cleaning did.
    pub cleaning: CleanReport,
    /// What simplification did; `None` where the mesh was small enough, or nothing smaller stayed close enough to it.
    pub simplification: Option<SimplifyReport>,
}

/// A point of the working surface as a mix of three working vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarycentricPoint {
    /// Working vertices.
    pub corners: [u32; 3],
    /// Their weights, each in [0, 1], adding up to 1; the last two have single precision.
    pub weights: [f64; 3],
}

impl BarycentricPoint {
    /// A working vertex itself.
    pub fn vertex(id: u32) -> Self {
        Self { corners: [id; 3], weights: [1.0, 0.0, 0.0] }
    }

    fn on(mesh: &Mesh, place: &SurfacePoint) -> Self {
        let [_, second, third] = place.barycentric;
        Self::new(mesh.faces()[place.face as usize], [second as f32, third as f32])
    }

    /// The point with these weights of the second and third corner.
    pub(crate) fn new(corners: [u32; 3], of_others: [f32; 2]) -> Self {
        let [second, third] = of_others.map(f64::from);
        Self { corners, weights: [(1.0 - second - third).max(0.0), second, third] }
    }

    /// The corner nearest to `position`; among equals the first.
    fn nearest_corner(&self, mesh: &Mesh, position: DVec3) -> u32 {
        let mut nearest = self.corners[0];
        for id in self.corners {
            let [here, there] =
                [nearest, id].map(|id| mesh.vertices()[id as usize].distance_squared(position));
            if there < here {
                nearest = id;
            }
        }
        nearest
    }

    /// The mix of the corners' values; `values` has one per working vertex.
    pub fn mix(&self, values: &[f64]) -> f64 {
        // The weight 1 is kept apart so that a kept vertex gets its value to the last bit.
        if self.weights[0] == 1.0 {
            return values[self.corners[0] as usize];
        }
        (0..3).map(|k| self.weights[k] * values[self.corners[k] as usize]).sum()
    }
}

impl WorkingMesh {
    /// Cleans, simplifies, and finds for each original vertex its place on the working surface.
    ///
    /// # Errors
    /// [`NoArea`](crate::Error::NoArea), [`Cancelled`](crate::Error::Cancelled).
    pub fn prepare(
        original: &Mesh,
        cleaning: &CleanSettings,
        simplification: &SimplifySettings,
        task: &Task,
    ) -> Result<PreparedWorkingMesh> {
        let Cleaned { mesh: cleaned, of_original: clean_of, to_original: of_clean, report } =
            clean(original, cleaning)?;
        let Some(simplified) = simplify(&cleaned, simplification, task)? else {
            let kept = clean_of.iter().map(|clean| clean.map(BarycentricPoint::vertex));
            let points = completed(original, &cleaned, kept.collect())?;
            let working = Self::with(original, cleaned, of_clean, points);
            return Ok(PreparedWorkingMesh { working, cleaning: report, simplification: None });
        };
        let Simplified { mesh, to_before, of_before, report: simplification } = simplified;
        let mut on_working: Vec<BarycentricPoint> =
            of_before.iter().map(|place| BarycentricPoint::on(&mesh, place)).collect();
        for (id, &clean) in (0u32..).zip(&to_before) {
            on_working[clean as usize] = BarycentricPoint::vertex(id);
        }
        let known = clean_of.iter().map(|clean| clean.map(|id| on_working[id as usize]));
        let points = completed(original, &mesh, known.collect())?;
        let to_original = to_before.iter().map(|&clean| of_clean[clean as usize]).collect();
        let working = Self::with(original, mesh, to_original, points);
        Ok(PreparedWorkingMesh { working, cleaning: report, simplification: Some(simplification) })
    }

    fn with(
        original: &Mesh,
        mesh: Mesh,
        to_original: Vec<u32>,
        point_of_original: Vec<BarycentricPoint>,
    ) -> Self {
        let of_original = (point_of_original.iter().zip(original.vertices()))
            .map(|(point, &position)| point.nearest_corner(&mesh, position))
            .collect();
        Self { mesh, of_original, to_original, point_of_original }
    }

    /// Values on the working vertices, carried onto the original's vertices: exact where a vertex
    /// was kept, linear on the working triangle nearest to it where it was not.
    pub fn onto_original(&self, values: &[f64]) -> Vec<f64> {
        assert_eq!(values.len(), self.mesh.n_vertices(), "one value per working vertex");
        self.point_of_original.iter().map(|point| point.mix(values)).collect()
    }

    /// Values on the original's vertices, read off at the vertices that were kept; of several at one place, at the first.
    pub fn onto_working(&self, values: &[f64]) -> Vec<f64> {
        assert_eq!(values.len(), self.point_of_original.len(), "one value per original vertex");
        self.to_original.iter().map(|&id| values[id as usize]).collect()
    }
}

/// Fills in, by the nearest point of the surface, the points of vertices that cleaning dropped.
fn completed(
    original: &Mesh,
    working: &Mesh,
    known: Vec<Option<BarycentricPoint>>,
) -> Result<Vec<BarycentricPoint>> {
    if let Some(all) = known.iter().copied().collect() {
        return Ok(all);
    }
    let surface = SurfaceIndex::new(working)?;
    let points = known.into_par_iter().zip(original.vertices()).map(|(known, &p)| {
        // A vertex so far out that its squared distance overflows gets vertex 0: nothing refers to
        // it, or cleaning would have kept it.
        known
            .or_else(|| surface.closest(p).map(|place| BarycentricPoint::on(working, &place)))
            .unwrap_or(BarycentricPoint::vertex(0))
    });
    Ok(points.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    fn working(mesh: &Mesh, target_vertices: usize) -> WorkingMesh {
        let simplification = SimplifySettings { target_vertices, most_distance: 0.2 };
        WorkingMesh::prepare(mesh, &CleanSettings::default(), &simplification, &Task::default())
            .unwrap()
            .working
    }

    #[test]
    fn on_the_whole_zoo_the_maps_name_the_same_places_in_the_same_order() {
        for (name, mesh) in zoo::all() {
            for target in [0, mesh.n_vertices() / 3] {
                let working = working(&mesh, target);
                assert_eq!(working.of_original.len(), mesh.n_vertices(), "{name}");
                assert!(working.to_original.is_sorted(), "{name}: the order changed");
                for (id, &original) in (0u32..).zip(&working.to_original) {
                    let p = mesh.vertices()[original as usize];
                    assert_eq!(working.mesh.vertices()[id as usize], p, "{name}");
                    assert_eq!(working.of_original[original as usize], id, "{name}");
                }
                let values: Vec<f64> = (0..working.mesh.n_vertices()).map(|i| i as f64).collect();
                let back = working.onto_working(&working.onto_original(&values));
                assert_eq!(back, values, "{name}: there and back is not the identity");
            }
        }
    }

    #[test]
    fn a_linear_function_comes_back_linear_where_the_surface_is_flat() {
        let grid = zoo::open_grid(30, 20);
        let points = grid.vertices().iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
        let mesh = Mesh::new(points, grid.faces().to_vec()).unwrap();
        let working = working(&mesh, 100);
        let x: Vec<f64> = working.mesh.vertices().iter().map(|p| p.x).collect();
        for (x, p) in working.onto_original(&x).iter().zip(mesh.vertices()) {
            assert!((x - p.x).abs() < 1e-5, "found {x} at {p}"); // weights in single precision
        }
    }

    #[test]
    fn a_vertex_that_nothing_refers_to_still_gets_an_answer() {
        let points = vec![DVec3::ZERO, 4.0 * DVec3::X, DVec3::X, DVec3::Y];
        let working = working(&Mesh::new(points, vec![[0, 2, 3]]).unwrap(), 0);
        assert_eq!(working.of_original, [0, 1, 1, 2]);
        assert_eq!(working.onto_original(&[1.0, 2.0, 3.0]), [1.0, 2.0, 2.0, 3.0]);
    }
}
