//! Both objects of a transfer, ready to be matched, with features from wherever the caller has them.

use std::path::{Path, PathBuf};

use semfm_geom::Task;
use semfm_geom::io::MeshFile;

use crate::files::{read_embeddings, read_vertex_features};
use crate::object_encoder::{EncodedPair, ObjectEncoder};
use crate::{Error, FeatureSource, PipelineSettings, Prepared, Result, prepare};

/// Where the features of a pair come from.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum PairFeatures {
    /// None: the geometry alone, for the method `wks`.
    Geometry,
    /// One feature vector per vertex (`.npy`) for each.
    PerVertex(PairFiles),
    /// Embeddings files of views of each.
    Embeddings(PairFiles),
    /// An encoder, with the folder in which it keeps what it made.
    Encoder(ObjectEncoder),
}

/// A file of each object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairFiles {
    /// Of the demonstrated object.
    pub source: PathBuf,
    /// Of the object to act on.
    pub target: PathBuf,
}

/// A mesh with the name of its file, for messages.
#[derive(Clone, Debug)]
pub struct NamedMesh<'a> {
    /// The file.
    pub path: &'a Path,
    /// What it holds.
    pub file: MeshFile,
}

/// Both objects, ready to be matched.
#[derive(Clone, Debug)]
pub struct PreparedPair {
    /// The demonstrated object.
    pub source: Prepared,
    /// The object to act on.
    pub target: Prepared,
    /// What was found or assumed, in words.
    pub notes: Vec<String>,
}

/// Prepares both objects, side by side.
///
/// # Errors
/// Those of [`prepare`], of [`read_embeddings`], [`read_vertex_features`] and [`ObjectEncoder::embed_pair`], with the file
/// that they are about; [`Error::Invalid`] for embeddings that were given the wrong way round.
pub fn prepare_pair(
    source: NamedMesh<'_>,
    target: NamedMesh<'_>,
    features: &PairFeatures,
    settings: &PipelineSettings,
    task: &Task,
) -> Result<PreparedPair> {
    let mut notes = Vec::new();
    let ready = |mesh: NamedMesh<'_>, features: FeatureSource<'_>| {
        prepare(mesh.file.mesh, features, settings, task).map_err(|error| of_file(mesh.path, error))
    };
    let (source, target) = match features {
        PairFeatures::Geometry => rayon::join(
            || ready(source, FeatureSource::Geometry),
            || ready(target, FeatureSource::Geometry),
        ),
        PairFeatures::PerVertex(files) => {
            let a = read_vertex_features(&files.source, &source.file.mesh)?;
            let b = read_vertex_features(&files.target, &target.file.mesh)?;
            rayon::join(
                || ready(source, FeatureSource::PerVertex(&a)),
                || ready(target, FeatureSource::PerVertex(&b)),
            )
        }
        PairFeatures::Embeddings(files) => {
            let [a, b] = embeddings_of_both(files, &source.file, &target.file)?;
            rayon::join(
                || ready(source, FeatureSource::from(&a)),
                || ready(target, FeatureSource::from(&b)),
            )
        }
        PairFeatures::Encoder(encoder) => {
            let EncodedPair { source: a, target: b } =
                encoder.embed_pair(&source.file, &target.file, task)?;
            notes.extend(encoder.why_not_kept());
            let of = |mesh: NamedMesh<'_>, encoded: crate::object_encoder::EncodedObject| {
                let prepared = encoded.prepare(mesh.file.mesh, settings, task);
                prepared.map_err(|error| of_file(mesh.path, error))
            };
            rayon::join(|| of(source, a), || of(target, b))
        }
    };
    Ok(PreparedPair { source: source?, target: target?, notes })
}

/// Embeddings of both objects; those that were given the wrong way round are named as such.
fn embeddings_of_both(
    files: &PairFiles,
    source: &MeshFile,
    target: &MeshFile,
) -> Result<[semfm_views::mcap::EmbeddingsFile; 2]> {
    let PairFiles { source: a, target: b } = files;
    let read =
        read_embeddings(a, &source.mesh).and_then(|a| Ok([a, read_embeddings(b, &target.mesh)?]));
    if let Err(Error::Views(semfm_views::Error::OtherMesh { .. })) = &read {
        let are_swapped =
            read_embeddings(a, &target.mesh).is_ok() && read_embeddings(b, &source.mesh).is_ok();
        if are_swapped {
            let found = format!(
                "them swapped: {} is of the target and {} of the source",
                a.display(),
                b.display()
            );
            let expected = "those of the source, then those of the target (exchange them)";
            return Err(Error::invalid("embeddings", expected, found));
        }
    }
    read
}

/// An error about a mesh, with its file.
fn of_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Geom(cause) if !matches!(cause, semfm_geom::Error::Cancelled) => {
            let (path, cause) = (path.to_owned(), Box::new(cause));
            Error::Geom(semfm_geom::Error::InFile { path, cause })
        }
        other => other,
    }
}
