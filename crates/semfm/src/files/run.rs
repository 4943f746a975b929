//! `run.json`: how a run from pictures to grasps went, stage by stage.

use std::path::Path;

use semfm_geom::io::{FormatError, read_json};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::stage::{FileHash, NoAnswerRecord};
use super::write_json;
use crate::Result;

/// The format that is written.
pub const FORMAT: &str = "semfm.run/1";

/// The file's name, in the folder of the run.
pub const RUN_FILE: &str = "run.json";

/// A run that came to its end, with an answer or without one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// `semfm.run/1`.
    pub format: String,
    /// Version of the program.
    pub version: String,
    /// The stages in their order; those after one without an answer are not there.
    pub stages: Vec<RunStageRecord>,
    /// Why there is no answer, where there is none: that of the last stage.
    pub no_answer: Option<NoAnswerRecord>,
    /// The page, by its content.
    pub page: FileHash,
    /// What the page was made from.
    pub page_inputs: Vec<FileHash>,
}

/// A stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunStageRecord {
    /// Its name, which is that of its folder.
    pub stage: String,
    /// Whether this run did it, or found it done.
    pub state: StageState,
    /// Wall time when it was done.
    pub seconds: f64,
    /// What came out, in words, a line each.
    pub summary: Vec<String>,
    /// Names of its files.
    pub files: Vec<String>,
}

/// How a run came to the files of a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StageState {
    /// By doing it.
    Done,
    /// They were there, from the same inputs and settings.
    Kept,
}

impl RunFile {
    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
    }

    /// Writes it into `folder`.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<()> {
        write_json(&folder.join(RUN_FILE), self)
    }

    /// Reads that of a folder.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is not JSON of this form,
    /// [`Error::Format`](crate::Error::Format) for another format.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(RUN_FILE);
        let file: Self = read_json(&path)?;
        if file.format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, file.format).into());
        }
        Ok(file)
    }
}
