//! The rigid parts of a gripper.

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;

use super::motion::Motion;

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

/// A part at one width between the pads.
#[derive(Clone, Copy, Debug)]
pub struct PosedPart<'a> {
    /// Its pose in the TCP frame.
    pub tcp_from_part: Pose,
    /// The part.
    pub part: &'a GripperPart,
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

    /// How far it reaches from the TCP along an axis of its frame when the pads are `width` apart, metres.
    pub(super) fn reach(&self, width: f64) -> f64 {
        let bounds = self.shape.compute_aabb(&self.motion.at(width));
        let corners = [bounds.mins, bounds.maxs];
        // The largest of several numbers passes over what is none.
        if !corners.iter().all(|corner| corner.is_finite()) {
            return f64::INFINITY;
        }
        corners.map(|corner| corner.abs().max_element()).into_iter().fold(0.0, f64::max)
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
