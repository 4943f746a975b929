//! The tour, from two meshes to a region, in the order of the paper.
//!
//! 1. [`prepare`] makes a mesh ready: an encoder is shown views of it and their features are lifted to the surface as a semantic cloud
//!    (section IV-C), the mesh is cleaned and simplified and gets Laplacian and eigenbasis
//!    (section III), and both become a [`PreparedObject`].
//! 2. [`transfer`](crate::transfer) matches two prepared objects and transfers a region from one to
//!    the other: anchors, functional map, ZoomOut, point map, vote and confidence (sections IV-D
//!    and IV-E). [`Matching`](crate::Matching) keeps the match for further regions.
//! 3. [`find_grasps`](crate::find_grasps) grasps the target in the region.
//!
//! The shell and the Python package call these same functions.

use std::fmt;
use std::sync::Arc;
use std::time::Instant;

use semfm_encoder::rendered_views::Coloring;
use semfm_encoder::{EncodedViews, Encoder, EncoderIdentity, confidence_weights};
use semfm_fmap::{Lifting, Method, PreparedObject, TransferSettings};
use semfm_geom::math::DVec3;
use semfm_geom::sampling::farthest_points;
use semfm_geom::{
    ConfidenceWeights, Mesh, SemanticCloud, ShapeCache, ShapeSettings, Task, noise_free,
};
#[cfg(feature = "mcap")]
use semfm_views::mcap::EmbeddingsFile;
use semfm_views::{EmbeddedView, LiftReport, LiftSettings, lift};
use serde::{Deserialize, Serialize};

use crate::encoded_objects::{EncodedObjects, milliseconds_since};
use crate::{Error, Result};

/// The settings of all steps, each with the default that we measured to be best.
#[derive(Clone, Debug)]
pub struct PipelineSettings {
    /// Working mesh, Laplacian and basis.
    pub shape: ShapeSettings,
    /// How features are lifted to the surface.
    pub lift: LiftSettings,
    /// How the region is transferred.
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
#[non_exhaustive]
pub enum FeatureSource<'a> {
    /// An encoder that is shown rendered views of the mesh in grey, at the rotations that it wants
    /// (the built-in one: [`builtin_encoder`](crate::encoder::builtin_encoder)).
    Encoder(&'a dyn Encoder),
    /// Patch embeddings of rendered views of this very mesh.
    Views(&'a [EmbeddedView]),
    /// The same with the name of the encoder that made them, for reports.
    Embedded {
        /// The views.
        views: &'a [EmbeddedView],
        /// Who made them.
        encoder: EncoderRecord,
    },
    /// One feature vector per vertex of the mesh as read (n × d, row-major), from any network.
    PerVertex(&'a [f32]),
    /// A cloud that the caller made.
    Cloud(Arc<SemanticCloud>),
    /// None: the geometry alone, for the method `wks`.
    Geometry,
}

/// Which encoder made an object's features, as reports name it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EncoderRecord {
    /// Name of the encoder.
    pub name: String,
    /// Version of its weights.
    pub version: String,
    /// Rotations of each view that were averaged.
    pub rolls: u32,
    /// Views of the object.
    pub n_views: usize,
    /// True where the features were made up, without a network.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub simulated: bool,
}

impl fmt::Display for EncoderRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, version, rolls, n_views, .. } = self;
        write!(f, "{n_views} views by {name} {version} ({rolls} rolls)")
    }
}

impl EncoderRecord {
    /// Of what an encoder made.
    pub fn of(encoded: &EncodedViews) -> Self {
        let EncoderIdentity { name, version } = encoded.encoder.clone();
        let n_views = encoded.views.len();
        Self { name, version, rolls: encoded.rolls, n_views, simulated: false }
    }

    /// How evidence in answers found by its features becomes a probability.
    pub fn confidence_weights(&self) -> ConfidenceWeights {
        let Self { name, version, .. } = self.clone();
        confidence_weights(&EncoderIdentity { name, version })
    }

    /// Of an embeddings file.
    #[cfg(feature = "mcap")]
    pub fn of_file(file: &EmbeddingsFile) -> Self {
        let about = &file.metadata;
        Self {
            name: about.encoder.clone(),
            version: about.revision.clone(),
            rolls: about.rolls,
            n_views: file.views.len(),
            simulated: about.simulated,
        }
    }
}

#[cfg(feature = "mcap")]
impl<'a> From<&'a EmbeddingsFile> for FeatureSource<'a> {
    fn from(file: &'a EmbeddingsFile) -> Self {
        Self::Embedded { views: &file.views, encoder: EncoderRecord::of_file(file) }
    }
}

/// An object ready to be matched, and how it was prepared.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The object.
    pub object: PreparedObject,
    /// How it came about.
    pub report: PreparationReport,
}

/// How an object was prepared.
#[derive(Clone, Debug)]
pub struct PreparationReport {
    /// Whether the shape was read from the cache.
    pub from_cache: bool,
    /// How well the views covered the surface, where there were views.
    pub lifted: Option<LiftReport>,
    /// The encoder behind the features, where it is known.
    pub encoder: Option<EncoderRecord>,
    /// Milliseconds of wall time per stage: `views` and `embed` where an encoder was asked, `lift`,
    /// `shape`, `prepare`.
    pub stages_ms: Vec<(&'static str, f64)>,
}

/// Prepares a mesh with its features: cloud, shape (from the cache where it is known), and what
/// matching derives from the two.
///
/// # Errors
/// [`Error::Invalid`] where per-vertex features do not fit the mesh; [`Error::Views`] for views that
/// do not; [`Error::Encoder`] for an encoder without an answer; [`Error::Geom`] for a mesh without area, impossible shape settings or an eigensolver that
/// does not converge, and on cancellation; [`Error::Fmap`] for features without variance.
pub fn prepare(
    mesh: Mesh,
    features: FeatureSource<'_>,
    settings: &PipelineSettings,
    task: &Task,
) -> Result<Prepared> {
    let mut stages_ms = Vec::new();
    let encoded = match &features {
        FeatureSource::Encoder(encoder) => Some(encode(&mesh, *encoder, &mut stages_ms, task)?),
        _ => None,
    };
    let features = encoded.as_ref().map_or(features, |encoded| FeatureSource::Embedded {
        views: &encoded.views,
        encoder: EncoderRecord::of(encoded),
    });
    let start = Instant::now();
    let lifted = match features {
        FeatureSource::Geometry => None,
        features => Some(semantic_cloud(&mesh, features, &settings.lift, task)?),
    };
    stages_ms.push(("lift", milliseconds_since(start)));

    let start = Instant::now();
    let shape = settings.cache.shape(mesh, &settings.shape, task)?;
    stages_ms.push(("shape", milliseconds_since(start)));

    let start = Instant::now();
    let (from_cache, shape) = (shape.hit, Arc::new(shape.shape));
    let (object, lifted, encoder) = match lifted {
        Some(LiftedCloud { cloud, report, encoder }) => {
            let object = PreparedObject::new(shape, cloud, task)?;
            let weights = encoder.as_ref().map(EncoderRecord::confidence_weights);
            (object.with_confidence_weights(weights.unwrap_or_default()), report, encoder)
        }
        None => (PreparedObject::without_features(shape, task)?, None, None),
    };
    stages_ms.push(("prepare", milliseconds_since(start)));

    let report = PreparationReport { from_cache, lifted, encoder, stages_ms };
    Ok(Prepared { object, report })
}

/// What an encoder makes of a mesh: rendered as it wants, in memory.
fn encode(
    mesh: &Mesh,
    encoder: &dyn Encoder,
    stages_ms: &mut Vec<(&'static str, f64)>,
    task: &Task,
) -> Result<EncodedViews> {
    let rolls = encoder.wants().rolls;
    let mut made = EncodedObjects::new(encoder, &[mesh.into()], Coloring::Grey, rolls, task)?;
    stages_ms.extend([("views", made.views_ms[0]), ("embed", made.embed_ms)]);
    Ok(made.encoded.remove(0))
}

/// The semantic cloud of a mesh, and how well views covered the surface.
#[derive(Clone, Debug)]
pub struct LiftedCloud {
    /// Surface points with features.
    pub cloud: Arc<SemanticCloud>,
    /// What was seen, where there were views.
    pub report: Option<LiftReport>,
    /// The encoder behind the features, where it is known.
    pub encoder: Option<EncoderRecord>,
}

/// The features of a mesh as a cloud on its surface. [`prepare`] does this; alone it is for callers
/// who give one shape several kinds of features.
///
/// # Errors
/// [`Error::Invalid`] where per-vertex features do not fit the mesh and for
/// [`FeatureSource::Geometry`], [`Error::Views`] for views that do not fit, [`Error::Encoder`] for an encoder without an answer, [`Error::Geom`] for a mesh without area and on cancellation.
pub fn semantic_cloud(
    mesh: &Mesh,
    features: FeatureSource<'_>,
    settings: &LiftSettings,
    task: &Task,
) -> Result<LiftedCloud> {
    match features {
        FeatureSource::Encoder(encoder) => {
            let encoded = encode(mesh, encoder, &mut Vec::new(), task)?;
            let encoder = EncoderRecord::of(&encoded);
            let features = FeatureSource::Embedded { views: &encoded.views, encoder };
            semantic_cloud(mesh, features, settings, task)
        }
        FeatureSource::Views(views) => {
            let lifted = lift(&noise_free(mesh), views, settings, task)?;
            let (cloud, report) = (Arc::new(lifted.cloud), Some(lifted.report));
            Ok(LiftedCloud { cloud, report, encoder: None })
        }
        FeatureSource::Embedded { views, encoder } => {
            let lifted = semantic_cloud(mesh, FeatureSource::Views(views), settings, task)?;
            Ok(LiftedCloud { encoder: Some(encoder), ..lifted })
        }
        FeatureSource::PerVertex(features) => {
            let cloud = cloud_of_vertices(mesh, features, settings.n_samples)?;
            Ok(LiftedCloud { cloud: Arc::new(cloud), report: None, encoder: None })
        }
        FeatureSource::Cloud(cloud) => Ok(LiftedCloud { cloud, report: None, encoder: None }),
        FeatureSource::Geometry => {
            Err(Error::invalid("features", "those of views, vertices or a cloud", "none"))
        }
    }
}

/// A cloud at up to `n_points` farthest-point vertices of the surface, with their features.
fn cloud_of_vertices(mesh: &Mesh, features: &[f32], n_points: usize) -> Result<SemanticCloud> {
    let n = mesh.n_vertices();
    if features.is_empty() || !features.len().is_multiple_of(n) {
        let expected = format!("a whole number of values for each of {n} vertices");
        let found = format!("{} values", features.len());
        return Err(Error::invalid("per-vertex features", expected, found));
    }
    let dim = features.len() / n;
    // Vertices that no triangle uses are no part of the surface.
    let mut used: Vec<u32> = mesh.faces().iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let positions: Vec<DVec3> = used.iter().map(|&v| mesh.vertices()[v as usize]).collect();
    let chosen: Vec<usize> =
        farthest_points(&positions, n_points).iter().map(|&i| used[i as usize] as usize).collect();
    let points = chosen.iter().map(|&v| mesh.vertices()[v]).collect();
    let rows = chosen.iter().flat_map(|&v| &features[v * dim..(v + 1) * dim]).copied().collect();
    Ok(SemanticCloud::new(points, rows, dim, vec![1; chosen.len()])?)
}
