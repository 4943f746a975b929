//! Rows of a vision-language model, scored like a method (`semfm.vlm/1`, see `docs/vlm.md`).

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use semfm::Region;
use semfm::geom::io::read_json;
use serde::Deserialize;
use serde_json::Value;

use crate::dataset::Dataset;
use crate::prediction::{Prediction, write_one};
use crate::row::{Failure, Row, VlmDetails};
use crate::{Error, Result};

/// The format that is read.
pub const FORMAT: &str = "semfm.vlm/1";
/// The way of asking that needs no mention in a name.
const USUAL_MODE: &str = "polygons";

#[derive(Deserialize)]
struct RowsFile {
    format: String,
    rows: Vec<VlmRow>,
}

#[derive(Deserialize)]
struct VlmRow {
    group: String,
    source: String,
    target: String,
    n_views: usize,
    mode: String,
    model: String,
    real_model: bool,
    mesh: Option<NamedMesh>,
    region: Option<Found>,
    inconsistency: Option<f64>,
    failure: Option<VlmFailure>,
    #[serde(default)]
    stages_ms: BTreeMap<String, Option<f64>>,
    #[serde(default)]
    tokens: Value,
}

#[derive(Deserialize)]
struct NamedMesh {
    hash: String,
}

#[derive(Deserialize)]
struct Found {
    vertices: Vec<u32>,
    weights: Option<Vec<f64>>,
}

#[derive(Deserialize)]
struct VlmFailure {
    kind: String,
    text: String,
    /// Nobody answered: the pair was not tried.
    #[serde(default)]
    of_endpoint: bool,
}

/// Reads a file of rows and scores those of the dataset's pairs.
///
/// A refusal or an answer that cannot be read counts as IoU 0; a silent endpoint as not tried. The
/// method is named by its number of views (`vlm-6`), and marked where no real model answered.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] for another format, a pair that the dataset does not have,
/// two rows for one question, or a region of another mesh.
pub fn read(path: &Path, dataset: &Dataset) -> Result<Vec<Row>> {
    let file = read_file(path)?;
    let mut pairs = BTreeMap::new();
    for group in &dataset.groups {
        for pair in &group.pairs {
            let [source, target] = pair.both().map(|place| dataset.objects[place].name.as_str());
            pairs.insert([group.name.as_str(), source, target], pair.target);
        }
    }
    // The rows of one target stand together, so that it is loaded once.
    let mut of_target = BTreeMap::<usize, Vec<(usize, VlmRow)>>::new();
    let mut seen = BTreeSet::new();
    for (number, row) in file.rows.into_iter().enumerate() {
        let place = format!("rows[{number}]");
        let Some(&target) = pairs.get(&[&*row.group, &*row.source, &*row.target]) else {
            let found = format!("{}: {} → {}", row.group, row.source, row.target);
            return Err(Error::format(path, place, "a pair of the dataset", found));
        };
        let key = (method(&row), row.group.clone(), row.source.clone(), row.target.clone());
        if !seen.insert(key) {
            return Err(Error::format(path, place, "one row for each question", "a second"));
        }
        of_target.entry(target).or_default().push((number, row));
    }
    let mut scored = Vec::new();
    for (target, rows) in of_target {
        let entry = &dataset.objects[target];
        let object = entry.load()?;
        let (hash, areas) = (object.mesh().hash().to_string(), object.mesh().vertex_areas());
        for (number, row) in rows {
            let place = format!("rows[{number}]");
            if let Some(named) = row.mesh.as_ref().filter(|named| named.hash != hash) {
                let place = format!("{place}.mesh.hash");
                return Err(Error::format(path, place, format!("{hash}, the target"), &named.hash));
            }
            let found = row.region.as_ref().map(|found| region(found, areas.len()));
            let found = found.transpose().map_err(|reason| {
                Error::format(path, format!("{place}.region"), "a region of the target", reason)
            })?;
            let scored_row = score(row, &entry.category, found, &object.truth, &areas)?;
            scored.push((number, scored_row));
        }
    }
    scored.sort_by_key(|(number, _)| *number);
    Ok(scored.into_iter().map(|(_, row)| row).collect())
}

fn read_file(path: &Path) -> Result<RowsFile> {
    let file: RowsFile = read_json(path)?;
    if file.format == FORMAT {
        Ok(file)
    } else {
        Err(Error::format(path, "format", FORMAT, file.format))
    }
}

/// Keeps the regions of the file's rows beside the predictions of the other methods in `folder`, and
/// names their files in `rows`, which [`read`] made of the same file.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] where the file has changed since; [`Error::Facade`] for
/// predictions that cannot be written.
pub fn keep(path: &Path, rows: &mut [Row], folder: &Path) -> Result<()> {
    let file = read_file(path)?;
    if file.rows.len() != rows.len() {
        let found = format!("{} rows", file.rows.len());
        return Err(Error::format(path, "rows", format!("{} as before", rows.len()), found));
    }
    for (row, answered) in rows.iter_mut().zip(&file.rows) {
        if let Some(found) = &answered.region {
            let weights = found.weights.clone().unwrap_or_else(|| vec![1.0; found.vertices.len()]);
            let vertices = found.vertices.clone();
            let answer = Prediction { vertices, weights, ..Prediction::default() };
            row.prediction = Some(write_one(folder, row, answer)?);
        }
    }
    Ok(())
}

fn method(row: &VlmRow) -> String {
    let mode = if row.mode == USUAL_MODE { String::new() } else { format!("-{}", row.mode) };
    let stand_in = if row.real_model { "" } else { " (stand-in)" };
    format!("vlm-{}{mode}{stand_in}", row.n_views)
}

fn region(found: &Found, n_vertices: usize) -> std::result::Result<Region, String> {
    let weights = match &found.weights {
        None => vec![1.0; found.vertices.len()],
        Some(weights) if weights.len() == found.vertices.len() => weights.clone(),
        Some(weights) => {
            return Err(format!("{} weights of {} vertices", weights.len(), found.vertices.len()));
        }
    };
    let mut all = vec![0.0; n_vertices];
    for (&vertex, weight) in found.vertices.iter().zip(weights) {
        *all.get_mut(vertex as usize)
            .ok_or_else(|| format!("vertex {vertex} of {n_vertices}"))? = weight;
    }
    Region::from_weights(all).map_err(|error| error.to_string())
}

fn score(
    row: VlmRow,
    category: &str,
    found: Option<Region>,
    truth: &Region,
    areas: &[f64],
) -> Result<Row> {
    let method = method(&row);
    let stages_ms: BTreeMap<String, f64> =
        row.stages_ms.into_iter().filter_map(|(stage, ms)| Some((stage, ms?))).collect();
    let total: f64 = stages_ms.values().sum();
    let mut scored = Row {
        group: row.group,
        category: category.into(),
        source: row.source,
        target: row.target,
        method,
        failure: row
            .failure
            .as_ref()
            .map(|f| Failure { kind: f.kind.clone(), text: f.text.clone() }),
        vlm: Some(VlmDetails {
            n_views: row.n_views,
            mode: row.mode,
            model: row.model,
            real_model: row.real_model,
            inconsistency: row.inconsistency,
            tokens: row.tokens,
        }),
        paper_runtime: (!stages_ms.is_empty()).then_some(total / 1e3),
        stages_ms,
        ..Row::default()
    };
    let nobody_answered = row.failure.as_ref().is_some_and(|failure| failure.of_endpoint);
    if !nobody_answered {
        let found = found.unwrap_or_else(|| Region::from_mask(&vec![false; areas.len()]));
        scored.score(&found, truth, areas)?;
    }
    Ok(scored)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::synthetic::{SyntheticSettings, make};

    fn read_text(text: &str) -> Result<Vec<Row>> {
        let settings = SyntheticSettings { seeds: vec![0], n_objects: 2, ..Default::default() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.json");
        std::fs::write(&path, text).unwrap();
        read(&path, &make(&settings).unwrap())
    }

    fn rows(rows: &[String]) -> String {
        format!(r#"{{"format": "semfm.vlm/1", "rows": [{}]}}"#, rows.join(","))
    }

    fn row(n_views: usize, rest: &str) -> String {
        format!(
            r#"{{"group": "tools", "source": "tools_0_s0", "target": "tools_1_s0", "n_views": {n_views},
                "mode": "polygons", "model": "m", "real_model": true, {rest}}}"#
        )
    }

    #[test]
    fn an_answer_is_scored_a_refusal_is_nothing_and_silence_is_not_tried() {
        let settings = SyntheticSettings { seeds: vec![0], n_objects: 2, ..Default::default() };
        let object = make(&settings).unwrap().objects[1].load().unwrap();
        let truth = format!("{:?}", object.truth.vertices());
        let text = rows(&[
            row(1, r#""failure": {"kind": "refusal", "text": "No."}"#),
            row(3, r#""failure": {"kind": "timeout", "text": "…", "of_endpoint": true}"#),
            row(
                6,
                &format!(
                    r#""region": {{"vertices": {truth}}}, "stages_ms": {{"model": 2500, "lift": null}}"#
                ),
            ),
        ]);
        let rows = read_text(&text).unwrap();
        let got: Vec<_> = rows.iter().map(|r| (&*r.method, r.iou, r.failure.is_some())).collect();
        assert_eq!(
            got,
            [("vlm-1", Some(0.0), true), ("vlm-3", None, true), ("vlm-6", Some(1.0), false)]
        );
        assert_eq!(
            (rows[2].paper_runtime, rows[2].n_found),
            (Some(2.5), object.truth.vertices().len())
        );
    }

    #[test]
    fn rows_of_something_else_are_refused_by_place() {
        let stranger = row(1, r#""region": null"#).replace("tools_1_s0", "nobody");
        let other_mesh = row(1, r#""mesh": {"hash": "blake3:0"}, "region": {"vertices": [1]}"#);
        for (text, word) in [
            (rows(&[stranger]), "nobody"),
            (rows(&[other_mesh]), "rows[0].mesh.hash"),
            (rows(&[row(1, r#""region": {"vertices": [9999999]}"#)]), "rows[0].region"),
            (rows(&[row(1, r#""region": null"#), row(1, r#""region": null"#)]), "rows[1]"),
            (r#"{"format": "semfm.vlm/9", "rows": []}"#.into(), "semfm.vlm/9"),
        ] {
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains(word), "{word}: {error}");
        }
    }
}
