//! What each method answered on each pair, one JSON file a pair: for pictures and for other scores.

use std::path::{Path, PathBuf};

use semfm::Region;
use semfm::geom::io::write_atomically;
use serde_json::{Map, Value, json};

use crate::Result;
use crate::candidate::Candidate;
use crate::row::AnchorRow;
use crate::run::Answer;

/// The format that is written.
pub const FORMAT: &str = "semfm.prediction/1";
/// The folder beside the results.
const FOLDER: &str = "predictions";
/// Weights are written to four decimals: they colour pictures, and the vertices are listed anyway.
const STEPS: f64 = 1e4;

/// Where predictions are put.
pub(crate) struct Predictions {
    folder: PathBuf,
}

/// The answers on one pair.
pub(crate) struct Page {
    folder: PathBuf,
    /// Relative to the results.
    name: String,
    about: [String; 3],
    methods: Map<String, Value>,
}

impl Predictions {
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned() }
    }

    pub fn page(&self, group: &str, source: &str, target: &str) -> Page {
        let name = format!("{FOLDER}/{}/{}--{}.json", plain(group), plain(source), plain(target));
        let about = [group, source, target].map(str::to_owned);
        Page { folder: self.folder.clone(), name, about, methods: Map::new() }
    }
}

impl Page {
    /// Adds an answer; gives the file that it will stand in, relative to the results.
    pub fn put(&mut self, candidate: Candidate, answer: &Answer) -> String {
        let value = match answer {
            Answer::Everything(region) => region_json(region),
            Answer::Carried(carried) => {
                let mut value = region_json(&carried.region);
                let hypotheses = carried.hypotheses.iter().map(|hypothesis| {
                    let mut place = region_json(&hypothesis.region);
                    place["probability"] = json!(hypothesis.probability);
                    place
                });
                value["hypotheses"] = hypotheses.collect();
                value["confidence"] = json!(carried.confidence);
                value["verdict"] = json!(carried.verdict);
                let anchors: Vec<AnchorRow> =
                    carried.report.anchors.iter().map(AnchorRow::from).collect();
                value["anchors"] = json!(anchors);
                value["point_map"] = json!(carried.point_map.source_of);
                value
            }
        };
        self.methods.insert(candidate.name().into(), value);
        self.name.clone()
    }

    /// Writes the file, if anybody answered.
    pub fn write(self) -> Result<()> {
        if self.methods.is_empty() {
            return Ok(());
        }
        let path = self.folder.join(&self.name);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(crate::Error::io(folder))?;
        }
        let [group, source, target] = self.about;
        let page = json!({
            "format": FORMAT,
            "group": group,
            "source": source,
            "target": target,
            "methods": self.methods,
        });
        write_atomically(&path, |out| Ok(serde_json::to_writer(out, &page)?))?;
        Ok(())
    }
}

fn region_json(region: &Region) -> Value {
    let vertices = region.vertices();
    let round = |w: f64| (w * STEPS).round() / STEPS;
    let weights: Vec<f64> = vertices.iter().map(|&v| round(region.weights()[v as usize])).collect();
    json!({ "vertices": vertices, "weights": weights })
}

/// A name that is a file name everywhere. Names that differ only in odd characters stay apart by a
/// few digits of their hash.
pub(crate) fn plain(name: &str) -> String {
    let keep = |c: char| c.is_ascii_alphanumeric() || "-_+".contains(c);
    let plain: String = name.chars().map(|c| if keep(c) { c } else { '_' }).collect();
    if plain == name {
        return plain;
    }
    let hash = blake3::hash(name.as_bytes()).to_hex();
    format!("{plain}-{}", &hash[..6])
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_page_holds_what_was_put_and_nothing_is_written_for_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let predictions = Predictions::new(folder.path());
        predictions.page("g", "a", "b").write().unwrap();
        assert!(!folder.path().join(FOLDER).exists());
        let mut page = predictions.page("g", "a", "b");
        let region = Region::from_weights(vec![0.123456, 0.987654]).unwrap();
        let name = page.put(Candidate::Whole, &Answer::Everything(region));
        page.write().unwrap();
        let text = std::fs::read(folder.path().join(name)).unwrap();
        let page: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(page["methods"]["whole"], json!({ "vertices": [1], "weights": [0.9877] }));
    }
}
