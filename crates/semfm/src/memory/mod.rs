//! A memory of demonstrations: objects with a region each, in one folder.
//!
//! One demonstration shows one mug. [`Memory`] keeps many, of any kinds: [`Memory::remember`] adds one,
//! [`Memory::transfer`] looks up those that a new object resembles most, carries the region of each to it,
//! and fuses the answers ([`semfm_fmap::fusion`]) into one region with one confidence.
//!
//! On disk a memory is a folder: `memory.json` ([`MemoryFile`]) names the entries, and the folder `entries`
//! holds for each its mesh (`mesh.ply`), its embeddings (`embeddings.emb.mcap`) and its region
//! (`region.json`). What `memory.json` does not name does not exist: an entry's files are complete before it
//! is named, so a process that is killed leaves the memory as it was. All features of a memory are by one
//! encoder, since features by several cannot be compared.

mod entry_objects;
mod remember;
mod shortlist;
mod transfer;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm_geom::io::FormatError;

use crate::files::{EntryRecord, MemoryEncoder, MemoryFile};
use crate::{Error, PipelineSettings, Result};

pub use remember::Demonstration;
pub use shortlist::{Candidate, shortlist};
pub use transfer::{EntryAnswer, MemorySettings, MemoryTransfer};

use entry_objects::EntryObjects;

/// The file that names the entries.
const INDEX: &str = "memory.json";
/// The folder of the entries' folders.
const ENTRIES: &str = "entries";
/// The files of an entry.
const MESH: &str = "mesh.ply";
const REGION: &str = "region.json";
const EMBEDDINGS: &str = "embeddings.emb.mcap";

/// Demonstrations in a folder. Prepared objects are kept while the value or a clone of it lives; clones share them, and
/// do not hear of each other's changes.
#[derive(Clone)]
pub struct Memory {
    folder: PathBuf,
    file: MemoryFile,
    settings: PipelineSettings,
    objects: Arc<EntryObjects>,
}

impl Memory {
    /// Opens a memory that is there.
    ///
    /// # Errors
    /// [`Error::Format`] for a folder that is none and for a `memory.json` whose
    /// entries do not belong together; [`Error::Geom`] where it cannot be read.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        let index = folder.join(INDEX);
        if !index.exists() {
            let expected = "a memory: a folder with memory.json, which `semfm-cli remember` makes";
            let found = match (folder.is_dir(), folder.exists()) {
                (true, _) => "a folder without one",
                (false, true) => "a file",
                (false, false) => "nothing there",
            };
            return Err(FormatError::new(folder, "memory", expected, found).into());
        }
        Ok(Self::of(folder, MemoryFile::read(&index)?))
    }

    /// Opens a memory, or begins one where the folder is empty or not there. Nothing is written before the
    /// first entry.
    ///
    /// # Errors
    /// As [`Memory::open`], and for a folder that holds other things.
    pub fn open_or_begin(folder: impl AsRef<Path>) -> Result<Self> {
        let folder = folder.as_ref();
        let is_free = match std::fs::read_dir(folder) {
            Ok(mut entries) => entries.all(|entry| entry.is_ok_and(|entry| is_ours(&entry))),
            Err(error) => error.kind() == std::io::ErrorKind::NotFound,
        };
        match folder.join(INDEX).exists() || !is_free {
            true => Self::open(folder),
            false => Ok(Self::of(folder, MemoryFile::empty())),
        }
    }

    fn of(folder: &Path, file: MemoryFile) -> Self {
        let settings = PipelineSettings::default();
        Self { folder: folder.to_owned(), file, settings, objects: Arc::default() }
    }

    /// How objects are prepared and matched; by default as [`PipelineSettings::default`] says, without a cache.
    #[must_use]
    pub fn with_settings(self, settings: PipelineSettings) -> Self {
        Self { settings, objects: Arc::default(), ..self }
    }

    /// How objects are prepared and matched.
    pub fn settings(&self) -> &PipelineSettings {
        &self.settings
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The entries, by name.
    pub fn entries(&self) -> &[EntryRecord] {
        &self.file.entries
    }

    /// The encoder behind all features; none while the memory is empty.
    pub fn encoder(&self) -> Option<&MemoryEncoder> {
        self.file.encoder.as_ref()
    }

    /// The entry of this name.
    pub fn entry(&self, name: &str) -> Option<&EntryRecord> {
        self.file.entries.iter().find(|entry| entry.name == name)
    }

    /// Where the files of an entry are.
    fn entry_folder(&self, entry: &EntryRecord) -> PathBuf {
        self.folder.join(ENTRIES).join(&entry.folder)
    }

    /// Refuses features by another encoder than that of the entries. `whose` object they are of is named.
    fn check_encoder(&self, whose: &str, found: Option<&MemoryEncoder>) -> Result<()> {
        let Some(expected) = self.encoder() else { return Ok(()) };
        if found == Some(expected) {
            return Ok(());
        }
        let expected = format!("by {expected}, as all of {}", self.folder.display());
        let found = found.map_or("by an unknown encoder".into(), |found| format!("by {found}"));
        Err(Error::invalid(format!("features of {whose}"), expected, found))
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Memory")
            .field("folder", &self.folder)
            .field("n_entries", &self.file.entries.len())
            .field("encoder", &self.file.encoder)
            .finish_non_exhaustive()
    }
}

/// What a memory may leave in its folder before the first entry is named.
fn is_ours(entry: &std::fs::DirEntry) -> bool {
    let name = entry.file_name();
    let name = name.to_string_lossy();
    name == ENTRIES || name == remember::LOCK || name.starts_with(semfm_geom::io::TEMPORARY_PREFIX)
}

#[cfg(test)]
mod tests;
