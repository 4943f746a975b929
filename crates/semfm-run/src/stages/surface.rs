//! What a camera saw of an object without a mesh: what `surface` does.

use std::path::Path;
use std::sync::Arc;

use semfm::observe::{ObservationFiles, SurfaceSettings};
use semfm::{ObjectFrame, ObservedObject, Task};

use super::pose::{files_of_frame, files_of_target};
use super::transfer::{object_encoder, reads_views, settings};
use super::{StageContext, StageEnd};
use crate::Result;

/// The surface, its embeddings, and points of what was seen beside it.
pub const MESH_FILE: &str = "surface.ply";
pub const EMBEDDINGS_FILE: &str = "surface.emb.mcap";
pub const AROUND_FILE: &str = "around.ply";

/// The demonstrated object.
pub fn demonstration(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let frame = context.recipe.demonstration.frames.first().cloned().unwrap_or_default();
    let files = files_of_frame(&frame, frame.mask.as_deref());
    surface(context, &ObservationFiles { color: frame.color.clone(), ..files }, folder, task)
}

/// The target.
pub fn target(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let frame = context.recipe.target.frame.clone().unwrap_or_default();
    surface(context, &files_of_target(&frame, true), folder, task)
}

fn surface(
    context: &StageContext<'_>,
    files: &ObservationFiles,
    folder: &Path,
    task: &Task,
) -> Result<StageEnd> {
    let frame = ObjectFrame::of(Arc::new(files.read()?), None)?;
    let object = ObservedObject::new(vec![frame], &SurfaceSettings::default())?;
    let table = &context.recipe.transfer;
    let embeddings = match reads_views(table) {
        true => {
            let settings = settings(table, context.recipe.seed, context.cache);
            Some(object.embed(&object_encoder(context, &settings)?, None, task)?)
        }
        false => None,
    };
    let embeddings = embeddings.as_ref().map(|made| (&made.file, made.shown));
    object.write(folder, embeddings, task)?;
    let mesh = object.mesh();
    let (low, high) = mesh.bounds();
    let [x, y, z] = (1e3 * (high - low)).to_array();
    let size = format!("{} vertices, {x:.0} × {y:.0} × {z:.0} mm", mesh.n_vertices());
    Ok(StageEnd { summary: vec![format!("what the camera saw: {size}")], ..StageEnd::default() })
}
