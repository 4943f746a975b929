use std::sync::OnceLock;

use semfm_encoder::builtin_encoder;
use semfm_encoder::rendered_views::Coloring;
use semfm_geom::math::DVec3;
use semfm_geom::zoo::icosphere;
use semfm_geom::{Mesh, ShapeCache, Task};
use semfm_views::mcap::EmbeddingsFile;

use super::*;
use crate::object_encoder::ObjectEncoder;
use crate::{FeatureSource, Prepared, Region, prepare};

/// A tool along x with its true grip, as the built-in encoder sees it.
struct Tool {
    mesh: Mesh,
    grip: Region,
    embeddings: EmbeddingsFile,
}

/// A ball whose one half is drawn out to a handle of this length, and whose other half is a flat head.
fn tool(handle: f64) -> Tool {
    let ball = icosphere(3);
    let stretched = |p: &DVec3| match p.x < 0.0 {
        true => DVec3::new(handle * p.x, 0.5 * p.y, 0.5 * p.z),
        false => DVec3::new(0.4 * p.x, 1.4 * p.y, 0.6 * p.z),
    };
    let mesh =
        Mesh::new(ball.vertices().iter().map(stretched).collect(), ball.faces().to_vec()).unwrap();
    let grip: Vec<bool> = ball.vertices().iter().map(|p| p.x < -0.2).collect();
    let encoder = ObjectEncoder::new(builtin_encoder().unwrap(), &ShapeCache::off());
    let embeddings = encoder.embed(&mesh, Coloring::Grey, &Task::default()).unwrap().embeddings;
    Tool { grip: Region::from_mask(&grip), mesh, embeddings }
}

/// Four tools, made once.
fn tools() -> &'static [Tool; 4] {
    static TOOLS: OnceLock<[Tool; 4]> = OnceLock::new();
    TOOLS.get_or_init(|| [2.0, 2.4, 2.8, 3.2].map(tool))
}

impl Tool {
    fn demonstration(&self, name: &str) -> Demonstration<'_> {
        Demonstration {
            name: name.into(),
            kind: Some("tool".into()),
            mesh: &self.mesh,
            region: &self.grip,
            embeddings: &self.embeddings,
            mesh_file: None,
            region_file: None,
        }
    }

    fn prepared(&self) -> Prepared {
        let features = FeatureSource::from(&self.embeddings);
        let (settings, task) = (PipelineSettings::default(), Task::default());
        prepare(self.mesh.clone(), features, &settings, &task).unwrap()
    }
}

fn memory_of(folder: &Path, tools: &[(&str, &Tool)]) -> Memory {
    let mut memory = Memory::open_or_begin(folder).unwrap();
    for (name, tool) in tools {
        memory.remember(&tool.demonstration(name), false, &Task::default()).unwrap();
    }
    memory
}

fn ask(memory: &Memory, target: &Prepared) -> MemoryTransfer {
    memory.transfer(target, &MemorySettings::default(), &Task::default()).unwrap()
}

fn iou(a: &Region, b: &Region) -> f64 {
    semfm_fmap::metrics::iou(a, b).unwrap()
}

#[test]
fn what_was_remembered_is_carried_to_a_new_object_in_whatever_order_it_was_added() {
    let [a, b, c, target] = tools();
    let folder = tempfile::tempdir().unwrap();
    let names = [("a", a), ("b", b), ("c", c)];
    let memory = memory_of(&folder.path().join("one"), &names);
    let backwards: Vec<(&str, &Tool)> = names.into_iter().rev().collect();
    let other = memory_of(&folder.path().join("other"), &backwards);
    let prepared = target.prepared();
    let (answer, same) = (ask(&memory, &prepared), ask(&other, &prepared));
    assert!(iou(&answer.fused.region, &target.grip) > 0.7);
    assert_eq!((answer.answers.len(), answer.n_entries), (3, 3));
    let shares: f64 = answer.answers.iter().map(|said| said.trust.share).sum();
    assert!((shares - 1.0).abs() < 1e-12);
    assert_eq!(answer.fused.region, same.fused.region);
    assert_eq!(answer.fused.confidence, same.fused.confidence);
    // Opened again, it is the same memory.
    let again = Memory::open(memory.folder()).unwrap();
    assert_eq!(again.entries(), memory.entries());
    assert_eq!(ask(&again, &prepared).fused.region, answer.fused.region);
}

#[test]
fn one_demonstration_answers_as_a_transfer_from_it_does() {
    let [a, _, _, target] = tools();
    let folder = tempfile::tempdir().unwrap();
    let memory = memory_of(folder.path(), &[("a", a)]);
    let prepared = target.prepared();
    let answer = ask(&memory, &prepared);
    let (settings, task) = (&memory.settings().transfer, Task::default());
    let source = a.prepared();
    let alone =
        semfm_fmap::transfer(&source.object, &prepared.object, &a.grip, settings, &task).unwrap();
    assert_eq!(answer.fused.region.mask(), alone.region.mask());
    assert_eq!(answer.fused.confidence, alone.confidence);
    assert_eq!(answer.answers[0].trust.agreement, None);
}

#[test]
fn a_bad_demonstration_does_not_ruin_the_answer() {
    let [a, b, c, target] = tools();
    let folder = tempfile::tempdir().unwrap();
    let mut memory = memory_of(folder.path(), &[("a", a), ("b", b)]);
    let prepared = target.prepared();
    let before = iou(&ask(&memory, &prepared).fused.region, &target.grip);
    let head: Vec<bool> = c.grip.mask().iter().map(|inside| !inside).collect();
    let (wrong, task) = (Region::from_mask(&head), Task::default());
    let demonstration = Demonstration { region: &wrong, ..c.demonstration("the wrong end") };
    memory.remember(&demonstration, false, &task).unwrap();
    let answer = ask(&memory, &prepared);
    let after = iou(&answer.fused.region, &target.grip);
    assert!(after > before - 0.05, "{before} became {after}");
    assert_eq!(answer.answers[2].entry.name, "the wrong end");
    assert!(answer.answers[2].trust.share < 0.2, "{:?}", answer.answers[2].trust);
}

#[test]
fn what_is_there_already_is_refused_unless_it_is_replaced() {
    let [a, b, ..] = tools();
    let (folder, task) = (tempfile::tempdir().unwrap(), Task::default());
    let mut memory = memory_of(folder.path(), &[("a", a)]);
    for (demonstration, reason) in [
        (b.demonstration("a"), "a name that is not taken"),
        (a.demonstration("again"), "the mesh and region of \"a\""),
        (b.demonstration(" b"), "without spaces at its ends"),
        (b.demonstration(""), "printable"),
        (
            Demonstration { region: &Region::from_mask(&[true; 3]), ..b.demonstration("b") },
            "weights",
        ),
        (Demonstration { embeddings: &a.embeddings, ..b.demonstration("b") }, "mesh"),
    ] {
        let error = memory.remember(&demonstration, false, &task).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
    let before = memory.entries().to_vec();
    memory.remember(&b.demonstration("a"), true, &task).unwrap();
    assert_eq!(memory.entries().len(), 1);
    assert_ne!(memory.entries()[0].mesh, before[0].mesh);
    // The files of what was replaced are gone.
    assert_eq!(std::fs::read_dir(folder.path().join(ENTRIES)).unwrap().count(), 1);
    memory.forget("a").unwrap();
    assert!(memory.entries().is_empty() && memory.encoder().is_none());
    assert!(memory.forget("a").unwrap_err().to_string().contains("an entry"));
}

#[test]
fn a_killed_remember_leaves_the_memory_as_it_was() {
    let [a, b, ..] = tools();
    let folder = tempfile::tempdir().unwrap();
    let memory = memory_of(folder.path(), &[("a", a)]);
    // The files of an entry that memory.json does not name yet, whole and in part.
    let own = memory.entry_folder(&memory.entries()[0]);
    let orphan = folder.path().join(ENTRIES).join("00112233445566ff");
    std::fs::create_dir_all(&orphan).unwrap();
    for name in [MESH, REGION] {
        std::fs::copy(own.join(name), orphan.join(name)).unwrap();
    }
    let mut again = Memory::open_or_begin(folder.path()).unwrap();
    assert_eq!(again.entries(), memory.entries());
    let target = b.prepared();
    assert_eq!(ask(&again, &target).fused.region, ask(&memory, &target).fused.region);
    again.remember(&b.demonstration("b"), false, &Task::default()).unwrap();
    assert!(!orphan.exists(), "what nobody names is cleaned up by the next one");
    assert_eq!(again.entries().len(), 2);
    // A folder in which the very first was killed is still free.
    let first = folder.path().join("first");
    std::fs::create_dir_all(first.join(ENTRIES).join("00112233445566ff")).unwrap();
    assert!(Memory::open_or_begin(&first).unwrap().entries().is_empty());
}

#[test]
fn features_by_several_encoders_are_refused() {
    let [a, b, ..] = tools();
    let (folder, task) = (tempfile::tempdir().unwrap(), Task::default());
    let mut memory = memory_of(folder.path(), &[("a", a)]);
    let mut embeddings = b.embeddings.clone();
    embeddings.metadata.encoder = "another".into();
    let other = Demonstration { embeddings: &embeddings, ..b.demonstration("b") };
    let error = memory.remember(&other, false, &task).unwrap_err().to_string();
    assert!(error.contains("another") && error.contains("builtin"), "{error}");
    let (settings, pipeline) = (MemorySettings::default(), PipelineSettings::default());
    let features = FeatureSource::from(&embeddings);
    let target = prepare(b.mesh.clone(), features, &pipeline, &task).unwrap();
    let error = memory.transfer(&target, &settings, &task).unwrap_err().to_string();
    assert!(error.contains("the target") && error.contains("another"), "{error}");
    let unknown = FeatureSource::Views(&b.embeddings.views);
    let target = prepare(b.mesh.clone(), unknown, &pipeline, &task).unwrap();
    let error = memory.transfer(&target, &settings, &task).unwrap_err().to_string();
    assert!(error.contains("an unknown encoder"), "{error}");
}

#[test]
fn an_empty_memory_and_what_is_none_say_what_to_do() {
    let [a, b, ..] = tools();
    let (folder, task) = (tempfile::tempdir().unwrap(), Task::default());
    let missing = folder.path().join("missing");
    let error = Memory::open(&missing).unwrap_err().to_string();
    assert!(error.contains("semfm-cli remember") && error.contains("nothing there"), "{error}");
    let empty = Memory::open_or_begin(&missing).unwrap();
    assert!(!missing.exists(), "nothing is written before the first entry");
    let settings = MemorySettings::default();
    let error = empty.transfer(&b.prepared(), &settings, &task).unwrap_err().to_string();
    assert!(error.contains("at least one demonstration"), "{error}");
    std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    let error = Memory::open_or_begin(folder.path()).unwrap_err().to_string();
    assert!(error.contains("a folder without one"), "{error}");

    let memory = memory_of(&folder.path().join("tools"), &[("a", a)]);
    let of = |settings: MemorySettings| {
        memory.transfer(&b.prepared(), &settings, &task).map(|answer| answer.answers.len())
    };
    let kind = |kind: &str| MemorySettings { kind: Some(kind.into()), ..settings.clone() };
    assert_eq!(of(kind("tool")).unwrap(), 1);
    let error = of(kind("mug")).unwrap_err().to_string();
    assert!(error.contains("(tool)") && error.contains("mug"), "{error}");
    assert!(of(MemorySettings { shortlist: 0, ..settings.clone() }).is_err());
}

#[test]
fn files_of_an_entry_that_are_not_its_own_are_named() {
    let [a, b, ..] = tools();
    let folder = tempfile::tempdir().unwrap();
    let memory = memory_of(folder.path(), &[("a", a), ("b", b)]);
    let [of_a, of_b] = ["a", "b"].map(|name| memory.entry_folder(memory.entry(name).unwrap()));
    std::fs::copy(of_b.join(MESH), of_a.join(MESH)).unwrap();
    let again = Memory::open(folder.path()).unwrap();
    let settings = MemorySettings::default();
    let error = again.transfer(&b.prepared(), &settings, &Task::default()).unwrap_err().to_string();
    assert!(error.contains(MESH) && error.contains("entry \"a\""), "{error}");
}

#[test]
fn the_kinds_of_a_memory_say_how_similar_its_kinds_are() {
    let entry = |name: &str, kind: Option<&str>, descriptor: [f32; 2]| EntryRecord {
        name: name.into(),
        kind: kind.map(str::to_owned),
        folder: "0".repeat(16),
        mesh: semfm_geom::MeshIdentity::of(&icosphere(1)),
        n_region: 1,
        region_hash: String::new(),
        descriptor: descriptor.to_vec(),
        provenance: crate::files::EntryProvenance::default(),
    };
    let (mug, pan) = (Some("mug"), Some("pan"));
    let mugs = [entry("a", mug, [1.0, 0.0]), entry("b", mug, [0.8, 0.6])];
    assert_eq!(shortlist::similarity_of_kinds(&mugs), None);
    let [a, b] = mugs;
    let unnamed = entry("c", None, [-1.0, 0.0]);
    let scale = shortlist::similarity_of_kinds(&[a, b, unnamed, entry("d", pan, [0.0, 1.0])]);
    let scale = scale.unwrap();
    assert!((scale.alike - 0.8).abs() < 1e-6 && (scale.unlike - 0.3).abs() < 1e-6, "{scale:?}");
}
