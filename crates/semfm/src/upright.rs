//! Which way is up: objects that lie on their side are hard to read in pictures and viewers.

use semfm_geom::math::{DQuat, DVec3, bounds};
use semfm_geom::sampling::fibonacci_directions;
use semfm_geom::{Mesh, principal_axes};

use crate::{Error, Result};

/// How well an object must stand. Of 120 real objects one, a wrench with rounded edges, is below.
const LEAST_STABILITY: f64 = 0.006;
/// How high above the lowest point the ground reaches, as a share of the height, and how little what
/// lies on it may be tilted (cosine).
const GROUND: f64 = 0.04;
const FLAT: f64 = 0.92;
/// The file's y and z count this much more: nobody exports a table with its top on the ground. With
/// 1.5, five of eight real mugs lay on their side, leaning on the handle; with 3, two do.
const FILE_AXIS: f64 = 3.0;
/// Directions in which the ground is measured.
const N_WIDTHS: usize = 8;
/// More triangles than this are thinned out; the way up needs no more.
const N_FACETS: usize = 30_000;
/// Directions that normals are sorted into, and how many of the fullest are tried as the ground.
const N_BINS: usize = 96;
const N_FLAT_SIDES: usize = 16;

/// Which way is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Upright {
    /// Unit vector in the mesh's coordinates.
    pub up: DVec3,
    /// Whether the object has a foot to stand on, so that `up` is more than a guess.
    pub is_sure: bool,
}

/// The way up in which the object stands best: the file's y or z where they do nearly as well, the
/// longest principal axis where it does not stand.
///
/// # Errors
/// [`Error::Invalid`] for a mesh without vertices, [`semfm_geom::Error::NoArea`] for one without
/// principal axes.
pub fn upright(mesh: &Mesh) -> Result<Upright> {
    let Some((low, high)) = bounds(mesh.vertices()) else {
        return Err(Error::invalid("mesh to be shown", "vertices", "none"));
    };
    let middle = (low + high) / 2.0;
    let facets = Facets::new(mesh, middle);
    let flat = facets.flat_sides().into_iter().map(|normal| (-normal, 1.0));
    let candidates = flat.chain([(DVec3::Y, FILE_AXIS), (DVec3::Z, FILE_AXIS)]);
    let (up, score) = candidates
        .map(|(up, bonus)| (up, bonus * facets.stability(up)))
        .fold((DVec3::Z, 0.0), |best, next| if next.1 > best.1 { next } else { best });
    let is_sure = score >= LEAST_STABILITY;
    Ok(Upright { up: if is_sure { up } else { principal_axes(mesh)?.row(2) }, is_sure })
}

impl Upright {
    /// The shortest rotation that turns the object's up to the y of a viewer: scene from mesh.
    pub fn y_up_from_mesh(&self) -> DQuat {
        DQuat::from_rotation_arc(self.up, DVec3::Y)
    }
}

/// Triangles about the middle of the object.
struct Facets {
    /// The corners of all of them, each once.
    points: Vec<DVec3>,
    facets: Vec<Facet>,
}

struct Facet {
    /// Twice the area long.
    normal: DVec3,
    /// Length of the normal.
    area: f64,
    /// Sum of the corners.
    sum: DVec3,
    corners: [DVec3; 3],
}

impl Facets {
    fn new(mesh: &Mesh, middle: DVec3) -> Self {
        let step = mesh.n_faces().div_ceil(N_FACETS).max(1);
        let chosen = || (0..mesh.n_faces()).step_by(step);
        let mut is_corner = vec![false; mesh.n_vertices()];
        chosen().flat_map(|face| mesh.faces()[face]).for_each(|v| is_corner[v as usize] = true);
        let vertices = mesh.vertices().iter().zip(is_corner);
        let points = vertices.filter(|(_, is_corner)| *is_corner).map(|(&p, _)| p - middle);
        let facets = chosen().map(|face| {
            let corners @ [a, b, c] = mesh.corners(face).map(|p| p - middle);
            let normal = (b - a).cross(c - a);
            Facet { normal, area: normal.length(), sum: corners.iter().sum(), corners }
        });
        Self { points: points.collect(), facets: facets.collect() }
    }

    /// Normals of the largest flat parts of the surface.
    fn flat_sides(&self) -> Vec<DVec3> {
        let bins: Vec<DVec3> = fibonacci_directions(N_BINS).collect();
        let mut sums = vec![DVec3::ZERO; bins.len()];
        for facet in &self.facets {
            sums[nearest_direction(&bins, facet.normal)] += facet.normal;
        }
        sums.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        sums.into_iter().take(N_FLAT_SIDES).filter_map(DVec3::try_normalize).collect()
    }

    /// How well the object stands with this side up: the share of the surface that lies flat on the ground,
    /// times how far the ground reaches as a share of the object's width where that is least. The first
    /// alone would stand a bottle on its side, the second alone a mug on its rim.
    fn stability(&self, up: DVec3) -> f64 {
        // Heights of the middles.
        let heights: Vec<f64> = self.facets.iter().map(|facet| facet.sum.dot(up) / 3.0).collect();
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut flat, mut total) = (0.0, 0.0);
        let mut ground = Vec::new();
        for (facet, height) in self.facets.iter().zip(heights) {
            total += facet.area;
            if height - low < GROUND * (high - low) {
                ground.extend(facet.corners);
                if facet.normal.dot(up) < -FLAT * facet.area {
                    flat += facet.area;
                }
            }
        }
        let x = up.any_orthonormal_vector();
        let y = up.cross(x);
        let reach = (0..N_WIDTHS)
            .map(|i| {
                let (sin, cos) = (std::f64::consts::PI * i as f64 / N_WIDTHS as f64).sin_cos();
                let along = cos * x + sin * y;
                width(&ground, along) / width(&self.points, along)
            })
            .fold(1.0, f64::min);
        if total > 0.0 { flat / total * reach } else { 0.0 }
    }
}

/// The direction with the largest product; the first of equals.
fn nearest_direction(directions: &[DVec3], normal: DVec3) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (i, direction) in directions.iter().enumerate() {
        let product = direction.dot(normal);
        if product > best.1 {
            best = (i, product);
        }
    }
    best.0
}

/// Extent of points along a direction.
fn width(points: &[DVec3], along: DVec3) -> f64 {
    let (low, high) = points
        .iter()
        .map(|point| point.dot(along))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    (high - low).max(0.0)
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DMat3;
    use semfm_geom::zoo;

    use super::*;

    fn turned(mesh: &Mesh, turn: DMat3) -> Mesh {
        let vertices = mesh.vertices().iter().map(|&p| turn * p).collect();
        Mesh::new(vertices, mesh.faces().to_vec()).unwrap()
    }

    fn block(half_extents: DVec3) -> Mesh {
        let (points, faces) = parry3d_f64::shape::Cuboid::new(half_extents).to_trimesh();
        Mesh::new(points, faces).unwrap()
    }

    #[test]
    fn a_block_on_its_foot_is_upright_and_a_ball_has_a_way_up() {
        // The larger foot decides.
        assert_eq!(upright(&block(DVec3::new(1.0, 0.2, 1.0))).unwrap().up, DVec3::Y);
        assert_eq!(upright(&block(DVec3::new(1.0, 1.0, 0.2))).unwrap().up, DVec3::Z);
        let tilt = DMat3::from_rotation_x(0.6) * DMat3::from_rotation_y(0.3);
        let tilted = upright(&turned(&block(DVec3::new(1.0, 1.0, 0.2)), tilt)).unwrap();
        assert!(tilted.is_sure && tilted.up.dot(tilt.z_axis).abs() > 0.999);
        let standing = turned(
            &block(DVec3::new(1.0, 1.0, 0.2)),
            DMat3::from_quat(tilted.y_up_from_mesh()) * tilt,
        );
        assert!(upright(&standing).unwrap().up.dot(DVec3::Y) > 0.999);
        assert!((upright(&zoo::icosphere(3)).unwrap().up.length() - 1.0).abs() < 1e-9);
    }
}
