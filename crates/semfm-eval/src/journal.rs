//! What is done so far, one line a pair, so that an interrupted run goes on where it stopped.
//!
//! The first line names the run; a line that was cut short by the interrupt is dropped. A finished
//! run has no journal.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::row::{ObjectRow, Row};
use crate::variant::Override;
use crate::{Error, Result};

/// The file in the output folder.
pub const FILE: &str = "journal.jsonl";

/// Everything that rows depend on. Two runs with the same identity give the same rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunIdentity {
    /// Name and version of this format.
    pub format: String,
    /// Version or hash of the program.
    pub program: String,
    /// Hash of the dataset.
    pub dataset: String,
    /// Where the features came from.
    pub embeddings: String,
    /// The methods, in order.
    pub methods: Vec<String>,
    /// All settings that methods and objects share.
    pub settings: RunSettings,
}

/// The settings of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunSettings {
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// Working mesh, Laplacian and basis: [`semfm::geom::ShapeSettings`] as JSON.
    pub shape: serde_json::Value,
    /// Settings of methods that are changed.
    pub overrides: Vec<Override>,
}

/// The format that is written.
pub const FORMAT: &str = "semfm.eval-journal/1";

impl RunIdentity {
    /// The first difference to another run.
    fn difference(&self, now: &Self) -> Option<Difference> {
        let (then_settings, now_settings) = (&self.settings, &now.settings);
        let changes = [
            Difference::of("journal format", &self.format, &now.format),
            Difference::of("program", &self.program, &now.program),
            Difference::of("dataset", &self.dataset, &now.dataset),
            Difference::of("source of features", &self.embeddings, &now.embeddings),
            Difference::of("choice of methods", &self.methods.join(","), &now.methods.join(",")),
            Difference::of(
                "choice of settings",
                &format!("seed {}", then_settings.seed),
                &format!("seed {}", now_settings.seed),
            ),
            Difference::of(
                "choice of settings",
                &json!(then_settings).to_string(),
                &json!(now_settings).to_string(),
            ),
        ];
        changes.into_iter().flatten().next()
    }
}

/// In what two runs differ.
struct Difference {
    what: &'static str,
    before: String,
    now: String,
}

impl Difference {
    fn of(what: &'static str, before: &str, now: &str) -> Option<Self> {
        let (before, now) = (before.to_owned(), now.to_owned());
        (before != now).then_some(Self { what, before, now })
    }
}

/// A pair that is done: its place in the plan and its rows.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct DonePair {
    pub group: usize,
    pub pair: usize,
    pub rows: Vec<Row>,
}

/// What a line after the first holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Line {
    /// An object was prepared.
    Object(ObjectRow),
    /// A pair is done.
    Pair(DonePair),
}

/// The open journal of a run.
pub(crate) struct Journal {
    path: PathBuf,
    file: Mutex<File>,
}

impl Journal {
    /// Opens the journal in `folder`; gives what an interrupted run left. `fresh` forgets
    /// them.
    ///
    /// # Errors
    /// [`Error::OtherRun`] where the journal is that of another run, [`Error::Io`].
    pub fn open(folder: &Path, run: &RunIdentity, fresh: bool) -> Result<(Self, Vec<Line>)> {
        let path = folder.join(FILE);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) if !fresh => text,
            Err(error) if !fresh && error.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io(&path)(error));
            }
            _ => String::new(),
        };
        let (whole, done) = read(&path, &text, run)?;
        let mut options = OpenOptions::new();
        let mut file = options
            .create(true)
            .write(true)
            .truncate(false)
            .open(&path)
            .map_err(Error::io(&path))?;
        file.set_len(whole).map_err(Error::io(&path))?;
        file.seek(SeekFrom::Start(whole)).map_err(Error::io(&path))?;
        let journal = Self { path, file: Mutex::new(file) };
        if whole == 0 {
            journal.append(run)?;
        }
        Ok((journal, done))
    }

    /// Adds a line and waits until it is on the disk.
    pub fn append(&self, line: &impl Serialize) -> Result<()> {
        let mut text =
            serde_json::to_string(line).map_err(|error| Error::io(&self.path)(error.into()))?;
        text.push('\n');
        let Ok(mut file) = self.file.lock() else { return Ok(()) }; // another worker panicked
        file.write_all(text.as_bytes())
            .and_then(|()| file.sync_data())
            .map_err(Error::io(&self.path))
    }

    /// The run is finished and its results are written: nothing to go on with.
    pub fn close(self) -> Result<()> {
        std::fs::remove_file(&self.path).map_err(Error::io(&self.path))
    }
}

/// Bytes of the whole lines, and what they hold.
fn read(path: &Path, text: &str, run: &RunIdentity) -> Result<(u64, Vec<Line>)> {
    let mut whole = 0;
    let mut done = Vec::new();
    for (number, line) in text.split_inclusive('\n').enumerate() {
        if !line.ends_with('\n') {
            break;
        }
        if number == 0 {
            let before: RunIdentity = serde_json::from_str(line).map_err(|error| {
                Error::format(path, "line 1", "the identity of a run", error.to_string())
            })?;
            if let Some(Difference { what, before, now }) = before.difference(run) {
                return Err(Error::OtherRun { path: path.into(), what: what.into(), before, now });
            }
        } else {
            // Only the last line can be damaged by an interrupt; what follows damage is done again.
            let Ok(line) = serde_json::from_str(line) else { break };
            done.push(line);
        }
        whole += line.len() as u64;
    }
    Ok((whole, done))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(methods: &[&str]) -> RunIdentity {
        RunIdentity {
            format: FORMAT.into(),
            program: "p".into(),
            dataset: "d".into(),
            embeddings: "e".into(),
            methods: methods.iter().map(|&m| m.into()).collect(),
            settings: RunSettings::default(),
        }
    }

    fn pair(number: usize) -> Line {
        let rows = vec![Row { iou: Some(0.1 * number as f64), ..Row::default() }];
        Line::Pair(DonePair { group: 0, pair: number, rows })
    }

    fn numbers(lines: &[Line]) -> Vec<usize> {
        let mut numbers = Vec::new();
        for line in lines {
            if let Line::Pair(done) = line {
                numbers.push(done.pair);
            }
        }
        numbers
    }

    #[test]
    fn an_interrupted_run_goes_on_and_half_a_line_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let run = identity(&["fused"]);
        let (journal, done) = Journal::open(folder.path(), &run, false).unwrap();
        assert!(done.is_empty());
        journal.append(&pair(3)).unwrap();
        journal.append(&pair(1)).unwrap();
        drop(journal);
        let path = folder.path().join(FILE);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 5]).unwrap();
        let (journal, done) = Journal::open(folder.path(), &run, false).unwrap();
        assert_eq!(numbers(&done), [3]);
        journal.append(&pair(1)).unwrap();
        drop(journal);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        let (journal, done) = Journal::open(folder.path(), &run, false).unwrap();
        assert_eq!(numbers(&done), [3, 1]);
        journal.close().unwrap();
        assert!(!path.exists());
    }

    #[test]
    fn another_run_is_refused_with_what_differs_unless_begun_afresh() {
        let folder = tempfile::tempdir().unwrap();
        let (journal, _) = Journal::open(folder.path(), &identity(&["fused"]), false).unwrap();
        journal.append(&pair(0)).unwrap();
        drop(journal);
        let other = identity(&["wks"]);
        let error = Journal::open(folder.path(), &other, false).err().unwrap().to_string();
        assert!(
            error.contains("methods") && error.contains("fused") && error.contains("wks"),
            "{error}"
        );
        let (_, done) = Journal::open(folder.path(), &other, true).unwrap();
        assert!(done.is_empty());
        assert!(Journal::open(folder.path(), &other, false).is_ok());
    }
}
