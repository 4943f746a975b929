//! Where features come from: files beside the meshes, an encoder, or the simulated one.

use std::path::{Path, PathBuf};
use std::time::Instant;

use semfm::encoder_command::{EncodedObject, EncoderCommand, EncoderSettings};
use semfm::geom::io::MeshFile;
use semfm::rendered_views::Coloring;
use semfm::views::EmbeddedView;
use semfm::views::mcap::EmbeddingsFile;
use semfm::{Method, Task};
use semfm_synth::{embed, render_views};

use crate::dataset::{LabelledObject, ObjectEntry, ObjectSource};
use crate::{Error, Result};

/// Embedded views of one object, and what making them took where that is known.
#[derive(Clone, Debug)]
pub struct Embedded {
    /// The views.
    pub views: Vec<EmbeddedView>,
    /// Name of the encoder.
    pub encoder: String,
    /// Rotations of each picture that were averaged.
    pub rolls: u32,
    /// Milliseconds for the pictures.
    pub views_ms: Option<f64>,
    /// Milliseconds for the encoder.
    pub embed_ms: Option<f64>,
}

/// Makes embeddings of a mesh's default views.
pub trait Encoder: Sync {
    /// Embeddings of `file`, averaged over `rolls` rotations.
    ///
    /// # Errors
    /// Why the encoder has no embeddings, in words.
    fn embed(&self, file: &MeshFile, rolls: u32) -> std::result::Result<Embedded, String>;

    /// Names the encoder: another name, other features.
    fn identity(&self) -> String;
}

/// The command `semfm-embed` as an encoder.
#[derive(Clone, Debug)]
pub struct CommandEncoder {
    command: EncoderCommand,
    identity: String,
}

impl Encoder for CommandEncoder {
    fn embed(&self, file: &MeshFile, rolls: u32) -> std::result::Result<Embedded, String> {
        let encoded = self.encode(file, rolls).map_err(|error| error.to_string())?;
        let EncodedObject { embeddings, times } = encoded;
        Ok(Embedded {
            views: embeddings.views,
            encoder: embeddings.metadata.encoder,
            rolls: embeddings.metadata.rolls,
            views_ms: times.map(|times| times.views_ms),
            embed_ms: times.map(|times| times.embed_ms),
        })
    }

    fn identity(&self) -> String {
        self.identity.clone()
    }
}

impl CommandEncoder {
    /// The encoder `model` ([`EncoderSettings::model`], which see for the others, too). Its files are
    /// hashed now: a run that was begun with other weights is another run.
    ///
    /// # Errors
    /// [`semfm::Error::EncoderMissing`], [`semfm::Error::EncoderFailed`].
    pub fn new(model: String, keep: bool, threads: usize) -> semfm::Result<Self> {
        let rolls = Method::default().info().features.rolls;
        let settings = EncoderSettings { model, rolls, keep, threads, quiet: true };
        let model = settings.model.clone();
        let command = EncoderCommand::new(settings)?;
        let identity = format!("encoder {model} {}", command.content_hash()?);
        Ok(Self { command, identity })
    }

    /// As [`EncoderCommand::note`].
    pub fn note(&self) -> Option<String> {
        self.command.note()
    }

    fn encode(&self, file: &MeshFile, rolls: u32) -> semfm::Result<EncodedObject> {
        // All objects are shown in grey: colour on one side of a pair misleads.
        self.command.with_rolls(rolls).embed(file, Coloring::Grey, &Task::default())
    }
}

/// Where an evaluation takes its features from.
#[non_exhaustive]
pub enum EmbeddingSource<'a> {
    /// Files: `NAME.emb.mcap` (and, for the published method, `NAME.r1.emb.mcap` with one roll where
    /// it is there) in a folder or in its subfolder CATEGORY; `None` for beside the meshes.
    /// Procedural objects take the simulated encoder.
    Files(Option<PathBuf>),
    /// An encoder makes them.
    Encoder(&'a dyn Encoder),
}

impl EmbeddingSource<'_> {
    /// Names the features for the journal.
    pub fn identity(&self) -> String {
        match self {
            Self::Files(None) => "files beside the meshes".into(),
            Self::Files(Some(folder)) => format!("files in {}", folder.display()),
            Self::Encoder(encoder) => encoder.identity(),
        }
    }

    /// The embedded views of an object.
    ///
    /// # Errors
    /// [`Error::Io`] where there is no file, [`Error::Facade`] for one that cannot be read or is of
    /// another mesh, [`Error::Format`] with the encoder's reason, [`Error::Synth`].
    pub fn views(
        &self,
        entry: &ObjectEntry,
        object: &LabelledObject,
        rolls: u32,
        task: &Task,
    ) -> Result<Embedded> {
        match (&entry.source, self) {
            (ObjectSource::Procedural { level, .. }, _) => {
                let Some(procedural) = &object.procedural else {
                    return Err(Error::invalid("object", "a procedural one", &entry.name));
                };
                let start = Instant::now();
                let pictures = render_views(procedural, task)?;
                let views_ms = Some(start.elapsed().as_secs_f64() * 1e3);
                let start = Instant::now();
                let views = embed(procedural, &pictures, *level)?;
                let embed_ms = Some(start.elapsed().as_secs_f64() * 1e3);
                let encoder = format!("simulated/{level}");
                Ok(Embedded { views, encoder, rolls: 1, views_ms, embed_ms })
            }
            (ObjectSource::Files { mesh, .. }, Self::Files(folder)) => {
                read(entry, object, mesh, folder.as_deref(), rolls)
            }
            (ObjectSource::Files { mesh, .. }, Self::Encoder(encoder)) => {
                encoder.embed(&object.file, rolls).map_err(|reason| {
                    Error::format(mesh, "embeddings", "an encoder that answers", reason)
                })
            }
        }
    }
}

fn read(
    entry: &ObjectEntry,
    object: &LabelledObject,
    mesh: &Path,
    folder: Option<&Path>,
    rolls: u32,
) -> Result<Embedded> {
    let name = &entry.name;
    let folders = match folder {
        Some(folder) => vec![folder.join(&entry.category), folder.to_owned()],
        None => vec![mesh.with_file_name("")],
    };
    let usual_rolls = Method::default().info().features.rolls;
    let mut paths = Vec::new();
    if rolls != usual_rolls {
        let file = format!("{name}.r{rolls}.emb.mcap");
        paths.extend(folders.iter().map(|folder| folder.join(&file)));
    }
    paths.extend(folders.iter().map(|folder| folder.join(format!("{name}.emb.mcap"))));
    let Some(path) = paths.into_iter().find(|path| path.is_file()) else {
        let path = folders[folders.len() - 1].join(format!("{name}.emb.mcap"));
        let source = std::io::Error::new(
            std::io::ErrorKind::NotFound,
            "no embeddings: give --embeddings DIR or --encoder MODEL, or put them beside the mesh",
        );
        return Err(Error::Io { path, source });
    };
    let file = EmbeddingsFile::read(&path)?;
    file.check_mesh(object.mesh())?;
    Ok(Embedded {
        views: file.views,
        encoder: file.metadata.encoder,
        rolls: file.metadata.rolls,
        views_ms: None,
        embed_ms: None,
    })
}
