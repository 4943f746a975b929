//! What embeddings depend on beside the pictures: the encoder's files, by their content.
//!
//! A name says little: the network under an `ENCODER.json` is replaced, a checkpoint is trained on and
//! saved into the same folder, a class is edited. The program that makes embeddings knows which files it
//! reads (`semfm-embed --list-inputs`), and their content is hashed here, once for each
//! [`CommandEncoder`](crate::CommandEncoder).

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::Metadata;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::SystemTime;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// The name and version of the list's format.
const FORMAT: &str = "semfm.encoder-inputs/1";
/// Bytes that are hashed at once.
const BLOCK: usize = 1 << 20;

/// What `semfm-embed --list-inputs` prints.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub(crate) struct EncoderInputs {
    format: String,
    /// What embeddings files call the encoder.
    model: String,
    /// Versions of the packages at work.
    packages: BTreeMap<String, String>,
    /// All files that are read, by a name that stays when the folder moves.
    files: BTreeMap<String, PathBuf>,
    /// Why more may matter than is listed.
    unknown: Option<String>,
}

/// All that makes an encoder this very one. Its hash is the encoder's part of a key.
#[derive(Serialize)]
struct Content<'a> {
    model: &'a str,
    packages: &'a BTreeMap<String, String>,
    files: BTreeMap<&'a str, String>,
}

/// How a file looks from outside; while it does not change, neither did the file between two looks of
/// one run. It never stands for the content itself.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct FileState {
    bytes: u64,
    modified: Option<SystemTime>,
    #[cfg(unix)]
    node: (u64, u64, i64, i64),
}

impl EncoderInputs {
    /// Asks the program what embeddings by `model` depend on.
    ///
    /// # Errors
    /// [`Error::ProgramMissing`], [`Error::ProgramFailed`], and [`Error::Invalid`] for an answer in
    /// another format.
    pub fn ask(program: &OsStr, model: &str) -> Result<Self> {
        let name = program.display().to_string();
        let mut command = Command::new(program);
        command.args(["--list-inputs", "--model", model]);
        let answer = match command.stdin(Stdio::null()).stderr(Stdio::inherit()).output() {
            Ok(answer) if answer.status.success() => answer.stdout,
            Ok(answer) => {
                let status = answer.status.to_string();
                return Err(Error::ProgramFailed { program: name, status });
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::ProgramMissing { model: model.to_owned(), program: name });
            }
            Err(source) => {
                return Err(semfm_geom::Error::Io { path: name.into(), source }.into());
            }
        };
        let not_ours = |found: String| {
            Error::invalid(format!("{name} --list-inputs"), format!("JSON of {FORMAT}"), found)
        };
        let inputs: Self =
            serde_json::from_slice(&answer).map_err(|error| not_ours(error.to_string()))?;
        if inputs.format == FORMAT { Ok(inputs) } else { Err(not_ours(inputs.format)) }
    }

    /// Whether everything that matters is listed.
    pub fn is_complete(&self) -> bool {
        self.unknown.is_none()
    }

    /// Why more may matter than is listed.
    pub fn unknown(&self) -> Option<&str> {
        self.unknown.as_deref()
    }

    /// The hash of names, versions and the content of all files.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] for a file that cannot be read.
    pub fn content_hash(&self) -> Result<blake3::Hash> {
        let hashed = self.files.par_iter().map(|(name, path)| {
            let hash = hash_of(path).map_err(|source| io_error(path, source))?;
            Ok((name.as_str(), hash.to_hex().to_string()))
        });
        let files = hashed.collect::<Result<BTreeMap<_, _>>>()?;
        let content = Content { model: &self.model, packages: &self.packages, files };
        let json = serde_json::json!(content).to_string();
        Ok(blake3::hash(json.as_bytes()))
    }

    /// How the files look now.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] for a file that is not there.
    pub fn states(&self) -> Result<Vec<FileState>> {
        let look = |path: &PathBuf| {
            std::fs::metadata(path)
                .map(|about| FileState::of(&about))
                .map_err(|source| io_error(path, source))
        };
        self.files.values().map(look).collect()
    }
}

impl FileState {
    fn of(about: &Metadata) -> Self {
        Self {
            bytes: about.len(),
            modified: about.modified().ok(),
            #[cfg(unix)]
            node: {
                use std::os::unix::fs::MetadataExt;
                (about.dev(), about.ino(), about.ctime(), about.ctime_nsec())
            },
        }
    }
}

fn hash_of(path: &Path) -> std::io::Result<blake3::Hash> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::other("expected a regular file"));
    }
    let mut file = std::fs::File::open(path)?;
    let (mut hasher, mut block) = (blake3::Hasher::new(), vec![0; BLOCK]);
    loop {
        match file.read(&mut block)? {
            0 => return Ok(hasher.finalize()),
            n => hasher.update(&block[..n]),
        };
    }
}

fn io_error(path: &Path, source: std::io::Error) -> Error {
    semfm_geom::Error::Io { path: path.to_owned(), source }.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs(folder: &Path, files: &[(&str, &str)]) -> EncoderInputs {
        let place = |(name, text): &(&str, &str)| {
            let path = folder.join(name);
            std::fs::write(&path, text).unwrap();
            ((*name).to_owned(), path)
        };
        EncoderInputs {
            format: FORMAT.into(),
            model: "net.json".into(),
            packages: BTreeMap::from([("onnxruntime".into(), "1".into())]),
            files: files.iter().map(place).collect(),
            unknown: None,
        }
    }

    #[test]
    fn the_hash_is_that_of_names_contents_and_versions_wherever_the_files_lie() {
        let [here, there] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let files = [("net.json", "{}"), ("net.onnx", "weights")];
        let hash = inputs(here.path(), &files).content_hash().unwrap();
        assert_eq!(inputs(there.path(), &files).content_hash().unwrap(), hash);

        let others: [&[(&str, &str)]; 4] = [
            &[("net.json", "{}"), ("net.onnx", "wieghts")],
            &[("net.json", "{}"), ("other.onnx", "weights")],
            &[("net.json", "weights"), ("net.onnx", "{}")],
            &[("net.json", "{}"), ("net.onnx", "weights"), ("net.data", "")],
        ];
        for files in others {
            assert_ne!(inputs(there.path(), files).content_hash().unwrap(), hash, "{files:?}");
        }
        let mut newer = inputs(here.path(), &files);
        newer.packages.insert("onnxruntime".into(), "2".into());
        assert_ne!(newer.content_hash().unwrap(), hash);
    }

    #[test]
    fn a_file_of_many_blocks_is_hashed_to_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("large");
        let mut bytes = vec![7_u8; 3 * BLOCK + 5];
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(hash_of(&path).unwrap(), blake3::hash(&bytes));
        bytes[3 * BLOCK + 4] = 8;
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(hash_of(&path).unwrap(), blake3::hash(&bytes));
    }
}
