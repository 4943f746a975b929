//! Objects made ready once, for all pairs and methods of a group.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use semfm::fmap::PreparedObject;
use semfm::fmap::clusters::{ClusterSettings, Clusters, spectral_clusters};
use semfm::geom::{SemanticCloud, Shape, ShapeCache, ShapeSettings};
use semfm::pipeline::semantic_cloud;
use semfm::{Meaning, Region, Task};

use crate::dataset::{LabelledObject, ObjectEntry};
use crate::embeddings::EmbeddingSource;
use crate::row::{Failure, ObjectRow};
use crate::variant::Features;
use crate::{Error, Result};

/// Or why not.
pub(crate) type Tried<T> = std::result::Result<T, Failure>;

/// What preparing needs besides the object.
pub(crate) struct Preparation<'a> {
    pub embeddings: &'a EmbeddingSource<'a>,
    pub shape: &'a ShapeSettings,
    pub cache: &'a ShapeCache,
    pub seed: u64,
    /// The features that some variant asks for.
    pub wanted: &'a BTreeSet<Features>,
}

/// One object: its truth, its shape, and its meaning in each sense that is wanted.
pub(crate) struct EvalObject {
    pub truth: Region,
    /// Area of each vertex as read.
    pub areas: Vec<f64>,
    pub about: ObjectRow,
    shape: Tried<Option<Arc<Shape>>>,
    meanings: BTreeMap<Features, Tried<Seen>>,
}

/// An object's meaning in one sense.
struct Seen {
    cloud: Arc<SemanticCloud>,
    clusters: Arc<Clusters>,
    times: BTreeMap<&'static str, f64>,
}

/// An object ready to be matched, in each sense.
pub(crate) type Ready = BTreeMap<Features, Tried<(PreparedObject, f64)>>;

impl EvalObject {
    /// Loads and prepares an object. `part_names` are those of the whole group, so that all its
    /// objects have features of one dimension.
    ///
    /// # Errors
    /// Only cancellation: whatever is wrong with the object is told by its pairs.
    pub fn new(
        entry: &ObjectEntry,
        object: Tried<LabelledObject>,
        part_names: &[String],
        preparation: &Preparation<'_>,
        task: &Task,
    ) -> Result<Tried<Self>> {
        task.check()?;
        let object = match object {
            Ok(object) => object,
            Err(failure) => return Ok(Err(failure)),
        };
        let mesh = object.mesh();
        let mut about = ObjectRow {
            name: entry.name.clone(),
            category: entry.category.clone(),
            mesh: mesh.hash().to_string(),
            n_vertices: mesh.n_vertices(),
            n_triangles: mesh.n_faces(),
            n_region: object.truth.vertices().len(),
            parts: object.parts.keys().cloned().collect(),
            ..ObjectRow::default()
        };
        let mut meanings = BTreeMap::new();
        for &features in preparation.wanted {
            let seen = see(entry, &object, features, part_names, preparation, &mut about, task);
            meanings.insert(features, tried("features", seen)?);
        }
        let shape = if preparation.wanted.is_empty() {
            Ok(None)
        } else {
            let made = preparation.cache.shape(mesh.clone(), preparation.shape, task);
            tried("object", made.map(|made| Some(Arc::new(made.shape))).map_err(Error::from))?
        };
        Ok(Ok(Self { areas: mesh.vertex_areas(), truth: object.truth, about, shape, meanings }))
    }

    /// Everything that does not depend on the partner, with the milliseconds it took.
    ///
    /// # Errors
    /// Only cancellation.
    pub fn ready(&self, task: &Task) -> Result<Ready> {
        let mut ready = Ready::new();
        for (&features, seen) in &self.meanings {
            ready.insert(features, self.ready_by(seen, task)?);
        }
        Ok(ready)
    }

    fn ready_by(&self, seen: &Tried<Seen>, task: &Task) -> Result<Tried<(PreparedObject, f64)>> {
        let (shape, seen) = match (&self.shape, seen) {
            (Ok(Some(shape)), Ok(seen)) => (shape, seen),
            (Err(failure), _) | (_, Err(failure)) => return Ok(Err(failure.clone())),
            (Ok(None), Ok(_)) => return Ok(Err(Failure::new("object", "no shape was made"))),
        };
        let start = Instant::now();
        let prepared = PreparedObject::new(Arc::clone(shape), Arc::clone(&seen.cloud), task)
            .and_then(|object| object.with_clusters(Arc::clone(&seen.clusters)));
        let ms = start.elapsed().as_secs_f64() * 1e3;
        tried("object", prepared.map(|prepared| (prepared, ms)).map_err(Error::from))
    }

    /// Milliseconds of each stage of its preparation, made cold, in one sense.
    pub fn times(&self, features: Features) -> BTreeMap<&'static str, f64> {
        let mut times = match self.meanings.get(&features) {
            Some(Ok(seen)) => seen.times.clone(),
            _ => BTreeMap::new(),
        };
        if let Ok(Some(shape)) = &self.shape {
            // A shape from the cache remembers what its making took.
            let made = shape.report().stages_ms;
            times.insert("shape", made.working_mesh + made.laplacian + made.eigenbasis);
        }
        times
    }
}

/// The object's meaning in one sense: cloud and clusters.
fn see(
    entry: &ObjectEntry,
    object: &LabelledObject,
    features: Features,
    part_names: &[String],
    preparation: &Preparation<'_>,
    about: &mut ObjectRow,
    task: &Task,
) -> Result<Seen> {
    let mut times = BTreeMap::new();
    let lift = features.lift(preparation.seed);
    let mesh = object.mesh();
    let cloud = if features == Features::Parts {
        let labels = part_features(object, part_names);
        semantic_cloud(mesh, Meaning::PerVertex(&labels), &lift, task)?.0
    } else {
        let embedded = preparation.embeddings.views(entry, object, features.rolls(), task)?;
        for (stage, ms) in [("views", embedded.views_ms), ("embed", embedded.embed_ms)] {
            ms.and_then(|ms| times.insert(stage, ms));
        }
        let start = Instant::now();
        let (cloud, report) = semantic_cloud(mesh, Meaning::Views(&embedded.views), &lift, task)?;
        times.insert("lift", start.elapsed().as_secs_f64() * 1e3);
        if features == Features::Ours {
            (about.encoder, about.rolls) = (Some(embedded.encoder), Some(embedded.rolls));
            about.seen = report.map(|report| report.n_seen as f64 / cloud.n_points() as f64);
        }
        cloud
    };
    let start = Instant::now();
    let settings = ClusterSettings { seed: preparation.seed, ..ClusterSettings::default() };
    let clusters = spectral_clusters(&cloud, &settings, task)?;
    times.insert("clusters", start.elapsed().as_secs_f64() * 1e3);
    Ok(Seen { cloud: Arc::new(cloud), clusters: Arc::new(clusters), times })
}

/// One-hot part labels (n × parts): the features of the upper bound. Where some object of the group names no
/// parts, region and rest are the parts.
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
    for (column, ids) in
        part_names.iter().enumerate().filter_map(|(c, name)| Some((c, object.parts.get(name)?)))
    {
        ids.iter().for_each(|&id| features[id as usize * d + column] = 1.0);
    }
    features
}

/// A failure to be told by the pairs; cancellation alone goes on upwards.
pub(crate) fn tried<T>(kind: &str, result: Result<T>) -> Result<Tried<T>> {
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(error) if error.is_cancelled() => Err(error),
        Err(error) => Ok(Err(Failure::new(kind, error))),
    }
}
