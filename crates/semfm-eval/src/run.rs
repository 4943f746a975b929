//! A run: the evaluation with its journal, and its results.

use std::collections::BTreeMap;
use std::path::Path;

use semfm::Task;
use serde_json::json;

use crate::dataset::Dataset;
use crate::embeddings::EmbeddingSource;
use crate::evaluation::{Evaluation, PairPlace};
use crate::journal::{FORMAT, Journal, Line, RunIdentity, RunSettings};
use crate::results::{About, Results};
use crate::row::Row;
use crate::settings::EvalSettings;
use crate::{OutputFolder, Result};

/// Runs every method on every pair and gives the results, which the caller writes with
/// [`Results::write`]. In `folder` stands the journal until [`Finished::close`]: an interrupted run goes on where it stopped. Progress is counted in
/// objects and pairs.
///
/// # Errors
/// [`Error::OtherRun`](crate::Error::OtherRun) where the folder holds an unfinished run of something else,
/// [`Error::Invalid`](crate::Error::Invalid) for impossible settings, [`Error::Io`](crate::Error::Io)
/// for files that cannot be written, cancellation. What goes wrong with one object or pair stands in
/// its rows.
pub fn run(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    settings: &EvalSettings,
    folder: OutputFolder,
    task: &Task,
) -> Result<Finished> {
    let methods = settings.methods()?;
    let identity = identity(dataset, embeddings, settings);
    let (journal, lines) = Journal::open(folder.path(), &identity, settings.fresh)?;
    let (mut done, mut objects) = (BTreeMap::new(), Vec::new());
    for line in lines {
        match line {
            Line::Pair(pair) => {
                let place = PairPlace { group: pair.group, pair: pair.pair };
                done.insert(place, pair.rows);
            }
            Line::Object(object) => objects.push(object),
        }
    }
    let resumed = done.len();
    let evaluation = Evaluation {
        dataset,
        embeddings,
        settings,
        methods: &methods,
        journal: Some(&journal),
        predictions: settings.keep_predictions.then_some(folder.path()),
        done,
        objects,
    };
    let results = results(evaluation, identity, task)?;
    Ok(Finished { results, resumed, journal, folder })
}

/// The same in memory: no file is written, nothing can be gone on with.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for impossible settings, cancellation. What goes wrong
/// with one object or pair stands in its rows.
pub fn evaluate(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    settings: &EvalSettings,
    task: &Task,
) -> Result<Results> {
    let methods = settings.methods()?;
    let identity = identity(dataset, embeddings, settings);
    let evaluation = Evaluation {
        dataset,
        embeddings,
        settings,
        methods: &methods,
        journal: None,
        predictions: None,
        done: BTreeMap::new(),
        objects: Vec::new(),
    };
    results(evaluation, identity, task)
}

fn results(evaluation: Evaluation<'_>, identity: RunIdentity, task: &Task) -> Result<Results> {
    let (dataset, settings) = (evaluation.dataset, evaluation.settings);
    let measured = evaluation.run(task)?;
    let about = About { identity, origin: dataset.origin.clone(), seed: settings.seed };
    let rows: Vec<Row> = measured.rows.into_values().flatten().collect();
    Ok(Results::new(about, measured.objects, rows, &settings.bootstrap))
}

/// A run that came to its end.
pub struct Finished {
    /// What came out.
    pub results: Results,
    /// Pairs that an interrupted run had done before.
    pub resumed: usize,
    journal: Journal,
    /// Held: nobody else writes there meanwhile.
    folder: OutputFolder,
}

impl Finished {
    /// The folder that the results belong into.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Removes the journal: call it once the results are written.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io).
    pub fn close(self) -> Result<Results> {
        self.journal.close()?;
        Ok(self.results)
    }
}

fn identity(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    settings: &EvalSettings,
) -> RunIdentity {
    RunIdentity {
        format: FORMAT.into(),
        program: settings.program.clone(),
        dataset: dataset.hash.clone(),
        embeddings: embeddings.identity(dataset),
        methods: settings.variants.iter().map(|variant| variant.name().to_owned()).collect(),
        settings: RunSettings {
            seed: settings.seed,
            shape: json!(settings.shape),
            overrides: settings.overrides.clone(),
        },
    }
}
