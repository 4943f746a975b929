//! Labelled objects prepared once, for all pairs and methods of a group.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use semfm::fmap::PreparedObject;
use semfm::fmap::clusters::ClusterSettings;
use semfm::geom::{SemanticCloud, Shape, ShapeCache, ShapeSettings};
use semfm::{EncoderRecord, FeatureSource, LiftedCloud, Region, Task, semantic_cloud};

use crate::dataset::{LabelledObject, ObjectEntry};
use crate::embeddings::EmbeddingSource;
use crate::row::{Failure, ObjectRow};
use crate::variant::Features;
use crate::{Error, Result};

/// A value, or why the rows that need it have no score.
pub(crate) type Attempt<T> = std::result::Result<T, Failure>;

/// How objects are prepared.
pub(crate) struct Preparation<'a> {
    pub embeddings: &'a EmbeddingSource,
    pub shape: &'a ShapeSettings,
    pub cache: &'a ShapeCache,
    pub seed: u64,
    /// The features that some method needs, with the clusters that methods need of them.
    pub wanted: &'a BTreeMap<Features, Vec<ClusterSettings>>,
}

/// An object with its true region, prepared for each kind of features.
pub(crate) struct EvalObject {
    pub truth: Region,
    /// Area of each vertex as read.
    pub areas: Vec<f64>,
    pub row: ObjectRow,
    prepared: BTreeMap<Features, Attempt<TimedObject>>,
}

/// A prepared object and the milliseconds that each stage took, made cold.
pub(crate) struct TimedObject {
    pub object: PreparedObject,
    /// Views, encoder, lifting, shape, and what follows from cloud and shape.
    stages_ms: BTreeMap<&'static str, f64>,
    /// The rows list anchors whatever the method, so there are always clusters; only methods that
    /// read them are charged for them.
    clusters_ms: Vec<(ClusterSettings, f64)>,
}

impl EvalObject {
    /// Loads and prepares an object. `part_names` are those of the whole group, so that all its
    /// objects have features of one dimension.
    ///
    /// # Errors
    /// Only cancellation: what is wrong with the object stands in its pairs' rows.
    pub fn new(
        entry: &ObjectEntry,
        object: &LabelledObject,
        part_names: &[String],
        preparation: &Preparation<'_>,
        task: &Task,
    ) -> Result<Self> {
        task.check()?;
        let mesh = object.mesh();
        let mut row = ObjectRow {
            name: entry.name.clone(),
            category: entry.category.clone(),
            mesh: mesh.hash().to_string(),
            n_vertices: mesh.n_vertices(),
            n_triangles: mesh.n_faces(),
            n_region: object.truth.vertices().len(),
            parts: object.parts.keys().cloned().collect(),
            ..ObjectRow::default()
        };
        let mut clouds = BTreeMap::new();
        for &features in preparation.wanted.keys() {
            let cloud = timed_cloud(entry, object, features, part_names, preparation, task);
            clouds.insert(features, attempt("features", cloud)?);
        }
        if let Some(Ok(cloud)) = clouds.get(&Features::of_default_method()) {
            row.seen = cloud.seen;
            if let Some(encoder) = cloud.encoder.clone() {
                row.encoder = Some(encoder.name);
                row.encoder_version = Some(encoder.version);
                row.rolls = Some(encoder.rolls);
            }
        }
        let mut prepared = BTreeMap::new();
        if !clouds.is_empty() {
            let made = preparation.cache.shape(mesh.clone(), preparation.shape, task);
            let made = made.map(|made| Arc::new(made.shape)).map_err(Error::from);
            let shape = attempt("object", made)?;
            for (features, cloud) in clouds {
                let clusters = &preparation.wanted[&features];
                let timed = match (&shape, cloud) {
                    (Ok(shape), Ok(cloud)) => {
                        attempt("object", TimedObject::new(shape, cloud, clusters, task))?
                    }
                    (Err(failure), _) => Err(failure.clone()),
                    (_, Err(failure)) => Err(failure),
                };
                prepared.insert(features, timed);
            }
        }
        Ok(Self { areas: mesh.vertex_areas(), truth: object.truth.clone(), row, prepared })
    }

    /// The object prepared with these features.
    pub fn prepared(&self, features: Features) -> Attempt<&TimedObject> {
        match self.prepared.get(&features) {
            Some(prepared) => prepared.as_ref().map_err(Clone::clone),
            None => Err(Failure::new("object", "was not prepared")),
        }
    }
}

impl TimedObject {
    fn new(
        shape: &Arc<Shape>,
        cloud: TimedCloud,
        clusters: &[ClusterSettings],
        task: &Task,
    ) -> Result<Self> {
        let mut stages_ms = cloud.stages_ms;
        // A shape from the cache remembers what its making took.
        let made = shape.report().stages_ms;
        stages_ms.insert("shape", made.working_mesh + made.laplacian + made.eigenbasis);
        let start = Instant::now();
        let weights = cloud.encoder.as_ref().map(EncoderRecord::confidence_weights);
        let object = PreparedObject::new(Arc::clone(shape), cloud.cloud, task)?
            .with_confidence_weights(weights.unwrap_or_default());
        stages_ms.insert("prepare", milliseconds_since(start));
        let mut clusters_ms = Vec::new();
        for settings in clusters {
            let start = Instant::now();
            object.clusters(settings, task)?;
            clusters_ms.push((*settings, milliseconds_since(start)));
        }
        Ok(Self { object, stages_ms, clusters_ms })
    }

    /// Milliseconds of each stage; `clusters` are those that the method uses.
    pub fn stages_ms(&self, clusters: Option<&ClusterSettings>) -> BTreeMap<&'static str, f64> {
        let mut stages_ms = self.stages_ms.clone();
        let own = self.clusters_ms.iter().find(|(settings, _)| Some(settings) == clusters);
        if let Some((_, ms)) = own {
            stages_ms.insert("clusters", *ms);
        }
        stages_ms
    }
}

/// An object's semantic cloud, where its features came from and what making it took.
struct TimedCloud {
    cloud: Arc<SemanticCloud>,
    encoder: Option<EncoderRecord>,
    /// Share of the samples that some view saw.
    seen: Option<f64>,
    stages_ms: BTreeMap<&'static str, f64>,
}

fn timed_cloud(
    entry: &ObjectEntry,
    object: &LabelledObject,
    features: Features,
    part_names: &[String],
    preparation: &Preparation<'_>,
    task: &Task,
) -> Result<TimedCloud> {
    let lift = features.lift(preparation.seed);
    let mesh = object.mesh();
    if features == Features::Parts {
        let labels = part_features(object, part_names);
        let cloud = semantic_cloud(mesh, FeatureSource::PerVertex(&labels), &lift, task)?.cloud;
        let stages_ms = BTreeMap::new();
        return Ok(TimedCloud { cloud, encoder: None, seen: None, stages_ms });
    }
    let embedded = preparation.embeddings.views(entry, object, features.rolls(), task)?;
    let mut stages_ms = BTreeMap::new();
    for (stage, ms) in [("views", embedded.views_ms), ("embed", embedded.embed_ms)] {
        if let Some(ms) = ms {
            stages_ms.insert(stage, ms);
        }
    }
    let start = Instant::now();
    let features = FeatureSource::Views(&embedded.views);
    let LiftedCloud { cloud, report, .. } = semantic_cloud(mesh, features, &lift, task)?;
    stages_ms.insert("lift", milliseconds_since(start));
    Ok(TimedCloud {
        encoder: Some(embedded.encoder),
        seen: report.map(|report| report.n_seen as f64 / cloud.n_points() as f64),
        cloud,
        stages_ms,
    })
}

/// One-hot part labels (n × parts): the features of the upper bound. Where some object of the group
/// names no parts, region and rest are the parts.
fn part_features(object: &LabelledObject, part_names: &[String]) -> Vec<f32> {
    let n = object.mesh().n_vertices();
    if part_names.is_empty() {
        return object
            .truth
            .mask()
            .iter()
            .flat_map(|&b| if b { [1.0, 0.0] } else { [0.0, 1.0] })
            .collect();
    }
    let d = part_names.len();
    let mut features = vec![0.0; n * d];
    for (column, name) in part_names.iter().enumerate() {
        for &id in object.parts.get(name).into_iter().flatten() {
            features[id as usize * d + column] = 1.0;
        }
    }
    features
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// A failure for the rows; cancellation alone goes on upwards.
pub(crate) fn attempt<T>(kind: &str, result: Result<T>) -> Result<Attempt<T>> {
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(error) if error.is_cancelled() => Err(error),
        Err(error) => Ok(Err(Failure::new(kind, error))),
    }
}
