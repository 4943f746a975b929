//! Simplification: fewer, more even triangles on a subset of the vertices, same topology.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::clean::{ListsByVertex, roots};
use crate::collapse::{Collapsed, Collapses};
use crate::math::DVec3;
use crate::surface::{SurfaceIndex, SurfacePoint};
use crate::{Error, Mesh, Result, Task};

/// How a mesh is simplified.
#[derive(Clone, Debug, PartialEq)]
pub struct SimplifySettings {
    /// Simplify above this many vertices; 0 keeps them all.
    pub target_vertices: usize,
    /// Largest Hausdorff distance accepted, as a share of the bounding box's diagonal; where it is
    /// passed, more vertices are kept.
    pub most_distance: f64,
}

impl Default for SimplifySettings {
    fn default() -> Self {
        Self { target_vertices: 10_000, most_distance: 0.01 }
    }
}

/// Factor by which the vertex budget grows after each attempt that strayed too far.
const GROWTH: f64 = 1.5;

/// What simplification did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimplifyReport {
    /// Vertices before.
    pub n_vertices_before: usize,
    /// Vertices after.
    pub n_vertices: usize,
    /// Triangles after.
    pub n_faces: usize,
    /// Hausdorff distance as a share of the diagonal, both ways: from every vertex before to the
    /// surface after, and from every triangle's centre after to the surface before.
    pub distance: f64,
    /// Vertex budgets tried; more than one where a smaller one strayed too far.
    pub attempts: usize,
    /// Connected components and Euler characteristic (vertices − edges + triangles) before.
    pub topology_before: Topology,
    /// The same after.
    pub topology: Topology,
}

/// Numbers that a change of topology cannot leave alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topology {
    /// Connected components.
    pub n_components: usize,
    /// Vertices − edges + triangles, over vertices in use.
    pub euler: i64,
}

impl Topology {
    /// Counts components, vertices in use, edges and triangles of `mesh`.
    pub fn of(mesh: &Mesh) -> Self {
        let root = roots(mesh.n_vertices(), mesh.faces());
        let mut is_used = vec![false; mesh.n_vertices()];
        mesh.faces().iter().flatten().for_each(|&id| is_used[id as usize] = true);
        let used = || (0u32..).zip(&is_used).filter(|(_, is_used)| **is_used).map(|(id, _)| id);
        let n_components = used().filter(|&id| root[id as usize] == id).count();
        let sides = mesh.faces().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut higher_ends =
            ListsByVertex::new(mesh.n_vertices(), sides.map(|(a, b)| (a.min(b), a.max(b))));
        let mut n_edges = 0;
        higher_ends.for_each(|ends| {
            ends.sort_unstable();
            n_edges += ends.chunk_by(|a, b| a == b).count() as i64;
        });
        let euler = used().count() as i64 - n_edges + mesh.n_faces() as i64;
        Self { n_components, euler }
    }
}

/// A simpler mesh whose vertices are a subset of the vertices before.
#[derive(Clone, Debug)]
pub struct Simplified {
    /// The simpler mesh (n vertices), in the order of the mesh before.
    pub mesh: Mesh,
    /// For each of its vertices the vertex before, at exactly the same position; ascending.
    pub to_before: Vec<u32>,
    /// For each vertex before the nearest point on the simpler surface.
    pub of_before: Vec<SurfacePoint>,
    /// What was done.
    pub report: SimplifyReport,
}

/// Collapses edges until `target_vertices` remain, by quadric error (Garland & Heckbert 1997) with a
/// preference for even triangles and without any change of topology, and keeps more where the
/// surface would move too far or the topology leaves no collapse.
///
/// `mesh` should be clean: vertices that nothing refers to vanish.
///
/// `None` where the mesh is small enough as it is, or nothing smaller stays close enough to it.
///
/// # Errors
/// [`Error::NoArea`], [`Error::Cancelled`].
pub fn simplify(
    mesh: &Mesh,
    settings: &SimplifySettings,
    task: &Task,
) -> Result<Option<Simplified>> {
    let n = mesh.n_vertices();
    let mut target = settings.target_vertices;
    if target == 0 || n <= target {
        return Ok(None);
    }
    let collapses = Collapses::new(mesh, target, task)?;
    let before = SurfaceIndex::new(mesh)?;
    let mut attempts = 0;
    while target < n {
        attempts += 1;
        task.check()?;
        let Fewer { mesh: working, to_before, came_to } = Fewer::new(mesh, &collapses, target)?;
        let centres = (0..working.n_faces()).into_par_iter().map(|face| {
            let [a, b, c] = working.corners(face);
            ((a + b + c) / 3.0, f64::MAX)
        });
        let back = closest_points(&before, centres)?;
        let vertices = (mesh.vertices().par_iter().zip(&came_to))
            .map(|(&p, &kept)| (p, reach(p.distance(mesh.vertices()[kept as usize]))));
        let of_before = closest_points(&SurfaceIndex::new(&working)?, vertices)?;
        let farthest = of_before.iter().chain(&back).map(|p| p.distance).fold(0.0, f64::max);
        let distance = farthest / mesh.diagonal();
        if distance <= settings.most_distance {
            let report = SimplifyReport {
                n_vertices_before: n,
                n_vertices: working.n_vertices(),
                n_faces: working.n_faces(),
                distance,
                attempts,
                topology_before: Topology::of(mesh),
                topology: Topology::of(&working),
            };
            return Ok(Some(Simplified { mesh: working, to_before, of_before, report }));
        }
        target = (target as f64 * GROWTH).ceil() as usize;
    }
    Ok(None)
}

/// How far to look for the nearest point of a surface that has a point at this distance.
fn reach(distance: f64) -> f64 {
    distance * (1.0 + 1e-9) + f64::MIN_POSITIVE
}

/// The point of the surface nearest to each of some points, of which each knows how far to look first.
fn closest_points(
    surface: &SurfaceIndex,
    points: impl IndexedParallelIterator<Item = (DVec3, f64)>,
) -> Result<Vec<SurfacePoint>> {
    let closest =
        |(p, reach)| surface.closest_among(p, reach, |_| true).or_else(|| surface.closest(p));
    // Only coordinates whose squares overflow have no closest point.
    points.map(closest).collect::<Option<_>>().ok_or_else(|| Error::OutOfRange {
        what: "coordinates",
        expected: "a mesh whose squared diagonal is finite".into(),
        found: "one beyond 1e150".into(),
    })
}

/// A simpler mesh and how its vertices belong to those before.
struct Fewer {
    mesh: Mesh,
    /// For each of its vertices the vertex before; ascending.
    to_before: Vec<u32>,
    /// For each vertex before the one that it was moved onto, by its number before.
    came_to: Vec<u32>,
}

impl Fewer {
    fn new(mesh: &Mesh, collapses: &Collapses<'_>, target: usize) -> Result<Self> {
        let Collapsed { faces, kept, came_to } = collapses.down_to(target);
        let to_before: Vec<u32> =
            (0..mesh.n_vertices() as u32).filter(|&id| kept[id as usize]).collect();
        let mut new_id = vec![u32::MAX; mesh.n_vertices()];
        for (new, &before) in (0u32..).zip(&to_before) {
            new_id[before as usize] = new;
        }
        let vertices = to_before.iter().map(|&id| mesh.vertices()[id as usize]).collect();
        let faces = faces.iter().map(|ids| ids.map(|id| new_id[id as usize])).collect();
        Ok(Self { mesh: Mesh::new(vertices, faces)?, to_before, came_to })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;
    use proptest::prelude::*;

    fn to(target_vertices: usize) -> SimplifySettings {
        SimplifySettings { target_vertices, most_distance: f64::INFINITY }
    }

    #[test]
    fn every_mesh_of_the_zoo_keeps_its_topology_at_any_budget() {
        for (name, mesh) in zoo::all() {
            let mesh = crate::clean::clean(&mesh, &Default::default()).unwrap().mesh;
            for target in [1, mesh.n_vertices() / 4, mesh.n_vertices() / 2] {
                let Some(simple) = simplify(&mesh, &to(target), &Task::default()).unwrap() else {
                    continue;
                };
                let report = simple.report;
                assert_eq!(report.topology, report.topology_before, "{name} to {target} vertices");
                for (&before, &p) in simple.to_before.iter().zip(simple.mesh.vertices()) {
                    assert_eq!(mesh.vertices()[before as usize], p, "{name}: a vertex moved");
                }
            }
        }
    }

    #[test]
    fn a_sphere_becomes_its_smallest_and_a_torus_stays_a_torus() {
        let sphere = simplify(&zoo::icosphere(3), &to(1), &Task::default()).unwrap().unwrap();
        assert!(sphere.mesh.n_vertices() < 40, "{} vertices are left", sphere.mesh.n_vertices());
        let torus = simplify(&zoo::torus(40, 20), &to(1), &Task::default()).unwrap().unwrap();
        assert_eq!(torus.report.topology, Topology { n_components: 1, euler: 0 });
    }

    #[test]
    fn more_is_kept_where_the_surface_would_stray() {
        let mesh = zoo::icosphere(3);
        let strict = SimplifySettings { target_vertices: 30, most_distance: 0.005 };
        let simple = simplify(&mesh, &strict, &Task::default()).unwrap().unwrap();
        assert!(simple.report.attempts > 1 && simple.report.distance <= 0.005);
        let hopeless = SimplifySettings { target_vertices: 30, most_distance: 1e-12 };
        assert!(simplify(&mesh, &hopeless, &Task::default()).unwrap().is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// Whatever triangles a soup is made of, locked or not, its topology stays.
        #[test]
        fn no_soup_is_torn(corners in prop::collection::vec(prop::array::uniform3(0u32..12), 1..40)) {
            let points = (0..12).map(|i| {
                let angle = f64::from(i) * 2.4;
                DVec3::new(angle.cos(), angle.sin(), f64::from(i) / 6.0 - 1.0)
            });
            let soup = Mesh::new(points.collect(), corners).unwrap();
            let Ok(cleaned) = crate::clean::clean(&soup, &Default::default()) else { return Ok(()) };
            if let Some(simple) = simplify(&cleaned.mesh, &to(1), &Task::default()).unwrap() {
                prop_assert_eq!(simple.report.topology, simple.report.topology_before);
            }
        }
    }
}
