//! Rigid bodies as the collision checks want them: convex pieces under spheres.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::Mesh;
use semfm_geom::math::{DMat3, DVec3};
use semfm_robot::{ConvexPieces, LinkShape};

use super::convex::{Convex, PlacedConvex, distance};
use super::sphere_tree::SphereTree;
use crate::{Error, Result};

/// Most spheres of a body. For a Panda, 64 a link leave one exact query in ten to an obstacle that is 1 cm away; with
/// 16 it is every third, with 256 the walk through the spheres costs as much as what it saves.
const MAX_SPHERES: usize = 64;

/// Nearer than this a distance by spheres is not good enough, and the pieces are asked, metres: by so much the spheres
/// of [`MAX_SPHERES`] stand out from a link.
const SPHERE_SLACK: f64 = 0.02;

/// A rigid body in its own frame, prepared for collision checks: convex pieces, and spheres that cover them. Cheap to
/// clone.
#[derive(Clone, Debug)]
pub struct CollisionBody {
    inner: Arc<Body>,
}

#[derive(Debug)]
struct Body {
    pieces: Vec<Piece>,
    /// A sphere around all pieces.
    centre: DVec3,
    radius: f64,
}

/// A convex piece of a body.
#[derive(Debug)]
pub(crate) struct Piece {
    pub(crate) body_from_piece: Pose,
    pub(crate) convex: Convex,
    pub(crate) spheres: SphereTree,
}

impl CollisionBody {
    /// From convex pieces in the body's frame, metres. Polyhedra, cuboids, balls, capsules and cylinders are taken as
    /// they are, compounds piece by piece; a triangle mesh becomes its hull.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a shape without bounds and numbers that are not finite.
    pub fn from_pieces(pieces: &[(Pose, SharedShape)]) -> Result<Self> {
        let mut placed = Vec::new();
        for (pose, shape) in pieces {
            let bounds = shape.compute_aabb(pose);
            let inner = Convex::pieces(shape.as_typed_shape())
                .filter(|_| bounds.mins.is_finite() && bounds.maxs.is_finite())
                .ok_or_else(|| Error::Invalid {
                    what: "shape of a body".into(),
                    expected: "convex pieces within finite bounds".into(),
                    found: format!("{:?} within {bounds:?}", shape.shape_type()),
                })?;
            placed.extend(inner.into_iter().map(|piece| PlacedConvex {
                body_from_convex: *pose * piece.body_from_convex,
                convex: piece.convex,
            }));
        }
        Ok(Self::new(placed))
    }

    /// From a mesh in units of `scale` metres, cut into convex pieces; the note says where that did not work.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a mesh without triangles and a scale that is not positive.
    pub fn from_mesh(mesh: &Mesh, scale: f64) -> Result<(Self, Option<String>)> {
        let invalid = |what: &str, expected: &str, found: String| Error::Invalid {
            what: what.into(),
            expected: expected.into(),
            found,
        };
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(invalid("scale of a mesh", "a positive number", scale.to_string()));
        }
        if mesh.n_faces() == 0 {
            return Err(invalid("mesh of a body", "triangles", "none".into()));
        }
        let points: Vec<DVec3> = mesh.vertices().iter().map(|&p| p * scale).collect();
        let cut = ConvexPieces::new(&points, mesh.faces());
        let pieces: Vec<_> = cut.shapes.into_iter().map(|shape| (Pose::IDENTITY, shape)).collect();
        Ok((Self::from_pieces(&pieces)?, cut.note))
    }

    /// From the shape of a link.
    ///
    /// # Errors
    /// As [`CollisionBody::from_pieces`].
    pub fn from_link(shape: &LinkShape) -> Result<Self> {
        let pieces: Vec<_> =
            shape.pieces.iter().map(|p| (p.link_from_piece, p.shape.clone())).collect();
        Self::from_pieces(&pieces)
    }

    fn new(placed: Vec<PlacedConvex>) -> Self {
        let trees = SphereTree::of_pieces(&placed, MAX_SPHERES);
        let (centre, radius) = around(&trees);
        let pieces = placed
            .into_iter()
            .zip(trees)
            .map(|(piece, spheres)| Piece {
                body_from_piece: piece.body_from_convex,
                convex: piece.convex,
                spheres,
            })
            .collect();
        Self { inner: Arc::new(Body { pieces, centre, radius }) }
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.inner.pieces
    }

    /// Number of convex pieces.
    pub fn n_pieces(&self) -> usize {
        self.inner.pieces.len()
    }

    /// Number of spheres that cover them.
    pub fn n_spheres(&self) -> usize {
        self.inner.pieces.iter().map(|piece| piece.spheres.n_leaves()).sum()
    }

    /// Centre of the sphere around all pieces, in the body's frame.
    pub(crate) fn centre(&self) -> DVec3 {
        self.inner.centre
    }

    pub(crate) fn radius(&self) -> f64 {
        self.inner.radius
    }
}

/// A sphere around the spheres of all pieces.
fn around(trees: &[SphereTree]) -> (DVec3, f64) {
    let n = trees.len().max(1) as f64;
    let centre = match trees {
        [only] => only.bound().centre,
        _ => trees.iter().map(|tree| tree.bound().centre).sum::<DVec3>() / n,
    };
    // Leaves cover more closely than the bounds of large pieces do.
    let leaves = trees.iter().flat_map(SphereTree::leaves);
    let by_leaves = leaves.fold(0.0, |r: f64, s| r.max(s.centre.distance(centre) + s.radius));
    let bounds = trees.iter().map(SphereTree::bound);
    let by_bounds = bounds.fold(0.0, |r: f64, s| r.max(s.centre.distance(centre) + s.radius));
    (centre, by_leaves.min(by_bounds))
}

/// A pose with its rotation as a matrix, which turns many points faster.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) pose: Pose,
    pub(crate) turn: DMat3,
}

impl Frame {
    pub(crate) fn new(pose: Pose) -> Self {
        Self { turn: DMat3::from_quat(pose.rotation), pose }
    }

    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.pose.translation
    }

    /// A point of the outer frame in this one.
    pub(crate) fn inverse_point(&self, p: DVec3) -> DVec3 {
        self.turn.transpose() * (p - self.pose.translation)
    }

    /// Points of `other`, a frame beside this one, as points of this one.
    pub(crate) fn relative(&self, other: &Self) -> Relative {
        let back = self.turn.transpose();
        let translation = back * (other.pose.translation - self.pose.translation);
        Relative { turn: back * other.turn, translation }
    }
}

/// A rotation and a translation for many points.
#[derive(Clone, Copy)]
pub(crate) struct Relative {
    pub(crate) turn: DMat3,
    pub(crate) translation: DVec3,
}

impl Relative {
    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.translation
    }
}

/// A lower bound of the distance between two bodies, exact where it is small; `most` where it is that or more, 0 where
/// they meet.
pub(crate) fn body_gap(
    a: &CollisionBody,
    a_at: &Frame,
    b: &CollisionBody,
    b_at: &Frame,
    most: f64,
) -> f64 {
    let apart = a_at.point(a.centre()).distance(b_at.point(b.centre()));
    if apart - a.radius() - b.radius() >= most {
        return most;
    }
    let a_from_b = a_at.relative(b_at);
    let mut least = most;
    for piece_b in b.pieces() {
        let bound = piece_b.spheres.bound();
        let centre = a_from_b.point(bound.centre);
        if centre.distance(a.centre()) - bound.radius - a.radius() >= least {
            continue;
        }
        for piece_a in a.pieces() {
            let by_spheres =
                SphereTree::least_gap_between(&piece_a.spheres, &piece_b.spheres, &a_from_b, least);
            least = refined(by_spheres, least, |least| {
                let a_at = a_at.pose * piece_a.body_from_piece;
                let b_at = b_at.pose * piece_b.body_from_piece;
                distance(&a_at.inv_mul(&b_at), &piece_a.convex, &piece_b.convex, least)
            });
            if least <= 0.0 {
                return 0.0;
            }
        }
    }
    least
}

/// The bound by spheres where that is good enough, else what the pieces say.
pub(crate) fn refined(by_spheres: f64, least: f64, exact: impl FnOnce(f64) -> f64) -> f64 {
    if by_spheres >= least {
        least
    } else if by_spheres > SPHERE_SLACK {
        by_spheres
    } else {
        exact(least).min(least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn boxes(half: [f64; 3], more: [f64; 3]) -> CollisionBody {
        let [a, b] = [half, more].map(|[x, y, z]| SharedShape::cuboid(x, y, z));
        CollisionBody::from_pieces(&[
            (Pose::IDENTITY, a),
            (Pose::translation(0.0, 0.0, half[2] + more[2]), b),
        ])
        .unwrap()
    }

    /// Of all pairs of pieces, without spheres.
    fn exact(a: &CollisionBody, a_at: &Pose, b: &CollisionBody, b_at: &Pose) -> f64 {
        let mut least = 9.0_f64;
        for p in a.pieces() {
            for q in b.pieces() {
                let between = (*a_at * p.body_from_piece).inv_mul(&(*b_at * q.body_from_piece));
                least = least.min(distance(&between, &p.convex, &q.convex, 9.0));
            }
        }
        least
    }

    proptest! {
        #[test]
        fn a_gap_is_a_lower_bound_and_exact_where_it_is_small(
            sizes in prop::array::uniform4(prop::array::uniform3(0.02..0.2_f64)),
            at in prop::array::uniform3(-0.8..0.8_f64),
            turns in prop::array::uniform2(prop::array::uniform3(-2.0..2.0_f64)),
            most in 1e-4..0.5_f64,
        ) {
            let (a, b) = (boxes(sizes[0], sizes[1]), boxes(sizes[2], sizes[3]));
            let a_at = Pose::new(DVec3::new(0.1, 0.2, 0.3), turns[0].into());
            let b_at = Pose::new(at.into(), turns[1].into());
            let gap = body_gap(&a, &Frame::new(a_at), &b, &Frame::new(b_at), most);
            let truth = exact(&a, &a_at, &b, &b_at);
            prop_assert!(gap <= truth + 1e-9);
            prop_assert!((gap == 0.0) == (truth == 0.0));
            if gap < SPHERE_SLACK.min(most) {
                prop_assert!((gap - truth).abs() < 1e-7);
            }
        }
    }

    #[test]
    fn what_has_no_bounds_is_refused() {
        let plane = SharedShape::halfspace(DVec3::Z);
        assert!(CollisionBody::from_pieces(&[(Pose::IDENTITY, plane)]).is_err());
        let far = Pose::translation(f64::NAN, 0.0, 0.0);
        assert!(CollisionBody::from_pieces(&[(far, SharedShape::ball(0.1))]).is_err());
        let mesh = semfm_geom::zoo::icosphere(1);
        assert!(CollisionBody::from_mesh(&mesh, 0.0).is_err());
        assert_eq!(CollisionBody::from_mesh(&mesh, 0.05).unwrap().0.n_pieces(), 1);
    }
}
