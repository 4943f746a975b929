//! Folders of shapes with true correspondences.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use semfm::geom::io::read_file;
use serde_json::json;

use crate::{Error, Result};

/// The list of pairs in a set's folder.
pub(super) const PAIRS: &str = "pairs.txt";

/// Sets of shapes with true correspondences.
#[derive(Clone, Debug)]
pub struct CorrespondenceDataset {
    /// The folder.
    pub path: PathBuf,
    /// Hash of all shapes and pairs.
    pub hash: String,
    /// The sets, by name.
    pub sets: Vec<CorrespondenceSet>,
}

/// Shapes of one kind and pairs among them.
#[derive(Clone, Debug)]
pub struct CorrespondenceSet {
    /// The folder's name.
    pub name: String,
    folder: PathBuf,
    /// (source, target) by name.
    pub pairs: Vec<[String; 2]>,
}

impl CorrespondenceDataset {
    /// Reads the lists of pairs and hashes everything that they name.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a line that is not two names, or no pair at all.
    pub fn open(path: &Path) -> Result<Self> {
        let mut folders: Vec<PathBuf> = std::fs::read_dir(path)
            .and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect())
            .map_err(Error::io(path))?;
        folders.retain(|folder| folder.join(PAIRS).is_file());
        folders.sort();
        let sets = folders.into_iter().map(CorrespondenceSet::open).collect::<Result<Vec<_>>>()?;
        if sets.iter().all(|set| set.pairs.is_empty()) {
            let expected = "at least one pair (SET/pairs.txt beside SET/NAME.npz)";
            return Err(Error::format(path, "folder", expected, "none"));
        }
        let hash = hash(&sets)?;
        Ok(Self { path: path.to_owned(), hash, sets })
    }

    /// Number of pairs in all sets.
    pub fn n_pairs(&self) -> usize {
        self.sets.iter().map(|set| set.pairs.len()).sum()
    }
}

impl CorrespondenceSet {
    fn open(folder: PathBuf) -> Result<Self> {
        let path = folder.join(PAIRS);
        let text = String::from_utf8(read_file(&path)?).map_err(|error| {
            let byte = format!("byte {}", error.utf8_error().valid_up_to());
            Error::format(&path, byte, "text in UTF-8", "another byte")
        })?;
        let text = text.trim_start_matches('\u{feff}');
        let mut pairs = Vec::new();
        for (line, number) in text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty()) {
            let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            pairs.push(
                <[String; 2]>::try_from(words).map_err(|_| {
                    Error::format(&path, format!("line {number}"), "two names", line)
                })?,
            );
        }
        let name = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, folder, pairs })
    }

    /// The file of a shape.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.npz"))
    }

    /// Names of the shapes that pairs name.
    pub(super) fn shapes(&self) -> BTreeSet<&str> {
        self.pairs.iter().flatten().map(String::as_str).collect()
    }
}

/// Hash of names, pairs and files.
fn hash(sets: &[CorrespondenceSet]) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    for set in sets {
        hasher.update(json!([set.name, set.pairs]).to_string().as_bytes());
        for name in set.shapes() {
            let path = set.file(name);
            let bytes = read_file(&path)?;
            hasher.update(blake3::hash(&bytes).as_bytes());
        }
    }
    Ok(format!("blake3:{}", hasher.finalize().to_hex()))
}
