//! Grasps as an `isaac_grasp` file (format 1.0), the YAML that NVIDIA's Isaac Sim and Isaac ROS
//! read: <https://nvidia-isaac-ros.github.io/concepts/manipulation/isaac_grasp.html>.
//!
//! Poses are those of the gripper's flange in the object's frame, quaternions with w first. `gripper_frame` is the
//! link whose frame the flange is, and joints are named as in the URDF: for the built-in grippers, in the published
//! ones. `cspace_position` is where the joints would be if nothing stopped them: below contact, so that the pads press.

use std::fmt::Write;
use std::path::Path;

use semfm_geom::io::{refuse_input, write_atomically};
use semfm_robot::{Gripper, JointPosition};

use crate::Result;
use crate::grasp_result::{GraspResult, position_and_rotation};

/// Writes the grasps, whole or not at all.
///
/// # Errors
/// [`semfm_geom::Error::Io`] where the file cannot be written.
pub fn write_isaac_grasps(path: &Path, result: &GraspResult<'_>) -> Result<()> {
    let text = isaac_yaml(result);
    refuse_input(path)?;
    Ok(write_atomically(path, |out| out.write_all(text.as_bytes()))?)
}

fn isaac_yaml(result: &GraspResult<'_>) -> String {
    let mut text = String::new();
    // Writing into a String does not fail.
    let _ = writeln!(
        text,
        "format: isaac_grasp\nformat_version: 1.0\n\nobject_frame: object\ngripper_frame: {}\n",
        quoted(gripper_frame(result.gripper))
    );
    let none = if result.found.grasps.is_empty() { " {}" } else { "" };
    let _ = writeln!(text, "grasps:{none}");
    for (i, grasp) in result.found.grasps.iter().enumerate() {
        let (p, q) = position_and_rotation(
            grasp.object_from_tcp * result.gripper.flange_from_tcp_at(grasp.width).inverse(),
        );
        let _ = writeln!(text, "  \"grasp_{i}\":\n    confidence: {}", number(grasp.score));
        let _ = writeln!(text, "    position: {}", list(p.to_array()));
        let xyz = list([q.x, q.y, q.z]);
        let _ = writeln!(text, "    orientation: {{w: {}, xyz: {xyz}}}", number(q.w));
        for (name, width) in [
            ("cspace_position", result.command_width(grasp)),
            ("pregrasp_cspace_position", grasp.opening),
        ] {
            let joints = result.gripper.joints_at(width);
            let _ = writeln!(text, "    {name}:{}", if joints.is_empty() { " {}" } else { "" });
            for JointPosition { name: joint, position } in joints {
                let _ = writeln!(text, "      {}: {}", quoted(joint), number(position));
            }
        }
    }
    text
}

/// The link whose frame poses are of.
fn gripper_frame(gripper: &Gripper) -> &str {
    if gripper.flange_link.is_empty() { &gripper.name } else { &gripper.flange_link }
}

/// A number to the nanometre, with a point and without an exponent: YAML readers disagree on which
/// exponents make a number.
fn number(value: f64) -> String {
    format!("{value:.9}")
}

fn list(values: [f64; 3]) -> String {
    format!("[{}]", values.map(number).join(", "))
}

/// A YAML string in double quotes, which are JSON's.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
