//! `semfm-cli region`: mark where the demonstration touched.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{ArgGroup, Args};
use semfm::demonstration::{
    GrownRegion, grow_region, merge_regions, region_around_contact, region_of_paint,
    region_under_mask,
};
use semfm::files::{read_region, write_region};
use semfm::geom::Pinhole;
use semfm::geom::io::read_mesh;
use semfm::geom::math::DVec3;
use semfm::observe::{MaskFile, MaskedPicture};
use semfm::views::mcap::{SingleView, read_view};
use semfm::{Mesh, Region};

use super::Outcome;
use super::hand_options::HandOptions;
use crate::console;
use crate::options::{Common, numbers};
use crate::output::OutputFile;

/// Mark a region on a mesh: by a contact and a radius, a mask in a view, a hand that touches it, paint, or vertex ids
///
/// A mask shows one side of a part: --grow adds the side that the camera did not see.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("how").required(true).multiple(true).args(["near", "mask", "ply_color", "vertices", "region", "hand", "hand_mask"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli region mug.obj -o grip.json --near 0.05,0,0.04 --radius 0.03\n  \
    semfm-cli region mug.obj -o grip.json --mask grip.png --view mug.views.mcap#003 --grow\n  \
    semfm-cli region mug.obj -o grip.json --hand hand.obj --aligned aligned.json --hand-depth depth.png \
    --hand-mask hand.png --hand-intrinsics K.json\n  \
    semfm-cli region painted.ply -o grip.json --ply-color")]
pub struct RegionCommand {
    /// The mesh
    mesh: PathBuf,
    /// Where to write the region (JSON); `-` is stdout
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// A contact point in the mesh's frame and units; needs --radius
    #[arg(
        long,
        value_name = "X,Y,Z",
        requires = "radius",
        conflicts_with_all = ["mask", "ply_color", "vertices", "region", "hand", "hand_mask"],
        allow_hyphen_values = true,
        help_heading = "How"
    )]
    near: Option<String>,
    /// Geodesic radius around the contact, in the mesh's units
    #[arg(
        long,
        value_name = "LENGTH",
        requires = "near",
        allow_negative_numbers = true,
        help_heading = "How"
    )]
    radius: Option<f64>,
    /// A mask of the size of a view (a picture that is bright, or opaque, where the region is; .npy; COCO's run lengths;
    /// or one label of a picture of labels); needs --view. Several masks, each with its view, are merged
    #[arg(long, value_name = "MASK[#LABEL]", requires = "view", conflicts_with_all = ["ply_color", "vertices", "region", "hand", "hand_mask"], help_heading = "How")]
    mask: Vec<String>,
    /// The view of the mask: a views file and a number
    #[arg(long, value_name = "V.views.mcap#NNN", requires = "mask", help_heading = "How")]
    view: Vec<String>,
    /// The vertices painted red, or in the colour given
    #[arg(long, value_name = "R,G,B", num_args = 0..=1, default_missing_value = "red", conflicts_with_all = ["vertices", "region", "hand", "hand_mask"], help_heading = "How")]
    ply_color: Option<String>,
    /// Vertex ids, 0-based
    #[arg(long, value_name = "ID,ID,…", value_delimiter = ',', conflicts_with_all = ["region", "hand", "hand_mask"], help_heading = "How")]
    vertices: Option<Vec<u32>>,
    /// A region that is there already (JSON), to be completed with --grow
    #[arg(long, value_name = "FILE", requires = "grow", conflicts_with_all = ["hand", "hand_mask"], help_heading = "How")]
    region: Option<PathBuf>,
    /// Complete what one camera saw to the part that it belongs to; a region that is known all around
    /// stays as it is
    #[arg(long, help_heading = "How")]
    grow: bool,
    #[command(flatten)]
    hand: HandOptions,
}

impl RegionCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let view_file =
            |view: &String| PathBuf::from(view.rsplit_once('#').map_or(&view[..], |v| v.0));
        let masks: Vec<MaskFile> = self.mask.iter().map(|mask| MaskFile::parse(mask)).collect();
        let views: Vec<PathBuf> = self.view.iter().map(view_file).collect();
        let mut inputs = vec![self.mesh.as_path()];
        inputs.extend(masks.iter().map(|mask| mask.path.as_path()));
        inputs.extend(views.iter().map(PathBuf::as_path).chain(self.region.as_deref()));
        let hand_files = self.hand.files()?;
        inputs.extend(hand_files.iter().map(PathBuf::as_path));
        let output = OutputFile::new(&self.output, &inputs, common)?;
        let file = read_mesh(&self.mesh)?;
        output.check_again()?;
        let mut camera = None;
        let mut region = if let (Some(near), Some(radius)) = (&self.near, self.radius) {
            let [x, y, z] = numbers(near).context("--near: expected three numbers, X,Y,Z")?;
            region_around_contact(&file.mesh, DVec3::new(x, y, z), radius)
                .with_context(|| self.mesh.display().to_string())?
        } else if !masks.is_empty() {
            if masks.len() != self.view.len() {
                let (n, found) = (masks.len(), self.view.len());
                bail!("--view: expected {n}, one for each --mask, found {found}");
            }
            let pairs = masks.iter().zip(&self.view);
            let seen: Vec<SeenRegion> = pairs
                .map(|(mask, view)| from_mask(&file.mesh, mask, view))
                .collect::<Result<_>>()?;
            if let [seen] = &seen[..] {
                camera = Some(seen.camera);
            }
            merge_regions(seen.into_iter().map(|seen| seen.region))?
        } else if self.hand.is_given() {
            let touched = self.hand.region(&file.mesh)?;
            if !common.quiet {
                touched.report.lines().iter().for_each(console::message);
            }
            if common.json {
                console::data(serde_json::to_string(&touched.report)?);
            }
            touched.region
        } else if let Some(path) = &self.region {
            read_region(path, &file.mesh)?
        } else if let Some(paint) = &self.ply_color {
            let paint = match paint.as_str() {
                "red" => None,
                text => Some(numbers(text).context("--ply-color: expected R,G,B, each 0 to 255")?),
            };
            region_of_paint(file.appearance.vertex_colors.as_deref(), paint)
                .with_context(|| self.mesh.display().to_string())?
        } else {
            let ids = self.vertices.unwrap_or_default();
            Region::from_vertices(file.mesh.n_vertices(), &ids).context("--vertices")?
        };
        if self.grow {
            region = grown(&file.mesh, &region, camera.as_ref(), common)?;
        }
        write_region(output.path(), &region, &file.mesh)?;
        if !common.quiet {
            let (inside, of) = (region.vertices().len(), region.n_vertices());
            console::message(format_args!("{inside} of {of} vertices"));
        }
        output.finish(common)?;
        Ok(Outcome::Done)
    }
}

/// A region completed to the part that it belongs to, with a line that says what came of it.
pub fn grown(
    mesh: &Mesh,
    region: &Region,
    camera: Option<&Pinhole>,
    common: &Common,
) -> Result<Region> {
    let GrownRegion { region, n_added, visible_share } =
        grow_region(mesh, region, camera).context("--grow")?;
    if !common.quiet {
        match (n_added, visible_share) {
            (0, Some(share)) => console::message(format_args!(
                "--grow added nothing: one camera sees at most {:.0} % of the region",
                100.0 * share
            )),
            _ => console::message(format_args!("--grow added {n_added} vertices")),
        }
    }
    Ok(region)
}

/// What a camera saw inside a mask.
struct SeenRegion {
    region: Region,
    camera: Pinhole,
}

fn from_mask(mesh: &Mesh, mask: &MaskFile, view: &str) -> Result<SeenRegion> {
    let Some((path, number)) = view.rsplit_once('#') else {
        bail!("--view: expected V.views.mcap#NNN, found `{view}`");
    };
    let number = number
        .parse()
        .with_context(|| format!("--view: expected a number after #, found `{number}`"))?;
    let path = Path::new(path);
    let SingleView { metadata, view } = read_view(path, number)?;
    metadata.check_mesh(mesh, path)?;
    let (width, height) = (view.camera.width(), view.camera.height());
    let marked = mask.read(MaskedPicture { width, height, name: "the view" })?;
    let region = region_under_mask(mesh, &view.camera, &marked)
        .with_context(|| mask.path.display().to_string())?;
    Ok(SeenRegion { region, camera: view.camera })
}
