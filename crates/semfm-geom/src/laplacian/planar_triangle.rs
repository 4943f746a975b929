//! Triangles laid out in the plane: what gradients and divergences need besides the Laplacian.

use super::{
    Laplacian, LaplacianKind, TuftedSettings, cotan_laplacian, intrinsic::IntrinsicTriangulation,
    tufted,
};
use crate::math::DVec2;
use crate::{Mesh, Result};

/// A triangle in its own plane, first corner at the origin, second on the x axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanarTriangle {
    /// Vertices.
    pub ids: [u32; 3],
    second: f64,
    third: DVec2,
    /// How much of the surface the triangle stands for: ½ on the tufted cover, which has two sheets.
    share: f64,
}

impl PlanarTriangle {
    /// From its sides ab, bc, ca; `None` for a triangle without area.
    fn new(ids: [u32; 3], [ab, bc, ca]: [f64; 3], share: f64) -> Option<Self> {
        let area4 = super::intrinsic::quadruple_area(ab, bc, ca);
        let third = DVec2::new((ab * ab + ca * ca - bc * bc) / (2.0 * ab), area4 / (2.0 * ab));
        (area4 > 0.0 && third.is_finite()).then_some(Self { ids, second: ab, third, share })
    }

    /// Sum of the sides.
    pub fn perimeter(&self) -> f64 {
        self.second + self.third.length() + (self.third - DVec2::new(self.second, 0.0)).length()
    }

    /// For the linear function with these corner values, what its unit descent X = −∇u/|∇u| adds to
    /// −∇ · X integrated around each corner: the area times X against the hat function's gradient,
    /// with the sign of the stiffness. Zero where u is flat.
    pub fn unit_descent_flux(&self, values: [f64; 3]) -> [f64; 3] {
        let corners = [DVec2::ZERO, DVec2::new(self.second, 0.0), self.third];
        // ∇ of the hat function of a corner, times twice the area: the opposite edge turned by 90°.
        let hats = [0, 1, 2].map(|k| (corners[(k + 2) % 3] - corners[(k + 1) % 3]).perp());
        // Heat falls by many powers of ten across a mesh: scaled, so that squares do not underflow.
        let scale = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if scale == 0.0 {
            return [0.0; 3];
        }
        let gradient: DVec2 =
            hats.iter().zip(values).map(|(hat, value)| *hat * (value / scale)).sum();
        let descent = -gradient.normalize_or_zero();
        hats.map(|hat| 0.5 * self.share * hat.dot(descent))
    }
}

/// The Laplacian of a kind, and the triangles that it belongs to.
pub(crate) fn laplacian_and_triangles(
    mesh: &Mesh,
    kind: LaplacianKind,
    settings: &TuftedSettings,
) -> Result<(Laplacian, Vec<PlanarTriangle>)> {
    match kind {
        LaplacianKind::Tufted => {
            let cover = tufted::delaunay_cover(mesh, settings)?;
            let laplacian = tufted::laplacian_of_cover(&cover, mesh.n_vertices())?;
            Ok((laplacian, triangles_of_cover(&cover)))
        }
        LaplacianKind::Cotan => {
            let triangles = mesh.faces().iter().enumerate().filter_map(|(face, &ids)| {
                let [a, b, c] = mesh.corners(face);
                PlanarTriangle::new(ids, [a.distance(b), b.distance(c), c.distance(a)], 1.0)
            });
            Ok((cotan_laplacian(mesh)?, triangles.collect()))
        }
    }
}

fn triangles_of_cover(cover: &IntrinsicTriangulation) -> Vec<PlanarTriangle> {
    let corners = cover.tail.chunks_exact(3).zip(cover.length.chunks_exact(3));
    corners
        .filter_map(|(ids, sides)| {
            PlanarTriangle::new([ids[0], ids[1], ids[2]], [sides[0], sides[1], sides[2]], 0.5)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_function_has_the_flux_of_its_own_stiffness() {
        // u = 2y on a right triangle: X = −ŷ, so −∇·X is that of the function −y.
        let triangle = PlanarTriangle::new([0, 1, 2], [3.0, 5.0, 4.0], 1.0).unwrap();
        let flux = triangle.unit_descent_flux([0.0, 0.0, 8.0]);
        for (found, expected) in flux.into_iter().zip([1.5, 0.0, -1.5]) {
            assert!((found - expected).abs() < 1e-14, "{flux:?}");
        }
        assert_eq!(triangle.unit_descent_flux([2.0; 3]).map(|f| f.abs() < 1e-14), [true; 3]);
        let faint = triangle.unit_descent_flux([0.0, 0.0, 8e-300]);
        assert!((faint[0] - 1.5).abs() < 1e-14, "{faint:?}");
    }
}
