//! The object's own frame: principal axes of its surface, with signs that turn with the object.

use crate::math::{DMat3, DVec3};
use crate::{Error, Mesh, Result};

/// Skewness (third moment over σ³) below which an axis counts as symmetric and takes its sign
/// from the file's frame: sampling noise of mirror-symmetric meshes stays under it.
const SYMMETRIC_SKEWNESS: f64 = 1e-6;

/// Sweeps of Jacobi rotations; a 3×3 matrix is diagonal to machine precision after five or six.
const JACOBI_SWEEPS: usize = 12;

/// Rotation `frame_from_object` whose rows are the principal axes of the surface: x of the
/// smallest variance, z ("up" in every picture) of the largest, right-handed.
///
/// Moments are exact integrals over the triangles, so they do not depend on the tessellation.
/// z, and the more skewed of x and y, point towards their longer tail (positive third moment);
/// the last axis follows by handedness. A rotated object has the rotated frame, as long as its
/// variances differ.
///
/// # Errors
/// [`Error::NoArea`] where every triangle is degenerate.
pub fn principal_axes(mesh: &Mesh) -> Result<DMat3> {
    let scale = mesh.diagonal();
    let (area, centroid) = checked_area_and_centroid(mesh)?;
    let to_unit = |p: DVec3| (p - centroid) / scale;
    let (variances, axes) = eigen_ascending(covariance(mesh, area, to_unit));
    let skewness = [0, 1, 2].map(|axis| {
        let third: f64 = (0..mesh.n_faces())
            .map(|face| {
                let heights = mesh.corners(face).map(|p| to_unit(p).dot(axes[axis]));
                mesh.face_area(face) / area * mean_cube(heights)
            })
            .sum();
        third / variances[axis].max(f64::MIN_POSITIVE).powf(1.5)
    });
    let [x, y, z] = [0, 1, 2].map(|axis| axes[axis] * sign(skewness[axis], axes[axis]));
    Ok(if skewness[0].abs() > skewness[1].abs() {
        DMat3::from_cols(x, z.cross(x), z).transpose()
    } else {
        DMat3::from_cols(y.cross(z), y, z).transpose()
    })
}

/// Where a surface lies and how far it reaches along its principal axes: exact integrals over the triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceMoments {
    /// The mean of its points.
    pub centroid: DVec3,
    /// Orthonormal; their signs mean nothing.
    pub axes: [DVec3; 3],
    /// Standard deviations along the axes, ascending, in the units of the mesh.
    pub deviations: [f64; 3],
}

impl SurfaceMoments {
    /// Those of a mesh.
    ///
    /// # Errors
    /// [`Error::NoArea`] where every triangle is degenerate.
    pub fn of(mesh: &Mesh) -> Result<Self> {
        let scale = mesh.diagonal();
        let (area, centroid) = checked_area_and_centroid(mesh)?;
        let to_unit = |p: DVec3| (p - centroid) / scale;
        let (variances, axes) = eigen_ascending(covariance(mesh, area, to_unit));
        let deviations = variances.map(|variance| variance.max(0.0).sqrt() * scale);
        Ok(Self { centroid, axes, deviations })
    }

    /// Root of the mean squared distance from the centroid.
    pub fn size(&self) -> f64 {
        let [x, y, z] = self.deviations;
        (x * x + y * y + z * z).sqrt()
    }
}

/// The second moments of a surface about its centroid, in the units of `to_unit`: those of the diagonal, so that neither
/// kilometres nor micrometres leave f64's range.
fn covariance(mesh: &Mesh, area: f64, to_unit: impl Fn(DVec3) -> DVec3) -> DMat3 {
    let mut covariance = DMat3::ZERO;
    for face in 0..mesh.n_faces() {
        let corners = mesh.corners(face).map(&to_unit);
        let sum = corners[0] + corners[1] + corners[2];
        // ∫ x xᵀ over a triangle = area/12 · (Σ aᵢ aᵢᵀ + s sᵀ), s the sum of the corners.
        let moment: DMat3 = corners.iter().map(|&a| outer(a)).fold(outer(sum), |m, a| m + a);
        covariance += moment * (mesh.face_area(face) / area / 12.0);
    }
    covariance
}

fn checked_area_and_centroid(mesh: &Mesh) -> Result<(f64, DVec3)> {
    let (area, centroid) = area_and_centroid(mesh);
    if !(area > 0.0 && area.is_finite() && mesh.diagonal().is_finite()) {
        return Err(Error::NoArea { n_faces: mesh.n_faces() });
    }
    Ok((area, centroid))
}

fn area_and_centroid(mesh: &Mesh) -> (f64, DVec3) {
    let (low, _) = mesh.bounds();
    let mut area = 0.0;
    let mut first = DVec3::ZERO;
    for face in 0..mesh.n_faces() {
        let [a, b, c] = mesh.corners(face).map(|p| p - low);
        let weight = mesh.face_area(face);
        area += weight;
        first += (a + b + c) * (weight / 3.0);
    }
    (area, low + first / area)
}

fn outer(a: DVec3) -> DMat3 {
    DMat3::from_cols(a * a.x, a * a.y, a * a.z)
}

/// Mean of s³ over a triangle on which s is linear with these corner values: a tenth of the sum
/// of all ten monomials of degree three.
fn mean_cube([a, b, c]: [f64; 3]) -> f64 {
    (a * a * (a + b + c) + b * b * (a + b + c) + c * c * (a + b + c) + a * b * c) / 10.0
}

fn sign(skewness: f64, axis: DVec3) -> f64 {
    if skewness.abs() > SYMMETRIC_SKEWNESS {
        return skewness.signum();
    }
    let [x, y, z] = axis.to_array();
    let largest = if x.abs() >= y.abs() && x.abs() >= z.abs() {
        x
    } else if y.abs() >= z.abs() {
        y
    } else {
        z
    };
    if largest < 0.0 { -1.0 } else { 1.0 }
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, ascending (Jacobi 1846).
fn eigen_ascending(matrix: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut a = matrix.transpose().to_cols_array_2d(); // row-major; the matrix is symmetric
    let mut v = DMat3::IDENTITY.to_cols_array_2d(); // v[k]: row k of the eigenvector matrix
    for _ in 0..JACOBI_SWEEPS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let (c, s) = (1.0 / t.hypot(1.0), t / t.hypot(1.0));
            for row in a.iter_mut().chain(v.iter_mut()) {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            let (row_p, row_q) = (a[p], a[q]);
            for (k, (x, y)) in row_p.into_iter().zip(row_q).enumerate() {
                (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
            }
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| a[i][i].total_cmp(&a[j][j]));
    let axes = order.map(|i| DVec3::new(v[0][i], v[1][i], v[2][i]).normalize_or(DVec3::AXES[i]));
    (order.map(|i| a[i][i]), axes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lopsided tetrahedron: three different variances, all of them skewed.
    fn lopsided() -> Mesh {
        let corners = [[0.0, 0.0, 0.0], [3.0, 0.2, 0.1], [0.3, 1.4, 0.0], [0.2, 0.1, 0.6]];
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Mesh::new(corners.map(DVec3::from_array).to_vec(), faces).unwrap()
    }

    fn moved(mesh: &Mesh, turn: DMat3, scale: f64, shift: DVec3) -> Mesh {
        let vertices = mesh.vertices().iter().map(|&p| turn * p * scale + shift).collect();
        Mesh::new(vertices, mesh.faces().to_vec()).unwrap()
    }

    #[test]
    fn the_frame_turns_with_the_object() {
        let mesh = lopsided();
        let frame = principal_axes(&mesh).unwrap();
        assert!((frame.determinant() - 1.0).abs() < 1e-12);
        for (k, scale) in [1e-6, 1.0, 1e5].into_iter().enumerate() {
            let turn = DMat3::from_rotation_z(1.0 + k as f64) * DMat3::from_rotation_x(2.0);
            let turned = moved(&mesh, turn, scale, DVec3::splat(3.0 * scale));
            let difference = principal_axes(&turned).unwrap() * turn - frame;
            assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-9), "{difference}");
        }
    }

    #[test]
    fn moments_are_those_of_a_known_surface_and_grow_with_it() {
        // A plate of 4 × 2 in the plane z = 1: variances 16/12 and 4/12.
        let corners = [[-2.0, -1.0, 1.0], [2.0, -1.0, 1.0], [2.0, 1.0, 1.0], [-2.0, 1.0, 1.0]];
        let faces = vec![[0, 1, 2], [0, 2, 3]];
        let plate = Mesh::new(corners.map(DVec3::from_array).to_vec(), faces).unwrap();
        let found = SurfaceMoments::of(&plate).unwrap();
        assert!((found.centroid - DVec3::Z).length() < 1e-12);
        let expected = [0.0, (4f64 / 12.0).sqrt(), (16f64 / 12.0).sqrt()];
        assert!(found.deviations.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!((found.size() - (20f64 / 12.0).sqrt()).abs() < 1e-12);
        let larger = moved(&plate, DMat3::from_rotation_x(1.0), 3.0, DVec3::ONE);
        let larger = SurfaceMoments::of(&larger).unwrap();
        assert!((larger.size() - 3.0 * found.size()).abs() < 1e-12);
    }

    #[test]
    fn the_frame_does_not_see_the_tessellation() {
        let mesh = lopsided();
        let mut vertices = mesh.vertices().to_vec();
        let mut faces = Vec::new();
        for (face, &[a, b, c]) in mesh.faces().iter().enumerate() {
            let [p, q, r] = mesh.corners(face);
            let middle = vertices.len() as u32;
            vertices.push(0.7 * p + 0.2 * q + 0.1 * r);
            faces.extend([[a, b, middle], [b, c, middle], [c, a, middle]]);
        }
        let finer = Mesh::new(vertices, faces).unwrap();
        let difference = principal_axes(&finer).unwrap() - principal_axes(&mesh).unwrap();
        assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-12), "{difference}");
    }

    #[test]
    fn a_flat_symmetric_plate_still_has_a_frame() {
        let corners = [[-2.0, -1.0, 0.0], [2.0, -1.0, 0.0], [2.0, 1.0, 0.0], [-2.0, 1.0, 0.0]];
        let faces = vec![[0, 1, 2], [0, 2, 3]];
        let plate = Mesh::new(corners.map(DVec3::from_array).to_vec(), faces).unwrap();
        let frame = principal_axes(&plate).unwrap();
        assert!((frame.row(2) - DVec3::X).length() < 1e-12);
        assert!(frame.row(0).z.abs() > 1.0 - 1e-12);
        let line = Mesh::new(vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], vec![[0, 1, 2]]).unwrap();
        assert!(principal_axes(&line).unwrap_err().to_string().contains("no area"));
    }
}
