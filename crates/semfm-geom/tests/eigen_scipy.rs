//! The eigensolver against scipy's, on the same matrices.
//!
//! `tests/fixtures/make_eigen_fixtures.py` made the fixtures and names the versions.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use faer::sparse::{SparseColMat, Triplet};
use npyz::NpyFile;
use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::{Laplacian, Task};

/// The array's numbers, row after row.
fn numbers(name: &str) -> Vec<f64> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/eigen");
    let file = File::open(folder.join(name)).unwrap();
    let array = NpyFile::new(BufReader::new(file)).unwrap();
    assert_eq!(array.order(), npyz::Order::C, "{name}");
    array.into_vec::<f64>().unwrap()
}

fn laplacian(name: &str) -> Laplacian {
    let mass = numbers(&format!("{name}_mass.npy"));
    let mut triplets = Vec::new();
    for entry in numbers(&format!("{name}_lower.npy")).chunks_exact(3) {
        let (row, column, value) = (entry[0] as usize, entry[1] as usize, entry[2]);
        triplets.push(Triplet::new(row, column, value));
        if row != column {
            triplets.push(Triplet::new(column, row, value));
        }
    }
    let n = mass.len();
    Laplacian { stiffness: SparseColMat::try_new_from_triplets(n, n, &triplets).unwrap(), mass }
}

/// Solves for the first k and compares with scipy to 1e-8, the tolerance on residuals; eigenvalue
/// errors are of second order, so the agreement found is nearer to 1e-12.
fn agree(name: &str, k: usize) {
    let laplacian = laplacian(name);
    let expected = numbers(&format!("{name}_values.npy"));
    let first = expected.iter().copied().find(|v| *v > 1e-6).unwrap();
    let basis = eigenbasis(&laplacian, k, &EigenSettings::default(), &Task::default()).unwrap();
    assert_eq!(basis.k(), k);
    for (j, (ours, theirs)) in basis.values.iter().zip(&expected).enumerate() {
        let allowed = 1e-8 * theirs.max(first);
        assert!((ours - theirs).abs() <= allowed, "{name} λ_{j}: ours {ours}, scipy {theirs}");
    }
    assert!(basis.residuals.iter().all(|r| *r <= 1e-8), "{name}: {:?}", basis.residuals);
    assert!(basis.orthonormality_error() < 1e-11, "{name}: {:e}", basis.orthonormality_error());
}

/// 40 pairs of about 600 vertices go through Lanczos; 200 pairs, the first 40 of which are known,
/// through the dense solver.
fn agree_both_ways(name: &str) {
    agree(name, 40);
    agree(name, 200);
}

#[test]
fn on_a_closed_surface() {
    agree_both_ways("closed");
}

#[test]
fn on_an_open_surface() {
    agree_both_ways("open");
}

#[test]
fn on_several_components_two_of_them_equal() {
    agree_both_ways("several");
}

#[test]
fn on_sheets_that_meet_in_one_edge() {
    agree_both_ways("book");
}

#[test]
fn on_a_sphere_with_its_multiplicities() {
    agree_both_ways("sphere");
}
