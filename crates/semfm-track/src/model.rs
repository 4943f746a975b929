//! The object that is followed: in metres, around its middle, sampled, with the edges that can be its outline.

use std::collections::HashMap;

use semfm_geom::math::DVec3;
use semfm_geom::sampling::sample_uniform;
use semfm_geom::{Mesh, SimplifySettings, SurfaceIndex, Task, simplify};

use crate::Result;

/// Samples of the surface, uniform by area. About half face a camera; with 1 mm of noise they hold the position to a tenth
/// of a millimetre, and each costs a ray a frame.
const N_SAMPLES: usize = 1600;

/// Meshes with more triangles lend their outline from a simpler copy: every edge is looked at in each frame.
const MOST_FACES: usize = 20_000;

/// Vertices of that copy.
const SIMPLER_VERTICES: usize = 8_000;

/// Samples whose sight from outside tells the winding.
const FOR_WINDING: usize = 128;

/// From this share of rays on that meet a front (or a back), the winding is believed.
const WOUND: f64 = 0.9;

/// A place on the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelSample {
    /// Metres from the middle.
    pub point: DVec3,
    /// Unit, outward where the winding is known.
    pub normal: DVec3,
    /// The vertex of the mesh that lies nearest among the corners of its triangle.
    pub vertex: u32,
}

/// An edge between two triangles, or at a border, in metres from the middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelEdge {
    pub ends: [DVec3; 2],
    /// Triangles beside it: the same one twice at a border.
    pub faces: [u32; 2],
}

/// The object in its inner frame: metres from the middle of its bounding sphere, axes of the mesh.
pub(crate) struct TrackModel {
    /// Metres per unit of the mesh.
    pub scale: f64,
    /// The middle, in the mesh's frame and unit.
    pub centre: DVec3,
    /// Of the bounding sphere, metres.
    pub radius: f64,
    pub samples: Vec<ModelSample>,
    pub surface: SurfaceIndex,
    /// Whether the sign of a normal says nothing.
    pub both_sides: bool,
    pub edges: Vec<ModelEdge>,
    /// Of the mesh whose edges these are: a corner, the (scaled) normal and the middle of each triangle.
    pub facets: Vec<Facet>,
}

/// What tells whether a triangle faces a camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    pub middle: DVec3,
    pub normal: DVec3,
}

impl TrackModel {
    /// Prepares a mesh at a scale (metres per unit).
    ///
    /// # Errors
    /// [`semfm_geom::Error::NoArea`] for a mesh without area, [`semfm_geom::Error::Cancelled`].
    pub fn new(mesh: &Mesh, scale: f64, seed: u64, task: &Task) -> Result<Self> {
        task.check()?;
        let (centre, radius) = mesh.bounding_sphere();
        let points = mesh.vertices().iter().map(|&p| scale * (p - centre)).collect();
        let metric = Mesh::new(points, mesh.faces().to_vec())?;
        let surface = SurfaceIndex::new(&metric)?;
        let mut samples: Vec<ModelSample> = sample_uniform(&metric, N_SAMPLES, seed)?
            .iter()
            .map(|sample| {
                let corners = metric.faces()[sample.face as usize];
                let distance =
                    |&v: &u32| metric.vertices()[v as usize].distance_squared(sample.point);
                let vertex = corners
                    .into_iter()
                    .min_by(|a, b| distance(a).total_cmp(&distance(b)))
                    .unwrap_or_default();
                ModelSample { point: sample.point, normal: sample.normal, vertex }
            })
            .collect();
        let radius = scale * radius;
        let front = front_share(&metric, &surface, &samples, radius);
        if front <= 1.0 - WOUND {
            samples.iter_mut().for_each(|sample| sample.normal = -sample.normal);
        }
        let both_sides = front > 1.0 - WOUND && front < WOUND;
        task.check()?;
        let outline = outline_mesh(metric, task)?;
        let facets = (0..outline.n_faces())
            .map(|face| Facet {
                middle: outline.corners(face).iter().sum::<DVec3>() / 3.0,
                normal: outline.face_normal_scaled(face),
            })
            .collect();
        let edges = edges_of(&outline);
        Ok(Self { scale, centre, radius, samples, surface, both_sides, edges, facets })
    }

    /// Diameter of the bounding sphere, metres.
    pub fn diameter(&self) -> f64 {
        2.0 * self.radius
    }

    /// Bytes that it keeps, but for the tree over its triangles.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.samples[..])
            + size_of_val(&self.edges[..])
            + size_of_val(&self.facets[..])
    }
}

/// The mesh, or a simpler one where it has too many triangles.
fn outline_mesh(mesh: Mesh, task: &Task) -> Result<Mesh> {
    if mesh.n_faces() <= MOST_FACES {
        return Ok(mesh);
    }
    let settings = SimplifySettings { target_vertices: SIMPLER_VERTICES, ..Default::default() };
    Ok(simplify(&mesh, &settings, &task.silent())?.map_or(mesh, |simpler| simpler.mesh))
}

/// Of the triangles that are seen first from outside along samples' normals, the share whose front is seen.
fn front_share(mesh: &Mesh, surface: &SurfaceIndex, samples: &[ModelSample], radius: f64) -> f64 {
    let (mut fronts, mut n) = (0usize, 0usize);
    for sample in samples.iter().step_by((samples.len() / FOR_WINDING).max(1)) {
        for side in [1.0, -1.0] {
            let from = sample.point + 4.0 * radius * side * sample.normal;
            let direction = sample.point - from;
            let Some(hit) = surface.first_hit(from, direction) else { continue };
            let faces_us = mesh.face_normal_scaled(hit.face as usize).dot(direction) < 0.0;
            (fronts, n) = (fronts + usize::from(faces_us), n + 1);
        }
    }
    if n == 0 { 0.5 } else { fronts as f64 / n as f64 }
}

/// Every edge once, vertices in one place taken as one: readers keep corners apart that normals or textures split.
fn edges_of(mesh: &Mesh) -> Vec<ModelEdge> {
    let mut ids: HashMap<[u64; 3], u32> = HashMap::new();
    let place = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let welded: Vec<u32> = mesh
        .vertices()
        .iter()
        .map(|p| {
            let next = ids.len() as u32;
            *ids.entry(place(p)).or_insert(next)
        })
        .collect();
    let mut edges: Vec<ModelEdge> = Vec::new();
    let mut known: HashMap<[u32; 2], usize> = HashMap::new();
    for (face, corners) in mesh.faces().iter().enumerate() {
        let face = face as u32;
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let (i, j) = (welded[a as usize], welded[b as usize]);
            if i == j {
                continue;
            }
            match known.entry([i.min(j), i.max(j)]) {
                std::collections::hash_map::Entry::Occupied(at) => {
                    edges[*at.get()].faces[1] = face;
                }
                std::collections::hash_map::Entry::Vacant(at) => {
                    at.insert(edges.len());
                    let ends = [a, b].map(|v| mesh.vertices()[v as usize]);
                    edges.push(ModelEdge { ends, faces: [face, face] });
                }
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn a_closed_mesh_has_three_edges_for_two_triangles_and_none_is_a_border() {
        let mesh = zoo::icosphere(2);
        let model = TrackModel::new(&mesh, 0.05, 0, &Task::default()).unwrap();
        assert_eq!(2 * model.edges.len(), 3 * mesh.n_faces());
        assert!(model.edges.iter().all(|edge| edge.faces[0] != edge.faces[1]));
        assert!((model.radius - 0.05).abs() < 1e-3 && !model.both_sides);
        // The same triangles, each with corners of its own, wound inward.
        let corners = mesh.faces().iter().flatten().map(|&v| mesh.vertices()[v as usize]);
        let faces = (0..mesh.n_faces() as u32).map(|f| [3 * f, 3 * f + 2, 3 * f + 1]).collect();
        let split = Mesh::new(corners.collect(), faces).unwrap();
        let split = TrackModel::new(&split, 0.05, 0, &Task::default()).unwrap();
        assert_eq!(split.edges.len(), model.edges.len());
        let outward = split.samples.iter().filter(|s| s.normal.dot(s.point) > 0.0).count();
        assert_eq!(outward, split.samples.len());
    }

    #[test]
    fn a_sheet_has_borders_and_a_line_is_refused() {
        let grid = TrackModel::new(&zoo::open_grid(4, 4), 0.1, 0, &Task::default()).unwrap();
        assert!(grid.edges.iter().any(|edge| edge.faces[0] == edge.faces[1]));
        let line = Mesh::new(vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], vec![[0, 1, 2]]).unwrap();
        assert!(TrackModel::new(&line, 1.0, 0, &Task::default()).is_err());
    }
}
