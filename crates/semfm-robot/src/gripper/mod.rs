//! Two-finger grippers: what moves, what is rigid, how wide it opens.
//!
//! A gripper comes from the table of built-in ones ([`Gripper::builtin`]) or from a robot
//! description ([`Gripper::from_urdf`]); [`Gripper::open`] takes the name of either. Both give the
//! same thing: convex parts, and for each width between the pads the pose of every part in the
//! frame between the pads (TCP).

mod builtin;
mod drive_joint;
mod finger_pair;
mod from_urdf;
mod motion;
mod pads;
mod part;
mod surface;

use std::ops::RangeInclusive;

use parry3d_f64::math::Pose;

pub use self::builtin::{BUILTIN_GRIPPERS, BuiltinGripper};
pub use self::drive_joint::{DriveJoint, JointPosition};
pub use self::from_urdf::GripperSettings;
pub use self::motion::Motion;
pub use self::part::{GripperPart, PosedPart, Role};
use crate::{Error, Result};

/// Farthest that a gripper may open or any of its parts may reach from the TCP, metres. Hands that open half a metre
/// are rare; numbers beyond this are millimetres taken for metres, or accidents.
pub const MAX_SPAN: f64 = 5.0;

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
    /// get. Where a linkage carries the pads along z it differs for other widths: see
    /// [`Gripper::flange_from_tcp_at`].
    pub flange_from_tcp: Pose,
    /// Rigid parts of palm and fingers.
    pub parts: Vec<GripperPart>,
    /// The joints that open and close it, where they are known by name; mimicking ones follow.
    pub joints: Vec<DriveJoint>,
    /// The link whose frame the flange is, as robot descriptions name it; empty where that is not known.
    pub flange_link: String,
    /// What was replaced or left out when it was loaded, in words.
    pub notes: Vec<String>,
    /// The TCP in the flange's frame, by width.
    flange_motion: Motion,
}

impl Gripper {
    /// A gripper of parts that bring their own motion. `flange` gives the TCP in the flange's frame
    /// by width.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] where the opening is empty, negative or beyond [`MAX_SPAN`], a pad has no area, there is
    /// no part, or one reaches farther than [`MAX_SPAN`] from the TCP.
    pub fn new(
        name: impl Into<String>,
        opening: RangeInclusive<f64>,
        pad: [f64; 2],
        flange: Motion,
        parts: Vec<GripperPart>,
    ) -> Result<Self> {
        let (closed, open) = (*opening.start(), *opening.end());
        if !(closed >= 0.0 && open > closed && open.is_finite()) {
            let found = format!("{closed} to {open}");
            return Err(out_of_range("opening", "0 ≤ closed < open", found));
        }
        if !pad.iter().all(|&side| side > 0.0 && side.is_finite()) {
            let [x, z] = pad;
            return Err(out_of_range("pad", "two lengths above zero", format!("{x}, {z}")));
        }
        if parts.is_empty() {
            return Err(out_of_range("parts", "at least one", "none".into()));
        }
        if open > MAX_SPAN {
            let expected = format!("at most {MAX_SPAN} m (is it in millimetres?)");
            return Err(out_of_range("opening", &expected, format!("{open:.3e} m")));
        }
        for part in &parts {
            let reach = part.reach(closed).max(part.reach(open));
            if reach > MAX_SPAN {
                let expected = format!("at most {MAX_SPAN} m from the TCP (is it in millimetres?)");
                let found = format!("link `{}` reaches {reach:.3e} m", part.link);
                return Err(out_of_range("parts", &expected, found));
            }
        }
        let flange_from_tcp = flange.at(closed);
        Ok(Self {
            name: name.into(),
            opening,
            pad,
            flange_from_tcp,
            parts,
            joints: Vec::new(),
            flange_link: String::new(),
            notes: Vec::new(),
            flange_motion: flange,
        })
    }

    /// Each part with its pose in the TCP frame when the pads are `width` metres apart; a width
    /// outside [`Gripper::opening`] counts as the nearest inside. The TCP stays between the pads:
    /// where a linkage carries the pads along z as it closes, palm and flange move instead.
    pub fn parts_at(&self, width: f64) -> Vec<PosedPart<'_>> {
        let width = self.reachable(width);
        self.parts
            .iter()
            .map(|part| PosedPart { tcp_from_part: part.motion.at(width), part })
            .collect()
    }

    /// Names and positions (metres or radians) of the joints when the pads are `width` metres apart;
    /// empty where they are not known.
    pub fn joints_at(&self, width: f64) -> Vec<JointPosition<'_>> {
        let width = self.reachable(width);
        self.joints
            .iter()
            .map(|joint| JointPosition { name: &joint.name, position: joint.at(width) })
            .collect()
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

fn out_of_range(what: &'static str, expected: &str, found: String) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found }
}

#[cfg(test)]
mod tests {
    use parry3d_f64::bounding_volume::Aabb;
    use parry3d_f64::math::Vector;
    use parry3d_f64::query::{PointQuery, distance, intersection_test};
    use parry3d_f64::shape::{Cuboid, SharedShape};
    use proptest::prelude::*;

    use super::*;

    fn grippers() -> impl Iterator<Item = Gripper> {
        BUILTIN_GRIPPERS.iter().map(|row| row.gripper().unwrap())
    }

    fn pads(gripper: &Gripper, width: f64, role: Role) -> Vec<PosedPart<'_>> {
        let mut parts = gripper.parts_at(width);
        parts.retain(|posed| posed.part.role == role && posed.part.link == "pad");
        parts
    }

    fn pad_distance(gripper: &Gripper, width: f64) -> f64 {
        let mut least = f64::INFINITY;
        for left in pads(gripper, width, Role::Left) {
            for right in pads(gripper, width, Role::Right) {
                let (a, b) = (&*left.part.shape, &*right.part.shape);
                let found = distance(&left.tcp_from_part, a, &right.tcp_from_part, b).unwrap();
                least = least.min(found.distance);
            }
        }
        least
    }

    fn bounds_of(gripper: &Gripper, width: f64, role: Role) -> Vec<Aabb> {
        let parts = gripper.parts_at(width).into_iter().filter(|posed| posed.part.role == role);
        parts.map(|posed| posed.part.shape.compute_aabb(&posed.tcp_from_part)).collect()
    }

    #[test]
    fn closed_pads_touch_at_the_origin() {
        for gripper in grippers() {
            let touch = 1e-6; // interpolation between the table's widths
            assert!(pad_distance(&gripper, 0.0) < touch, "{}", gripper.name);
            for role in [Role::Left, Role::Right] {
                for pad in pads(&gripper, 0.0, role) {
                    let bounds = pad.part.shape.compute_aabb(&pad.tcp_from_part);
                    let off = bounds.distance_to_local_point(Vector::ZERO, true);
                    assert!(off < touch, "{}", gripper.name);
                }
            }
        }
    }

    #[test]
    fn left_is_the_mirror_of_right() {
        for gripper in grippers() {
            for width in [0.0, 0.03, *gripper.opening.end()] {
                let lefts = bounds_of(&gripper, width, Role::Left);
                let rights = bounds_of(&gripper, width, Role::Right);
                assert_eq!(lefts.len(), rights.len(), "{}", gripper.name);
                for (left, right) in lefts.iter().zip(&rights) {
                    let mirrored = [
                        (left.mins.x - right.mins.x).abs(),
                        (left.mins.z - right.mins.z).abs(),
                        (left.mins.y + right.maxs.y).abs(),
                        (left.maxs.y + right.mins.y).abs(),
                    ];
                    let name = &gripper.name;
                    assert!(mirrored.iter().all(|&off| off < 1e-12), "{name}: {mirrored:?}");
                }
            }
        }
    }

    proptest! {
        #[test]
        fn fingers_are_as_far_apart_as_the_width_says(
            share in 0.0..1.0f64,
            row in 0..BUILTIN_GRIPPERS.len(),
        ) {
            let gripper = BUILTIN_GRIPPERS[row].gripper().unwrap();
            let width = share * gripper.opening.end();
            prop_assert!((pad_distance(&gripper, width) - width).abs() < 2e-6);
        }

        #[test]
        fn nothing_stands_between_the_pads(
            share in 0.01..1.0f64,
            row in 0..BUILTIN_GRIPPERS.len(),
        ) {
            let gripper = BUILTIN_GRIPPERS[row].gripper().unwrap();
            let width = share * gripper.opening.end();
            let [x, z] = gripper.pad;
            let gap = Cuboid::new(Vector::new(x / 2.0, width / 2.0 - 1e-5, z / 2.0));
            for PosedPart { tcp_from_part, part } in gripper.parts_at(width) {
                let hit =
                    intersection_test(&tcp_from_part, &*part.shape, &Pose::IDENTITY, &gap).unwrap();
                prop_assert!(!hit.intersecting, "{}: {} at {width}", gripper.name, part.link);
            }
        }
    }

    fn poses(gripper: &Gripper, width: f64) -> Vec<Pose> {
        gripper.parts_at(width).iter().map(|posed| posed.tcp_from_part).collect()
    }

    #[test]
    fn a_width_out_of_reach_counts_as_the_nearest() {
        let gripper = Gripper::builtin("franka").unwrap();
        let (closed, open) = (*gripper.opening.start(), *gripper.opening.end());
        assert_eq!(poses(&gripper, 9.0), poses(&gripper, open));
        assert_eq!(poses(&gripper, -1.0), poses(&gripper, closed));
        assert_eq!(poses(&gripper, f64::NAN), poses(&gripper, open));
    }

    #[test]
    fn nonsense_is_no_gripper() {
        let part = GripperPart::new("p", Role::Palm, SharedShape::ball(0.1), Pose::IDENTITY);
        let away = Pose::from_translation(Vector::new(0.0, 1e6, 0.0));
        let far = GripperPart::new("f", Role::Left, SharedShape::ball(0.1), away);
        let huge = GripperPart::new("h", Role::Left, SharedShape::ball(1e9), Pose::IDENTITY);
        for (opening, pad, parts, sound) in [
            (0.0..=0.1, [0.01, 0.01], vec![part.clone()], true),
            (0.1..=0.1, [0.01, 0.01], vec![part.clone()], false),
            (0.0..=f64::NAN, [0.01, 0.01], vec![part.clone()], false),
            (0.0..=1e12, [0.01, 0.01], vec![part.clone()], false),
            (0.0..=0.1, [0.01, 0.01], vec![far], false),
            (0.0..=0.1, [0.01, 0.01], vec![huge], false),
            (0.0..=0.1, [0.0, 0.01], vec![part], false),
            (0.0..=0.1, [0.01, 0.01], vec![], false),
        ] {
            let made = Gripper::new("x", opening, pad, Pose::IDENTITY.into(), parts);
            assert_eq!(made.is_ok(), sound);
        }
    }
}
