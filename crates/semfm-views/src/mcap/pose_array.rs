//! Poses for ROS 2: `geometry_msgs/msg/PoseArray` in CDR, as `ros2 bag play` and every ROS viewer
//! read it, and beside it one `std_msgs/msg/Float64MultiArray` for each number that belongs to a pose:
//! messages that every installation has, so that no package need be built to read them.

use std::collections::BTreeMap;
use std::path::Path;

use super::cdr::Cdr;
use super::metadata::METADATA_NAME;
use super::ros2_messages::Ros2Message;
use super::writer::{ChunkCompression, write_mcap};
use crate::Result;
use semfm_geom::io::refuse_input;
use semfm_geom::math::{DQuat, DVec3};

/// Topic of the poses.
pub const POSES_TOPIC: &str = "/grasps/poses";

/// A number for each pose.
#[derive(Clone, Copy, Debug)]
pub struct PoseNumbers<'a> {
    /// Topic of the message.
    pub topic: &'a str,
    /// What they are, with their unit: label of the message's only dimension.
    pub label: &'a str,
    /// One for each pose, in the same order.
    pub numbers: &'a [f64],
}

/// Writes one `PoseArray` on [`POSES_TOPIC`] and an array for each of `numbers`, whole or not at all.
/// `poses` are positions in metres and rotations in the frame `frame_id`; `metadata` goes into the record
/// `semfm`, key `json`, beside its `format`.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) where the file cannot be written.
pub fn write_pose_array(
    path: &Path,
    frame_id: &str,
    poses: &[(DVec3, DQuat)],
    numbers: &[PoseNumbers<'_>],
    format: &str,
    metadata: &serde_json::Value,
) -> Result<()> {
    refuse_input(path)?;
    write_mcap(path, "ros2", ChunkCompression::Lz4, |file| {
        let entries = [("format", format.to_owned()), ("json", metadata.to_string())];
        file.metadata(METADATA_NAME, BTreeMap::from(entries.map(|(k, v)| (k.to_owned(), v))))?;
        let schema = Ros2Message::PoseArray.schema();
        file.log_encoded(POSES_TOPIC, &schema, "cdr", &pose_array(frame_id, poses))?;
        let schema = Ros2Message::Float64MultiArray.schema();
        for PoseNumbers { topic, label, numbers } in numbers {
            file.log_encoded(topic, &schema, "cdr", &number_array(label, numbers))?;
        }
        Ok(())
    })
}

/// The message's bytes, at time 0.
fn pose_array(frame_id: &str, poses: &[(DVec3, DQuat)]) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.header(0, frame_id);
    cdr.length(poses.len());
    for (position, rotation) in poses {
        cdr.pose(*position, *rotation);
    }
    cdr.into_bytes()
}

/// The message's bytes: one dimension, then the numbers.
fn number_array(label: &str, numbers: &[f64]) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.length(1);
    cdr.string(label);
    cdr.length(numbers.len());
    cdr.length(numbers.len()); // stride
    cdr.u32(0); // data_offset
    cdr.length(numbers.len());
    numbers.iter().for_each(|&x| cdr.f64(x));
    cdr.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_on_multiples_of_their_size() {
        let bytes = pose_array("cam", &[(DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY)]);
        // Header 4, stamp 8, length 4 + "cam\0" 4, count 4, padding 4, seven numbers.
        assert_eq!(bytes.len(), 4 + 8 + 8 + 4 + 4 + 56);
        assert_eq!(bytes[12..20], [4, 0, 0, 0, b'c', b'a', b'm', 0]);
        let numbers: Vec<f64> = bytes[28..]
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!(numbers, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn an_array_has_one_dimension_and_its_numbers_behind_it() {
        let bytes = number_array("w", &[0.5, 0.25]);
        // Header 4, count of dimensions 4, length 4 + "w\0" 2, padding 2, size, stride, offset, count, 2
        // numbers on multiples of eight from byte 32 of the body on.
        assert_eq!(bytes[4..14], [1, 0, 0, 0, 2, 0, 0, 0, b'w', 0]);
        assert_eq!(bytes[16..32], [2, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
        let numbers: Vec<f64> = bytes[bytes.len() - 16..]
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect();
        assert_eq!((numbers, (bytes.len() - 4) % 8), (vec![0.5, 0.25], 0));
    }

    #[test]
    fn our_own_strict_reader_takes_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grasps.mcap");
        let about = serde_json::json!({ "widths": [0.04] });
        let poses = [(DVec3::X, DQuat::from_rotation_z(1.0))];
        let widths = PoseNumbers { topic: "/grasps/widths", label: "width (m)", numbers: &[0.04] };
        write_pose_array(&path, "camera", &poses, &[widths], "semfm.grasps/1", &about).unwrap();
        let report = crate::mcap::inspect(&path).unwrap();
        assert_eq!(report.n_messages, 2);
    }
}
