//! Every reader of files from outside, as a function of bytes: what `fuzz/` runs under libFuzzer, and
//! `tests/mutated_files.rs` on a stable compiler.
//!
//! A reader may refuse whatever it likes. It must not panic, take more than [`MOST_BYTES`] or more than
//! [`MOST_SECONDS`].

use std::path::Path;
use std::sync::OnceLock;

use semfm::files;
use semfm::geom::connectivity::MeshReport;
use semfm::geom::io::{read_mesh, read_mesh_or_points, read_points};
use semfm::grasp::{GraspObject, GraspSettings, GripperGeometry, Scene, find_grasps_with};
use semfm::observe;
use semfm::robot::{
    Arm, ArmSettings, Gripper, GripperSettings, JointLimitsFile, MeshPaths, RobotDescription, Srdf,
};
use semfm::views::mcap::{EmbeddingsFile, ViewsFile, inspect, read_view};
use semfm::{Mesh, Task};
use semfm_eval::{AnnotatedMesh, MapResults, Results};
use semfm_run::Recipe;
use semfm_synth::{Category, ObjectSettings, make_object};

/// Memory that reading one file may take.
pub const MOST_BYTES: u64 = 1 << 30;

/// Time that reading one file may take.
pub const MOST_SECONDS: u64 = 10;

/// Stands between the text of a robot and the mesh of its fingers in one input.
pub const ROBOT_MESH: &[u8] = b"\n<!-- finger.stl -->\n";

/// A reader of files.
pub struct Reader {
    /// Its name, for the command line.
    pub name: &'static str,
    /// Extension of its files.
    pub extension: &'static str,
    /// Reads a file in a folder of its own; whether anything was made of it.
    pub read: fn(&Path) -> bool,
}

/// All of them.
pub const READERS: [Reader; 18] = [
    Reader { name: "obj", extension: "obj", read: mesh },
    Reader { name: "off", extension: "off", read: mesh },
    Reader { name: "ply", extension: "ply", read: mesh },
    Reader { name: "stl", extension: "stl", read: mesh },
    Reader { name: "gltf", extension: "gltf", read: mesh },
    Reader { name: "glb", extension: "glb", read: mesh },
    Reader { name: "pcd", extension: "pcd", read: mesh },
    Reader { name: "views", extension: "mcap", read: views },
    Reader { name: "embeddings", extension: "mcap", read: embeddings },
    Reader { name: "json", extension: "json", read: json },
    Reader { name: "urdf", extension: "urdf", read: robot },
    Reader { name: "srdf", extension: "srdf", read: srdf },
    Reader { name: "joint_limits", extension: "yaml", read: joint_limits },
    Reader { name: "recipe", extension: "toml", read: recipe },
    Reader { name: "npy", extension: "npy", read: npy },
    Reader { name: "npz", extension: "npz", read: npz },
    Reader { name: "png", extension: "png", read: picture },
    Reader { name: "exr", extension: "exr", read: picture },
];

/// Runs a reader on bytes, as a fuzzer has them.
///
/// # Panics
/// For a name that is none of [`READERS`], where there is no room for a file, and where the reader does.
pub fn read_bytes(name: &str, bytes: &[u8]) -> bool {
    let reader = READERS.iter().find(|reader| reader.name == name);
    let reader = reader.unwrap_or_else(|| panic!("no reader `{name}`"));
    thread_local!(static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("room for a folder"));
    FOLDER.with(|folder| {
        let path = folder.path().join("input").with_extension(reader.extension);
        std::fs::write(&path, bytes).expect("room for a file");
        (reader.read)(&path)
    })
}

/// The mesh that seeds of regions, grasps, features and alignments belong to.
pub fn seed_mesh() -> &'static Mesh {
    static MESH: OnceLock<Mesh> = OnceLock::new();
    MESH.get_or_init(|| {
        let settings = ObjectSettings { n_vertices: 300, ..Default::default() };
        make_object(Category::Containers, 1, &settings).expect("a container").mesh
    })
}

fn mesh(path: &Path) -> bool {
    let points = read_points(path).is_ok();
    let _ = read_mesh_or_points(path);
    let _ = observe::read_hand(path);
    let Ok(file) = read_mesh(path) else { return points };
    let _ = MeshReport::new(&file.mesh);
    true
}

fn views(path: &Path) -> bool {
    let _ = inspect(path);
    let _ = read_view(path, 0);
    let _ = observe::read_observations(path, &Default::default(), |_| Ok(()));
    ViewsFile::read(path).is_ok()
}

fn embeddings(path: &Path) -> bool {
    let _ = inspect(path);
    let _ = files::read_embeddings(path, seed_mesh());
    EmbeddingsFile::read(path).is_ok()
}

/// Every JSON file of ours and of others: which one it is meant to be is not asked.
fn json(path: &Path) -> bool {
    let mesh = seed_mesh();
    let mut read = files::read_region(path, mesh).is_ok();
    read |= files::TransferredRegionFile::read(path).is_ok();
    read |= files::TransferReportFile::read(path).is_ok();
    read |= files::PointMapFile::read(path).is_ok_and(|map| map.check(path, mesh, mesh).is_ok());
    read |= files::GraspsFile::read(path, mesh).is_ok();
    read |= files::read_aligned(path, Some(mesh)).is_ok();
    read |= files::read_pose(path).is_ok();
    read |= files::read_scene(path).is_ok();
    read |= files::TrajectoryFile::read(path).is_ok();
    read |= files::MemoryFile::read(path).is_ok();
    read |= files::MemoryReportFile::read(path).is_ok();
    read |= files::read_motion(path).is_ok();
    if let Ok(image) = semfm::align::DepthImage::new(4, 3, vec![1.0; 12]) {
        read |= observe::read_intrinsics(path, &image).is_ok();
        let size = observe::MaskedPicture { width: 4, height: 3, name: "the view" };
        read |= observe::read_mask(path, size).is_ok();
        read |= observe::read_calibration(path, 4, 3).is_ok();
        read |= observe::read_bop_models(path).is_ok();
        read |= observe::read_vertex_ids(path).is_ok();
    }
    read |= Results::read(path).is_ok();
    read | MapResults::read(path).is_ok()
}

/// A robot, the mesh of whose fingers may follow its text in the same input, and grasps with it.
fn robot(path: &Path) -> bool {
    let Ok(bytes) = std::fs::read(path) else { return false };
    let cut = bytes.windows(ROBOT_MESH.len()).position(|window| window == ROBOT_MESH);
    let (text, finger) = match cut {
        Some(at) => (&bytes[..at], &bytes[at + ROBOT_MESH.len()..]),
        None => (&bytes[..], &b""[..]),
    };
    let (urdf, stl) = (path.with_file_name("robot.urdf"), path.with_file_name("finger.stl"));
    if std::fs::write(&urdf, text).and_then(|()| std::fs::write(&stl, finger)).is_err() {
        return false;
    }
    if let Ok(description) = RobotDescription::read(&urdf) {
        let _ = description.meshes(&MeshPaths::new(&urdf, &Default::default()));
        if let Ok(tree) = description.tree() {
            let _ = Arm::new(tree.into(), &ArmSettings::default());
        }
    }
    let Ok(gripper) = Gripper::from_urdf(&urdf, &GripperSettings::default()) else { return false };
    let Ok(gripper) = GripperGeometry::new(&gripper) else { return false };
    static OBJECT: OnceLock<GraspObject> = OnceLock::new();
    let object =
        OBJECT.get_or_init(|| GraspObject::from_mesh(seed_mesh(), 0.05).expect("a container"));
    let weights = vec![1.0; object.n_weights()];
    let settings = GraspSettings { n_samples: 4, neighbour_rounds: 0, ..Default::default() };
    let task = Task::default();
    find_grasps_with(object, &weights, &gripper, &Scene::new(), &settings, &task).is_ok()
}

/// An SRDF for the synthetic arm.
fn srdf(path: &Path) -> bool {
    static ROBOT: OnceLock<semfm::robot::Robot> = OnceLock::new();
    let robot = ROBOT.get_or_init(|| {
        let text = semfm_synth::arm_urdf();
        let description = RobotDescription::parse(text.as_bytes(), "arm.urdf").expect("a URDF");
        description.tree().expect("one tree")
    });
    Srdf::read(path, robot).is_ok()
}

fn joint_limits(path: &Path) -> bool {
    JointLimitsFile::read(path).is_ok()
}

/// A recipe of `run`. The files that it names are not there, so what is checked of its text is asked for beside.
fn recipe(path: &Path) -> bool {
    let whole = Recipe::read(path).is_ok();
    let text = std::fs::read_to_string(path).unwrap_or_default();
    whole | Recipe::parse(path, &text).is_ok()
}

fn npy(path: &Path) -> bool {
    let size = observe::MaskedPicture { width: 16, height: 12, name: "the view" };
    let mask = observe::read_mask(path, size).is_ok();
    let depth = observe::read_depth_image(path, None).is_ok();
    files::read_vertex_features(path, seed_mesh()).is_ok() | mask | depth
}

fn npz(path: &Path) -> bool {
    let hand = observe::read_hand(path).is_ok();
    AnnotatedMesh::read(path).is_ok() | hand
}

fn picture(path: &Path) -> bool {
    let size = observe::MaskedPicture { width: 16, height: 12, name: "the view" };
    let mask = observe::read_mask(path, size).is_ok();
    mask | observe::read_depth_image(path, None).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reader_has_its_fuzz_target() {
        let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz");
        let manifest = std::fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
        for Reader { name, .. } in READERS {
            let target = fuzz.join(format!("fuzz_targets/{name}.rs"));
            let text = std::fs::read_to_string(&target).unwrap();
            assert!(text.contains(&format!("read_bytes(\"{name}\", bytes)")), "{name}");
            assert!(manifest.contains(&format!("fuzz_targets/{name}.rs")), "{name}");
        }
    }
}
