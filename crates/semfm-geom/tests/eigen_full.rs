//! Large and costly checks of the eigensolver, run where `SEMFM_FULL=1` is set.

use std::f64::consts::TAU;

use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::laplacian::cotan_laplacian;
use semfm_geom::math::DVec3;
use semfm_geom::{Laplacian, Mesh, Task};

#[allow(clippy::print_stderr)] // A check that was skipped says so.
fn full(name: &str) -> bool {
    let full = std::env::var_os("SEMFM_FULL").is_some_and(|value| value == "1");
    if !full {
        eprintln!("skipped: {name} runs only with SEMFM_FULL=1");
    }
    full
}

/// A bumpy torus of area 1.
fn torus(around: usize, along: usize) -> Laplacian {
    let at = |i: usize, j: usize| ((i % around) * along + j % along) as u32;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for i in 0..around {
        for j in 0..along {
            let (a, b) = (TAU * i as f64 / around as f64, TAU * j as f64 / along as f64);
            let tube = 0.35 * (1.0 + 0.2 * (3.0 * a).sin() + 0.1 * (5.0 * b + 2.0 * a).cos());
            let ring = 1.0 + tube * b.cos();
            vertices.push(DVec3::new(ring * a.cos(), 1.3 * ring * a.sin(), tube * b.sin()));
            let [p, q, s, t] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            faces.extend([[p, q, s], [p, s, t]]);
        }
    }
    let side = Mesh::new(vertices.clone(), faces.clone()).unwrap().area().sqrt();
    let unit = vertices.into_iter().map(|p| p / side).collect();
    cotan_laplacian(&Mesh::new(unit, faces).unwrap()).unwrap()
}

#[test]
fn two_hundred_thousand_vertices_have_nearly_the_spectrum_of_a_quarter_of_them() {
    if !full("the 200 000-vertex mesh") {
        return;
    }
    let solve = |laplacian: &Laplacian, k| {
        eigenbasis(laplacian, k, &EigenSettings::default(), &Task::default()).unwrap()
    };
    let fine = solve(&torus(800, 250), 60);
    assert!(fine.residuals.iter().all(|r| *r <= 1e-8));
    assert!(fine.orthonormality_error() < 1e-11);
    let coarse = solve(&torus(400, 125), 60);
    for (a, b) in fine.values.iter().zip(&coarse.values).skip(1) {
        // Linear elements err by O(λ h²), and λ h² is below 750 · 2e-5 here.
        assert!((a - b).abs() < 0.015 * b, "{a} against {b}");
    }
}

#[test]
fn every_pair_of_two_thousand_vertices_is_found() {
    if !full("all pairs of 2 000 vertices") {
        return;
    }
    let laplacian = torus(80, 25);
    let basis = eigenbasis(&laplacian, 2000, &EigenSettings::default(), &Task::default()).unwrap();
    let diagonal = laplacian.stiffness.triplet_iter().filter(|t| t.row == t.col);
    let trace: f64 = diagonal.map(|t| t.val / laplacian.mass[t.row]).sum();
    assert!((basis.values.iter().sum::<f64>() / trace - 1.0).abs() < 1e-11);
    assert!(basis.orthonormality_error() < 1e-11);
}
