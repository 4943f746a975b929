//! What each method answered on each pair, one JSON file a pair: for pictures and for other scores.

use std::collections::BTreeMap;
use std::path::Path;

use semfm::geom::io::{read_json, write_atomically};
use semfm::{Region, Transfer, Verdict};
use serde::{Deserialize, Serialize};

use crate::row::{AnchorRow, Row};
use crate::{Error, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.prediction/1";
/// The folder beside the results.
const FOLDER: &str = "predictions";
/// Weights are written to four decimals: they colour pictures, and the vertices are listed anyway.
const STEPS: f64 = 1e4;

/// The content of a file: the answers on one pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PairPredictions {
    /// Name and version of this format.
    pub format: String,
    /// Group of the pair.
    pub group: String,
    /// The answers by method.
    pub methods: BTreeMap<String, Prediction>,
    /// Name of the source.
    pub source: String,
    /// Name of the target.
    pub target: String,
}

/// What one method answered. Only the region is always there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Prediction {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anchors: Option<Vec<AnchorRow>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hypotheses: Option<Vec<PredictedHypothesis>>,
    /// Source vertex for each target vertex.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_map: Option<Vec<u32>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// Vertices of the region.
    pub vertices: Vec<u32>,
    /// The weight of each of them.
    pub weights: Vec<f64>,
}

/// Another place where the region may be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PredictedHypothesis {
    pub probability: f64,
    pub vertices: Vec<u32>,
    pub weights: Vec<f64>,
}

impl Prediction {
    /// Nothing but a region.
    pub fn of_region(region: &Region) -> Self {
        let (vertices, weights) = (region.vertices(), rounded_weights(region));
        Self { vertices, weights, ..Self::default() }
    }

    /// All that a transfer says.
    pub fn of_transfer(transfer: &Transfer) -> Self {
        let hypotheses = transfer.hypotheses.iter().map(|hypothesis| PredictedHypothesis {
            probability: hypothesis.probability,
            vertices: hypothesis.region.vertices(),
            weights: rounded_weights(&hypothesis.region),
        });
        Self {
            anchors: Some(transfer.report.anchors.iter().map(AnchorRow::from).collect()),
            confidence: Some(transfer.confidence),
            hypotheses: Some(hypotheses.collect()),
            point_map: Some(transfer.point_map.source_of.clone()),
            verdict: Some(transfer.verdict),
            ..Self::of_region(&transfer.region)
        }
    }

    /// As a region of a mesh with so many vertices; none where it does not fit.
    pub fn region(&self, n_vertices: usize) -> Option<Region> {
        let mut weights = vec![0.0; n_vertices];
        for (&vertex, &weight) in self.vertices.iter().zip(&self.weights) {
            *weights.get_mut(vertex as usize)? = weight;
        }
        Region::from_weights(weights).ok()
    }
}

/// The weights of the region's vertices.
fn rounded_weights(region: &Region) -> Vec<f64> {
    let vertices = region.vertices().into_iter();
    vertices.map(|v| (region.weights()[v as usize] * STEPS).round() / STEPS).collect()
}

impl PairPredictions {
    /// No answers yet.
    pub fn new(group: &str, source: &str, target: &str) -> Self {
        let (group, source, target) = (group.into(), source.into(), target.into());
        Self { format: FORMAT.into(), group, methods: BTreeMap::new(), source, target }
    }

    /// The file that the answers of all methods stand in, relative to the results.
    pub fn file(&self) -> String {
        let [group, source, target] = [&self.group, &self.source, &self.target].map(|x| plain(x));
        format!("{FOLDER}/{group}/{source}--{target}.json")
    }

    /// Writes them into `folder` under this name, if any method answered.
    pub fn write(&self, folder: &Path, file: &str) -> Result<()> {
        if self.methods.is_empty() {
            return Ok(());
        }
        let path = folder.join(file);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        }
        write_atomically(&path, |out| Ok(serde_json::to_writer(out, self)?))?;
        Ok(())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Facade`] where it cannot be read or is not of this format.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(read_json(path)?)
    }
}

/// Writes the answer of one row that no run of ours made; gives the file, relative to the results.
pub(crate) fn write_one(folder: &Path, row: &Row, answer: Prediction) -> Result<String> {
    let mut predictions = PairPredictions::new(&row.group, &row.source, &row.target);
    predictions.methods.insert(row.method.clone(), answer);
    let stem = [&row.source, &row.target, &row.method].map(|name| plain(name)).join("--");
    let file = format!("{FOLDER}/{}/{stem}.json", plain(&row.group));
    predictions.write(folder, &file)?;
    Ok(file)
}

/// A name that is a file name everywhere. Names that differ only in odd characters stay apart by a
/// few digits of their hash.
pub(crate) fn plain(name: &str) -> String {
    let plain: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    if plain == name {
        return plain;
    }
    let hash = blake3::hash(name.as_bytes()).to_hex();
    format!("{plain}-{}", &hash[..6])
}

fn is_plain(c: char) -> bool {
    c.is_ascii_alphanumeric() || "-_+".contains(c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn names_become_file_names_and_stay_apart() {
        assert_eq!(plain("psb_cup_22"), "psb_cup_22");
        let names = ["../a", "..-a", "a b", "a/b", "4 cups (human)"].map(plain);
        for (i, name) in names.iter().enumerate() {
            assert!(!name.contains(['/', ' ', '.']), "{name}");
            assert!(!names[..i].contains(name), "{name}");
        }
    }

    #[test]
    fn a_file_holds_what_was_put_and_nothing_is_written_for_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut predictions = PairPredictions::new("g", "a", "b");
        let file = predictions.file();
        predictions.write(folder.path(), &file).unwrap();
        assert!(!folder.path().join(FOLDER).exists());
        let region = Region::from_weights(vec![0.123456, 0.987654]).unwrap();
        predictions.methods.insert("whole".into(), Prediction::of_region(&region));
        predictions.write(folder.path(), &file).unwrap();
        let path = folder.path().join(file);
        let page: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(page["methods"]["whole"], json!({ "vertices": [1], "weights": [0.9877] }));
        assert_eq!(PairPredictions::read(&path).unwrap(), predictions);
    }
}
