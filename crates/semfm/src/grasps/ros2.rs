//! Grasps as a ROS 2 bag in MCAP: one `geometry_msgs/msg/PoseArray`.

use std::path::Path;

use semfm_views::mcap::write_pose_array;

use super::{FORMAT, GraspAnswer, grasps_json, position_and_rotation};
use crate::Result;

/// Writes the hand's poses (TCP), best first, in the frame `camera`, or `object` where no camera is
/// known. Widths, scores and the gripper are in the metadata, as in `grasps.json`.
///
/// # Errors
/// [`semfm_views::Error::Io`] where the file cannot be written.
pub fn write_ros2(path: &Path, answer: &GraspAnswer<'_>) -> Result<()> {
    let framed = answer.found.grasps.iter().map(|grasp| answer.framed(grasp.object_from_tcp).1);
    let poses: Vec<_> = framed.map(position_and_rotation).collect();
    let frame = if answer.camera_from_object.is_some() { "camera" } else { "object" };
    Ok(write_pose_array(path, frame, &poses, FORMAT, &grasps_json(answer))?)
}
