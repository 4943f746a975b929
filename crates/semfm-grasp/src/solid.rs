//! Convex bodies at rest or swept along a line, as collision tests want them.

use std::sync::{Arc, OnceLock};

use glam::{Mat3A, Vec3A};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::details::intersection_test_cuboid_triangle;
use parry3d_f64::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d_f64::shape::{Cuboid, SupportMap, Triangle, TypedShape};
use semfm_geom::math::{DMat3, DVec3, bounds};

use crate::box_tree::Bounds;

/// Rounding of products and sums of three numbers in single precision, as a share of the largest.
const ROUNDING: f64 = 2e-6;

/// A rotation whose quaternion's vector is shorter is none: a part of 1 m moves by a nanometre.
const UNTURNED: f64 = 5e-10;

/// A sweep that leaves a box's axis by less than this (metres) still counts as along the axis.
const ALONG_AXIS: f64 = 1e-9;

/// A convex shape in its own frame: an axis-aligned box, and where that is not exact, the corners
/// of the hull inside it.
#[derive(Clone, Debug)]
pub(crate) struct Convex {
    centre: DVec3,
    half: DVec3,
    hull: Option<Hull>,
}

/// The convex hull of some points, and of the same points moved along a path.
#[derive(Clone, Debug)]
struct Hull {
    points: Arc<[DVec3]>,
    path: DVec3,
    /// Least and largest value along each of [`SLABS`], once asked for: most of what a gripper sweeps has nothing near.
    slabs: OnceLock<Slabs>,
}

/// For each direction of [`SLABS`] the least and the largest value.
type Slabs = [[f64; 2]; SLABS.len()];

/// Directions between the axes along which hulls are bounded. With them nine triangles of ten that miss a hull but
/// meet its box are told without a search for the closest points.
const SLABS: [DVec3; 10] = [
    DVec3::new(1.0, 1.0, 0.0),
    DVec3::new(1.0, -1.0, 0.0),
    DVec3::new(1.0, 0.0, 1.0),
    DVec3::new(1.0, 0.0, -1.0),
    DVec3::new(0.0, 1.0, 1.0),
    DVec3::new(0.0, 1.0, -1.0),
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, -1.0),
    DVec3::new(1.0, -1.0, 1.0),
    DVec3::new(1.0, -1.0, -1.0),
];

impl Convex {
    /// The convex pieces of a shape, each with its pose in the shape's frame, or `None` for a shape
    /// without bounds. Boxes and convex polyhedra are kept exactly, compounds piece by piece, a
    /// triangle mesh becomes its convex hull and anything round its box: never less than the shape.
    pub(crate) fn pieces(shape: TypedShape<'_>) -> Option<Vec<(Pose, Self)>> {
        match shape {
            TypedShape::Cuboid(cuboid) => Self::single_box(DVec3::ZERO, cuboid.half_extents),
            TypedShape::ConvexPolyhedron(polyhedron) => Self::single_hull(polyhedron.points()),
            TypedShape::TriMesh(mesh) => Self::single_hull(mesh.vertices()),
            TypedShape::Compound(compound) => {
                let mut pieces = Vec::new();
                for (pose, shape) in compound.shapes() {
                    let inner = Self::pieces(shape.as_typed_shape())?;
                    pieces.extend(inner.into_iter().map(|(p, piece)| (*pose * p, piece)));
                }
                Some(pieces)
            }
            TypedShape::HalfSpace(_) => None,
            TypedShape::Ball(shape) => Self::single_box(DVec3::ZERO, DVec3::splat(shape.radius)),
            TypedShape::Capsule(shape) => {
                let bounds = shape.local_aabb();
                Self::single_box(bounds.center(), bounds.half_extents())
            }
            TypedShape::Cylinder(shape) => Self::single_box(
                DVec3::ZERO,
                DVec3::new(shape.radius, shape.half_height, shape.radius),
            ),
            TypedShape::Cone(shape) => Self::single_box(
                DVec3::ZERO,
                DVec3::new(shape.radius, shape.half_height, shape.radius),
            ),
            TypedShape::RoundCuboid(shape) => {
                Self::single_box(DVec3::ZERO, shape.inner_shape.half_extents + shape.border_radius)
            }
            _ => None,
        }
    }

    /// The hull of points as the only piece.
    fn single_hull(points: &[DVec3]) -> Option<Vec<(Pose, Self)>> {
        let (low, high) = bounds(points)?;
        let (centre, half) = (low.midpoint(high), (high - low) / 2.0);
        let hull = Hull::new(points.iter().map(|&p| p - centre).collect());
        hull.slabs(); // once for all poses
        let hull = Some(hull);
        let piece = Self { centre, half, hull };
        Some(vec![(Pose::IDENTITY, piece)])
    }

    /// A box as the only piece; `None` where it has no bounds to speak of.
    fn single_box(centre: DVec3, half: DVec3) -> Option<Vec<(Pose, Self)>> {
        (centre.is_finite() && half.is_finite() && half.max_element() < 1e6)
            .then(|| vec![(Pose::IDENTITY, Self { centre, half, hull: None })])
    }

    /// The box with this centre and these half extents.
    pub(crate) fn cuboid(centre: DVec3, half: DVec3) -> Self {
        Self { centre, half, hull: None }
    }

    /// Corners of the shape in its own frame.
    fn corners(&self) -> Vec<DVec3> {
        match &self.hull {
            Some(hull) => hull.points.iter().map(|&p| p + self.centre).collect(),
            None => (0..8).map(|i| self.centre + self.half * corner_signs(i)).collect(),
        }
    }

    /// Bounds of the shape at `pose`, in the frame that `pose` leads to.
    pub(crate) fn bounds_at(&self, pose: &Pose) -> (DVec3, DVec3) {
        let corners: Vec<DVec3> = self.corners().into_iter().map(|p| *pose * p).collect();
        bounds(&corners).unwrap_or((pose.translation, pose.translation))
    }

    /// Lowest value of `direction · point` over the shape at `pose`.
    pub(crate) fn lowest(&self, pose: &Pose, direction: DVec3) -> f64 {
        let local = pose.rotation.inverse() * direction;
        let least = match &self.hull {
            None => -self.half.dot(local.abs()),
            Some(hull) => hull.points.iter().map(|p| p.dot(local)).fold(f64::INFINITY, f64::min),
        };
        let least = least + self.centre.dot(local);
        least + pose.translation.dot(direction)
    }

    /// The shape at `pose`, at rest.
    pub(crate) fn at(&self, pose: &Pose) -> Solid {
        let frame = *pose * Pose::from_translation(self.centre);
        Solid::new(frame, self.half, self.hull.clone())
    }

    /// Everything that the shape covers on its way from one pose to the other, if it moves on a
    /// line between them; where it also turns, the convex hull of both ends.
    pub(crate) fn swept(&self, from: &Pose, to: &Pose) -> Solid {
        let motion = from.inv_mul(to);
        let path = motion.translation;
        let off_axis = path.abs().element_sum() - path.abs().max_element();
        if motion.rotation.xyz().length() < UNTURNED {
            // The box around both ends is the box around the whole way.
            let frame = *from * Pose::from_translation(self.centre + path / 2.0);
            let half = self.half + path.abs() / 2.0;
            let hull = match &self.hull {
                None if off_axis < ALONG_AXIS => None,
                None => Some(Hull::new(self.corners_around_centre()).moved(path)),
                Some(hull) => Some(hull.moved(path)),
            };
            return Solid::new(frame, half, hull);
        }
        let start = self.corners();
        let all: Vec<DVec3> =
            start.iter().copied().chain(start.iter().map(|&p| motion * p)).collect();
        let (low, high) = bounds(&all).unwrap_or_default();
        let centre = low.midpoint(high);
        let frame = *from * Pose::from_translation(centre);
        let hull = Hull::new(all.into_iter().map(|p| p - centre).collect());
        Solid::new(frame, (high - low) / 2.0, Some(hull))
    }

    /// A box around the shape at each of the poses (at least one) and on straight ways between them.
    pub(crate) fn around(&self, poses: &[Pose]) -> Solid {
        let (first, corners) = (poses[0], self.corners());
        let all: Vec<DVec3> = poses
            .iter()
            .map(|pose| first.inv_mul(pose))
            .flat_map(|motion| corners.iter().map(move |&p| motion * p))
            .collect();
        let (low, high) = bounds(&all).unwrap_or_default();
        let frame = first * Pose::from_translation(low.midpoint(high));
        Solid::oriented_box(frame, (high - low) / 2.0)
    }

    fn corners_around_centre(&self) -> Vec<DVec3> {
        (0..8).map(|i| self.half * corner_signs(i)).collect()
    }
}

/// Slabs of what moves along a path, seen from its middle.
fn widened(at_rest: &Slabs, path: DVec3) -> Slabs {
    std::array::from_fn(|k| {
        let ([low, high], half) = (at_rest[k], path.dot(SLABS[k]).abs() / 2.0);
        [low - half, high + half]
    })
}

impl Hull {
    fn new(points: Vec<DVec3>) -> Self {
        Self { points: points.into(), path: DVec3::ZERO, slabs: OnceLock::new() }
    }

    /// Of points that are at rest: the same along `path`, seen from the middle of the way.
    fn moved(&self, path: DVec3) -> Self {
        let slabs = OnceLock::new();
        if let Some(at_rest) = self.slabs.get() {
            let _ = slabs.set(widened(at_rest, path));
        }
        Self { points: self.points.clone(), path, slabs }
    }

    fn slabs(&self) -> &Slabs {
        self.slabs.get_or_init(|| {
            let at_rest = SLABS.map(|direction| {
                let none = [f64::INFINITY, f64::NEG_INFINITY];
                let along = self.points.iter().map(|p| p.dot(direction));
                along.fold(none, |[l, h], x| [l.min(x), h.max(x)])
            });
            widened(&at_rest, self.path)
        })
    }

    /// Whether one of [`SLABS`] shows that the triangle is farther than `margin`.
    fn is_beside(&self, corners: [DVec3; 3], margin: f64) -> bool {
        self.slabs().iter().zip(SLABS).any(|([low, high], direction)| {
            let [a, b, c] = corners.map(|p| p.dot(direction));
            let wide = margin * direction.length();
            a.min(b).min(c) > high + wide || a.max(b).max(c) < low - wide
        })
    }
}

/// A convex body in the object's frame: an oriented box, and where that is not exact, the corners
/// of the hull inside it.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    /// object_from_box.
    frame: Pose,
    /// box_from_object as a matrix, which turns a triangle faster than a quaternion does.
    turn: DMat3,
    half: DVec3,
    hull: Option<Hull>,
}

impl Solid {
    fn new(frame: Pose, half: DVec3, hull: Option<Hull>) -> Self {
        Self { frame, turn: DMat3::from_quat(frame.rotation).transpose(), half, hull }
    }

    /// An oriented box: its frame in the object's, and its half extents.
    pub(crate) fn oriented_box(frame: Pose, half: DVec3) -> Self {
        Self::new(frame, half, None)
    }

    /// The centre of its box.
    pub(crate) fn centre(&self) -> DVec3 {
        self.frame.translation
    }

    /// A point in the box's frame.
    #[inline]
    pub(crate) fn local(&self, p: DVec3) -> DVec3 {
        self.turn * (p - self.frame.translation)
    }

    /// The box, grown by `margin`, as a question to many axis-aligned boxes.
    pub(crate) fn grown(&self, margin: f64) -> GrownBox {
        let centre = self.frame.translation;
        // Single precision has 24 bits: what rounding may take away is added first.
        let rounding = ROUNDING * (centre.abs() + self.half).max_element();
        let half = self.half + margin + rounding;
        let turn = self.turn;
        let spread = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        let reach = spread.transpose() * half;
        GrownBox {
            centre: centre.as_vec3a(),
            half: half.as_vec3a(),
            turn: Mat3A::from_cols(
                turn.x_axis.as_vec3a(),
                turn.y_axis.as_vec3a(),
                turn.z_axis.as_vec3a(),
            ),
            spread: Mat3A::from_cols(
                spread.x_axis.as_vec3a(),
                spread.y_axis.as_vec3a(),
                spread.z_axis.as_vec3a(),
            ),
            reach: reach.as_vec3a(),
        }
    }

    /// Whether the triangle's box may come nearer to the body's box than `least`.
    pub(crate) fn may_be_nearer(&self, corners: &[DVec3; 3], least: f64) -> bool {
        let [a, b, c] = corners.map(|p| self.local(p));
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let outside = (low - self.half).max(-self.half - high).max(DVec3::ZERO);
        outside.length_squared() < least * least
    }

    /// Whether the body, grown by `margin`, meets the triangle (touching counts).
    pub(crate) fn meets_triangle(&self, corners: &[DVec3; 3], margin: f64) -> bool {
        let [a, b, c] = corners.map(|p| self.local(p));
        let half = self.half + margin;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if low.cmpgt(half).any() || high.cmplt(-half).any() {
            return false;
        }
        let triangle = Triangle::new(a, b, c);
        match &self.hull {
            None => {
                intersection_test_cuboid_triangle(&Pose::IDENTITY, &Cuboid::new(half), &triangle)
            }
            Some(hull) => !hull.is_beside([a, b, c], margin) && !separated(hull, &triangle, margin),
        }
    }

    /// Whether the body, grown by `margin`, holds the point.
    pub(crate) fn meets_point(&self, point: DVec3, margin: f64) -> bool {
        let p = self.local(point);
        let outside = (p.abs() - self.half).max(DVec3::ZERO);
        if outside.length_squared() > margin * margin {
            return false;
        }
        match &self.hull {
            None => true,
            Some(hull) => !separated(hull, &Triangle::new(p, p, p), margin),
        }
    }

    /// Distance to the triangle where it is below `cap`, otherwise `cap`; 0 where they meet.
    pub(crate) fn distance(&self, corners: &[DVec3; 3], cap: f64) -> f64 {
        let [a, b, c] = corners.map(|p| self.local(p));
        let triangle = Triangle::new(a, b, c);
        match &self.hull {
            None => gap(&Cuboid::new(self.half), &triangle, cap),
            Some(hull) if hull.is_beside([a, b, c], cap) => cap,
            Some(hull) => gap(hull, &triangle, cap),
        }
    }
}

/// An oriented box that many axis-aligned ones are held against, in single precision.
pub(crate) struct GrownBox {
    centre: Vec3A,
    half: Vec3A,
    turn: Mat3A,
    /// Absolute values of `turn`.
    spread: Mat3A,
    /// Half extents of the box around it.
    reach: Vec3A,
}

impl GrownBox {
    /// Whether the two overlap (six of the fifteen separating axes: it may say yes for a near miss,
    /// never no for a hit).
    #[inline]
    pub(crate) fn overlaps(&self, bounds: &Bounds) -> bool {
        let (centre, extent) = ((bounds.low + bounds.high) * 0.5, (bounds.high - bounds.low) * 0.5);
        let offset = self.centre - centre;
        offset.abs().cmple(extent + self.reach).all()
            && (self.turn * offset).abs().cmple(self.half + self.spread * extent).all()
    }
}

impl SupportMap for Hull {
    fn local_support_point(&self, direction: Vector) -> Vector {
        let mut best = (f64::NEG_INFINITY, DVec3::ZERO);
        for &p in &*self.points {
            let along = p.dot(direction);
            if along > best.0 {
                best = (along, p);
            }
        }
        best.1 + self.path * (0.5 * self.path.dot(direction).signum())
    }
}

fn separated(body: &impl SupportMap, triangle: &Triangle, margin: f64) -> bool {
    matches!(closest(body, triangle, margin, false), GJKResult::NoIntersection(_))
}

fn gap(body: &impl SupportMap, triangle: &Triangle, cap: f64) -> f64 {
    match closest(body, triangle, cap, true) {
        GJKResult::ClosestPoints(a, b, _) => a.distance(b).min(cap),
        GJKResult::NoIntersection(_) => cap,
        GJKResult::Intersection | GJKResult::Proximity(_) => 0.0,
    }
}

fn closest(body: &impl SupportMap, triangle: &Triangle, max: f64, exact: bool) -> GJKResult {
    let towards = -(triangle.a + triangle.b + triangle.c);
    let direction = towards.try_normalize().unwrap_or(Vector::X);
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(&Pose::IDENTITY, body, triangle, direction));
    gjk::closest_points(&Pose::IDENTITY, body, triangle, max, exact, &mut simplex)
}

/// The signs of the corner of a box with this number (0 to 7).
fn corner_signs(i: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|bit| if i >> bit & 1 == 0 { -1.0 } else { 1.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::math::Rotation;

    fn tile(centre: DVec3) -> [DVec3; 3] {
        [centre, centre + 0.01 * DVec3::X, centre + 0.01 * DVec3::Y]
    }

    #[test]
    fn a_sweep_covers_the_way_and_nothing_beyond() {
        let cube = Convex::cuboid(DVec3::ZERO, DVec3::splat(0.5));
        let turned = Rotation::from_axis_angle(DVec3::Z, 0.3);
        let from = Pose::from_parts(DVec3::ZERO, turned);
        for slanted in [false, true] {
            let way = turned * DVec3::new(0.0, 4.0, if slanted { 3.0 } else { 0.0 });
            let to = Pose::from_parts(way, turned);
            let solid = cube.swept(&from, &to);
            assert_eq!(solid.hull.is_some(), slanted);
            assert!(solid.meets_triangle(&tile(way / 2.0), 0.0));
            assert!(solid.meets_triangle(&tile(way), 0.0));
            assert!(!solid.meets_triangle(&tile(1.5 * way), 0.0));
            assert!(solid.meets_point(way / 2.0, 0.0) && !solid.meets_point(-0.3 * way, 0.0));
        }
    }

    #[test]
    fn the_box_around_a_way_holds_all_that_is_swept() {
        let cube = Convex::cuboid(DVec3::X, DVec3::splat(0.5));
        let pose = |t: f64| Pose::new(DVec3::new(t, t * t, 0.3), DVec3::new(0.4 * t, 0.2, t));
        let way: Vec<Pose> = (0..6).map(|i| pose(f64::from(i) / 3.0)).collect();
        let around = cube.around(&way);
        let mut hits = 0;
        for i in 0..300 {
            let t = f64::from(i);
            let from_centre = 0.8 * DVec3::new((7.1 * t).sin(), (3.3 * t).cos(), t.sin());
            let p = way[i as usize % way.len()] * (DVec3::X + from_centre);
            let hit = way.windows(2).any(|w| cube.swept(&w[0], &w[1]).meets_point(p, 0.0));
            assert!(!hit || around.meets_point(p, 1e-9), "{p}");
            hits += u32::from(hit);
        }
        assert!((10..290).contains(&hits), "{hits} of 300 hit");
    }

    #[test]
    fn a_hull_and_a_box_of_the_same_corners_agree() {
        let plain = Convex::cuboid(DVec3::X, DVec3::new(0.5, 0.2, 0.3));
        let hull = Hull::new(plain.corners_around_centre());
        let hull = Convex { hull: Some(hull), ..plain.clone() };
        let pose = Pose::new(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.5, -0.4, 0.2));
        let (a, b) = (plain.at(&pose), hull.at(&pose));
        let mut hits = 0;
        for i in 0..500 {
            let t = f64::from(i);
            let p = pose * (DVec3::X + 0.6 * DVec3::new((7.1 * t).sin(), (3.3 * t).cos(), t.sin()));
            let corners = [p, p + 0.1 * DVec3::X, p + 0.15 * DVec3::Z];
            let hit = a.meets_triangle(&corners, 1e-4);
            assert_eq!(hit, b.meets_triangle(&corners, 1e-4));
            assert!((a.distance(&corners, 1.0) - b.distance(&corners, 1.0)).abs() < 1e-9);
            hits += u32::from(hit);
        }
        assert!((30..450).contains(&hits), "{hits} of 500 hit");
        let lowest = plain.lowest(&pose, DVec3::Z);
        assert!((lowest - hull.lowest(&pose, DVec3::Z)).abs() < 1e-12);
    }
}
