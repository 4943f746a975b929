//! Reading a bag: once for times, cameras and transforms, and once more for the pictures, so that no more of them are in
//! memory than wait for their counterpart.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use semfm_align::DepthImage;
use semfm_geom::io::FormatError;
use semfm_geom::math::DAffine3;
use semfm_views::mcap::{CdrReader, Message, message_error, read_messages};

use super::compressed_depth::Fault;
use super::images::{COMPRESSED, IMAGE, color, depth};
use super::messages::{CAMERA_INFO, CameraInfo, TF_MESSAGE, transforms};
use super::point_cloud::{POINT_CLOUD, points};
use super::topics::{Asked, Chosen, Topic, choose, is_rectified};
use super::transforms::Transforms;
use crate::observation::Observation;
use crate::{Error, Result};

/// What is read of a bag. Topics that are not named are chosen where only one can be meant.
#[derive(Clone, Debug, PartialEq)]
pub struct BagSettings {
    /// Topic of colour pictures.
    pub color: Option<String>,
    /// Topic of depth images or of clouds.
    pub depth: Option<String>,
    /// Topic of the camera; else `camera_info` beside the depth, or the colour.
    pub camera_info: Option<String>,
    /// Frame that becomes the observations' world; the camera's own where none is named.
    pub fixed_frame: Option<String>,
    /// Farthest apart, in nanoseconds, that colour, depth and transforms of one observation may be.
    pub max_gap_nanos: u64,
}

impl Default for BagSettings {
    fn default() -> Self {
        Self {
            color: None,
            depth: None,
            camera_info: None,
            fixed_frame: None,
            // A little less than one period of 30 Hz: more pairs a picture with the neighbour of its own.
            max_gap_nanos: 30_000_000,
        }
    }
}

/// A gap of this many seconds or more pairs what has nothing to do with each other.
const WIDEST_GAP: f64 = 3600.0;

impl BagSettings {
    /// A setting that is not the default, in words.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let given = [
            ("topic of the colour", self.color.is_some()),
            ("topic of the depth", self.depth.is_some()),
            ("topic of the camera", self.camera_info.is_some()),
            ("fixed frame", self.fixed_frame.is_some()),
            ("max gap", self.max_gap_nanos != Self::default().max_gap_nanos),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(setting, _)| setting)
    }

    /// With a gap in seconds.
    ///
    /// # Errors
    /// [`Error::Invalid`] for what is not from 0 to an hour.
    pub fn with_max_gap(self, seconds: f64) -> Result<Self> {
        if !(0.0..WIDEST_GAP).contains(&seconds) {
            return Err(Error::invalid("max gap", "0 to 3600 seconds", seconds));
        }
        Ok(Self { max_gap_nanos: (seconds * 1e9) as u64, ..self })
    }
}

/// What was found in a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BagReport {
    /// Topic of the colour, where there was any.
    pub color: Option<String>,
    /// Topic of the depth or the clouds, where there were any.
    pub depth: Option<String>,
    /// Topic of the camera.
    pub camera_info: String,
    /// Observations handed out.
    pub n_observations: usize,
    /// Pictures, depths or clouds without a counterpart in time, left out.
    pub n_unpaired: usize,
}

/// Reads a bag (an `.mcap` file, or a folder of them) and hands each observation to `visit`, in the order of time.
/// Pictures of a lens that distorts come out without distortion.
///
/// # Errors
/// [`Error::Views`] for a damaged file, or one that was cut; [`Error::Format`] for topics that are missing or could be
/// meant twice, messages out of order, transforms that are missing, depth on another frame than its colour, and whatever
/// else a message should not be, with file, topic and message; and the errors of `visit`.
pub fn read_bag(
    path: &Path,
    settings: &BagSettings,
    visit: impl FnMut(Observation) -> Result<()>,
) -> Result<BagReport> {
    read_chosen(path, settings, Choice { every: 1, most: usize::MAX }, visit)
}

/// Which observations of a bag are made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The first, and each that is so many further on; at least 1.
    pub every: usize,
    /// At most so many.
    pub most: usize,
}

/// The same of some observations: of the others no picture is decoded, and behind the last the bag is not read on.
///
/// # Errors
/// As [`read_bag`], of the observations that are made.
pub(crate) fn read_chosen(
    path: &Path,
    settings: &BagSettings,
    Choice { every, most }: Choice,
    mut visit: impl FnMut(Observation) -> Result<()>,
) -> Result<BagReport> {
    let files = files_of(path)?;
    let survey = Survey::of(&files)?;
    let asked = Asked {
        color: settings.color.clone(),
        depth: settings.depth.clone(),
        camera_info: settings.camera_info.clone(),
    };
    let fault = |Fault { expected, found }| FormatError::new(path, "topics", expected, found);
    let chosen = choose(&survey.schemas, &asked).map_err(fault)?;
    let info = survey.camera(path, &chosen.camera_info)?;
    let pairs = Pairs::new(path, &survey, &chosen, settings.max_gap_nanos)?;
    let maker = Maker { chosen: &chosen, info, transforms: &survey.transforms, settings };
    let mut waiting = Waiting { every, parts: BTreeMap::new(), next: 0 };
    let mut n_observations = 0;
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for file in &files {
        if n_observations >= most {
            break;
        }
        each_message(file, |message| {
            let topic = &message.channel.topic;
            let index = counts.entry(topic.clone()).or_default();
            let Some(place) = pairs.place(topic, *index) else {
                *index += 1;
                return Ok(ControlFlow::Continue(()));
            };
            *index += 1;
            waiting.put(place, message.data);
            while let Some(parts) = waiting.next(&pairs) {
                let seen = maker.observation(parts, message.log_time);
                visit(seen.map_err(|fault| in_message(file, message, fault))?)?;
                n_observations += 1;
                if n_observations == most {
                    return Ok(ControlFlow::Break(()));
                }
            }
            Ok(ControlFlow::Continue(()))
        })?;
    }
    Ok(BagReport {
        color: chosen.color.map(|topic| topic.name),
        depth: chosen.depth.map(|topic| topic.name),
        camera_info: chosen.camera_info,
        n_observations,
        n_unpaired: pairs.n_unpaired,
    })
}

/// The files of a bag, in the order of their recording.
fn files_of(path: &Path) -> Result<Vec<PathBuf>> {
    let extension =
        |path: &Path| path.extension().and_then(|e| e.to_str()).unwrap_or("").to_owned();
    let sqlite = || {
        let expected = "MCAP: `ros2 bag convert` makes it of SQLite";
        FormatError::new(path, "storage", expected, "SQLite (.db3)")
    };
    if !path.is_dir() {
        return match extension(path).as_str() {
            "db3" => Err(sqlite().into()),
            _ => Ok(vec![path.to_owned()]),
        };
    }
    let entries = std::fs::read_dir(path)
        .map_err(|source| semfm_geom::Error::Io { path: path.to_owned(), source })?;
    let all: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    let mut files: Vec<PathBuf> = all.iter().filter(|p| extension(p) == "mcap").cloned().collect();
    if files.is_empty() {
        if all.iter().any(|p| extension(p) == "db3") {
            return Err(sqlite().into());
        }
        return Err(FormatError::new(path, "folder", "the .mcap files of a bag", "none").into());
    }
    // rosbag2 numbers them at the end: bag_9 stands before bag_10.
    let number = |p: &PathBuf| {
        let stem = p.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        stem[stem.len() - digits..].parse::<u64>().unwrap_or(0)
    };
    files.sort_by(|a, b| number(a).cmp(&number(b)).then_with(|| a.cmp(b)));
    Ok(files)
}

/// Reads a file whose visitor fails in our way, up to where it has enough.
fn each_message(
    file: &Path,
    mut visit: impl FnMut(&Message<'_>) -> Result<ControlFlow<()>>,
) -> Result<()> {
    let mut end = None;
    let read = read_messages(file, |message| match visit(&message) {
        Ok(ControlFlow::Continue(())) => Ok(()),
        Ok(ControlFlow::Break(())) => {
            end = Some(Ok(()));
            Err(semfm_geom::Error::Cancelled.into())
        }
        Err(error) => {
            end = Some(Err(error));
            Err(semfm_geom::Error::Cancelled.into())
        }
    });
    match end {
        Some(end) => end,
        None => Ok(read.map(drop)?),
    }
}

fn in_message(file: &Path, message: &Message<'_>, fault: Fault) -> Error {
    message_error(file, message, &fault.expected, fault.found).into()
}

/// What a first pass over a bag finds.
#[derive(Default)]
struct Survey {
    /// Name of the messages of each topic.
    schemas: BTreeMap<String, String>,
    /// Times of the pictures and clouds of each topic, and the frame of the first.
    stamps: BTreeMap<String, Vec<u64>>,
    frames: BTreeMap<String, String>,
    cameras: BTreeMap<String, CameraInfo>,
    /// Topics of cameras that did not stay as they were.
    changed: Vec<String>,
    transforms: Transforms,
}

impl Survey {
    fn of(files: &[PathBuf]) -> Result<Self> {
        let mut survey = Self::default();
        for file in files {
            each_message(file, |message| {
                let read = survey.message(message).map(ControlFlow::Continue);
                read.map_err(|fault| in_message(file, message, fault))
            })?;
        }
        Ok(survey)
    }

    fn message(&mut self, message: &Message<'_>) -> std::result::Result<(), Fault> {
        let channel = message.channel;
        let Some(schema) = channel.schema.as_ref().map(|schema| schema.name.as_str()) else {
            return Ok(());
        };
        let known = [IMAGE, COMPRESSED, POINT_CLOUD, CAMERA_INFO, TF_MESSAGE];
        let ros1 = schema.starts_with("sensor_msgs/") && channel.message_encoding == "ros1";
        if ros1 || (known.contains(&schema) && channel.message_encoding != "cdr") {
            let expected =
                "messages of ROS 2 in CDR (`rosbags-convert` makes them of a bag of ROS 1)";
            return Err(Fault::new(expected, format!("`{}`", channel.message_encoding)));
        }
        if !self.schemas.contains_key(&channel.topic) {
            self.schemas.insert(channel.topic.clone(), schema.to_owned());
        }
        match schema {
            TF_MESSAGE => {
                let is_static = channel.topic.ends_with("tf_static");
                for transform in transforms(message.data)? {
                    self.transforms.add(transform, is_static)?;
                }
            }
            CAMERA_INFO => {
                let info = CameraInfo::read(message.data)?;
                let first =
                    self.cameras.entry(channel.topic.clone()).or_insert_with(|| info.clone());
                if *first != info {
                    self.changed.push(channel.topic.clone());
                }
            }
            IMAGE | COMPRESSED | POINT_CLOUD => {
                let header = CdrReader::new(message.data).and_then(|mut cdr| {
                    let (time, frame) = cdr.header()?;
                    Some((time, frame.to_owned()))
                });
                let (time, frame) = header.ok_or_else(|| {
                    Fault::new("a header in CDR", "fewer bytes, or another encoding")
                })?;
                let time = if time == 0 { message.log_time } else { time };
                let stamps = self.stamps.entry(channel.topic.clone()).or_default();
                if let Some(last) = stamps.last().filter(|last| **last > time) {
                    let expected = format!("messages in the order of time, from {last} ns on");
                    return Err(Fault::new(
                        expected,
                        format!("{time} ns: the recording starts again?"),
                    ));
                }
                stamps.push(time);
                self.frames.entry(channel.topic.clone()).or_insert(frame);
            }
            _ => {}
        }
        Ok(())
    }

    fn camera(&self, path: &Path, topic: &str) -> Result<&CameraInfo> {
        let place = format!("topic {topic}");
        if self.changed.iter().any(|name| name == topic) {
            let expected = "a camera that stays as it is";
            return Err(FormatError::new(path, place, expected, "one that changes").into());
        }
        self.cameras
            .get(topic)
            .ok_or_else(|| FormatError::new(path, place, "a CameraInfo", "no message").into())
    }
}

/// Which part of an observation a message is.
#[derive(Clone, Copy)]
enum Part {
    Color,
    Depth,
}

/// Which messages make which observations.
struct Pairs {
    color: Option<String>,
    depth: Option<String>,
    /// Observation of each message, where it has one.
    of_color: Vec<Option<usize>>,
    of_depth: Vec<Option<usize>>,
    n_unpaired: usize,
}

/// A message's place: observation and part.
struct Place {
    observation: usize,
    part: Part,
}

impl Pairs {
    fn new(path: &Path, survey: &Survey, chosen: &Chosen, gap: u64) -> Result<Self> {
        let name = |topic: &Option<Topic>| topic.as_ref().map(|topic| topic.name.clone());
        let (color, depth) = (name(&chosen.color), name(&chosen.depth));
        let stamps = |name: &Option<String>| {
            name.as_ref().map(|name| survey.stamps.get(name).map_or(&[][..], |s| &s[..]))
        };
        if let (Some(color), Some(depth)) = (&chosen.color, &chosen.depth)
            && depth.schema != POINT_CLOUD
            && survey.frames.get(&color.name) != survey.frames.get(&depth.name)
        {
            let frame = |name: &String| survey.frames.get(name).cloned().unwrap_or_default();
            let expected = format!(
                "depth that is registered to the colour, on the frame `{}` (such as \
                                    aligned_depth_to_color)",
                frame(&color.name)
            );
            let found = format!("depth on `{}`", frame(&depth.name));
            return Err(
                FormatError::new(path, format!("topic {}", depth.name), expected, found).into()
            );
        }
        let all = |n: usize| (0..n).map(Some).collect::<Vec<Option<usize>>>();
        let (of_color, of_depth) = match (stamps(&color), stamps(&depth)) {
            (Some(color), Some(depth)) => paired(color, depth, gap),
            (Some(color), None) => (all(color.len()), Vec::new()),
            (None, Some(depth)) => (Vec::new(), all(depth.len())),
            (None, None) => (Vec::new(), Vec::new()),
        };
        let n_unpaired = of_color.iter().chain(&of_depth).filter(|pair| pair.is_none()).count();
        if of_color.iter().chain(&of_depth).all(Option::is_none) {
            let expected =
                format!("colour and depth within {:.3} s of each other", gap as f64 / 1e9);
            return Err(FormatError::new(path, "times", expected, "no such pair").into());
        }
        Ok(Self { color, depth, of_color, of_depth, n_unpaired })
    }

    fn place(&self, topic: &str, index: usize) -> Option<Place> {
        let of = |name: &Option<String>, pairs: &[Option<usize>]| {
            (name.as_deref() == Some(topic)).then(|| pairs.get(index).copied().flatten()).flatten()
        };
        let color =
            of(&self.color, &self.of_color).map(|n| Place { observation: n, part: Part::Color });
        let depth =
            || of(&self.depth, &self.of_depth).map(|n| Place { observation: n, part: Part::Depth });
        color.or_else(depth)
    }
}

/// Numbers of the observations that two ascending series of times make: members of a pair are each other's nearest, and
/// no farther apart than `gap`.
fn paired(a: &[u64], b: &[u64], gap: u64) -> (Vec<Option<usize>>, Vec<Option<usize>>) {
    let nearest = |time: u64, others: &[u64]| {
        let after = others.partition_point(|&t| t < time);
        let candidates = [after.checked_sub(1), Some(after).filter(|&i| i < others.len())];
        candidates.into_iter().flatten().min_by_key(|&i| others[i].abs_diff(time))
    };
    let (mut of_a, mut of_b) = (vec![None; a.len()], vec![None; b.len()]);
    let mut n = 0;
    for (i, &time) in a.iter().enumerate() {
        let Some(j) = nearest(time, b).filter(|&j| b[j].abs_diff(time) <= gap) else { continue };
        // Of several of `a` with one time the first is the nearest.
        if nearest(b[j], a).is_some_and(|k| a[k] == time) && of_b[j].is_none() {
            (of_a[i], of_b[j]) = (Some(n), Some(n));
            n += 1;
        }
    }
    (of_a, of_b)
}

/// The messages of one observation.
#[derive(Default)]
struct Parts {
    color: Option<Vec<u8>>,
    depth: Option<Vec<u8>>,
}

/// Messages that wait for their counterpart, or for an earlier observation; of those observations alone that are wanted.
struct Waiting {
    /// From one wanted observation to the next.
    every: usize,
    parts: BTreeMap<usize, Parts>,
    next: usize,
}

impl Waiting {
    fn put(&mut self, place: Place, message: &[u8]) {
        if !place.observation.is_multiple_of(self.every) {
            return;
        }
        let message = message.to_vec();
        let parts = self.parts.entry(place.observation).or_default();
        match place.part {
            Part::Color => parts.color = Some(message),
            Part::Depth => parts.depth = Some(message),
        }
    }

    /// The next wanted observation, once it is complete.
    fn next(&mut self, pairs: &Pairs) -> Option<Parts> {
        let at = self.next;
        let parts = self.parts.get(&at)?;
        let is_there =
            |topic: &Option<String>, part: &Option<Vec<u8>>| topic.is_none() || part.is_some();
        if !(is_there(&pairs.color, &parts.color) && is_there(&pairs.depth, &parts.depth)) {
            return None;
        }
        self.next += self.every;
        self.parts.remove(&at)
    }
}

/// Makes observations of messages.
struct Maker<'a> {
    chosen: &'a Chosen,
    info: &'a CameraInfo,
    transforms: &'a Transforms,
    settings: &'a BagSettings,
}

impl Maker<'_> {
    fn observation(&self, parts: Parts, log_time: u64) -> std::result::Result<Observation, Fault> {
        let Chosen { color: color_topic, depth: depth_topic, .. } = self.chosen;
        let color =
            parts.color.as_deref().map(|data| color(schema(color_topic), data)).transpose()?;
        let is_cloud = schema(depth_topic) == POINT_CLOUD;
        let data = parts.depth.as_deref();
        let depth = match data.filter(|_| !is_cloud) {
            Some(data) => Some(depth(schema(depth_topic), data)?),
            None => None,
        };
        let header = |data: &[u8]| {
            CdrReader::new(data)?.header().map(|(time, frame)| (time, frame.to_owned()))
        };
        let (time, frame) = data.or(parts.color.as_deref()).and_then(header).unwrap_or_default();
        let time = if time == 0 { log_time } else { time };
        let size = match (&depth, &color) {
            (Some(depth), Some(color))
                if (depth.width, depth.height) != (color.width, color.height) =>
            {
                let expected =
                    format!("depth of {} × {} pixels, as the colour", color.width, color.height);
                return Err(Fault::new(expected, format!("{} × {}", depth.width, depth.height)));
            }
            (Some(depth), _) => Some([depth.width, depth.height]),
            (None, Some(color)) => Some([color.width, color.height]),
            (None, None) => None,
        };
        let rectified = depth_topic.as_ref().filter(|_| !is_cloud).or(color_topic.as_ref());
        let rectified = rectified.is_none_or(|topic| is_rectified(&topic.name));
        let calibration = match size {
            Some(size) => self.info.calibration(size, rectified)?,
            None => self.info.calibration(self.info.size(), true)?,
        };
        let words = |error: Error| Fault::new("an observation", error.to_string());
        let mut seen = Observation::new(calibration.camera);
        seen.time_nanos = Some(time);
        if let Some(color) = color {
            seen = seen.with_color(color.pixels).map_err(words)?;
        }
        if let Some(depth) = depth {
            let image = DepthImage::new(depth.width, depth.height, depth.metres);
            let image = image.map_err(|error| Fault::new("a depth image", error.to_string()))?;
            seen = seen.with_depth(image).map_err(words)?;
        }
        if let Some(lens) = &calibration.distortion {
            seen = seen.undistorted(lens).map_err(words)?;
        }
        let gap = self.settings.max_gap_nanos;
        let camera_frame = if is_cloud { &self.info.frame } else { &frame };
        if let Some(data) = data.filter(|_| is_cloud) {
            let motion = self.transforms.lookup(camera_frame, &frame, time, gap)?;
            let cloud = points(data)?.into_iter().map(|p| motion.transform_point3(p)).collect();
            seen = seen.with_cloud(cloud).map_err(words)?;
        }
        let pose = match &self.settings.fixed_frame {
            Some(fixed) => self.transforms.lookup(fixed, camera_frame, time, gap)?.inverse(),
            None => DAffine3::IDENTITY,
        };
        seen.posed(pose).map_err(words)
    }
}

/// Name of a topic's messages; empty where there is no such topic.
fn schema(topic: &Option<Topic>) -> &str {
    topic.as_ref().map_or("", |topic| topic.schema.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn members_of_a_pair_are_each_others_nearest() {
        let (a, b) = paired(&[0, 100, 200, 300], &[10, 195, 205, 900], 30);
        assert_eq!(a, [Some(0), None, Some(1), None]);
        assert_eq!(b, [Some(0), Some(1), None, None]);
        assert_eq!(paired(&[5, 5], &[5], 0), (vec![Some(0), None], vec![Some(0)]));
        assert_eq!(paired(&[], &[5], 9).1, [None]);
    }

    #[test]
    fn files_of_a_bag_stand_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["bag_10.mcap", "bag_9.mcap", "metadata.yaml", "bag_0.mcap"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names: Vec<String> = files_of(folder.path())
            .unwrap()
            .iter()
            .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(names, ["bag_0.mcap", "bag_9.mcap", "bag_10.mcap"]);
        assert!(files_of(Path::new("a.db3")).unwrap_err().to_string().contains("ros2 bag convert"));
    }
}
