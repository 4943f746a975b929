//! The options of `region --hand`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::demonstration::{TouchedRegion, region_of_hands};
use semfm::files::read_pose;
use semfm::observe::{ContactSettings, HandFiles, HandFrame, MaskFile, ObservationFiles};
use semfm::{Mesh, align::Sim3};

/// A hand that touches the object, in one frame or several. An option that is given once counts for all frames.
#[derive(Debug, Args)]
#[command(next_help_heading = "A hand")]
pub struct HandOptions {
    /// A reconstructed hand: mesh or cloud (HaMeR, WiLoR, SAM 3D Body), or .npz of vertices and joints; in metres, in the
    /// camera's frame with --aligned, else in the mesh's. Several: frames of one grasp, which are merged
    #[arg(long, value_name = "HAND")]
    pub hand: Vec<PathBuf>,
    /// How the mesh stands before the camera: what `align` writes
    #[arg(long, value_name = "FILE")]
    aligned: Vec<PathBuf>,
    /// Ids of the hand's vertices, where the file is a whole body: JSON, .npy or text
    #[arg(long, value_name = "FILE", requires = "hand")]
    hand_vertices: Option<PathBuf>,
    /// The hand stands in the file as in a mirror: a left one that was not turned back
    #[arg(long, requires = "hand")]
    hand_mirror: bool,
    /// The hand's mask in the picture: with --hand-depth alone it is the hand; it cuts the hand out of a whole body
    #[arg(long, value_name = "MASK[#LABEL]", requires = "hand_intrinsics")]
    pub hand_mask: Vec<String>,
    /// The depth image to which the hand is brought along its rays
    #[arg(long, value_name = "DEPTH", requires_all = ["hand_mask", "hand_intrinsics"])]
    hand_depth: Vec<PathBuf>,
    /// The camera of --hand-depth and --hand-mask
    #[arg(long, value_name = "K.json")]
    hand_intrinsics: Option<PathBuf>,
    /// The picture of --hand-mask, where there is no depth
    #[arg(long, value_name = "IMAGE", requires = "hand_mask")]
    hand_image: Vec<PathBuf>,
    /// Units of --hand-depth to the metre [default: 1000 for whole numbers, 1 for floats]
    #[arg(long, value_name = "N", requires = "hand_depth", allow_negative_numbers = true)]
    hand_depth_scale: Option<f64>,
    /// Focal length in pixels that the hand was made with, where it is not the camera's
    #[arg(long, value_name = "PIXELS", requires = "hand_depth", allow_negative_numbers = true)]
    hand_focal: Option<f64>,
}

impl HandOptions {
    /// Whether a hand was named.
    pub fn is_given(&self) -> bool {
        !(self.hand.is_empty() && self.hand_mask.is_empty())
    }

    /// The files that it reads.
    pub fn files(&self) -> Result<Vec<PathBuf>> {
        let poses = self.aligned.iter().cloned();
        let frames = self.frames(|_| Ok(None))?;
        Ok(frames.iter().flat_map(HandFiles::paths).map(Path::to_owned).chain(poses).collect())
    }

    /// The region that the hand touches, on `mesh`.
    pub fn region(&self, mesh: &Mesh) -> Result<TouchedRegion> {
        let files = self.frames(|path| Ok(Some(read_pose(path)?)))?;
        let frames: Vec<HandFrame> =
            files.iter().map(HandFiles::read).collect::<std::result::Result<_, _>>()?;
        region_of_hands(mesh, &frames, &ContactSettings::default()).context("--hand")
    }

    fn frames(&self, pose: impl Fn(&Path) -> Result<Option<Sim3>>) -> Result<Vec<HandFiles>> {
        let n = self.hand.len().max(self.hand_mask.len());
        if n == 0 && !self.aligned.is_empty() {
            bail!("--aligned: expected --hand or --hand-mask beside it, found neither");
        }
        let check = |flag: &str, found: usize| match found {
            found if found <= 1 || found == n => Ok(()),
            found => bail!("{flag}: expected 1 or {n}, one for each frame, found {found}"),
        };
        check("--hand", self.hand.len())?;
        check("--aligned", self.aligned.len())?;
        check("--hand-mask", self.hand_mask.len())?;
        check("--hand-depth", self.hand_depth.len())?;
        check("--hand-image", self.hand_image.len())?;
        let frame = |i: usize| {
            let mask = of_frame(&self.hand_mask, i);
            let seen = mask.zip(self.hand_intrinsics.as_ref()).map(|(mask, intrinsics)| {
                ObservationFiles {
                    color: of_frame(&self.hand_image, i).cloned(),
                    depth: of_frame(&self.hand_depth, i).cloned(),
                    depth_scale: self.hand_depth_scale,
                    calibration: intrinsics.clone(),
                    masks: vec![MaskFile::parse(mask)],
                    camera_from_world: None,
                }
            });
            Ok(HandFiles {
                hand: of_frame(&self.hand, i).cloned(),
                vertices: self.hand_vertices.clone(),
                is_mirrored: self.hand_mirror,
                seen,
                focal: self.hand_focal,
                camera_from_object: match of_frame(&self.aligned, i) {
                    Some(path) => pose(path)?,
                    None => None,
                },
            })
        };
        (0..n).map(frame).collect()
    }
}

/// The value of a frame: its own, or the only one.
fn of_frame<T>(values: &[T], frame: usize) -> Option<&T> {
    if values.len() == 1 { values.first() } else { values.get(frame) }
}
