//! Surfaces of many triangles and clouds of points as obstacles, under a tree of boxes.

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Pose;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode, TraversalAction};
use parry3d_f64::shape::SupportMap;
use semfm_geom::Mesh;
use semfm_geom::connectivity::MeshReport;
use semfm_geom::math::DVec3;

use super::body::{CollisionBody, Frame, Piece, Relative, refined};
use super::convex::{Convex, Core, depth, distance};

/// Directions of the rays that decide between inside and outside: none lies along an axis or a diagonal.
const INSIDE_RAYS: [DVec3; 3] = [
    DVec3::new(0.5377, 0.2713, 0.7983),
    DVec3::new(-0.7019, 0.6177, -0.3545),
    DVec3::new(0.1736, -0.9397, 0.2949),
];

/// Triangles, or points with a margin, in a frame of their own.
#[derive(Debug)]
pub(crate) struct Surface {
    items: Vec<Convex>,
    /// Where an item's convex shape has its origin; points only.
    places: Vec<DVec3>,
    tree: Bvh,
    /// Whether the triangles bound a volume: then its inside is solid.
    is_closed: bool,
}

impl Surface {
    /// All triangles of a mesh (at least one), coordinates times `scale`.
    pub(crate) fn of_mesh(mesh: &Mesh, scale: f64) -> Self {
        let corners: Vec<[DVec3; 3]> =
            (0..mesh.n_faces()).map(|face| mesh.corners(face).map(|p| p * scale)).collect();
        let boxes = corners.iter().map(|&[a, b, c]| Aabb::new(a.min(b).min(c), a.max(b).max(c)));
        let tree = tree(boxes.collect());
        let items = corners.iter().map(|&t| Convex::sharp(Core::Triangle(t))).collect();
        let places = vec![DVec3::ZERO; corners.len()];
        Self { items, places, tree, is_closed: MeshReport::new(mesh).watertight }
    }

    /// Balls of radius `margin` around points (at least one).
    pub(crate) fn of_points(points: &[DVec3], margin: f64) -> Self {
        let boxes = points.iter().map(|&p| Aabb::new(p - margin, p + margin));
        let tree = tree(boxes.collect());
        let items = vec![Convex { core: Core::Point, rounding: margin }; points.len()];
        Self { items, places: points.to_vec(), tree, is_closed: false }
    }

    /// A lower bound of the distance from a point of this frame.
    pub(crate) fn bound_distance(&self, p: DVec3) -> f64 {
        let root = self.tree.root_aabb();
        box_distance(root.mins, root.maxs, p)
    }

    /// A lower bound of the distance between a body and this, exact where it is small; `most` where it is that or
    /// more, 0 where they meet.
    pub(crate) fn gap(&self, body: &CollisionBody, body_at: &Frame, at: &Frame, most: f64) -> f64 {
        let centre = at.inverse_point(body_at.point(body.centre()));
        if self.bound_distance(centre) - body.radius() >= most {
            return most;
        }
        let mut least = most;
        let here = at.relative(body_at);
        for piece in body.pieces() {
            let by_spheres = piece.spheres.least_gap(least, |centre| {
                self.point_distance(here.point(centre), least + piece.spheres.bound().radius)
            });
            least = refined(by_spheres, least, |least| {
                self.piece_distance(piece, &here, &(at.pose.inv_mul(&body_at.pose)), least)
            });
            if least > 0.0 && self.is_closed {
                // It touches no triangle, so all of it is on the side where one of its points is.
                let some = piece.convex.core.local_support_point(DVec3::X);
                if self.encloses(here.point(piece.body_from_piece * some)) {
                    return 0.0;
                }
            }
            if least <= 0.0 {
                return 0.0;
            }
        }
        least
    }

    /// Distance from a point of this frame to the nearest item, at most `most`.
    fn point_distance(&self, p: DVec3, most: f64) -> f64 {
        let mut least = most;
        self.tree.traverse(|node: &BvhNode| {
            if box_distance(node.mins(), node.maxs(), p) >= least {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                let leaf = leaf as usize;
                let there = self.items[leaf].point_distance(p - self.places[leaf]);
                least = least.min(there.unwrap_or(0.0));
            }
            TraversalAction::Continue
        });
        least
    }

    fn piece_distance(&self, piece: &Piece, here: &Relative, body: &Pose, most: f64) -> f64 {
        let piece_at = *body * piece.body_from_piece;
        let bound = piece.spheres.bound();
        let centre = here.point(bound.centre);
        let mut least = most;
        self.tree.traverse(|node: &BvhNode| {
            if box_distance(node.mins(), node.maxs(), centre) - bound.radius >= least {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                let leaf = leaf as usize;
                let item_from_piece = Pose::from_translation(-self.places[leaf]) * piece_at;
                let there = distance(&item_from_piece, &self.items[leaf], &piece.convex, least);
                least = least.min(there);
                if least <= 0.0 {
                    return TraversalAction::EarlyExit;
                }
            }
            TraversalAction::Continue
        });
        least
    }

    /// How deep a piece is in this: in the item that it is deepest in. 0 where it touches none (also inside of a
    /// closed surface).
    pub(crate) fn depth(&self, piece: &Piece, body_at: &Frame, at: &Frame) -> f64 {
        let piece_at = at.pose.inv_mul(&body_at.pose) * piece.body_from_piece;
        let bound = piece.spheres.bound();
        let centre = at.inverse_point(body_at.point(bound.centre));
        let near = |node: &BvhNode| box_distance(node.mins(), node.maxs(), centre) <= bound.radius;
        let depths = self.tree.leaves(near).map(|leaf| {
            let leaf = leaf as usize;
            let item_from_piece = Pose::from_translation(-self.places[leaf]) * piece_at;
            depth(&item_from_piece, &self.items[leaf], &piece.convex)
        });
        depths.fold(0.0, f64::max)
    }

    /// Whether a closed surface encloses a point, by a majority of three rays.
    fn encloses(&self, p: DVec3) -> bool {
        let root = self.tree.root_aabb();
        if p.cmplt(root.mins).any() || p.cmpgt(root.maxs).any() {
            return false;
        }
        let says_inside = |ray: &&DVec3| {
            let near = |node: &BvhNode| ray_meets_box(node, p, **ray);
            let crossings = self.tree.leaves(near).filter(|&leaf| {
                let Core::Triangle(corners) = self.items[leaf as usize].core else { return false };
                ray_crosses(&corners, p, **ray)
            });
            crossings.count() % 2 == 1
        };
        INSIDE_RAYS.iter().filter(says_inside).count() >= 2
    }
}

fn tree(boxes: Vec<Aabb>) -> Bvh {
    Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
}

fn box_distance(low: DVec3, high: DVec3, p: DVec3) -> f64 {
    (low - p).max(p - high).max(DVec3::ZERO).length()
}

/// Whether a ray meets the node's box (the slab test of Kay & Kajiya 1986).
fn ray_meets_box(node: &BvhNode, origin: DVec3, direction: DVec3) -> bool {
    let (low, high) = ((node.mins() - origin) / direction, (node.maxs() - origin) / direction);
    let (enter, leave) = (low.min(high).max_element(), low.max(high).min_element());
    enter.max(0.0) <= leave + 1e-12
}

/// Möller & Trumbore (Fast, Minimum Storage Ray/Triangle Intersection, 1997), both sides.
fn ray_crosses(&[a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> bool {
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let s = origin - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(ab);
    let v = direction.dot(q) / determinant;
    determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ac.dot(q) / determinant > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::shape::SharedShape;
    use semfm_geom::zoo;

    fn ball(radius: f64) -> CollisionBody {
        CollisionBody::from_pieces(&[(Pose::IDENTITY, SharedShape::ball(radius))]).unwrap()
    }

    fn place(i: u32) -> DVec3 {
        let t = f64::from(i);
        DVec3::new((7.1 * t).sin(), (3.3 * t).cos(), (1.9 * t).sin())
    }

    #[test]
    fn gaps_to_a_mesh_are_those_of_a_full_search() {
        let at = Frame::new(Pose::new(DVec3::new(0.2, 0.1, 0.0), DVec3::new(0.3, 0.2, 0.1)));
        let shape = SharedShape::cuboid(0.1, 0.05, 0.2);
        let body =
            CollisionBody::from_pieces(&[(Pose::translation(0.1, 0.0, 0.0), shape)]).unwrap();
        for (name, mesh) in zoo::all() {
            let surface = Surface::of_mesh(&mesh, 0.5);
            for i in 0..40 {
                let body_at = Frame::new(Pose::new(place(i), place(i + 77)));
                let gap = surface.gap(&body, &body_at, &at, 0.3);
                let piece = &body.pieces()[0];
                let between = at.pose.inv_mul(&body_at.pose) * piece.body_from_piece;
                let nearest =
                    surface.items.iter().map(|item| distance(&between, item, &piece.convex, 0.3));
                let truth = nearest.fold(0.3, f64::min);
                let inside = surface.is_closed && gap == 0.0 && truth > 0.0;
                if inside {
                    let some = piece.convex.core.local_support_point(DVec3::X);
                    assert!(surface.encloses(between * some), "{name} {i}");
                } else {
                    assert!(gap <= truth + 1e-9, "{name} {i}: {gap} {truth}");
                    assert_eq!(gap == 0.0, truth == 0.0, "{name} {i}");
                }
            }
        }
    }

    #[test]
    fn what_is_inside_of_a_closed_mesh_touches_it() {
        let surface = Surface::of_mesh(&zoo::icosphere(2), 1.0);
        let still = Frame::new(Pose::IDENTITY);
        for (x, gap) in [(0.0, 0.0), (0.5, 0.0), (0.95, 0.0), (1.2, 0.1), (3.0, 0.2)] {
            let at = Frame::new(Pose::translation(x, 0.0, 0.0));
            let found = surface.gap(&ball(0.1), &at, &still, 0.2);
            assert!((found - gap).abs() < 0.02, "{x}: {found}");
        }
    }

    #[test]
    fn points_have_a_margin() {
        let points: Vec<DVec3> = (0..500).map(place).collect();
        let cloud = Surface::of_points(&points, 0.01);
        let still = Frame::new(Pose::IDENTITY);
        for i in 1000..1200 {
            let at = Frame::new(Pose::from_translation(1.5 * place(i)));
            let nearest =
                points.iter().map(|p| p.distance(at.pose.translation)).fold(9.0, f64::min);
            let truth = (nearest - 0.06).clamp(0.0, 0.5);
            let found = cloud.gap(&ball(0.05), &at, &still, 0.5);
            assert!((found - truth).abs() < 1e-6, "{i}: {found} {truth}");
        }
        let at = Frame::new(Pose::from_translation(points[3] + 0.04 * DVec3::Y));
        let body = ball(0.05);
        assert!(cloud.depth(&body.pieces()[0], &at, &still) >= 0.02 - 1e-9);
    }
}
