//! A folder of real meshes: `<category>/<name>.obj` (or another format) beside `<name>.json`.
//!
//! The label holds `region.vertices` and perhaps `parts`, which name the vertices of each part. An
//! object without a label is a target that nobody scores, and a folder without labelled objects is
//! no category; both are left out. `pairs.json` at the root (group → \[\[source, target\], …\]) chooses
//! pairs; else each category's labelled objects form all ordered pairs.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use semfm::files::read_region;
use semfm::geom::io::{MeshFormat, TEMPORARY_PREFIX, read_file, read_json, read_mesh};
use serde::Deserialize;
use serde_json::json;

use super::{
    Dataset, DatasetOrigin, Group, LabelledObject, ObjectEntry, ObjectSource, Pair, ordered_pairs,
};
use crate::{Error, Result};

/// The file that chooses pairs.
const PAIRS: &str = "pairs.json";

/// Opens a folder: finds the labelled objects and the pairs, and hashes both.
///
/// # Errors
/// [`Error::Io`] for what cannot be read, [`Error::Format`] where `pairs.json` is not what it should
/// be or names an object without a label, or where the folder has no pair to score.
pub fn open(path: &Path) -> Result<Dataset> {
    let (mut objects, mut notes) = (Vec::new(), Vec::new());
    for folder in entries(path)?.into_iter().filter(|entry| entry.is_dir()) {
        let found = labelled(&folder)?;
        objects.extend(found.objects);
        notes.extend(found.notes);
    }
    let chosen = path.join(PAIRS);
    let groups =
        if chosen.is_file() { chosen_pairs(&chosen, &objects)? } else { all_pairs(&objects) };
    if groups.iter().all(|group| group.pairs.is_empty()) {
        let expected = "at least two labelled objects in a category (NAME.obj beside NAME.json)";
        let found = format!("{} labelled objects and no pair", objects.len());
        return Err(Error::format(path, "folder", expected, found));
    }
    let (objects, groups) = only_used(objects, groups);
    let hash = hash(&objects, &groups)?;
    let origin = DatasetOrigin::Folder { path: path.to_owned() };
    Ok(Dataset { notes, origin, hash, objects, groups })
}

/// Mesh, region and parts of one object.
pub(super) fn load(mesh: &Path, label: &Path) -> Result<LabelledObject> {
    let file = read_mesh(mesh)?;
    let truth = read_region(label, &file.mesh)?;
    let parts = read_parts(label, file.mesh.n_vertices())?;
    Ok(LabelledObject { file, truth, parts, procedural: None })
}

fn read_parts(label: &Path, n_vertices: usize) -> Result<BTreeMap<String, Vec<u32>>> {
    #[derive(Deserialize)]
    struct Label {
        #[serde(default)]
        parts: BTreeMap<String, Vec<u32>>,
    }
    let Label { parts } = read_json(label)?;
    for (name, ids) in &parts {
        if let Some(at) = ids.iter().position(|&id| id as usize >= n_vertices) {
            let expected = format!("ids below {n_vertices}, the mesh's vertex count");
            let place = format!("parts.{name}[{at}]");
            return Err(Error::format(label, place, expected, ids[at].to_string()));
        }
    }
    Ok(parts)
}

/// Files and folders in a folder, sorted by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = std::fs::read_dir(folder)
        .and_then(|entries| {
            entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()
        })
        .map_err(Error::io(folder))?;
    let is_temporary = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().starts_with(TEMPORARY_PREFIX)
    };
    paths.retain(|path| !is_temporary(path));
    paths.sort();
    Ok(paths)
}

/// What a category folder holds.
struct Category {
    objects: Vec<ObjectEntry>,
    notes: Vec<String>,
}

/// The objects of a category folder that have a label.
fn labelled(folder: &Path) -> Result<Category> {
    let category =
        folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut objects: Vec<ObjectEntry> = Vec::new();
    let mut notes = Vec::new();
    for mesh in entries(folder)? {
        let label = mesh.with_extension("json");
        let Some(name) = mesh.file_stem().map(|stem| stem.to_string_lossy().into_owned()) else {
            continue;
        };
        let is_mesh = mesh.is_file() && MeshFormat::from_path(&mesh).is_some();
        if !is_mesh || !label.is_file() {
            continue;
        }
        // One object in two formats counts once. Sorted, they need not be neighbours.
        let known = objects.iter().find(|known| known.name == name);
        if let Some(ObjectSource::Files { mesh: used, .. }) = known.map(|known| &known.source) {
            notes.push(format!(
                "{} is passed over: {} has the same name and the same label",
                mesh.display(),
                used.display()
            ));
            continue;
        }
        let source = ObjectSource::Files { mesh, label };
        objects.push(ObjectEntry { name, category: category.clone(), source });
    }
    Ok(Category { objects, notes })
}

fn all_pairs(objects: &[ObjectEntry]) -> Vec<Group> {
    let mut members = BTreeMap::<&str, Vec<usize>>::new();
    for (place, object) in objects.iter().enumerate() {
        members.entry(&object.category).or_default().push(place);
    }
    members
        .into_iter()
        .map(|(name, members)| Group { name: name.to_owned(), pairs: ordered_pairs(&members) })
        .filter(|group| !group.pairs.is_empty())
        .collect()
}

fn chosen_pairs(path: &Path, objects: &[ObjectEntry]) -> Result<Vec<Group>> {
    // group → [[source, target], …]
    let listed: BTreeMap<String, Vec<[String; 2]>> = read_json(path)?;
    let names = NamedPlaces::new(objects);
    let mut groups = Vec::new();
    for (name, listed) in listed {
        let mut pairs = Vec::new();
        for [source, target] in &listed {
            let pair = Pair {
                source: names.find(path, &name, source)?,
                target: names.find(path, &name, target)?,
            };
            if pair.source == pair.target {
                let found = format!("{source} with itself");
                return Err(Error::format(path, &name, "two different objects", found));
            }
            pairs.push(pair);
        }
        groups.push(Group { name, pairs });
    }
    Ok(groups)
}

/// Places of objects by NAME and by CATEGORY/NAME.
struct NamedPlaces(HashMap<String, Vec<usize>>);

impl NamedPlaces {
    fn new(objects: &[ObjectEntry]) -> Self {
        let mut places = HashMap::<String, Vec<usize>>::new();
        for (place, object) in objects.iter().enumerate() {
            places.entry(object.name.clone()).or_default().push(place);
            places.insert(format!("{}/{}", object.category, object.name), vec![place]);
        }
        Self(places)
    }

    /// The object that `group` in the file `path` names.
    fn find(&self, path: &Path, group: &str, name: &str) -> Result<usize> {
        match self.0.get(name).map(Vec::as_slice) {
            Some([place]) => Ok(*place),
            Some(_) => {
                let expected = "CATEGORY/NAME, for several categories have this name";
                Err(Error::format(path, group, expected, name))
            }
            None => Err(Error::format(path, group, "the name of a labelled object", name)),
        }
    }
}

/// Leaves out objects that no pair names, and numbers the rest anew.
fn only_used(objects: Vec<ObjectEntry>, mut groups: Vec<Group>) -> (Vec<ObjectEntry>, Vec<Group>) {
    let used: BTreeSet<usize> =
        groups.iter().flat_map(|group| &group.pairs).flat_map(Pair::both).collect();
    let new_place: BTreeMap<usize, usize> = used.iter().copied().zip(0..).collect();
    let objects = objects.into_iter().enumerate();
    let kept = objects.filter(|(place, _)| used.contains(place)).map(|(_, object)| object);
    for pair in groups.iter_mut().flat_map(|group| &mut group.pairs) {
        pair.source = new_place[&pair.source];
        pair.target = new_place[&pair.target];
    }
    (kept.collect(), groups)
}

/// Names, contents of meshes and labels, and pairs.
fn hash(objects: &[ObjectEntry], groups: &[Group]) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    for object in objects {
        hasher.update(json!([object.category, object.name]).to_string().as_bytes());
        if let ObjectSource::Files { mesh, label } = &object.source {
            for path in [mesh, label] {
                let bytes = read_file(path)?;
                hasher.update(blake3::hash(&bytes).as_bytes());
            }
        }
    }
    for group in groups {
        let pairs: Vec<[usize; 2]> = group.pairs.iter().map(Pair::both).collect();
        hasher.update(json!([group.name, pairs]).to_string().as_bytes());
    }
    Ok(format!("blake3:{}", hasher.finalize().to_hex()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm::Mesh;
    use semfm::geom::io::write_mesh;
    use semfm::geom::math::DVec3;

    fn put(folder: &Path, category: &str, name: &str, label: Option<&str>) {
        let folder = folder.join(category);
        std::fs::create_dir_all(&folder).unwrap();
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let mesh = Mesh::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
        write_mesh(folder.join(format!("{name}.obj")), &mesh).unwrap();
        if let Some(label) = label {
            std::fs::write(folder.join(format!("{name}.json")), label).unwrap();
        }
    }

    const LABEL: &str =
        r#"{"region": {"vertices": [1, 2]}, "parts": {"grip": [1, 2], "rest": [0, 3]}}"#;

    fn three_cups() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a", "b", "c"] {
            put(folder.path(), "cups", name, Some(LABEL));
        }
        put(folder.path(), "cups", "unlabelled", None);
        put(folder.path(), "coloured", "a", None);
        folder
    }

    #[test]
    fn all_ordered_pairs_of_a_category_unless_pairs_are_chosen() {
        let folder = three_cups();
        let dataset = open(folder.path()).unwrap();
        assert_eq!((dataset.objects.len(), dataset.groups.len(), dataset.n_pairs()), (3, 1, 6));
        let object = dataset.objects[0].load().unwrap();
        assert_eq!(object.truth.vertices(), [1, 2]);
        assert_eq!(object.parts["rest"], [0, 3]);

        let chosen = r#"{"mugs": [["b", "cups/c"]], "again": [["c", "b"]]}"#;
        std::fs::write(folder.path().join(PAIRS), chosen).unwrap();
        let fewer = open(folder.path()).unwrap();
        let names: Vec<&str> = fewer.objects.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(names, ["b", "c"]);
        let pair = Pair { source: 0, target: 1 };
        assert_eq!((&*fewer.groups[1].name, &fewer.groups[1].pairs[..]), ("mugs", &[pair][..]));
        assert_ne!(dataset.hash, fewer.hash);
    }

    #[test]
    fn two_meshes_of_one_name_are_one_object_and_the_other_is_named() {
        let folder = three_cups();
        assert!(open(folder.path()).unwrap().notes.is_empty());
        let cups = folder.path().join("cups");
        std::fs::copy(cups.join("b.obj"), cups.join("b-2.obj")).unwrap();
        std::fs::rename(cups.join("b-2.obj"), cups.join("b.ply.obj")).unwrap();
        write_mesh(cups.join("b.ply"), &read_mesh(cups.join("b.obj")).unwrap().mesh).unwrap();
        std::fs::write(cups.join(".semfm-b.obj.1-0-0.tmp"), "half a mesh").unwrap();
        std::fs::create_dir(folder.path().join(".semfm-out.1-0-0.tmp")).unwrap();
        let dataset = open(folder.path()).unwrap();
        assert_eq!((dataset.objects.len(), dataset.notes.len()), (3, 1), "{:?}", dataset.notes);
        assert!(dataset.notes[0].contains("b.ply") && dataset.notes[0].contains("b.obj"));
    }

    #[test]
    fn the_hash_knows_the_labels() {
        let folder = three_cups();
        let before = open(folder.path()).unwrap().hash;
        assert_eq!(before, open(folder.path()).unwrap().hash);
        put(folder.path(), "cups", "b", Some(r#"{"region": {"vertices": [1]}}"#));
        assert_ne!(before, open(folder.path()).unwrap().hash);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let folder = three_cups();
        for (pairs, word) in [
            (r#"{"mugs": [["a", "nobody"]]}"#, "nobody"),
            (r#"{"mugs": [["a", "a"]]}"#, "itself"),
            (r#"{"mugs": ["a"]}"#, "line 1"),
            (r#"{"mugs": []}"#, "no pair"),
        ] {
            std::fs::write(folder.path().join(PAIRS), pairs).unwrap();
            let error = open(folder.path()).unwrap_err().to_string();
            assert!(error.contains(word), "{pairs}: {error}");
        }
        std::fs::remove_file(folder.path().join(PAIRS)).unwrap();
        put(folder.path(), "cups", "a", Some(r#"{"vertices": [1], "parts": {"grip": [4]}}"#));
        let error = open(folder.path()).unwrap().objects[0].load().unwrap_err().to_string();
        assert!(error.contains("parts.grip[0]"), "{error}");
        assert!(open(&folder.path().join("nowhere")).is_err());
    }
}
