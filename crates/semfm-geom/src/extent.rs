//! How far the surface reaches. Vertices that no triangle uses do not count: one stray must not
//! shrink an object's pictures, nor widen what is near to it.

use crate::Mesh;
use crate::math::{DVec3, bounds};

/// A sphere around a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub centre: DVec3,
    /// Its radius, in the units of the mesh.
    pub radius: f64,
}

/// Positions of the vertices that some triangle uses, in the mesh's order.
pub fn surface_vertices(mesh: &Mesh) -> Vec<DVec3> {
    let mut used = vec![false; mesh.n_vertices()];
    for &id in mesh.faces().iter().flatten() {
        used[id as usize] = true;
    }
    mesh.vertices().iter().zip(used).filter_map(|(&p, used)| used.then_some(p)).collect()
}

/// The sphere about the centre of the surface's bounding box that holds all of the surface.
/// [`Mesh::bounding_sphere`] counts stray vertices, too.
pub fn surface_sphere(mesh: &Mesh) -> Sphere {
    let points = surface_vertices(mesh);
    let (low, high) = bounds(&points).unwrap_or_default();
    let centre = (low + high) / 2.0;
    let radius = points.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
    Sphere { centre, radius }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stray_vertex_does_not_count() {
        let far = DVec3::splat(100.0);
        let mesh = Mesh::new(vec![DVec3::ZERO, far, DVec3::X, DVec3::Y], vec![[0, 2, 3]]).unwrap();
        assert_eq!(surface_vertices(&mesh), [DVec3::ZERO, DVec3::X, DVec3::Y]);
        let sphere = surface_sphere(&mesh);
        assert_eq!(sphere.centre, DVec3::new(0.5, 0.5, 0.0));
        assert!((sphere.radius - 0.5f64.sqrt()).abs() < 1e-15);
        assert!(mesh.bounding_sphere().1 > 80.0);
    }
}
