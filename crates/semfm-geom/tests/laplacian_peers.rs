//! The tufted Laplacian and the geodesics against other people's, on the meshes and numbers that
//! `fixtures/make_laplacian_fixtures.py` wrote.

use std::collections::HashMap;
use std::path::PathBuf;

use semfm_geom::laplacian::{
    CloudSettings, Laplacian, TuftedSettings, point_cloud_laplacian, tufted_laplacian,
};
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

const MESHES: [&str; 9] = [
    "grid",
    "torus",
    "book",
    "book_of_five",
    "slivers",
    "components",
    "duplicates",
    "mixed_winding",
    "isolated",
];

fn array(fixture: &str, name: &str) -> Vec<f64> {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "tests/fixtures/laplacian", fixture, &format!("{name}.npy")].iter().collect();
    let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap()
}

fn points(fixture: &str) -> Vec<DVec3> {
    array(fixture, "points").chunks_exact(3).map(DVec3::from_slice).collect()
}

fn mesh(fixture: &str) -> Mesh {
    let faces = array(fixture, "faces");
    let faces = faces.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect();
    Mesh::new(points(fixture), faces).unwrap()
}

/// Largest difference of any entry of the stiffness, relative to the largest entry, and of any
/// mass, relative to the largest mass.
fn differences(ours: &Laplacian, fixture: &str) -> (f64, f64) {
    let mut theirs: HashMap<(usize, usize), f64> = array(fixture, "entries")
        .chunks_exact(3)
        .map(|entry| ((entry[0] as usize, entry[1] as usize), entry[2]))
        .collect();
    let scale = theirs.values().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut worst = 0.0f64;
    for t in ours.stiffness.triplet_iter().filter(|t| t.row <= t.col) {
        worst = worst.max((t.val - theirs.remove(&(t.row, t.col)).unwrap_or(0.0)).abs());
    }
    worst = theirs.values().fold(worst, |worst, v| worst.max(v.abs()));
    let mass = array(fixture, "mass");
    assert_eq!(mass.len(), ours.mass.len());
    let scale_mass = mass.iter().copied().fold(0.0, f64::max);
    let worst_mass = mass.iter().zip(&ours.mass).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (worst / scale, worst_mass / scale_mass)
}

#[test]
fn tufted_laplacians_agree_with_robust_laplacian() {
    let mut failures = Vec::new();
    for name in MESHES {
        let ours = tufted_laplacian(&mesh(name), &TuftedSettings::default()).unwrap();
        let (stiffness, mass) = differences(&ours, name);
        // Both compute the same sums in another order; an isolated vertex has mass 1e-12 of the
        // mean here and none there.
        if !(stiffness < 1e-9 && mass < 1e-9) {
            failures.push(format!("{name}: stiffness {stiffness:.1e}, mass {mass:.1e}"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn point_cloud_laplacians_are_close_to_robust_laplacian() {
    for name in ["cloud_ball", "cloud_open_sheet"] {
        let ours = point_cloud_laplacian(&points(name), &CloudSettings::default()).unwrap();
        let (stiffness, mass) = differences(&ours, name);
        assert!(stiffness < 1e-9 && mass < 1e-9, "{name}: stiffness {stiffness:.1e}, mass {mass:.1e}");
    }
}
