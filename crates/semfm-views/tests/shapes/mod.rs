//! Small meshes for the tests of rendering and lifting.
#![allow(dead_code)] // each test binary uses its own few

use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

/// A torus-like closed surface without symmetry: `n` × `n` quads cut in two.
pub fn lumpy_torus(n: u32) -> Mesh {
    let turn = |i: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let point = |i: u32, j: u32| {
        let (a, b) = (turn(i), turn(j));
        let ring = 2.0 + 0.4 * a.sin();
        let tube = 0.7 + 0.2 * (2.0 * a + b).cos();
        let r = ring + tube * b.cos();
        DVec3::new(1.3 * r * a.cos(), r * a.sin(), tube * b.sin() + 0.2 * (3.0 * a).cos())
    };
    let vertices = (0..n).flat_map(|i| (0..n).map(move |j| point(i, j))).collect();
    let id = |i: u32, j: u32| (i % n) * n + j % n;
    let quads = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let faces = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(vertices, faces).unwrap()
}

/// A sphere of `n` × 2n quads (cut in two), stretched by `axes`.
pub fn ellipsoid(n: u32, axes: DVec3, centre: DVec3) -> Mesh {
    let mut vertices = Vec::new();
    for i in 0..=n {
        let polar = f64::from(i) / f64::from(n) * std::f64::consts::PI;
        for j in 0..2 * n {
            let a = f64::from(j) / f64::from(n) * std::f64::consts::PI;
            let unit = DVec3::new(polar.sin() * a.cos(), polar.sin() * a.sin(), polar.cos());
            vertices.push(unit * axes + centre);
        }
    }
    let id = |i: u32, j: u32| i * 2 * n + j % (2 * n);
    let quads = (0..n).flat_map(|i| (0..2 * n).map(move |j| (i, j)));
    let faces = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(vertices, faces).unwrap()
}

/// Two meshes as one, without joining them.
pub fn together(one: &Mesh, other: &Mesh) -> Mesh {
    let offset = one.n_vertices() as u32;
    let vertices = one.vertices().iter().chain(other.vertices()).copied().collect();
    let shifted = other.faces().iter().map(|face| face.map(|id| id + offset));
    Mesh::new(vertices, one.faces().iter().copied().chain(shifted).collect()).unwrap()
}

/// Meshes that real files contain: open, non-manifold, flat, degenerate, in pieces, far away.
pub fn zoo() -> Vec<(&'static str, Mesh)> {
    let mesh = |points: &[[f64; 3]], faces: &[[u32; 3]]| {
        Mesh::new(points.iter().map(|&p| DVec3::from_array(p)).collect(), faces.to_vec()).unwrap()
    };
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let fan =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.3]];
    let mut with_slivers = square.to_vec();
    with_slivers.extend([[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [7.0, 7.0, 7.0]]);
    let sphere = ellipsoid(8, DVec3::ONE, DVec3::ZERO);
    let torus = lumpy_torus(12);
    let scaled = |factor: f64, shift: f64| {
        let vertices = torus.vertices().iter().map(|&p| p * factor + DVec3::splat(shift)).collect();
        Mesh::new(vertices, torus.faces().to_vec()).unwrap()
    };
    vec![
        ("closed", lumpy_torus(12)),
        ("open and flat", mesh(&square, &[[0, 1, 2], [0, 2, 3]])),
        ("three triangles on an edge", mesh(&fan, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]])),
        (
            "degenerate triangles",
            mesh(&with_slivers, &[[0, 1, 2], [0, 2, 3], [4, 5, 4], [0, 4, 2], [1, 1, 1]]),
        ),
        ("in pieces", together(&sphere, &ellipsoid(6, DVec3::splat(0.3), DVec3::splat(5.0)))),
        ("tiny", scaled(1e-9, 0.0)),
        ("huge", scaled(1e9, 0.0)),
        ("far from the origin", scaled(0.01, 1e4)),
        ("one triangle", mesh(&square[..3], &[[0, 1, 2]])),
    ]
}
