//! Convex shapes: the point farthest in a direction, and distances and depths between two of them.

use std::sync::Arc;

use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::epa::EPA;
use parry3d_f64::query::gjk::{self, CsoPoint, GJKResult, VoronoiSimplex};
use parry3d_f64::shape::{SupportMap, TypedShape};
use semfm_geom::math::{DQuat, DVec3};

use super::hull::Hull;

/// A convex shape about its own origin: all points within `rounding` metres of its core.
#[derive(Clone, Debug)]
pub(crate) struct Convex {
    pub(crate) core: Core,
    pub(crate) rounding: f64,
}

/// What a convex shape is grown from; cylinders and segments along z.
#[derive(Clone, Debug)]
pub(crate) enum Core {
    Point,
    Segment { half: f64 },
    Cuboid { half: DVec3 },
    Cylinder { radius: f64, half: f64 },
    Triangle([DVec3; 3]),
    Hull(Arc<Hull>),
}

/// A convex shape at its place in the frame of the body that it belongs to.
#[derive(Clone, Debug)]
pub(crate) struct PlacedConvex {
    pub(crate) body_from_convex: Pose,
    pub(crate) convex: Convex,
}

impl Convex {
    /// A core without rounding.
    pub(crate) fn sharp(core: Core) -> Self {
        Self { core, rounding: 0.0 }
    }

    /// The convex pieces of one of parry's shapes. A triangle mesh becomes its hull, a kind that is not known the box
    /// around it; `None` for a shape without bounds.
    pub(crate) fn pieces(shape: TypedShape<'_>) -> Option<Vec<PlacedConvex>> {
        // parry's cylinders stand along y.
        let upright = Pose::from_rotation(DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2));
        let one = |body_from_convex, core, rounding| {
            Some(vec![PlacedConvex { body_from_convex, convex: Self { core, rounding } }])
        };
        let hull = |points: &[DVec3]| Core::Hull(Arc::new(Hull::new(points.to_vec())));
        match shape {
            TypedShape::Ball(ball) => one(Pose::IDENTITY, Core::Point, ball.radius),
            TypedShape::Cuboid(cuboid) => {
                one(Pose::IDENTITY, Core::Cuboid { half: cuboid.half_extents }, 0.0)
            }
            TypedShape::Cylinder(shape) => {
                let core = Core::Cylinder { radius: shape.radius, half: shape.half_height };
                one(upright, core, 0.0)
            }
            TypedShape::Capsule(capsule) => {
                let way = capsule.segment.b - capsule.segment.a;
                let turn = DQuat::from_rotation_arc(DVec3::Z, way.normalize_or(DVec3::Z));
                let middle = capsule.segment.a.midpoint(capsule.segment.b);
                let core = Core::Segment { half: way.length() / 2.0 };
                one(Pose::from_parts(middle, turn), core, capsule.radius)
            }
            TypedShape::ConvexPolyhedron(polyhedron) => {
                one(Pose::IDENTITY, hull(polyhedron.points()), 0.0)
            }
            TypedShape::TriMesh(mesh) => one(Pose::IDENTITY, hull(mesh.vertices()), 0.0),
            TypedShape::Compound(compound) => {
                let mut pieces = Vec::new();
                for (pose, shape) in compound.shapes() {
                    let inner = Self::pieces(shape.as_typed_shape())?;
                    pieces.extend(inner.into_iter().map(|piece| PlacedConvex {
                        body_from_convex: *pose * piece.body_from_convex,
                        convex: piece.convex,
                    }));
                }
                Some(pieces)
            }
            TypedShape::HalfSpace(_) => None,
            TypedShape::RoundCuboid(shape) => {
                let core = Core::Cuboid { half: shape.inner_shape.half_extents };
                one(Pose::IDENTITY, core, shape.border_radius)
            }
            TypedShape::Cone(cone) => {
                let half = DVec3::new(cone.radius, cone.half_height, cone.radius);
                one(Pose::IDENTITY, Core::Cuboid { half }, 0.0)
            }
            _ => None,
        }
    }

    /// Distance from a point in the shape's frame, 0 inside; of cores that have a formula, else `None`.
    #[inline]
    pub(crate) fn point_distance(&self, p: DVec3) -> Option<f64> {
        let distance = match self.core {
            Core::Point => p.length(),
            Core::Segment { half } => DVec3::new(p.x, p.y, (p.z.abs() - half).max(0.0)).length(),
            Core::Cuboid { half } => (p.abs() - half).max(DVec3::ZERO).length(),
            Core::Cylinder { radius, half } => {
                let beside = ((p.x * p.x + p.y * p.y).sqrt() - radius).max(0.0);
                let above = (p.z.abs() - half).max(0.0);
                (beside * beside + above * above).sqrt()
            }
            Core::Triangle(corners) => return Some(triangle_distance(corners, p) - self.rounding),
            Core::Hull(_) => return None,
        };
        Some(distance - self.rounding)
    }

    /// Lowest value of `direction · point` over the shape at `pose`; `direction` is a unit vector.
    pub(crate) fn lowest(&self, pose: &Pose, direction: DVec3) -> f64 {
        let local = pose.rotation.inverse() * -direction;
        let point = *pose * self.core.local_support_point(local);
        point.dot(direction) - self.rounding
    }
}

impl SupportMap for Core {
    fn local_support_point(&self, direction: Vector) -> Vector {
        match self {
            Self::Point => DVec3::ZERO,
            Self::Segment { half } => DVec3::new(0.0, 0.0, half.copysign(direction.z)),
            Self::Cuboid { half } => half.copysign(direction),
            Self::Cylinder { radius, half } => {
                let beside = (direction.x * direction.x + direction.y * direction.y).sqrt();
                let factor = if beside > 0.0 { radius / beside } else { 0.0 };
                DVec3::new(factor * direction.x, factor * direction.y, half.copysign(direction.z))
            }
            Self::Triangle([a, b, c]) => {
                let [x, y, z] = [a, b, c].map(|p| p.dot(direction));
                if x >= y && x >= z {
                    *a
                } else if y >= z {
                    *b
                } else {
                    *c
                }
            }
            Self::Hull(hull) => hull.farthest(direction),
        }
    }
}

/// Distance between two convex shapes, `most` where it is that or more, 0 where they meet.
pub(crate) fn distance(a_from_b: &Pose, a: &Convex, b: &Convex, most: f64) -> f64 {
    let rounding = a.rounding + b.rounding;
    match closest(a_from_b, a, b, most + rounding).0 {
        GJKResult::ClosestPoints(p, q, _) => (p.distance(q) - rounding).clamp(0.0, most),
        GJKResult::NoIntersection(direction) => {
            // The search says the same when it gives up after its last step; the direction tells the two apart.
            let between = CsoPoint::from_shapes(a_from_b, &a.core, &b.core, direction).point;
            (-direction.dot(between) - rounding).clamp(0.0, most)
        }
        GJKResult::Intersection | GJKResult::Proximity(_) => 0.0,
    }
}

/// How far two convex shapes are inside of each other: the shortest way that parts them, metres; negative, their
/// distance with a minus, where they do not meet.
pub(crate) fn depth(a_from_b: &Pose, a: &Convex, b: &Convex) -> f64 {
    let rounding = a.rounding + b.rounding;
    let (found, simplex) = closest(a_from_b, a, b, f64::MAX);
    let cores = match found {
        GJKResult::ClosestPoints(p, q, _) => -p.distance(q),
        _ => EPA::new()
            .closest_points(a_from_b, &a.core, &b.core, &simplex)
            .map_or(0.0, |(p, q, _)| p.distance(q)),
    };
    cores + rounding
}

fn closest(a_from_b: &Pose, a: &Convex, b: &Convex, most: f64) -> (GJKResult, VoronoiSimplex) {
    let direction = a_from_b.translation.try_normalize().unwrap_or(Vector::X);
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(a_from_b, &a.core, &b.core, direction));
    let found = gjk::closest_points(a_from_b, &a.core, &b.core, most, true, &mut simplex);
    (found, simplex)
}

/// Distance from a point to a triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5).
fn triangle_distance([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length();
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (ap - ab * (d1 / (d1 - d3))).length();
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (ap - ac * (d2 / (d2 - d6))).length();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (bp - (c - b) * share).length();
    }
    let sum = va + vb + vc;
    (ap - ab * (vb / sum) - ac * (vc / sum)).length()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(x: f64, y: f64, z: f64) -> Convex {
        Convex::sharp(Core::Cuboid { half: DVec3::new(x, y, z) })
    }

    fn cube_hull(half: f64) -> Convex {
        let corners = (0..8)
            .map(|i| {
                DVec3::from_array([0, 1, 2].map(|bit| if i >> bit & 1 == 0 { -half } else { half }))
            })
            .collect();
        Convex::sharp(Core::Hull(Arc::new(Hull::new(corners))))
    }

    fn ball(radius: f64) -> Convex {
        Convex { core: Core::Point, rounding: radius }
    }

    #[test]
    fn distances_are_those_of_geometry() {
        let rod = Convex { core: Core::Segment { half: 0.3 }, rounding: 0.05 };
        let can = Convex::sharp(Core::Cylinder { radius: 0.2, half: 0.1 });
        let turned = Pose::from_parts(
            DVec3::new(1.0, 0.0, 0.0),
            DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4),
        );
        let cases = [
            (cuboid(0.1, 0.2, 0.3), cuboid(0.2, 0.1, 0.1), Pose::translation(1.0, 0.0, 0.0), 0.7),
            (cuboid(0.1, 0.2, 0.3), cuboid(0.1, 0.1, 0.1), Pose::translation(0.5, 0.7, 0.0), 0.5),
            (cube_hull(0.1), cube_hull(0.1), turned, 0.9 - 0.1 * 2.0_f64.sqrt()),
            (ball(0.1), ball(0.2), Pose::translation(0.3, 0.4, 0.0), 0.2),
            (rod.clone(), ball(0.1), Pose::translation(0.0, 0.0, 1.0), 0.55),
            (rod, can.clone(), Pose::translation(0.5, 0.0, 0.0), 0.25),
            (can, ball(0.1), Pose::translation(0.5, 0.0, 0.5), 0.5 - 0.1),
        ];
        for (case, (a, b, a_from_b, expected)) in cases.into_iter().enumerate() {
            let found = distance(&a_from_b, &a, &b, 10.0);
            assert!((found - expected).abs() < 1e-9, "case {case}: {found} instead of {expected}");
            assert!((distance(&a_from_b.inverse(), &b, &a, 10.0) - expected).abs() < 1e-9);
            assert_eq!(distance(&a_from_b, &a, &b, 0.5 * expected), 0.5 * expected);
            assert!((depth(&a_from_b, &a, &b) + expected).abs() < 1e-9);
        }
    }

    #[test]
    fn depths_are_those_of_geometry() {
        let cases = [
            (
                cuboid(0.1, 0.2, 0.3),
                cuboid(0.2, 0.1, 0.1),
                Pose::translation(0.25, 0.02, 0.01),
                0.05,
            ),
            (cube_hull(0.1), cuboid(0.1, 0.1, 0.1), Pose::translation(0.0, 0.17, 0.01), 0.03),
            (ball(0.1), ball(0.2), Pose::translation(0.1, 0.0, 0.0), 0.2),
            (ball(0.1), cube_hull(0.2), Pose::translation(0.25, 0.0, 0.0), 0.05),
            (ball(0.01), cube_hull(0.2), Pose::translation(0.1, 0.03, 0.02), 0.11),
        ];
        for (case, (a, b, a_from_b, expected)) in cases.into_iter().enumerate() {
            let found = depth(&a_from_b, &a, &b);
            assert!((found - expected).abs() < 1e-7, "case {case}: {found} instead of {expected}");
            assert_eq!(distance(&a_from_b, &a, &b, 1.0), 0.0);
        }
    }

    #[test]
    fn formulas_for_points_agree_with_the_search() {
        let corners = [DVec3::ZERO, DVec3::new(0.3, 0.0, 0.1), DVec3::new(0.1, 0.4, 0.0)];
        let shapes = [
            cuboid(0.1, 0.2, 0.3),
            ball(0.2),
            Convex { core: Core::Segment { half: 0.3 }, rounding: 0.05 },
            Convex::sharp(Core::Cylinder { radius: 0.2, half: 0.1 }),
            Convex { core: Core::Triangle(corners), rounding: 0.01 },
        ];
        for i in 0..2000 {
            let t = f64::from(i);
            let p = DVec3::new((7.1 * t).sin(), (3.3 * t).cos(), (1.9 * t).sin()) * 0.6;
            for shape in &shapes {
                let found = shape.point_distance(p).unwrap().max(0.0);
                let searched = distance(&Pose::from_translation(p), shape, &ball(0.0), 9.0);
                assert!((found - searched).abs() < 1e-7, "{shape:?} {p}: {found} {searched}");
            }
        }
    }
}
