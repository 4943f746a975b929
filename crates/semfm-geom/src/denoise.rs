//! Noise on the vertices of a mesh: how much there is, and the surface without it.
//!
//! A coarse reconstruction puts each vertex somewhat off the surface. Pictures of it show every facet in another
//! light, and its area and its spectrum are those of a crumpled sheet. What is computed from a mesh (views, lifting,
//! working mesh) is therefore computed from a smooth copy where the mesh is noisy, and from the mesh itself where it
//! is not: below the least noise nothing changes by a single bit.

use std::borrow::Cow;
use std::collections::BTreeMap;

use faer::Mat;
use faer::linalg::solvers::Solve;

use crate::connectivity::VertexAdjacency;
use crate::math::DVec3;
use crate::{Mesh, Welded};

/// Noise below this share of the diagonal is left alone.
const LEAST_NOISE: f64 = 0.002;
/// Nor is noise below this share of the median edge told apart from the corners of a coarse mesh.
const LEAST_BESIDE_EDGES: f64 = 0.15;
/// Vertices whose neighbourhoods are looked at.
const N_LOOKED_AT: usize = 400;
/// A neighbourhood must have so many vertices for a quadratic surface through it to say anything.
const LEAST_NEIGHBOURHOOD: usize = 10;
/// One of more vertices, around the hub of a fan, is not local, and is not looked at.
const MOST_NEIGHBOURHOOD: usize = 400;
/// Vertices whose normals have a smaller cosine with the middle one's are on another side of the object: two edges may
/// reach around a thin bar.
const SAME_SIDE: f64 = 0.2;
/// Fewer vertices than this say nothing of noise.
const LEAST_LOOKED_AT: usize = 100;
/// The share of the neighbourhoods that have less than the noise told: noise is everywhere alike, creases and corners
/// are not.
const QUANTILE: f64 = 0.25;
/// Steps of Taubin's filter: forth, and back by so much that the surface does not shrink.
const FORTH: f64 = 0.5;
const BACK: f64 = -0.53;
/// Pairs of steps for noise as large as the edges are long; fewer for less.
const MOST_PAIRS: f64 = 40.0;

/// Standard deviation of the noise of a mesh's vertices across its surface, in the mesh's units; none where too few
/// vertices have neighbours that tell.
///
/// Each of some vertices is held, with the vertices up to two edges away, against the quadratic surface that fits them
/// best; the lower quartile of the deviations is the noise.
fn vertex_noise(mesh: &Mesh) -> Option<f64> {
    let n = mesh.n_vertices();
    let looked_at: Vec<u32> = (0..n as u32).step_by(n.div_ceil(N_LOOKED_AT).max(1)).collect();
    let near = neighbours(mesh, &looked_at);
    let mut ring: Vec<u32> = near.values().flatten().copied().collect();
    ring.sort_unstable();
    ring.dedup();
    let far = neighbours(mesh, &ring);
    let normals = vertex_normals(mesh);
    let neighbourhoods = near.iter().filter_map(|(v, near)| {
        let far = near.iter().filter_map(|u| far.get(u)).flatten();
        let mut ids: Vec<u32> =
            near.iter().chain(far).chain([v]).copied().take(6 * MOST_NEIGHBOURHOOD).collect();
        ids.sort_unstable();
        ids.dedup();
        let here = normals[*v as usize];
        ids.retain(|&u| normals[u as usize].dot(here) >= SAME_SIDE);
        let points = ids.iter().map(|&u| mesh.vertices()[u as usize]);
        (ids.len() <= MOST_NEIGHBOURHOOD).then(|| points.collect::<Vec<DVec3>>())
    });
    let mut deviations: Vec<f64> = neighbourhoods.filter_map(|points| deviation(&points)).collect();
    if deviations.len() < LEAST_LOOKED_AT {
        return None;
    }
    deviations.sort_by(f64::total_cmp);
    Some(deviations[(QUANTILE * deviations.len() as f64) as usize])
}

/// Unit normals at the vertices (n), by area; zero where triangles cancel.
fn vertex_normals(mesh: &Mesh) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.n_vertices()];
    for (face, ids) in mesh.faces().iter().enumerate() {
        let scaled = mesh.face_normal_scaled(face);
        ids.iter().for_each(|&id| normals[id as usize] += scaled);
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// The vertices that share an edge with each of the wanted ones, repeated for each triangle.
fn neighbours(mesh: &Mesh, wanted: &[u32]) -> BTreeMap<u32, Vec<u32>> {
    let mut is_wanted = vec![false; mesh.n_vertices()];
    wanted.iter().for_each(|&v| is_wanted[v as usize] = true);
    let mut found = BTreeMap::<u32, Vec<u32>>::new();
    for &[a, b, c] in mesh.faces() {
        for [v, left, right] in [[a, b, c], [b, c, a], [c, a, b]] {
            if is_wanted[v as usize] {
                found.entry(v).or_default().extend([left, right]);
            }
        }
    }
    found
}

/// The mesh with its vertices moved where they are without noise; `None` where there is little.
///
/// Vertices and triangles keep their numbers. A low-pass filter moves vertices to and from the mean of their neighbours
/// (Taubin, "A signal processing approach to fair surface design", 1995), more often the larger the noise is beside the
/// edges. Vertices at one place, on both sides of a seam, move as one.
pub(crate) fn without_noise(mesh: &Mesh) -> Option<Mesh> {
    // Joining takes longer than looking: the mesh as it is stored tells whether it is worth it. Where most triangles
    // have vertices of their own it does not tell.
    let least = LEAST_NOISE * mesh.diagonal();
    if vertex_noise(mesh).is_some_and(|noise| noise < least) {
        return None;
    }
    let Welded { mesh: welded, of_original, .. } = Welded::new(mesh);
    let noise = vertex_noise(&welded)?;
    // Of 30 clean meshes of real objects none has more than .0008 of the diagonal; with noise of .003 all have at least
    // .0023.
    if noise < least {
        return None;
    }
    let edge = welded.median_edge();
    if noise < LEAST_BESIDE_EDGES * edge {
        return None;
    }
    let adjacency = VertexAdjacency::new(&welded);
    let pairs = (MOST_PAIRS * (noise / edge).min(1.0)).ceil() as usize;
    let mut points = welded.vertices().to_vec();
    for _ in 0..pairs {
        for weight in [FORTH, BACK] {
            points = moved(&points, &adjacency, weight);
        }
    }
    let points = of_original.iter().map(|&v| points[v as usize]).collect();
    Mesh::new(points, mesh.faces().to_vec()).ok()
}

/// The mesh with its vertices moved where they are without noise, or the mesh itself where there is little (less than
/// .2 % of the diagonal): what views, features and maps are computed from. Vertices and triangles keep their numbers.
///
/// ```
/// use semfm_geom::{Mesh, math::DVec3, noise_free};
/// let triangle = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// assert_eq!(noise_free(&triangle).hash(), triangle.hash());
/// # Ok::<(), semfm_geom::Error>(())
/// ```
pub fn noise_free(mesh: &Mesh) -> Cow<'_, Mesh> {
    without_noise(mesh).map_or(Cow::Borrowed(mesh), Cow::Owned)
}

/// Each point moved by `weight` of the way to the mean of its neighbours.
fn moved(points: &[DVec3], adjacency: &VertexAdjacency, weight: f64) -> Vec<DVec3> {
    let moved = points.iter().enumerate().map(|(v, &p)| {
        let neighbours = adjacency.of(v);
        if neighbours.is_empty() {
            return p;
        }
        let sum: DVec3 = neighbours.iter().map(|&u| points[u as usize]).sum();
        p + weight * (sum / neighbours.len() as f64 - p)
    });
    moved.collect()
}

/// Root of the mean squared distance of points from the quadratic surface z = a + b x + c y + d x² + e xy + f y² that fits
/// them best, z across their plane, degrees of freedom counted; none for too few points or points on a line.
fn deviation(points: &[DVec3]) -> Option<f64> {
    if points.len() < LEAST_NEIGHBOURHOOD {
        return None;
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    let covariance = Mat::from_fn(3, 3, |i, j| {
        points.iter().map(|&p| (p - middle)[i] * (p - middle)[j]).sum::<f64>()
    });
    let eigen = covariance.self_adjoint_eigen(faer::Side::Lower).ok()?;
    let axis = |j: usize| DVec3::new(eigen.U()[(0, j)], eigen.U()[(1, j)], eigen.U()[(2, j)]);
    let [across, second, first] = [axis(0), axis(1), axis(2)];
    let size = (eigen.S().column_vector()[2] / points.len() as f64).sqrt();
    let row = |p: DVec3| {
        let (x, y) = ((p - middle).dot(first) / size, (p - middle).dot(second) / size);
        [1.0, x, y, x * x, x * y, y * y]
    };
    let (mut normal, mut right) = (Mat::<f64>::zeros(6, 6), Mat::<f64>::zeros(6, 1));
    for &p in points {
        let (row, z) = (row(p), (p - middle).dot(across));
        for (i, a) in row.iter().enumerate() {
            right[(i, 0)] += a * z;
            row.iter().enumerate().for_each(|(j, b)| normal[(i, j)] += a * b);
        }
    }
    let fit = normal.llt(faer::Side::Lower).ok()?.solve(&right);
    let squares = points.iter().map(|&p| {
        let z: f64 = row(p).iter().enumerate().map(|(i, x)| x * fit[(i, 0)]).sum();
        ((p - middle).dot(across) - z).powi(2)
    });
    let variance = squares.sum::<f64>() / (points.len() - 6) as f64;
    Some(variance.sqrt()).filter(|deviation| deviation.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The vertices moved by up to ± `reach` along each axis: standard deviation reach/√3.
    fn noisy(mesh: &Mesh, reach: f64) -> Mesh {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut off = || (2.0 * rng.random::<f64>() - 1.0) * reach;
        let vertices = mesh.vertices().iter().map(|&p| p + DVec3::new(off(), off(), off()));
        Mesh::new(vertices.collect(), mesh.faces().to_vec()).unwrap()
    }

    #[test]
    fn noise_is_told_and_taken_away() {
        let ball = zoo::icosphere(5); // radius 1
        for reach in [0.03, 0.06] {
            let mesh = noisy(&ball, reach);
            let told = vertex_noise(&mesh).unwrap() * 3f64.sqrt() / reach;
            assert!((0.6..1.2).contains(&told), "{told} of the noise is told");
            let smooth = without_noise(&mesh).unwrap();
            assert_eq!(smooth.faces(), mesh.faces());
            let off = |mesh: &Mesh| {
                let squares = mesh.vertices().iter().map(|p| (p.length() - 1.0).powi(2));
                (squares.sum::<f64>() / mesh.n_vertices() as f64).sqrt()
            };
            assert!(off(&smooth) < 0.4 * off(&mesh), "{} of {}", off(&smooth), off(&mesh));
        }
    }

    #[test]
    fn clean_meshes_stay_as_they_are() {
        for (name, mesh) in zoo::all() {
            assert!(without_noise(&mesh).is_none(), "{name}: {:?}", vertex_noise(&mesh));
        }
        assert!(without_noise(&zoo::icosphere(4)).is_none());
    }

    #[test]
    fn a_seam_stays_closed() {
        let ball = noisy(&zoo::icosphere(4), 0.05);
        // Triangles above a height have vertices of their own: none, half of them, all.
        for height in [2.0, 0.0, -2.0] {
            let mut vertices = ball.vertices().to_vec();
            let mut faces = ball.faces().to_vec();
            for face in &mut faces {
                if face.iter().all(|&v| ball.vertices()[v as usize].z > height) {
                    *face = face.map(|v| {
                        vertices.push(ball.vertices()[v as usize]);
                        vertices.len() as u32 - 1
                    });
                }
            }
            let smooth = without_noise(&Mesh::new(vertices, faces).unwrap()).unwrap();
            assert_eq!(Welded::new(&smooth).mesh.n_vertices(), ball.n_vertices());
        }
    }

    #[test]
    fn a_thin_bar_of_few_triangles_is_no_noise() {
        let corner = |i: u32| match i % 4 {
            0 => (0.5, 0.5),
            1 => (-0.5, 0.5),
            2 => (-0.5, -0.5),
            _ => (0.5, -0.5),
        };
        let n = 200;
        let vertices = (0..4 * n).map(|i| {
            let (x, y) = corner(i);
            DVec3::new(x, y, f64::from(i / 4))
        });
        let faces = (0..4 * (n - 1)).flat_map(|i| {
            let next = if i % 4 == 3 { i - 3 } else { i + 1 };
            [[i, next, i + 4], [next, next + 4, i + 4]]
        });
        let bar = Mesh::new(vertices.collect(), faces.collect()).unwrap();
        assert!(without_noise(&bar).is_none(), "{:?} of {}", vertex_noise(&bar), bar.diagonal());
    }
}
