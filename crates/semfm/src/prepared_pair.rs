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

/// Embeddings of both objects, averaged over as many rotations; those that were given the wrong way round are named as such.
///
/// # Errors
/// Those of [`read_embeddings`]; [`Error::Invalid`] for files that were given the wrong way round, and for files that average
/// over different numbers of rotations: their features are not comparable.
pub fn embeddings_of_both(
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
    let [a, b] = read?;
    let (source_rolls, target_rolls) = (a.metadata.rolls, b.metadata.rolls);
    if source_rolls != target_rolls {
        let expected = "the same number of rotations (rolls) in both files";
        let found = format!("{source_rolls} of the source and {target_rolls} of the target");
        return Err(Error::invalid("embeddings", expected, found));
    }
    Ok([a, b])
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

#[cfg(test)]
mod tests {
    use semfm_encoder::builtin_encoder;
    use semfm_encoder::rendered_views::Coloring;
    use semfm_geom::io::{read_mesh, write_mesh};
    use semfm_geom::{ShapeCache, zoo};
    use semfm_views::mcap::Dtype;

    use super::*;

    #[test]
    fn embeddings_of_other_rotations_do_not_match() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ball.ply");
        write_mesh(&path, &zoo::icosphere(2)).unwrap();
        let mesh = read_mesh(&path).unwrap();
        let encoder = ObjectEncoder::new(builtin_encoder().unwrap(), &ShapeCache::off());
        let of = |rolls: u32| {
            let at = folder.path().join(format!("{rolls}.emb.mcap"));
            let encoder = encoder.clone().with_rolls(rolls);
            let made = encoder.embed(&mesh, Coloring::Grey, &Task::default()).unwrap();
            made.embeddings.write(&at, Dtype::F32).unwrap();
            at
        };
        let (once, twice) = (of(1), of(2));
        let same = PairFiles { source: once.clone(), target: once.clone() };
        assert!(embeddings_of_both(&same, &mesh, &mesh).is_ok());
        let files = PairFiles { source: once, target: twice };
        let error = embeddings_of_both(&files, &mesh, &mesh).unwrap_err().to_string();
        assert!(error.contains("1 of the source and 2 of the target"), "{error}");
    }
}
