//! What changed since an older run, pair by pair, worst first.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use semfm::geom::io::{printable, write_atomically, write_json_pretty};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::bootstrap::{PairDraws, PairKey, weighted_mean};
use crate::results::Results;
use crate::row::ObjectRow;
use crate::summary::NOTICED;
use crate::table::{header, interval, line, number};

/// The files in the output folder.
pub const FILES: [&str; 2] = ["compare.json", "compare.md"];
/// Pairs shown in the text, from either end.
const SHOWN: usize = 20;

/// The difference between two runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// In which way the runs are not of the same thing; empty where they are.
    pub mismatches: Vec<String>,
    /// Each method that both have.
    pub methods: Vec<MethodChange>,
    /// Each row that both have a score for, by falling loss.
    pub pairs: Vec<PairChange>,
    /// Rows that only the older run has a score for.
    pub only_before: Vec<[String; 4]>,
    /// Rows that only the newer run has a score for.
    pub only_now: Vec<[String; 4]>,
}

/// What became of one method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodChange {
    /// Name of the method.
    pub method: String,
    /// Pairs that both runs have a score for.
    pub n: usize,
    /// Mean IoU then.
    pub before: f64,
    /// Mean IoU now.
    pub now: f64,
    /// 95 % interval of the mean change, objects resampled.
    pub interval: Option<[f64; 2]>,
    /// Pairs better by more than .01, and worse.
    pub better_worse: [usize; 2],
}

/// What became of one pair under one method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairChange {
    /// Group of the pair.
    pub group: String,
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
    /// Name of the method.
    pub method: String,
    /// IoU then.
    pub before: f64,
    /// IoU now.
    pub now: f64,
    /// Confidence then and now.
    pub confidence: [Option<f64>; 2],
}

impl PairChange {
    /// IoU now − then.
    pub fn gain(&self) -> f64 {
        self.now - self.before
    }

    fn pair_key(&self) -> PairKey<'_> {
        PairKey { group: &self.group, source: &self.source, target: &self.target }
    }
}

impl Comparison {
    /// Compares `now` with `before`.
    pub fn new(before: &Results, now: &Results) -> Self {
        let (old, new) = (scores(before), scores(now));
        let mut pairs: Vec<PairChange> = old
            .iter()
            .filter_map(|(key, before)| {
                let now = new.get(key)?;
                let [group, source, target, method] = key.clone();
                let confidence = [before.confidence, now.confidence];
                let (before, now) = (before.iou, now.iou);
                Some(PairChange { group, source, target, method, before, now, confidence })
            })
            .collect();
        let methods = now.methods();
        let methods = methods.into_iter().filter_map(|m| method_change(m, &pairs, now)).collect();
        // Stable: equal losses stay in the order of their names.
        pairs.sort_by(|a, b| a.gain().total_cmp(&b.gain()));
        Self {
            mismatches: mismatches(before, now),
            methods,
            pairs,
            only_before: only_in_first(&old, &new),
            only_now: only_in_first(&new, &old),
        }
    }

    /// Writes `compare.json` and `compare.md` into `folder`.
    ///
    /// # Errors
    /// [`crate::Error::Facade`] where they cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let [json, text] = FILES.map(|name| folder.join(name));
        write_json_pretty(&json, self)?;
        write_atomically(&text, |out| out.write_all(printable(&self.render()).as_bytes()))?;
        Ok(vec![json, text])
    }

    /// The comparison as Markdown.
    pub fn render(&self) -> String {
        let mut text = String::from("# Compared with the older run\n\n");
        for mismatch in &self.mismatches {
            let _ = writeln!(text, "**Not the same:** {mismatch}\n");
        }
        let names = ["method", "pairs", "before", "now", "change", "95 %", "better", "worse"];
        text += &header(names.map(str::to_owned));
        for change in &self.methods {
            text += &line([
                change.method.clone(),
                change.n.to_string(),
                number(Some(change.before), 3),
                number(Some(change.now), 3),
                format!("{:+.3}", change.now - change.before),
                interval(change.interval, true),
                change.better_worse[0].to_string(),
                change.better_worse[1].to_string(),
            ]);
        }
        let worse: Vec<&PairChange> =
            self.pairs.iter().take_while(|pair| pair.gain() < -NOTICED).collect();
        let better: Vec<&PairChange> =
            self.pairs.iter().rev().take_while(|pair| pair.gain() > NOTICED).collect();
        for (title, pairs) in [("Worse, worst first", worse), ("Better, best first", better)] {
            let _ = write!(text, "\n## {title} ({})\n\n", pairs.len());
            if pairs.is_empty() {
                text += "None.\n";
                continue;
            }
            let names = ["group", "source", "target", "method", "before", "now", "change"];
            text += &header(names.map(str::to_owned));
            for pair in pairs.iter().take(SHOWN) {
                let PairChange { group, source, target, method, before, now, .. } = pair;
                let named = [group, source, target, method].map(Clone::clone);
                let numbers = [number(Some(*before), 2), number(Some(*now), 2)];
                text +=
                    &line(named.into_iter().chain(numbers).chain([format!("{:+.2}", pair.gain())]));
            }
        }
        let (before, now) = (self.only_before.len(), self.only_now.len());
        if before + now > 0 {
            let _ = writeln!(text, "\nScored only then: {before} rows; only now: {now} rows.");
        }
        text
    }
}

/// Group, source, target and method.
type RowKey = [String; 4];

/// What a method scored on a pair.
struct Score {
    iou: f64,
    confidence: Option<f64>,
}

fn scores(results: &Results) -> BTreeMap<RowKey, Score> {
    let mut scores = BTreeMap::new();
    for row in &results.rows {
        if let Some(iou) = row.iou {
            let score = Score { iou, confidence: row.confidence };
            scores.insert(row.key().map(str::to_owned), score);
        }
    }
    scores
}

fn only_in_first(a: &BTreeMap<RowKey, Score>, b: &BTreeMap<RowKey, Score>) -> Vec<RowKey> {
    a.keys().filter(|key| !b.contains_key(*key)).cloned().collect()
}

fn method_change(method: &str, pairs: &[PairChange], now: &Results) -> Option<MethodChange> {
    let own: Vec<&PairChange> = pairs.iter().filter(|pair| pair.method == method).collect();
    let n = own.len() as f64;
    let keys: Vec<PairKey<'_>> = own.iter().map(|pair| pair.pair_key()).collect();
    let gains: Vec<Option<f64>> = own.iter().map(|pair| Some(pair.gain())).collect();
    let draws = PairDraws::new(&keys, &now.bootstrap);
    let n_better = own.iter().filter(|pair| pair.gain() > NOTICED).count();
    let n_worse = own.iter().filter(|pair| pair.gain() < -NOTICED).count();
    (!own.is_empty()).then(|| MethodChange {
        method: method.into(),
        n: own.len(),
        before: own.iter().map(|pair| pair.before).sum::<f64>() / n,
        now: own.iter().map(|pair| pair.now).sum::<f64>() / n,
        interval: draws.interval(|weights| weighted_mean(&gains, weights)),
        better_worse: [n_better, n_worse],
    })
}

/// What differs in what was measured; the methods' own settings and the program are meant to.
fn mismatches(before: &Results, now: &Results) -> Vec<String> {
    let (a, b) = (&before.about, &now.about);
    let mut found = Vec::new();
    if a.identity.dataset != b.identity.dataset {
        found.push(format!(
            "the dataset (then {}, {}; now {}, {})",
            a.origin, a.identity.dataset, b.origin, b.identity.dataset
        ));
        let (old, new) = (meshes(before), meshes(now));
        let names: BTreeSet<&String> = old.keys().chain(new.keys()).collect();
        let changed: Vec<&str> =
            names.into_iter().filter(|n| old.get(*n) != new.get(*n)).map(|n| &**n).collect();
        if !changed.is_empty() {
            found.push(format!("the objects {}", changed.join(", ")));
        }
    }
    if a.identity.embeddings != b.identity.embeddings {
        let (then, now) = (&a.identity.embeddings, &b.identity.embeddings);
        found.push(format!("the source of features (then {then}, now {now})"));
    }
    if a.seed != b.seed {
        found.push(format!("the seed (then {}, now {})", a.seed, b.seed));
    }
    found
}

/// What identifies each object, by category and name.
fn meshes(results: &Results) -> BTreeMap<String, String> {
    let mut meshes = BTreeMap::new();
    for object in &results.objects {
        let ObjectRow { category, name, mesh, n_region, .. } = object;
        meshes.insert(format!("{category}/{name}"), format!("{mesh} {n_region}"));
    }
    meshes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::some_results;

    #[test]
    fn the_worst_loss_comes_first_and_gone_rows_are_told() {
        let before = some_results();
        let mut now = before.clone();
        now.rows[0].iou = Some(0.75);
        now.rows[4].iou = Some(0.1);
        now.rows[1].iou = Some(0.3);
        now.rows[1].failure = None;
        let comparison = Comparison::new(&before, &now);
        assert!(comparison.mismatches.is_empty());
        assert_eq!((&*comparison.pairs[0].source, comparison.pairs[0].before), ("b", 0.4));
        let fused = &comparison.methods[0];
        assert_eq!((&*fused.method, fused.n, fused.better_worse), ("fused", 2, [1, 1]));
        assert!((fused.now - fused.before - 0.5 * (0.05 - 0.3)).abs() < 1e-12);
        assert_eq!(comparison.only_now.len(), 1);
        let text = comparison.render();
        assert!(text.contains("Worse, worst first (1)") && text.contains("-0.30"), "{text}");
    }

    #[test]
    fn another_dataset_is_named() {
        let before = some_results();
        let mut now = before.clone();
        now.about.identity.dataset = "blake3:2".into();
        now.about.seed = 7;
        now.objects.push(ObjectRow { name: "c".into(), ..Default::default() });
        let text = Comparison::new(&before, &now).render();
        for word in ["blake3:1", "blake3:2", "/c", "now 7"] {
            assert!(text.contains(word), "{word}: {text}");
        }
    }
}
