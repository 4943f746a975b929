//! The cotangent Laplacian (Pinkall & Polthier 1993; Meyer et al. 2003).

use super::assembly::WeightedEdge;
use super::{Laplacian, assembly, fill_empty_masses};
use crate::{Error, Mesh, Result};

/// Stiffness from the cotangents of the angles opposite each edge, mass a third of the area around
/// each vertex.
///
/// Degenerate triangles contribute nothing. A vertex without area gets a tiny mass (1e-12 of the
/// mean) so that the mass stays invertible. On meshes that are not manifold or have slivers,
/// prefer the tufted Laplacian.
///
/// # Errors
/// [`Error::NoArea`] where every triangle is degenerate.
pub fn cotan_laplacian(mesh: &Mesh) -> Result<Laplacian> {
    let mut edges = Vec::with_capacity(mesh.n_faces() * 3);
    for (face, ids) in mesh.faces().iter().enumerate() {
        let corners = mesh.corners(face);
        let double_area = mesh.face_normal_scaled(face).length();
        if double_area <= 0.0 {
            continue;
        }
        for k in 0..3 {
            let (to_i, to_j) =
                (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
            let weight = 0.5 * to_i.dot(to_j) / double_area;
            edges.push(WeightedEdge { ends: [ids[(k + 1) % 3], ids[(k + 2) % 3]], weight });
        }
    }
    let mut mass = mesh.vertex_areas();
    if mass.iter().all(|&m| m <= 0.0) {
        return Err(Error::NoArea { n_faces: mesh.n_faces() });
    }
    fill_empty_masses(&mut mass);
    Ok(Laplacian { stiffness: assembly::stiffness(mesh.n_vertices(), &edges), mass })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    #[test]
    fn rows_sum_to_zero_and_a_linear_function_has_its_dirichlet_energy() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let square = Mesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let laplacian = cotan_laplacian(&square).unwrap();
        let x: Vec<f64> = square.vertices().iter().map(|p| p.x).collect();
        let (mut energy, mut row_sum) = (0.0, [0.0f64; 4]);
        for t in laplacian.stiffness.triplet_iter() {
            energy += x[t.row] * x[t.col] * t.val;
            row_sum[t.row] += t.val;
        }
        assert!((energy - 1.0).abs() < 1e-14, "∫|∇x|² over the unit square is 1, found {energy}");
        assert!(row_sum.iter().all(|s| s.abs() < 1e-14));
    }
}
