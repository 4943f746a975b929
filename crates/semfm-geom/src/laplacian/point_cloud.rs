//! The Laplacian of points without triangles (Sharp & Crane 2020).

use super::local_delaunay::{LocalDelaunay, Neighbour, lift};
use super::tufted::{delaunay_cover_of_soup, laplacian_of_cover};
use super::{Laplacian, TuftedSettings};
use crate::math::{DMat3, DVec2, DVec3};
use crate::{Error, PointIndex, Result};
use parry3d_f64::glamx::DSymmetricEigen3;

/// How the Laplacian of a point cloud is built.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudSettings {
    /// Neighbours of each point that define its tangent plane and its triangles.
    pub n_neighbors: usize,
    /// As in [`TuftedSettings`].
    pub mollify_factor: f64,
}

impl Default for CloudSettings {
    fn default() -> Self {
        Self { n_neighbors: 30, mollify_factor: TuftedSettings::default().mollify_factor }
    }
}

/// The Laplacian of `points` (n) sampled from a surface, in any order and density.
///
/// Each point and its nearest neighbours are projected onto their plane of best fit; the Delaunay
/// triangles around the point there are kept. The union of all these is no manifold, but the tufted
/// cover does not mind. A triangle that all three of its points agree on is in it three times, so
/// stiffness and mass are divided by 3. A point in no triangle gets a tiny mass.
///
/// # Errors
/// [`Error::NoArea`] where no point has neighbours that span a plane, [`Error::NotFinite`] for
/// coordinates, [`Error::OutOfRange`] for fewer than three points or neighbours.
pub fn point_cloud_laplacian(points: &[DVec3], settings: &CloudSettings) -> Result<Laplacian> {
    for (what, found) in
        [("points of a cloud", points.len()), ("n_neighbors", settings.n_neighbors)]
    {
        if found < 3 {
            return Err(Error::OutOfRange {
                what,
                expected: "3 or more".into(),
                found: found.to_string(),
            });
        }
    }
    let triangles = union_of_stars(points, settings.n_neighbors)?;
    let cover = delaunay_cover_of_soup(points, &triangles, settings.mollify_factor)?;
    let mut laplacian = laplacian_of_cover(&cover, points.len())?;
    laplacian.mass.iter_mut().for_each(|m| *m /= 3.0);
    laplacian.stiffness.val_mut().iter_mut().for_each(|w| *w /= 3.0);
    Ok(laplacian)
}

/// The triangles around every point, each seen from its own tangent plane.
fn union_of_stars(points: &[DVec3], n_neighbors: usize) -> Result<Vec<[u32; 3]>> {
    let index = PointIndex::new(points)?;
    let mut triangles = Vec::with_capacity(6 * points.len());
    let mut finder = LocalDelaunay::default();
    let (mut ids, mut offsets, mut projected) = (Vec::new(), Vec::new(), Vec::new());
    for (center, &point) in points.iter().enumerate() {
        ids.clear();
        // One more than asked, for the point itself is among them.
        let nearest = index.k_nearest(point, n_neighbors + 1);
        ids.extend(nearest.iter().map(|&(id, _)| id).filter(|&id| id != center).take(n_neighbors));
        offsets.clear();
        offsets.extend(ids.iter().map(|&id| points[id] - point));
        let Some((right, up)) = tangent_plane(&offsets) else { continue };
        projected.clear();
        projected.extend(ids.iter().zip(&offsets).map(|(&id, v)| Neighbour {
            position: DVec2::new(right.dot(*v), up.dot(*v)),
            lift: lift(id) - lift(center),
        }));
        triangles.extend(finder.star(&projected).map(|(i, j)| {
            let [i, j] = [i, j].map(|neighbour| ids[neighbour as usize] as u32);
            [center as u32, i, j]
        }));
    }
    Ok(triangles)
}

/// Variance across a line of points, as a share of the whole, below which they span no plane.
const LINE: f64 = 1e-12;

/// v vᵀ.
fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.x * v, v.y * v, v.z * v)
}

/// Two unit vectors that span the plane of best fit to a point and its neighbours' `offsets` from
/// it: the directions of largest variance about the common mean. `None` for points on a line.
fn tangent_plane(offsets: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let mean = offsets.iter().sum::<DVec3>() / (offsets.len() + 1) as f64;
    // Scatter Σ (v − mean)(v − mean)ᵀ, the point itself (offset 0) included.
    let scatter = offsets.iter().fold(outer(mean), |sum, &v| sum + outer(v - mean));
    // Scaled to trace one, where the closed form is at its best.
    let trace = scatter.x_axis.x + scatter.y_axis.y + scatter.z_axis.z;
    if trace <= 0.0 {
        return None;
    }
    let eigen = DSymmetricEigen3::new(scatter * (1.0 / trace));
    let normal = eigen.eigenvectors.x_axis.try_normalize()?;
    (eigen.eigenvalues.y > LINE).then(|| normal.any_orthonormal_pair())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;
    use std::f64::consts::PI;

    #[test]
    fn a_sampled_sphere_has_the_area_and_the_energy_of_a_sphere() {
        let points = zoo::spiral_cloud(2000);
        let laplacian = point_cloud_laplacian(&points, &CloudSettings::default()).unwrap();
        let area: f64 = laplacian.mass.iter().sum();
        assert!((area / (4.0 * PI) - 1.0).abs() < 0.01, "area {area}");
        // z is an eigenfunction with λ = 2, and ∫ z² = 4π / 3.
        let energy: f64 = laplacian
            .stiffness
            .triplet_iter()
            .map(|t| points[t.row].z * t.val * points[t.col].z)
            .sum();
        assert!((energy / (8.0 * PI / 3.0) - 1.0).abs() < 0.01, "Dirichlet energy {energy}");
    }

    #[test]
    fn a_regular_grid_is_covered_three_times_like_any_other_cloud() {
        let points: Vec<DVec3> =
            (0..900).map(|i| DVec3::new(f64::from(i % 30), f64::from(i / 30), 0.0)).collect();
        let laplacian = point_cloud_laplacian(&points, &CloudSettings::default()).unwrap();
        let area: f64 = laplacian.mass.iter().sum();
        assert!((area / (29.0 * 29.0) - 1.0).abs() < 1e-3, "area {area} of 841");
    }

    #[test]
    fn a_far_away_cloud_is_the_same_cloud() {
        let points = zoo::spiral_cloud(500);
        let moved: Vec<DVec3> = points.iter().map(|&p| p + DVec3::new(64.0, -32.0, 16.0)).collect();
        let settings = CloudSettings::default();
        let (here, there) = (
            point_cloud_laplacian(&points, &settings).unwrap(),
            point_cloud_laplacian(&moved, &settings).unwrap(),
        );
        for (a, b) in here.mass.iter().zip(&there.mass) {
            assert!((a - b).abs() < 1e-9 * a.abs().max(1e-3), "{a} here, {b} there");
        }
    }

    #[test]
    fn copies_lines_and_few_points_end_well() {
        let mut points = zoo::spiral_cloud(300);
        points.extend_from_within(..50);
        let doubled = point_cloud_laplacian(&points, &CloudSettings::default()).unwrap();
        assert!(doubled.mass.iter().all(|&m| m > 0.0));
        let line: Vec<DVec3> = (0..50).map(|i| DVec3::X * f64::from(i)).collect();
        assert!(matches!(
            point_cloud_laplacian(&line, &CloudSettings::default()),
            Err(Error::NoArea { .. })
        ));
        let two = [DVec3::ZERO, DVec3::X];
        assert!(matches!(
            point_cloud_laplacian(&two, &CloudSettings::default()),
            Err(Error::OutOfRange { .. })
        ));
        let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let laplacian = point_cloud_laplacian(&triangle, &CloudSettings::default()).unwrap();
        assert!((laplacian.mass.iter().sum::<f64>() - 0.5).abs() < 1e-4);
    }
}
