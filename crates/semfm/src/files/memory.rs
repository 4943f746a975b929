//! `memory.json`: which demonstrations a memory holds. Format `semfm.memory/1`.

use std::collections::BTreeSet;
use std::path::Path;

use semfm_geom::MeshIdentity;
use semfm_geom::io::{FormatError, read_json};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{EncoderRecord, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.memory/1";

/// Digits of the name of an entry's folder.
const FOLDER_DIGITS: usize = 16;

/// The demonstrations of a memory, and whose features they have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemoryFile {
    /// `semfm.memory/1`.
    pub format: String,
    /// The encoder behind the features of every entry; none while there is no entry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<MemoryEncoder>,
    /// The demonstrations, by name.
    pub entries: Vec<EntryRecord>,
}

/// The encoder of a memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemoryEncoder {
    /// Its name.
    pub name: String,
    /// Version of its weights.
    pub version: String,
    /// Rotations of each view that were averaged.
    pub rolls: u32,
    /// Numbers of a feature.
    pub dim: usize,
}

/// One demonstration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EntryRecord {
    /// Its name, unique in the memory.
    pub name: String,
    /// What kind of object it is, as its owner calls it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
    /// Its folder in that of the entries: 16 hexadecimal digits, a hash of its content.
    pub folder: String,
    /// Its mesh.
    pub mesh: MeshIdentity,
    /// Vertices of the region.
    pub n_region: usize,
    /// Hash of the region's weights.
    pub region_hash: String,
    /// Mean feature of the surface at unit length, to five digits: what entries are looked up by.
    pub descriptor: Vec<f32>,
    /// Where it came from.
    pub provenance: EntryProvenance,
}

/// Where a demonstration came from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntryProvenance {
    /// The file of the mesh, where there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh_file: Option<String>,
    /// The file of the region, where there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region_file: Option<String>,
    /// When it was added, seconds since 1970 (UTC).
    pub added_seconds: u64,
    /// Version of the program that added it.
    pub version: String,
}

impl MemoryFile {
    /// The file of a memory without entries.
    pub fn empty() -> Self {
        Self { format: FORMAT.into(), encoder: None, entries: Vec::new() }
    }

    /// Its JSON.
    pub fn to_json(&self) -> Value {
        super::to_json(self)
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        // Not the `write_json` of these files, which refuses to replace what was read: a memory is changed in place.
        Ok(semfm_geom::io::write_json(path, &self.to_json())?)
    }

    /// Reads the file and checks that its entries belong together.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is not JSON;
    /// [`Error::Format`](crate::Error::Format) for another format, a name twice, an entry whose folder is
    /// no hash or whose descriptor has another dimension than the encoder.
    pub fn read(path: &Path) -> Result<Self> {
        let value: Value = read_json(path)?;
        let format = value.get("format").and_then(Value::as_str).unwrap_or("none");
        if format != FORMAT {
            return Err(FormatError::new(path, "format", FORMAT, format).into());
        }
        let file = Self::deserialize(&value).map_err(|error| {
            FormatError::new(
                path,
                "memory",
                "entries with name, mesh and folder",
                error.to_string(),
            )
        })?;
        file.check(path)?;
        Ok(file)
    }

    fn check(&self, path: &Path) -> Result<()> {
        let dim = self.encoder.as_ref().map(|encoder| encoder.dim);
        let mut names = BTreeSet::new();
        for (at, entry) in self.entries.iter().enumerate() {
            let fault = |field: &str, expected: String, found: String| {
                FormatError::new(path, format!("entries[{at}].{field}"), expected, found)
            };
            if !names.insert(&entry.name) {
                let expected = "each name once".into();
                return Err(fault("name", expected, format!("{:?} again", entry.name)).into());
            }
            let is_hash = |text: &str| text.bytes().all(|digit| digit.is_ascii_hexdigit());
            if entry.folder.len() != FOLDER_DIGITS || !is_hash(&entry.folder) {
                let expected = format!("{FOLDER_DIGITS} hexadecimal digits");
                return Err(fault("folder", expected, format!("{:?}", entry.folder)).into());
            }
            let Some(dim) = dim else {
                let expected = "none while the file names no encoder".into();
                return Err(fault("name", expected, format!("{:?}", entry.name)).into());
            };
            if entry.descriptor.len() != dim {
                let expected = format!("{dim} numbers, as many as a feature of the encoder has");
                return Err(
                    fault("descriptor", expected, entry.descriptor.len().to_string()).into()
                );
            }
        }
        Ok(())
    }
}

impl MemoryEncoder {
    /// Of features of `dim` numbers.
    pub fn of(record: &EncoderRecord, dim: usize) -> Self {
        let EncoderRecord { name, version, rolls, .. } = record.clone();
        Self { name, version, rolls, dim }
    }
}

impl std::fmt::Display for MemoryEncoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, version, rolls, dim } = self;
        write!(f, "{name} {version} ({rolls} rolls, dimension {dim})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    fn entry(name: &str, dim: usize) -> EntryRecord {
        EntryRecord {
            name: name.into(),
            kind: Some("mug".into()),
            folder: "0123456789abcdef".into(),
            mesh: MeshIdentity::of(&zoo::tetrahedron()),
            n_region: 2,
            region_hash: "blake3:0".into(),
            descriptor: vec![0.5; dim],
            provenance: EntryProvenance::default(),
        }
    }

    fn memory(entries: Vec<EntryRecord>) -> MemoryFile {
        let encoder =
            MemoryEncoder { name: "builtin".into(), version: "1".into(), rolls: 1, dim: 3 };
        MemoryFile { encoder: Some(encoder), entries, ..MemoryFile::empty() }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("memory.json");
        for file in [MemoryFile::empty(), memory(vec![entry("a", 3), entry("b", 3)])] {
            file.write(&path).unwrap();
            assert_eq!(MemoryFile::read(&path).unwrap(), file);
        }
    }

    #[test]
    fn entries_that_do_not_belong_together_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("memory.json");
        let outside = EntryRecord { folder: "../../../etc/x".into(), ..entry("b", 3) };
        for (file, place) in [
            (memory(vec![entry("a", 3), entry("a", 3)]), "entries[1].name"),
            (memory(vec![entry("a", 3), outside]), "entries[1].folder"),
            (memory(vec![entry("a", 4)]), "entries[0].descriptor"),
            (MemoryFile { encoder: None, ..memory(vec![entry("a", 3)]) }, "entries[0].name"),
            (MemoryFile { format: "semfm.memory/9".into(), ..memory(vec![]) }, "format"),
        ] {
            file.write(&path).unwrap();
            let error = MemoryFile::read(&path).unwrap_err();
            assert_eq!(error.place().as_deref(), Some(place), "{error}");
            assert!(error.to_string().contains("memory.json"), "{error}");
        }
    }
}
