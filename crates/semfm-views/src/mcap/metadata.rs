//! The metadata record `semfm`: of which mesh a file was made, and how.
//!
//! Keys of views: `format` (`semfm.views/1`), `mesh_hash`, `n_vertices`, `n_triangles`, `n_views`,
//! `width`, `height`, `rig`, `background`, `seed`. An embeddings file keeps them, with `format`
//! `semfm.embeddings/1`, and adds `encoder`, `revision`, `preprocessing`, `rolls`, `outliers`, and
//! `simulated` (`true`) where no network was asked. Other keys are kept as they are.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::FormatError;
use semfm_geom::{Mesh, MeshHash, MeshIdentity};
use serde::de::Error as _;
use serde::{Deserialize, Serialize};

use super::contents::MetadataRecord;
use super::entries::{Entries, EntryError, from_entries, to_entries};
use crate::{Error, Result};

/// Name of the metadata record in which our files describe themselves.
pub const METADATA_NAME: &str = "semfm";

/// What a file of views says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsMetadata {
    /// The mesh that was rendered.
    pub mesh: MeshIdentity,
    /// Width of each picture in pixels.
    pub width: u32,
    /// Height of each picture in pixels.
    pub height: u32,
    /// How the cameras were placed, in words or as settings.
    pub rig: String,
    /// What stands behind the object.
    pub background: String,
    /// Seed of whatever was drawn by chance.
    pub seed: u64,
    /// Further entries, kept as they are.
    pub more: BTreeMap<String, String>,
}

/// What a file of embeddings says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddingsMetadata {
    /// What the views that were encoded said of themselves.
    pub views: ViewsMetadata,
    /// Name of the encoder.
    pub encoder: String,
    /// Its revision, or the hash of its file.
    pub revision: String,
    /// How a picture was made into the encoder's input.
    pub preprocessing: String,
    /// Number of rotations of each picture that were averaged.
    pub rolls: u32,
    /// What was done with outlier tokens.
    pub outliers: String,
    /// True where the embeddings were made up, without a network.
    pub simulated: bool,
}

const VIEWS_FORMAT: &str = "semfm.views/1";
const EMBEDDINGS_FORMAT: &str = "semfm.embeddings/1";

/// The keys of views as they stand in the record.
#[derive(Serialize, Deserialize)]
struct ViewsRecord {
    format: String,
    mesh_hash: MeshHash,
    n_vertices: u64,
    n_triangles: u64,
    n_views: u64,
    width: u32,
    height: u32,
    #[serde(default)]
    rig: String,
    #[serde(default)]
    background: String,
    #[serde(default)]
    seed: u64,
    #[serde(flatten)]
    more: Entries,
}

/// The keys that an embeddings file adds.
#[derive(Serialize, Deserialize)]
struct EmbeddingsRecord {
    encoder: String,
    #[serde(default)]
    revision: String,
    #[serde(default)]
    preprocessing: String,
    rolls: u32,
    #[serde(default)]
    outliers: String,
    #[serde(default, skip_serializing_if = "is_false")]
    simulated: bool,
    /// The keys of [`ViewsRecord`].
    #[serde(flatten)]
    views: Entries,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands out a reference")]
fn is_false(truth: &bool) -> bool {
    !truth
}

impl ViewsMetadata {
    /// Metadata for views of `mesh`; the rest is for the caller to fill.
    pub fn of(mesh: &Mesh, width: u32, height: u32) -> Self {
        Self {
            mesh: MeshIdentity::of(mesh),
            width,
            height,
            rig: String::new(),
            background: String::new(),
            seed: 0,
            more: BTreeMap::new(),
        }
    }

    /// Refuses another mesh than the one that the file `path` was made of.
    ///
    /// # Errors
    /// [`Error::OtherMesh`], naming both.
    pub fn check_mesh(&self, mesh: &Mesh, path: &Path) -> Result<()> {
        self.mesh.check(mesh).map_err(|_| Error::OtherMesh {
            path: path.to_path_buf(),
            expected: self.mesh.to_string(),
            found: MeshIdentity::of(mesh).to_string(),
        })
    }

    /// The record's entries for a file of `n_views` views.
    pub fn entries(&self, n_views: usize) -> BTreeMap<String, String> {
        let record = ViewsRecord {
            format: VIEWS_FORMAT.to_owned(),
            mesh_hash: self.mesh.hash,
            n_vertices: self.mesh.n_vertices as u64,
            n_triangles: self.mesh.n_triangles as u64,
            n_views: n_views as u64,
            width: self.width,
            height: self.height,
            rig: self.rig.clone(),
            background: self.background.clone(),
            seed: self.seed,
            more: Entries::new(),
        };
        let mut entries = self.more.clone();
        entries.extend(to_entries(&record));
        entries
    }

    /// Reads the record of a views file; also the number of views that it names.
    pub(super) fn read(path: &Path, records: &[MetadataRecord]) -> Result<(Self, usize)> {
        let entries = own_record(path, records, VIEWS_FORMAT)?;
        Self::of_record(from_entries(entries).map_err(|error| at_fault(path, error))?, path)
    }

    fn of_record(record: ViewsRecord, path: &Path) -> Result<(Self, usize)> {
        let mesh = MeshIdentity {
            hash: record.mesh_hash,
            n_vertices: count(path, "n_vertices", record.n_vertices)?,
            n_triangles: count(path, "n_triangles", record.n_triangles)?,
        };
        let n_views = count(path, "n_views", record.n_views)?;
        let ViewsRecord { width, height, rig, background, seed, more, .. } = record;
        Ok((Self { mesh, width, height, rig, background, seed, more }, n_views))
    }
}

impl EmbeddingsMetadata {
    /// The record's entries for a file of `n_views` views.
    pub fn entries(&self, n_views: usize) -> BTreeMap<String, String> {
        let record = EmbeddingsRecord {
            encoder: self.encoder.clone(),
            revision: self.revision.clone(),
            preprocessing: self.preprocessing.clone(),
            rolls: self.rolls,
            outliers: self.outliers.clone(),
            simulated: self.simulated,
            views: Entries::new(),
        };
        let mut entries = self.views.entries(n_views);
        entries.extend(to_entries(&record));
        entries.insert("format".to_owned(), EMBEDDINGS_FORMAT.to_owned());
        entries
    }

    /// Reads the record of an embeddings file; also the number of views that it names.
    pub(super) fn read(path: &Path, records: &[MetadataRecord]) -> Result<(Self, usize)> {
        let entries = own_record(path, records, EMBEDDINGS_FORMAT)?;
        let record: EmbeddingsRecord =
            from_entries(entries).map_err(|error| at_fault(path, error))?;
        let views = from_entries(&record.views).map_err(|error| at_fault(path, error))?;
        let (views, n_views) = ViewsMetadata::of_record(views, path)?;
        let EmbeddingsRecord {
            encoder, revision, preprocessing, rolls, outliers, simulated, ..
        } = record;
        let metadata = Self { views, encoder, revision, preprocessing, rolls, outliers, simulated };
        Ok((metadata, n_views))
    }
}

/// The one record of ours in a file, which must be of the given format.
fn own_record<'r>(path: &Path, records: &'r [MetadataRecord], format: &str) -> Result<&'r Entries> {
    let mut ours = records.iter().filter(|record| record.name == METADATA_NAME);
    let entries = match (ours.next(), ours.next()) {
        (Some(record), None) => &record.entries,
        (first, _) => {
            let expected = format!("one record named `{METADATA_NAME}`");
            let found = if first.is_none() { "none" } else { "more than one" };
            return Err(FormatError::new(path, "metadata", expected, found).into());
        }
    };
    let (key, expected) = ("format".to_owned(), format.to_owned());
    match entries.get("format") {
        Some(found) if found == format => Ok(entries),
        Some(found) => Err(at_fault(path, EntryError { key, expected, found: found.clone() })),
        None => Err(at_fault(path, EntryError::missing_field("format"))),
    }
}

fn at_fault(path: &Path, error: EntryError) -> Error {
    let EntryError { key, expected, found } = error;
    let place = format!("metadata record `{METADATA_NAME}`, key `{key}`");
    FormatError::new(path, place, expected, found).into()
}

fn count(path: &Path, key: &str, n: u64) -> Result<usize> {
    usize::try_from(n).map_err(|_| {
        let expected = format!("at most {}", usize::MAX);
        at_fault(path, EntryError { key: key.to_owned(), expected, found: n.to_string() })
    })
}
