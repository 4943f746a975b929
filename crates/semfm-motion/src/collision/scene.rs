//! What stands around an arm: primitives, meshes, clouds of points, a table, bodies of convex pieces.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;
use semfm_robot::Geometry;

use super::body::{CollisionBody, Frame, body_gap, refined};
use super::convex::{Convex, Core, depth, distance};
use super::surface::Surface;
use crate::{Error, Result};

/// Farthest that anything of a scene may be from the base, metres: beyond it distances lose the digits that count.
const MAX_REACH: f64 = 1e4;

/// Named things that must not be touched, in the frame of the arm's base, metres. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    obstacles: Vec<Arc<Obstacle>>,
}

/// One of them.
#[derive(Debug)]
pub(crate) struct Obstacle {
    pub(crate) name: String,
    base_from_obstacle: Frame,
    shape: Shape,
}

#[derive(Debug)]
enum Shape {
    /// A shape whose distance from a point has a formula.
    Primitive(Convex),
    /// All below z = 0.
    HalfSpace,
    Body(CollisionBody),
    Surface(Surface),
}

impl Scene {
    /// Nothing around.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a box, cylinder, capsule or ball.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mesh file (read it and use [`Scene::with_mesh`]), sizes that are negative, numbers that
    /// are not finite, and a name that is there already.
    pub fn with_primitive(self, name: &str, shape: &Geometry, at: Pose) -> Result<Self> {
        let (core, rounding) = match *shape {
            Geometry::Box { size } => (Core::Cuboid { half: size / 2.0 }, 0.0),
            Geometry::Cylinder { radius, length } => {
                (Core::Cylinder { radius, half: length / 2.0 }, 0.0)
            }
            Geometry::Capsule { radius, length } => (Core::Segment { half: length / 2.0 }, radius),
            Geometry::Sphere { radius } => (Core::Point, radius),
            _ => {
                let expected = "a box, cylinder, capsule or ball";
                return Err(invalid(name, expected, format!("{shape:?}")));
            }
        };
        let sizes = match core {
            Core::Cuboid { half } => half.to_array(),
            Core::Cylinder { radius, half } => [radius, half, rounding],
            Core::Segment { half } => [half, rounding, rounding],
            _ => [rounding; 3],
        };
        if let Some(size) = sizes.iter().find(|size| !(0.0..=MAX_REACH).contains(*size)) {
            return Err(invalid(name, "sizes from 0 to 1e4 m", size.to_string()));
        }
        self.with(name, Shape::Primitive(Convex { core, rounding }), at)
    }

    /// Adds a mesh whose units are `scale` metres, as its triangles stand; where it is watertight its inside is solid.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mesh without triangles, a scale that is not positive, numbers that are not finite and a
    /// name that is there already.
    pub fn with_mesh(self, name: &str, mesh: &Mesh, scale: f64, at: Pose) -> Result<Self> {
        if mesh.n_faces() == 0 {
            return Err(invalid(name, "a mesh with triangles", "none".into()));
        }
        let (low, high) = mesh.bounds();
        let reach = low.abs().max(high.abs()).max_element() * scale;
        if !(scale > 0.0 && reach <= MAX_REACH) {
            let expected = "a positive scale and corners within 1e4 m";
            return Err(invalid(name, expected, format!("scale {scale}, corners to {reach} m")));
        }
        self.with(name, Shape::Surface(Surface::of_mesh(mesh, scale)), at)
    }

    /// Adds points; everything keeps `margin` metres away from each. No points add nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a margin or a point that is not finite, a negative margin, and a name that is there already.
    pub fn with_cloud(self, name: &str, points: &[DVec3], margin: f64, at: Pose) -> Result<Self> {
        if !(0.0..=MAX_REACH).contains(&margin) {
            return Err(invalid(name, "a margin of at least 0 m", margin.to_string()));
        }
        // A comparison with NaN is false: such a point is found as well.
        let is_near = |p: &DVec3| p.is_finite() && p.abs().max_element() <= MAX_REACH;
        if let Some(i) = points.iter().position(|p| !is_near(p)) {
            let found = format!("{} at point {i}", points[i]);
            return Err(invalid(name, "coordinates within 1e4 m", found));
        }
        if points.is_empty() {
            return Ok(self);
        }
        self.with(name, Shape::Surface(Surface::of_points(points, margin)), at)
    }

    /// Adds a table: everything below the plane through `point` is solid. `normal` points away from it, at any length.
    ///
    /// # Errors
    /// [`Error::Invalid`] for numbers that are not finite, a normal of length 0, and a name that is there already.
    pub fn with_table(self, name: &str, point: DVec3, normal: DVec3) -> Result<Self> {
        let Some(up) = normal.try_normalize() else {
            return Err(invalid(name, "a normal of some length", normal.to_string()));
        };
        let turn = semfm_geom::math::DQuat::from_rotation_arc(DVec3::Z, up);
        self.with(name, Shape::HalfSpace, Pose::from_parts(point, turn))
    }

    /// Adds a body of convex pieces, such as the object that is to be grasped.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a pose that is not finite and a name that is there already.
    pub fn with_body(self, name: &str, body: &CollisionBody, at: Pose) -> Result<Self> {
        self.with(name, Shape::Body(body.clone()), at)
    }

    /// The scene without the obstacle of that name.
    ///
    /// # Errors
    /// [`Error::Invalid`] where there is none.
    pub fn without(mut self, name: &str) -> Result<Self> {
        let found = self.find(name)?;
        self.obstacles.remove(found);
        Ok(self)
    }

    /// Names of all obstacles, in the order in which they were added.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.obstacles.iter().map(|obstacle| obstacle.name.as_str())
    }

    pub(crate) fn obstacles(&self) -> &[Arc<Obstacle>] {
        &self.obstacles
    }

    fn find(&self, name: &str) -> Result<usize> {
        self.names().position(|other| other == name).ok_or_else(|| {
            let names: Vec<&str> = self.names().collect();
            invalid(name, "the name of an obstacle", format!("only {}", names.join(", ")))
        })
    }

    fn with(mut self, name: &str, shape: Shape, at: Pose) -> Result<Self> {
        if self.names().any(|other| other == name) {
            return Err(invalid(name, "a name for one obstacle only", "a second one".into()));
        }
        let is_near = at.translation.abs().max_element() <= MAX_REACH;
        if !(at.translation.is_finite() && is_near && at.rotation.is_finite()) {
            let expected = "a finite pose within 1e4 m";
            return Err(invalid(name, expected, format!("{at:?}")));
        }
        let at = Pose::from_parts(at.translation, at.rotation.normalize());
        if !at.rotation.is_finite() {
            return Err(invalid(name, "a rotation", "a quaternion of length 0".into()));
        }
        let base_from_obstacle = Frame::new(at);
        self.obstacles.push(Arc::new(Obstacle { name: name.into(), base_from_obstacle, shape }));
        Ok(self)
    }
}

fn invalid(name: &str, expected: &str, found: String) -> Error {
    Error::Invalid { what: format!("obstacle `{name}`"), expected: expected.into(), found }
}

impl Obstacle {
    /// A lower bound of the distance of a point.
    pub(crate) fn bound_distance(&self, p: DVec3) -> f64 {
        let at = &self.base_from_obstacle;
        match &self.shape {
            Shape::Primitive(convex) => convex.point_distance(at.inverse_point(p)).unwrap_or(0.0),
            Shape::HalfSpace => (p - at.pose.translation).dot(at.turn.z_axis),
            Shape::Body(body) => p.distance(at.point(body.centre())) - body.radius(),
            Shape::Surface(surface) => surface.bound_distance(at.inverse_point(p)),
        }
    }

    /// A lower bound of the distance of a body at `body_at`, exact where it is small; `most` where it is that or more,
    /// 0 where they meet.
    pub(crate) fn gap(&self, body: &CollisionBody, body_at: &Frame, most: f64) -> f64 {
        let at = &self.base_from_obstacle;
        match &self.shape {
            Shape::Primitive(convex) => primitive_gap(convex, at, body, body_at, most),
            Shape::HalfSpace => half_space_gap(at, body, body_at, most),
            Shape::Body(other) => body_gap(body, body_at, other, at, most),
            Shape::Surface(surface) => surface.gap(body, body_at, at, most),
        }
    }

    /// How deep a body is in this: of the pieces that touch, the deepest. 0 where none does.
    pub(crate) fn depth(&self, body: &CollisionBody, body_at: &Frame) -> f64 {
        let at = &self.base_from_obstacle;
        let depths = body.pieces().iter().map(|piece| {
            let piece_at = body_at.pose * piece.body_from_piece;
            match &self.shape {
                Shape::Primitive(convex) => {
                    depth(&at.pose.inv_mul(&piece_at), convex, &piece.convex)
                }
                Shape::HalfSpace => {
                    let up = at.turn.z_axis;
                    at.pose.translation.dot(up) - piece.convex.lowest(&piece_at, up)
                }
                Shape::Body(other) => {
                    let pieces = other.pieces().iter().map(|other| {
                        let other_at = at.pose * other.body_from_piece;
                        depth(&other_at.inv_mul(&piece_at), &other.convex, &piece.convex)
                    });
                    pieces.fold(0.0, f64::max)
                }
                Shape::Surface(surface) => surface.depth(piece, body_at, at),
            }
        });
        depths.fold(0.0, f64::max)
    }
}

fn primitive_gap(
    convex: &Convex,
    at: &Frame,
    body: &CollisionBody,
    body_at: &Frame,
    most: f64,
) -> f64 {
    // The formula is chosen once, not for each sphere.
    match convex.core {
        Core::Cuboid { half } => {
            let to = move |p: DVec3| (p.abs() - half).max(DVec3::ZERO).length();
            primitive_gap_by(to, convex, at, body, body_at, most)
        }
        _ => {
            let to = |p: DVec3| convex.point_distance(p).unwrap_or(0.0);
            primitive_gap_by(to, convex, at, body, body_at, most)
        }
    }
}

/// The same; `to` is the distance from a point in the frame of the obstacle.
fn primitive_gap_by(
    to: impl Fn(DVec3) -> f64,
    convex: &Convex,
    at: &Frame,
    body: &CollisionBody,
    body_at: &Frame,
    most: f64,
) -> f64 {
    let centre = at.inverse_point(body_at.point(body.centre()));
    if to(centre) - body.radius() >= most {
        return most;
    }
    let here = at.relative(body_at);
    let mut least = most;
    for piece in body.pieces() {
        let by_spheres = piece.spheres.least_gap(least, |centre| to(here.point(centre)));
        least = refined(by_spheres, least, |least| {
            let piece_at = body_at.pose * piece.body_from_piece;
            distance(&at.pose.inv_mul(&piece_at), convex, &piece.convex, least)
        });
        if least <= 0.0 {
            return 0.0;
        }
    }
    least
}

fn half_space_gap(at: &Frame, body: &CollisionBody, body_at: &Frame, most: f64) -> f64 {
    let up = at.turn.z_axis;
    let height = |p: DVec3| (p - at.pose.translation).dot(up);
    if height(body_at.point(body.centre())) - body.radius() >= most {
        return most;
    }
    let ground = at.pose.translation.dot(up);
    let lowest = body
        .pieces()
        .iter()
        .map(|piece| piece.convex.lowest(&(body_at.pose * piece.body_from_piece), up) - ground);
    lowest.fold(most, f64::min).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d_f64::shape::SharedShape;
    use semfm_geom::zoo;

    fn body() -> CollisionBody {
        let shape = SharedShape::cuboid(0.05, 0.05, 0.1);
        CollisionBody::from_pieces(&[(Pose::IDENTITY, shape)]).unwrap()
    }

    #[test]
    fn gaps_and_depths_to_each_kind_of_obstacle() {
        let size = DVec3::new(0.2, 0.2, 0.2);
        let at = Pose::translation(0.5, 0.0, 0.0);
        let ball = zoo::icosphere(3);
        let scene = Scene::new()
            .with_primitive("box", &Geometry::Box { size }, at)
            .and_then(|s| {
                s.with_primitive("can", &Geometry::Cylinder { radius: 0.1, length: 0.2 }, at)
            })
            .and_then(|s| {
                s.with_primitive("rod", &Geometry::Capsule { radius: 0.1, length: 0.2 }, at)
            })
            .and_then(|s| s.with_primitive("ball", &Geometry::Sphere { radius: 0.1 }, at))
            .and_then(|s| s.with_mesh("mesh", &ball, 0.1, at))
            .and_then(|s| s.with_cloud("cloud", &[DVec3::ZERO], 0.1, at))
            .and_then(|s| s.with_table("wall", DVec3::new(0.4, 0.0, 0.0), -DVec3::X))
            .and_then(|s| s.with_body("body", &CollisionBody::from_mesh(&ball, 0.1).unwrap().0, at))
            .unwrap();
        for obstacle in scene.obstacles() {
            for (x, truth) in [(0.2_f64, 0.15_f64), (0.345, 0.005), (0.37, -0.02)] {
                let body_at = Frame::new(Pose::translation(x, 0.0, 0.0));
                let gap = obstacle.gap(&body(), &body_at, 1.0);
                let depth = obstacle.depth(&body(), &body_at);
                assert!(gap <= truth.max(0.0) + 1e-3, "{}: {gap} {truth}", obstacle.name);
                assert!(gap >= truth - 0.03, "{}: {gap} {truth}", obstacle.name);
                // A mesh is touched in its triangles, which are not as deep as the solid.
                if obstacle.name != "mesh" {
                    let expected = (-truth).max(0.0);
                    assert!((depth - expected).abs() < 1e-3, "{}: {depth}", obstacle.name);
                } else {
                    assert_eq!(depth > 0.0, truth < 0.0);
                }
            }
        }
    }

    #[test]
    fn a_scene_without_sense_is_refused() {
        let scene = Scene::new();
        let at = Pose::IDENTITY;
        let shape = Geometry::Box { size: DVec3::ONE };
        let negative = Geometry::Box { size: -DVec3::ONE };
        assert!(scene.clone().with_primitive("a", &negative, at).is_err());
        let nan = Geometry::Sphere { radius: f64::NAN };
        assert!(scene.clone().with_primitive("a", &nan, at).is_err());
        let far = Pose::translation(f64::NAN, 0.0, 0.0);
        assert!(scene.clone().with_primitive("a", &shape, far).is_err());
        assert!(scene.clone().with_table("a", DVec3::ZERO, DVec3::ZERO).is_err());
        assert!(scene.clone().with_cloud("a", &[DVec3::NAN], 0.1, at).is_err());
        assert!(scene.clone().with_cloud("a", &[DVec3::ONE], -0.1, at).is_err());
        assert!(scene.clone().with_mesh("a", &zoo::tetrahedron(), -1.0, at).is_err());
        assert_eq!(scene.clone().with_cloud("a", &[], 0.1, at).unwrap().names().len(), 0);
        let scene = scene.with_primitive("a", &shape, at).unwrap();
        assert!(scene.clone().with_primitive("a", &shape, at).is_err());
        assert!(scene.clone().without("b").is_err());
        assert_eq!(scene.without("a").unwrap().names().len(), 0);
    }
}
