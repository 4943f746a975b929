//! Procedural objects of the six categories, with the simulated encoder's features.

use std::collections::BTreeMap;

use semfm::Region;
use semfm::geom::io::{Appearance, MeshFile};
use semfm_synth::{Category, Level, ObjectSettings, make_object};
use serde_json::json;

use super::{
    Dataset, DatasetOrigin, Group, LabelledObject, ObjectEntry, ObjectSource, ordered_pairs,
};
use crate::{Error, Result};

/// Which procedural objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntheticSettings {
    /// How hard the features are.
    pub level: Level,
    /// Seeds; pairs are formed within each.
    pub seeds: Vec<u64>,
    /// Objects of each category and seed, at least 2. There are six kinds, which take turns.
    pub n_objects: usize,
}

impl Default for SyntheticSettings {
    fn default() -> Self {
        Self { level: Level::Medium, seeds: vec![0, 1], n_objects: 4 }
    }
}

/// All ordered pairs within each category and seed; one group for each category.
///
/// # Errors
/// [`Error::Invalid`] for no seeds, repeated ones, or fewer than two objects.
pub fn make(settings: &SyntheticSettings) -> Result<Dataset> {
    let SyntheticSettings { level, seeds, n_objects } = settings;
    let mut distinct = seeds.clone();
    distinct.sort_unstable();
    distinct.dedup();
    if seeds.is_empty() || distinct.len() < seeds.len() {
        return Err(Error::invalid("seeds", "distinct numbers", format!("{seeds:?}")));
    }
    if *n_objects < 2 {
        let expected = "at least 2, so that there is a pair";
        return Err(Error::invalid("objects per category", expected, n_objects.to_string()));
    }
    let (mut objects, mut groups) = (Vec::new(), Vec::new());
    for category in Category::ALL {
        let mut pairs = Vec::new();
        for &seed in seeds {
            let members: Vec<usize> = (objects.len()..objects.len() + n_objects).collect();
            objects.extend((0..*n_objects).map(|instance| ObjectEntry {
                name: format!("{category}_{instance}_s{seed}"),
                category: category.to_string(),
                source: ObjectSource::Procedural { category, instance, seed, level: *level },
            }));
            pairs.extend(ordered_pairs(&members));
        }
        groups.push(Group { name: category.to_string(), pairs });
    }
    let origin = DatasetOrigin::Synthetic {
        level: level.to_string(),
        seeds: seeds.clone(),
        n_objects: *n_objects,
    };
    // The generator is part of the program, and a journal names the program.
    let made_by = json!([origin, env!("CARGO_PKG_VERSION")]).to_string();
    let hash = format!("blake3:{}", blake3::hash(made_by.as_bytes()).to_hex());
    Ok(Dataset { notes: Vec::new(), origin, hash, objects, groups })
}

pub(super) fn load(category: Category, instance: usize, seed: u64) -> Result<LabelledObject> {
    let settings = ObjectSettings { seed, ..ObjectSettings::default() };
    let object = make_object(category, instance, &settings)?;
    let mut parts = BTreeMap::<String, Vec<u32>>::new();
    for (vertex, &part) in (0..).zip(&object.parts) {
        let name = object.part_names[usize::from(part)];
        parts.entry(name.to_owned()).or_default().push(vertex);
    }
    Ok(LabelledObject {
        file: MeshFile {
            mesh: object.mesh.clone(),
            n_faces: object.mesh.n_faces(),
            appearance: Appearance::default(),
            format: "obj".parse()?, // what it would be written as
        },
        truth: Region::from_mask(&object.region),
        parts,
        procedural: Some(object),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_stay_within_category_and_seed() {
        let dataset =
            make(&SyntheticSettings { seeds: vec![3, 5], n_objects: 3, ..Default::default() })
                .unwrap();
        assert_eq!((dataset.objects.len(), dataset.n_pairs()), (36, 72));
        for group in &dataset.groups {
            for pair in &group.pairs {
                let (a, b) = (&dataset.objects[pair.source], &dataset.objects[pair.target]);
                assert_eq!((&a.category, &b.category), (&group.name, &group.name));
                let [x, y] = [a, b].map(|object| object.name.rsplit('s').next());
                assert!(a.name != b.name && x == y, "{} {}", a.name, b.name);
            }
        }
        let again = Dataset::open(&dataset.origin).unwrap();
        assert_eq!((again.hash, again.objects), (dataset.hash, dataset.objects));
    }

    #[test]
    fn impossible_sets_are_refused() {
        for (seeds, n_objects) in [(vec![], 3), (vec![1, 1], 3), (vec![1], 1)] {
            assert!(make(&SyntheticSettings { seeds, n_objects, ..Default::default() }).is_err());
        }
    }

    #[test]
    fn parts_cover_each_vertex_once_and_the_grip_is_not_empty() {
        let object = load(Category::Containers, 0, 0).unwrap();
        let mut ids: Vec<u32> = object.parts.values().flatten().copied().collect();
        ids.sort_unstable();
        assert_eq!(ids, (0..object.mesh().n_vertices() as u32).collect::<Vec<_>>());
        assert!(!object.truth.is_empty());
    }
}
