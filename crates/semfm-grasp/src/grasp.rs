//! A hand pose with its reasons.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

/// One parallel-jaw grasp of an object.
#[derive(Clone, Debug)]
pub struct Grasp {
    /// The gripper's TCP frame in the object's frame, metres.
    pub object_from_tcp: Pose,
    /// Distance between the pads when they touch, metres.
    pub width: f64,
    /// One contact point for each pad (the one at -y first), in the object's frame, metres.
    pub contacts: [DVec3; 2],
    /// The weighted sum of the named terms, in [0, 1].
    pub score: f64,
    /// Name and value of each term of the score.
    pub terms: Vec<(&'static str, f64)>,
}
