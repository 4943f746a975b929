//! Where the demonstration touched: what `region` does.

use std::path::Path;

use semfm::align::Sim3;
use semfm::demonstration::{
    GrownRegion, grow_region, merge_regions, region_around_contact, region_of_hands,
    region_under_mask,
};
use semfm::files::{read_pose, read_region, write_region};
use semfm::geom::io::{read_mesh, write_json, write_mesh};
use semfm::geom::math::{DAffine3, DMat3, DMat4, DVec3};
use semfm::observe::{ContactReport, ContactSettings, HandFiles, HandFrame};
use semfm::{Mesh, Region};

use super::pose::{aligned_of_frame, files_of_frame};
use super::{StageContext, StageEnd};
use crate::Result;
use crate::recipe::DemonstrationFrame;

/// What the hand touched (`semfm.contact/1`), and the first frame's hand as it rests on the mesh, in its frame and unit.
pub const CONTACT_FILE: &str = "contact.json";
pub const HAND_FILE: &str = "hand.ply";
/// The region.
pub const REGION_FILE: &str = "region.json";

/// Marks the region.
pub fn region(context: &StageContext<'_>, folder: &Path) -> Result<StageEnd> {
    let demonstration = &context.recipe.demonstration;
    let mesh = read_mesh(context.source_mesh())?.mesh;
    let mut end = StageEnd::default();
    let mut region = if let Some(path) = &demonstration.region {
        read_region(path, &mesh)?
    } else if let (Some(near), Some(radius)) = (demonstration.near, demonstration.radius) {
        region_around_contact(&mesh, DVec3::from_array(near), radius)?
    } else if demonstration.frames.iter().any(DemonstrationFrame::has_hand) {
        touched(context, &mesh, folder, &mut end)?
    } else {
        let frames = demonstration.frames.iter().enumerate();
        let seen = frames.map(|(i, frame)| masked(context, &mesh, i, frame));
        merge_regions(seen.collect::<Result<Vec<Region>>>()?)?
    };
    if demonstration.grow {
        let grown: GrownRegion = grow_region(&mesh, &region, None)?;
        end.summary.push(format!("completed by {} vertices", grown.n_added));
        region = grown.region;
    }
    write_region(&folder.join(REGION_FILE), &region, &mesh)?;
    let (n, of) = (region.vertices().len(), region.n_vertices());
    end.summary.insert(0, format!("{n} of {of} vertices"));
    Ok(end)
}

/// What the hands of the frames touch.
fn touched(
    context: &StageContext<'_>,
    mesh: &Mesh,
    folder: &Path,
    end: &mut StageEnd,
) -> Result<Region> {
    let frames = context.recipe.demonstration.frames.iter().enumerate();
    let frames = frames.map(|(i, frame)| hand_frame(context, i, frame));
    let frames: Vec<HandFrame> = frames.collect::<Result<_>>()?;
    let touched = region_of_hands(mesh, &frames, &ContactSettings::default())?;
    write_json(folder.join(CONTACT_FILE), &touched.report)?;
    if let Some(hand) = frames.first().and_then(|frame| resting_hand(frame, &touched.report)) {
        write_mesh(folder.join(HAND_FILE), &hand)?;
    }
    end.summary.extend(touched.report.lines());
    Ok(touched.region)
}

/// A hand with the pose of the mesh in its frame.
fn hand_frame(
    context: &StageContext<'_>,
    i: usize,
    frame: &DemonstrationFrame,
) -> Result<HandFrame> {
    let has_picture = frame.depth.is_some() || frame.color.is_some();
    let is_seen = frame.hand_mask.is_some() && frame.intrinsics.is_some() && has_picture;
    let pose = aligned_of_frame(context, i).map(|aligned| read_pose(&aligned.path)).transpose()?;
    let files = HandFiles {
        hand: frame.hand.clone(),
        vertices: frame.hand_vertices.clone(),
        is_mirrored: frame.hand_mirror,
        seen: is_seen.then(|| files_of_frame(frame, frame.hand_mask.as_deref())),
        focal: frame.hand_focal,
        camera_from_object: pose,
    };
    Ok(files.read()?)
}

/// The hand in the mesh's frame and unit, moved as it was found to rest; `None` for points without faces.
fn resting_hand(frame: &HandFrame, report: &ContactReport) -> Option<Mesh> {
    let moved = DVec3::from_array(report.frames.first()?.hand_moved_mm) / 1e3;
    let (object_from_hand, unit) = match &frame.camera_from_object {
        Some(pose) => (affine(&pose.inverse()), pose.scale),
        None => (DAffine3::IDENTITY, 1.0),
    };
    let hand = frame.hand.transformed(&object_from_hand);
    let points = hand.points().iter().map(|&p| p + moved / unit).collect();
    Mesh::new(points, hand.faces().to_vec()).ok().filter(|mesh| mesh.n_faces() > 0)
}

fn affine(motion: &Sim3) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array_2d(&motion.to_rows()).transpose())
}

/// What a camera saw inside the mask of the region.
fn masked(
    context: &StageContext<'_>,
    mesh: &Mesh,
    i: usize,
    frame: &DemonstrationFrame,
) -> Result<Region> {
    let seen = files_of_frame(frame, frame.region_mask.as_deref()).read()?;
    let pose = aligned_of_frame(context, i).map(|aligned| read_pose(&aligned.path)).transpose()?;
    let pose = pose.unwrap_or(Sim3::IDENTITY);
    // A camera has no scale: the mesh is made as large as it is before it.
    let points = mesh.vertices().iter().map(|&p| pose.scale * p).collect();
    let in_metres = Mesh::new(points, mesh.faces().to_vec())?;
    let rigid = DAffine3::from_mat3_translation(DMat3::from_quat(pose.rotation), pose.translation);
    let camera = seen.camera().posed(rigid)?;
    let marked = seen.masks().first().map(|mask| &mask.marked[..]).unwrap_or_default();
    Ok(region_under_mask(&in_metres, &camera, marked)?)
}
