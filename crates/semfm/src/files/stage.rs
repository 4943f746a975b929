//! `stage.json`: what a stage of a run was made from, so that it is done again when that has changed, and only then.

use std::path::{Path, PathBuf};

use semfm_geom::io::{FormatError, read_json};
use serde::{Deserialize, Serialize};

use super::trajectory::relative;
use super::write_json;
use crate::Result;

/// The format that is written.
pub const FORMAT: &str = "semfm.stage/1";

/// The file's name, in the folder of its stage.
pub const STAGE_FILE: &str = "stage.json";

/// A finished stage: settings, inputs and outputs by their hashes, and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageFile {
    /// `semfm.stage/1`.
    pub format: String,
    /// Name of the stage, which is that of its folder.
    pub stage: String,
    /// Version of the program.
    pub version: String,
    /// BLAKE3 of the stage's settings as JSON.
    pub settings: String,
    /// Every file that was read, by name.
    pub inputs: Vec<FileHash>,
    /// Every file that was written, by name.
    pub outputs: Vec<FileHash>,
    /// Wall time.
    pub seconds: f64,
    /// What came out, in words, a line each.
    pub summary: Vec<String>,
    /// Why there is no answer, where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_answer: Option<NoAnswerRecord>,
}

/// A file by its content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileHash {
    /// Path relative to the folder of the record.
    pub file: String,
    /// BLAKE3 of its bytes.
    pub blake3: String,
}

/// Why sound input has no answer, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoAnswerRecord {
    /// The reason, in words.
    pub reason: String,
    /// What to try next, in words.
    pub next: String,
}

impl FileHash {
    /// Of a file, named as one in `folder` names it; `None` where it cannot be read.
    pub fn of(path: &Path, folder: &Path) -> Option<Self> {
        Some(Self { file: relative(path, folder), blake3: hash_of(path)? })
    }

    /// Whether the file that a record in `folder` names still has these bytes.
    pub fn holds(&self, folder: &Path) -> bool {
        hash_of(&folder.join(&self.file)).is_some_and(|hash| hash == self.blake3)
    }
}

/// BLAKE3 of a file's bytes. It reads past [`read_file`](semfm_geom::io::read_file): a file that is looked at to see whether
/// it has changed is no input of this run.
fn hash_of(path: &Path) -> Option<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(path).ok()?).ok()?;
    Some(hasher.finalize().to_hex().to_string())
}

impl StageFile {
    /// Writes it into `folder`.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(STAGE_FILE), self)
    }

    /// Reads that of a folder.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is not JSON of this form,
    /// [`Error::Format`](crate::Error::Format) for another format.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(STAGE_FILE);
        let file: Self = read_json(&path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        Ok(file)
    }

    /// What no longer holds of the record in `folder` for these settings; `None` where all of it does.
    pub fn why_stale(&self, folder: &Path, settings: &str, version: &str) -> Option<String> {
        let named = |hash: &FileHash| PathBuf::from(&hash.file).display().to_string();
        if self.version != version {
            return Some(format!("it was made by version {}", self.version));
        }
        if self.settings != settings {
            return Some("its settings have changed".into());
        }
        if let Some(input) = self.inputs.iter().find(|input| !input.holds(folder)) {
            return Some(format!("{} has changed", named(input)));
        }
        let output = self.outputs.iter().find(|output| !output.holds(folder));
        output.map(|output| format!("{} is not what it wrote", named(output)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_holds_until_something_that_it_names_changes() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("out/region");
        std::fs::create_dir_all(&folder).unwrap();
        let (input, output) = (parent.path().join("mug.obj"), folder.join("region.json"));
        std::fs::write(&input, "mug").unwrap();
        std::fs::write(&output, "region").unwrap();
        let record = StageFile {
            format: FORMAT.into(),
            stage: "region".into(),
            version: "1".into(),
            settings: "abc".into(),
            inputs: vec![FileHash::of(&input, &folder).unwrap()],
            outputs: vec![FileHash::of(&output, &folder).unwrap()],
            seconds: 0.5,
            summary: vec!["a line".into()],
            no_answer: None,
        };
        assert_eq!(record.inputs[0].file, "../../mug.obj");
        record.write(&folder).unwrap();
        let read = StageFile::read(&folder).unwrap();
        assert_eq!(read, record);
        assert_eq!(read.why_stale(&folder, "abc", "1"), None);
        assert!(read.why_stale(&folder, "abd", "1").unwrap().contains("settings"));
        assert!(read.why_stale(&folder, "abc", "2").unwrap().contains("version 1"));
        std::fs::write(&output, "touched").unwrap();
        assert!(read.why_stale(&folder, "abc", "1").unwrap().contains("region.json"));
        std::fs::write(&output, "region").unwrap();
        std::fs::remove_file(&input).unwrap();
        assert!(read.why_stale(&folder, "abc", "1").unwrap().contains("mug.obj"));
        assert!(FileHash::of(&input, &folder).is_none());
        std::fs::write(folder.join(STAGE_FILE), r#"{"format": "semfm.stage/1"}"#).unwrap();
        assert!(StageFile::read(&folder).is_err());
    }
}
