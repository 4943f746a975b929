//! Objects as files, as a real object has them, with simulated embeddings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use semfm_geom::io::{write_json, write_mesh};
use semfm_geom::{MeshIdentity, Task};
use semfm_views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, ViewsMetadata};
use semfm_views::{RenderSettings, RigSettings, SurfaceColor, View, render, rig};

use crate::{Level, Result, SynthObject, embed};

/// Where the files of an object are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectFiles {
    /// The mesh, `NAME.obj`.
    pub mesh: PathBuf,
    /// Its true grip region and its parts, `NAME.json`.
    pub truth: PathBuf,
    /// Its embeddings, `NAME.emb.mcap`.
    pub embeddings: PathBuf,
}

/// The pictures that the simulated encoder is shown: the default rig and light, in grey.
///
/// # Errors
/// [`Error::Views`](crate::Error::Views) for a mesh that cannot be rendered, which a procedural
/// object never causes, and for a cancelled task.
pub fn render_views(object: &SynthObject, task: &Task) -> Result<Vec<View>> {
    let cameras = rig(&object.mesh, &RigSettings::default())?;
    let settings = RenderSettings::default();
    Ok(render(&object.mesh, &SurfaceColor::default(), &cameras, &settings, task)?)
}

/// Writes `NAME.obj`, `NAME.json` and `NAME.emb.mcap` into `folder`, which must exist.
///
/// The three are what an evaluation folder holds of a labelled object, and the embeddings say that
/// they are simulated. The same object and level give the same bytes at every thread count.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) and [`Error::Views`](crate::Error::Views) where a file
/// cannot be written; [`Error::Views`](crate::Error::Views) for a cancelled task.
pub fn write_object(
    folder: &Path,
    object: &SynthObject,
    level: Level,
    task: &Task,
) -> Result<ObjectFiles> {
    let views = render_views(object, task)?;
    let embeddings = EmbeddingsFile {
        path: PathBuf::new(),
        metadata: metadata(object, level),
        views: embed(object, &views, level)?,
    };
    let files = write_labelled_mesh(folder, object)?;
    embeddings.write(&files.embeddings, Dtype::F16)?;
    Ok(files)
}

/// Writes `NAME.obj` and `NAME.json` into `folder`, which must exist. The embeddings are for the
/// caller to make and to write where the answer says.
///
/// # Errors
/// [`Error::Geom`](crate::Error::Geom) where a file cannot be written.
pub fn write_labelled_mesh(folder: &Path, object: &SynthObject) -> Result<ObjectFiles> {
    let name = object.name();
    let [mesh, truth, embeddings] =
        ["obj", "json", "emb.mcap"].map(|extension| folder.join(format!("{name}.{extension}")));
    let files = ObjectFiles { mesh, truth, embeddings };
    write_mesh(&files.mesh, &object.mesh)?;
    write_json(&files.truth, &truth_of(object))?;
    Ok(files)
}

/// The truth about an object as evaluation reads it.
fn truth_of(object: &SynthObject) -> serde_json::Value {
    let mut parts: BTreeMap<&str, Vec<usize>> =
        object.part_names.iter().map(|&name| (name, Vec::new())).collect();
    for (id, &part) in object.parts.iter().enumerate() {
        parts.entry(object.part_names[usize::from(part)]).or_default().push(id);
    }
    let grip: Vec<usize> = (0..object.region.len()).filter(|&id| object.region[id]).collect();
    serde_json::json!({
        "object": object.name(),
        "category": object.category.name(),
        "kind": object.kind,
        "n_vertices": object.mesh.n_vertices(),
        "n_faces": object.mesh.n_faces(),
        "source": "procedural",
        "region": { "name": "grip", "vertices": grip },
        "parts": parts,
    })
}

fn metadata(object: &SynthObject, level: Level) -> EmbeddingsMetadata {
    let rig = RigSettings::default();
    EmbeddingsMetadata {
        views: ViewsMetadata {
            mesh: MeshIdentity::of(&object.mesh),
            width: rig.size,
            height: rig.size,
            rig: rig.to_string(),
            background: "white".into(),
            seed: object.seed,
            more: BTreeMap::new(),
        },
        encoder: format!("simulated/{level}"),
        revision: env!("CARGO_PKG_VERSION").into(),
        preprocessing: "none: parts, not pictures, are encoded".into(),
        rolls: 1,
        outliers: "none".into(),
        simulated: true,
    }
}
