//! Embeddings through the command `semfm-embed`, kept between runs.
//!
//! Image encoders live in Python. Here an object is rendered, the command turns the views file into
//! an embeddings file, and the file is kept under a key of everything that it depends on.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime};

use semfm_geom::io::{MeshFile, read_json, write_json};
use semfm_geom::{MeshHash, ShapeCache, Task};
use semfm_views::Renderer;
use semfm_views::mcap::EmbeddingsFile;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use crate::files::read_embeddings;
use crate::rendered_views::{Coloring, ViewSettings, write_rendered_views};
use crate::{Error, Result};

/// Environment variable that names the program; else `semfm-embed` is looked for on the PATH.
pub const PROGRAM_VARIABLE: &str = "SEMFM_EMBED";

/// Which encoder makes the embeddings, and how.
#[derive(Clone, Debug)]
pub struct EncoderSettings {
    /// A Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or `package.module:Class`.
    /// A class of Python is known by its name alone: after a change of its code, `keep` false.
    pub model: String,
    /// Rotations of each view that are averaged: 1, 2 or 4.
    pub rolls: u32,
    /// Whether embeddings are kept in the user's cache, and used where they are there.
    pub keep: bool,
    /// Threads of the encoder; 0 leaves the number to it.
    pub threads: usize,
    /// Whether the encoder says nothing but errors.
    pub quiet: bool,
}

/// The command with the folder in which its embeddings are kept.
#[derive(Debug)]
pub struct EncoderCommand {
    settings: EncoderSettings,
    folder: PathBuf,
    /// The folder, where nothing is kept.
    _scratch: Option<TempDir>,
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
    model: &'a str,
    /// When a local model was written, since 1970; a name elsewhere stands for itself.
    written: Option<Duration>,
    rolls: u32,
    views: ViewSettings,
}

impl EncoderCommand {
    /// The command; embeddings are kept beside the prepared shapes in the user's cache
    /// ([`ShapeCache::of_user`]), or in a temporary folder.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`] where the folder cannot be made.
    pub fn new(settings: EncoderSettings) -> Result<Self> {
        let shapes = ShapeCache::of_user();
        let kept = shapes.folder().filter(|_| settings.keep);
        if let Some(folder) = kept.map(|shapes| shapes.with_file_name("embeddings")) {
            std::fs::create_dir_all(&folder).map_err(|source| io_error(&folder, source))?;
            return Ok(Self { settings, folder, _scratch: None });
        }
        let scratch = temporary_folder()?;
        Ok(Self { settings, folder: scratch.path().to_owned(), _scratch: Some(scratch) })
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
        // Whatever is wrong with a kept file, a new one is the cure.
        if let Ok(kept) = self.read(object, coloring) {
            return Ok(kept);
        }
        self.make(&[object], coloring, task)?;
        self.read(object, coloring)
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
        // Whatever is wrong with a kept file, a new one is the cure.
        let kept_source = self.read(source, coloring).ok();
        let kept_target = self.read(target, coloring).ok();
        let mut missing = Vec::new();
        if kept_source.is_none() {
            missing.push(source);
        }
        let is_same = self.kept_at(source, coloring) == self.kept_at(target, coloring);
        if kept_target.is_none() && !is_same {
            missing.push(target);
        }
        if !missing.is_empty() {
            self.make(&missing, coloring, task)?;
        }
        Ok(EncodedPair {
            source: kept_source.map_or_else(|| self.read(source, coloring), Ok)?,
            target: kept_target.map_or_else(|| self.read(target, coloring), Ok)?,
        })
    }

    /// What is kept of an object.
    fn read(&self, file: &MeshFile, coloring: Coloring) -> Result<EncodedObject> {
        let path = self.kept_at(file, coloring);
        let embeddings = read_embeddings(&path, &file.mesh)?;
        Ok(EncodedObject { embeddings, times: read_json(times_path(&path)).ok() })
    }

    /// Renders the objects and has them embedded, each into its place.
    fn make(&self, objects: &[&MeshFile], coloring: Coloring, task: &Task) -> Result<()> {
        let scratch = temporary_folder()?;
        let (mut rendered, mut views_ms) = (Vec::new(), Vec::new());
        for file in objects {
            let start = Instant::now();
            let path = self.kept_at(file, coloring);
            let name = path.file_name().unwrap_or_default();
            let views = scratch.path().join(name).with_extension("").with_extension("views.mcap");
            // By the CPU on every machine: what is kept must not depend on the driver that was there.
            write_rendered_views(&views, file, &shown(coloring), &Renderer::cpu(), task)?;
            views_ms.push(start.elapsed().as_secs_f64() * 1e3);
            rendered.push(views);
        }
        let start = Instant::now();
        self.run(&rendered)?;
        let embed_ms = start.elapsed().as_secs_f64() * 1e3 / objects.len() as f64;
        for (file, views_ms) in objects.iter().zip(views_ms) {
            // Embeddings without their times are as good.
            let times = EncodingTimes { views_ms, embed_ms };
            let _ = write_json(times_path(&self.kept_at(file, coloring)), &times);
        }
        Ok(())
    }

    /// Calls the program: `NAME.views.mcap` becomes `NAME.emb.mcap` in the folder.
    fn run(&self, views: &[PathBuf]) -> Result<()> {
        let program = std::env::var_os(PROGRAM_VARIABLE).unwrap_or_else(|| "semfm-embed".into());
        let EncoderSettings { model, rolls, threads, quiet, .. } = &self.settings;
        let mut arguments: Vec<OsString> = views.iter().map(OsString::from).collect();
        arguments.extend(["--output-folder".into(), OsString::from(&self.folder)]);
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
    fn kept_at(&self, file: &MeshFile, coloring: Coloring) -> PathBuf {
        let EncoderSettings { model, rolls, .. } = &self.settings;
        let colors = (coloring == Coloring::Own).then(|| file.appearance.content_hash());
        let written = std::fs::metadata(model).and_then(|about| about.modified()).ok();
        let key = CacheKey {
            mesh: file.mesh.hash(),
            colors,
            model,
            written: written.and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok()),
            rolls: *rolls,
            views: shown(coloring),
        };
        let key = blake3::hash(crate::files::to_json(&key).to_string().as_bytes());
        self.folder.join(format!("{}.emb.mcap", key.to_hex()))
    }
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
