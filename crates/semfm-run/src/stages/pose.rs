//! The meshes found in the pictures: what `align` does.

use std::path::{Path, PathBuf};

use semfm::align::{AlignSettings, Alignment, Verdict, align};
use semfm::files::{AlignedFile, read_pose};
use semfm::geom::io::read_mesh;
use semfm::observe::{MaskFile, Observation, ObservationFiles};
use semfm::{Mesh, ObjectSize, Task};

use super::{StageContext, StageEnd, no_answer};
use crate::recipe::{AlignTable, DemonstrationFrame, TargetFrame};
use crate::{Result, Stage};

/// The pose of the demonstrated mesh in a frame: its file, and where in the recipe it is said how to change it.
pub struct AlignedFrame {
    pub path: PathBuf,
    pub is_made_here: bool,
}

/// Every frame of the demonstration whose pose is not told.
pub fn demonstration(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let demonstration = &context.recipe.demonstration;
    let mesh = read_mesh(context.source_mesh())?.mesh;
    let mut end = StageEnd::default();
    for (i, frame) in demonstration.frames.iter().enumerate() {
        if !demonstration.is_aligned_in(frame) {
            continue;
        }
        let seen = files_of_frame(frame, frame.mask.as_deref());
        let search = Search { table: &demonstration.align, init: frame.init.as_deref() };
        let name = aligned_name(i, demonstration.frames.len());
        let of_frame = Aligned { mesh: &mesh, files: &seen, seed: context.recipe.seed, search };
        let found = of_frame.write(&folder.join(name), task)?;
        end.add(&mesh, &found);
        if found.verdict == Verdict::Refuse && !demonstration.use_refused {
            let place = format!("demonstration.frames[{i}]");
            end.refuse(&found, &place, "demonstration");
            break;
        }
    }
    Ok(end)
}

/// The target.
pub fn target(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let target = &context.recipe.target;
    let mesh = read_mesh(context.target_mesh())?.mesh;
    let frame = target.frame.clone().unwrap_or_default();
    let seen = files_of_target(&frame, false);
    let search = Search { table: &target.align, init: frame.init.as_deref() };
    let aligned = Aligned { mesh: &mesh, files: &seen, seed: context.recipe.seed, search };
    let found = aligned.write(&folder.join(ALIGNED_FILE), task)?;
    let mut end = StageEnd::default();
    end.add(&mesh, &found);
    if found.verdict == Verdict::Refuse && !target.use_refused {
        end.refuse(&found, "target.frame", "target");
    }
    Ok(end)
}

/// The file of a pose.
pub const ALIGNED_FILE: &str = "aligned.json";

/// The file of a frame's pose: `aligned.json`, with the frame's number where there are several.
fn aligned_name(frame: usize, n_frames: usize) -> String {
    if n_frames == 1 { ALIGNED_FILE.into() } else { format!("aligned_{frame}.json") }
}

/// The pose of the demonstrated mesh in a frame, told or found; `None` where there is none.
pub fn aligned_of_frame(context: &StageContext<'_>, frame: usize) -> Option<AlignedFrame> {
    let demonstration = &context.recipe.demonstration;
    let frames = &demonstration.frames;
    let of_frame = frames.get(frame)?;
    if let Some(path) = &of_frame.aligned {
        return Some(AlignedFrame { path: path.clone(), is_made_here: false });
    }
    let name = aligned_name(frame, frames.len());
    let path = context.file(Stage::DemonstrationPose, &name);
    demonstration.is_aligned_in(of_frame).then_some(AlignedFrame { path, is_made_here: true })
}

/// The files of a frame of the demonstration with one of its masks.
pub fn files_of_frame(frame: &DemonstrationFrame, mask: Option<&Path>) -> ObservationFiles {
    ObservationFiles {
        color: frame.color.clone().filter(|_| frame.depth.is_none()),
        depth: frame.depth.clone(),
        depth_scale: frame.depth_scale,
        calibration: frame.intrinsics.clone().unwrap_or_default(),
        masks: mask.into_iter().map(mask_file).collect(),
        camera_from_world: None,
    }
}

pub fn files_of_target(frame: &TargetFrame, with_color: bool) -> ObservationFiles {
    ObservationFiles {
        color: frame.color.clone().filter(|_| with_color),
        depth: frame.depth.clone(),
        depth_scale: frame.depth_scale,
        calibration: frame.intrinsics.clone().unwrap_or_default(),
        masks: frame.mask.as_deref().into_iter().map(mask_file).collect(),
        camera_from_world: None,
    }
}

/// `FILE` or `FILE#LABEL`.
fn mask_file(path: &Path) -> MaskFile {
    MaskFile::parse(&path.to_string_lossy())
}

/// What the page shows of a frame of the demonstration: colour with the masks of object, hand and region; `None` without a
/// colour picture or a camera.
pub fn observation_of_frame(frame: &DemonstrationFrame) -> Result<Option<Observation>> {
    if frame.color.is_none() || frame.intrinsics.is_none() {
        return Ok(None);
    }
    let masks = [&frame.mask, &frame.hand_mask, &frame.region_mask];
    let files = ObservationFiles {
        color: frame.color.clone(),
        masks: masks.into_iter().flatten().map(|path| mask_file(path)).collect(),
        ..files_of_frame(frame, None)
    };
    Ok(Some(files.read()?))
}

/// The same of the target.
pub fn observation_of_target(frame: &TargetFrame) -> Result<Option<Observation>> {
    if frame.color.is_none() || frame.intrinsics.is_none() {
        return Ok(None);
    }
    Ok(Some(files_of_target(frame, true).read()?))
}

/// How a mesh is looked for.
struct Search<'a> {
    table: &'a AlignTable,
    init: Option<&'a Path>,
}

/// A mesh that is looked for in an observation.
struct Aligned<'a> {
    mesh: &'a Mesh,
    files: &'a ObservationFiles,
    seed: u64,
    search: Search<'a>,
}

impl Aligned<'_> {
    /// Looks for it and writes its pose.
    fn write(&self, path: &Path, task: &Task) -> Result<Alignment> {
        let seen = self.files.read()?;
        let observed = seen.observed_cloud(seen.masks().first())?;
        let defaults = AlignSettings::default();
        let settings = AlignSettings {
            init: self.search.init.map(read_pose).transpose()?,
            scale_range: self.search.table.scale_range,
            n_starts: self.search.table.starts.unwrap_or(defaults.n_starts),
            seed: self.seed,
        };
        let found = align(self.mesh, &observed, &settings, task).map_err(semfm::Error::from)?;
        AlignedFile::new(&found, self.mesh, &settings).write(path)?;
        Ok(found)
    }
}

impl StageEnd {
    /// Tells what was found.
    fn add(&mut self, mesh: &Mesh, found: &Alignment) {
        let scale = found.camera_from_object.scale;
        self.summary.push(format!(
            "{}: {:.0} % of the points on the model, residual {:.1} mm, object {}",
            found.verdict,
            100.0 * found.inlier_share,
            1e3 * found.residual_m,
            ObjectSize::of(mesh, scale)
        ));
        self.summary.extend(found.reasons.iter().cloned());
    }

    fn refuse(&mut self, found: &Alignment, place: &str, table: &str) {
        let reasons = match found.reasons.as_slice() {
            [] => "no pose explains what was seen".to_owned(),
            reasons => reasons.join("; "),
        };
        self.no_answer = no_answer(
            format!("the mesh was not found in the depth image: {reasons}"),
            format!(
                "look at the page: does {place}.mask show the object alone, and is {place}.depth_scale right? A guess of the \
                 pose ({place}.init) or {table}.align.scale_range narrows the search; {table}.use_refused = true goes on \
                 all the same"
            ),
        );
    }
}
