//! How good an answer is, when the truth is known: and how a map behaves, when it is not.

use semfm_geom::Mesh;
use semfm_geom::math::DVec3;
use serde::{Deserialize, Serialize};

use crate::{Error, PointMap, Region, Result};

/// Intersection over union of two regions, counted in vertices as in the paper; 0 where both are
/// empty, for nothing was found.
///
/// # Errors
/// [`Error::Length`] where the regions belong to meshes of different size.
pub fn iou(found: &Region, truth: &Region) -> Result<f64> {
    area_iou(found, truth, &vec![1.0; truth.n_vertices()])
}

/// Intersection over union with a weight per vertex (its area): does not change with the density
/// of the mesh.
///
/// # Errors
/// As [`iou`].
pub fn area_iou(found: &Region, truth: &Region, areas: &[f64]) -> Result<f64> {
    Error::length("vertices of the found region", truth.n_vertices(), found.n_vertices())?;
    Error::length("vertex areas", truth.n_vertices(), areas.len())?;
    Ok(overlap(&found.mask(), &truth.mask(), areas))
}

/// Σ areas of a ∩ b over Σ areas of a ∪ b, 0 where the union is empty.
pub(crate) fn overlap(a: &[bool], b: &[bool], areas: &[f64]) -> f64 {
    let (mut both, mut either) = (0.0, 0.0);
    for ((&a, &b), area) in a.iter().zip(b).zip(areas) {
        both += if a && b { area } else { &0.0 };
        either += if a || b { area } else { &0.0 };
    }
    if either > 0.0 { both / either } else { 0.0 }
}

/// Mean distance on the source between where a target vertex is sent and where it belongs, × 100 / √area:
/// the geodesic error of the correspondence literature (Kim, Lipman & Funkhouser 2011).
///
/// `distance(a, b)` measures on the source, in the units of `area`'s root.
///
/// # Errors
/// [`Error::Length`] where the maps differ in size.
pub fn geodesic_error(
    found: &PointMap,
    truth: &PointMap,
    distance: impl Fn(u32, u32) -> f64,
    source_area: f64,
) -> Result<f64> {
    Error::length("target vertices of the found map", truth.n_target(), found.n_target())?;
    let total: f64 =
        found.source_of.iter().zip(&truth.source_of).map(|(&a, &b)| distance(a, b)).sum();
    Ok(100.0 * total / (truth.n_target().max(1) as f64 * source_area.sqrt()))
}

/// How far the paper's f(k₁) ≈ k₂ holds for one anchor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnchorError {
    /// Share (by area) of the mapped source anchor that lies in its partner; 0 where nothing of it
    /// arrives.
    pub landed: f64,
    /// Mean distance of the mapped anchor to its partner, 0 inside, in √area; `None` where nothing
    /// arrives or there is no partner.
    pub mean_distance: Option<f64>,
}

/// Anchor error of a point map. `mapped` and `partner` say for each target vertex whether it is
/// matched to the source anchor and whether it is in the target's; `distance_to_partner(j)` is in
/// the units of `unit`.
pub fn anchor_error(
    mapped: &[bool],
    partner: &[bool],
    areas: &[f64],
    distance_to_partner: impl Fn(usize) -> f64,
    unit: f64,
) -> AnchorError {
    let (mut all, mut inside, mut distance) = (0.0, 0.0, 0.0);
    for j in (0..mapped.len()).filter(|&j| mapped[j]) {
        all += areas[j];
        if partner[j] {
            inside += areas[j];
        } else {
            distance += areas[j] * distance_to_partner(j);
        }
    }
    let has_partner = partner.contains(&true);
    AnchorError {
        landed: if all > 0.0 { inside / all } else { 0.0 },
        mean_distance: (all > 0.0 && has_partner).then(|| distance / (all * unit)),
    }
}

/// Dirichlet energy ½ ∫ ‖∇f‖² of a map into space given on the vertices (n), linear on triangles
/// (Pinkall & Polthier 1993): small where neighbours are sent to neighbours. Degenerate triangles
/// are left out. Free of scale in the mesh; quadratic in the scale of `values`.
pub fn dirichlet_energy(mesh: &Mesh, values: &[DVec3]) -> f64 {
    (0..mesh.n_faces()).map(|face| energy_of_face(mesh, values, face)).sum()
}

/// ¼ Σ_k cot αₖ ‖fᵢ − fⱼ‖² with i, j the ends of the side opposite to corner k, and cot αₖ =
/// (pᵢ − pₖ)·(pⱼ − pₖ) / (2 area)
fn energy_of_face(mesh: &Mesh, values: &[DVec3], face: usize) -> f64 {
    let corners = mesh.corners(face);
    let double_area = mesh.face_normal_scaled(face).length();
    let ids = mesh.faces()[face];
    let sum: f64 = (0..3)
        .map(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let cosine = (corners[i] - corners[k]).dot(corners[j] - corners[k]);
            cosine * values[ids[i] as usize].distance_squared(values[ids[j] as usize])
        })
        .sum();
    if double_area > 0.0 { 0.25 * sum / double_area } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_counts_vertices_or_areas() {
        let [found, truth, none] =
            [&[0, 1][..], &[1, 2], &[]].map(|ids| Region::from_vertices(4, ids).unwrap());
        assert_eq!(iou(&found, &truth).unwrap(), 1.0 / 3.0);
        assert_eq!(area_iou(&found, &truth, &[1.0, 2.0, 1.0, 9.0]).unwrap(), 0.5);
        assert_eq!(iou(&none, &none).unwrap(), 0.0);
        assert!(iou(&none, &Region::from_vertices(5, &[]).unwrap()).is_err());
    }

    #[test]
    fn geodesic_error_is_in_hundredths_of_the_side() {
        let (found, truth) =
            (PointMap { source_of: vec![0, 3] }, PointMap { source_of: vec![0, 1] });
        let error = geodesic_error(&found, &truth, |a, b| f64::from(a.abs_diff(b)) * 0.1, 4.0);
        assert!((error.unwrap() - 5.0).abs() < 1e-12);
    }

    #[test]
    fn an_anchor_that_half_lands_says_so() {
        let (mapped, partner) = ([true, true, false, false], [false, true, true, false]);
        let error = anchor_error(&mapped, &partner, &[1.0; 4], |_| 0.6, 2.0);
        assert!((error.landed - 0.5).abs() < 1e-12);
        assert!((error.mean_distance.unwrap() - 0.15).abs() < 1e-12);
        let nothing = anchor_error(&[false; 4], &partner, &[1.0; 4], |_| 0.6, 2.0);
        assert_eq!(nothing, AnchorError { landed: 0.0, mean_distance: None });
    }

    #[test]
    fn the_identity_of_a_flat_square_has_its_area_as_energy() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let square = Mesh::new(corners.clone(), vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        assert!((dirichlet_energy(&square, &corners) - 1.0).abs() < 1e-12);
        assert_eq!(dirichlet_energy(&square, &[DVec3::ONE; 4]), 0.0);
    }
}
