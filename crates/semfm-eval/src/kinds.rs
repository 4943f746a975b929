//! Are objects of different kinds told apart from those of one, and refused?

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use semfm::fmap::metrics::iou;
use semfm::geom::LikenessScale;
use semfm::geom::io::{write_atomically, write_json_pretty};
use semfm::{Matching, Task, Verdict};
use serde::{Deserialize, Serialize};

use crate::dataset::Dataset;
use crate::embeddings::EmbeddingSource;
use crate::prepared_objects::{
    PreparationSettings, PreparedEntries, half_of, members, prepared_entries,
};
use crate::table::{header, line, number, percent};
use crate::{Error, Result};

/// The format that is written.
pub const KINDS_FORMAT: &str = "semfm.eval-kinds/1";

/// What came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KindResults {
    /// Name and version of this format.
    pub format: String,
    /// Hash of the dataset.
    pub dataset: String,
    /// Names the features.
    pub embeddings: String,
    /// The pairs of the dataset, and some of objects of different categories.
    pub rows: Vec<KindRow>,
    /// What the rows of both come to, over all and over either half of the targets.
    pub summaries: Vec<KindSummary>,
    /// The scale of likeness by these pairs: what `ConfidenceWeights` takes for an encoder where they are a
    /// background of procedural objects.
    pub scale: Option<LikenessScale>,
}

/// One pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KindRow {
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
    /// Whether the dataset has them as a pair; else their categories differ.
    pub is_pair: bool,
    /// Half of the objects that the target is in.
    pub half: u8,
    /// How alike they are.
    pub likeness: f64,
    /// The probability that they are of one kind, where the encoder's scale is known.
    pub one_kind: Option<f64>,
    /// The probability that the answer is right, if they are.
    pub if_one_kind: f64,
    /// What the answer says of itself.
    pub confidence: f64,
    /// What it advises.
    pub verdict: Verdict,
    /// IoU with the truth, for a pair.
    pub iou: Option<f64>,
}

/// Some of the rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KindSummary {
    /// `all`, `half 0` or `half 1`.
    pub targets: String,
    /// Pairs of the dataset.
    pub n_pairs: usize,
    /// Pairs of different categories.
    pub n_nonsense: usize,
    /// Chance that a pair of the dataset is more alike than one of different categories.
    pub auc: f64,
    /// Mean likeness of the pairs.
    pub pairs_likeness: f64,
    /// Mean likeness of the nonsense.
    pub nonsense_likeness: f64,
    /// Share of the pairs accepted, without and with the evidence of kind.
    pub pairs_accepted: [f64; 2],
    /// Share of the nonsense accepted, without and with it.
    pub nonsense_accepted: [f64; 2],
    /// Share of the nonsense refused as not alike.
    pub nonsense_not_alike: f64,
}

/// Matches every pair of the dataset, and `n_nonsense` pairs of objects of different categories, drawn by chance.
///
/// # Errors
/// [`Error::Invalid`] where there are no two categories or no nonsense is asked for; what is wrong with an object;
/// cancellation.
pub fn run_kinds(
    dataset: &Dataset,
    embeddings: &EmbeddingSource,
    n_nonsense: usize,
    settings: &PreparationSettings,
    task: &Task,
) -> Result<KindResults> {
    let nonsense = nonsense_pairs(dataset, n_nonsense, settings.seed)?;
    let pairs = dataset.groups.iter().flat_map(|group| &group.pairs);
    let pairs =
        pairs.map(|pair| KindPair { source: pair.source, target: pair.target, is_pair: true });
    let mut all: Vec<KindPair> = pairs.collect();
    all.extend(nonsense);
    let (done, total) = (AtomicUsize::new(0), members(dataset).len() + all.len());
    let step = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        Ok(task.step("evaluation", done, total)?)
    };
    let objects = prepared_entries(dataset, embeddings, settings, task, step)?;
    let rows = settings.workers.each(all.len(), |i| {
        let row = row(dataset, &objects, all[i], settings, &task.silent())?;
        step()?;
        Ok(row)
    })?;
    let likenesses = |is_pair: bool| -> Vec<f64> {
        rows.iter().filter(|row| row.is_pair == is_pair).map(|row| row.likeness).collect()
    };
    let summaries = [None, Some(0), Some(1)].into_iter();
    Ok(KindResults {
        format: KINDS_FORMAT.into(),
        dataset: dataset.hash.clone(),
        embeddings: embeddings.identity(dataset),
        scale: LikenessScale::of(&likenesses(false), &likenesses(true)),
        summaries: summaries.filter_map(|half| KindSummary::of(half, &rows)).collect(),
        rows,
    })
}

/// Two objects, by their places in the dataset.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct KindPair {
    source: usize,
    target: usize,
    is_pair: bool,
}

/// Pairs of objects of different categories, each at most once.
fn nonsense_pairs(dataset: &Dataset, count: usize, seed: u64) -> Result<Vec<KindPair>> {
    let places = members(dataset);
    let category = |place: usize| &dataset.objects[place].category;
    let mut pairs = BTreeSet::new();
    for &source in &places {
        let others = places.iter().filter(|&&target| category(target) != category(source));
        pairs.extend(others.map(|&target| KindPair { source, target, is_pair: false }));
    }
    if pairs.is_empty() || count == 0 {
        let found = format!("{count} asked for, of {} possible", pairs.len());
        return Err(Error::invalid("nonsense", "at least one pair, and two categories", found));
    }
    let mut pairs: Vec<KindPair> = pairs.into_iter().collect();
    pairs.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    pairs.truncate(count);
    Ok(pairs)
}

fn row(
    dataset: &Dataset,
    objects: &PreparedEntries,
    pair: KindPair,
    settings: &PreparationSettings,
    task: &Task,
) -> Result<KindRow> {
    let [source, target] = [pair.source, pair.target].map(|place| match &objects[&place] {
        Ok(object) => Ok(object),
        Err(failure) => Err(Error::invalid(
            &dataset.objects[place].name,
            "an object to be matched",
            &failure.text,
        )),
    });
    let (source, target) = (source?, target?);
    let (a, b) = (&source.prepared.object, &target.prepared.object);
    let matching = Matching::new(a, b, &settings.pipeline().transfer, task)?;
    let found = matching.transfer(&source.truth)?;
    let one_kind = found.report.one_kind;
    let name = |place: usize| dataset.objects[place].name.clone();
    Ok(KindRow {
        source: name(pair.source),
        target: name(pair.target),
        is_pair: pair.is_pair,
        half: half_of(&dataset.objects[pair.target].name),
        likeness: found.report.evidence.likeness.unwrap_or_default(),
        one_kind,
        if_one_kind: found.report.evidence.probability(b.confidence_weights()),
        confidence: found.confidence,
        verdict: found.verdict,
        iou: if pair.is_pair { Some(iou(&found.region, &target.truth)?) } else { None },
    })
}

impl KindSummary {
    fn of(half: Option<u8>, rows: &[KindRow]) -> Option<Self> {
        let of_half = rows.iter().filter(|row| half.is_none_or(|half| row.half == half));
        let (pairs, nonsense): (Vec<&KindRow>, Vec<&KindRow>) =
            of_half.partition(|row| row.is_pair);
        if pairs.is_empty() || nonsense.is_empty() {
            return None;
        }
        let share = |rows: &[&KindRow], holds: fn(&KindRow) -> bool| {
            rows.iter().filter(|row| holds(row)).count() as f64 / rows.len() as f64
        };
        let mean = |rows: &[&KindRow]| {
            rows.iter().map(|row| row.likeness).sum::<f64>() / rows.len() as f64
        };
        let accepted = |rows: &[&KindRow]| {
            let without: fn(&KindRow) -> bool =
                |row| semfm::fmap::confidence::verdict(row.if_one_kind) == Verdict::Accept;
            [share(rows, without), share(rows, |row| row.verdict == Verdict::Accept)]
        };
        let above: f64 = pairs
            .iter()
            .flat_map(|pair| nonsense.iter().map(|other| pair.likeness.total_cmp(&other.likeness)))
            .map(|order| match order {
                std::cmp::Ordering::Greater => 1.0,
                std::cmp::Ordering::Equal => 0.5,
                std::cmp::Ordering::Less => 0.0,
            })
            .sum();
        Some(Self {
            targets: half.map_or("all".into(), |half| format!("half {half}")),
            n_pairs: pairs.len(),
            n_nonsense: nonsense.len(),
            auc: above / (pairs.len() * nonsense.len()) as f64,
            pairs_likeness: mean(&pairs),
            nonsense_likeness: mean(&nonsense),
            pairs_accepted: accepted(&pairs),
            nonsense_accepted: accepted(&nonsense),
            nonsense_not_alike: share(&nonsense, |row| row.one_kind.is_some_and(|p| p < 0.5)),
        })
    }
}

impl KindResults {
    /// Writes `kinds.json` and `kinds.md` into `folder`, each whole or not at all.
    ///
    /// # Errors
    /// [`Error::Facade`] where they cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let (json, table) = (folder.join("kinds.json"), folder.join("kinds.md"));
        write_json_pretty(&json, self)?;
        write_atomically(&table, |out| out.write_all(self.to_markdown().as_bytes()))?;
        Ok(vec![json, table])
    }

    /// The results as Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "# Pairs of one kind and nonsense\n\nDataset {}. Features: {}. Accepted: without the evidence of kind → \
             with it.\n\n",
            self.dataset, self.embeddings
        );
        let names = [
            "targets",
            "pairs",
            "nonsense",
            "AUC of likeness",
            "likeness: pairs",
            "nonsense",
            "pairs accepted",
            "nonsense accepted",
            "nonsense not alike",
        ];
        text += &header(names.map(str::to_owned));
        for summary in &self.summaries {
            let change = |[without, with]: [f64; 2]| {
                format!("{} → {}", percent(Some(without)), percent(Some(with)))
            };
            text += &line([
                summary.targets.clone(),
                summary.n_pairs.to_string(),
                summary.n_nonsense.to_string(),
                number(Some(summary.auc), 3),
                number(Some(summary.pairs_likeness), 3),
                number(Some(summary.nonsense_likeness), 3),
                change(summary.pairs_accepted),
                change(summary.nonsense_accepted),
                percent(Some(summary.nonsense_not_alike)),
            ]);
        }
        if let Some(LikenessScale { unlike, alike }) = self.scale {
            text += &format!("\nLikenessScale {{ unlike: {unlike:.3}, alike: {alike:.3} }}\n");
        }
        text
    }
}
