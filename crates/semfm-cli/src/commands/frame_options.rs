//! What a camera saw: single files, or a frame of a BOP scene or of a bag.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{ArgGroup, Args};
use semfm::files::read_camera_pose;
use semfm::observe::{
    BagSettings, Mask, MaskFile, Observation, ObservationFiles, SourceReport, SourceSettings,
    read_observations,
};

/// The files of one frame.
#[derive(Debug, Args)]
#[command(next_help_heading = "Files", group = ArgGroup::new("picture").multiple(true).args(["color", "depth"]))]
pub struct FrameFileOptions {
    /// A colour picture: PNG, JPEG or EXR
    #[arg(long, value_name = "IMAGE", requires = "intrinsics")]
    pub color: Option<PathBuf>,
    /// A depth image: 16-bit PNG, EXR or .npy
    #[arg(long, value_name = "DEPTH", requires = "intrinsics")]
    pub depth: Option<PathBuf>,
    /// Units of the depth image to the metre [default: 1000 for whole numbers, 1 for floats]
    #[arg(long, value_name = "N", allow_negative_numbers = true, requires = "depth")]
    depth_scale: Option<f64>,
    /// The camera
    #[arg(long, value_name = "K.json", requires = "picture")]
    intrinsics: Option<PathBuf>,
    /// What the pixels show; several are taken
    #[arg(long, value_name = "MASK[#LABEL]", requires = "intrinsics")]
    mask: Vec<String>,
    /// Where the camera stood: a 4 × 4 matrix `camera_from_world` (JSON)
    #[arg(long, value_name = "FILE", requires = "intrinsics")]
    pose: Option<PathBuf>,
}

impl FrameFileOptions {
    /// Whether a picture is given.
    pub fn is_given(&self) -> bool {
        self.color.is_some() || self.depth.is_some()
    }

    /// The files that it reads.
    pub fn paths(&self) -> Vec<PathBuf> {
        let masks = self.mask.iter().map(|mask| MaskFile::parse(mask).path);
        let single = [&self.color, &self.depth, &self.intrinsics, &self.pose];
        single.into_iter().flatten().cloned().chain(masks).collect()
    }

    /// The frame.
    pub fn read(&self) -> Result<Observation> {
        let calibration = self.intrinsics.clone().context("--intrinsics is needed")?;
        let pose = self.pose.as_deref().map(read_camera_pose).transpose()?;
        let files = ObservationFiles {
            color: self.color.clone(),
            depth: self.depth.clone(),
            depth_scale: self.depth_scale,
            calibration,
            masks: self.mask.iter().map(|mask| MaskFile::parse(mask)).collect(),
            camera_from_world: pose,
        };
        Ok(files.read()?)
    }
}

/// How a bag is read.
#[derive(Debug, Args)]
#[command(next_help_heading = "Bag")]
pub struct BagOptions {
    /// Topic of the colour, where several could be meant
    #[arg(long, value_name = "TOPIC")]
    color_topic: Option<String>,
    /// Topic of the depth, or of the clouds
    #[arg(long, value_name = "TOPIC")]
    depth_topic: Option<String>,
    /// Topic of the camera [default: camera_info beside the depth]
    #[arg(long, value_name = "TOPIC")]
    info_topic: Option<String>,
    /// Frame in which the camera's poses are given [default: the camera's own]
    #[arg(long, value_name = "FRAME")]
    fixed_frame: Option<String>,
    /// Farthest apart that colour, depth and transforms of one frame may be, seconds [default: 0.03]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    max_gap: Option<f64>,
}

impl BagOptions {
    /// How a bag is read.
    pub fn settings(&self) -> Result<BagSettings> {
        let settings = BagSettings {
            color: self.color_topic.clone(),
            depth: self.depth_topic.clone(),
            camera_info: self.info_topic.clone(),
            fixed_frame: self.fixed_frame.clone(),
            ..BagSettings::default()
        };
        Ok(match self.max_gap {
            Some(seconds) => settings.with_max_gap(seconds).context("--max-gap")?,
            None => settings,
        })
    }

    /// Refuses options of a bag where files are read.
    pub fn check_unused(&self) -> Result<()> {
        match self.given() {
            Some(option) => bail!("{option}: expected a bag beside it, found files alone"),
            None => Ok(()),
        }
    }

    /// One of the options that were given.
    fn given(&self) -> Option<&'static str> {
        let given = [
            ("--color-topic", self.color_topic.is_some()),
            ("--depth-topic", self.depth_topic.is_some()),
            ("--info-topic", self.info_topic.is_some()),
            ("--fixed-frame", self.fixed_frame.is_some()),
            ("--max-gap", self.max_gap.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(option, _)| option)
    }
}

/// Which frames of a source are taken.
#[derive(Clone, Copy, Debug, Args)]
pub struct FrameChoice {
    /// Take the first frame and each that is so many further on [default: 1]
    #[arg(long, value_name = "N")]
    every: Option<usize>,
    /// Take at most so many
    #[arg(long, value_name = "N")]
    most: Option<usize>,
}

impl FrameChoice {
    /// How these frames of a source are read.
    pub fn settings(&self, bag: &BagOptions) -> Result<SourceSettings> {
        let (bag, every) = (bag.settings()?, self.every.unwrap_or(1));
        Ok(SourceSettings { bag, every, most: self.most })
    }

    /// Refuses a choice among the frames of a source where files are read.
    pub fn check_unused(&self) -> Result<()> {
        let given = [("--every", self.every.is_some()), ("--most", self.most.is_some())];
        match given.into_iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => bail!("{option}: expected a source beside it, found files alone"),
            None => Ok(()),
        }
    }
}

/// One frame of a BOP scene or of a bag.
pub struct SourceFrame {
    /// What was seen.
    pub observation: Observation,
    /// What was chosen or left out, in words.
    pub report: SourceReport,
}

/// `SOURCE`, or `SOURCE#N` for its frame N, counted from 0.
pub fn parse_source(text: &str) -> (PathBuf, Option<usize>) {
    match text.rsplit_once('#').map(|(path, number)| (path, number.parse())) {
        Some((path, Ok(number))) if !path.is_empty() => (path.into(), Some(number)),
        _ => (text.into(), None),
    }
}

/// Reads one frame.
pub fn read_source_frame(source: &Path, number: usize, bag: &BagOptions) -> Result<SourceFrame> {
    let most = number.checked_add(1); // all, for the last number there is
    let settings = SourceSettings { bag: bag.settings()?, most, ..SourceSettings::default() };
    let (mut n_seen, mut found) = (0, None);
    let report = read_observations(source, &settings, |seen| {
        if n_seen == number {
            found = Some(seen);
        }
        n_seen += 1;
        Ok(())
    })?;
    let Some(observation) = found else {
        bail!(
            "{}: expected a frame #{number}, found {n_seen}, the first of which is #0",
            source.display()
        );
    };
    Ok(SourceFrame { observation, report })
}

/// The mask of the object: the named one, or the only one; none where there is none.
pub fn chosen_mask<'a>(seen: &'a Observation, object: Option<&str>) -> Result<Option<&'a Mask>> {
    seen.mask_of_object(object).context("--object")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_may_name_its_frame() {
        assert_eq!(parse_source("bop/000001"), (PathBuf::from("bop/000001"), None));
        assert_eq!(parse_source("frames.mcap#12"), (PathBuf::from("frames.mcap"), Some(12)));
        assert_eq!(parse_source("a#b"), (PathBuf::from("a#b"), None));
        assert_eq!(parse_source("#3"), (PathBuf::from("#3"), None));
    }
}
