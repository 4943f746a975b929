//! Lifting: from patch embeddings in images to a [`SemanticCloud`] on the surface (section IV-C).
//!
//! Two rules. Pull: each surface sample looks up its own place in every view that sees it (the
//! default). Unproject: each patch centre is cast onto the surface, and a sample averages what
//! landed near it (the paper's). On thin objects hardly one patch centre in fifteen hits the
//! surface, which is what the first rule cures.

mod nearest_seen;
mod pull;
mod unproject;

use semfm_geom::math::bounds;
use semfm_geom::sampling::{SurfaceSample, sample_even, sample_uniform};
use semfm_geom::{Mesh, SemanticCloud, Task, surface_sphere, surface_vertices};

use crate::{EmbeddedView, Error, Result};

/// How image features reach the surface samples.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum LiftRule {
    /// Samples pull their features out of every view that sees them; samples that no view sees
    /// take those of the nearest seen sample along the surface.
    Pull {
        /// How far behind the visible surface a sample may lie and still count as seen, as a share
        /// of the bounding-sphere radius.
        depth_tolerance: f64,
    },
    /// The paper's rule: patch centres are unprojected onto the surface, samples average the ones
    /// within a radius, or take the nearest where there is none.
    Unproject {
        /// The paper's ε, as a share of the bounding box's diagonal.
        radius: f64,
    },
}

/// How the cloud is made.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LiftSettings {
    /// Which way features travel.
    pub rule: LiftRule,
    /// Surface samples M: farthest points for [`LiftRule::Pull`], area-uniform for
    /// [`LiftRule::Unproject`].
    pub n_samples: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for LiftSettings {
    fn default() -> Self {
        Self { rule: LiftRule::Pull { depth_tolerance: 0.01 }, n_samples: 1200, seed: 0 }
    }
}

impl LiftSettings {
    /// The method `semfm`: 400 area-uniform samples, ε = 6 % of the diagonal.
    pub fn paper() -> Self {
        Self { rule: LiftRule::Unproject { radius: 0.06 }, n_samples: 400, seed: 0 }
    }

    fn check(&self) -> Result<()> {
        if !(1..=1_000_000).contains(&self.n_samples) {
            let found = self.n_samples.to_string();
            return Err(Error::invalid("surface samples", "1 to 1000000", found));
        }
        let (name, share) = match self.rule {
            LiftRule::Pull { depth_tolerance } => ("depth tolerance", depth_tolerance),
            LiftRule::Unproject { radius } => ("lifting radius", radius),
        };
        if !(share > 0.0 && share.is_finite()) {
            return Err(Error::invalid(
                name,
                "a positive share of the object's size",
                share.to_string(),
            ));
        }
        Ok(())
    }
}

/// The cloud, the samples it was made on (in the same order), and how well they were seen.
#[derive(Clone, Debug)]
pub struct Lifted {
    /// Points (M × 3) with features (M × d).
    pub cloud: SemanticCloud,
    /// The same points with their triangles and normals.
    pub samples: Vec<SurfaceSample>,
    /// What was seen.
    pub report: LiftReport,
}

/// How well the views cover the surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LiftReport {
    /// Samples whose features come from at least one view.
    pub n_seen: usize,
    /// For each view, the samples it sees ([`LiftRule::Pull`]) or the patch centres that landed on
    /// the surface ([`LiftRule::Unproject`]).
    pub lifted_by_view: Vec<usize>,
}

/// Features on the samples, before they become a cloud.
struct Features {
    data: Vec<f32>, // (M × d)
    n_views: Vec<u32>,
    lifted_by_view: Vec<usize>,
}

/// Carries the embeddings of `views` onto samples of the surface of `mesh`.
///
/// `mesh` is the mesh that the views show, in the frame of their cameras; the views' grids may
/// differ in size and rectangle, but not in dimension. The same input and seed give the same bytes
/// at every thread count.
///
/// # Errors
/// [`Error::Invalid`] for settings out of range, no views, a view that disagrees in dimension (named),
/// or when nothing of the surface is in sight; [`semfm_geom::Error::NoArea`];
/// [`semfm_geom::Error::Cancelled`].
pub fn lift(
    mesh: &Mesh,
    views: &[EmbeddedView],
    settings: &LiftSettings,
    task: &Task,
) -> Result<Lifted> {
    settings.check()?;
    let dim = check(views)?;
    let samples = match settings.rule {
        LiftRule::Pull { .. } => sample_even(mesh, settings.n_samples, settings.seed)?,
        LiftRule::Unproject { .. } => sample_uniform(mesh, settings.n_samples, settings.seed)?,
    };
    // Both rules measure in the size of the surface, whatever stray vertices the mesh holds.
    let features = match settings.rule {
        LiftRule::Pull { depth_tolerance } => {
            let radius = surface_sphere(mesh).radius;
            pull::pull(mesh, &samples, views, dim, depth_tolerance * radius, task)?
        }
        LiftRule::Unproject { radius } => {
            let (low, high) = bounds(&surface_vertices(mesh))
                .expect("a mesh has a triangle, and that has corners");
            let epsilon = radius * low.distance(high);
            unproject::unproject(mesh, &samples, views, dim, epsilon, task)?
        }
    };
    let report = LiftReport {
        n_seen: features.n_views.iter().filter(|&&n| n > 0).count(),
        lifted_by_view: features.lifted_by_view,
    };
    let points = samples.iter().map(|sample| sample.point).collect();
    let cloud = SemanticCloud::new(points, features.data, dim, features.n_views)?;
    Ok(Lifted { cloud, samples, report })
}

/// Checks every view and returns their common dimension.
fn check(views: &[EmbeddedView]) -> Result<usize> {
    let Some(first) = views.first() else {
        return Err(Error::invalid("embedded views", "at least one", "none"));
    };
    let dim = first.patches.dim();
    for (k, view) in views.iter().enumerate() {
        let found = view.patches.dim();
        if found != dim {
            let expected = format!("{dim} dimensions, as in view 0");
            return Err(Error::invalid(format!("view {k}"), expected, found.to_string()));
        }
    }
    Ok(dim)
}

fn nothing_in_sight(n_views: usize, what: &str) -> Error {
    let expected = format!("at least one {what}");
    Error::invalid(
        "surface in sight of the embedded views",
        expected,
        format!("none in {n_views} views"),
    )
}
