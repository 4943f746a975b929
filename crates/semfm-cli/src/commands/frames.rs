//! `semfm-cli frames`: what a camera saw, from one form of files into another.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use semfm::geom::io::is_same_file;
use semfm::observe::{read_observations, write_observations};

use super::Outcome;
use super::frame_options::{BagOptions, FrameChoice, FrameFileOptions};
use crate::console;
use crate::options::Common;

/// Read what a depth camera saw, from files, a BOP scene or a ROS 2 bag, and write it as a BOP scene or a bag
///
/// Everything is checked on the way: sizes, units, missing returns, cameras, times, transforms; pictures of a lens that
/// distorts come out without distortion. All frames are held in memory: --every and --most take fewer.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli frames recording.mcap -o scene --every 30 --fixed-frame base_link\n  \
    semfm-cli frames --color c.png --depth d.png --intrinsics K.json --mask cup.png -o scene\n  \
    semfm-cli frames bop/000001 -o frames.mcap")]
pub struct FramesCommand {
    /// A bag (.mcap, or a folder of them) or the folder of a BOP scene
    #[arg(conflicts_with_all = ["color", "depth", "depth_scale", "intrinsics", "mask", "pose"])]
    source: Option<PathBuf>,
    /// Where to write: a folder (BOP scene), or a bag (`NAME.mcap`)
    #[arg(short, long, value_name = "FOLDER|FILE.mcap")]
    output: PathBuf,
    #[command(flatten)]
    files: FrameFileOptions,
    #[command(flatten)]
    bag: BagOptions,
    #[command(flatten)]
    choice: FrameChoice,
}

impl FramesCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        if self.source.as_deref().is_some_and(|source| is_same_file(source, &self.output)) {
            bail!("{}: expected another place than the source", self.output.display());
        }
        if self.source.is_none() && !self.files.is_given() {
            bail!(
                "expected a bag or a BOP scene, or --color or --depth with --intrinsics; found neither"
            );
        }
        let observations = match &self.source {
            Some(source) => {
                let mut all = Vec::new();
                let report =
                    read_observations(source, &self.choice.settings(&self.bag)?, |seen| {
                        all.push(seen);
                        Ok(())
                    })?;
                if !common.quiet {
                    report.notes.iter().for_each(console::message);
                }
                all
            }
            None => {
                self.bag.check_unused()?;
                self.choice.check_unused()?;
                vec![self.files.read()?]
            }
        };
        write_observations(&self.output, &observations)?;
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
}
