//! The evaluation itself: objects prepared once, every method on every pair, rows kept as they come.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use semfm::fmap::Matching;
use semfm::geom::{ShapeCache, ShapeSettings};
use semfm::{Region, Task, TransferSettings};

use crate::bootstrap::BootstrapSettings;
use crate::dataset::{Dataset, DatasetOrigin, Group};
use crate::embeddings::EmbeddingSource;
use crate::journal::{DonePair, FORMAT, Journal, Line, RunIdentity};
use crate::object::{EvalObject, Preparation, Ready, Tried, tried};
use crate::prediction::{PairPredictions, Prediction};
use crate::results::{About, Results};
use crate::row::{Failure, ObjectRow, Row};
use crate::variant::{Features, Override, Variant};
use crate::workers::Workers;
use crate::{Error, Result};

/// What to compare, and how.
#[derive(Clone, Debug)]
pub struct EvalSettings {
    /// The methods, in the order of the tables.
    pub variants: Vec<Variant>,
    /// Settings of theirs that are changed.
    pub overrides: Vec<Override>,
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// How the machine is shared.
    pub workers: Workers,
    /// Working mesh, Laplacian and basis.
    pub shape: ShapeSettings,
    /// Where prepared shapes are kept.
    pub cache: ShapeCache,
    /// Whether each prediction is written.
    pub keep_predictions: bool,
    /// Whether to forget what an interrupted run left.
    pub fresh: bool,
    /// Name, version or hash of the program, so that another one does not go on with its rows.
    pub program: String,
    /// How intervals are made.
    pub bootstrap: BootstrapSettings,
}

impl Default for EvalSettings {
    fn default() -> Self {
        Self {
            variants: Variant::ALL.to_vec(),
            overrides: Vec::new(),
            seed: 0,
            workers: Workers::new(0, 0),
            shape: ShapeSettings::default(),
            cache: ShapeCache::off(),
            keep_predictions: true,
            fresh: false,
            program: env!("CARGO_PKG_VERSION").into(),
            bootstrap: BootstrapSettings::default(),
        }
    }
}

/// Runs every method on every pair and gives the results, which the caller writes with
/// [`Results::write`]. In `folder`, which is made, stands the journal until
/// [`Finished::close`]: an interrupted run goes on where it stopped. Progress is counted in
/// objects and pairs.
///
/// # Errors
/// [`Error::OtherRun`] where the folder holds an unfinished run of something else,
/// [`Error::Invalid`] for impossible settings, files that cannot be written, cancellation. What goes
/// wrong with one object or pair is told in its rows.
pub fn run(
    dataset: &Dataset,
    embeddings: &EmbeddingSource<'_>,
    settings: &EvalSettings,
    folder: &Path,
    task: &Task,
) -> Result<Finished> {
    let methods = methods(settings)?;
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let identity = identity(dataset, embeddings, settings);
    let (journal, kept) = Journal::open(folder, &identity, settings.fresh)?;
    let mut done = BTreeMap::new();
    let mut objects = BTreeMap::new();
    for line in kept {
        match line {
            Line::Pair(pair) => drop(done.insert((pair.group, pair.pair), pair.rows)),
            Line::Object(object) => drop(objects.insert(key(&object), object)),
        }
    }
    let resumed = done.len();
    let evaluation = Evaluation {
        dataset,
        settings,
        methods: &methods,
        preparation: Preparation {
            embeddings,
            shape: &settings.shape,
            cache: &settings.cache,
            seed: settings.seed,
            wanted: &methods.iter().filter_map(|method| method.0.features()).collect(),
        },
        journal: &journal,
        predictions: settings.keep_predictions.then_some(folder),
        progress: Progress::new(dataset, &done, task),
        objects: Mutex::new(objects),
    };
    for (number, group) in dataset.groups.iter().enumerate() {
        for (pair, rows) in evaluation.group(number, group, &done)? {
            done.insert((number, pair), rows);
        }
    }
    let objects = evaluation.objects.into_inner().unwrap_or_default();
    let about = About { identity, origin: dataset.origin.clone(), seed: settings.seed };
    let rows = done.into_values().flatten().collect();
    let results = Results::new(about, objects.into_values().collect(), rows, &settings.bootstrap);
    Ok(Finished { results, resumed, journal })
}

/// A run that came to its end.
pub struct Finished {
    /// What came out.
    pub results: Results,
    /// Pairs that an interrupted run had done before.
    pub resumed: usize,
    journal: Journal,
}

impl Finished {
    /// Removes the journal: call it once the results are written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn close(self) -> Result<Results> {
        self.journal.close()?;
        Ok(self.results)
    }
}

type Method = (Variant, Option<TransferSettings>);

fn methods(settings: &EvalSettings) -> Result<Vec<Method>> {
    let mut seen = BTreeSet::new();
    if settings.variants.is_empty() || !settings.variants.iter().all(|c| seen.insert(c)) {
        let names: Vec<_> = settings.variants.iter().map(|c| c.name()).collect();
        return Err(Error::invalid("methods", "at least one, each once", names.join(",")));
    }
    for change in &settings.overrides {
        if !settings.variants.iter().any(|variant| variant.name() == change.method) {
            let what = format!("setting of {}", change.method);
            return Err(Error::invalid(what, "a method that is evaluated", &change.key));
        }
    }
    let with_overrides = |&variant: &Variant| -> Result<Method> {
        let Some(own) = variant.settings(settings.seed) else { return Ok((variant, None)) };
        let changed = settings.overrides.iter().try_fold(own, |own, o| o.apply(variant, own))?;
        Ok((variant, Some(changed)))
    };
    settings.variants.iter().map(with_overrides).collect()
}

fn identity(
    dataset: &Dataset,
    embeddings: &EmbeddingSource<'_>,
    settings: &EvalSettings,
) -> RunIdentity {
    let EvalSettings { seed, shape, overrides, .. } = settings;
    RunIdentity {
        format: FORMAT.into(),
        program: settings.program.clone(),
        dataset: dataset.hash.clone(),
        embeddings: match &dataset.origin {
            DatasetOrigin::Synthetic { level, .. } => format!("the simulated encoder ({level})"),
            DatasetOrigin::Folder { .. } => embeddings.identity(),
        },
        methods: settings.variants.iter().map(|c| c.name().to_owned()).collect(),
        settings: format!("seed {seed}, {shape:?}, changes {overrides:?}"),
    }
}

fn key(object: &ObjectRow) -> (String, String) {
    (object.category.clone(), object.name.clone())
}

struct Evaluation<'a> {
    dataset: &'a Dataset,
    settings: &'a EvalSettings,
    methods: &'a [Method],
    preparation: Preparation<'a>,
    journal: &'a Journal,
    /// Where predictions are put.
    predictions: Option<&'a Path>,
    progress: Progress,
    objects: Mutex<BTreeMap<(String, String), ObjectRow>>,
}

impl Evaluation<'_> {
    /// The rows of all pairs of a group that are not done yet.
    fn group(
        &self,
        number: usize,
        group: &Group,
        done: &BTreeMap<(usize, usize), Vec<Row>>,
    ) -> Result<Vec<(usize, Vec<Row>)>> {
        let open: Vec<usize> =
            (0..group.pairs.len()).filter(|&pair| !done.contains_key(&(number, pair))).collect();
        if open.is_empty() {
            return Ok(Vec::new());
        }
        let workers = &self.settings.workers;
        let objects = self.objects(group, &open)?;
        let places: Vec<usize> = objects.keys().copied().collect();
        let ready = workers.each(places.len(), |i| match &objects[&places[i]] {
            Ok(object) => Ok(Some(object.ready(self.progress.quiet())?)),
            Err(_) => Ok(None),
        })?;
        let ready: BTreeMap<usize, Option<Ready>> = places.into_iter().zip(ready).collect();
        let rows = workers.each(open.len(), |i| {
            let (source, target) = group.pairs[open[i]];
            let side = |place: usize| Side {
                name: &self.dataset.objects[place].name,
                category: &self.dataset.objects[place].category,
                object: objects.get(&place),
                ready: ready.get(&place).and_then(Option::as_ref),
            };
            let rows = self.pair(&group.name, &side(source), &side(target))?;
            let pair = DonePair { group: number, pair: open[i], rows };
            self.journal.append(&Line::Pair(pair.clone()))?;
            self.progress.step()?;
            Ok(pair.rows)
        })?;
        Ok(open.into_iter().zip(rows).collect())
    }

    /// The objects of the open pairs, prepared.
    fn objects(&self, group: &Group, open: &[usize]) -> Result<BTreeMap<usize, Tried<EvalObject>>> {
        let members: Vec<usize> = group
            .pairs
            .iter()
            .flat_map(|&(a, b)| [a, b])
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let needed: BTreeSet<usize> =
            open.iter().flat_map(|&pair| [group.pairs[pair].0, group.pairs[pair].1]).collect();
        let workers = &self.settings.workers;
        // Which parts there are depends on the whole group, whatever is left to do.
        let loaded = workers
            .each(members.len(), |i| tried("object", self.dataset.objects[members[i]].load()))?;
        let part_names = part_names(&loaded);
        let loaded: Vec<Mutex<Option<_>>> =
            loaded.into_iter().map(|o| Mutex::new(Some(o))).collect();
        let chosen: Vec<usize> =
            (0..members.len()).filter(|&i| needed.contains(&members[i])).collect();
        let objects = workers.each(chosen.len(), |i| {
            let place = members[chosen[i]];
            let entry = &self.dataset.objects[place];
            let object = loaded[chosen[i]].lock().ok().and_then(|mut slot| slot.take());
            let object = object.unwrap_or_else(|| Err(Failure::new("object", "taken twice")));
            let object = EvalObject::new(
                entry,
                object,
                &part_names,
                &self.preparation,
                self.progress.quiet(),
            )?;
            let about = match &object {
                Ok(object) => object.about.clone(),
                Err(failure) => ObjectRow {
                    name: entry.name.clone(),
                    category: entry.category.clone(),
                    failure: Some(failure.clone()),
                    ..ObjectRow::default()
                },
            };
            self.journal.append(&Line::Object(about.clone()))?;
            if let Ok(mut objects) = self.objects.lock() {
                objects.insert(key(&about), about);
            }
            self.progress.step()?;
            Ok((place, object))
        })?;
        Ok(objects.into_iter().collect())
    }

    /// Every method on one pair.
    fn pair(&self, group: &str, source: &Side<'_>, target: &Side<'_>) -> Result<Vec<Row>> {
        let mut predictions = PairPredictions::new(group, source.name, target.name);
        let file = predictions.file();
        let mut rows = Vec::new();
        for (variant, settings) in self.methods {
            let mut row = Row {
                group: group.into(),
                category: source.category.into(),
                source: source.name.into(),
                target: target.name.into(),
                method: variant.name().into(),
                ..Row::default()
            };
            let answer = match (source.object, target.object) {
                (Some(Ok(a)), Some(Ok(b))) => {
                    let job = Job { source: (a, source.ready), target: (b, target.ready) };
                    let carried =
                        job.carry(*variant, settings.as_ref(), &mut row, self.progress.quiet());
                    tried("transfer", carried)?.and_then(|carried| carried)
                }
                (Some(Err(failure)), _) | (_, Some(Err(failure))) => Err(failure.clone()),
                _ => Err(Failure::new("object", "was not prepared")),
            };
            match answer {
                Ok(answer) => {
                    if self.predictions.is_some() {
                        predictions.methods.insert(variant.name().into(), answer);
                        row.prediction = Some(file.clone());
                    }
                }
                Err(failure) => row.failure = Some(failure),
            }
            rows.push(row);
        }
        if let Some(folder) = self.predictions {
            predictions.write(folder, &file)?;
        }
        Ok(rows)
    }
}

/// One object of a pair.
struct Side<'a> {
    name: &'a str,
    category: &'a str,
    object: Option<&'a Tried<EvalObject>>,
    ready: Option<&'a Ready>,
}

/// A pair whose objects are sound.
struct Job<'a> {
    source: (&'a EvalObject, Option<&'a Ready>),
    target: (&'a EvalObject, Option<&'a Ready>),
}

impl<'a> Job<'a> {
    fn carry(
        &self,
        variant: Variant,
        settings: Option<&TransferSettings>,
        row: &mut Row,
        task: &Task,
    ) -> Result<Tried<Prediction>> {
        let (source, target) = (self.source.0, self.target.0);
        let (truth, areas) = (&target.truth, &target.areas);
        let (Some(features), Some(settings)) = (variant.features(), settings) else {
            let everything = Region::from_mask(&vec![true; areas.len()]);
            row.score(&everything, truth, areas)?;
            return Ok(Ok(Prediction::of_region(&everything)));
        };
        let by = |ready: Option<&'a Ready>| ready.and_then(|ready| ready.get(&features));
        let (Some(a), Some(b)) = (by(self.source.1), by(self.target.1)) else {
            return Ok(Err(Failure::new("object", "was not prepared")));
        };
        let ((a, a_ms), (b, b_ms)) = match (a, b) {
            (Ok(a), Ok(b)) => (a, b),
            (Err(failure), _) | (_, Err(failure)) => return Ok(Err(failure.clone())),
        };
        let matching = Matching::new(a, b, settings, task)?;
        matching.anchors(task)?; // the rows list them, whatever the method
        let carried = matching.transfer(&source.truth)?;
        row.take(&carried, truth, areas)?;
        for (stage, ms) in carried.report.stages_ms.iter() {
            row.stages_ms.insert(stage.into(), ms);
        }
        row.matching_ms = Some(carried.report.stages_ms.total_ms());
        for (side, object, ready_ms) in [("source", source, a_ms), ("target", target, b_ms)] {
            row.stages_ms.insert(format!("prepare_{side}"), *ready_ms);
            for (stage, ms) in object.times(features) {
                row.stages_ms.insert(format!("{stage}_{side}"), ms);
            }
        }
        sum_up_times(row, features);
        Ok(Ok(Prediction::of_transfer(&carried)))
    }
}

/// Cold time and the paper's runtime, from the stages.
fn sum_up_times(row: &mut Row, features: Features) {
    let of_encoder = ["views_source", "views_target", "embed_source", "embed_target"];
    let total: f64 = row.stages_ms.values().sum();
    let encoder: Vec<f64> =
        of_encoder.iter().filter_map(|s| row.stages_ms.get(*s).copied()).collect();
    let measured = encoder.len() == of_encoder.len() && features != Features::Parts;
    row.cold_ms = Some(total - encoder.iter().sum::<f64>());
    row.paper_runtime = measured.then_some(total / 1e3);
}

/// Part names of the whole group; none where some object has no parts.
fn part_names(objects: &[Tried<crate::dataset::LabelledObject>]) -> Vec<String> {
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
    /// For the work inside: its own steps would jumble the bar.
    quiet: Task,
    done: AtomicUsize,
    total: usize,
}

impl Progress {
    fn new(dataset: &Dataset, done: &BTreeMap<(usize, usize), Vec<Row>>, task: &Task) -> Self {
        let mut total = 0;
        for (number, group) in dataset.groups.iter().enumerate() {
            let open = group.pairs.iter().enumerate();
            let open: Vec<_> = open.filter(|(i, _)| !done.contains_key(&(number, *i))).collect();
            let objects: BTreeSet<usize> = open.iter().flat_map(|(_, p)| [p.0, p.1]).collect();
            total += open.len() + objects.len();
        }
        Self { task: task.clone(), quiet: Task::default(), done: AtomicUsize::new(0), total }
    }

    fn quiet(&self) -> &Task {
        &self.quiet
    }

    fn step(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        Ok(self.task.step("evaluation", done, self.total)?)
    }
}
