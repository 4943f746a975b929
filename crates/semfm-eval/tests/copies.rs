//! A region of an object, transferred onto changed copies of that object, lies where it lay.
#![allow(clippy::print_stderr)] // A check that was skipped says so.

use std::path::{Path, PathBuf};

use semfm::encoder::builtin_encoder;
use semfm::fmap::metrics::iou;
use semfm::geom::io::read_mesh;
use semfm::{FeatureSource, Mesh, PipelineSettings, Prepared, Region, Task, prepare, transfer};
use semfm_synth::{Category, Change, ObjectSettings, make_object};

/// The changes that a region survives, and the least IoU after each: rigid and scaled copies .99; a mirror image and
/// other triangles .97.
const LEAST: [(Change, f64); 7] = [
    (Change::Identity, 0.99),
    (Change::Turned, 0.99),
    (Change::Rescaled, 0.99),
    (Change::Mirrored, 0.97),
    (Change::Decimated, 0.97),
    (Change::Remeshed, 0.97),
    (Change::FacesDropped, 0.97),
];

/// Real objects, of which the second is open and in two pieces.
const REAL: [&str; 2] = ["1_tools_handles/bm_axe", "4_water_containers/bm_milk_jug"];

fn prepared(mesh: &Mesh) -> Prepared {
    let encoder = builtin_encoder().unwrap();
    let settings = PipelineSettings::default();
    prepare(mesh.clone(), FeatureSource::Encoder(&*encoder), &settings, &Task::default()).unwrap()
}

fn check(name: &str, mesh: &Mesh, region: &[bool]) {
    let source = prepared(mesh);
    for (change, least) in LEAST {
        let copy = change.copy(mesh, region, 0).unwrap();
        let target = prepared(&copy.mesh);
        let settings = PipelineSettings::default().transfer;
        let region = Region::from_mask(region);
        let found =
            transfer(&source.object, &target.object, &region, &settings, &Task::default()).unwrap();
        let reached = iou(&found.region, &Region::from_mask(&copy.region)).unwrap();
        assert!(reached >= least, "{name}, {}: IoU {reached}", change.name());
        let same = found.report.same_surface;
        assert!(same.is_some_and(|share| share > 0.8), "{name}, {}: {same:?}", change.name());
        assert!(found.confidence > 0.5, "{name}, {}: {}", change.name(), found.confidence);
    }
}

#[test]
fn procedural_objects_keep_their_grips() {
    for category in [Category::Tools, Category::Containers] {
        let object = make_object(category, 1, &ObjectSettings::default()).unwrap();
        check(&object.name(), &object.mesh, &object.region);
    }
}

#[test]
fn real_objects_keep_their_regions() {
    let Some(objects) = real_objects() else {
        eprintln!("SKIPPED: no labelled objects in $SEMFM_SHARED or shared beside the repository");
        return;
    };
    for name in REAL {
        let mesh = read_mesh(objects.join(format!("{name}.obj"))).unwrap().mesh;
        let label = objects.join(format!("{name}.json"));
        let region = semfm::files::read_region(&label, &mesh).unwrap();
        check(name, &mesh, &region.mask());
    }
}

fn real_objects() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("SEMFM_SHARED").map_or_else(beside, PathBuf::from);
    let has_all =
        |folder: &PathBuf| REAL.iter().all(|name| folder.join(format!("{name}.obj")).is_file());
    Some(shared.join("data/objects")).filter(has_all)
}
