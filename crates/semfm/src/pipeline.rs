//! The road of the paper, from two meshes to a region: the tour that a user reads first.
//!
//! 1. [`PreparedObject::new`] makes a mesh ready: cleaned and simplified, Laplacian and eigenbasis
//!    (section III), and its meaning lifted to the surface (section IV-C).
//! 2. [`transfer`] carries a region from one prepared object to another: anchors, functional map,
//!    ZoomOut, point map, vote and confidence (sections IV-D and IV-E).
//!
//! The shell and the Python package call these same two functions.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use semfm_fmap::{Lifting, Method, Region, Transfer, TransferSettings};
use semfm_geom::math::DVec3;
use semfm_geom::sampling::farthest_points;
use semfm_geom::{Mesh, SemanticCloud, Shape, ShapeCache, ShapeSettings, Task};
use semfm_views::{EmbeddedView, LiftReport, LiftSettings, lift};

use crate::{Error, Result};

/// All settings of the road, each with the default that we measured to be best.
#[derive(Clone, Debug)]
pub struct PipelineSettings {
    /// Working mesh, Laplacian and basis.
    pub shape: ShapeSettings,
    /// How embeddings are lifted to the surface.
    pub lift: LiftSettings,
    /// How the region is carried.
    pub transfer: TransferSettings,
    /// Where prepared shapes are kept between runs; off by default.
    pub cache: ShapeCache,
}

impl Default for PipelineSettings {
    fn default() -> Self {
        Self::of(Method::Fused)
    }
}

impl PipelineSettings {
    /// A method's own constants. `semfm` has its own lifting, as the paper has it; every other
    /// method uses ours.
    pub fn of(method: Method) -> Self {
        let lift = match method.info().features.lifting {
            Lifting::Unproject => LiftSettings::paper(),
            _ => LiftSettings::default(),
        };
        let transfer = TransferSettings::of(method);
        Self { shape: ShapeSettings::default(), lift, transfer, cache: ShapeCache::off() }
    }

    /// One seed for everything that is drawn by chance.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.lift.seed = seed;
        self.transfer.clusters.seed = seed;
        self
    }
}

/// Where an object's features come from.
#[derive(Clone, Debug)]
pub enum Meaning<'a> {
    /// Patch embeddings of rendered views of this very mesh.
    Views(&'a [EmbeddedView]),
    /// One feature vector per vertex of the mesh as read (n × d, row-major), from anybody's network.
    PerVertex(&'a [f32]),
    /// A cloud that the caller made.
    Cloud(Cow<'a, SemanticCloud>),
}

/// An object ready to be matched: its shape, its meaning, and how long each took.
#[derive(Clone, Debug)]
pub struct PreparedObject {
    /// What matching reads, made once.
    pub object: semfm_fmap::PreparedObject,
    /// Working mesh and eigenbasis.
    pub shape: Arc<Shape>,
    /// Whether the shape was read from the cache.
    pub from_cache: bool,
    /// Surface points with features.
    pub cloud: Arc<SemanticCloud>,
    /// How well the views covered the surface, where there were views.
    pub lifted: Option<LiftReport>,
    /// Milliseconds per stage: `lift`, `shape`, `prepare`.
    pub stages_ms: Vec<(&'static str, f64)>,
}

impl PreparedObject {
    /// Makes a mesh ready: its shape (from the cache where it is known) and its semantic cloud.
    ///
    /// # Errors
    /// Whatever the shape, the features or the lifting report; [`Error::Invalid`] where per-vertex
    /// features do not fit the mesh.
    pub fn new(
        mesh: Mesh,
        meaning: Meaning<'_>,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Self> {
        let start = Instant::now();
        let (cloud, lifted) = semantic_cloud(&mesh, meaning, &settings.lift, task)?;
        let lift_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let cached = settings.cache.shape(mesh, &settings.shape, task)?;
        let shape_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let (shape, cloud) = (Arc::new(cached.shape), Arc::new(cloud));
        let object = semfm_fmap::PreparedObject::new(Arc::clone(&shape), Arc::clone(&cloud), task)?;
        let prepare_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Self {
            object,
            shape,
            from_cache: cached.hit,
            cloud,
            lifted,
            stages_ms: vec![("lift", lift_ms), ("shape", shape_ms), ("prepare", prepare_ms)],
        })
    }
}

/// The meaning of a mesh as a cloud on its surface, and how well views covered it, where there were
/// views. [`PreparedObject::new`] does this; alone it serves who gives one shape several meanings.
///
/// # Errors
/// Whatever the lifting reports; [`Error::Invalid`] where per-vertex features do not fit the mesh.
pub fn semantic_cloud(
    mesh: &Mesh,
    meaning: Meaning<'_>,
    settings: &LiftSettings,
    task: &Task,
) -> Result<(SemanticCloud, Option<LiftReport>)> {
    match meaning {
        Meaning::Views(views) => {
            let lifted = lift(mesh, views, settings, task)?;
            Ok((lifted.cloud, Some(lifted.report)))
        }
        Meaning::PerVertex(features) => {
            Ok((cloud_of_vertices(mesh, features, settings.n_samples)?, None))
        }
        Meaning::Cloud(cloud) => Ok((cloud.into_owned(), None)),
    }
}

/// Carries `region`, a weight per vertex of the source mesh as read, to the target.
///
/// # Errors
/// An empty region or one of another mesh, features of different dimensions, impossible settings,
/// cancellation. A region that lands nowhere is not an error but a refusal.
pub fn transfer(
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    settings: &TransferSettings,
    task: &Task,
) -> Result<Transfer> {
    Ok(semfm_fmap::transfer(&source.object, &target.object, region, settings, task)?)
}

/// A cloud at up to `n_points` farthest-point vertices of the surface, with their features.
fn cloud_of_vertices(mesh: &Mesh, features: &[f32], n_points: usize) -> Result<SemanticCloud> {
    let n = mesh.n_vertices();
    if features.is_empty() || !features.len().is_multiple_of(n) {
        let expected = format!("a whole number of values for each of {n} vertices");
        return Err(Error::invalid(
            "per-vertex features",
            expected,
            format!("{} values", features.len()),
        ));
    }
    let dim = features.len() / n;
    // Vertices that no triangle uses are no part of the surface.
    let mut used: Vec<u32> = mesh.faces().iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let positions: Vec<DVec3> = used.iter().map(|&v| mesh.vertices()[v as usize]).collect();
    let chosen =
        farthest_points(&positions, n_points).into_iter().map(|i| used[i as usize] as usize);
    let chosen: Vec<usize> = chosen.collect();
    let points = chosen.iter().map(|&v| mesh.vertices()[v]).collect();
    let rows = chosen.iter().flat_map(|&v| &features[v * dim..(v + 1) * dim]).copied().collect();
    Ok(SemanticCloud::new(points, rows, dim, vec![1; chosen.len()])?)
}
