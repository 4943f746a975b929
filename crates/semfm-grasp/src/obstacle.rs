//! What a gripper must not run into: triangles or points under a tree of boxes.

use glam::Vec3A;
use semfm_geom::Mesh;
use semfm_geom::connectivity::MeshReport;
use semfm_geom::math::DVec3;

use crate::box_tree::{Bounds, BoxTree};
use crate::solid::Solid;

/// Directions of the rays that decide between inside and outside: none lies along an axis or a
/// diagonal, where objects made by people have their edges.
const INSIDE_RAYS: [DVec3; 3] = [
    DVec3::new(0.5377, 0.2713, 0.7983),
    DVec3::new(-0.7019, 0.6177, -0.3545),
    DVec3::new(0.1736, -0.9397, 0.2949),
];

/// A surface of triangles or a set of points with a radius.
pub(crate) struct Obstacle {
    items: Items,
    tree: BoxTree,
    /// Whether the triangles bound a volume, so that a body can be inside without touching.
    closed: bool,
}

enum Items {
    Triangles(Vec<[DVec3; 3]>),
    Points { points: Vec<DVec3>, radius: f64 },
}

impl Obstacle {
    /// All triangles of a mesh, degenerate ones too: a collision is with the mesh as it stands.
    pub(crate) fn of_mesh(mesh: &Mesh) -> Self {
        let triangles: Vec<[DVec3; 3]> =
            (0..mesh.n_faces()).map(|face| mesh.corners(face)).collect();
        let boxes = triangles.iter().map(|&[a, b, c]| (a.min(b).min(c), a.max(b).max(c)));
        let tree = BoxTree::new(boxes);
        let closed = MeshReport::new(mesh).watertight;
        Self { items: Items::Triangles(triangles), tree, closed }
    }

    /// Balls of one radius around points (at least one).
    pub(crate) fn of_points(points: Vec<DVec3>, radius: f64) -> Self {
        let tree = BoxTree::new(points.iter().map(|&p| (p, p)));
        Self { tree, items: Items::Points { points, radius }, closed: false }
    }

    /// Whether `solid`, grown by `margin`, touches anything.
    pub(crate) fn meets(&self, solid: &Solid, margin: f64) -> bool {
        self.meets_any(self.near(solid, margin), solid, margin)
    }

    /// Whether `solid`, grown by `margin`, touches one of these items.
    pub(crate) fn meets_any(
        &self,
        mut items: impl Iterator<Item = u32>,
        solid: &Solid,
        margin: f64,
    ) -> bool {
        match &self.items {
            Items::Triangles(triangles) => {
                items.any(|i| solid.meets_triangle(&triangles[i as usize], margin))
            }
            Items::Points { points, radius } => {
                items.any(|i| solid.meets_point(points[i as usize], margin + radius))
            }
        }
    }

    /// Distance between `solid` and the nearest item, at most `cap`.
    pub(crate) fn distance(&self, solid: &Solid, cap: f64) -> f64 {
        let mut least = cap;
        match &self.items {
            Items::Triangles(triangles) => {
                for i in self.near(solid, cap) {
                    let corners = &triangles[i as usize];
                    if solid.may_be_nearer(corners, least) {
                        least = solid.distance(corners, least).min(least);
                    }
                }
            }
            Items::Points { points, radius } => {
                for i in self.near(solid, cap) {
                    let p = points[i as usize];
                    least = least.min((solid.distance(&[p; 3], least + radius) - radius).max(0.0));
                }
            }
        }
        least
    }

    /// Ids of the items whose boxes come near the box of `solid` grown by `margin`, points with their radius.
    pub(crate) fn near<'a>(
        &'a self,
        solid: &Solid,
        margin: f64,
    ) -> impl Iterator<Item = u32> + use<'a> {
        let radius = match self.items {
            Items::Triangles(_) => 0.0,
            Items::Points { radius, .. } => radius,
        };
        let grown = solid.grown(margin + radius);
        self.tree.passing(move |bounds| grown.overlaps(bounds))
    }

    /// Corners of a triangle, or a point three times.
    #[inline]
    pub(crate) fn corners(&self, item: u32) -> [DVec3; 3] {
        match &self.items {
            Items::Triangles(triangles) => triangles[item as usize],
            Items::Points { points, .. } => [points[item as usize]; 3],
        }
    }

    /// Ids of the points within `radius` of `centre`, in the order of the tree.
    pub(crate) fn points_within(
        &self,
        centre: DVec3,
        radius: f64,
    ) -> impl Iterator<Item = u32> + '_ {
        let middle = centre.as_vec3a();
        let wider = (radius + 1e-5 * (radius + centre.abs().max_element())) as f32;
        let found = self.tree.passing(move |bounds| {
            let outside = (bounds.low - middle).max(middle - bounds.high).max(Vec3A::ZERO);
            outside.length_squared() <= wider * wider
        });
        found.filter(move |&i| self.corners(i)[0].distance_squared(centre) <= radius * radius)
    }

    /// Where the line `origin + t · direction`, t in (`near`, `far`), crosses triangles: t and the
    /// triangle's id, by t. Points have no crossings.
    pub(crate) fn crossings(
        &self,
        origin: DVec3,
        direction: DVec3,
        near: f64,
        far: f64,
    ) -> Vec<(f64, u32)> {
        let Items::Triangles(triangles) = &self.items else { return Vec::new() };
        let mut hits: Vec<(f64, u32)> = self
            .tree
            .passing(|bounds| meets_box(bounds, origin, direction, [near, far]))
            .filter_map(|i| Some((crossing(&triangles[i as usize], origin, direction)?, i)))
            .filter(|&(t, _)| t > near && t < far)
            .collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        hits
    }

    /// Whether a closed surface encloses the point, by a majority of three rays; an open surface
    /// encloses nothing.
    pub(crate) fn encloses(&self, point: DVec3) -> bool {
        let Bounds { low, high } = self.tree.bounds();
        let outside = point.cmplt(low.as_dvec3()).any() || point.cmpgt(high.as_dvec3()).any();
        if !self.closed || outside {
            return false;
        }
        let says_inside = INSIDE_RAYS
            .iter()
            .filter(|ray| self.crossings(point, **ray, 0.0, f64::MAX).len() % 2 == 1);
        says_inside.count() >= 2
    }
}

/// Whether the line `origin + t · direction`, t in `[near, far]`, meets the box (the slab test
/// of Kay & Kajiya 1986).
fn meets_box(bounds: &Bounds, origin: DVec3, direction: DVec3, [near, far]: [f64; 2]) -> bool {
    let [low, high] =
        [bounds.low, bounds.high].map(|corner| (corner.as_dvec3() - origin) / direction);
    // A direction with a zero makes infinities (right) or, on a face of the box, NaN, which min and
    // max of f64 leave out.
    let (enter, leave) = (0..3).fold((near, far), |(enter, leave), axis| {
        let (a, b) = (low[axis], high[axis]);
        (enter.max(a.min(b)), leave.min(a.max(b)))
    });
    enter <= leave + 1e-12
}

/// Möller & Trumbore (Fast, Minimum Storage Ray/Triangle Intersection, 1997), both sides.
fn crossing(&[a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / determinant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::math::Pose;
    use semfm_geom::zoo;

    fn cube(centre: DVec3, half: f64) -> Solid {
        Solid::oriented_box(Pose::new(centre, DVec3::new(0.3, 0.2, 0.9)), DVec3::splat(half))
    }

    #[test]
    fn the_tree_answers_as_a_full_search_does() {
        for (name, mesh) in zoo::all() {
            let obstacle = Obstacle::of_mesh(&mesh);
            let (centre, radius) = mesh.bounding_sphere();
            for i in 0..60 {
                let t = f64::from(i);
                let at = centre + radius * DVec3::new(t.sin(), (1.7 * t).cos(), (2.9 * t).sin());
                let solid = cube(at, 0.15 * radius);
                let hit = (0..mesh.n_faces()).any(|f| solid.meets_triangle(&mesh.corners(f), 0.0));
                assert_eq!(obstacle.meets(&solid, 0.0), hit, "{name} {i}");
                let cap = 0.5 * radius;
                let least = (0..mesh.n_faces())
                    .map(|f| solid.distance(&mesh.corners(f), cap))
                    .fold(cap, f64::min);
                let found = obstacle.distance(&solid, cap);
                assert!((found - least).abs() < 1e-9, "{name} {i}: {found} instead of {least}");
            }
        }
    }

    #[test]
    fn inside_and_outside_of_closed_and_open_surfaces() {
        let sphere = Obstacle::of_mesh(&zoo::icosphere(2));
        assert!(sphere.encloses(DVec3::new(0.1, -0.3, 0.2)) && !sphere.encloses(DVec3::ONE));
        assert_eq!(sphere.crossings(DVec3::new(-3.0, 0.01, 0.02), DVec3::X, 0.0, 9.0).len(), 2);
        let open = Obstacle::of_mesh(&zoo::open_grid(5, 5));
        assert!(!open.encloses(DVec3::new(0.5, 0.5, 0.1)));
    }

    #[test]
    fn points_keep_their_distance() {
        let cloud = Obstacle::of_points(vec![DVec3::ZERO, DVec3::X], 0.1);
        let solid = Solid::oriented_box(Pose::from_translation(0.5 * DVec3::Z), DVec3::splat(0.3));
        assert!(!cloud.meets(&solid, 0.0) && cloud.meets(&solid, 0.11));
        assert!((cloud.distance(&solid, 1.0) - 0.1).abs() < 1e-9);
    }
}
