//! Objects prepared once, every method on every pair, rows kept as they come.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use semfm::fmap::Matching;
use semfm::fmap::clusters::ClusterSettings;
use semfm::{Region, Task};

use crate::Result;
use crate::dataset::{Dataset, Group, LabelledObject, Pair};
use crate::embeddings::EmbeddingSource;
use crate::journal::{DonePair, Journal, Line};
use crate::object::{Attempt, EvalObject, Preparation, attempt};
use crate::prediction::{PairPredictions, Prediction};
use crate::row::{Failure, ObjectRow, Row};
use crate::settings::{EvalSettings, MethodRun};
use crate::variant::Features;

/// Rows by pair, in the order of the dataset.
pub(crate) type RowsByPair = BTreeMap<PairPlace, Vec<Row>>;
/// Objects by category and name.
type ObjectRows = BTreeMap<(String, String), ObjectRow>;

/// Where a pair is in the dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PairPlace {
    pub group: usize,
    pub pair: usize,
}

/// What an evaluation is made of.
pub(crate) struct Evaluation<'a> {
    pub dataset: &'a Dataset,
    pub embeddings: &'a EmbeddingSource,
    pub settings: &'a EvalSettings,
    pub methods: &'a [MethodRun],
    /// Where what is done is kept.
    pub journal: Option<&'a Journal>,
    /// Where predictions are put.
    pub predictions: Option<&'a Path>,
    /// What an interrupted run left.
    pub done: RowsByPair,
    /// The objects that it prepared.
    pub objects: Vec<ObjectRow>,
}

/// What came out.
pub(crate) struct Measured {
    pub rows: RowsByPair,
    /// By category and name.
    pub objects: Vec<ObjectRow>,
}

impl<'a> Evaluation<'a> {
    /// Prepares and matches all that is not done yet.
    ///
    /// # Errors
    /// [`crate::Error::Io`] where journal or predictions cannot be written, cancellation.
    pub fn run(self, task: &Task) -> Result<Measured> {
        let wanted = wanted(self.methods);
        let preparation = Preparation {
            embeddings: self.embeddings,
            shape: &self.settings.shape,
            cache: &self.settings.cache,
            seed: self.settings.seed,
            wanted: &wanted,
        };
        let objects = self.objects.iter().map(|row| (row.key(), row.clone())).collect();
        let running = Running {
            evaluation: &self,
            preparation,
            progress: Progress::new(self.dataset, &self.done, task),
            objects: Mutex::new(objects),
        };
        let mut rows = self.done.clone();
        for (number, group) in self.dataset.groups.iter().enumerate() {
            rows.extend(running.group(number, group)?);
        }
        let objects = running.objects.into_inner().unwrap_or_default();
        Ok(Measured { rows, objects: objects.into_values().collect() })
    }
}

/// The features that some method needs, and the clusters that methods need of them.
fn wanted(methods: &[MethodRun]) -> BTreeMap<Features, Vec<ClusterSettings>> {
    let mut wanted = BTreeMap::<Features, Vec<ClusterSettings>>::new();
    for method in methods {
        let Some(features) = method.variant.features() else { continue };
        let clusters = wanted.entry(features).or_default();
        if let Some(settings) = method.clusters().filter(|own| !clusters.contains(own)) {
            clusters.push(settings);
        }
    }
    wanted
}

/// An evaluation under way.
struct Running<'a> {
    evaluation: &'a Evaluation<'a>,
    preparation: Preparation<'a>,
    progress: Progress,
    objects: Mutex<ObjectRows>,
}

/// The objects of a group that are needed, by their place in the dataset.
type GroupObjects = BTreeMap<usize, Attempt<EvalObject>>;

impl Running<'_> {
    /// The rows of all pairs of a group that are not done yet.
    fn group(&self, number: usize, group: &Group) -> Result<RowsByPair> {
        let places = (0..group.pairs.len()).map(|pair| PairPlace { group: number, pair });
        let open: Vec<PairPlace> =
            places.filter(|place| !self.evaluation.done.contains_key(place)).collect();
        if open.is_empty() {
            return Ok(RowsByPair::new());
        }
        let objects = self.group_objects(group, &open)?;
        let rows = self.evaluation.settings.workers.each(open.len(), |i| {
            let place = open[i];
            let rows = self.pair(group, &group.pairs[place.pair], &objects)?;
            let pair = DonePair { group: place.group, pair: place.pair, rows };
            self.keep(&Line::Pair(pair.clone()))?;
            self.progress.step()?;
            Ok(pair.rows)
        })?;
        Ok(open.into_iter().zip(rows).collect())
    }

    fn keep(&self, line: &Line) -> Result<()> {
        match self.evaluation.journal {
            Some(journal) => journal.append(line),
            None => Ok(()),
        }
    }

    /// The objects of the open pairs, prepared.
    fn group_objects(&self, group: &Group, open: &[PairPlace]) -> Result<GroupObjects> {
        let members: BTreeSet<usize> = group.pairs.iter().flat_map(Pair::both).collect();
        let members: Vec<usize> = members.into_iter().collect();
        let needed: BTreeSet<usize> =
            open.iter().flat_map(|place| group.pairs[place.pair].both()).collect();
        let dataset = self.evaluation.dataset;
        let workers = &self.evaluation.settings.workers;
        // Which parts there are depends on the whole group, whatever is left to do.
        let loaded = workers
            .each(members.len(), |i| attempt("object", dataset.objects[members[i]].load()))?;
        let part_names = part_names(&loaded);
        let mut chosen: Vec<(usize, Attempt<LabelledObject>)> =
            members.into_iter().zip(loaded).collect();
        chosen.retain(|(place, _)| needed.contains(place));
        let objects = workers.each(chosen.len(), |i| {
            let (place, loaded) = &chosen[i];
            Ok((*place, self.object(*place, loaded, &part_names)?))
        })?;
        Ok(objects.into_iter().collect())
    }

    /// Prepares one object and keeps its row.
    fn object(
        &self,
        place: usize,
        loaded: &Attempt<LabelledObject>,
        part_names: &[String],
    ) -> Result<Attempt<EvalObject>> {
        let entry = &self.evaluation.dataset.objects[place];
        let (object, row) = match loaded {
            Ok(loaded) => {
                let task = self.progress.quiet();
                let object = EvalObject::new(entry, loaded, part_names, &self.preparation, task)?;
                let row = object.row.clone();
                (Ok(object), row)
            }
            Err(failure) => {
                let row = ObjectRow {
                    name: entry.name.clone(),
                    category: entry.category.clone(),
                    failure: Some(failure.clone()),
                    ..ObjectRow::default()
                };
                (Err(failure.clone()), row)
            }
        };
        self.keep(&Line::Object(row.clone()))?;
        if let Ok(mut objects) = self.objects.lock() {
            objects.insert(row.key(), row);
        }
        self.progress.step()?;
        Ok(object)
    }

    /// Every method on one pair.
    fn pair(&self, group: &Group, pair: &Pair, objects: &GroupObjects) -> Result<Vec<Row>> {
        let entries = &self.evaluation.dataset.objects;
        let (source, target) = (&entries[pair.source], &entries[pair.target]);
        let mut predictions = PairPredictions::new(&group.name, &source.name, &target.name);
        let file = predictions.file();
        let mut rows = Vec::new();
        for method in self.evaluation.methods {
            let mut row = Row {
                group: group.name.clone(),
                category: source.category.clone(),
                source: source.name.clone(),
                target: target.name.clone(),
                method: method.variant.name().into(),
                ..Row::default()
            };
            let answer = match (objects.get(&pair.source), objects.get(&pair.target)) {
                (Some(Ok(source)), Some(Ok(target))) => {
                    let answer = method.apply(source, target, &mut row, self.progress.quiet());
                    attempt("transfer", answer)?.and_then(|answer| answer)
                }
                (Some(Err(failure)), _) | (_, Some(Err(failure))) => Err(failure.clone()),
                _ => Err(Failure::new("object", "was not prepared")),
            };
            match answer {
                Ok(answer) => {
                    if self.evaluation.predictions.is_some() {
                        predictions.methods.insert(row.method.clone(), answer);
                        row.prediction = Some(file.clone());
                    }
                }
                Err(failure) => row.failure = Some(failure),
            }
            rows.push(row);
        }
        if let Some(folder) = self.evaluation.predictions {
            predictions.write(folder, &file)?;
        }
        Ok(rows)
    }
}

impl MethodRun {
    /// The clusters that the method's anchors are selected from.
    fn clusters(&self) -> Option<ClusterSettings> {
        self.settings.as_ref().map(|settings| settings.clusters)
    }

    /// Transfers the source's true region to the target and scores it.
    fn apply(
        &self,
        source: &EvalObject,
        target: &EvalObject,
        row: &mut Row,
        task: &Task,
    ) -> Result<Attempt<Prediction>> {
        let (truth, areas) = (&target.truth, &target.areas);
        let (Some(features), Some(settings)) = (self.variant.features(), &self.settings) else {
            let everything = Region::from_mask(&vec![true; areas.len()]);
            row.score(&everything, truth, areas)?;
            return Ok(Ok(Prediction::of_region(&everything)));
        };
        let (a, b) = match (source.prepared(features), target.prepared(features)) {
            (Ok(a), Ok(b)) => (a, b),
            (Err(failure), _) | (_, Err(failure)) => return Ok(Err(failure)),
        };
        let matching = Matching::new(&a.object, &b.object, settings, task)?;
        matching.anchors(task)?; // the rows list them, whatever the method
        let transferred = matching.transfer(&source.truth)?;
        row.take(&transferred, truth, areas)?;
        for (stage, ms) in transferred.report.stages_ms.iter() {
            row.stages_ms.insert(stage.into(), ms);
        }
        row.matching_ms = Some(transferred.report.stages_ms.total_ms());
        let reads_clusters = row.stages_ms.contains_key("anchors");
        let clusters = self.clusters().filter(|_| reads_clusters);
        for (side, object) in [("source", a), ("target", b)] {
            for (stage, ms) in object.stages_ms(clusters.as_ref()) {
                row.stages_ms.insert(format!("{stage}_{side}"), ms);
            }
        }
        sum_up_times(row, features);
        Ok(Ok(Prediction::of_transfer(&transferred)))
    }
}

/// Cold time and the paper's runtime, from the stages.
fn sum_up_times(row: &mut Row, features: Features) {
    let of_encoder = ["views_source", "views_target", "embed_source", "embed_target"];
    let total: f64 = row.stages_ms.values().sum();
    let encoder: Vec<f64> =
        of_encoder.iter().filter_map(|stage| row.stages_ms.get(*stage).copied()).collect();
    let measured = encoder.len() == of_encoder.len() && features != Features::Parts;
    row.cold_ms = Some(total - encoder.iter().sum::<f64>());
    row.paper_runtime = measured.then_some(total / 1e3);
}

/// Part names of the whole group; none where some object has no parts.
fn part_names(objects: &[Attempt<LabelledObject>]) -> Vec<String> {
    let mut names = BTreeSet::new();
    for object in objects.iter().flatten() {
        if object.parts.is_empty() {
            return Vec::new();
        }
        names.extend(object.parts.keys().cloned());
    }
    names.into_iter().collect()
}

/// Objects and pairs done, of all that are to be done.
struct Progress {
    task: Task,
    /// For the work inside: its own steps would mix with these.
    quiet: Task,
    done: AtomicUsize,
    total: usize,
}

impl Progress {
    fn new(dataset: &Dataset, done: &RowsByPair, task: &Task) -> Self {
        let mut total = 0;
        for (number, group) in dataset.groups.iter().enumerate() {
            let mut objects = BTreeSet::new();
            for (pair, open) in group.pairs.iter().enumerate() {
                if !done.contains_key(&PairPlace { group: number, pair }) {
                    total += 1;
                    objects.extend(open.both());
                }
            }
            total += objects.len();
        }
        Self { task: task.clone(), quiet: task.silent(), done: AtomicUsize::new(0), total }
    }

    fn quiet(&self) -> &Task {
        &self.quiet
    }

    fn step(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        Ok(self.task.step("evaluation", done, self.total)?)
    }
}
