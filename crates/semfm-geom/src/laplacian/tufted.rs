//! The intrinsic Delaunay Laplacian of the tufted cover
//! (Sharp & Crane 2020, "A Laplacian for Nonmanifold Triangle Meshes").

use super::intrinsic::IntrinsicTriangulation;
use super::tufted_cover::tufted_cover;
use super::{Laplacian, assembly, fill_empty_masses};
use crate::math::DVec3;
use crate::{Error, Mesh, Result};

/// How the tufted Laplacian is built.
#[derive(Clone, Debug, PartialEq)]
pub struct TuftedSettings {
    /// Slack that mollification gives to each triangle inequality, in mean edge lengths. 0 keeps
    /// the lengths; the authors recommend 1e-5.
    pub mollify_factor: f64,
}

impl Default for TuftedSettings {
    fn default() -> Self {
        Self { mollify_factor: 1e-5 }
    }
}

/// The Laplacian of a mesh that need not be manifold, oriented, closed or well shaped: two copies
/// of each triangle are glued into the tufted cover, edge lengths are mollified, edges flipped to
/// intrinsic Delaunay, and half of the cover's cotangent stiffness and mass is what one sheet has.
///
/// Edge weights are non-negative (to 1e-6), so the maximum principle holds. The mass adds up to the
/// area, or to slightly more where mollification had to thicken slivers. Triangles that name a
/// vertex twice are left out; a vertex without triangles gets a tiny mass (1e-12 of the mean).
///
/// # Errors
/// [`Error::NoArea`] where no triangle has three different vertices or all lie on one spot,
/// [`Error::OutOfRange`] for a negative or non-finite `mollify_factor`.
pub fn tufted_laplacian(mesh: &Mesh, settings: &TuftedSettings) -> Result<Laplacian> {
    laplacian_of_cover(&delaunay_cover(mesh, settings)?, mesh.n_vertices())
}

/// The intrinsic Delaunay triangulation of a mesh's tufted cover.
pub(super) fn delaunay_cover(
    mesh: &Mesh,
    settings: &TuftedSettings,
) -> Result<IntrinsicTriangulation> {
    if mesh.faces().iter().all(names_three_vertices) {
        return delaunay_cover_of_soup(mesh.vertices(), mesh.faces(), settings.mollify_factor);
    }
    let faces: Vec<[u32; 3]> = mesh.faces().iter().copied().filter(names_three_vertices).collect();
    delaunay_cover_of_soup(mesh.vertices(), &faces, settings.mollify_factor)
}

fn names_three_vertices(&[a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// As [`delaunay_cover`], for triangles that each name three different vertices.
pub(super) fn delaunay_cover_of_soup(
    points: &[DVec3],
    faces: &[[u32; 3]],
    mollify_factor: f64,
) -> Result<IntrinsicTriangulation> {
    if !(mollify_factor >= 0.0 && mollify_factor.is_finite()) {
        let (what, expected) = ("mollify_factor", "a number of mean edges, 0 or more".into());
        return Err(Error::OutOfRange { what, expected, found: mollify_factor.to_string() });
    }
    let mut cover = tufted_cover(points, faces, mollify_factor)
        .ok_or(Error::NoArea { n_faces: faces.len() })?;
    cover.flip_to_delaunay();
    Ok(cover)
}

/// One sheet's worth of a cover's cotangent stiffness and lumped mass (n).
pub(super) fn laplacian_of_cover(cover: &IntrinsicTriangulation, n: usize) -> Result<Laplacian> {
    let mut mass = cover.vertex_areas(n);
    if mass.iter().all(|&m| m <= 0.0) {
        return Err(Error::NoArea { n_faces: cover.n_triangles() / 2 });
    }
    mass.iter_mut().for_each(|m| *m /= 2.0);
    fill_empty_masses(&mut mass);
    let mut edges = cover.weighted_edges();
    edges.iter_mut().for_each(|edge| edge.weight /= 2.0);
    Ok(Laplacian { stiffness: assembly::stiffness(n, &edges), mass })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{laplacian::cotan_laplacian, zoo};

    #[test]
    fn on_a_delaunay_mesh_it_is_the_cotangent_laplacian() {
        let sphere = zoo::icosphere(3);
        let (tufted, cotan) = (
            tufted_laplacian(&sphere, &TuftedSettings::default()).unwrap(),
            cotan_laplacian(&sphere).unwrap(),
        );
        for t in cotan.stiffness.triplet_iter() {
            let other = tufted.stiffness.get(t.row, t.col).copied().unwrap_or(0.0);
            assert!(
                (t.val - other).abs() < 1e-12,
                "({}, {}): {} against {other}",
                t.row,
                t.col,
                t.val
            );
        }
    }

    #[test]
    fn off_the_diagonal_nothing_is_positive() {
        for (name, mesh) in zoo::all() {
            let laplacian = tufted_laplacian(&mesh, &TuftedSettings::default()).unwrap();
            for t in laplacian.stiffness.triplet_iter().filter(|t| t.row != t.col) {
                assert!(*t.val <= 1e-5, "{name}: ({}, {}) = {}", t.row, t.col, t.val);
            }
        }
    }

    #[test]
    fn what_has_no_extent_is_refused() {
        let spot = Mesh::new(vec![DVec3::ONE; 3], vec![[0, 1, 2]]).unwrap();
        let settings = TuftedSettings::default();
        assert!(matches!(tufted_laplacian(&spot, &settings), Err(Error::NoArea { .. })));
        let line = Mesh::new(vec![DVec3::ZERO, DVec3::X], vec![[0, 1, 1]]).unwrap();
        assert!(matches!(tufted_laplacian(&line, &settings), Err(Error::NoArea { .. })));
        let bad = TuftedSettings { mollify_factor: f64::NAN };
        assert!(matches!(
            tufted_laplacian(&zoo::tetrahedron(), &bad),
            Err(Error::OutOfRange { .. })
        ));
    }
}
