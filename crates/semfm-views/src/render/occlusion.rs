//! Ambient occlusion: how open the surface lies (Zhukov, Iones & Kronin, *An ambient light
//! illumination model*, 1998), at the vertices.

use rayon::prelude::*;
use semfm_geom::math::{DAffine3, DMat3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole, PixelDepth, Sphere, surface_sphere};

use super::depth_lookup::inverse_depths;
use super::ordered_mesh::OrderedMesh;
use super::triangle::Projection;
use semfm_geom::sampling::fibonacci_directions;

/// Axes along which a vertex is looked at, from both ends: of each two opposite eyes a convex
/// object hides the vertex from exactly one.
const AXES: usize = 32;

/// Distance of the eyes in bounding-sphere radii: far enough that their rays are parallel to 1°.
const DISTANCE: f64 = 60.0;

/// What lies in front of a vertex by less than this share of the radius does not hide it: the
/// triangles around it must not.
const TOLERANCE: f64 = 0.01;

/// Share of the light from all around that reaches each vertex (n), 0 to 1.
///
/// Of the directions from which a vertex is in sight, weighted by how large its triangles are seen
/// from there, twice the share: a closed convex object has 1 everywhere, the inside of a cup less. No
/// winding is asked for, so open and badly oriented meshes have it, too; a sheet in free air has 1.
/// Vertices of no triangle have 1.
pub fn openness(mesh: &Mesh) -> Vec<f32> {
    openness_of(mesh, &OrderedMesh::new(mesh))
}

/// The same of a mesh whose order of drawing is known.
pub(super) fn openness_of(mesh: &Mesh, ordered: &OrderedMesh<'_>) -> Vec<f32> {
    let sphere = surface_sphere(mesh);
    let directions: Vec<DVec3> =
        fibonacci_directions(AXES).flat_map(|axis| [axis, -axis]).collect();
    let normals: Vec<DVec3> =
        (0..mesh.n_faces()).map(|face| mesh.face_normal_scaled(face)).collect();
    // For each direction d: which vertices are in sight from there, and the weight w_d = Σ |N·d| over the
    // scaled normals N of a vertex's triangles. The openness is
    //   min(1, 2 · Σ_{d in sight} w_d / Σ_d w_d).
    let looks: Vec<(Vec<bool>, Vec<f64>)> = directions
        .par_iter()
        .map(|&direction| {
            let mut weights = vec![0.0; mesh.n_vertices()];
            for (ids, normal) in mesh.faces().iter().zip(&normals) {
                let weight = normal.dot(direction).abs();
                ids.iter().for_each(|&id| weights[id as usize] += weight);
            }
            (vertices_in_sight(mesh, ordered, sphere, direction), weights)
        })
        .collect();
    let open = (0..mesh.n_vertices()).map(|id| {
        let (mut seen, mut all) = (0.0, 0.0);
        for (in_sight, weights) in &looks {
            all += weights[id];
            seen += if in_sight[id] { weights[id] } else { 0.0 };
        }
        if all > 0.0 { (2.0 * seen / all).min(1.0) as f32 } else { 1.0 }
    });
    open.collect()
}

/// Which vertices (n) an eye far away in a direction sees.
fn vertices_in_sight(
    mesh: &Mesh,
    ordered: &OrderedMesh<'_>,
    Sphere { centre, radius }: Sphere,
    direction: DVec3,
) -> Vec<bool> {
    let right = direction.any_orthonormal_vector();
    let turn = DMat3::from_cols(right, right.cross(direction), -direction).transpose();
    let eye = centre + DISTANCE * radius * direction;
    let intrinsics =
        Intrinsics { width: 1, height: 1, fx: DISTANCE, fy: DISTANCE, cx: 0.0, cy: 0.0 };
    let pose = DAffine3::from_mat3_translation(turn, turn * -eye);
    let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose)
        .expect("a mesh has finite bounds, so the eye does");
    let projected: Vec<PixelDepth> = mesh.vertices().iter().map(|&p| camera.project(p)).collect();
    let positions: Vec<[f64; 2]> = projected.iter().map(|p| [p.u, p.v]).collect();
    let nearest = inverse_depths(&Projection::new(ordered, &camera), &positions);
    let tolerance = TOLERANCE * radius;
    projected.iter().zip(nearest).map(|(p, inverse)| p.z <= 1.0 / inverse + tolerance).collect()
}
