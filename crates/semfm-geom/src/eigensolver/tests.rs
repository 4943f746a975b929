use std::f64::consts::TAU;

use super::*;
use crate::Mesh;
use crate::laplacian::cotan_laplacian;
use crate::math::DVec3;

/// A torus of `around × along` vertices, bent out of symmetry when `bumps` is not zero.
fn torus(around: usize, along: usize, bumps: f64, offset: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..around {
        for j in 0..along {
            let a = TAU * i as f64 / around as f64;
            let b = TAU * j as f64 / along as f64;
            let tube = 0.35 * (1.0 + bumps * ((3.0 * a).sin() + 0.5 * (5.0 * b + 2.0 * a).cos()));
            let ring = 1.0 + tube * b.cos();
            vertices.push(offset + DVec3::new(ring * a.cos(), ring * a.sin(), tube * b.sin()));
            let [p, q, s, t] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                .map(|(i, j)| ((i % around) * along + j % along) as u32);
            faces.extend([[p, q, s], [p, s, t]]);
        }
    }
    (vertices, faces)
}

fn torus_laplacian(around: usize, along: usize, bumps: f64) -> Laplacian {
    let (vertices, faces) = torus(around, along, bumps, DVec3::ZERO);
    cotan_laplacian(&Mesh::new(vertices, faces).unwrap()).unwrap()
}

fn solve(laplacian: &Laplacian, k: usize) -> Eigenbasis {
    eigenbasis(laplacian, k, &EigenSettings::default(), &Task::default()).unwrap()
}

/// The same pencil, solved by the dense path whatever its size.
fn dense_values(laplacian: &Laplacian, k: usize) -> Vec<f64> {
    let none = Mat::zeros(laplacian.n_vertices(), 0);
    dense::first_pairs(laplacian, none.as_ref(), k).unwrap().0
}

fn assert_same_values(found: &[f64], expected: &[f64], scale: f64) {
    assert_eq!(found.len(), expected.len());
    for (j, (a, b)) in found.iter().zip(expected).enumerate() {
        // Eigenvalue errors are squares of residuals: 1e-10 allows for rounding alone.
        assert!((a - b).abs() <= 1e-10 * b.max(scale), "λ_{j}: {a} against {b}");
    }
}

#[test]
fn lanczos_agrees_with_the_dense_solution() {
    let laplacian = torus_laplacian(40, 20, 0.2);
    let basis = solve(&laplacian, 60);
    assert_same_values(&basis.values, &dense_values(&laplacian, 60), basis.values[1]);
    assert!(basis.orthonormality_error() < 1e-12, "{:.1e}", basis.orthonormality_error());
    assert!(basis.residuals.iter().all(|r| *r <= 1e-8), "{:?}", basis.residuals);
}

#[test]
fn a_restarted_search_finds_the_same_as_one_in_many_dimensions() {
    let laplacian = torus_laplacian(60, 25, 0.2);
    let operator = ShiftInvert::new(&laplacian, None).unwrap();
    let none = Mat::zeros(1500, 0);
    let [tight, ample] = [56, 300].map(|max_dimension| {
        let plan = Plan { wanted: 40, block: 4, max_dimension, tolerance: 1e-9, seed: 5 };
        lanczos::largest_pairs(&operator, none.as_ref(), &plan, &Task::default()).unwrap()
    });
    for (a, b) in tight.mus.iter().zip(&ample.mus) {
        assert!((a - b).abs() < 1e-12 * b, "{a} against {b}");
    }
    assert!(orthonormality_error(tight.vectors.as_ref()) < 1e-12);
}

#[test]
fn values_scale_with_the_inverse_area_at_any_unit_of_length() {
    let reference = solve(&torus_laplacian(40, 20, 0.2), 30);
    for unit in [1e-4, 1e4] {
        let (vertices, faces) = torus(40, 20, 0.2, DVec3::ZERO);
        let scaled = vertices.into_iter().map(|p| p * unit).collect();
        let laplacian = cotan_laplacian(&Mesh::new(scaled, faces).unwrap()).unwrap();
        let basis = solve(&laplacian, 30);
        let back: Vec<f64> = basis.values.iter().map(|v| v * unit * unit).collect();
        assert_same_values(&back, &reference.values, reference.values[1]);
    }
}

#[test]
fn every_component_brings_a_zero_and_the_constant_comes_first() {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for c in 0..150u32 {
        let (v, f) = torus(5, 4, 0.1, DVec3::X * 4.0 * f64::from(c));
        let first = vertices.len() as u32;
        vertices.extend(v.into_iter().map(|p| p * (1.0 + 0.001 * f64::from(c))));
        faces.extend(f.into_iter().map(|face| face.map(|id| id + first)));
    }
    let laplacian = cotan_laplacian(&Mesh::new(vertices, faces).unwrap()).unwrap();
    for k in [60, 150, 200] {
        let basis = solve(&laplacian, k);
        assert_eq!(basis.values.iter().filter(|v| **v == 0.0).count(), k.min(150));
        let constant = basis.functions[(0, 0)];
        assert!(basis.functions.col(0).iter().all(|v| (v - constant).abs() < 1e-12));
        assert!(basis.orthonormality_error() < 1e-10);
    }
}

#[test]
fn equal_components_bring_multiplicities_far_above_the_block() {
    // 40 copies of one torus: every eigenvalue is there at least 40 times.
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for _ in 0..40 {
        let (v, f) = torus(9, 7, 0.1, DVec3::ZERO);
        let first = vertices.len() as u32;
        vertices.extend(v);
        faces.extend(f.into_iter().map(|face| face.map(|id| id + first)));
    }
    let laplacian = cotan_laplacian(&Mesh::new(vertices, faces).unwrap()).unwrap();
    let (v, f) = torus(9, 7, 0.1, DVec3::ZERO);
    let one = dense_values(&cotan_laplacian(&Mesh::new(v, f).unwrap()).unwrap(), 6);
    let expected: Vec<f64> = one.iter().flat_map(|&v| [v.max(0.0); 40]).take(200).collect();
    let basis = solve(&laplacian, 200);
    assert_same_values(&basis.values, &expected, one[1]);
    assert!(basis.orthonormality_error() < 1e-10);
}

#[test]
fn all_pairs_of_small_meshes_are_found() {
    let tetrahedron = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let laplacian = cotan_laplacian(&Mesh::new(tetrahedron, faces).unwrap()).unwrap();
    for k in 1..=4 {
        assert_eq!(solve(&laplacian, k).k(), k);
    }
    let laplacian = torus_laplacian(12, 8, 0.2);
    let basis = solve(&laplacian, 96);
    let trace: f64 = laplacian
        .stiffness
        .triplet_iter()
        .filter(|t| t.row == t.col)
        .map(|t| t.val / laplacian.mass[t.row])
        .sum();
    assert!((basis.values.iter().sum::<f64>() / trace - 1.0).abs() < 1e-12);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_signs_follow_the_rule() {
    let laplacian = torus_laplacian(50, 20, 0.2);
    let (a, b) = (solve(&laplacian, 20), solve(&laplacian, 20));
    assert_eq!(a.functions, b.functions);
    for j in 0..20 {
        let column = a.functions.col_as_slice(j);
        let largest = column.iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
        assert!(largest > 0.0);
    }
    // Another seed: the same functions, up to what the symmetry of an eigenspace leaves open.
    let other = EigenSettings { seed: 9, ..EigenSettings::default() };
    let c = eigenbasis(&laplacian, 20, &other, &Task::default()).unwrap();
    assert_same_values(&c.values, &a.values, a.values[1]);
}

#[test]
fn a_count_notices_a_pair_that_was_left_out() {
    let laplacian = torus_laplacian(40, 20, 0.2);
    let operator = ShiftInvert::new(&laplacian, None).unwrap();
    let mut values = dense_values(&laplacian, 21);
    let missed = |values: &[f64]| {
        let gap = last_gap(values, values[1]).unwrap();
        missed_below(gap, &laplacian, operator.factor.analysis().symbolic()).unwrap()
    };
    assert_eq!(missed(&values), 0);
    values.remove(10);
    assert_eq!(missed(&values), 1);
    values.remove(5);
    assert_eq!(missed(&values), 2);
}

#[test]
fn a_count_below_what_was_found_is_an_error() {
    let laplacian = torus_laplacian(40, 20, 0.2);
    let operator = ShiftInvert::new(&laplacian, None).unwrap();
    let values = dense_values(&laplacian, 9);
    let too_many = check::SpectralGap { below: values[7], above: values[8], expected: 9 };
    assert!(matches!(
        missed_below(too_many, &laplacian, operator.factor.analysis().symbolic()),
        Err(Error::LinearAlgebra(_))
    ));
}

#[test]
fn bad_requests_are_refused_and_a_cancelled_task_stops() {
    let laplacian = torus_laplacian(40, 20, 0.2);
    let settings = EigenSettings::default();
    let ask = |k, task: &Task| eigenbasis(&laplacian, k, &settings, task);
    assert!(matches!(ask(0, &Task::default()), Err(Error::OutOfRange { .. })));
    assert!(matches!(
        ask(801, &Task::default()),
        Err(Error::TooManyEigenpairs { asked: 801, n_vertices: 800 })
    ));
    let stop = Task::default();
    let inside = stop.clone();
    let task = Task::with_progress(move |progress| {
        if progress.done > 0 {
            inside.cancel();
        }
    });
    assert!(ask(30, &task).is_ok(), "the flag of another task is not ours");
    stop.cancel();
    assert!(matches!(ask(30, &stop), Err(Error::Cancelled)));
    let with = |tolerance| {
        let settings = EigenSettings { tolerance, ..settings };
        eigenbasis(&laplacian, 30, &settings, &Task::default())
    };
    assert!(with(EigenSettings::LEAST_TOLERANCE).is_ok(), "the least that may be asked is reached");
    for impossible in [1e-30, -1.0, f64::NAN, 2.0] {
        assert!(matches!(with(impossible), Err(Error::OutOfRange { .. })), "{impossible}");
    }
}
