//! Writing a bag: what [`read_bag`](super::read_bag) reads, and every ROS 2 installation.

use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::path::Path;

use semfm_geom::io::refuse_input;
use semfm_geom::math::DQuat;
use semfm_views::mcap::{Cdr, ChannelId, ChunkCompression, McapWriter, Ros2Message, write_mcap};

use crate::observation::Observation;
use crate::{Error, Result};

const COLOR: &str = "/camera/color/image_rect";
const COLOR_INFO: &str = "/camera/color/camera_info";
const DEPTH: &str = "/camera/depth/image_rect";
const DEPTH_INFO: &str = "/camera/depth/camera_info";
const TF: &str = "/tf";

/// The camera's frame, and the one that it stands in.
const CAMERA_FRAME: &str = "camera";
const WORLD_FRAME: &str = "world";

/// Time of the first observation that has none, and between two of them: 30 Hz. Time 0 means "no time" to ROS.
const START_NANOS: u64 = 1_000_000_000;
const STEP_NANOS: u64 = 33_333_333;

/// Writes observations as a ROS 2 bag, whole or not at all: colour as `rgb8`, depth as `32FC1` (NaN where nothing came
/// back), the camera beside each, and where it stands as the transform of `camera` in `world`. Masks, objects and clouds
/// are not written.
///
/// # Errors
/// [`Error::Invalid`] for no observation, one without colour and depth, and times that do not ascend;
/// [`Error::Views`] where the file cannot be written.
pub fn write_bag<O: Borrow<Observation>>(path: &Path, observations: &[O]) -> Result<()> {
    let observations: Vec<&Observation> = observations.iter().map(Borrow::borrow).collect();
    if observations.is_empty() {
        return Err(Error::invalid("observations", "at least one", "none"));
    }
    let times: Vec<u64> = observations
        .iter()
        .enumerate()
        .map(|(i, seen)| seen.time_nanos.unwrap_or(START_NANOS + i as u64 * STEP_NANOS))
        .collect();
    if let Some(at) = times.windows(2).position(|pair| pair[0] >= pair[1]) {
        let what = format!("time of observation {}", at + 1);
        return Err(Error::invalid(what, format!("more than {} ns", times[at]), times[at + 1]));
    }
    let is_empty = |seen: &&Observation| seen.color().is_none() && seen.depth().is_none();
    if let Some(at) = observations.iter().position(is_empty) {
        return Err(Error::invalid(format!("observation {at}"), "colour or depth", "neither"));
    }
    refuse_input(path)?;
    Ok(write_mcap(path, "ros2", ChunkCompression::Lz4, |file| {
        let mut channels = Channels::default();
        for (seen, &time) in observations.iter().zip(&times) {
            if let Some(color) = seen.color() {
                let data = color.as_flattened();
                channels.log(
                    file,
                    COLOR_INFO,
                    Ros2Message::CameraInfo,
                    time,
                    camera_info(seen, time),
                )?;
                let message = image(seen, time, "rgb8", 3, data);
                channels.log(file, COLOR, Ros2Message::Image, time, message)?;
            }
            if let Some(depth) = seen.depth() {
                let metres = |&z: &f32| if z > 0.0 { z } else { f32::NAN }.to_le_bytes();
                let data: Vec<u8> = depth.metres().iter().flat_map(metres).collect();
                channels.log(
                    file,
                    DEPTH_INFO,
                    Ros2Message::CameraInfo,
                    time,
                    camera_info(seen, time),
                )?;
                let message = image(seen, time, "32FC1", 4, &data);
                channels.log(file, DEPTH, Ros2Message::Image, time, message)?;
            }
            channels.log(file, TF, Ros2Message::TfMessage, time, transform(seen, time))?;
        }
        Ok(())
    })?)
}

/// Topics, each declared with its first message.
#[derive(Default)]
struct Channels(BTreeMap<&'static str, ChannelId>);

impl Channels {
    fn log(
        &mut self,
        file: &mut McapWriter<'_>,
        topic: &'static str,
        kind: Ros2Message,
        time: u64,
        message: Vec<u8>,
    ) -> semfm_views::Result<()> {
        let channel = match self.0.get(topic) {
            Some(channel) => *channel,
            None => {
                let channel = file.declare(topic, &kind.schema(), "cdr", &BTreeMap::new())?;
                self.0.insert(topic, channel);
                channel
            }
        };
        file.log_to(channel, time, &message)
    }
}

/// `sensor_msgs/Image`.
fn image(seen: &Observation, time: u64, encoding: &str, bytes: u32, data: &[u8]) -> Vec<u8> {
    let (width, height) = (seen.camera().width(), seen.camera().height());
    let mut cdr = Cdr::new();
    cdr.header(time, CAMERA_FRAME);
    cdr.u32(height);
    cdr.u32(width);
    cdr.string(encoding);
    cdr.u8(0); // little-endian
    cdr.u32(width * bytes);
    cdr.byte_sequence(data);
    cdr.into_bytes()
}

/// `sensor_msgs/CameraInfo`, without distortion; pixel centres at whole coordinates.
fn camera_info(seen: &Observation, time: u64) -> Vec<u8> {
    let camera = seen.camera();
    let (fx, fy, cx, cy) = (camera.fx(), camera.fy(), camera.cx() - 0.5, camera.cy() - 0.5);
    let k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let turn = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    let mut cdr = Cdr::new();
    cdr.header(time, CAMERA_FRAME);
    cdr.u32(camera.height());
    cdr.u32(camera.width());
    cdr.string("plumb_bob");
    cdr.f64s([0.0; 5].into_iter());
    k.iter().chain(&turn).chain(&p).for_each(|&x| cdr.f64(x));
    for _ in 0..6 {
        cdr.u32(0); // binning and region of interest: none
    }
    cdr.u8(0);
    cdr.into_bytes()
}

/// `tf2_msgs/TFMessage`: how the camera stands in the world.
fn transform(seen: &Observation, time: u64) -> Vec<u8> {
    let world_from_camera = seen.camera().camera_from_world().inverse();
    let mut cdr = Cdr::new();
    cdr.length(1);
    cdr.header(time, WORLD_FRAME);
    cdr.string(CAMERA_FRAME);
    cdr.pose(world_from_camera.translation, DQuat::from_mat3(&world_from_camera.matrix3));
    cdr.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag::{BagSettings, read_bag};
    use crate::source::{SourceSettings, read_observations};
    use semfm_align::DepthImage;
    use semfm_geom::math::{DAffine3, DMat3, DVec3};
    use semfm_geom::{Intrinsics, Pinhole};

    fn seen(i: u8) -> Observation {
        let intrinsics = Intrinsics { width: 3, height: 2, fx: 20.0, fy: 21.0, cx: 1.5, cy: 1.25 };
        let turn = DMat3::from_rotation_y(0.1 * f64::from(i));
        let pose = DAffine3::from_mat3_translation(turn, DVec3::new(0.1, 0.0, 0.5));
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, pose).unwrap();
        let depth =
            DepthImage::new(3, 2, vec![0.5, 0.0, 0.1234, 1.0, 2.0, 6.0 + f32::from(i)]).unwrap();
        let mut seen = Observation::new(camera)
            .with_color((0..6).map(|p| [p, i, 255 - p]).collect())
            .and_then(|s| s.with_depth(depth))
            .unwrap();
        seen.time_nanos = Some(5_000_000_000 + 40_000_000 * u64::from(i));
        seen
    }

    fn read(path: &Path, settings: &BagSettings) -> Result<Vec<Observation>> {
        let mut all = Vec::new();
        let report = read_bag(path, settings, |seen| {
            all.push(seen);
            Ok(())
        })?;
        assert_eq!(report.n_observations, all.len());
        Ok(all)
    }

    fn in_world() -> BagSettings {
        BagSettings { fixed_frame: Some("world".into()), ..Default::default() }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.mcap");
        let written: Vec<Observation> = (0..5).map(seen).collect();
        write_bag(&path, &written).unwrap();
        let again = read(&path, &in_world()).unwrap();
        assert_eq!(again.len(), 5);
        for (found, given) in again.iter().zip(&written) {
            assert_eq!((found.color(), found.depth()), (given.color(), given.depth()));
            assert_eq!(found.time_nanos, given.time_nanos);
            let (a, b) = (found.camera().camera_from_world(), given.camera().camera_from_world());
            assert!(a.abs_diff_eq(b, 1e-12) && found.camera().cx() == 1.5);
        }
        // The same in a folder, and without a pose.
        let own = read(folder.path(), &BagSettings::default()).unwrap();
        assert_eq!(own[3].camera().camera_from_world(), DAffine3::IDENTITY);
    }

    #[test]
    fn what_is_missing_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.mcap");
        write_bag(&path, &[seen(0), seen(1)]).unwrap();
        let words = |settings: BagSettings| read(&path, &settings).unwrap_err().to_string();
        let fixed =
            |name: &str| BagSettings { fixed_frame: Some(name.into()), ..Default::default() };
        assert!(words(fixed("map")).contains("camera → world"));
        let other = BagSettings { depth: Some("/depth".into()), ..Default::default() };
        assert!(words(other).contains("/camera/depth/image_rect"));
        let info = BagSettings { camera_info: Some("/info".into()), ..Default::default() };
        assert!(words(info).contains("/camera/color/camera_info"));
        // A bag cut short.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 40]).unwrap();
        assert!(words(BagSettings::default()).contains("seen.mcap"));
        assert!(
            write_bag::<Observation>(&path, &[]).is_err()
                && write_bag(&path, &[seen(1), seen(0)]).is_err()
        );
    }

    #[test]
    fn pictures_that_nobody_wants_are_not_decoded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("seen.mcap");
        // Every second picture has an encoding that is not read.
        write_mcap(&path, "ros2", ChunkCompression::Lz4, |file| {
            let mut channels = Channels::default();
            for i in 0..4 {
                let (seen, encoding) = (seen(i), if i % 2 == 0 { "rgb8" } else { "bayer_rggb8" });
                let time = seen.time_nanos.unwrap();
                let info = camera_info(&seen, time);
                channels.log(file, COLOR_INFO, Ros2Message::CameraInfo, time, info)?;
                let message = image(&seen, time, encoding, 3, seen.color().unwrap().as_flattened());
                channels.log(file, COLOR, Ros2Message::Image, time, message)?;
            }
            Ok(())
        })
        .unwrap();
        let read = |every: usize, most: Option<usize>| {
            let settings = SourceSettings { every, most, ..Default::default() };
            let mut times = Vec::new();
            let report = read_observations(&path, &settings, |seen| {
                times.push((seen.time_nanos.unwrap() - 5_000_000_000) / 40_000_000);
                Ok(())
            })?;
            assert_eq!(report.n_observations, times.len());
            Ok(times)
        };
        let times = |every: usize, most: Option<usize>| read(every, most).unwrap();
        assert_eq!(times(2, None), [0, 2]);
        assert_eq!(times(1, Some(1)), [0]);
        assert_eq!(times(1, Some(0)), [0; 0]);
        assert_eq!(times(2, Some(1)), [0]);
        let all: Result<Vec<u64>> = read(1, None);
        assert!(all.unwrap_err().to_string().contains("bayer_rggb8"));
    }

    #[test]
    fn a_cloud_comes_into_the_cameras_frame() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lidar.mcap");
        let cloud = crate::bag::point_cloud::tests::message(5, "lidar", &[[1.0, 0.0, 0.0]], 16);
        let mut tf = Cdr::new();
        tf.length(1);
        tf.header(0, CAMERA_FRAME);
        tf.string("lidar");
        tf.pose(DVec3::new(0.0, 0.0, 2.0), DQuat::IDENTITY);
        let cloud_schema = semfm_views::mcap::Schema {
            name: "sensor_msgs/msg/PointCloud2".into(),
            encoding: "ros2msg".into(),
            data: Vec::new(),
        };
        let write = |with_tf: bool| {
            write_mcap(&path, "ros2", ChunkCompression::None, |file| {
                if with_tf {
                    let schema = Ros2Message::TfMessage.schema();
                    file.log_encoded("/tf_static", &schema, "cdr", &tf.clone().into_bytes())?;
                }
                let info = Ros2Message::CameraInfo.schema();
                file.log_encoded("/camera_info", &info, "cdr", &camera_info(&seen(0), 5))?;
                file.log_encoded("/points", &cloud_schema, "cdr", &cloud)
            })
        };
        write(true).unwrap();
        let settings =
            BagSettings { camera_info: Some("/camera_info".into()), ..Default::default() };
        let read_one = || read(&path, &settings);
        assert_eq!(read_one().unwrap()[0].cloud().unwrap(), [DVec3::new(1.0, 0.0, 2.0)]);
        write(false).unwrap();
        let error = read_one().unwrap_err().to_string();
        assert!(error.contains("`lidar`") && error.contains("/points"), "{error}");
    }
}
