//! How a target is turned against its source, from their point map, their way up and their regions.

use faer::{Mat, Side};
use semfm::geom::math::{DMat3, DQuat, DVec3};
use semfm::upright::Upright;
use semfm::{Mesh, Region};

/// Correlation of matched points from which on a point map tells how the target is turned, where
/// nothing else does and where both objects stand. Maps between objects of one kind reached .45 to .87,
/// a mug's map to a bench .34.
pub(super) const FAIR_CORRELATION: f64 = 0.6;
const GOOD_CORRELATION: f64 = 0.8;
/// The same where both objects stand and only the heading is asked for: one angle needs less.
const FAIR_HEADING: f64 = 0.5;
/// Distance of a region from an object's middle, as a share of the object's reach, from which on it
/// tells the heading: a handle, not a rim.
const OFF_CENTRE: f64 = 0.3;

/// A mesh and the weight of each of its vertices in a region.
#[derive(Clone, Copy)]
pub(crate) struct WeightedMesh<'a> {
    pub mesh: &'a Mesh,
    pub weights: &'a [f64],
}

/// One object of a pair and which way it is up.
#[derive(Clone, Copy)]
pub(super) struct Standing<'a> {
    pub object: WeightedMesh<'a>,
    pub upright: Upright,
}

impl Standing<'_> {
    /// The rotation that turns up to z.
    fn flat_from_object(&self) -> DMat3 {
        let up = self.upright.up;
        let x = up.any_orthonormal_vector();
        DMat3::from_cols(x, up.cross(x), up).transpose()
    }

    /// The angle about z at which the region lies, seen from above; none where it lies around the middle.
    fn heading_of_region(&self, flat_from_object: DMat3) -> Option<f64> {
        let vertices = self.object.mesh.vertices();
        let weighted = vertices.iter().zip(self.object.weights);
        let inside: Vec<DVec3> =
            weighted.filter(|(_, w)| **w >= Region::COUNTS).map(|(&p, _)| p).collect();
        if inside.is_empty() {
            return None;
        }
        let middle = mean(vertices);
        let reach = vertices.iter().map(|&p| (flat_from_object * (p - middle)).truncate().length());
        let reach = reach.fold(0.0, f64::max);
        let towards = (flat_from_object * (mean(&inside) - middle)).truncate();
        (towards.length() > OFF_CENTRE * reach).then(|| towards.y.atan2(towards.x))
    }
}

/// `target_from_source` of directions. A good map gives all of it. Where both objects stand, up goes to
/// up, and a fair map gives the heading; where it cannot, the side on which the region lies does. Where
/// one does not stand, a fair map must do.
pub(super) fn pair_rotation(
    source: Standing<'_>,
    target: Standing<'_>,
    source_of: &[u32],
) -> Option<DMat3> {
    let stand = source.upright.is_sure && target.upright.is_sure;
    let least = if stand { GOOD_CORRELATION } else { FAIR_CORRELATION };
    let by_map = best_rotation(source.object.mesh, target.object.mesh, source_of)
        .filter(|rotation| rotation.correlation >= least);
    if by_map.is_some() || !stand {
        return by_map.map(|rotation| rotation.target_from_source);
    }
    let (flat_source, flat_target) = (source.flat_from_object(), target.flat_from_object());
    let matched = matched(source.object.mesh, source_of);
    let heading = heading_of_map(&matched, flat_source, target.object.mesh.vertices(), flat_target)
        .or_else(|| {
            let from = source.heading_of_region(flat_source)?;
            Some(target.heading_of_region(flat_target)? - from)
        })?;
    Some(flat_target.transpose() * DMat3::from_rotation_z(heading) * flat_source)
}

/// The least squares angle about z between matched points p and q seen from above, both centred:
/// atan2(Σ p × q, Σ p · q). None where they correlate too little.
fn heading_of_map(
    matched: &[DVec3],
    flat_source: DMat3,
    found: &[DVec3],
    flat_target: DMat3,
) -> Option<f64> {
    let (middle_p, middle_q) = (mean(matched), mean(found));
    let (mut along, mut across, mut spread) = (0.0, 0.0, [0.0; 2]);
    for (&p, &q) in matched.iter().zip(found) {
        let (p, q) = (flat_source * (p - middle_p), flat_target * (q - middle_q));
        along += p.x * q.x + p.y * q.y;
        across += p.x * q.y - p.y * q.x;
        spread = [spread[0] + p.x * p.x + p.y * p.y, spread[1] + q.x * q.x + q.y * q.y];
    }
    let is_fair = along.hypot(across) > FAIR_HEADING * (spread[0] * spread[1]).sqrt();
    is_fair.then(|| across.atan2(along))
}

/// The source vertex of each target vertex, as a position.
fn matched(source: &Mesh, source_of: &[u32]) -> Vec<DVec3> {
    source_of.iter().map(|&v| source.vertices()[v as usize]).collect()
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// A rotation, and how well matched points correlate after it.
pub(super) struct BestRotation {
    pub target_from_source: DMat3,
    pub correlation: f64,
}

/// The rotation that brings the source's matched points p nearest to the target's q.
///
/// With S = Σ p qᵀ of the centred points, scaled by √(Σ |p|² Σ |q|²), the unit quaternion is the
/// eigenvector of the largest eigenvalue of Horn's symmetric 4 × 4 matrix N(S), and that eigenvalue is
/// the correlation after the rotation (Horn, "Closed-form solution of absolute orientation using unit
/// quaternions", 1987). None where all points of one side are one.
pub(super) fn best_rotation(
    source: &Mesh,
    target: &Mesh,
    source_of: &[u32],
) -> Option<BestRotation> {
    let (matched, found) = (matched(source, source_of), target.vertices());
    let (mean_source, mean_target) = (mean(&matched), mean(found));
    let mut s = [[0.0; 3]; 3];
    let (mut spread_source, mut spread_target) = (0.0, 0.0);
    for (&p, &q) in matched.iter().zip(found) {
        let (p, q) = (p - mean_source, q - mean_target);
        spread_source += p.length_squared();
        spread_target += q.length_squared();
        for (row, a) in s.iter_mut().zip(p.to_array()) {
            row.iter_mut().zip(q.to_array()).for_each(|(cell, b)| *cell += a * b);
        }
    }
    let scale = (spread_source * spread_target).sqrt();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s.map(|row| row.map(|x| x / scale));
    let lower = [
        [xx + yy + zz, 0.0, 0.0, 0.0],
        [yz - zy, xx - yy - zz, 0.0, 0.0],
        [zx - xz, xy + yx, yy - xx - zz, 0.0],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let eigen = Mat::from_fn(4, 4, |i, j| lower[i][j]).self_adjoint_eigen(Side::Lower).ok()?;
    // Eigenvalues ascend: the last is the largest.
    let correlation = eigen.S().column_vector()[3];
    let [w, x, y, z] = [0, 1, 2, 3].map(|i| eigen.U()[(i, 3)]);
    let target_from_source = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    Some(BestRotation { target_from_source, correlation })
}

#[cfg(test)]
pub(super) mod tests {
    use semfm::geom::math::DMat3;
    use semfm_geom::zoo;

    use super::*;

    pub(in super::super) fn turned(mesh: &Mesh, turn: DMat3) -> Mesh {
        let vertices = mesh.vertices().iter().map(|&p| turn * p).collect();
        Mesh::new(vertices, mesh.faces().to_vec()).unwrap()
    }

    #[test]
    fn a_turned_copy_is_turned_back() {
        let mesh = zoo::torus(24, 12);
        let turn = DMat3::from_rotation_x(1.1) * DMat3::from_rotation_z(0.4);
        let identity: Vec<u32> = (0..mesh.n_vertices() as u32).collect();
        let found = best_rotation(&mesh, &turned(&mesh, turn), &identity).unwrap();
        let error = (found.target_from_source - turn).to_cols_array();
        assert!((found.correlation - 1.0).abs() < 1e-12 && error.iter().all(|x| x.abs() < 1e-9));
    }

    #[test]
    fn a_map_of_nonsense_turns_nothing() {
        let mesh = zoo::torus(24, 12);
        let n = mesh.n_vertices() as u32;
        let nonsense: Vec<u32> = (0..n).map(|v| v * 7919 % n).collect();
        let found = best_rotation(&mesh, &mesh, &nonsense).unwrap();
        assert!(found.correlation < FAIR_CORRELATION);
    }
}
