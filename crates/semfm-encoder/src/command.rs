//! Encoders outside of this process, through the program `semfm-embed`.
//!
//! Image encoders of PyTorch and ONNX live in Python. Views go to the program as views files, and its
//! embeddings files come back, both in a temporary folder.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use semfm_geom::Task;
use semfm_views::mcap::EmbeddingsFile;

use crate::command_inputs::{EncoderInputs, FileState};
use crate::encoder::{EncodedViews, Encoder, EncoderIdentity, PRETRAINED_ROLLS, WantedViews};
use crate::open::OpenSettings;
use crate::rendered_views::{Coloring, RenderedObject, ViewSettings};
use crate::{Error, Result};

/// Environment variable that names the program; else `semfm-embed` is looked for on the PATH.
pub const PROGRAM_VARIABLE: &str = "SEMFM_EMBED";

/// A model that `semfm-embed` runs: a Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or
/// `package.module:Class`.
///
/// Its calls fail with [`Error::ProgramMissing`], [`Error::ProgramFailed`], [`semfm_geom::Error::Io`]
/// for a file of the encoder that cannot be read, and as [`EmbeddingsFile::read`] does.
#[derive(Clone, Debug)]
pub struct CommandEncoder {
    model: String,
    settings: OpenSettings,
    /// What the encoder is, once it was asked for.
    known: Arc<Mutex<Option<Arc<KnownEncoder>>>>,
}

/// An encoder by its content.
#[derive(Debug)]
struct KnownEncoder {
    inputs: EncoderInputs,
    /// How its files looked before they were hashed.
    states: Vec<FileState>,
    hash: blake3::Hash,
}

impl CommandEncoder {
    /// The model of this name; whether it is there shows when it is asked.
    pub fn new(model: impl Into<String>, settings: OpenSettings) -> Self {
        Self { model: model.into(), settings, known: Arc::default() }
    }

    /// What the encoder is: asked of the program and hashed the first time.
    fn known(&self) -> Result<Arc<KnownEncoder>> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*known {
            return Ok(Arc::clone(known));
        }
        let inputs = EncoderInputs::ask(&program(), &self.model)?;
        let states = inputs.states()?;
        let hash = inputs.content_hash()?;
        let fresh = Arc::new(KnownEncoder { inputs, states, hash });
        *known = Some(Arc::clone(&fresh));
        Ok(fresh)
    }

    /// Calls the program: `NNN.views.mcap` becomes `NNN.emb.mcap` in the folder.
    fn run(&self, views: &[PathBuf], folder: &Path, rolls: u32) -> Result<()> {
        let program = program();
        let OpenSettings { threads, quiet } = self.settings;
        let mut arguments: Vec<OsString> = views.iter().map(OsString::from).collect();
        arguments.extend(["--output-folder".into(), OsString::from(folder)]);
        arguments.extend(["--model".into(), OsString::from(&self.model)]);
        arguments.extend(["--rolls".into(), rolls.to_string().into()]);
        if threads > 0 {
            arguments.extend(["--threads".into(), threads.to_string().into()]);
        }
        if quiet {
            arguments.push("--quiet".into());
        }
        let program_name = program.display().to_string();
        match Command::new(&program).args(arguments).stdout(Stdio::null()).status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => {
                Err(Error::ProgramFailed { program: program_name, status: status.to_string() })
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(Error::ProgramMissing { model: self.model.clone(), program: program_name })
            }
            Err(source) => Err(io_error(Path::new(&program), source)),
        }
    }
}

impl Encoder for CommandEncoder {
    /// The model's name; its version is known when it has run.
    fn identity(&self) -> EncoderIdentity {
        EncoderIdentity { name: self.model.clone(), version: String::new() }
    }

    fn content_hash(&self) -> Result<String> {
        Ok(self.known()?.hash.to_hex().to_string())
    }

    /// The known one, if none of its files changed since it was hashed.
    fn hash_of_last_run(&self) -> Result<Option<String>> {
        let known = self.known()?;
        let is_same = known.inputs.states().is_ok_and(|states| states == known.states)
            // The hub may have had a newer revision of what was listed.
            && (!is_hub_name(&self.model)
                || EncoderInputs::ask(&program(), &self.model)? == known.inputs);
        if !is_same {
            // The next object is asked for under what the files are then.
            *self.known.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
        let is_kept = is_same && known.inputs.is_complete();
        Ok(is_kept.then(|| known.hash.to_hex().to_string()))
    }

    fn why_not_kept(&self) -> Option<String> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let unknown = known.as_ref()?.inputs.unknown()?;
        Some(format!("embeddings by {} are made anew each time: {unknown}", self.model))
    }

    fn wants(&self) -> WantedViews {
        let views = ViewSettings { coloring: Coloring::Own, ..ViewSettings::default() };
        WantedViews { views, reads_colors: true, rolls: PRETRAINED_ROLLS }
    }

    fn encode(
        &self,
        objects: &[RenderedObject<'_>],
        rolls: u32,
        task: &Task,
    ) -> Result<Vec<EncodedViews>> {
        let scratch =
            tempfile::tempdir().map_err(|source| io_error(&std::env::temp_dir(), source))?;
        let mut paths = Vec::new();
        for (number, object) in objects.iter().enumerate() {
            let path = scratch.path().join(format!("{number:03}.views.mcap"));
            object.write(&path)?;
            paths.push(path);
        }
        task.check()?;
        self.run(&paths, scratch.path(), rolls)?;
        let mut encoded = Vec::new();
        for (number, object) in objects.iter().enumerate() {
            let path = scratch.path().join(format!("{number:03}.emb.mcap"));
            let file = EmbeddingsFile::read(&path)?;
            file.check_mesh(object.mesh)?;
            encoded.push(EncodedViews::of_file(file));
        }
        Ok(encoded)
    }
}

/// The program that runs encoders.
fn program() -> OsString {
    std::env::var_os(PROGRAM_VARIABLE).unwrap_or_else(|| "semfm-embed".into())
}

/// Whether a model is a name on the Hugging Face hub: neither a file or folder nor a class.
fn is_hub_name(model: &str) -> bool {
    !model.contains(':') && !Path::new(model).exists()
}

fn io_error(path: &Path, source: std::io::Error) -> Error {
    semfm_geom::Error::Io { path: path.to_owned(), source }.into()
}
