//! Adding demonstrations to a memory, and taking them away.

use std::fs::{self, File};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use semfm_fmap::likeness::PlainFeatures;
use semfm_geom::io::{StagedFolder, write_mesh};
use semfm_geom::suggestion::unknown_name;
use semfm_geom::{Mesh, MeshIdentity, Task};
use semfm_views::mcap::{Dtype, EmbeddingsFile};

use super::{EMBEDDINGS, ENTRIES, INDEX, MESH, Memory, REGION};
use crate::files::{EntryProvenance, EntryRecord, MemoryEncoder, MemoryFile, write_region};
use crate::{EncoderRecord, Error, FeatureSource, Region, Result, prepare};

/// Held by whoever changes a memory.
pub(super) const LOCK: &str = "memory.lock";

/// Longest name of an entry, in bytes.
const LONGEST_NAME: usize = 200;

/// A demonstration to remember.
#[derive(Clone, Debug)]
pub struct Demonstration<'a> {
    /// Its name in the memory: printable, without line breaks.
    pub name: String,
    /// What kind of object it is, in the owner's words; entries can be chosen by it.
    pub kind: Option<String>,
    /// The object.
    pub mesh: &'a Mesh,
    /// Where one acts on it.
    pub region: &'a Region,
    /// What an encoder made of its views.
    pub embeddings: &'a EmbeddingsFile,
    /// The file that the mesh was read from, where there was one.
    pub mesh_file: Option<String>,
    /// The file that the region was read from, where there was one.
    pub region_file: Option<String>,
}

impl Memory {
    /// Adds a demonstration; with `replace`, in place of the one of that name and of any with the same mesh
    /// and region. It is prepared once, so that its shape is in the cache of [`Memory::settings`] when it is asked.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a name that is taken or impossible, a mesh and region that are there already, a
    /// region that is empty or of another mesh, and features by another encoder than those of the other
    /// entries; [`Error::Views`] for embeddings of another mesh; [`Error::Geom`] for files that cannot be
    /// written. The memory then is as it was.
    pub fn remember(
        &mut self,
        demonstration: &Demonstration<'_>,
        replace: bool,
        task: &Task,
    ) -> Result<&EntryRecord> {
        let Demonstration { mesh, region, embeddings, .. } = *demonstration;
        demonstration.check()?;
        let encoder = MemoryEncoder::of(&EncoderRecord::of_file(embeddings), embeddings.dim());
        self.check_encoder(&demonstration.name, Some(&encoder))?;
        self.check_new(demonstration, replace)?;
        let prepared =
            prepare(mesh.clone(), FeatureSource::from(embeddings), &self.settings, task)?;
        let plain = PlainFeatures::new(prepared.object.cloud());
        let entry = demonstration.record(plain.descriptor());

        fs::create_dir_all(&self.folder).map_err(|error| io(&self.folder, error))?;
        let _alone = lock(&self.folder)?;
        // Somebody else may have added entries since.
        self.read_again()?;
        self.check_encoder(&demonstration.name, Some(&encoder))?;
        self.check_new(demonstration, replace)?;
        let staged = StagedFolder::new(self.entry_folder(&entry))?;
        write_mesh(staged.path().join(MESH), mesh)?;
        write_region(&staged.path().join(REGION), region, mesh)?;
        embeddings.write(&staged.path().join(EMBEDDINGS), Dtype::F32)?;
        staged.put(&[], &[])?;

        let mut file = self.file.clone();
        file.encoder = Some(encoder);
        file.entries.retain(|old| !entry.stands_for(old));
        let place = file.entries.partition_point(|old| old.name < entry.name);
        file.entries.insert(place, entry);
        self.put(file)?;
        Ok(&self.file.entries[place])
    }

    /// Takes a demonstration away.
    ///
    /// # Errors
    /// [`Error::Invalid`] where no entry has the name, [`Error::Geom`] where the folder cannot be written.
    pub fn forget(&mut self, name: &str) -> Result<()> {
        let missing = |memory: &Self| {
            let names = memory.file.entries.iter().map(|entry| entry.name.as_str());
            Error::invalid("name", "that of an entry of the memory", unknown_name(name, names))
        };
        if self.entry(name).is_none() {
            return Err(missing(self));
        }
        let _alone = lock(&self.folder)?;
        self.read_again()?;
        let mut file = self.file.clone();
        file.entries.retain(|entry| entry.name != name);
        if file.entries.len() == self.file.entries.len() {
            return Err(missing(self));
        }
        if file.entries.is_empty() {
            file.encoder = None;
        }
        self.put(file)
    }

    /// Writes the new list, which is when the change happens, and removes the files of what it does not name.
    fn put(&mut self, file: MemoryFile) -> Result<()> {
        file.write(&self.folder.join(INDEX))?;
        self.file = file;
        self.remove_unnamed();
        Ok(())
    }

    /// Removes what replaced entries and killed processes left. Only folders that are named as ours are, and
    /// trouble with it is no error: nobody reads them.
    fn remove_unnamed(&self) {
        let folders = fs::read_dir(self.folder.join(ENTRIES)).into_iter().flatten().flatten();
        for folder in folders {
            let name = folder.file_name().to_string_lossy().into_owned();
            let is_named = self.file.entries.iter().any(|entry| entry.folder == name);
            let is_hash = name.len() == 16 && name.bytes().all(|digit| digit.is_ascii_hexdigit());
            if is_hash && !is_named {
                let _ = fs::remove_dir_all(folder.path());
            }
        }
    }

    fn read_again(&mut self) -> Result<()> {
        let index = self.folder.join(INDEX);
        if index.exists() {
            self.file = MemoryFile::read(&index)?;
        }
        Ok(())
    }

    /// Refuses what is there already, unless it is to be replaced.
    fn check_new(&self, demonstration: &Demonstration<'_>, replace: bool) -> Result<()> {
        if replace {
            return Ok(());
        }
        let name = &demonstration.name;
        if self.entry(name).is_some() {
            let expected = "a name that is not taken; --replace replaces the entry";
            return Err(Error::invalid(
                "name",
                expected,
                format!("{name:?}, which is there already"),
            ));
        }
        let (hash, region_hash) = (demonstration.mesh.hash(), hash_of(demonstration.region));
        let mut entries = self.file.entries.iter();
        match entries.find(|entry| entry.mesh.hash == hash && entry.region_hash == region_hash) {
            Some(same) => {
                let expected = "a demonstration that is not there yet; --replace renames the entry";
                let found = format!("the mesh and region of {:?}", same.name);
                Err(Error::invalid(format!("demonstration {name:?}"), expected, found))
            }
            None => Ok(()),
        }
    }
}

impl Demonstration<'_> {
    fn check(&self) -> Result<()> {
        let name = self.name.trim();
        let is_plain = !name.is_empty() && name == self.name && name.len() <= LONGEST_NAME;
        if !is_plain || name.chars().any(char::is_control) {
            let expected =
                format!("1 to {LONGEST_NAME} bytes, printable, without spaces at its ends");
            return Err(Error::invalid("name", expected, format!("{:?}", self.name)));
        }
        let n_vertices = self.mesh.n_vertices();
        if self.region.n_vertices() != n_vertices {
            let expected = format!("{n_vertices} weights, one per vertex of the mesh");
            return Err(Error::invalid("region", expected, self.region.n_vertices().to_string()));
        }
        if self.region.is_empty() {
            return Err(semfm_fmap::Error::EmptyRegion { n_vertices }.into());
        }
        Ok(self.embeddings.check_mesh(self.mesh)?)
    }

    fn record(&self, descriptor: &[f32]) -> EntryRecord {
        let region_hash = hash_of(self.region);
        let mesh = MeshIdentity::of(self.mesh);
        // Of everything that the files of the entry hold: the same content in the same place.
        let mut content = blake3::Hasher::new();
        for part in [&self.name, &mesh.hash.to_string(), &region_hash] {
            content.update(part.as_bytes()).update(&[0]);
        }
        let about = &self.embeddings.metadata;
        content.update(format!("{} {} {}", about.encoder, about.revision, about.rolls).as_bytes());
        for x in descriptor {
            content.update(&x.to_le_bytes());
        }
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH);
        EntryRecord {
            name: self.name.clone(),
            kind: self.kind.clone(),
            folder: content.finalize().to_hex()[..16].to_owned(),
            mesh,
            n_region: self.region.vertices().len(),
            region_hash,
            descriptor: descriptor.iter().map(|x| (x * 1e5).round() / 1e5).collect(),
            provenance: EntryProvenance {
                mesh_file: self.mesh_file.clone(),
                region_file: self.region_file.clone(),
                added_seconds: seconds.map_or(0, |since| since.as_secs()),
                version: env!("CARGO_PKG_VERSION").into(),
            },
        }
    }
}

impl EntryRecord {
    /// Whether this entry replaces `old`: its name, or its mesh and region.
    fn stands_for(&self, old: &Self) -> bool {
        let same = self.mesh.hash == old.mesh.hash && self.region_hash == old.region_hash;
        self.name == old.name || same
    }
}

/// Hash of what a region file keeps of a region: the vertices that count and their weights.
fn hash_of(region: &Region) -> String {
    let mut hasher = blake3::Hasher::new();
    for vertex in region.vertices() {
        let weight = region.weights()[vertex as usize];
        hasher.update(&vertex.to_le_bytes()).update(&weight.to_le_bytes());
    }
    format!("blake3:{}", hasher.finalize().to_hex())
}

/// The lock of a memory, held until the file is dropped. On file systems without locks nobody waits.
fn lock(folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let file = File::options().create(true).append(true).open(&path);
    let file = file.map_err(|error| io(&path, error))?;
    let _ = file.lock();
    Ok(file)
}

fn io(path: &Path, source: std::io::Error) -> Error {
    semfm_geom::Error::Io { path: path.to_owned(), source }.into()
}
