//! Every object as the target of memories that hold others of its kind.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use semfm::fmap::fusion::{Answer, fuse};
use semfm::fmap::metrics::iou;
use semfm::memory::{MemorySettings, shortlist};
use semfm::{Matching, Task, Transfer};

use super::draws::{Draw, draws};
use super::results::{MEMORY_FORMAT, MemoryResults, MemoryRow, MemorySummary, ScoredAnswer};
use crate::dataset::{Dataset, Group};
use crate::embeddings::EmbeddingSource;
use crate::object::attempt;
use crate::prepared_objects::{
    PreparationSettings, PreparedEntries, PreparedEntry, half_of, members, prepared_entries,
};
use crate::{Error, Result};

/// Which memories are asked, and how.
#[derive(Clone, Debug)]
pub struct MemoryEvalSettings {
    /// Demonstrations of the target's kind, at most; one table line each.
    pub counts: Vec<usize>,
    /// Objects of other categories in each memory.
    pub n_distractors: usize,
    /// How a memory answers.
    pub memory: MemorySettings,
    /// How objects are prepared and matched.
    pub preparation: PreparationSettings,
}

impl Default for MemoryEvalSettings {
    fn default() -> Self {
        Self {
            counts: vec![1, 2, 3, 5, 10],
            n_distractors: 0,
            memory: MemorySettings::default(),
            preparation: PreparationSettings::default(),
        }
    }
}

/// Asks memories of every number of demonstrations for every object. An object's memory holds others of its group,
/// never the object itself. Progress is counted in objects. What goes wrong with one object stands in its rows.
///
/// # Errors
/// [`Error::Invalid`] for no numbers of demonstrations or one of 0, cancellation.
pub fn run_memory(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    settings: &MemoryEvalSettings,
    task: &Task,
) -> Result<MemoryResults> {
    if settings.counts.is_empty() || settings.counts.contains(&0) {
        let found = format!("{:?}", settings.counts);
        return Err(Error::invalid(
            "demonstrations",
            "at least one number, each at least 1",
            found,
        ));
    }
    let run = MemoryRun {
        dataset,
        settings,
        task,
        quiet: task.silent(),
        done: AtomicUsize::new(0),
        total: 2 * members(dataset).len(),
    };
    let preparation = &settings.preparation;
    let objects = prepared_entries(dataset, embeddings, preparation, task, || run.step())?;
    let mut rows = Vec::new();
    for group in &dataset.groups {
        rows.extend(run.group(group, &objects)?);
    }
    Ok(MemoryResults {
        format: MEMORY_FORMAT.into(),
        dataset: dataset.hash.clone(),
        embeddings: embeddings.identity(dataset),
        n_distractors: settings.n_distractors,
        shortlist: settings.memory.shortlist,
        seed: settings.preparation.seed,
        summaries: MemorySummary::all_of(&rows),
        rows,
    })
}

struct MemoryRun<'a> {
    dataset: &'a Dataset,
    settings: &'a MemoryEvalSettings,
    task: &'a Task,
    quiet: Task,
    done: AtomicUsize,
    total: usize,
}

/// The answers on one target that were asked for, each with its milliseconds, by the sources' places.
type Answers = BTreeMap<usize, (Transfer, f64)>;

impl MemoryRun<'_> {
    fn group(&self, group: &Group, objects: &PreparedEntries) -> Result<Vec<MemoryRow>> {
        let targets: BTreeSet<usize> = group.pairs.iter().map(|pair| pair.target).collect();
        let targets: Vec<usize> = targets.into_iter().collect();
        let rows = self.settings.preparation.workers.each(targets.len(), |i| {
            let target = targets[i];
            let pool: Vec<usize> = group
                .pairs
                .iter()
                .filter(|pair| pair.target == target && is_ready(objects, pair.source))
                .map(|pair| pair.source)
                .collect();
            let rows = self.target(group, target, &pool, objects)?;
            self.step()?;
            Ok(rows)
        })?;
        Ok(rows.into_iter().flatten().collect())
    }

    /// The rows of one target.
    fn target(
        &self,
        group: &Group,
        target: usize,
        pool: &[usize],
        objects: &PreparedEntries,
    ) -> Result<Vec<MemoryRow>> {
        let entry = &self.dataset.objects[target];
        let others: Vec<usize> = objects
            .keys()
            .copied()
            .filter(|&place| self.dataset.objects[place].category != entry.category)
            .filter(|&place| is_ready(objects, place))
            .collect();
        let mut answers = Answers::new();
        let mut rows = Vec::new();
        for &n in &self.settings.counts {
            let (strangers, seed) = (self.settings.n_distractors, self.settings.preparation.seed);
            let drawn = draws(pool, n, &others, strangers, &entry.name, seed);
            for (number, draw) in drawn.into_iter().enumerate() {
                let mut row = MemoryRow {
                    group: group.name.clone(),
                    category: entry.category.clone(),
                    target: entry.name.clone(),
                    half: half_of(&entry.name),
                    n,
                    draw: number,
                    ..MemoryRow::default()
                };
                let scored = match &objects[&target] {
                    Ok(object) => {
                        let asked = self.ask(object, &draw, pool, objects, &mut answers, &mut row);
                        attempt("transfer", asked)?
                    }
                    Err(failure) => Err(failure.clone()),
                };
                row.failure = scored.err();
                rows.push(row);
            }
        }
        Ok(rows)
    }

    /// Asks one memory and fills in the row.
    fn ask(
        &self,
        target: &PreparedEntry,
        draw: &Draw,
        pool: &[usize],
        objects: &PreparedEntries,
        answers: &mut Answers,
        row: &mut MemoryRow,
    ) -> Result<()> {
        let demonstrations: Vec<(&str, &PreparedEntry, usize)> = draw
            .iter()
            .filter_map(|&place| {
                let object = objects.get(&place)?.as_ref().ok()?;
                Some((self.dataset.objects[place].name.as_str(), object, place))
            })
            .collect();
        if demonstrations.is_empty() {
            return Err(Error::invalid("memory", "at least one demonstration", "none"));
        }
        let plain = target.prepared.object.plain_features();
        let described = demonstrations
            .iter()
            .map(|(name, object, _)| (*name, object.prepared.object.plain_features().descriptor()));
        let chosen = shortlist(plain, described, self.settings.memory.shortlist);
        let mut matched = Vec::new();
        for candidate in chosen {
            let (name, object, place) = demonstrations[candidate.place];
            let (transfer, ms) = self.answer(target, object, place, answers)?;
            row.answer_ms += ms;
            row.matched.push(name.to_owned());
            row.n_of_kind += usize::from(pool.contains(&place));
            matched.push((object, transfer, pool.contains(&place)));
        }
        let said: Vec<Answer<'_>> = matched
            .iter()
            .map(|(object, transfer, _)| Answer {
                source: &object.prepared.object,
                region: &object.truth,
                transfer,
            })
            .collect();
        let start = Instant::now();
        let fused = fuse(&target.prepared.object, &said, &self.settings.memory.fusion)?;
        row.answer_ms += start.elapsed().as_secs_f64() * 1e3;
        let scores = matched.iter().map(|(_, transfer, is_of_kind)| {
            let iou = iou(&transfer.region, &target.truth)?;
            let answer = ScoredAnswer {
                iou,
                confidence: transfer.confidence,
                verdict: Some(transfer.verdict),
            };
            Ok((answer, *is_of_kind))
        });
        let scores = scores.collect::<semfm::fmap::Result<Vec<_>>>()?;
        let most = scores
            .iter()
            .map(|(answer, _)| *answer)
            .reduce(|best, next| if next.confidence > best.confidence { next } else { best });
        row.chosen = most.unwrap_or_default();
        row.best_iou = scores.iter().map(|(answer, _)| answer.iou).fold(0.0, f64::max);
        let of_kind: Vec<f64> = scores
            .iter()
            .filter(|(_, is_of_kind)| *is_of_kind)
            .map(|(answer, _)| answer.iou)
            .collect();
        if !of_kind.is_empty() {
            row.mean_iou = of_kind.iter().sum::<f64>() / of_kind.len() as f64;
        }
        row.fused = ScoredAnswer {
            iou: iou(&fused.region, &target.truth)?,
            confidence: fused.confidence,
            verdict: Some(fused.verdict),
        };
        row.evidence = Some(fused.evidence);
        Ok(())
    }

    /// One demonstration's answer and what it took, made once for all memories that hold it.
    fn answer(
        &self,
        target: &PreparedEntry,
        source: &PreparedEntry,
        place: usize,
        answers: &mut Answers,
    ) -> Result<(Transfer, f64)> {
        if let Some(known) = answers.get(&place) {
            return Ok(known.clone());
        }
        let start = Instant::now();
        let (a, b) = (&source.prepared.object, &target.prepared.object);
        let matching =
            Matching::new(a, b, &self.settings.preparation.pipeline().transfer, &self.quiet)?;
        let transfer = matching.transfer(&source.truth)?;
        let made = (transfer, start.elapsed().as_secs_f64() * 1e3);
        answers.insert(place, made.clone());
        Ok(made)
    }

    fn step(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        Ok(self.task.step("evaluation", done, self.total)?)
    }
}

fn is_ready(objects: &PreparedEntries, place: usize) -> bool {
    objects.get(&place).is_some_and(|object| object.is_ok())
}
