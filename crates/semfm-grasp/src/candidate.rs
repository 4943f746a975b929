//! A gripper pose worth examining.

use parry3d_f64::math::{Pose, Rotation};
use semfm_geom::math::{DMat3, DVec3};

use crate::grasp::Grasp;

/// Where the gripper might go, before anybody has checked it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// object_from_tcp; the place along y is found when the pads close.
    pub(crate) tcp: Pose,
    /// An interval along the TCP's y axis that the grasp is to hold, metres.
    pub(crate) seed: [f64; 2],
}

impl Candidate {
    /// The pose of a grasp, to be examined once more or moved.
    pub(crate) fn from_grasp(grasp: &Grasp) -> Self {
        Self { tcp: grasp.object_from_tcp, seed: [-grasp.width / 2.0, grasp.width / 2.0] }
    }
}

/// The rotation whose y and z axes are `closing` and `approach` (unit, orthogonal).
pub(crate) fn rotation(closing: DVec3, approach: DVec3) -> Rotation {
    Rotation::from_mat3(&DMat3::from_cols(closing.cross(approach), closing, approach))
}
