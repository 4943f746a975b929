//! Spatial search on a surface: the point nearest to a query, the first triangle a ray meets,
//! whether two points see each other.

use std::fmt;

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray};
use parry3d_f64::shape::Triangle;

use crate::math::DVec3;
use crate::weld::repeated_faces;
use crate::{Error, Mesh, Result};

/// Bounding boxes are widened by this share of the diagonal, so that rounding in the slab test
/// never hides a triangle that lies flat in its own box. Rounding is about 1e-15; widening up to
/// 1e-6 costs no measurable time.
const BOX_MARGIN: f64 = 1e-12;

/// A point on a surface: the triangle, where in the triangle, and how far from the query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Triangle id in the mesh that the index was built from.
    pub face: u32,
    /// Barycentric weights of the triangle's corners, each in [0, 1], adding up to 1.
    pub barycentric: [f64; 3],
    /// Position.
    pub point: DVec3,
    /// Distance from the query to `point`.
    pub distance: f64,
}

/// Where a ray first meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Triangle id in the mesh that the index was built from.
    pub face: u32,
    /// The hit is at `origin + t · direction`, t ≥ 0.
    pub t: f64,
    /// Barycentric weights of the triangle's corners, each in [0, 1], adding up to 1.
    pub barycentric: [f64; 3],
}

/// A tree of boxes over the triangles of a mesh: built once, asked often, from any thread.
///
/// Triangles without area are left out: they have no inside, and their neighbours cover their
/// edges. So are those that coincide with an earlier one. Both sides of a triangle count, whatever its winding.
///
/// ```
/// use semfm_geom::{Mesh, SurfaceIndex, math::DVec3};
/// let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// let surface = SurfaceIndex::new(&mesh)?;
/// let nearest = surface.closest(DVec3::new(0.25, 0.25, 3.0)).unwrap();
/// assert_eq!((nearest.distance, nearest.barycentric), (3.0, [0.5, 0.25, 0.25]));
/// let hit = surface.first_hit(DVec3::new(0.25, 0.25, 3.0), DVec3::NEG_Z).unwrap();
/// assert_eq!((hit.face, hit.t), (0, 3.0));
/// # Ok::<(), semfm_geom::Error>(())
/// ```
pub struct SurfaceIndex {
    /// The triangles with an area: corners, and id in the mesh. The tree numbers them 0, 1, 2 …
    /// (given ids with gaps, parry 0.31 panics on a tree of one leaf).
    triangles: Vec<([DVec3; 3], u32)>,
    tree: Bvh,
}

impl SurfaceIndex {
    /// Builds the tree over the triangles of `mesh` (about .5 µs a triangle).
    ///
    /// # Errors
    /// [`Error::NoArea`] where every triangle is degenerate.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let repeated = repeated_faces(mesh);
        let triangles: Vec<([DVec3; 3], u32)> = (0..mesh.n_faces())
            .filter(|&face| mesh.face_area(face) > 0.0)
            .filter(|&face| repeated.as_ref().is_none_or(|repeated| !repeated[face]))
            .map(|face| (mesh.corners(face), face as u32))
            .collect();
        if triangles.is_empty() {
            return Err(Error::NoArea { n_faces: mesh.n_faces() });
        }
        let margin = DVec3::splat(BOX_MARGIN * mesh.diagonal());
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|&([a, b, c], _)| Aabb::new(a.min(b).min(c) - margin, a.max(b).max(c) + margin))
            .collect();
        Ok(Self { triangles, tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes) })
    }

    /// The point of the surface nearest to `query`; `None` only where a coordinate of `query` is
    /// not finite or so large that its square is not.
    pub fn closest(&self, query: DVec3) -> Option<SurfacePoint> {
        self.closest_among(query, f64::MAX, |_| true)
    }

    /// The nearest point closer than `within` among the triangles that `counts` lets pass (by id in
    /// the mesh): those that face a sensor, say, so that a thin wall's far side does not answer for
    /// its near one. The shorter `within`, the sooner the answer; `None` where no triangle counts.
    pub fn closest_among(
        &self,
        query: DVec3,
        within: f64,
        counts: impl Fn(u32) -> bool,
    ) -> Option<SurfacePoint> {
        let (leaf, (distance, (point, barycentric))) = self.tree.find_best(
            within,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(query, true),
            |leaf, _| {
                let ([a, b, c], face) = self.triangles[leaf as usize];
                if !counts(face) {
                    return None;
                }
                let (hit, place) =
                    Triangle::new(a, b, c).project_local_point_and_get_location(query, true);
                Some((hit.point.distance(query), (hit.point, place.barycentric_coordinates()?)))
            },
        )?;
        Some(SurfacePoint { face: self.triangles[leaf as usize].1, barycentric, point, distance })
    }

    /// The first triangle on the ray `origin + t · direction`, t ≥ 0; `None` for a miss, for a
    /// direction of length 0 and for numbers that are not finite.
    ///
    /// Rays do not slip through between two triangles that share an edge (see `WatertightRay`).
    pub fn first_hit(&self, origin: DVec3, direction: DVec3) -> Option<RayHit> {
        let watertight = WatertightRay::new(origin, direction)?;
        let ray = Ray::new(origin, direction);
        let (leaf, (t, barycentric)) = self.tree.find_best(
            f64::MAX,
            |node: &BvhNode, best| node.cast_ray(&ray, best),
            |leaf, _| watertight.hit(self.triangles[leaf as usize].0),
        )?;
        Some(RayHit { face: self.triangles[leaf as usize].1, t, barycentric })
    }

    /// Whether any triangle stands between `from` and `to`, farther than `margin` (a length) from
    /// both of them. With a margin, a point on the surface does not hide itself.
    pub fn blocked(&self, from: DVec3, to: DVec3, margin: f64) -> bool {
        let length = from.distance(to);
        let Some(watertight) = WatertightRay::new(from, to - from) else { return false };
        let ray = Ray::new(from, to - from);
        let (near, far) = (margin / length, 1.0 - margin / length);
        self.tree.leaves(|node: &BvhNode| node.cast_ray(&ray, far) <= far).any(|leaf| {
            watertight
                .hit(self.triangles[leaf as usize].0)
                .is_some_and(|(t, _)| t > near && t < far)
        })
    }
}

impl fmt::Debug for SurfaceIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SurfaceIndex")
            .field("n_triangles", &self.triangles.len())
            .finish_non_exhaustive()
    }
}

/// The ray–triangle test of Woop, Benthin & Wald (Watertight Ray/Triangle Intersection, 2013): the
/// ray is sheared onto the z axis, and a triangle is hit where its three signed edge areas around
/// the origin agree. Two triangles compute a shared edge's area with exactly opposite signs, so
/// that a ray cannot miss both.
struct WatertightRay {
    origin: DVec3,
    axes: [usize; 3],
    shear: DVec3,
}

impl WatertightRay {
    fn new(origin: DVec3, direction: DVec3) -> Option<Self> {
        if !(origin.is_finite() && direction.is_finite() && direction != DVec3::ZERO) {
            return None;
        }
        let z = direction.abs().max_position();
        // Swapping the other two for a backward ray would keep the winding; both sides count here.
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let shear = DVec3::new(direction[x], direction[y], 1.0) / direction[z];
        shear.is_finite().then_some(Self { origin, axes: [x, y, z], shear })
    }

    /// `t` and the barycentric weights of the hit.
    fn hit(&self, corners: [DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|corner| {
            let p = corner - self.origin;
            DVec3::new(p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], self.shear.z * p[z])
        });
        let areas = [c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x];
        let sum = areas[0] + areas[1] + areas[2];
        let mixed = areas.iter().any(|&u| u < 0.0) && areas.iter().any(|&u| u > 0.0);
        if mixed || sum == 0.0 {
            return None;
        }
        let barycentric = areas.map(|u| u / sum);
        let t = barycentric[0] * a.z + barycentric[1] * b.z + barycentric[2] * c.z;
        (t >= 0.0).then_some((t, barycentric))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DQuat;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn direction(rng: &mut ChaCha8Rng) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| rng.random::<f64>() - 0.5)).normalize()
    }

    /// An octahedron whose triangles are split `levels` times, corners on the unit sphere.
    fn sphere(levels: usize) -> Mesh {
        let mut points =
            vec![DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut faces: Vec<[u32; 3]> =
            (0..4).flat_map(|i| [[i, (i + 1) % 4, 4], [(i + 1) % 4, i, 5]]).collect();
        for _ in 0..levels {
            let mut middles = std::collections::HashMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push((points[a as usize] + points[b as usize]).normalize());
                    points.len() as u32 - 1
                })
            };
            faces = faces
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        Mesh::new(points, faces).unwrap()
    }

    #[test]
    fn no_ray_from_inside_leaves_a_closed_surface_even_through_its_corners() {
        let mesh = sphere(3);
        let turned = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let points = mesh.vertices().iter().map(|&p| turned * p + 5.0 * DVec3::ONE).collect();
        let mesh = Mesh::new(points, mesh.faces().to_vec()).unwrap();
        let surface = SurfaceIndex::new(&mesh).unwrap();
        let origin = 5.0 * DVec3::ONE + DVec3::new(0.1, -0.2, 0.05);
        let corners = mesh.vertices().iter().map(|&p| p - origin);
        let edges = mesh.faces().iter().map(|f| {
            mesh.vertices()[f[0] as usize].midpoint(mesh.vertices()[f[1] as usize]) - origin
        });
        for ray in corners.chain(edges) {
            let hit = surface.first_hit(origin, ray).expect("the surface is closed");
            assert!((hit.t - 1.0).abs() < 1e-9, "hit at t = {}", hit.t);
        }
    }

    #[test]
    fn only_triangles_that_count_answer_and_only_within_reach() {
        let mesh = sphere(2);
        let surface = SurfaceIndex::new(&mesh).unwrap();
        let upper = |face: u32| mesh.face_normal_scaled(face as usize).z > 0.0;
        let below = DVec3::new(0.1, 0.2, -0.9);
        let hit = surface.closest_among(below, f64::MAX, upper).unwrap();
        assert!(upper(hit.face) && hit.distance > 0.8, "{hit:?}");
        assert!(surface.closest_among(below, 0.5, upper).is_none());
        assert!(surface.closest_among(below, 0.5, |_| true).is_some());
    }

    #[test]
    fn the_nearest_point_and_the_first_hit_are_those_of_a_full_search() {
        let mesh = sphere(2);
        let surface = SurfaceIndex::new(&mesh).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..200 {
            let query = direction(&mut rng) * (3.0 * rng.random::<f64>());
            let nearest = surface.closest(query).unwrap();
            let corners = mesh.corners(nearest.face as usize);
            let mixed: DVec3 = (0..3).map(|k| nearest.barycentric[k] * corners[k]).sum();
            assert!(mixed.distance(nearest.point) < 1e-14);
            let least = (0..mesh.n_faces())
                .map(|face| {
                    let [a, b, c] = mesh.corners(face);
                    Triangle::new(a, b, c).distance_to_local_point(query, true)
                })
                .fold(f64::INFINITY, f64::min);
            assert!((nearest.distance - least).abs() < 1e-14);

            let ray = direction(&mut rng);
            let watertight = WatertightRay::new(query, ray).unwrap();
            let first = (0..mesh.n_faces())
                .filter_map(|face| watertight.hit(mesh.corners(face)))
                .map(|(t, _)| t)
                .min_by(f64::total_cmp);
            assert_eq!(surface.first_hit(query, ray).map(|hit| hit.t), first);
            let far_end = query + 10.0 * ray;
            assert_eq!(surface.blocked(query, far_end, 1e-9), first.is_some());
        }
    }

    #[test]
    fn a_point_on_the_near_side_is_seen_and_one_on_the_far_side_is_not() {
        let surface = SurfaceIndex::new(&sphere(3)).unwrap();
        let eye = DVec3::new(4.0, 0.3, 0.2);
        let near = surface.closest(eye).unwrap().point;
        let far = surface.closest(-eye).unwrap().point;
        assert!(!surface.blocked(eye, near, 1e-6) && surface.blocked(eye, far, 1e-6));
        assert!(!surface.blocked(eye, eye, 1e-6), "a segment of length 0 meets nothing");
    }

    #[test]
    fn degenerate_triangles_and_numbers_that_are_none_do_not_trouble_it() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, 2.0 * DVec3::X];
        let mesh = Mesh::new(points.clone(), vec![[0, 1, 3], [0, 0, 1], [0, 1, 2]]).unwrap();
        let surface = SurfaceIndex::new(&mesh).unwrap();
        assert_eq!(surface.closest(DVec3::new(0.2, 0.2, 1.0)).unwrap().face, 2);
        let bad = DVec3::new(f64::NAN, 0.0, 0.0);
        assert!(surface.closest(bad).is_none() && surface.closest(bad / 0.0).is_none());
        assert!(surface.first_hit(bad, DVec3::X).is_none());
        assert!(surface.first_hit(DVec3::ZERO, DVec3::ZERO).is_none());
        assert!(!surface.blocked(bad, DVec3::X, 0.0));
        let flat = Mesh::new(points.clone(), vec![[0, 1, 3]]).unwrap();
        assert!(matches!(SurfaceIndex::new(&flat), Err(Error::NoArea { n_faces: 1 })));
        let pile = Mesh::new(points, vec![[0, 1, 2]; 3000]).unwrap();
        let hit = SurfaceIndex::new(&pile).unwrap().first_hit(DVec3::new(0.1, 0.1, 1.0), -DVec3::Z);
        assert_eq!(hit.unwrap().t, 1.0);
    }
}
