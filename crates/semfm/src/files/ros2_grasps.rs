//! Grasps as a ROS 2 bag in MCAP: one `geometry_msgs/msg/PoseArray`.

use std::path::Path;

use semfm_views::mcap::write_pose_array;

use super::grasps::{FORMAT, GraspsFile};
use crate::Result;
use crate::grasp_result::{GraspResult, position_and_rotation};

/// Writes the gripper's poses (TCP), best first, in the frame `camera`, or `object` where no camera
/// is known. Widths, scores and the gripper are in the metadata, as in `grasps.json`.
///
/// # Errors
/// [`semfm_views::Error::Io`] where the file cannot be written.
pub fn write_ros2_grasps(path: &Path, result: &GraspResult<'_>) -> Result<()> {
    let grasps = result.found.grasps.iter();
    let poses: Vec<_> =
        grasps.map(|grasp| position_and_rotation(result.in_frame(grasp.object_from_tcp))).collect();
    let metadata = GraspsFile::new(result).to_json();
    Ok(write_pose_array(path, result.frame().name(), &poses, FORMAT, &metadata)?)
}
