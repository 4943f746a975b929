//! Simplification: fewer, more even triangles on a subset of the vertices, same topology.

use std::collections::HashSet;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::clean::roots;
use crate::collapse::{Collapsed, collapse};
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
        let used: HashSet<u32> = mesh.faces().iter().flatten().copied().collect();
        let n_components = used.iter().filter(|&&id| root[id as usize] == id).count();
        let mut edges: Vec<(u32, u32)> = mesh
            .faces()
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        edges.par_sort_unstable();
        edges.dedup();
        let euler = used.len() as i64 - edges.len() as i64 + mesh.n_faces() as i64;
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
    /// What was done; `None` where the mesh was small enough.
    pub report: Option<SimplifyReport>,
}

/// Collapses edges until about `target_vertices` remain, by quadric error with a preference for
/// even triangles (Garland & Heckbert 1997, in the form of meshoptimizer), and keeps more where
/// the surface would move too far.
///
/// `mesh` should be clean: vertices that nothing refers to vanish.
///
/// # Errors
/// [`Error::NoArea`], [`Error::Cancelled`].
pub fn simplify(mesh: &Mesh, settings: &SimplifySettings, task: &Task) -> Result<Simplified> {
    let n = mesh.n_vertices();
    let mut target = settings.target_vertices;
    if target == 0 || n <= target {
        return unchanged(mesh, None);
    }
    let before = SurfaceIndex::new(mesh)?;
    let topology_before = Topology::of(mesh);
    for attempts in 1.. {
        task.check()?;
        let simplified = on_fewer(mesh, target, task)?;
        let after = SurfaceIndex::new(&simplified.0)?;
        let of_before = closest_points(&after, mesh.vertices().par_iter().copied())?;
        let centres = (0..simplified.0.n_faces()).into_par_iter().map(|face| {
            let [a, b, c] = simplified.0.corners(face);
            (a + b + c) / 3.0
        });
        let back = closest_points(&before, centres)?;
        let distance =
            of_before.iter().chain(&back).map(|p| p.distance).fold(0.0, f64::max) / mesh.diagonal();
        let (working, to_before) = simplified;
        let report = SimplifyReport {
            n_vertices_before: n,
            n_vertices: working.n_vertices(),
            n_faces: working.n_faces(),
            distance,
            attempts,
            topology_before,
            topology: Topology::of(&working),
        };
        if distance <= settings.most_distance {
            return Ok(Simplified { mesh: working, to_before, of_before, report: Some(report) });
        }
        target = (target as f64 * GROWTH) as usize;
        if target >= n {
            break;
        }
    }
    unchanged(mesh, None)
}

fn unchanged(mesh: &Mesh, report: Option<SimplifyReport>) -> Result<Simplified> {
    let surface = SurfaceIndex::new(mesh)?;
    Ok(Simplified {
        mesh: mesh.clone(),
        to_before: (0..mesh.n_vertices() as u32).collect(),
        of_before: closest_points(&surface, mesh.vertices().par_iter().copied())?,
        report,
    })
}

fn closest_points(
    surface: &SurfaceIndex,
    points: impl IndexedParallelIterator<Item = crate::math::DVec3>,
) -> Result<Vec<SurfacePoint>> {
    points.map(|p| surface.closest(p)).collect::<Option<_>>().ok_or(Error::NoArea { n_faces: 0 })
}

/// One run of the collapse: the simpler mesh and, for each of its vertices, the vertex before.
fn on_fewer(mesh: &Mesh, target: usize, task: &Task) -> Result<(Mesh, Vec<u32>)> {
    let Collapsed { faces, kept } = collapse(mesh, target, task)?;
    let to_before: Vec<u32> =
        (0..mesh.n_vertices() as u32).filter(|&id| kept[id as usize]).collect();
    let mut new_id = vec![u32::MAX; mesh.n_vertices()];
    for (new, &before) in (0u32..).zip(&to_before) {
        new_id[before as usize] = new;
    }
    let vertices = to_before.iter().map(|&id| mesh.vertices()[id as usize]).collect();
    let faces = faces.iter().map(|ids| ids.map(|id| new_id[id as usize])).collect();
    Ok((Mesh::new(vertices, faces)?, to_before))
}
