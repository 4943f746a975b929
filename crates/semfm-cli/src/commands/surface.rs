//! `semfm-cli surface`: what a depth camera saw of an object, as an object.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use semfm::files::SURFACE_FILES;
use semfm::geom::ShapeCache;
use semfm::observe::{
    Observation, SourceReport, SourceSettings, SurfaceSettings, read_observations,
};
use semfm::observed_object::ObservedViews;
use semfm::{Method, ObjectFrame, ObservedObject, VisibleFrames};

use super::Outcome;
use super::encoder_options::EncoderOptions;
use super::frame_options::{BagOptions, FrameFileOptions, parse_source, read_source_frame};
use crate::console;
use crate::options::Common;
use crate::output::{check_folder, check_folder_again};

/// Make an object of what a depth camera saw of it, for `transfer`, `region` and `grasp`
///
/// For objects without a reconstruction. The mesh is the surface under the mask, in metres and in the camera's frame; its
/// embeddings are those of the real picture, of the surface rendered from where it was seen, or of both.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli surface --color c.png --depth d.png --intrinsics K.json --mask kettle.png -o kettle\n  \
    semfm-cli surface bop/000001#3 --object obj5 -o seen\n  \
    semfm-cli surface recording.mcap -o seen --merge --every 30 --fixed-frame base_link\n\n\
    Then:\n  \
    semfm-cli transfer mug.obj kettle/surface.ply --region grip.json -o out \\\n    \
    --target-embeddings kettle/surface.emb.mcap \\\n    \
    --gripper franka --metres --scene kettle/around.ply --unseen 0.05")]
pub struct SurfaceCommand {
    /// A bag (.mcap, or a folder of them) or the folder of a BOP scene; `#N` is its frame N [default: the first, #0]
    #[arg(value_name = "SOURCE[#N]", conflicts_with_all = ["color", "depth", "depth_scale", "intrinsics", "mask", "pose"])]
    source: Option<String>,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// The object's mask, by name, where the frame has several (a file's name without extension, `obj5` in a BOP scene)
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    #[command(flatten)]
    files: FrameFileOptions,
    #[command(flatten)]
    bag: BagOptions,
    /// Merge all frames that show the object, whose cameras' poses are known: the surface is then in the frame of the poses
    #[arg(long, conflicts_with = "vertices", help_heading = "Merge")]
    merge: bool,
    /// Merge the first frame and each that is so many further on
    #[arg(long, value_name = "N", default_value_t = 1, requires = "merge", help_heading = "Merge")]
    every: usize,
    /// Merge at most so many
    #[arg(long, value_name = "N", requires = "merge", help_heading = "Merge")]
    most: Option<usize>,
    #[command(flatten)]
    options: SurfaceOptions,
    #[command(flatten)]
    encoder: EncoderOptions,
    /// What the encoder is shown: pictures, surface (rendered from where it was seen) or both [default: what suits the
    /// encoder: surface where it was trained on grey views, as the built-in one, else both]
    #[arg(long, value_name = "VIEWS", help_heading = "Features")]
    views: Option<ObservedViews>,
    /// Write no embeddings
    #[arg(long, conflicts_with_all = ["encoder", "rolls", "views"], help_heading = "Features")]
    no_embeddings: bool,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Surface")]
struct SurfaceOptions {
    /// Radius of the window in which depth is smoothed, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = SurfaceSettings::default().smooth_pixels)]
    smooth: usize,
    /// Pixels along the mask's outline that are left out
    #[arg(long, value_name = "PIXELS", default_value_t = SurfaceSettings::default().trim_pixels)]
    trim: usize,
    /// Vertices at most: of a larger picture every second pixel is taken, or fewer
    #[arg(long, value_name = "N", default_value_t = SurfaceSettings::default().most_vertices)]
    vertices: usize,
}

impl SurfaceOptions {
    fn settings(&self) -> Result<SurfaceSettings> {
        let Self { smooth, trim, vertices } = *self;
        let settings =
            SurfaceSettings { smooth_pixels: smooth, trim_pixels: trim, most_vertices: vertices };
        settings.check().map_err(|error| anyhow!("--{error}"))?;
        Ok(settings)
    }
}

impl SurfaceCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let source = self.source.as_deref().map(parse_source);
        let mut inputs = self.files.paths();
        inputs.extend(source.iter().map(|(path, _)| path.clone()));
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        check_folder(&self.output, SURFACE_FILES, &inputs)?;
        let settings = self.options.settings()?;
        let task = console::progress(common.quiet);
        let all = self.frames(source.as_ref(), common)?;
        check_folder_again(&self.output, SURFACE_FILES)?;
        let frames = self.frames_of_object(all, common)?;
        let seen = match self.merge {
            true => ObservedObject::merged(frames, &settings)?,
            false => ObservedObject::new(frames, &settings)?,
        };
        let embeddings = match self.no_embeddings {
            true => None,
            false => {
                let most_rolls = Method::default().info().features.rolls;
                let encoder = self.encoder.open(most_rolls, &ShapeCache::off(), common)?;
                let shown = seen.shown(self.views, &encoder.encoder().wants());
                let shown = shown.map_err(|error| anyhow!("--{error}"))?;
                Some(seen.embed(&encoder, Some(shown), &task)?)
            }
        };
        let embeddings = embeddings.as_ref().map(|made| (&made.file, made.shown));
        let files = seen.write(&self.output, embeddings, &task)?;
        if !common.quiet {
            print_surface(&seen);
        }
        if common.json {
            let file = seen.with_result(embeddings, |result| result.file());
            console::data(serde_json::to_string(&file)?);
        } else {
            files.iter().for_each(|file| console::data(file.display()));
        }
        Ok(Outcome::Done)
    }

    /// What was seen: one frame, or with --merge all of them.
    fn frames(
        &self,
        source: Option<&(PathBuf, Option<usize>)>,
        common: &Common,
    ) -> Result<Vec<Observation>> {
        let note = |report: &SourceReport| {
            if !common.quiet {
                report.notes.iter().for_each(console::message);
            }
        };
        match source {
            Some((path, Some(number))) if self.merge => bail!(
                "{}#{number}: expected a source without a frame's number beside --merge, found one",
                path.display()
            ),
            Some((path, None)) if self.merge => {
                let settings = SourceSettings {
                    bag: self.bag.settings()?,
                    every: self.every,
                    most: self.most,
                };
                let mut all = Vec::new();
                note(&read_observations(path, &settings, |seen| {
                    all.push(seen);
                    Ok(())
                })?);
                if all.is_empty() {
                    bail!("{}: expected at least one frame, found none", path.display());
                }
                Ok(all)
            }
            Some((path, number)) => {
                let frame = read_source_frame(path, number.unwrap_or(0), &self.bag)?;
                note(&frame.report);
                Ok(vec![frame.observation])
            }
            None if self.merge => {
                bail!(
                    "--merge: expected a source of several frames, a bag or a BOP scene, found files"
                )
            }
            None if self.files.is_given() => {
                self.bag.check_unused()?;
                Ok(vec![self.files.read()?])
            }
            None => bail!(
                "expected a bag or a BOP scene, or --depth (and --color) with --intrinsics; found neither"
            ),
        }
    }

    /// The frames that show the object. Where several are merged, those without its mask, or without depth under it, are
    /// left out.
    fn frames_of_object(&self, all: Vec<Observation>, common: &Common) -> Result<Vec<ObjectFrame>> {
        let object = self.object.as_deref();
        let all = all.into_iter().map(Arc::new);
        if !self.merge {
            let frames = all.map(|seen| ObjectFrame::of(seen, object));
            return frames.collect::<semfm::Result<_>>().context("--object");
        }
        let VisibleFrames { frames, left_out } =
            VisibleFrames::of(all, object).context("--merge")?;
        if !common.quiet {
            left_out.iter().for_each(console::message);
        }
        Ok(frames)
    }
}

/// What was made of the pixels.
fn print_surface(seen: &ObservedObject) {
    let (low, high) = seen.mesh().bounds();
    let [x, y, z] = (1e3 * (high - low)).to_array();
    let (n, faces) = (seen.mesh().n_vertices(), seen.mesh().n_faces());
    console::message(format_args!("{n} vertices, {faces} triangles; {x:.0} × {y:.0} × {z:.0} mm"));
    if let Some(report) = seen.pixels() {
        console::message(format_args!(
            "of {} pixels, {} of them without depth and filled",
            report.n_pixels, report.n_filled
        ));
    }
    if !seen.around().is_empty() {
        console::message(format_args!("{} points of what is around it", seen.around().len()));
    }
}
