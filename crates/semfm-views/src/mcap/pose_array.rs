//! Poses for ROS 2: `geometry_msgs/msg/PoseArray` in CDR, as `ros2 bag play` and every ROS viewer
//! read it, and beside it one `std_msgs/msg/Float64MultiArray` for each number that belongs to a pose:
//! messages that every installation has, so that no package need be built to read them.
//!
//! CDR (OMG Common Data Representation, XCDR1, little-endian): a header of four bytes, then each
//! number on a multiple of its own size, counted from behind the header; a string as its length with
//! the closing zero, a sequence as its length and its members.

use std::collections::BTreeMap;
use std::path::Path;

use super::contents::Schema;
use super::metadata::METADATA_NAME;
use super::writer::{ChunkCompression, write_mcap};
use crate::Result;
use semfm_geom::io::refuse_input;
use semfm_geom::math::{DQuat, DVec3};

/// Topic of the poses.
pub const POSES_TOPIC: &str = "/grasps/poses";

/// The message's definition with those it is made of, in the form that MCAP prescribes for
/// `ros2msg`.
const POSE_ARRAY: &str = "std_msgs/Header header
geometry_msgs/Pose[] poses
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";

/// The definition of an array of numbers, in the same form.
const NUMBERS: &str = "std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
";

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
        let schema = schema("geometry_msgs/msg/PoseArray", POSE_ARRAY);
        file.log_encoded(POSES_TOPIC, &schema, "cdr", &pose_array(frame_id, poses))?;
        let schema = self::schema("std_msgs/msg/Float64MultiArray", NUMBERS);
        for PoseNumbers { topic, label, numbers } in numbers {
            file.log_encoded(topic, &schema, "cdr", &number_array(label, numbers))?;
        }
        Ok(())
    })
}

fn schema(name: &str, definition: &str) -> Schema {
    Schema { name: name.to_owned(), encoding: "ros2msg".to_owned(), data: definition.into() }
}

/// The message's bytes, at time 0.
fn pose_array(frame_id: &str, poses: &[(DVec3, DQuat)]) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.u32(0); // seconds
    cdr.u32(0); // nanoseconds
    cdr.string(frame_id);
    cdr.length(poses.len());
    for (position, rotation) in poses {
        position.to_array().into_iter().chain(rotation.to_array()).for_each(|x| cdr.f64(x));
    }
    cdr.bytes
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
    cdr.bytes
}

/// A CDR message being written.
struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// Bytes before the first number; alignment is counted from behind them.
    const HEADER: [u8; 4] = [0, 1, 0, 0]; // plain CDR, little-endian, no options

    fn new() -> Self {
        Self { bytes: Self::HEADER.to_vec() }
    }

    fn align(&mut self, size: usize) {
        let body = self.bytes.len() - Self::HEADER.len();
        self.bytes.resize(Self::HEADER.len() + body.next_multiple_of(size), 0);
    }

    fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    fn length(&mut self, n: usize) {
        self.u32(u32::try_from(n).unwrap_or(u32::MAX));
    }

    fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
    }

    fn string(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }
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
