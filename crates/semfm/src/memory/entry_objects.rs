//! The objects of a memory's entries, prepared when they are first asked for.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use semfm_geom::Task;
use semfm_geom::io::{FormatError, read_mesh};

use super::{EMBEDDINGS, MESH, REGION};
use crate::files::{EntryRecord, read_embeddings, read_region};
use crate::{FeatureSource, PipelineSettings, Prepared, Region, Result, prepare};

/// Objects that are kept. A prepared one takes some twenty megabytes; what falls out is prepared again, its
/// shape from the cache.
const MOST_KEPT: usize = 64;

/// The object of an entry and its region.
#[derive(Debug)]
pub(super) struct EntryObject {
    pub prepared: Prepared,
    pub region: Region,
}

/// The objects that were asked for lately, by the folders of their entries, the latest last.
#[derive(Default)]
pub(super) struct EntryObjects {
    kept: Mutex<Vec<(String, Arc<EntryObject>)>>,
}

impl EntryObjects {
    /// The object of an entry whose files are in `folder`.
    ///
    /// # Errors
    /// [`Error::Format`](crate::Error::Format) for files that are not of this entry, and those of reading
    /// and preparing them.
    pub fn object(
        &self,
        entry: &EntryRecord,
        folder: &Path,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Arc<EntryObject>> {
        if let Some(object) = self.take_up(&entry.folder) {
            return Ok(object);
        }
        // Not under the lock: several are prepared at once.
        let object = Arc::new(EntryObject::read(entry, folder, settings, task)?);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push((entry.folder.clone(), Arc::clone(&object)));
        let n_over = kept.len().saturating_sub(MOST_KEPT);
        kept.drain(..n_over);
        Ok(object)
    }

    /// The object that is kept under this name, which is now the latest.
    fn take_up(&self, name: &str) -> Option<Arc<EntryObject>> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|(of, _)| of == name)?;
        let found = kept.remove(place);
        let object = Arc::clone(&found.1);
        kept.push(found);
        Some(object)
    }
}

impl EntryObject {
    fn read(
        entry: &EntryRecord,
        folder: &Path,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Self> {
        let path = folder.join(MESH);
        let mesh = read_mesh(&path)?.mesh;
        if mesh.hash() != entry.mesh.hash {
            let expected = format!("the mesh {} of entry {:?}", entry.mesh.hash, entry.name);
            return Err(FormatError::new(path, "mesh", expected, mesh.hash().to_string()).into());
        }
        let region = read_region(&folder.join(REGION), &mesh)?;
        let embeddings = read_embeddings(&folder.join(EMBEDDINGS), &mesh)?;
        let prepared = prepare(mesh, FeatureSource::from(&embeddings), settings, task)?;
        Ok(Self { prepared, region })
    }
}
