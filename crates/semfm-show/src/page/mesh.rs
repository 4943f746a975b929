//! A mesh file as a group of the page, and regions on it.

use std::path::Path;

use semfm::files::read_region;
use semfm::geom::io::{FormatError, MeshFile, read_mesh};
use semfm::{Region, Task};

use super::group::{Fact, Group, Layer, Panel, VertexColors};
use crate::Result;

/// Of vertices without a colour.
pub(super) const GREY: [u8; 3] = [184; 3];

/// The last part of a path, as text.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// The mesh in its own colours.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for a file that is no mesh,
/// [`Error::Format`](crate::Error::Format) for a surface that cannot be drawn.
pub(super) fn mesh_group(path: &Path, task: &Task) -> Result<Group> {
    let file = read_mesh(path)?;
    let name = file_name(path);
    let layers = vec![Layer::own_colors(vertex_colors(&file))];
    let panel = Panel::new(&name, file.mesh, None, task).map_err(|error| {
        FormatError::new(path, "mesh", "a surface that can be drawn", error.to_string())
    })?;
    Ok(Group {
        title: name,
        facts: Vec::new(),
        panels: vec![panel],
        layers,
        notes: Vec::new(),
        source_of: None,
        pictures: Vec::new(),
        hands: None,
        motion: None,
    })
}

/// Puts a region in front of the other layers of a mesh, and looks at it from where it shows.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for a file that is no region of this mesh.
pub(super) fn add_region(group: &mut Group, path: &Path, task: &Task) -> Result<Region> {
    let panel = &mut group.panels[0];
    let region = read_region(path, &panel.mesh)?;
    let name = file_name(path);
    let n_inside = region.weights().iter().filter(|&&w| w >= Region::COUNTS).count();
    group.facts.push(Fact::new(name.clone(), format!("{n_inside} vertices")));
    let at = group.layers.len() - 1;
    if at == 0 {
        *panel = Panel::new(&panel.name, panel.mesh.clone(), Some(region.weights()), task)?;
    }
    let colors = vec![VertexColors::Weights(region.weights().to_vec())];
    group.layers.insert(at, Layer { name, legend: Vec::new(), colors });
    Ok(region)
}

/// Colours of the vertices as the file has them: its own, those of its images, or grey.
fn vertex_colors(file: &MeshFile) -> Vec<[u8; 3]> {
    let mut colors = vec![GREY; file.mesh.n_vertices()];
    if file.appearance.is_plain() {
        return colors;
    }
    for (face, &ids) in file.mesh.faces().iter().enumerate() {
        for (corner, &id) in ids.iter().enumerate() {
            let mut weights = [0.0; 3];
            weights[corner] = 1.0;
            let [r, g, b, _] = file.appearance.color_at(face, ids, weights);
            colors[id as usize] = [r, g, b];
        }
    }
    colors
}
