//! Grasps as files: what a robot takes from here.
//!
//! `docs/frames.md` draws the frames. In short: `object` is the mesh's own frame scaled to metres,
//! `camera` is x right, y down, z forward, and the hand's frame (TCP) has +z along the approach and
//! y along the closing direction.

mod isaac;
mod json;
#[cfg(feature = "mcap")]
mod ros2;

use parry3d_f64::math::Pose;
use semfm_geom::Mesh;
use semfm_geom::math::{DQuat, DVec3};
use semfm_grasp::Grasps;
use semfm_robot::Gripper;

pub use isaac::write_isaac;
pub use json::{FORMAT, grasps_json, write_grasps};
#[cfg(feature = "mcap")]
pub use ros2::write_ros2;

/// Grasps with all that gives them meaning: of which object, by which hand, seen from where.
#[derive(Clone, Copy, Debug)]
pub struct GraspAnswer<'a> {
    /// The object's mesh as read, in its own units.
    pub mesh: &'a Mesh,
    /// Metres per unit of the mesh.
    pub object_scale: f64,
    /// Where the object, scaled to metres, stands before the camera, if that is known.
    pub camera_from_object: Option<Pose>,
    /// The hand.
    pub gripper: &'a Gripper,
    /// The grasps, best first, and what became of the other candidates.
    pub found: &'a Grasps,
}

impl GraspAnswer<'_> {
    /// The hand's pose in the camera's frame, or in the object's where no camera is known; with the
    /// frame's name.
    fn framed(&self, object_from_tcp: Pose) -> (&'static str, Pose) {
        match self.camera_from_object {
            Some(camera_from_object) => ("camera", camera_from_object * object_from_tcp),
            None => ("object", object_from_tcp),
        }
    }
}

/// Position and rotation with w ≥ 0, so that one pose has one set of numbers.
fn position_and_rotation(pose: Pose) -> (DVec3, DQuat) {
    let rotation = pose.rotation.normalize();
    (pose.translation, if rotation.w < 0.0 { -rotation } else { rotation })
}
