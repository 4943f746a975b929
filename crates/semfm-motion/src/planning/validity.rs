//! What a planner asks of a collision checker.

/// Says which joint values are free. Lists of joint values are in the order of the arm's joints; a continuous joint
/// may have any value, all that differ by a turn mean the same.
pub trait Validity: Sync {
    /// True where nothing touches at the joint values `q`.
    fn is_free(&self, q: &[f64]) -> bool;

    /// True where nothing touches along the straight line between two joint values, both ends included. The line
    /// does not take a short way round: whoever asks has unrolled continuous joints ([`super::JointSpace::toward`]).
    fn motion_is_free(&self, from: &[f64], to: &[f64]) -> bool;

    /// A lower bound of the least distance between any two things that may not touch, metres; 0 where they touch.
    fn clearance(&self, q: &[f64]) -> f64;

    /// An upper bound of the way that any point of the robot goes, metres, when each joint moves by at most its
    /// `travel` (radians or metres, not negative), wherever it starts. Grows in proportion to `travel`.
    fn displacement(&self, travel: &[f64]) -> f64;

    /// What touches at `q` and how deep, for messages; `None` where nothing does or it cannot be named.
    fn first_contact(&self, q: &[f64]) -> Option<Contact>;
}

/// Two things that touch.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// A link, an obstacle or the object.
    pub a: String,
    /// The other one.
    pub b: String,
    /// How far one is inside of the other, metres.
    pub depth: f64,
}
