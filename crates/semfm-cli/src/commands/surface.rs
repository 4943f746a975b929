//! `semfm-cli surface`: what a depth camera saw of an object, as an object.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use semfm::encoder::{ObservedPicture, WantedViews};
use semfm::files::{SURFACE_FILES, SurfaceResult, write_surface};
use semfm::geom::ShapeCache;
use semfm::geom::math::{DAffine3, DVec3};
use semfm::observe::{
    Mask, MaskedFrame, MergedSurface, Observation, ObservedSurface, SourceReport, SourceSettings,
    SurfaceReport, SurfaceSettings, merged_surface, merged_surroundings, read_observations,
};
use semfm::observed_object::{ObservedViews, embed_observed, observed_views};
use semfm::{Mesh, Method};

use super::Outcome;
use super::encoder_options::EncoderOptions;
use super::frame_options::{
    BagOptions, FrameFileOptions, chosen_mask, mask_in_frame, parse_source, read_source_frame,
};
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
        for (option, found, most) in [("--smooth", self.smooth, 20), ("--trim", self.trim, 100)] {
            if found > most {
                bail!("{option}: expected 0 to {most} pixels, found {found}");
            }
        }
        if self.vertices < 100 {
            bail!("--vertices: expected at least 100, found {}", self.vertices);
        }
        let Self { smooth, trim, vertices } = *self;
        Ok(SurfaceSettings { smooth_pixels: smooth, trim_pixels: trim, most_vertices: vertices })
    }
}

/// A surface, whether one frame or several saw it.
struct Seen {
    mesh: Mesh,
    colors: Option<Vec<[u8; 3]>>,
    pixels: Option<SurfaceReport>,
    around: Vec<DVec3>,
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
        let shown = self.shown_frames(&all, common)?;
        let frames: Vec<&Observation> = shown.iter().map(|frame| frame.seen).collect();
        let Seen { mesh, colors, pixels, around } = match shown[..] {
            [MaskedFrame { seen, mask }] => seen_once(seen, mask, &settings)?,
            _ => seen_often(&shown, &settings)?,
        };
        let embeddings = match self.no_embeddings {
            true => None,
            false => {
                let most_rolls = Method::default().info().features.rolls;
                let encoder = self.encoder.open(most_rolls, &ShapeCache::off(), common)?;
                let wants = encoder.encoder().wants();
                let kind = self.shown_views(&frames, &wants)?;
                let pictures = pictures(&shown)?;
                let views = observed_views(&mesh, &pictures, kind, &wants, &task)?;
                let made = embed_observed(&views, &**encoder.encoder(), encoder.rolls(), &task)?;
                Some((made, kind))
            }
        };
        let result = SurfaceResult {
            mesh: &mesh,
            colors: colors.as_deref(),
            frames: &frames,
            object: shown.iter().find_map(|frame| frame.mask).map(|mask| mask.name.as_str()),
            pixels,
            around: &around,
            embeddings: embeddings.as_ref().map(|(file, kind)| (file, *kind)),
        };
        let files = write_surface(&self.output, &result, &task)?;
        if !common.quiet {
            print_surface(&result);
        }
        if common.json {
            console::data(serde_json::to_string(&result.file())?);
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
                    bag: self.bag.settings(path)?,
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
                let poses = all.iter().map(|seen| seen.camera().camera_from_world());
                if all.len() > 1 && poses.clone().all(|pose| pose == DAffine3::IDENTITY) {
                    bail!(
                        "{}: expected the camera's pose in each frame (a BOP scene with cam_R_w2c and cam_t_w2c, a bag with \
                         --fixed-frame), found none",
                        path.display()
                    );
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
    /// left out; where no frame has any mask, all that was seen is the object.
    fn shown_frames<'a>(
        &self,
        all: &'a [Observation],
        common: &Common,
    ) -> Result<Vec<MaskedFrame<'a>>> {
        let object = self.object.as_deref();
        let frame = |seen: &'a Observation| {
            let mask = match self.merge {
                true => mask_in_frame(seen, object)?,
                false => chosen_mask(seen, object)?,
            };
            Ok(MaskedFrame { seen, mask })
        };
        let frames: Vec<MaskedFrame<'a>> = all.iter().map(frame).collect::<Result<_>>()?;
        if frames.iter().all(|frame| frame.mask.is_none()) {
            if let Some(name) = object {
                bail!("--object: expected a mask of some frame, found none of the name `{name}`");
            }
            return Ok(frames);
        }
        if !self.merge {
            return Ok(frames);
        }
        let mut shown = Vec::new();
        for (number, frame) in frames.iter().enumerate() {
            let why = match frame.mask {
                None => "it has no mask of the object",
                Some(mask) if frame.seen.points(Some(mask)).is_err() => "no depth under its mask",
                Some(_) => {
                    shown.push(*frame);
                    continue;
                }
            };
            if !common.quiet {
                console::message(format_args!("frame {number} is left out: {why}"));
            }
        }
        if shown.is_empty() {
            bail!("--merge: expected depth under the mask of some frame, found none");
        }
        Ok(shown)
    }

    /// What the encoder is shown.
    fn shown_views(&self, frames: &[&Observation], wants: &WantedViews) -> Result<ObservedViews> {
        let has_color = frames.iter().all(|seen| seen.color().is_some());
        match self.views {
            Some(shown) if !has_color && shown != ObservedViews::Surface => {
                bail!("--views {shown}: expected a colour picture, found depth alone")
            }
            Some(shown) => Ok(shown),
            None if has_color => Ok(ObservedViews::for_encoder(wants)),
            None => Ok(ObservedViews::Surface),
        }
    }
}

/// The surface of one frame, in its camera's frame.
fn seen_once(seen: &Observation, mask: Option<&Mask>, settings: &SurfaceSettings) -> Result<Seen> {
    let ObservedSurface { mesh, colors, report, .. } = seen.surface(mask, settings)?;
    let around = mask.map(|mask| seen.surroundings(mask)).transpose()?.unwrap_or_default();
    Ok(Seen { mesh, colors, pixels: Some(report), around })
}

/// The surface of several frames, in the frame in which their cameras are posed.
fn seen_often(frames: &[MaskedFrame<'_>], settings: &SurfaceSettings) -> Result<Seen> {
    let MergedSurface { mesh, colors, .. } = merged_surface(frames, settings)?;
    Ok(Seen { mesh, colors, pixels: None, around: merged_surroundings(frames)? })
}

/// The pictures before the mesh: of one frame in its camera's frame, of several in the world's.
fn pictures<'a>(frames: &[MaskedFrame<'a>]) -> Result<Vec<ObservedPicture<'a>>> {
    let picture = |&MaskedFrame { seen, mask }: &MaskedFrame<'a>| {
        let camera = match frames {
            [_] => seen.camera().posed(DAffine3::IDENTITY)?,
            _ => *seen.camera(),
        };
        // The surface is rendered without colours.
        let color = seen.color().unwrap_or_default();
        Ok(ObservedPicture { camera, color, mask: mask.map(|mask| &mask.marked[..]) })
    };
    frames.iter().map(picture).collect()
}

/// What was made of the pixels.
fn print_surface(result: &SurfaceResult<'_>) {
    let (low, high) = result.mesh.bounds();
    let [x, y, z] = (1e3 * (high - low)).to_array();
    let (n, faces) = (result.mesh.n_vertices(), result.mesh.n_faces());
    console::message(format_args!("{n} vertices, {faces} triangles; {x:.0} × {y:.0} × {z:.0} mm"));
    if let Some(report) = result.pixels {
        console::message(format_args!(
            "of {} pixels, {} of them without depth and filled",
            report.n_pixels, report.n_filled
        ));
    }
    if !result.around.is_empty() {
        console::message(format_args!("{} points of what is around it", result.around.len()));
    }
}
