//! An object's track as a ROS 2 bag: its pose with covariance, its frame on `/tf`, the records as JSON, and the region as
//! triangles in the object's frame.

use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::refuse_input;
use semfm_geom::math::{DQuat, DVec3};
use semfm_geom::{Mesh, MeshIdentity};
use semfm_track::TrackRecord;
use semfm_views::mcap::{
    Cdr, ChannelId, ChunkCompression, METADATA_NAME, McapWriter, Ros2Message, write_mcap,
};

use super::track::{FORMAT, TrackLine};
use crate::Result;

/// `geometry_msgs/PoseWithCovarianceStamped`, in frames with a pose.
pub const TRACK_POSE_TOPIC: &str = "/track/pose";

/// `std_msgs/String`: the line of `semfm.track/1` of each frame.
pub const TRACK_STATE_TOPIC: &str = "/track/state";

/// `visualization_msgs/MarkerArray`: the region, as often as its confidence is told.
pub const TRACK_REGION_TOPIC: &str = "/track/region";

/// Frame of the object: rigid, in metres, axes and origin of the mesh.
pub const TRACK_OBJECT_FRAME: &str = "object";

/// Time of a frame that has none, and between two: 30 Hz. Time 0 means "no time" to ROS.
const START_NANOS: u64 = 1_000_000_000;
const STEP_NANOS: u64 = 33_333_333;

/// Vertices with a weight from this on are of the region.
const COUNTS: f64 = 0.05;

/// `visualization_msgs/Marker`: a list of triangles.
const TRIANGLE_LIST: u32 = 11;

/// A bag being written.
pub struct Ros2Track<'a, 'w> {
    file: &'a mut McapWriter<'w>,
    camera_frame: &'a str,
    pose: ChannelId,
    tf: ChannelId,
    state: ChannelId,
    region: ChannelId,
}

/// Writes a bag through `fill`, whole or not at all. `camera_frame` is the frame of the camera's poses.
///
/// # Errors
/// [`semfm_views::Error::Io`] where the file cannot be written, or what `fill` returns.
pub fn write_ros2_track<T>(
    path: &Path,
    mesh: &Mesh,
    camera_frame: &str,
    fill: impl FnOnce(&mut Ros2Track<'_, '_>) -> Result<T>,
) -> Result<T> {
    refuse_input(path)?;
    let mut outcome = None;
    let written = write_mcap(path, "ros2", ChunkCompression::Lz4, |file| {
        let about = serde_json::json!({ "mesh": MeshIdentity::of(mesh) }).to_string();
        let entries = [("format", FORMAT.to_owned()), ("json", about)];
        file.metadata(METADATA_NAME, entries.map(|(k, v)| (k.to_owned(), v)).into())?;
        let mut declare = |topic: &str, message: Ros2Message| {
            file.declare(topic, &message.schema(), "cdr", &BTreeMap::new())
        };
        let pose = declare(TRACK_POSE_TOPIC, Ros2Message::PoseWithCovarianceStamped)?;
        let tf = declare(semfm_views::mcap::TF, Ros2Message::TfMessage)?;
        let state = declare(TRACK_STATE_TOPIC, Ros2Message::String)?;
        let region = declare(TRACK_REGION_TOPIC, Ros2Message::MarkerArray)?;
        let mut track = Ros2Track { file, camera_frame, pose, tf, state, region };
        // Whatever went wrong, the file is not put in place; the reason is kept aside.
        let result = fill(&mut track);
        let is_done = result.is_ok();
        outcome = Some(result);
        if is_done { Ok(()) } else { Err(semfm_geom::Error::Cancelled.into()) }
    });
    match (outcome, written) {
        (Some(Err(error)), _) => Err(error),
        (Some(Ok(value)), Ok(())) => Ok(value),
        (_, Err(error)) => Err(error.into()),
        (None, Ok(())) => unreachable!("a file without its content is never put in place"),
    }
}

impl Ros2Track<'_, '_> {
    /// Writes a frame.
    ///
    /// # Errors
    /// [`semfm_views::Error::Io`].
    pub fn frame(&mut self, record: &TrackRecord) -> Result<()> {
        let time = record_time(record);
        if let (Some(pose), Some(covariance)) = (record.camera_from_object, record.covariance) {
            let mut cdr = Cdr::new();
            cdr.header(time, self.camera_frame);
            cdr.pose(pose.translation, pose.rotation);
            covariance.iter().flatten().for_each(|&x| cdr.f64(x));
            self.file.log_to(self.pose, time, &cdr.into_bytes())?;
            let mut cdr = Cdr::new();
            cdr.length(1);
            cdr.header(time, self.camera_frame);
            cdr.string(TRACK_OBJECT_FRAME);
            cdr.pose(pose.translation, pose.rotation);
            self.file.log_to(self.tf, time, &cdr.into_bytes())?;
        }
        let mut cdr = Cdr::new();
        cdr.string(&TrackLine::new(record).to_json().to_string());
        Ok(self.file.log_to(self.state, time, &cdr.into_bytes())?)
    }

    /// Writes the region's weights (one for each vertex) at the time of a record: triangles of the mesh, the surer the more
    /// opaque.
    ///
    /// # Errors
    /// [`semfm_views::Error::Io`].
    pub fn region(&mut self, record: &TrackRecord, mesh: &Mesh, weights: &[f64]) -> Result<()> {
        let Some(pose) = record.camera_from_object else { return Ok(()) };
        let time = record_time(record);
        let message = region_marker(time, mesh, pose.scale, weights);
        Ok(self.file.log_to(self.region, time, &message)?)
    }
}

fn record_time(record: &TrackRecord) -> u64 {
    record.time_nanos.unwrap_or(START_NANOS + record.frame as u64 * STEP_NANOS)
}

/// A `MarkerArray` of the triangles whose corners are of the region, in metres of the object's frame.
fn region_marker(time: u64, mesh: &Mesh, scale: f64, weights: &[f64]) -> Vec<u8> {
    let counts = |face: &&[u32; 3]| face.iter().all(|&v| weights[v as usize] >= COUNTS);
    let corners: Vec<u32> = mesh.faces().iter().filter(counts).flatten().copied().collect();
    let mut cdr = Cdr::new();
    cdr.length(1);
    cdr.header(time, TRACK_OBJECT_FRAME);
    cdr.string("region");
    for number in [0, TRIANGLE_LIST, 0] {
        cdr.u32(number); // id, type, action: add
    }
    cdr.pose(DVec3::ZERO, DQuat::IDENTITY);
    [1.0; 3].into_iter().for_each(|x| cdr.f64(x));
    color(&mut cdr, 1.0);
    cdr.time(0); // lifetime: for ever
    cdr.bool(true); // locked to its frame
    cdr.length(corners.len());
    let points = corners.iter().map(|&v| scale * mesh.vertices()[v as usize]);
    points.flat_map(|p| p.to_array()).for_each(|x| cdr.f64(x));
    cdr.length(corners.len());
    corners.iter().for_each(|&v| color(&mut cdr, weights[v as usize]));
    cdr.string(""); // texture
    cdr.header(0, "");
    cdr.string("");
    cdr.length(0);
    cdr.length(0); // coordinates in it
    cdr.string(""); // text
    cdr.string(""); // mesh
    cdr.string("");
    cdr.length(0);
    cdr.bool(false);
    cdr.into_bytes()
}

/// Orange, as regions are elsewhere, as opaque as it is sure.
fn color(cdr: &mut Cdr, weight: f64) {
    [1.0, 0.55, 0.1, weight as f32].into_iter().for_each(|channel| cdr.f32(channel));
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::Sim3;
    use semfm_geom::zoo;
    use semfm_track::{PoseEvidence, TrackState};
    use semfm_views::mcap::{CdrReader, read_messages};

    fn record(frame: usize, pose: Option<Sim3>) -> TrackRecord {
        TrackRecord {
            frame,
            time_nanos: None,
            state: if pose.is_some() { TrackState::Tracking } else { TrackState::Lost },
            camera_from_object: pose,
            probability: 0.9,
            covariance: pose
                .map(|_| std::array::from_fn(|i| std::array::from_fn(|j| (6 * i + j) as f64))),
            position_std: None,
            rotation_std: None,
            evidence: PoseEvidence::default(),
            region: None,
        }
    }

    #[test]
    fn the_strict_reader_takes_the_bag_and_finds_pose_and_covariance() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("track.mcap");
        let mesh = zoo::icosphere(1);
        let shift = DVec3::new(0.1, 0.2, 0.7);
        let pose = Sim3 { scale: 0.05, translation: shift, ..Sim3::IDENTITY };
        write_ros2_track(&path, &mesh, "camera", |track| {
            let first = record(0, Some(pose));
            track.frame(&first)?;
            track.region(&first, &mesh, &vec![1.0; mesh.n_vertices()])?;
            track.frame(&record(1, None))
        })
        .unwrap();
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        read_messages(&path, |message| {
            *counts.entry(message.channel.topic.clone()).or_default() += 1;
            if message.channel.topic == TRACK_POSE_TOPIC {
                let mut cdr = CdrReader::new(message.data).unwrap();
                assert_eq!(cdr.header().unwrap(), (START_NANOS, "camera"));
                assert_eq!(cdr.pose().unwrap().0, shift);
                let covariance: [f64; 36] = cdr.f64_array().unwrap();
                assert!((0..36).all(|i| covariance[i] == i as f64));
            }
            Ok(())
        })
        .unwrap();
        assert_eq!(counts[TRACK_POSE_TOPIC], 1);
        assert_eq!(counts[TRACK_STATE_TOPIC], 2);
        assert_eq!((counts["/tf"], counts[TRACK_REGION_TOPIC]), (1, 1));
        let failed = write_ros2_track::<()>(&folder.path().join("no.mcap"), &mesh, "c", |_| {
            Err(crate::Error::invalid("frame", "one", "none"))
        });
        assert!(failed.unwrap_err().to_string().contains("frame"));
        assert!(!folder.path().join("no.mcap").exists());
    }
}
