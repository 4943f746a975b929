//! Grasps as a ROS 2 bag in MCAP: one `geometry_msgs/msg/PoseArray`, and the widths and scores as
//! `std_msgs/msg/Float64MultiArray`.

use std::path::Path;

use semfm_grasp::Grasp;
use semfm_views::mcap::{PoseNumbers, write_pose_array};

use super::grasps::{FORMAT, GraspsFile};
use crate::Result;
use crate::grasp_result::{GraspResult, position_and_rotation};

/// What a number of a message is.
struct Column {
    topic: &'static str,
    label: &'static str,
    of: fn(&GraspResult<'_>, &Grasp) -> f64,
}

/// Numbers that stand beside the poses, in the same order.
static COLUMNS: [Column; 5] = [
    Column {
        topic: "/grasps/widths",
        label: "distance of the closed pads (m)",
        of: |_, g| g.width,
    },
    Column {
        topic: "/grasps/openings",
        label: "distance of the pads on the way in (m)",
        of: |_, g| g.opening,
    },
    Column {
        topic: "/grasps/contact_widths",
        label: "distance of the contacts (m)",
        of: |_, g| g.contact_width(),
    },
    Column {
        topic: "/grasps/command_widths",
        label: "width to command with limited force, below contact (m)",
        of: |result, g| result.command_width(g),
    },
    Column { topic: "/grasps/scores", label: "score (0 to 1)", of: |_, g| g.score },
];

/// Writes the gripper's poses (TCP), best first, in the frame `camera`, or `object` where no camera
/// is known, with widths, openings and scores on topics of their own. The rest is in the metadata, as in
/// `grasps.json`.
///
/// # Errors
/// [`semfm_views::Error::Io`] where the file cannot be written.
pub fn write_ros2_grasps(path: &Path, result: &GraspResult<'_>) -> Result<()> {
    let grasps = &result.found.grasps;
    let poses: Vec<_> = grasps
        .iter()
        .map(|grasp| position_and_rotation(result.in_frame(grasp.object_from_tcp)))
        .collect();
    let columns: Vec<Vec<f64>> = COLUMNS
        .iter()
        .map(|column| grasps.iter().map(|grasp| (column.of)(result, grasp)).collect())
        .collect();
    let numbers: Vec<PoseNumbers<'_>> = COLUMNS
        .iter()
        .zip(&columns)
        .map(|(Column { topic, label, .. }, numbers)| PoseNumbers { topic, label, numbers })
        .collect();
    let metadata = GraspsFile::new(result).to_json();
    let frame = result.frame().name();
    Ok(write_pose_array(path, frame, &poses, &numbers, FORMAT, &metadata)?)
}
