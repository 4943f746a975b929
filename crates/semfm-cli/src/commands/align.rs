//! `semfm-cli align`: the pose and the metres of a reconstruction in what a camera sees.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::{ArgGroup, Args};
use semfm::align::{AlignSettings, Alignment, ObservedCloud, Verdict, align};
use semfm::files::{AlignedFile, read_pose};
use semfm::geom::io::{read_mesh, read_points};
use semfm::geom::math::DVec3;
use semfm::observe::{
    Mask, MaskFile, Observation, ObservationFiles, read_intrinsics, registration_doubt,
};

use super::Outcome;
use super::frame_options::{BagOptions, SourceFrame, chosen_mask, parse_source, read_source_frame};
use super::size::size_in_metres;
use crate::console;
use crate::options::{Common, numbers};
use crate::output::OutputFile;

/// Find a mesh of unknown scale in a depth image or a point cloud
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("observed").required(true).args(["cloud", "depth", "frame"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli align mug.obj --depth depth.png --intrinsics K.json --mask mask.png -o aligned.json\n  \
    semfm-cli align mug.obj --frame bop/000001#3 --object obj5 -o aligned.json\n  \
    semfm-cli align mug.obj --cloud seen.ply -o aligned.json\n\n\
    Without a mask the cloud should hold little but the object: what else it holds counts as clutter.\n\
    Exit code 0: a pose to use or to check. 1: verdict `refuse` (the file is written all the same). 2: bad input.")]
pub struct AlignCommand {
    /// The mesh, in any frame and any unit
    mesh: PathBuf,
    /// Where to write the pose (JSON); `-` is stdout
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    observed: ObservedOptions,
    #[command(flatten)]
    bag: BagOptions,
    /// A guess: aligned.json or a 4 × 4 matrix, scale included; the search stays near its rotation
    #[arg(long, value_name = "FILE", help_heading = "Search")]
    init: Option<PathBuf>,
    /// Least and greatest scale, metres per unit of the mesh [default: from the sizes]
    #[arg(long, value_name = "LOW,HIGH", help_heading = "Search")]
    scale_range: Option<String>,
    /// Rotations to start from where there is no guess
    #[arg(long, value_name = "N", default_value_t = AlignSettings::default().n_starts, help_heading = "Search")]
    starts: usize,
    /// Seed of the mesh's samples
    #[arg(long, value_name = "N", default_value_t = AlignSettings::default().seed, help_heading = "Search")]
    seed: u64,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "What the camera sees")]
struct ObservedOptions {
    /// A cloud of the object in the camera's frame, metres: PLY, PCD, OBJ or OFF
    #[arg(long, value_name = "FILE")]
    cloud: Option<PathBuf>,
    /// Where the camera stood in the cloud's frame
    #[arg(long, value_name = "X,Y,Z", requires = "cloud", allow_hyphen_values = true)]
    viewpoint: Option<String>,
    /// The cloud was put together from many views: any side may be in it
    #[arg(long, requires = "cloud", conflicts_with = "viewpoint")]
    many_views: bool,
    /// A depth image: 16-bit PNG, EXR or .npy
    #[arg(long, value_name = "DEPTH", requires = "intrinsics")]
    depth: Option<PathBuf>,
    /// Units of the depth image to the metre [default: 1000 for whole numbers, 1 for floats]
    #[arg(long, value_name = "N", allow_negative_numbers = true, requires = "depth")]
    depth_scale: Option<f64>,
    /// The camera: `{"fx", "fy", "cx", "cy"}` or `{"K": 3 × 3}`; with coefficients of distortion the image is undistorted
    #[arg(long, value_name = "K.json", requires = "depth")]
    intrinsics: Option<PathBuf>,
    /// A mask of the depth image's size: a picture that is bright, or opaque, on the object; .npy; COCO's run lengths
    /// (.json); or one label of a picture of labels
    #[arg(long, value_name = "MASK[#LABEL]", requires = "depth")]
    mask: Option<String>,
    /// The colour camera, where the mask was drawn in its picture and --intrinsics are another camera's: says on whose pixels
    /// the depth lies
    #[arg(long, value_name = "K.json", requires = "mask")]
    color_intrinsics: Option<PathBuf>,
    /// A frame of a BOP scene or of a bag in place of files; `#N` is its frame N [default: #0]
    #[arg(long, value_name = "SOURCE[#N]")]
    frame: Option<String>,
    /// The object's mask in that frame, by name, where it has several (`obj5` in a BOP scene)
    #[arg(long, value_name = "NAME", requires = "frame")]
    object: Option<String>,
}

/// What is searched, and what is doubtful about it.
struct Observed {
    cloud: ObservedCloud,
    notes: Vec<String>,
}

impl AlignCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let mut inputs = vec![self.mesh.as_path()];
        inputs.extend(self.init.as_deref());
        let observed_files = self.observed.files();
        inputs.extend(observed_files.iter().map(PathBuf::as_path));
        let output = OutputFile::new(&self.output, &inputs, common)?;
        let file = read_mesh(&self.mesh)?;
        let start = Instant::now();
        let Observed { cloud, notes } = self.observed.read(&self.bag)?;
        if !common.quiet {
            notes.iter().for_each(console::message);
        }
        let read = start.elapsed().as_secs_f64() * 1e3;
        let settings = AlignSettings {
            init: self.init.as_deref().map(read_pose).transpose()?,
            scale_range: (self.scale_range.as_deref().map(numbers).transpose())
                .context("--scale-range: expected two numbers, LOW,HIGH")?,
            n_starts: self.starts,
            seed: self.seed,
        };
        output.check_again()?;
        let task = console::progress(common.quiet);
        let mut found = align(&file.mesh, &cloud, &settings, &task)
            .with_context(|| self.mesh.display().to_string())?;
        found.stages_ms.insert(0, ("observe", read));
        let aligned = AlignedFile::new(&found, &file.mesh, &settings);
        aligned.write(output.path())?;
        if !common.quiet {
            print_alignment(&found);
            let scale = found.camera_from_object.scale;
            console::message(size_in_metres(&file.mesh, scale));
        }
        if common.json {
            console::data(aligned.to_json());
        }
        output.finish(common)?;
        let refused = found.verdict == Verdict::Refuse;
        Ok(if refused { Outcome::NoAnswer } else { Outcome::Done })
    }
}

impl ObservedOptions {
    /// The files it reads.
    fn files(&self) -> Vec<PathBuf> {
        let depth = self.depth_files().map(|files| files.paths().map(Path::to_owned).collect());
        let depth: Vec<PathBuf> = depth.unwrap_or_default();
        let source = self.frame.as_deref().map(|frame| parse_source(frame).0);
        let further = [self.cloud.clone(), self.color_intrinsics.clone(), source];
        depth.into_iter().chain(further.into_iter().flatten()).collect()
    }

    /// A depth image with its camera and mask.
    fn depth_files(&self) -> Option<ObservationFiles> {
        Some(ObservationFiles {
            depth: Some(self.depth.clone()?),
            depth_scale: self.depth_scale,
            calibration: self.intrinsics.clone()?,
            masks: self.mask.as_deref().map(MaskFile::parse).into_iter().collect(),
            ..Default::default()
        })
    }

    fn read(&self, bag: &BagOptions) -> Result<Observed> {
        if self.frame.is_none() {
            bag.check_unused()?;
        }
        if let Some(files) = self.depth_files() {
            let seen = files.read()?;
            let mask = seen.masks().first();
            let named = || files.paths().last().unwrap_or(Path::new("")).display().to_string();
            let notes = self.doubts(&seen, mask)?;
            return Ok(Observed { cloud: seen.observed_cloud(mask).with_context(named)?, notes });
        }
        if let Some(frame) = &self.frame {
            let (path, number) = parse_source(frame);
            let number = number.unwrap_or(0);
            let SourceFrame { observation: seen, report } = read_source_frame(&path, number, bag)?;
            let mask = chosen_mask(&seen, self.object.as_deref())?;
            let mut notes = report.notes;
            notes.extend(self.doubts(&seen, mask)?);
            return Ok(Observed {
                cloud: seen.observed_cloud(mask).with_context(|| frame.clone())?,
                notes,
            });
        }
        let path = self.cloud.as_deref().context("--cloud, --depth or --frame is needed")?;
        let points = read_points(path)?.points;
        let viewpoint = match self.viewpoint.as_deref().map(numbers) {
            Some(numbers) => {
                DVec3::from_array(numbers.context("--viewpoint: expected three numbers, X,Y,Z")?)
            }
            None => DVec3::ZERO,
        };
        let observed = if self.many_views {
            ObservedCloud::from_many_views(&points)
        } else {
            ObservedCloud::from_view(&points, viewpoint)
        };
        let cloud = observed.with_context(|| path.display().to_string())?;
        Ok(Observed { cloud, notes: Vec::new() })
    }

    /// What speaks against the mask or the camera: depth that does not jump where the mask ends.
    fn doubts(&self, seen: &Observation, mask: Option<&Mask>) -> Result<Vec<String>> {
        let (Some(depth), Some(mask)) = (seen.depth(), mask) else { return Ok(Vec::new()) };
        let color = self.color_intrinsics.as_deref().map(|path| read_intrinsics(path, depth));
        let color = color.transpose()?;
        let doubt = registration_doubt(depth, &mask.marked, seen.camera(), color.as_ref());
        Ok(doubt.map(|doubt| format!("warning: {doubt}")).into_iter().collect())
    }
}

fn print_alignment(found: &Alignment) {
    let scale = found.camera_from_object.scale;
    console::message(format_args!(
        "scale {scale:.5} ± {:.5} metres per unit, residual {:.2} mm",
        found.scale_std,
        1e3 * found.residual_m
    ));
    console::message(format_args!(
        "{:.0} % of the points on the model, {:.0} % of its visible side seen: {}",
        100.0 * found.inlier_share,
        100.0 * found.visibility,
        found.verdict
    ));
    found.reasons.iter().for_each(|reason| console::message(format_args!("  {reason}")));
}
