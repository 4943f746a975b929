//! Pictures (PNG) of meshes, transfers and grasps, for notebooks: those that the shell writes to files.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use semfm::ObservedObject;
use semfm::Task;
use semfm::observe::Observation;
use semfm::views::{RenderSettings, RigSettings, SurfaceColor, View, camera_towards, render};
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

/// A surface that cameras saw, from where the first of them stood and in the pictures' colours, where there are some.
pub fn write_observed_picture(
    path: &Path,
    seen: &ObservedObject,
    task: &Task,
) -> semfm::Result<()> {
    let mesh = seen.mesh();
    let (low, high) = mesh.bounds();
    let camera = seen.cameras()?.remove(0);
    let up = -camera.camera_from_world().matrix3.row(1);
    let towards = camera.eye() - (low + high) / 2.0;
    let settings = RigSettings { size: SIDE, ..RigSettings::default() };
    let camera = camera_towards(mesh, towards, up, &settings)?;
    let colors = seen.colors().unwrap_or_default().iter();
    let colors: Vec<[f32; 3]> = colors.map(|c| c.map(|x| f32::from(x) / 255.0)).collect();
    let paint =
        if colors.is_empty() { SurfaceColor::GREY } else { SurfaceColor::Vertices(&colors) };
    let views = render(mesh, &paint, &[camera], &RenderSettings::default(), task)?;
    Ok(write_sheet(path, &views, 1)?)
}

/// What a camera saw as a picture: its colours, else its depth from near (dark) to far, white where nothing came back.
pub fn view_of_observation(seen: &Observation) -> View {
    let camera = *seen.camera();
    let n_pixels = camera.width() as usize * camera.height() as usize;
    let rgb = match (seen.color(), seen.depth()) {
        (Some(color), _) => color.as_flattened().to_vec(),
        (None, Some(depth)) => grey_of_depth(depth.metres()),
        (None, None) => vec![255; 3 * n_pixels],
    };
    View { camera, rgb, depth: vec![f32::INFINITY; n_pixels], triangles: vec![-1; n_pixels] }
}

fn grey_of_depth(metres: &[f32]) -> Vec<u8> {
    let seen = metres.iter().copied().filter(|&z| z > 0.0);
    let (near, far) = seen.fold((f32::INFINITY, 0f32), |(a, b), z| (a.min(z), b.max(z)));
    let grey = |&z: &f32| match z > 0.0 {
        true => (220.0 * (z - near) / (far - near).max(f32::MIN_POSITIVE)) as u8,
        false => 255,
    };
    metres.iter().map(grey).flat_map(|grey| [grey; 3]).collect()
}
