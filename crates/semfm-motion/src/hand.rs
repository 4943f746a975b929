//! The hand at the end of an arm, as rigid parts, and the grasps that it is to take.

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::math::{DQuat, DVec3};
use semfm_robot::Role;
use std::f64::consts::PI;

use crate::{Error, Result};

/// Distance between corners that count as the same, metres: a part is its mirror's turn to within a scanner's noise.
const SAME_CORNER: f64 = 1e-4;

/// A hand as rigid parts. Where the parts stand is told by each [`TargetGrasp`].
#[derive(Clone, Debug)]
pub struct Hand {
    /// The parts, in the order of a grasp's poses.
    pub parts: Vec<HandPart>,
    /// Whether the hand is the same when it is turned half way round its approach axis: then both ways to take a grasp
    /// are tried.
    pub is_symmetric: bool,
}

/// A rigid part of a hand: convex pieces in a frame of their own, metres.
#[derive(Clone, Debug)]
pub struct HandPart {
    /// Name of the link that it belongs to.
    pub name: String,
    /// Palm or finger: fingers may touch the object.
    pub role: Role,
    /// Its convex pieces, in the part's frame.
    pub pieces: Vec<(Pose, SharedShape)>,
}

/// A grasp that the arm is to carry out.
#[derive(Clone, Debug)]
pub struct TargetGrasp {
    /// The TCP when the fingers are closed, in the frame of the arm's base: +z along the approach, y along the closing
    /// direction.
    pub base_from_tcp: Pose,
    /// The same TCP in the frame of the arm's tip.
    pub tip_from_tcp: Pose,
    /// Distance between the closed pads, metres.
    pub width: f64,
    /// Distance between the pads on the way in, metres.
    pub opening: f64,
    /// How good the grasp is, 0 to 1.
    pub score: f64,
    /// Pose of each part in the frame of the TCP, fingers closed.
    pub closed: Vec<Pose>,
    /// The same with the fingers open, the arm where it is when they close.
    pub open: Vec<Pose>,
}

impl TargetGrasp {
    /// Checks numbers that come from outside; `n_parts` is the number of the hand's parts.
    ///
    /// # Errors
    /// [`Error::Invalid`] for poses that are not finite, widths below zero or in the wrong order, and lists of another
    /// length.
    pub fn check(&self, n_parts: usize) -> Result<()> {
        let invalid = |what: &str, expected: &str, found: String| Error::Invalid {
            what: format!("grasp: {what}"),
            expected: expected.into(),
            found,
        };
        let poses = [self.base_from_tcp, self.tip_from_tcp];
        let all = poses.iter().chain(&self.closed).chain(&self.open);
        for pose in all {
            if !(pose.translation.is_finite() && pose.rotation.is_finite()) {
                return Err(invalid("pose", "finite numbers", format!("{:?}", pose.translation)));
            }
        }
        for (what, list) in [("closed", &self.closed), ("open", &self.open)] {
            if list.len() != n_parts {
                let expected = format!("{n_parts} poses, one a part of the hand");
                return Err(invalid(what, &expected, list.len().to_string()));
            }
        }
        let widths_are_sound = 0.0 <= self.width
            && self.width <= self.opening
            && self.opening.is_finite()
            && self.score.is_finite();
        if !widths_are_sound {
            let found = format!("{} and {}", self.width, self.opening);
            return Err(invalid("width and opening", "0 ≤ width ≤ opening", found));
        }
        Ok(())
    }

    /// The same grasp with the hand turned half way round its approach axis.
    ///
    /// The two fingers change places, and the poses of the parts in the frame of the TCP stay what they are.
    #[must_use]
    pub fn turned(&self) -> Self {
        let half_turn = Pose::from_rotation(DQuat::from_rotation_z(PI));
        Self { base_from_tcp: self.base_from_tcp * half_turn, ..self.clone() }
    }

    /// Where the arm's tip is at the grasp.
    pub fn base_from_tip(&self) -> Pose {
        self.base_from_tcp * self.tip_from_tcp.inverse()
    }

    /// Where the arm's tip is `distance` metres before the grasp, against its approach direction.
    pub fn base_from_tip_before(&self, distance: f64) -> Pose {
        let back = Pose::from_translation(DVec3::new(0.0, 0.0, -distance));
        self.base_from_tcp * back * self.tip_from_tcp.inverse()
    }

    /// Pose of each part in the frame of the arm's tip when the fingers have gone `share` of their way from open (0) to
    /// closed (1): straight between the two, turned evenly.
    pub fn tip_from_parts(&self, share: f64) -> Vec<Pose> {
        let between = |(open, closed): (&Pose, &Pose)| {
            let translation = open.translation.lerp(closed.translation, share);
            let rotation = open.rotation.slerp(closed.rotation, share);
            self.tip_from_tcp * Pose::from_parts(translation, rotation)
        };
        self.open.iter().zip(&self.closed).map(between).collect()
    }
}

impl Hand {
    /// A hand of parts whose poses in the TCP's frame are `tcp_from_parts` at one width. Symmetric where a half turn about
    /// the TCP's z takes every corner of every part to a corner of a part.
    pub fn new(parts: Vec<HandPart>, tcp_from_parts: &[Pose]) -> Self {
        let half_turn = DQuat::from_rotation_z(PI);
        let corners: Vec<DVec3> = parts
            .iter()
            .zip(tcp_from_parts)
            .flat_map(|(part, &tcp_from_part)| {
                part.pieces.iter().flat_map(move |(part_from_piece, shape)| {
                    let pose = tcp_from_part * *part_from_piece;
                    corners_of(shape).into_iter().map(move |corner| pose * corner)
                })
            })
            .collect();
        let is_met =
            |corner: DVec3| corners.iter().any(|other| other.distance(corner) < SAME_CORNER);
        let is_symmetric = corners.iter().all(|&corner| is_met(half_turn * corner));
        Self { parts, is_symmetric }
    }

    /// What messages call each part: unique, and unlike the links of a robot.
    pub fn part_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for part in &self.parts {
            let side = match part.role {
                Role::Palm => "palm",
                Role::Left => "left finger",
                Role::Right => "right finger",
            };
            let plain = format!("gripper's {} ({side})", part.name);
            let n_alike = names.iter().filter(|other| other.starts_with(&plain)).count();
            names.push(if n_alike == 0 { plain } else { format!("{plain} {}", n_alike + 1) });
        }
        names
    }
}

/// Corners of a convex piece; of round shapes the corners of the box around them.
fn corners_of(shape: &SharedShape) -> Vec<DVec3> {
    if let Some(hull) = shape.as_convex_polyhedron() {
        return hull.points().to_vec();
    }
    shape.compute_local_aabb().vertices().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(at: DVec3, role: Role) -> HandPart {
        let shape = SharedShape::cuboid(0.01, 0.005, 0.02);
        HandPart { name: "finger".into(), role, pieces: vec![(Pose::from_translation(at), shape)] }
    }

    fn grasp() -> TargetGrasp {
        TargetGrasp {
            base_from_tcp: Pose::from_parts(DVec3::new(0.5, 0.1, 0.3), DQuat::from_rotation_y(2.0)),
            tip_from_tcp: Pose::translation(0.0, 0.0, 0.1),
            width: 0.02,
            opening: 0.06,
            score: 0.5,
            closed: vec![Pose::translation(0.0, 0.01, 0.0); 2],
            open: vec![Pose::translation(0.0, 0.03, 0.0); 2],
        }
    }

    #[test]
    fn a_pair_of_like_fingers_is_symmetric_and_a_camera_on_one_side_is_not() {
        let fingers =
            vec![block(DVec3::Y * 0.02, Role::Right), block(DVec3::Y * -0.02, Role::Left)];
        assert!(Hand::new(fingers.clone(), &[Pose::IDENTITY; 2]).is_symmetric);
        let with_camera = [fingers, vec![block(DVec3::X * 0.05, Role::Palm)]].concat();
        assert!(!Hand::new(with_camera, &[Pose::IDENTITY; 3]).is_symmetric);
    }

    #[test]
    fn before_the_grasp_is_against_the_approach() {
        let grasp = grasp();
        let way = grasp.base_from_tip_before(0.1).translation - grasp.base_from_tip().translation;
        let approach = grasp.base_from_tcp.rotation * DVec3::Z;
        assert!((way + 0.1 * approach).length() < 1e-12);
        let turned = grasp.turned();
        assert!(
            turned.turned().base_from_tcp.rotation.dot(grasp.base_from_tcp.rotation).abs()
                > 1.0 - 1e-12
        );
        assert!(
            (turned.base_from_tcp.rotation * DVec3::Y + grasp.base_from_tcp.rotation * DVec3::Y)
                .length()
                < 1e-12
        );
    }

    #[test]
    fn fingers_move_from_open_to_closed() {
        let grasp = grasp();
        for (share, y) in [(0.0, 0.03), (0.5, 0.02), (1.0, 0.01)] {
            let parts = grasp.tip_from_parts(share);
            assert!((parts[0].translation - DVec3::new(0.0, y, 0.1)).length() < 1e-12);
        }
    }

    #[test]
    fn unsound_grasps_are_refused() {
        assert!(grasp().check(2).is_ok());
        assert!(grasp().check(3).is_err());
        assert!(TargetGrasp { width: 0.07, ..grasp() }.check(2).is_err());
        assert!(TargetGrasp { opening: f64::NAN, ..grasp() }.check(2).is_err());
        let nowhere = Pose::translation(f64::NAN, 0.0, 0.0);
        assert!(TargetGrasp { base_from_tcp: nowhere, ..grasp() }.check(2).is_err());
    }
}
