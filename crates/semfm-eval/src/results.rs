//! `results.json`: everything that came out, for programs.

use std::path::{Path, PathBuf};

use semfm::geom::io::{read_json, write_json_pretty};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::bootstrap::BootstrapSettings;
use crate::calibration::Calibration;
use crate::dataset::DatasetOrigin;
use crate::journal::RunIdentity;
use crate::row::{ObjectRow, Row};
use crate::summary::{Difference, Scope, ScoreTable, Summary};
use crate::{Error, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.eval/1";
/// The file in the output folder.
pub const FILE: &str = "results.json";

/// The results of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Name and version of this format.
    pub format: String,
    /// What was run, on what.
    pub about: About,
    /// How intervals were made.
    pub bootstrap: BootstrapSettings,
    /// The objects, by category and name.
    pub objects: Vec<ObjectRow>,
    /// One row per pair and method.
    pub rows: Vec<Row>,
    /// Every scope and method.
    pub summaries: Vec<Summary>,
    /// Methods against methods.
    pub differences: Vec<Difference>,
    /// What each method's confidence is worth.
    pub calibration: Vec<Calibration>,
}

/// What was run, on what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct About {
    /// Everything that the rows depend on.
    pub identity: RunIdentity,
    /// Where the dataset came from.
    pub origin: DatasetOrigin,
    /// Seed of everything drawn by chance.
    pub seed: u64,
}

impl Results {
    /// Sums rows up.
    pub fn new(
        about: About,
        objects: Vec<ObjectRow>,
        rows: Vec<Row>,
        bootstrap: &BootstrapSettings,
    ) -> Self {
        let table = ScoreTable::new(&rows);
        let (summaries, differences) = (table.summaries(bootstrap), table.differences(bootstrap));
        let mut calibration = Vec::new();
        for method in &table.methods {
            let own = rows.iter().filter(|row| row.method == *method);
            calibration.extend(Calibration::of(method, own));
        }
        let (format, bootstrap) = (FORMAT.into(), *bootstrap);
        Self { format, about, bootstrap, objects, summaries, differences, calibration, rows }
    }

    /// The same with the rows of another source beside ours.
    pub fn with_rows(self, more: Vec<Row>) -> Self {
        let rows = self.rows.into_iter().chain(more).collect();
        Self::new(self.about, self.objects, rows, &self.bootstrap)
    }

    /// The summary of a method on a scope.
    pub fn summary(&self, scope: &Scope, method: &str) -> Option<&Summary> {
        self.summaries.iter().find(|s| s.scope == *scope && s.method == method)
    }

    /// Methods in the order of the rows.
    pub fn methods(&self) -> Vec<&str> {
        ScoreTable::new(&self.rows).methods
    }

    /// Reads `results.json`, or the one in a folder.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`].
    pub fn read(path: &Path) -> Result<Self> {
        read_results(path, FORMAT, |results: &Self| &results.format)
    }

    /// Writes `results.json` into `folder`, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<PathBuf> {
        let path = folder.join(FILE);
        write_json_pretty(&path, self)?;
        Ok(path)
    }

    /// The same without any time: what must not depend on machine, threads or interrupts.
    pub fn without_times(&self) -> Self {
        let mut same = self.clone();
        same.rows = self.rows.iter().map(Row::without_times).collect();
        for summary in &mut same.summaries {
            summary.median_matching_ms = None;
            summary.median_cold_ms = None;
            summary.median_paper_runtime = None;
        }
        same
    }
}

/// Reads `results.json` of this format, or the one in a folder.
pub(crate) fn read_results<T: DeserializeOwned>(
    path: &Path,
    format: &str,
    format_of: fn(&T) -> &str,
) -> Result<T> {
    let path = if path.is_dir() { path.join(FILE) } else { path.to_owned() };
    let results: T = read_json(&path)?;
    let found = format_of(&results);
    if found == format { Ok(results) } else { Err(Error::format(&path, "format", format, found)) }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::journal::RunSettings;
    use crate::row::Failure;
    use std::collections::BTreeMap;

    fn row(source: &str, target: &str, method: &str, iou: Option<f64>) -> Row {
        Row {
            group: "cups".into(),
            category: "cups".into(),
            source: source.into(),
            target: target.into(),
            method: method.into(),
            iou,
            confidence: iou.filter(|_| method == "fused"),
            failure: iou.is_none().then(|| Failure::new("features", "no file")),
            stages_ms: BTreeMap::from([("fit".to_owned(), 3.5)]),
            matching_ms: Some(3.5),
            ..Row::default()
        }
    }

    /// Two pairs of cups, three methods, one failure.
    pub(crate) fn some_results() -> Results {
        let rows = vec![
            row("a", "b", "fused", Some(0.7)),
            row("a", "b", "nearest", None),
            row("a", "b", "oracle", Some(0.9)),
            row("a", "b", "whole", Some(0.1)),
            row("b", "a", "fused", Some(0.4)),
            row("b", "a", "nearest", Some(0.5)),
            row("b", "a", "oracle", Some(0.8)),
            row("b", "a", "whole", Some(0.2)),
        ];
        let identity = RunIdentity {
            format: crate::journal::FORMAT.into(),
            program: "p".into(),
            dataset: "blake3:1".into(),
            embeddings: "files".into(),
            methods: ["fused", "nearest", "oracle", "whole"].map(String::from).to_vec(),
            settings: RunSettings::default(),
        };
        let origin = DatasetOrigin::Folder { path: "cups".into() };
        let about = About { identity, origin, seed: 0 };
        Results::new(
            about,
            Vec::new(),
            rows,
            &BootstrapSettings { draws: 50, ..Default::default() },
        )
    }

    #[test]
    fn results_are_read_back_and_times_can_be_left_out() {
        let results = some_results();
        let folder = tempfile::tempdir().unwrap();
        results.write(folder.path()).unwrap();
        assert_eq!(Results::read(folder.path()).unwrap(), results);
        let bare = results.without_times();
        assert_ne!(bare, results);
        assert!(!serde_json::to_string(&bare).unwrap().contains("3.5"));
        let path = folder.path().join(FILE);
        std::fs::write(&path, r#"{"format": "semfm.eval/1"}"#).unwrap();
        let error = Results::read(&path).unwrap_err().to_string();
        assert!(error.contains("results.json") && error.contains("about"), "{error}");
    }
}
