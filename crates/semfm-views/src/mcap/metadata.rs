//! The metadata record `semfm`: of which mesh a file was made, and how.
//!
//! Keys of views: `format` (`semfm.views/1`), `mesh_hash`, `n_vertices`, `n_triangles`, `n_views`,
//! `width`, `height`, `rig`, `background`, `seed`. An embeddings file keeps them, with `format`
//! `semfm.embeddings/1`, and adds `encoder`, `revision`, `preprocessing`, `rolls`, `outliers`, and
//! `simulated` (`true`) where no network was asked. Other keys are kept as they are.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use semfm_geom::{Mesh, MeshHash};

use crate::{Error, Result};

/// Name of the metadata record in which our files describe themselves.
pub const METADATA_NAME: &str = "semfm";

/// Which mesh a file was made of, as read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshIdentity {
    /// Hash of positions and triangles.
    pub hash: MeshHash,
    /// Number of vertices.
    pub n_vertices: usize,
    /// Number of triangles.
    pub n_triangles: usize,
}

impl MeshIdentity {
    /// The identity of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        Self { hash: mesh.hash(), n_vertices: mesh.n_vertices(), n_triangles: mesh.n_faces() }
    }

    /// Refuses another mesh than this one; `path` is the file that names this one.
    ///
    /// # Errors
    /// [`Error::OtherMesh`], naming both.
    pub fn check(&self, mesh: &Mesh, path: &Path) -> Result<()> {
        let found = Self::of(mesh);
        if *self == found {
            return Ok(());
        }
        let (expected, found) = (self.to_string(), found.to_string());
        Err(Error::OtherMesh { path: path.to_path_buf(), expected, found })
    }
}

impl fmt::Display for MeshIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({} vertices, {} triangles)", self.hash, self.n_vertices, self.n_triangles)
    }
}

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

    /// The record's entries for a file of `n_views` views.
    pub fn entries(&self, n_views: usize) -> BTreeMap<String, String> {
        let own = [
            ("format", VIEWS_FORMAT.to_owned()),
            ("mesh_hash", self.mesh.hash.to_string()),
            ("n_vertices", self.mesh.n_vertices.to_string()),
            ("n_triangles", self.mesh.n_triangles.to_string()),
            ("n_views", n_views.to_string()),
            ("width", self.width.to_string()),
            ("height", self.height.to_string()),
            ("rig", self.rig.clone()),
            ("background", self.background.clone()),
            ("seed", self.seed.to_string()),
        ];
        let mut entries = self.more.clone();
        entries.extend(own.map(|(key, value)| (key.to_owned(), value)));
        entries
    }

    /// Reads the record of a views file; also the number of views that it names.
    pub(super) fn read(
        path: &Path,
        records: &[(String, BTreeMap<String, String>)],
    ) -> Result<(Self, usize)> {
        let mut entries = Entries::find(path, records)?;
        entries.format(VIEWS_FORMAT)?;
        let (mut metadata, n_views) = Self::take(&mut entries)?;
        metadata.more = entries.left;
        Ok((metadata, n_views))
    }

    fn take(entries: &mut Entries<'_>) -> Result<(Self, usize)> {
        let hash = entries.take("mesh_hash")?;
        let hash = MeshHash::parse(&hash).ok_or_else(|| {
            entries.error("mesh_hash", "`blake3:` and 64 hexadecimal digits", &hash)
        })?;
        let mesh = MeshIdentity {
            hash,
            n_vertices: entries.number("n_vertices")?,
            n_triangles: entries.number("n_triangles")?,
        };
        let metadata = Self {
            mesh,
            width: entries.number("width")?,
            height: entries.number("height")?,
            rig: entries.take_or_empty("rig"),
            background: entries.take_or_empty("background"),
            seed: match entries.left.contains_key("seed") {
                true => entries.number("seed")?,
                false => 0,
            },
            more: BTreeMap::new(),
        };
        Ok((metadata, entries.number("n_views")?))
    }
}

impl EmbeddingsMetadata {
    /// The record's entries for a file of `n_views` views.
    pub fn entries(&self, n_views: usize) -> BTreeMap<String, String> {
        let mut entries = self.views.entries(n_views);
        let own = [
            ("format", EMBEDDINGS_FORMAT.to_owned()),
            ("encoder", self.encoder.clone()),
            ("revision", self.revision.clone()),
            ("preprocessing", self.preprocessing.clone()),
            ("rolls", self.rolls.to_string()),
            ("outliers", self.outliers.clone()),
        ];
        entries.extend(own.map(|(key, value)| (key.to_owned(), value)));
        if self.simulated {
            entries.insert("simulated".to_owned(), "true".to_owned());
        }
        entries
    }

    /// Reads the record of an embeddings file; also the number of views that it names.
    pub(super) fn read(
        path: &Path,
        records: &[(String, BTreeMap<String, String>)],
    ) -> Result<(Self, usize)> {
        let mut entries = Entries::find(path, records)?;
        entries.format(EMBEDDINGS_FORMAT)?;
        let (views, n_views) = ViewsMetadata::take(&mut entries)?;
        let mut metadata = Self {
            views,
            encoder: entries.take("encoder")?,
            revision: entries.take_or_empty("revision"),
            preprocessing: entries.take_or_empty("preprocessing"),
            rolls: entries.number("rolls")?,
            outliers: entries.take_or_empty("outliers"),
            simulated: entries.take_or_empty("simulated") == "true",
        };
        metadata.views.more = entries.left;
        Ok((metadata, n_views))
    }
}

/// Entries of the record that are not read yet.
struct Entries<'a> {
    path: &'a Path,
    left: BTreeMap<String, String>,
}

impl<'a> Entries<'a> {
    fn find(path: &'a Path, records: &[(String, BTreeMap<String, String>)]) -> Result<Self> {
        let mut ours = records.iter().filter(|(name, _)| name == METADATA_NAME);
        let found = match (ours.next(), ours.next()) {
            (Some((_, entries)), None) => return Ok(Self { path, left: entries.clone() }),
            (None, _) => "none",
            _ => "more than one",
        };
        Err(Error::Format {
            path: path.to_path_buf(),
            place: "metadata".to_owned(),
            expected: format!("one record named `{METADATA_NAME}`"),
            found: found.to_owned(),
        })
    }

    fn error(&self, key: &str, expected: &str, found: &str) -> Error {
        Error::Format {
            path: self.path.to_path_buf(),
            place: format!("metadata record `{METADATA_NAME}`, key `{key}`"),
            expected: expected.to_owned(),
            found: found.to_owned(),
        }
    }

    fn format(&mut self, expected: &str) -> Result<()> {
        match self.take("format")? {
            found if found == expected => Ok(()),
            found => Err(self.error("format", expected, &found)),
        }
    }

    fn take(&mut self, key: &str) -> Result<String> {
        self.left.remove(key).ok_or_else(|| self.error(key, "a value", "nothing"))
    }

    fn take_or_empty(&mut self, key: &str) -> String {
        self.left.remove(key).unwrap_or_default()
    }

    fn number<T: std::str::FromStr>(&mut self, key: &str) -> Result<T> {
        let text = self.take(key)?;
        text.parse().map_err(|_| self.error(key, "a whole number", &text))
    }
}
