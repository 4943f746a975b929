//! `embed`: what an encoder makes of an object.

use std::sync::Arc;

use pyo3::prelude::*;
use semfm::Method;
use semfm::encoder::rendered_views::Coloring;

use crate::embeddings::Embeddings;
use crate::errors;
use crate::interruptible::run;
use crate::mesh::GivenObject;
use crate::prepared::encoder_of;
use crate::shape::cache_of;

/// Embeddings of an object's views by an encoder, as `transfer` and `prepare` make them.
///
/// Parameters
/// ----------
/// mesh : mesh_like or MeshFile
/// encoder : str, default "builtin"
///     ``builtin``, a ``.net`` file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON,
///     or ``package.module:Class``.
/// rolls : int, optional
///     Rotations of each view that are averaged, 1, 2 or 4; what the encoder wants where none is
///     given.
/// colors : bool, default False
///     Show the object in its own colours, where the encoder reads colours.
/// cache : cache, optional
///     Where embeddings are kept: a folder, or True for the user's own.
/// progress : progress, optional
///
/// Returns
/// -------
/// Embeddings
///
/// Examples
/// --------
/// >>> import semfm
/// >>> mug = semfm.demo_object("containers", n_vertices=500).mesh
/// >>> embeddings = semfm.embed(mug)
/// >>> embeddings.encoder, embeddings.n_views
/// ('builtin', 14)
#[pyfunction]
#[pyo3(signature = (mesh, *, encoder="builtin", rolls=None, colors=false, cache=None, progress=None))]
pub fn embed(
    py: Python<'_>,
    mesh: &Bound<'_, PyAny>,
    encoder: &str,
    rolls: Option<u32>,
    colors: bool,
    cache: Option<&Bound<'_, PyAny>>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Embeddings> {
    if let Some(rolls) = rolls.filter(|rolls| ![1, 2, 4].contains(rolls)) {
        return Err(errors::invalid(py, "rolls", "1, 2 or 4", &rolls.to_string()));
    }
    let object = GivenObject::of(mesh, "mesh")?;
    let most_rolls = Method::default().info().features.rolls;
    let encoder = encoder_of(py, Some(encoder), rolls, most_rolls, &cache_of(cache)?)?;
    let coloring = if colors { Coloring::Own } else { Coloring::Grey };
    let encoded = run(py, progress, move |task| encoder.embed(object.drawable(), coloring, task))?;
    Ok(Embeddings { inner: Arc::new(encoded.embeddings) })
}
