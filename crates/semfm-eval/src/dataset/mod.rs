//! What is evaluated: objects with a true region, and the ordered pairs among them.

pub mod folder;
pub mod synthetic;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use semfm::geom::io::MeshFile;
use semfm::{Mesh, Region};
use semfm_synth::{Category, Level, SynthObject};
use serde::{Deserialize, Serialize};

use crate::Result;

/// Objects, and groups of ordered pairs among them.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// What was passed over, and why.
    pub notes: Vec<String>,
    /// Where it came from; enough to open it again.
    pub origin: DatasetOrigin,
    /// Hash of everything that a score depends on but the features: meshes, labels, pairs.
    pub hash: String,
    /// The objects that pairs name.
    pub objects: Vec<ObjectEntry>,
    /// The groups, in the order of the tables.
    pub groups: Vec<Group>,
}

/// Where a dataset came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum DatasetOrigin {
    /// A folder of meshes with labels.
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// Procedural objects with a simulated encoder.
    Synthetic {
        /// How hard the features are.
        level: String,
        /// Seeds of the objects.
        seeds: Vec<u64>,
        /// Objects of each category and seed.
        n_objects: usize,
    },
}

impl fmt::Display for DatasetOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder { path } => write!(f, "folder {}", path.display()),
            Self::Synthetic { level, seeds, n_objects } => {
                write!(f, "procedural objects, level {level}, seeds {seeds:?}, {n_objects} each")
            }
        }
    }
}

/// Pairs that are summed up together.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Its name in the tables.
    pub name: String,
    /// Ordered pairs.
    pub pairs: Vec<Pair>,
}

/// Two objects, by their places in [`Dataset::objects`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pair {
    /// The object with the demonstrated region.
    pub source: usize,
    /// The object that the region is transferred to.
    pub target: usize,
}

impl Pair {
    /// Source and target.
    pub(crate) fn both(&self) -> [usize; 2] {
        [self.source, self.target]
    }
}

/// One object by name.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectEntry {
    /// Its name, unique in its category.
    pub name: String,
    /// Its category: the folder, or that of the generator.
    pub category: String,
    /// How to get it.
    pub source: ObjectSource,
}

/// How to get an object.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ObjectSource {
    /// From its files.
    Files {
        /// The mesh.
        mesh: PathBuf,
        /// Its true region and parts, JSON.
        label: PathBuf,
    },
    /// From the generator.
    Procedural {
        /// Which.
        category: Category,
        /// Number within the category.
        instance: usize,
        /// Seed.
        seed: u64,
        /// How hard its features are.
        level: Level,
    },
}

/// An object in memory: mesh, true region, and named parts where there are any.
#[derive(Clone, Debug)]
pub struct LabelledObject {
    /// The mesh, with its colours.
    pub file: MeshFile,
    /// Where one acts on it.
    pub truth: Region,
    /// Vertices of each part; empty where nobody named parts.
    pub parts: BTreeMap<String, Vec<u32>>,
    /// What the generator knows, for the simulated encoder.
    pub procedural: Option<SynthObject>,
}

impl LabelledObject {
    /// The mesh as read.
    pub fn mesh(&self) -> &Mesh {
        &self.file.mesh
    }
}

impl Dataset {
    /// The files of the objects: meshes and labels.
    pub fn files(&self) -> Vec<&Path> {
        let mut files = Vec::new();
        for object in &self.objects {
            if let ObjectSource::Files { mesh, label } = &object.source {
                files.extend([mesh.as_path(), label.as_path()]);
            }
        }
        files
    }

    /// Opens again what results were made of. The objects may have changed since:
    /// compare [`Dataset::hash`].
    ///
    /// # Errors
    /// [`crate::Error::Io`], [`crate::Error::Format`] for a folder; [`crate::Error::Invalid`] for
    /// impossible procedural objects.
    pub fn open(origin: &DatasetOrigin) -> Result<Self> {
        match origin {
            DatasetOrigin::Folder { path } => folder::open(path),
            DatasetOrigin::Synthetic { level, seeds, n_objects } => {
                let settings = synthetic::SyntheticSettings {
                    level: level.parse::<Level>()?,
                    seeds: seeds.clone(),
                    n_objects: *n_objects,
                };
                synthetic::make(&settings)
            }
        }
    }

    /// Number of pairs in all groups.
    pub fn n_pairs(&self) -> usize {
        self.groups.iter().map(|group| group.pairs.len()).sum()
    }

    /// The place of an object.
    pub fn find(&self, category: &str, name: &str) -> Option<usize> {
        self.objects.iter().position(|o| o.category == category && o.name == name)
    }
}

impl ObjectEntry {
    /// Reads or makes the object.
    ///
    /// # Errors
    /// [`crate::Error::Facade`] for mesh and region, [`crate::Error::Io`] and
    /// [`crate::Error::Format`] for parts, [`crate::Error::Synth`] for a procedural object.
    pub fn load(&self) -> Result<LabelledObject> {
        match &self.source {
            ObjectSource::Files { mesh, label } => folder::load(mesh, label),
            ObjectSource::Procedural { category, instance, seed, .. } => {
                synthetic::load(*category, *instance, *seed)
            }
        }
    }
}

/// All ordered pairs of distinct places among `members`.
pub(crate) fn ordered_pairs(members: &[usize]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for &source in members {
        pairs.extend(members.iter().map(|&target| Pair { source, target }));
    }
    pairs.retain(|pair| pair.source != pair.target);
    pairs
}
