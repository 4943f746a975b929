//! Objects as files: the road that a real object takes, with simulated embeddings at its end.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use semfm_geom::Task;
use semfm_geom::io::{write_atomically, write_mesh};
use semfm_views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, MeshIdentity, ViewsMetadata};
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
/// As [`rig()`] and [`render()`], which a procedural object never causes; cancellation.
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
/// cannot be written, and cancellation.
pub fn write_object(
    folder: &Path,
    object: &SynthObject,
    level: Level,
    task: &Task,
) -> Result<ObjectFiles> {
    let name = object.name();
    let path = |extension: &str| folder.join(format!("{name}.{extension}"));
    let files =
        ObjectFiles { mesh: path("obj"), truth: path("json"), embeddings: path("emb.mcap") };
    let views = render_views(object, task)?;
    let embeddings = EmbeddingsFile {
        path: PathBuf::new(),
        metadata: metadata(object, level),
        views: embed(object, &views, level)?,
    };
    write_mesh(&files.mesh, &object.mesh)?;
    write_atomically(&files.truth, |out| writeln!(out, "{}", truth(object)))?;
    embeddings.write(&files.embeddings, Dtype::F16)?;
    Ok(files)
}

/// The truth about an object as evaluation reads it.
fn truth(object: &SynthObject) -> serde_json::Value {
    let ids_where = |holds: &dyn Fn(usize) -> bool| -> Vec<usize> {
        (0..object.mesh.n_vertices()).filter(|&id| holds(id)).collect()
    };
    let parts: BTreeMap<&str, Vec<usize>> = object
        .part_names
        .iter()
        .enumerate()
        .map(|(part, &name)| (name, ids_where(&|id| usize::from(object.parts[id]) == part)))
        .collect();
    serde_json::json!({
        "object": object.name(),
        "category": object.category.name(),
        "kind": object.kind,
        "n_vertices": object.mesh.n_vertices(),
        "n_faces": object.mesh.n_faces(),
        "source": "procedural",
        "region": { "name": "grip", "vertices": ids_where(&|id| object.region[id]) },
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
            rig: format!("{rig:?}"),
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
