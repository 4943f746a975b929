//! What a camera saw: single files, or a frame of a BOP scene or of a bag.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::read_rigid_pose;
use semfm::geom::math::{DAffine3, DMat3};
use semfm::observe::{
    BagSettings, Mask, MaskFile, Observation, ObservationFiles, SourceReport, SourceSettings,
    read_observations,
};

/// The files of one frame.
#[derive(Debug, Args)]
#[command(next_help_heading = "Files")]
pub struct FrameFileOptions {
    /// A colour picture: PNG or JPEG
    #[arg(long, value_name = "IMAGE", requires = "intrinsics")]
    pub color: Option<PathBuf>,
    /// A depth image: 16-bit PNG or .npy
    #[arg(long, value_name = "DEPTH", requires = "intrinsics")]
    pub depth: Option<PathBuf>,
    /// Units of the depth image to the metre [default: 1000 for whole numbers, 1 for floats]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    depth_scale: Option<f64>,
    /// The camera
    #[arg(long, value_name = "K.json")]
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
        let pose = self.pose.as_deref().map(|path| read_rigid_pose(path, "camera_from_world"));
        let pose = pose.transpose()?.map(|pose| {
            DAffine3::from_mat3_translation(DMat3::from_quat(pose.rotation), pose.translation)
        });
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
    /// Farthest apart that colour, depth and transforms of one frame may be, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.03, allow_negative_numbers = true)]
    max_gap: f64,
}

impl BagOptions {
    /// The settings of the reader.
    pub fn settings(&self) -> Result<BagSettings> {
        if !(self.max_gap >= 0.0 && self.max_gap < 3600.0) {
            bail!("--max-gap: expected 0 to 3600 seconds, found {}", self.max_gap);
        }
        Ok(BagSettings {
            color: self.color_topic.clone(),
            depth: self.depth_topic.clone(),
            camera_info: self.info_topic.clone(),
            fixed_frame: self.fixed_frame.clone(),
            max_gap_nanos: (self.max_gap * 1e9) as u64,
        })
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
pub fn parse_source(text: &str) -> (PathBuf, usize) {
    match text.rsplit_once('#').map(|(path, number)| (path, number.parse())) {
        Some((path, Ok(number))) if !path.is_empty() => (path.into(), number),
        _ => (text.into(), 0),
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
    if let Some(name) = object {
        return Ok(Some(seen.mask(name).context("--object")?));
    }
    match seen.masks() {
        [] => Ok(None),
        [only] => Ok(Some(only)),
        several => {
            let names: Vec<&str> = several.iter().map(|mask| mask.name.as_str()).collect();
            bail!("--object: expected one of the masks {}, found none", names.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_may_name_its_frame() {
        assert_eq!(parse_source("bop/000001"), (PathBuf::from("bop/000001"), 0));
        assert_eq!(parse_source("frames.mcap#12"), (PathBuf::from("frames.mcap"), 12));
        assert_eq!(parse_source("a#b"), (PathBuf::from("a#b"), 0));
        assert_eq!(parse_source("#3"), (PathBuf::from("#3"), 0));
    }
}
