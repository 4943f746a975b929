//! Two-finger hands: what moves, what is rigid, how wide it opens.
//!
//! A hand comes from a built-in parameter set ([`Gripper::builtin`]) or from a robot description
//! ([`Gripper::from_urdf`]); [`Gripper::open`] takes the name of either. Both give the same thing:
//! convex parts, and for each width between the pads the pose of every part in the frame between
//! the pads (TCP).

mod builtin;
mod drive;
mod jaws;
mod load;
mod motion;
mod pads;
mod solids;

use std::ops::RangeInclusive;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;

pub use self::drive::DriveJoint;
pub use self::load::GripperSettings;
pub use self::motion::Motion;
use crate::{Error, Result};

/// A parallel-jaw gripper. Its frame (TCP): origin between the finger pads, +z along the approach,
/// y along the closing direction, metres.
#[derive(Clone, Debug)]
pub struct Gripper {
    /// Name, as in the URDF or the built-in set.
    pub name: String,
    /// Distances between the pads that the joints can reach, metres.
    pub opening: RangeInclusive<f64>,
    /// The pads' rectangle: extent along x (width of the finger) and along z (approach), metres.
    /// Its middle is the origin.
    pub pad: [f64; 2],
    /// The flange's frame that the robot moves, from the TCP, when the pads are as close as they
    /// get. Where a linkage carries the pads along z it differs for other widths: ask
    /// [`Gripper::flange_from_tcp_at`].
    pub flange_from_tcp: Pose,
    /// Rigid parts of palm and fingers.
    pub parts: Vec<GripperPart>,
    /// The joints that open and close it, where they are known by name; mimicking ones follow.
    pub joints: Vec<DriveJoint>,
    /// What was replaced or left out when it was loaded, in words.
    pub notes: Vec<String>,
    /// The TCP in the flange's frame, by width.
    flange_motion: Motion,
}

/// A rigid convex or boxed part of the gripper.
#[derive(Clone, Debug)]
pub struct GripperPart {
    /// The link it belongs to.
    pub link: String,
    /// Whether it moves with a finger.
    pub role: Role,
    /// Its collision shape, in its own frame.
    pub shape: SharedShape,
    /// Its pose in the TCP frame, by width between the pads.
    pub motion: Motion,
}

/// What a part moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Fixed to the palm.
    Palm,
    /// Moves with the finger whose pad lies at negative y.
    Left,
    /// Moves with the finger whose pad lies at positive y.
    Right,
}

impl Gripper {
    /// A gripper of parts that bring their own motion. `flange` gives the TCP in the flange's frame
    /// by width.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the opening is empty, negative or not finite, a pad has no area,
    /// or there is no part.
    pub fn new(
        name: impl Into<String>,
        opening: RangeInclusive<f64>,
        pad: [f64; 2],
        flange: Motion,
        parts: Vec<GripperPart>,
    ) -> Result<Self> {
        let out = |what, expected: &str, found: String| {
            Err(Error::OutOfRange { what, expected: expected.into(), found })
        };
        let (closed, open) = (*opening.start(), *opening.end());
        if !(closed >= 0.0 && open > closed && open.is_finite()) {
            return out("opening", "0 ≤ closed < open", format!("{closed} to {open}"));
        }
        if !pad.iter().all(|&side| side > 0.0 && side.is_finite()) {
            return out("pad", "two lengths above zero", format!("{pad:?}"));
        }
        if parts.is_empty() {
            return out("parts", "at least one", "none".into());
        }
        let flange_from_tcp = flange.at(closed);
        let (name, joints, notes) = (name.into(), Vec::new(), Vec::new());
        let flange_motion = flange;
        Ok(Self { name, opening, pad, flange_from_tcp, parts, joints, notes, flange_motion })
    }

    /// A built-in hand by its name, see [`Gripper::BUILTIN`].
    ///
    /// # Errors
    /// [`Error::UnknownGripper`] with the names there are.
    pub fn builtin(name: &str) -> Result<Self> {
        builtin::by_name(name).unwrap_or_else(|| {
            let known = Self::BUILTIN.join(", ");
            Err(Error::UnknownGripper { name: name.into(), known })
        })
    }

    /// Names of the built-in hands.
    pub const BUILTIN: [&str; 3] = ["franka", "robotiq-2f85", "robotiq-2f140"];

    /// Each part with its pose in the TCP frame when the pads are `width` metres apart; a width
    /// outside [`Gripper::opening`] counts as the nearest inside. The TCP stays between the pads:
    /// where a linkage carries the pads along z as it closes, palm and flange move instead.
    pub fn parts_at(&self, width: f64) -> Vec<(Pose, &GripperPart)> {
        let width = self.reachable(width);
        self.parts.iter().map(|part| (part.motion.at(width), part)).collect()
    }

    /// Names and positions (metres or radians) of the joints when the pads are `width` metres apart;
    /// empty where they are not known.
    pub fn joints_at(&self, width: f64) -> Vec<(&str, f64)> {
        let width = self.reachable(width);
        self.joints.iter().map(|joint| (joint.name.as_str(), joint.at(width))).collect()
    }

    /// The TCP's pose in the flange's frame when the pads are `width` metres apart.
    pub fn flange_from_tcp_at(&self, width: f64) -> Pose {
        self.flange_motion.at(self.reachable(width))
    }

    fn reachable(&self, width: f64) -> f64 {
        if width.is_nan() {
            return *self.opening.end();
        }
        width.clamp(*self.opening.start(), *self.opening.end())
    }
}

impl GripperPart {
    /// A part that moves with the width as `motion` says.
    pub fn new(
        link: impl Into<String>,
        role: Role,
        shape: SharedShape,
        motion: impl Into<Motion>,
    ) -> Self {
        Self { link: link.into(), role, shape, motion: motion.into() }
    }

    /// A part of a finger that slides apart along y: `closed` is its pose in the TCP frame at width
    /// 0, and it moves by half of the width towards its own side. A part of the palm stays.
    pub fn sliding(
        link: impl Into<String>,
        role: Role,
        shape: SharedShape,
        closed: Pose,
        widest: f64,
    ) -> Self {
        let side = match role {
            Role::Palm => 0.0,
            Role::Left => -1.0,
            Role::Right => 1.0,
        };
        let mut open = closed;
        open.translation.y += side * widest / 2.0;
        Self::new(link, role, shape, Motion::new([(0.0, closed), (widest, open)]))
    }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::math::Vector;
    use parry3d_f64::query::{PointQuery, distance, intersection_test};
    use parry3d_f64::shape::Cuboid;
    use proptest::prelude::*;

    use super::*;

    fn hands() -> impl Iterator<Item = Gripper> {
        Gripper::BUILTIN.iter().map(|name| Gripper::builtin(name).unwrap())
    }

    fn pad_distance(hand: &Gripper, width: f64) -> f64 {
        let parts = hand.parts_at(width);
        let of = |role| parts.iter().filter(move |(_, p)| p.role == role && p.link == "pad");
        let mut least = f64::INFINITY;
        for (left, a) in of(Role::Left) {
            for (right, b) in of(Role::Right) {
                least = least.min(distance(left, &*a.shape, right, &*b.shape).unwrap().distance);
            }
        }
        least
    }

    #[test]
    fn an_unknown_name_is_told_the_known_ones() {
        let error = Gripper::builtin("barrett").unwrap_err().to_string();
        assert!(Gripper::BUILTIN.iter().all(|name| error.contains(name)), "{error}");
    }

    #[test]
    fn closed_pads_touch_at_the_origin() {
        for hand in hands() {
            let touch = 1e-6; // interpolation between the table's widths
            assert!(pad_distance(&hand, 0.0) < touch, "{}", hand.name);
            for (pose, part) in hand.parts_at(0.0).iter().filter(|(_, part)| part.link == "pad") {
                let reach = part.shape.compute_aabb(pose);
                assert!(reach.distance_to_local_point(Vector::ZERO, true) < touch, "{}", hand.name);
            }
        }
    }

    #[test]
    fn left_is_the_mirror_of_right() {
        for hand in hands() {
            let count = |role| hand.parts.iter().filter(|part| part.role == role).count();
            assert_eq!(count(Role::Left), count(Role::Right), "{}", hand.name);
            for width in [0.0, 0.03, *hand.opening.end()] {
                let parts = hand.parts_at(width);
                let boxes = |role| {
                    let of = parts.iter().filter(move |(_, part)| part.role == role);
                    of.map(|(pose, part)| part.shape.compute_aabb(pose)).collect::<Vec<_>>()
                };
                for (left, right) in boxes(Role::Left).iter().zip(boxes(Role::Right)) {
                    let mirrored = [
                        (left.mins.x - right.mins.x).abs(),
                        (left.mins.z - right.mins.z).abs(),
                        (left.mins.y + right.maxs.y).abs(),
                        (left.maxs.y + right.mins.y).abs(),
                    ];
                    assert!(mirrored.iter().all(|&off| off < 1e-12), "{}: {mirrored:?}", hand.name);
                }
            }
        }
    }

    proptest! {
        #[test]
        fn fingers_are_as_far_apart_as_the_width_says(share in 0.0..1.0f64, hand in 0..3usize) {
            let hand = Gripper::builtin(Gripper::BUILTIN[hand]).unwrap();
            let width = share * hand.opening.end();
            prop_assert!((pad_distance(&hand, width) - width).abs() < 2e-6);
        }

        #[test]
        fn nothing_stands_between_the_pads(share in 0.01..1.0f64, hand in 0..3usize) {
            let hand = Gripper::builtin(Gripper::BUILTIN[hand]).unwrap();
            let width = share * hand.opening.end();
            let half = Vector::new(hand.pad[0] / 2.0, width / 2.0 - 1e-5, hand.pad[1] / 2.0);
            let gap = Cuboid::new(half);
            for (pose, part) in hand.parts_at(width) {
                let hit = intersection_test(&pose, &*part.shape, &Pose::IDENTITY, &gap).unwrap().intersecting;
                prop_assert!(!hit, "{}: {} at {width}", hand.name, part.link);
            }
        }
    }

    #[test]
    fn a_width_out_of_reach_counts_as_the_nearest() {
        let hand = Gripper::builtin("franka").unwrap();
        let poses = |width| hand.parts_at(width).iter().map(|(pose, _)| *pose).collect::<Vec<_>>();
        assert_eq!(poses(9.0), poses(*hand.opening.end()));
        assert_eq!(poses(-1.0), poses(*hand.opening.start()));
        assert_eq!(poses(f64::NAN), poses(*hand.opening.end()));
    }

    #[test]
    fn nonsense_is_no_gripper() {
        let part = || GripperPart::new("p", Role::Palm, SharedShape::ball(0.1), Pose::IDENTITY);
        let new =
            |opening, pad, parts| Gripper::new("x", opening, pad, Pose::IDENTITY.into(), parts);
        assert!(new(0.0..=0.1, [0.01, 0.01], vec![part()]).is_ok());
        assert!(new(0.1..=0.1, [0.01, 0.01], vec![part()]).is_err());
        assert!(new(0.0..=f64::NAN, [0.01, 0.01], vec![part()]).is_err());
        assert!(new(0.0..=0.1, [0.0, 0.01], vec![part()]).is_err());
        assert!(new(0.0..=0.1, [0.01, 0.01], vec![]).is_err());
    }
}
