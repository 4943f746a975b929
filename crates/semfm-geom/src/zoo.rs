//! The mesh zoo: small meshes, each with one kind of trouble, for tests that must hold on all.
//!
//! Every mesh is made by a formula, so a test elsewhere (or in another language) can rebuild it.
//! Compiled for this crate's own tests, and for others under the feature `zoo`.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use crate::Mesh;
use crate::math::DVec3;

/// Every mesh with its name, in a fixed order.
pub fn all() -> Vec<(&'static str, Mesh)> {
    vec![
        ("tetrahedron", tetrahedron()),
        ("icosphere", icosphere(2)),
        ("open_grid", open_grid(9, 7)),
        ("torus", torus(24, 12)),
        ("moebius", moebius(30, 4)),
        ("book", book(3, 4, 6)),
        ("two_components", two_components()),
        ("slivers", slivers(12)),
        ("duplicate_faces", duplicate_faces()),
        ("isolated_vertices", isolated_vertices()),
        ("degenerate_faces", degenerate_faces()),
    ]
}

/// A regular tetrahedron, closed, edge √8.
pub fn tetrahedron() -> Mesh {
    let vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        .map(|p: [i32; 3]| DVec3::from_array(p.map(f64::from)));
    mesh(vertices.to_vec(), vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
}

/// The icosahedron on the unit sphere, each triangle split in four `level` times:
/// 10 · 4^level + 2 vertices, outward winding.
pub fn icosphere(level: usize) -> Mesh {
    let t = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices: Vec<DVec3> = [
        [-1.0, t, 0.0],
        [1.0, t, 0.0],
        [-1.0, -t, 0.0],
        [1.0, -t, 0.0],
        [0.0, -1.0, t],
        [0.0, 1.0, t],
        [0.0, -1.0, -t],
        [0.0, 1.0, -t],
        [t, 0.0, -1.0],
        [t, 0.0, 1.0],
        [-t, 0.0, -1.0],
        [-t, 0.0, 1.0],
    ]
    .map(|p| DVec3::from_array(p).normalize())
    .to_vec();
    #[rustfmt::skip]
    let mut faces = vec![
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let point = vertices[a as usize] + vertices[b as usize];
                vertices.push(point.normalize());
                vertices.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    mesh(vertices, faces)
}

/// A wavy square sheet with boundary: `nx` × `ny` vertices over [0, 1]².
pub fn open_grid(nx: usize, ny: usize) -> Mesh {
    let vertices = (0..nx * ny)
        .map(|id| {
            let (i, j) = (id % nx, id / nx);
            let (x, y) = (i as f64 / (nx - 1) as f64, j as f64 / (ny - 1) as f64);
            DVec3::new(x, y, 0.1 * (3.0 * x).sin() * (2.0 * y).cos())
        })
        .collect();
    mesh(vertices, sheet(nx, ny, 0))
}

/// A torus of radii 1 and 0.4, closed, genus 1, `nu` × `nv` vertices.
pub fn torus(nu: usize, nv: usize) -> Mesh {
    let mut vertices = Vec::with_capacity(nu * nv);
    let mut faces = Vec::with_capacity(2 * nu * nv);
    for i in 0..nu {
        for j in 0..nv {
            let (u, v) = (TAU * i as f64 / nu as f64, TAU * j as f64 / nv as f64);
            let ring = 1.0 + 0.4 * v.cos();
            vertices.push(DVec3::new(ring * u.cos(), ring * u.sin(), 0.4 * v.sin()));
            let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                .map(|(i, j)| (i % nu * nv + j % nv) as u32);
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(vertices, faces)
}

/// A Möbius strip: one side, one boundary, no consistent winding. `n` × `width` vertices.
pub fn moebius(n: usize, width: usize) -> Mesh {
    let mut vertices = Vec::with_capacity(n * width);
    let mut faces = Vec::new();
    for i in 0..n {
        let u = TAU * i as f64 / n as f64;
        for j in 0..width {
            let across = 0.3 * (2.0 * j as f64 / (width - 1) as f64 - 1.0);
            let ring = 1.0 + across * (u / 2.0).cos();
            vertices.push(DVec3::new(ring * u.cos(), ring * u.sin(), across * (u / 2.0).sin()));
        }
        // After one turn the strip meets itself upside down.
        let id = |i: usize, j: usize| (if i == n { width - 1 - j } else { i * width + j }) as u32;
        for j in 0..width - 1 {
            let (a, b, c, d) = (id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1));
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(vertices, faces)
}

/// A book of `pages` flat sheets that share their spine: its edges have `pages` triangles each.
pub fn book(pages: usize, nx: usize, ny: usize) -> Mesh {
    let mut vertices: Vec<DVec3> =
        (0..ny).map(|j| DVec3::new(0.0, 0.0, j as f64 / (ny - 1) as f64)).collect();
    let mut faces = Vec::new();
    for page in 0..pages {
        let angle = TAU * page as f64 / pages as f64 + 0.2 * page as f64;
        let first = vertices.len();
        for j in 0..ny {
            for i in 1..nx {
                let r = i as f64 / (nx - 1) as f64;
                vertices.push(DVec3::new(
                    r * angle.cos(),
                    r * angle.sin(),
                    j as f64 / (ny - 1) as f64,
                ));
            }
        }
        let id =
            |i: u32, j: u32| if i == 0 { j } else { first as u32 + j * (nx as u32 - 1) + i - 1 };
        let local = sheet(nx, ny, 0);
        faces.extend(local.iter().map(|f| f.map(|v| id(v % nx as u32, v / nx as u32))));
    }
    mesh(vertices, faces)
}

/// A sphere and a torus that do not touch.
pub fn two_components() -> Mesh {
    let (sphere, ring) = (icosphere(1), torus(12, 8));
    let offset = sphere.n_vertices() as u32;
    let mut vertices = sphere.vertices().to_vec();
    vertices.extend(ring.vertices().iter().map(|&p| p + DVec3::new(3.0, 0.0, 0.0)));
    let mut faces = sphere.faces().to_vec();
    faces.extend(ring.faces().iter().map(|f| f.map(|id| id + offset)));
    mesh(vertices, faces)
}

/// A cylinder without lids whose triangles are up to a million times longer than wide, one ring
/// of them exactly flat.
pub fn slivers(n: usize) -> Mesh {
    let heights = [0.0, 1.0, 1.0 + 1e-6, 1.0 + 1e-6, 2.0, 5.0];
    let mut vertices = Vec::new();
    for (row, &z) in heights.iter().enumerate() {
        for i in 0..n {
            let angle = TAU * (i as f64 + 0.1 * row as f64 * f64::from(row != 3)) / n as f64;
            let angle = if row == 3 { TAU * (i as f64 + 0.2) / n as f64 } else { angle };
            vertices.push(DVec3::new(angle.cos(), angle.sin(), z));
        }
    }
    let mut faces = Vec::new();
    for row in 0..heights.len() - 1 {
        for i in 0..n {
            let [a, b, c, d] = [(row, i), (row, i + 1), (row + 1, i + 1), (row + 1, i)]
                .map(|(row, i)| (row * n + i % n) as u32);
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(vertices, faces)
}

/// A sphere with some triangles twice, one of them with the opposite winding.
pub fn duplicate_faces() -> Mesh {
    let sphere = icosphere(1);
    let mut faces = sphere.faces().to_vec();
    let [a, b, c] = faces[11];
    faces.extend([faces[3], faces[4], [c, b, a], faces[40]]);
    mesh(sphere.vertices().to_vec(), faces)
}

/// A grid among whose vertices some belong to no triangle: the first, one in the middle, the last.
pub fn isolated_vertices() -> Mesh {
    let grid = open_grid(6, 5);
    let mut vertices = vec![DVec3::new(9.0, 9.0, 9.0)];
    vertices.extend(&grid.vertices()[..14]);
    vertices.push(DVec3::new(0.5, 0.5, 1.0));
    vertices.extend(&grid.vertices()[14..]);
    vertices.push(DVec3::new(-3.0, 0.0, 0.0));
    let faces = grid.faces().iter().map(|f| f.map(|id| id + 1 + u32::from(id >= 14))).collect();
    mesh(vertices, faces)
}

/// A grid with triangles that name a vertex twice, and one between three vertices on one line.
pub fn degenerate_faces() -> Mesh {
    let grid = open_grid(6, 5);
    let mut faces = grid.faces().to_vec();
    faces.extend([[3, 3, 9], [7, 7, 7], [0, 1, 2]]);
    let mut vertices = grid.vertices().to_vec();
    vertices[1] = (vertices[0] + vertices[2]) / 2.0;
    mesh(vertices, faces)
}

/// The same triangles, each with three vertices of its own, as STL files and flat shading have them.
pub fn as_soup(mesh: &Mesh) -> Mesh {
    let vertices = mesh.faces().iter().flatten().map(|&id| mesh.vertices()[id as usize]);
    let faces = (0..mesh.n_faces() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]);
    self::mesh(vertices.collect(), faces.collect())
}

/// `n` points on the unit sphere along a golden-angle spiral (no mesh: for point clouds).
pub fn spiral_cloud(n: usize) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / n as f64;
            let (ring, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            DVec3::new(ring * angle.cos(), ring * angle.sin(), z)
        })
        .collect()
}

/// Two triangles for each cell of an `nx` × `ny` grid of vertices, ids from `first`.
fn sheet(nx: usize, ny: usize, first: usize) -> Vec<[u32; 3]> {
    let cells = (0..ny - 1).flat_map(|j| (0..nx - 1).map(move |i| (first + j * nx + i) as u32));
    let row = nx as u32;
    cells.flat_map(|a| [[a, a + 1, a + 1 + row], [a, a + 1 + row, a + row]]).collect()
}

fn mesh(vertices: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Mesh {
    Mesh::new(vertices, faces).expect("the formulas above give finite points and ids in range")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_meshes_have_the_counts_their_formulas_say() {
        assert_eq!(icosphere(2).n_vertices(), 162);
        assert_eq!(torus(24, 12).n_vertices(), 288);
        assert!((icosphere(4).area() / (4.0 * PI) - 1.0).abs() < 5e-3);
        assert!(all().iter().all(|(name, mesh)| mesh.area() > 0.0 && !name.is_empty()));
    }
}
