//! The paper's rule: cast each patch's centre onto the surface, average what lands near a sample.

use rayon::prelude::*;
use semfm_geom::math::DVec3;
use semfm_geom::sampling::SurfaceSample;
use semfm_geom::{Mesh, PointIndex, Task};

use super::{Features, nothing_in_sight};
use crate::render::depth_lookup::inverse_depths;
use crate::render::ordered_mesh::OrderedMesh;
use crate::render::triangle::Projection;
use crate::{EmbeddedView, Result};

/// A lifted sample (x, e) of the paper's set 𝒮ᵢ: a surface point and the patch it came from.
struct LiftedPatch {
    point: DVec3,
    view: usize,
    patch: usize,
}

pub(super) fn unproject(
    mesh: &Mesh,
    samples: &[SurfaceSample],
    views: &[EmbeddedView],
    dim: usize,
    radius: f64,
    task: &Task,
) -> Result<Features> {
    task.step("lift", 0, 2)?;
    let ordered = OrderedMesh::new(mesh);
    let by_view: Vec<Vec<LiftedPatch>> =
        (0..views.len()).into_par_iter().map(|k| lifted_patches(&ordered, views, k)).collect();
    let lifted_by_view = by_view.iter().map(Vec::len).collect();
    let lifted: Vec<LiftedPatch> = by_view.into_iter().flatten().collect();
    if lifted.is_empty() {
        return Err(nothing_in_sight(views.len(), "patch whose centre falls on the surface"));
    }
    task.step("lift", 1, 2)?;

    let points: Vec<DVec3> = lifted.iter().map(|lifted| lifted.point).collect();
    let index = PointIndex::new(&points)?;
    let mut data = vec![0f32; samples.len() * dim];
    let n_views = data
        .par_chunks_exact_mut(dim)
        .zip(samples)
        .map(|(feature, sample)| {
            let near = index.within(sample.point, radius);
            let alone = [index.nearest(sample.point)];
            let tokens = if near.is_empty() { &alone[..] } else { &near };
            let share = 1.0 / tokens.len() as f32;
            for &(i, _) in tokens {
                let token = views[lifted[i].view].patches.vector(lifted[i].patch);
                feature.iter_mut().zip(token).for_each(|(f, t)| *f += share * t);
            }
            let mut seen_by: Vec<usize> = near.iter().map(|&(i, _)| lifted[i].view).collect();
            seen_by.sort_unstable();
            seen_by.dedup();
            seen_by.len() as u32
        })
        .collect();
    task.step("lift", 2, 2)?;
    Ok(Features { data, n_views, lifted_by_view })
}

/// The valid patches of view `k` whose centres see the surface, with the points they see.
fn lifted_patches(mesh: &OrderedMesh<'_>, views: &[EmbeddedView], k: usize) -> Vec<LiftedPatch> {
    let EmbeddedView { camera, patches } = &views[k];
    let (width, height) = (f64::from(camera.width()), f64::from(camera.height()));
    let centres: Vec<[f64; 2]> = (0..patches.n_patches())
        .map(|patch| {
            let [u, v] = patches.grid().centre(patch);
            let in_image = (0.0..=width).contains(&u) && (0.0..=height).contains(&v);
            if in_image && patches.valid()[patch] { [u, v] } else { [f64::NAN; 2] }
        })
        .collect();
    let eye = camera.eye();
    let inverse_depths = inverse_depths(&Projection::new(mesh, camera), &centres);
    let hits =
        inverse_depths.iter().zip(&centres).enumerate().filter(|(_, (inverse, _))| **inverse > 0.0);
    hits.map(|(patch, (&inverse, &[u, v]))| LiftedPatch {
        point: eye + camera.ray(u, v) / inverse,
        view: k,
        patch,
    })
    .collect()
}
