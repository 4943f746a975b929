//! `semfm-cli frames`: what a camera saw, from one form of files into another.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::read_rigid_pose;
use semfm::geom::io::is_same_file;
use semfm::geom::math::{DAffine3, DMat3};
use semfm::observe::{
    BagSettings, MaskFile, Observation, ObservationFiles, SourceSettings, read_observations,
    write_bag, write_bop,
};

use super::Outcome;
use crate::console;
use crate::options::Common;

/// Read what a depth camera saw, from files, a BOP scene or a ROS 2 bag, and write it as a BOP scene or a bag
///
/// Everything is checked on the way: sizes, units, missing returns, cameras, times, transforms; pictures of a lens that
/// distorts come out without distortion.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli frames recording.mcap -o scene --every 30 --fixed-frame base_link\n  \
    semfm-cli frames --color c.png --depth d.png --intrinsics K.json --mask cup.png -o scene\n  \
    semfm-cli frames bop/000001 -o frames.mcap")]
pub struct FramesCommand {
    /// A bag (.mcap, or a folder of them) or the folder of a BOP scene
    #[arg(conflicts_with_all = ["color", "depth"])]
    source: Option<PathBuf>,
    /// Where to write: a folder (BOP scene), or a bag (`NAME.mcap`)
    #[arg(short, long, value_name = "FOLDER|FILE.mcap")]
    output: PathBuf,
    /// A colour picture: PNG or JPEG
    #[arg(long, value_name = "IMAGE", requires = "intrinsics", help_heading = "Files")]
    color: Option<PathBuf>,
    /// A depth image: 16-bit PNG or .npy
    #[arg(long, value_name = "DEPTH", requires = "intrinsics", help_heading = "Files")]
    depth: Option<PathBuf>,
    /// Units of the depth image to the metre [default: 1000 for whole numbers, 1 for floats]
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Files")]
    depth_scale: Option<f64>,
    /// The camera
    #[arg(long, value_name = "K.json", help_heading = "Files")]
    intrinsics: Option<PathBuf>,
    /// What the pixels show; several are taken
    #[arg(long, value_name = "MASK[#LABEL]", requires = "intrinsics", help_heading = "Files")]
    mask: Vec<String>,
    /// Where the camera stood: a 4 × 4 matrix `camera_from_world` (JSON)
    #[arg(long, value_name = "FILE", requires = "intrinsics", help_heading = "Files")]
    pose: Option<PathBuf>,
    /// Topic of the colour, where several could be meant
    #[arg(long, value_name = "TOPIC", help_heading = "Bag")]
    color_topic: Option<String>,
    /// Topic of the depth, or of the clouds
    #[arg(long, value_name = "TOPIC", help_heading = "Bag")]
    depth_topic: Option<String>,
    /// Topic of the camera [default: camera_info beside the depth]
    #[arg(long, value_name = "TOPIC", help_heading = "Bag")]
    info_topic: Option<String>,
    /// Frame in which the camera's poses are given [default: the camera's own]
    #[arg(long, value_name = "FRAME", help_heading = "Bag")]
    fixed_frame: Option<String>,
    /// Farthest apart that colour, depth and transforms of one frame may be, seconds
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.03,
        allow_negative_numbers = true,
        help_heading = "Bag"
    )]
    max_gap: f64,
    /// Take the first frame and each that is so many further on
    #[arg(long, value_name = "N", default_value_t = 1)]
    every: usize,
    /// Take at most so many (they are held in memory)
    #[arg(long, value_name = "N")]
    most: Option<usize>,
}

impl FramesCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        if self.source.as_deref().is_some_and(|source| is_same_file(source, &self.output)) {
            bail!("{}: expected another place than the source", self.output.display());
        }
        if self.source.is_none() && self.color.is_none() && self.depth.is_none() {
            bail!(
                "expected a bag or a BOP scene, or --color or --depth with --intrinsics; found neither"
            );
        }
        let observations = match &self.source {
            Some(source) => {
                let mut all = Vec::new();
                let report = read_observations(source, &self.settings()?, |seen| {
                    all.push(seen);
                    Ok(())
                })?;
                if !common.quiet {
                    report.notes.iter().for_each(console::message);
                }
                all
            }
            None => vec![self.observation_of_files()?],
        };
        let is_bag = self.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
        if is_bag {
            write_bag(&self.output, &observations)?;
        } else {
            write_bop(&self.output, &observations)?;
        }
        if !common.quiet {
            console::message(format_args!("{} frames", observations.len()));
        }
        if common.json {
            console::data(serde_json::json!({
                "output": self.output.display().to_string(), "n_frames": observations.len(),
            }));
        } else {
            console::data(self.output.display());
        }
        Ok(Outcome::Done)
    }

    fn settings(&self) -> Result<SourceSettings> {
        if !(self.max_gap >= 0.0 && self.max_gap < 3600.0) {
            bail!("--max-gap: expected 0 to 3600 seconds, found {}", self.max_gap);
        }
        let bag = BagSettings {
            color: self.color_topic.clone(),
            depth: self.depth_topic.clone(),
            camera_info: self.info_topic.clone(),
            fixed_frame: self.fixed_frame.clone(),
            max_gap_nanos: (self.max_gap * 1e9) as u64,
        };
        Ok(SourceSettings { bag, every: self.every, most: self.most })
    }

    fn observation_of_files(&self) -> Result<Observation> {
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
