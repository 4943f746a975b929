//! Grasps with the object, the gripper and the camera that they refer to.
//!
//! `docs/frames.md` draws the frames. In short: `object` is the mesh's own frame scaled to metres,
//! `camera` is x right, y down, z forward, and the gripper's frame (TCP) has +z along the approach
//! and y along the closing direction.

use parry3d_f64::math::Pose;
use semfm_geom::Mesh;
use semfm_geom::math::{DQuat, DVec3};
use semfm_grasp::{Grasp, Grasps};
use semfm_robot::Gripper;
use serde::{Deserialize, Serialize};

use crate::ObjectSize;

/// Grasps: of which object, by which gripper, seen from where.
#[derive(Clone, Copy, Debug)]
pub struct GraspResult<'a> {
    /// The object's mesh as read, in its own units.
    pub mesh: &'a Mesh,
    /// Metres per unit of the mesh.
    pub object_scale: f64,
    /// Where the object, scaled to metres, stands before the camera, if that is known.
    pub camera_from_object: Option<Pose>,
    /// The gripper.
    pub gripper: &'a Gripper,
    /// The grasps, best first, and what became of the other candidates.
    pub found: &'a Grasps,
}

/// The frame that poses are given in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AnswerFrame {
    /// The camera's, where the object's pose before one is known.
    Camera,
    /// The object's, in metres.
    Object,
}

impl AnswerFrame {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Object => "object",
        }
    }
}

impl GraspResult<'_> {
    /// How large the object is.
    pub fn size(&self) -> ObjectSize {
        ObjectSize::of(self.mesh, self.object_scale)
    }

    /// The shortest side of the object's box as a share of the gripper's widest opening: above 1 it fits between the
    /// pads by parts only.
    pub fn size_to_opening(&self) -> f64 {
        let shortest = self.size().sides.into_iter().fold(f64::INFINITY, f64::min);
        shortest / self.gripper.opening.end()
    }

    /// What a hand that stops at a force is told for a grasp, metres: [`Grasp::command_width`], but no less than the
    /// gripper can close to.
    pub fn command_width(&self, grasp: &Grasp) -> f64 {
        grasp.command_width().max(*self.gripper.opening.start())
    }

    /// The frame that poses are given in.
    pub fn frame(&self) -> AnswerFrame {
        match self.camera_from_object {
            Some(_) => AnswerFrame::Camera,
            None => AnswerFrame::Object,
        }
    }

    /// A pose in the object's frame as one in [`GraspResult::frame`].
    pub fn in_frame(&self, object_from_tcp: Pose) -> Pose {
        match self.camera_from_object {
            Some(camera_from_object) => camera_from_object * object_from_tcp,
            None => object_from_tcp,
        }
    }
}

/// Position and rotation with w ≥ 0, so that one pose has one set of numbers.
pub(crate) fn position_and_rotation(pose: Pose) -> (DVec3, DQuat) {
    let rotation = pose.rotation.normalize();
    (pose.translation, if rotation.w < 0.0 { -rotation } else { rotation })
}
