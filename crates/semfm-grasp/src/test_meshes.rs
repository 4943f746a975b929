//! Shapes with known grasps, for this crate's tests.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

/// A box around the origin, by its edge lengths.
pub(crate) fn cuboid(size: DVec3) -> Mesh {
    let corner = |i: usize| {
        let sign = |bit: usize| if i >> bit & 1 == 0 { -0.5 } else { 0.5 };
        size * DVec3::new(sign(0), sign(1), sign(2))
    };
    let quads =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect(), faces).unwrap()
}

/// A closed cylinder around the z axis, centred on the origin.
pub(crate) fn cylinder(radius: f64, height: f64, n: u32) -> Mesh {
    let ring = |z: f64| {
        (0..n).map(move |i| {
            let angle = TAU * f64::from(i) / f64::from(n);
            DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
        })
    };
    let mut vertices: Vec<DVec3> = ring(-height / 2.0).chain(ring(height / 2.0)).collect();
    vertices.extend([-height / 2.0, height / 2.0].map(|z| z * DVec3::Z));
    let faces = (0..n)
        .flat_map(|i| {
            let j = (i + 1) % n;
            [[i, j, n + j], [i, n + j, n + i], [2 * n, j, i], [2 * n + 1, n + i, n + j]]
        })
        .collect();
    Mesh::new(vertices, faces).unwrap()
}

/// Two meshes in one.
pub(crate) fn joined(a: &Mesh, b: &Mesh) -> Mesh {
    let n = a.n_vertices() as u32;
    let vertices = a.vertices().iter().chain(b.vertices()).copied().collect();
    let later = b.faces().iter().map(|face| face.map(|id| id + n));
    Mesh::new(vertices, a.faces().iter().copied().chain(later).collect()).unwrap()
}

/// The mesh moved by a map of its points.
pub(crate) fn moved(mesh: &Mesh, map: impl Fn(DVec3) -> DVec3) -> Mesh {
    Mesh::new(mesh.vertices().iter().map(|&p| map(p)).collect(), mesh.faces().to_vec()).unwrap()
}

/// The mesh with independent normal noise of deviation `sigma` on each coordinate (twelve uniform numbers less six
/// have a deviation of 1).
pub(crate) fn noisy(mesh: &Mesh, sigma: f64, seed: u64) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let points =
        mesh.vertices().iter().map(|&p| p + sigma * DVec3::from_array([(); 3].map(|()| normal())));
    let points: Vec<DVec3> = points.collect();
    Mesh::new(points, mesh.faces().to_vec()).unwrap()
}
