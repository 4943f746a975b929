//! Pictures (PNG) of meshes, transfers and grasps, for notebooks: those that the shell writes to files.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use semfm::Task;
use semfm::views::{RenderSettings, SurfaceColor, render};
use semfm::weight_colors::weight_colors;
use semfm_show::{Viewpoints, viewpoints, write_sheet};

use crate::interruptible::run;

/// Side of each of the two pictures of a mesh, in pixels.
const SIDE: u32 = 320;

/// The bytes of the picture that `draw` writes.
pub fn png<'py>(
    py: Python<'py>,
    draw: impl FnOnce(&Path, &Task) -> semfm::Result<()> + Send + 'static,
) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = run(py, None, move |task| {
        let failed = |source| semfm_geom::Error::Io { path: std::env::temp_dir(), source };
        let folder = tempfile::tempdir().map_err(failed)?;
        let path = folder.path().join("picture.png");
        draw(&path, task)?;
        Ok(std::fs::read(&path).map_err(failed)?)
    })?;
    Ok(PyBytes::new(py, &bytes))
}

/// What a notebook shows: the picture, or nothing where it cannot be drawn; the text stands there in any
/// case.
pub fn shown(picture: PyResult<Bound<'_, PyBytes>>) -> Option<Bound<'_, PyBytes>> {
    picture.ok()
}

/// A mesh with a weight per vertex, from where the weights are seen best and from another side.
pub fn write_mesh_picture(
    path: &Path,
    mesh: &semfm::Mesh,
    weights: &[f64],
    task: &Task,
) -> semfm::Result<()> {
    let Viewpoints { best, other, .. } = viewpoints(mesh, weights, SIDE, task)?;
    let colors = weight_colors(weights);
    let paint = SurfaceColor::Vertices(&colors);
    let views = render(mesh, &paint, &[best, other], &RenderSettings::default(), task)?;
    Ok(write_sheet(path, &views, 2)?)
}
