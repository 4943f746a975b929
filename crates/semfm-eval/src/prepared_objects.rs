//! Labelled objects of a dataset, prepared for `fused` alone.

use std::collections::BTreeMap;

use semfm::geom::{ShapeCache, ShapeSettings};
use semfm::{FeatureSource, Method, PipelineSettings, Prepared, Region, Task, prepare};

use crate::Result;
use crate::dataset::Dataset;
use crate::embeddings::EmbeddingSource;
use crate::object::{Attempt, attempt};
use crate::workers::Workers;

/// An object with its true region.
pub(crate) struct PreparedEntry {
    pub prepared: Prepared,
    pub truth: Region,
}

/// How objects are prepared and matched.
#[derive(Clone, Debug)]
pub struct PreparationSettings {
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// How the machine is shared.
    pub workers: Workers,
    /// Working mesh, Laplacian and basis.
    pub shape: ShapeSettings,
    /// Where prepared shapes are kept.
    pub cache: ShapeCache,
}

impl Default for PreparationSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            workers: Workers::new(0, 0),
            shape: ShapeSettings::default(),
            cache: ShapeCache::off(),
        }
    }
}

impl PreparationSettings {
    /// The settings of all steps.
    pub(crate) fn pipeline(&self) -> PipelineSettings {
        let pipeline = PipelineSettings {
            shape: self.shape.clone(),
            cache: self.cache.clone(),
            ..PipelineSettings::of(Method::Fused)
        };
        pipeline.with_seed(self.seed)
    }
}

/// The objects of all pairs of a dataset, by their places in it.
pub(crate) type PreparedEntries = BTreeMap<usize, Attempt<PreparedEntry>>;

/// Prepares the objects of all pairs; `step` is called after each.
///
/// # Errors
/// Only cancellation: what is wrong with an object stands in its place.
pub(crate) fn prepared_entries(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    settings: &PreparationSettings,
    task: &Task,
    step: impl Fn() -> Result<()> + Sync,
) -> Result<PreparedEntries> {
    let members = members(dataset);
    let quiet = task.silent();
    let objects = settings.workers.each(members.len(), |i| {
        let entry = &dataset.objects[members[i]];
        let made = || {
            let object = entry.load()?;
            let rolls = Method::Fused.info().features.rolls;
            let embedded = embeddings.views(entry, &object, rolls, &quiet)?;
            let features =
                FeatureSource::Embedded { views: &embedded.views, encoder: embedded.encoder };
            let prepared = prepare(object.mesh().clone(), features, &settings.pipeline(), &quiet)?;
            Ok(PreparedEntry { prepared, truth: object.truth })
        };
        let object = attempt("object", made())?;
        step()?;
        Ok(object)
    })?;
    Ok(members.into_iter().zip(objects).collect())
}

/// The places of the objects that stand in some pair.
pub(crate) fn members(dataset: &Dataset) -> Vec<usize> {
    let pairs = dataset.groups.iter().flat_map(|group| &group.pairs);
    let members: std::collections::BTreeSet<usize> = pairs.flat_map(|pair| pair.both()).collect();
    members.into_iter().collect()
}

/// Which half of the objects one is in, by the hash of its name: what is chosen on one half is read on the other.
pub(crate) fn half_of(name: &str) -> u8 {
    blake3::hash(name.as_bytes()).as_bytes()[0] % 2
}
