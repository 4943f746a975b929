//! Embeddings through the command `semfm-embed`, kept between runs.
//!
//! Image encoders live in Python. Here an object is rendered, the command turns the views file into
//! an embeddings file, and the file is kept under a key of everything that it depends on: the mesh and
//! how it is shown, and the content of the encoder's files (`encoder_inputs`), never its name alone.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use semfm_geom::io::{MeshFile, read_json, write_atomically, write_json};
use semfm_geom::{MeshHash, ShapeCache, Task};
use semfm_views::Renderer;
use semfm_views::mcap::EmbeddingsFile;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use crate::encoder_inputs::{EncoderInputs, FileState};
use crate::files::read_embeddings;
use crate::rendered_views::{Coloring, ViewSettings, write_rendered_views};
use crate::{Error, Result};

/// Environment variable that names the program; else `semfm-embed` is looked for on the PATH.
pub const PROGRAM_VARIABLE: &str = "SEMFM_EMBED";

/// Which encoder makes the embeddings, and how.
#[derive(Clone, Debug)]
pub struct EncoderSettings {
    /// A Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or `package.module:Class`.
    pub model: String,
    /// Rotations of each view that are averaged: 1, 2 or 4.
    pub rolls: u32,
    /// Whether embeddings are kept in the user's cache, and used where they are there. Those of a class
    /// of Python that does not list its files are never kept.
    pub keep: bool,
    /// Threads of the encoder; 0 leaves the number to it.
    pub threads: usize,
    /// Whether the encoder says nothing but errors.
    pub quiet: bool,
}

/// The command with the folder in which its embeddings are kept.
#[derive(Clone, Debug)]
pub struct EncoderCommand {
    settings: EncoderSettings,
    /// `None` where nothing is kept.
    folder: Option<PathBuf>,
    /// What the encoder is, once it was asked for.
    encoder: Arc<Mutex<Option<Arc<KnownEncoder>>>>,
}

/// An encoder by its content.
#[derive(Debug)]
struct KnownEncoder {
    inputs: EncoderInputs,
    /// How its files looked before they were hashed.
    states: Vec<FileState>,
    hash: blake3::Hash,
}

/// Embeddings of one object.
#[derive(Clone, Debug)]
pub struct EncodedObject {
    /// The embeddings of its views.
    pub embeddings: EmbeddingsFile,
    /// What making them took, now or then; `None` where that is not known.
    pub times: Option<EncodingTimes>,
}

/// Embeddings of two objects.
#[derive(Clone, Debug)]
pub struct EncodedPair {
    /// Of the demonstrated object.
    pub source: EncodedObject,
    /// Of the object to act on.
    pub target: EncodedObject,
}

/// What making the embeddings of an object took, the encoder's start included.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct EncodingTimes {
    /// Milliseconds for the views.
    pub views_ms: f64,
    /// Milliseconds for the encoder.
    pub embed_ms: f64,
}

/// What embeddings depend on. The key is a hash of its JSON.
#[derive(Serialize)]
struct CacheKey<'a> {
    mesh: MeshHash,
    /// Hash of the object's colours, where they are shown.
    colors: Option<String>,
    /// Hash of everything that makes the encoder.
    encoder: &'a str,
    /// The version of the code that draws the views.
    version: &'static str,
    rolls: u32,
    views: ViewSettings,
}

impl EncoderCommand {
    /// The command; embeddings are kept beside the prepared shapes in the user's cache
    /// ([`ShapeCache::of_user`]).
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where the folder cannot be made.
    pub fn new(settings: EncoderSettings) -> Result<Self> {
        let shapes = ShapeCache::of_user();
        let kept = shapes.folder().filter(|_| settings.keep);
        let folder = kept.map(|shapes| shapes.with_file_name("embeddings"));
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder).map_err(|source| io_error(folder, source))?;
        }
        Ok(Self { settings, folder, encoder: Arc::default() })
    }

    /// The same encoder with another number of rolls; its files are not hashed again.
    #[must_use]
    pub fn with_rolls(&self, rolls: u32) -> Self {
        Self { settings: EncoderSettings { rolls, ..self.settings.clone() }, ..self.clone() }
    }

    /// A hash of everything that makes the encoder: its files' content, versions of what runs them.
    /// Another encoder, or the same after a change of any of its files, has another.
    ///
    /// # Errors
    /// [`Error::EncoderMissing`], [`Error::EncoderFailed`], [`semfm_geom::Error::Io`] for a file that
    /// cannot be read.
    pub fn content_hash(&self) -> Result<String> {
        Ok(self.known_encoder()?.hash.to_hex().to_string())
    }

    /// Why embeddings were not kept although they should be, in words.
    pub fn note(&self) -> Option<String> {
        self.folder.as_ref()?;
        let known = self.encoder.lock().unwrap_or_else(PoisonError::into_inner);
        let unknown = known.as_ref()?.inputs.unknown()?;
        Some(format!("embeddings by {} are made anew each time: {unknown}", self.settings.model))
    }

    /// The embeddings of an object's default views, in the object's own colours or in grey; made
    /// where they are not there yet.
    ///
    /// # Errors
    /// [`Error::EncoderMissing`], [`Error::EncoderFailed`]; what [`write_rendered_views`] and
    /// [`EmbeddingsFile::read`] report.
    pub fn embed(
        &self,
        object: &MeshFile,
        coloring: Coloring,
        task: &Task,
    ) -> Result<EncodedObject> {
        if let Some(kept) = self.kept(object, coloring)? {
            return Ok(kept);
        }
        let mut made = self.make(&[object], coloring, task)?;
        Ok(made.swap_remove(0))
    }

    /// The embeddings of two objects. Those that are not there yet are made in one call of the
    /// encoder, which may take longer to start than to look at an object.
    ///
    /// # Errors
    /// As [`EncoderCommand::embed`].
    pub fn embed_pair(
        &self,
        source: &MeshFile,
        target: &MeshFile,
        coloring: Coloring,
        task: &Task,
    ) -> Result<EncodedPair> {
        let kept_source = self.kept(source, coloring)?;
        let kept_target = self.kept(target, coloring)?;
        match (kept_source, kept_target) {
            (Some(source), Some(target)) => Ok(EncodedPair { source, target }),
            (Some(source), None) => {
                let target = self.make(&[target], coloring, task)?.swap_remove(0);
                Ok(EncodedPair { source, target })
            }
            (None, Some(target)) => {
                let source = self.make(&[source], coloring, task)?.swap_remove(0);
                Ok(EncodedPair { source, target })
            }
            (None, None) if look(source, coloring) == look(target, coloring) => {
                let both = self.make(&[source], coloring, task)?.swap_remove(0);
                Ok(EncodedPair { source: both.clone(), target: both })
            }
            (None, None) => {
                let mut made = self.make(&[source, target], coloring, task)?;
                let target = made.swap_remove(1);
                Ok(EncodedPair { source: made.swap_remove(0), target })
            }
        }
    }

    /// What is kept of an object. Whatever is wrong with a kept file, a new one is the cure.
    fn kept(&self, file: &MeshFile, coloring: Coloring) -> Result<Option<EncodedObject>> {
        let Some(folder) = &self.folder else { return Ok(None) };
        let known = self.known_encoder()?;
        if !known.inputs.is_complete() {
            return Ok(None);
        }
        let path = self.kept_at(folder, &known.hash, file, coloring);
        let Ok(embeddings) = read_embeddings(&path, &file.mesh) else { return Ok(None) };
        Ok(Some(EncodedObject { embeddings, times: read_json(times_path(&path)).ok() }))
    }

    /// Renders the objects, has them embedded, and keeps the files where they may be kept.
    fn make(
        &self,
        objects: &[&MeshFile],
        coloring: Coloring,
        task: &Task,
    ) -> Result<Vec<EncodedObject>> {
        let scratch = temporary_folder()?;
        let (mut rendered, mut views_ms) = (Vec::new(), Vec::new());
        for (i, file) in objects.iter().enumerate() {
            let start = Instant::now();
            let views = scratch.path().join(format!("{i}.views.mcap"));
            // By the CPU on every machine: what is kept must not depend on the driver that was there.
            write_rendered_views(&views, file, &shown(coloring), &Renderer::cpu(), task)?;
            views_ms.push(start.elapsed().as_secs_f64() * 1e3);
            rendered.push(views);
        }
        let start = Instant::now();
        self.run(&rendered, scratch.path())?;
        let embed_ms = start.elapsed().as_secs_f64() * 1e3 / objects.len() as f64;
        let used = self.encoder_that_ran()?;
        let mut made = Vec::new();
        for (i, (file, views_ms)) in objects.iter().zip(views_ms).enumerate() {
            let path = scratch.path().join(format!("{i}.emb.mcap"));
            let embeddings = read_embeddings(&path, &file.mesh)?;
            let times = EncodingTimes { views_ms, embed_ms };
            if let (Some(folder), Some(used)) = (&self.folder, &used) {
                let kept = self.kept_at(folder, &used.hash, file, coloring);
                let bytes = std::fs::read(&path).map_err(|source| io_error(&path, source))?;
                write_atomically(&kept, |out| out.write_all(&bytes))?;
                // Embeddings without their times are as good.
                let _ = write_json(times_path(&kept), &times);
            }
            made.push(EncodedObject { embeddings, times: Some(times) });
        }
        Ok(made)
    }

    /// What the encoder is: asked of the program and hashed the first time.
    fn known_encoder(&self) -> Result<Arc<KnownEncoder>> {
        let mut known = self.encoder.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*known {
            return Ok(Arc::clone(known));
        }
        let fresh = Arc::new(KnownEncoder::of(&program(), &self.settings.model)?);
        *known = Some(Arc::clone(&fresh));
        Ok(fresh)
    }

    /// The encoder under which embeddings that were just made can be kept: the known one, if none of
    /// its files changed since it was hashed.
    fn encoder_that_ran(&self) -> Result<Option<Arc<KnownEncoder>>> {
        if self.folder.is_none() {
            return Ok(None);
        }
        let known = self.known_encoder()?;
        let is_same = known.inputs.states().is_ok_and(|states| states == known.states)
            // The hub may have had a newer revision of what was listed.
            && (!is_hub_name(&self.settings.model)
                || EncoderInputs::ask(&program(), &self.settings.model)? == known.inputs);
        if !is_same {
            // The next object is asked for under what the files are then.
            *self.encoder.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
        Ok(Some(known).filter(|known| is_same && known.inputs.is_complete()))
    }

    /// Calls the program: `NAME.views.mcap` becomes `NAME.emb.mcap` in the folder.
    fn run(&self, views: &[PathBuf], folder: &Path) -> Result<()> {
        let program = program();
        let EncoderSettings { model, rolls, threads, quiet, .. } = &self.settings;
        let mut arguments: Vec<OsString> = views.iter().map(OsString::from).collect();
        arguments.extend(["--output-folder".into(), OsString::from(folder)]);
        arguments.extend(["--model".into(), model.into()]);
        arguments.extend(["--rolls".into(), rolls.to_string().into()]);
        if *threads > 0 {
            arguments.extend(["--threads".into(), threads.to_string().into()]);
        }
        if *quiet {
            arguments.push("--quiet".into());
        }
        let program_name = program.display().to_string();
        match Command::new(&program).args(arguments).stdout(Stdio::null()).status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => {
                Err(Error::EncoderFailed { program: program_name, status: status.to_string() })
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(Error::EncoderMissing { program: program_name })
            }
            Err(source) => Err(io_error(Path::new(&program), source)),
        }
    }

    /// Where the embeddings of an object are kept.
    fn kept_at(
        &self,
        folder: &Path,
        encoder: &blake3::Hash,
        file: &MeshFile,
        coloring: Coloring,
    ) -> PathBuf {
        let Look { mesh, colors } = look(file, coloring);
        let key = CacheKey {
            mesh,
            colors,
            encoder: &encoder.to_hex(),
            version: env!("CARGO_PKG_VERSION"),
            rolls: self.settings.rolls,
            views: shown(coloring),
        };
        let key = blake3::hash(crate::files::to_json(&key).to_string().as_bytes());
        folder.join(format!("{}.emb.mcap", key.to_hex()))
    }
}

impl KnownEncoder {
    fn of(program: &OsString, model: &str) -> Result<Self> {
        let inputs = EncoderInputs::ask(program, model)?;
        let states = inputs.states()?;
        let hash = inputs.content_hash()?;
        Ok(Self { inputs, states, hash })
    }
}

/// The object as an encoder sees it.
#[derive(PartialEq)]
struct Look {
    mesh: MeshHash,
    /// Hash of the object's colours, where they are shown.
    colors: Option<String>,
}

fn look(file: &MeshFile, coloring: Coloring) -> Look {
    let colors = (coloring == Coloring::Own).then(|| file.appearance.content_hash());
    Look { mesh: file.mesh.hash(), colors }
}

/// The program that makes embeddings.
fn program() -> OsString {
    std::env::var_os(PROGRAM_VARIABLE).unwrap_or_else(|| "semfm-embed".into())
}

/// Whether a model is a name on the Hugging Face hub: neither a file or folder nor a class.
fn is_hub_name(model: &str) -> bool {
    !model.contains(':') && !Path::new(model).exists()
}

/// How an encoder is shown an object.
fn shown(coloring: Coloring) -> ViewSettings {
    ViewSettings { coloring, ..ViewSettings::default() }
}

/// Where it stands what making embeddings took.
fn times_path(embeddings: &Path) -> PathBuf {
    embeddings.with_extension("took.json")
}

fn temporary_folder() -> Result<TempDir> {
    tempfile::tempdir().map_err(|source| io_error(&std::env::temp_dir(), source))
}

fn io_error(path: &Path, source: std::io::Error) -> Error {
    semfm_geom::Error::Io { path: path.to_owned(), source }.into()
}
