//! Cleaning and simplification on real objects. Skipped, loudly, where the objects are not there.
#![allow(clippy::print_stderr)]

use std::path::{Path, PathBuf};
use std::time::Instant;

use semfm_geom::io::read_mesh;
use semfm_geom::{
    CleanSettings, Mesh, PreparedWorkingMesh, SimplifyReport, SimplifySettings, Task, WorkingMesh,
};

/// Objects that troubled other simplifiers: a shoe with 35 handles, one of 149 components, a game
/// pad with non-manifold edges, thin blades, scissors of slivers, a cup, controllers of many parts.
const OBJECTS: [&str; 12] = [
    "2_shoes/web_clog",
    "2_shoes/web_hightop",
    "2_shoes/bm_stylized_boot",
    "3_cutting_tools/bm_butter_knife",
    "3_cutting_tools/bm_craft_knife",
    "3_cutting_tools/bm_hacksaw_01",
    "4_water_containers/cdb_utah_teapot",
    "4_water_containers/psb_cup_29",
    "5_controllers/cdb_ps_controller",
    "5_controllers/pm_nes_controller",
    "5_controllers/xr_htc-vive-focus_none",
    "6_scissor_tools/partnet_scissors_10495",
];

fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let root = std::env::var_os("SEMFM_SHARED").map_or(beside, PathBuf::from).join("data");
    let found = root.join("objects").is_dir();
    if !found {
        eprintln!("SKIPPED: no shared objects under {}", root.display());
    }
    found.then_some(root)
}

fn working(name: &str, mesh: &Mesh, target_vertices: usize) -> (WorkingMesh, SimplifyReport) {
    let settings = SimplifySettings { target_vertices, ..SimplifySettings::default() };
    let start = Instant::now();
    let PreparedWorkingMesh { working, cleaning, simplification } =
        WorkingMesh::prepare(mesh, &CleanSettings::default(), &settings, &Task::default()).unwrap();
    let report = simplification.expect("these objects are larger than the target");
    eprintln!(
        "{name}: {cleaning}; simplified to {} vertices within {:.4} of the diagonal in {} ms, \
         slivers {:.3} -> {:.3}",
        report.n_vertices,
        report.distance,
        start.elapsed().as_millis(),
        slivers(mesh),
        slivers(&working.mesh),
    );
    (working, report)
}

/// Share of triangles of quality (4√3 area / Σ edge²) below .2.
fn slivers(mesh: &Mesh) -> f64 {
    let bad = (0..mesh.n_faces()).filter(|&face| {
        let [a, b, c] = mesh.corners(face);
        let sum = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
        4.0 * 3f64.sqrt() * mesh.face_area(face) < 0.2 * sum
    });
    bad.count() as f64 / mesh.n_faces() as f64
}

#[test]
fn real_objects_keep_their_topology_and_their_place() {
    let Some(root) = shared() else { return };
    for name in OBJECTS {
        let mesh = read_mesh(root.join("objects").join(name).with_extension("obj")).unwrap().mesh;
        for target in [10_000, 4_000] {
            let (working, report) = working(name, &mesh, target);
            assert_eq!(report.topology, report.topology_before, "{name} at {target}");
            assert!(report.distance <= 0.01, "{name} at {target}: {}", report.distance);
            assert!(slivers(&working.mesh) <= slivers(&mesh) + 0.02, "{name} at {target}");
        }
    }
}

#[test]
fn a_generated_object_keeps_its_many_handles() {
    let Some(root) = shared() else { return };
    let mesh = read_mesh(root.join("sam3d/sam3d_sample.glb")).unwrap().mesh;
    let (_, report) = working("sam3d", &mesh, 10_000);
    assert_eq!(report.topology, report.topology_before);
    assert!(report.distance <= 0.01, "{}", report.distance);
}

#[test]
fn labelled_regions_survive_the_way_there_and_back() {
    let Some(root) = shared() else { return };
    for name in OBJECTS {
        let path = root.join("objects").join(name);
        let Ok(label) = std::fs::read_to_string(path.with_extension("json")) else { continue };
        let label: serde_json::Value = serde_json::from_str(&label).unwrap();
        let ids = label["region"]["vertices"].as_array().unwrap();
        let mesh = read_mesh(path.with_extension("obj")).unwrap().mesh;
        let mut region = vec![0.0; mesh.n_vertices()];
        ids.iter().for_each(|id| region[id.as_u64().unwrap() as usize] = 1.0);
        // A border drawn through triangles twelve times as large is off by part of one of them.
        for (target, least) in [(10_000, 0.97), (4_000, 0.95)] {
            let (working, _) = working(name, &mesh, target);
            let back = working.onto_original(&working.onto_working(&region));
            let pairs =
                || region.iter().zip(&back).map(|(&there, &back)| (there >= 0.5, back >= 0.5));
            let both = pairs().filter(|&(there, back)| there && back).count() as f64;
            let any = pairs().filter(|&(there, back)| there || back).count() as f64;
            eprintln!(
                "{name}: region of {} vertices by way of {target}: IoU {:.4}",
                ids.len(),
                both / any
            );
            assert!(both / any >= least, "{name} at {target}: IoU {}", both / any);
        }
    }
}
