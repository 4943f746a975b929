//! Where features come from: an encoder, files beside the meshes, or the simulated encoder.

use std::path::{Path, PathBuf};
use std::time::Instant;

use semfm::encoder::rendered_views::Coloring;
use semfm::geom::io::MeshFile;
use semfm::object_encoder::{EncodedObject, ObjectEncoder};
use semfm::views::EmbeddedView;
use semfm::views::mcap::EmbeddingsFile;
use semfm::{EncoderRecord, Method, Task};
use semfm_synth::{embed, render_views};

use crate::dataset::{Dataset, DatasetOrigin, LabelledObject, ObjectEntry, ObjectSource};
use crate::{Error, Result};

/// Embedded views of one object, and what making them took where that is known.
#[derive(Clone, Debug)]
pub struct Embedded {
    /// The views.
    pub views: Vec<EmbeddedView>,
    /// Who made them.
    pub encoder: EncoderRecord,
    /// Milliseconds for the pictures.
    pub views_ms: Option<f64>,
    /// Milliseconds for the encoder.
    pub embed_ms: Option<f64>,
}

/// Where an evaluation takes its features from.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum EmbeddingSource {
    /// Files: `NAME.emb.mcap` (and, for the published method, `NAME.r1.emb.mcap` with one roll where
    /// it is there) in a folder or in its subfolder CATEGORY; `None` for beside the meshes.
    Files(Option<PathBuf>),
    /// An encoder makes them. It is shown all objects in grey: colour on one side of a pair misleads.
    Encoder {
        /// The encoder.
        encoder: ObjectEncoder,
        /// Rotations for every method, in place of what the method and the encoder ask for.
        rolls: Option<u32>,
        /// Names it with the hash of its content: a run that was begun with other weights is another
        /// run.
        identity: String,
    },
    /// The generator's own, of procedural objects.
    Simulated,
}

impl EmbeddingSource {
    /// An encoder, whose files are hashed now.
    ///
    /// # Errors
    /// [`semfm::Error::Encoder`].
    pub fn of_encoder(encoder: ObjectEncoder, rolls: Option<u32>) -> semfm::Result<Self> {
        let name = encoder.encoder().identity();
        let hash = encoder.encoder().content_hash()?;
        let rolls_named = rolls.map_or_else(String::new, |rolls| format!(", {rolls} rolls"));
        let identity = if name.version.is_empty() {
            format!("encoder {name} {hash}{rolls_named}")
        } else {
            format!("encoder {name}{rolls_named}")
        };
        Ok(Self::Encoder { encoder, rolls, identity })
    }

    /// Why embeddings are not kept although they should be, in words.
    pub fn note(&self) -> Option<String> {
        match self {
            Self::Encoder { encoder, .. } => encoder.why_not_kept(),
            Self::Files(_) | Self::Simulated => None,
        }
    }

    /// Whether some object of the dataset has its embeddings beside its mesh.
    pub fn any_beside(dataset: &Dataset) -> bool {
        dataset.objects.iter().any(|entry| match &entry.source {
            ObjectSource::Files { mesh, .. } => {
                mesh.with_file_name(format!("{}.emb.mcap", entry.name)).is_file()
            }
            ObjectSource::Procedural { .. } => false,
        })
    }

    /// Names the features of a dataset: another name, other features.
    pub fn identity(&self, dataset: &Dataset) -> String {
        match (self, &dataset.origin) {
            (Self::Encoder { identity, .. }, _) => identity.clone(),
            (_, DatasetOrigin::Synthetic { level, .. }) => {
                format!("the simulated encoder ({level})")
            }
            (Self::Files(Some(folder)), _) => format!("files in {}", folder.display()),
            (Self::Files(None) | Self::Simulated, _) => "files beside the meshes".into(),
        }
    }

    /// The embedded views of an object for a method that asks for up to `rolls` rotations.
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
            (source, Self::Encoder { encoder, rolls: every, .. }) => {
                let wanted = encoder.encoder().wants();
                let rolls = every.unwrap_or_else(|| wanted.rolls_up_to(rolls));
                let encoder = encoder.clone().with_rolls(rolls);
                let place = match source {
                    ObjectSource::Files { mesh, .. } => mesh.clone(),
                    ObjectSource::Procedural { .. } => PathBuf::from(&entry.name),
                };
                encoded(&encoder, &object.file).map_err(|reason| {
                    let expected = "an encoder that answers";
                    Error::format(&place, "embeddings", expected, reason.to_string())
                })
            }
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
                let encoder = EncoderRecord {
                    name: format!("simulated/{level}"),
                    version: env!("CARGO_PKG_VERSION").into(),
                    rolls: 1,
                    n_views: views.len(),
                    simulated: true,
                };
                Ok(Embedded { views, encoder, views_ms, embed_ms })
            }
            (ObjectSource::Files { mesh, .. }, Self::Files(folder)) => {
                read(entry, object, mesh, folder.as_deref(), rolls)
            }
            (ObjectSource::Files { mesh, .. }, Self::Simulated) => {
                read(entry, object, mesh, None, rolls)
            }
        }
    }
}

fn encoded(encoder: &ObjectEncoder, file: &MeshFile) -> semfm::Result<Embedded> {
    let EncodedObject { embeddings, times, .. } =
        encoder.embed(file, Coloring::Grey, &Task::default())?;
    Ok(Embedded {
        encoder: EncoderRecord::of_file(&embeddings),
        views: embeddings.views,
        views_ms: times.map(|times| times.views_ms),
        embed_ms: times.map(|times| times.embed_ms),
    })
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
            "no embeddings: give --embeddings DIR or --encoder NAME, or put them beside the mesh",
        );
        return Err(Error::Io { path, source });
    };
    let file = EmbeddingsFile::read(&path)?;
    file.check_mesh(object.mesh())?;
    let encoder = EncoderRecord::of_file(&file);
    Ok(Embedded { views: file.views, encoder, views_ms: None, embed_ms: None })
}
