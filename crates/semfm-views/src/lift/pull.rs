//! The default rule: every sample looks itself up in every view that sees it.

use rayon::prelude::*;
use semfm_geom::sampling::SurfaceSample;
use semfm_geom::{Mesh, Pinhole, PixelDepth, Task};

use super::nearest_seen::nearest_seen;
use super::{Features, nothing_in_sight};
use crate::render::depth_lookup::inverse_depths;
use crate::render::ordered_mesh::OrderedMesh;
use crate::render::triangle::Projection;
use crate::{EmbeddedView, PatchEmbeddings, PatchGrid, Result};

/// Weight of a view beside |cos(view direction, normal)|: a grazing view still counts a little
/// where there is no other.
const GRAZING_WEIGHT: f32 = 0.05;

/// Least bilinear weight of a patch, so that a sample exactly on a patch's centre can still fall
/// back on the neighbours when that patch has no say.
const LEAST_BILINEAR: f32 = 1e-4;

/// Patches covered by less than this share describe the background: they count only where no
/// better one is near.
const LEAST_COVERAGE: f32 = 0.1;
const BACKGROUND_WEIGHT: f32 = 1e-3;

/// What a view says about a sample: four patches with weights of sum 1, and the view's own weight.
#[derive(Clone, Copy)]
struct Sighting {
    patches: [(usize, f32); 4],
    weight: f32,
}

/// The feature of a sample is the mean over the views v that see it,
///
/// > f = Σ_v (w_v / Σ_u w_u) Σ_k m_vk t_vk,   w_v = |cos θ_v| + .05,
///
/// where θ_v is the angle between the normal and the direction to the camera, and the four patches
/// around the sample's pixel have the vectors t_vk and weights m_vk of sum 1 ([`patch_mix`]).
pub(super) fn pull(
    mesh: &Mesh,
    samples: &[SurfaceSample],
    views: &[EmbeddedView],
    dim: usize,
    tolerance: f64,
    task: &Task,
) -> Result<Features> {
    task.step("lift", 0, 2)?;
    let ordered = OrderedMesh::new(mesh);
    // (views × M)
    let sightings: Vec<Vec<Option<Sighting>>> =
        views.par_iter().map(|view| sightings(&ordered, samples, view, tolerance)).collect();
    let lifted_by_view: Vec<usize> =
        sightings.iter().map(|seen| seen.iter().flatten().count()).collect();
    if lifted_by_view.iter().all(|&n| n == 0) {
        return Err(nothing_in_sight(views.len(), "visible surface sample"));
    }
    task.step("lift", 1, 2)?;

    let mut data = vec![0f32; samples.len() * dim];
    let n_views: Vec<u32> = data
        .par_chunks_exact_mut(dim)
        .enumerate()
        .map(|(j, feature)| {
            let seen = views.iter().zip(&sightings).filter_map(|(view, s)| Some((view, s[j]?)));
            let total: f32 = seen.clone().map(|(_, sighting)| sighting.weight).sum();
            let mut count = 0;
            for (view, sighting) in seen {
                // Dropped patches have weight 0 and may hold anything, NaN included.
                for (patch, weight) in sighting.patches.into_iter().filter(|tap| tap.1 > 0.0) {
                    let weight = weight * sighting.weight / total;
                    let token = view.patches.vector(patch);
                    feature.iter_mut().zip(token).for_each(|(f, t)| {
                        *f += weight * t;
                    });
                }
                count += 1;
            }
            count
        })
        .collect();

    let source = nearest_seen(samples, &n_views)?;
    for (j, &seen) in source.iter().enumerate() {
        if seen != j {
            data.copy_within(seen * dim..(seen + 1) * dim, j * dim);
        }
    }
    task.step("lift", 2, 2)?;
    Ok(Features { data, n_views, lifted_by_view })
}

/// For each sample, what the view says about it, if it sees it.
fn sightings(
    mesh: &OrderedMesh<'_>,
    samples: &[SurfaceSample],
    view: &EmbeddedView,
    tolerance: f64,
) -> Vec<Option<Sighting>> {
    let camera = &view.camera;
    let projected: Vec<PixelDepth> = samples.iter().map(|s| camera.project(s.point)).collect();
    let positions: Vec<[f64; 2]> = projected
        .iter()
        .map(|p| if in_image(camera, p) { [p.u, p.v] } else { [f64::NAN; 2] })
        .collect();
    let nearest = inverse_depths(&Projection::new(mesh, camera), &positions);
    let eye = camera.eye();
    samples
        .iter()
        .zip(&projected)
        .zip(&nearest)
        .map(|((sample, p), &inverse_depth)| {
            // No surface at all (1/0 = ∞) is rounding at the very edge of the silhouette.
            if !in_image(camera, p) || p.z > 1.0 / inverse_depth + tolerance {
                return None;
            }
            let patches = patch_mix(&view.patches, p.u, p.v)?;
            let cosine = (eye - sample.point).normalize_or_zero().dot(sample.normal).abs();
            Some(Sighting { patches, weight: cosine as f32 + GRAZING_WEIGHT })
        })
        .collect()
}

/// Whether a point falls into the image, in front of the camera.
fn in_image(camera: &Pinhole, &PixelDepth { u, v, z }: &PixelDepth) -> bool {
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    z > 0.0 && (0.0..=width).contains(&u) && (0.0..=height).contains(&v)
}

/// The four patches around a pixel position with their weights (sum 1): bilinear between patch
/// centres, times the trust in each patch. `None` outside the grid or where no patch is valid.
fn patch_mix(patches: &PatchEmbeddings, u: f64, v: f64) -> Option<[(usize, f32); 4]> {
    let PatchGrid { rows, cols, rect } = patches.grid();
    let [left, top, right, bottom] = rect.map(f64::from);
    // In patches from the first centre; the grid ends half a patch beyond its outer centres, and
    // images that are no multiple of the patch leave up to one patch of margin around it.
    let x = (u - left) / (right - left) * cols as f64 - 0.5;
    let y = (v - top) / (bottom - top) * rows as f64 - 0.5;
    let is_inside =
        (-1.5..=cols as f64 + 0.5).contains(&x) && (-1.5..=rows as f64 + 0.5).contains(&y);
    if !is_inside {
        return None;
    }
    let mut mix = [(0, 0.0); 4];
    let mut sum = 0.0;
    for (k, tap) in mix.iter_mut().enumerate() {
        let (column, column_weight) = tap_along(x, k % 2, cols);
        let (row, row_weight) = tap_along(y, k / 2, rows);
        let patch = row * cols + column;
        let weight = (column_weight * row_weight).max(LEAST_BILINEAR) * trust(patches, patch);
        *tap = (patch, weight);
        sum += weight;
    }
    (sum > 0.0).then(|| mix.map(|(patch, weight)| (patch, weight / sum)))
}

/// The patch below (`side` 0) or above (1) a position along one axis, and its linear weight.
fn tap_along(x: f64, side: usize, count: usize) -> (usize, f32) {
    let below = x.floor();
    let fraction = x - below;
    let patch = (below + side as f64).clamp(0.0, count as f64 - 1.0) as usize;
    (patch, if side == 0 { 1.0 - fraction } else { fraction } as f32)
}

/// min(2·coverage, 1), hardly anything on the background, nothing for dropped tokens.
fn trust(patches: &PatchEmbeddings, patch: usize) -> f32 {
    let coverage = f32::from(patches.coverage()[patch]) / 255.0;
    match patches.valid()[patch] {
        false => 0.0,
        true if coverage < LEAST_COVERAGE => BACKGROUND_WEIGHT,
        true => (2.0 * coverage).min(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(coverage: [u8; 6], valid: [bool; 6]) -> PatchEmbeddings {
        // Patches of 10 × 20 pixels.
        let grid = PatchGrid { rows: 2, cols: 3, rect: [10.0, 20.0, 40.0, 60.0] };
        PatchEmbeddings::new(grid, 1, vec![0.0; 6], coverage.to_vec(), valid.to_vec()).unwrap()
    }

    fn weight_of(mix: [(usize, f32); 4], patch: usize) -> f32 {
        mix.iter().filter(|tap| tap.0 == patch).map(|tap| tap.1).sum()
    }

    #[test]
    fn between_patch_centres_the_mix_is_bilinear() {
        let grid = grid([255; 6], [true; 6]);
        // A quarter of the way from patch (0, 1) to (0, 2), half-way down to row 1.
        let mix = patch_mix(&grid, 27.5, 40.0).unwrap();
        for (patch, expected) in [(1, 0.375), (2, 0.125), (4, 0.375), (5, 0.125)] {
            assert!((weight_of(mix, patch) - expected).abs() < 1e-6);
        }
        // In the corner, beyond the last centres, the corner patch speaks alone.
        assert!(weight_of(patch_mix(&grid, 39.9, 59.9).unwrap(), 5) > 0.999);
        assert!(patch_mix(&grid, 51.0, 40.0).is_none());
    }

    #[test]
    fn uncovered_and_dropped_patches_lose_their_say() {
        let mut valid = [true; 6];
        valid[1] = false;
        let mix = patch_mix(&grid([255, 255, 64, 255, 10, 255], valid), 30.0, 40.0).unwrap();
        let total = 64.0 / 255.0 * 2.0 + 1e-3 + 1.0;
        for (patch, trust) in [(1, 0.0), (2, 128.0 / 255.0), (4, 1e-3), (5, 1.0)] {
            assert!((weight_of(mix, patch) - trust / total).abs() < 1e-6);
        }
        assert!(patch_mix(&grid([255; 6], [false; 6]), 30.0, 40.0).is_none());
    }
}
