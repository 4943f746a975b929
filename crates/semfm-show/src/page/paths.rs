//! What each path given to `show` becomes.

use std::path::{Path, PathBuf};

use semfm::Region;
use semfm::geom::Task;
use semfm::geom::io::{MeshFile, MeshFormat, read_mesh};
use semfm::region_file::{self, read_region};
use serde_json::Value;

use super::grasps::grasps_group;
use super::transfer_folder::{read_json, transfer_groups};
use super::{Group, Layer, Paint, Panel};
use crate::{Error, Result};

/// What `show` takes, for its messages.
const EXPECTED: &str = "the folder that `transfer -o` wrote, a mesh (OBJ, PLY, STL, OFF, glTF or GLB), \
    a region or grasps (JSON) after their mesh, or a views file (MCAP)";

/// The groups of all paths: one for each folder of a transfer (and one for its grasps), mesh and views
/// file; a region file is shown on the mesh before it, a file of grasps beside it.
///
/// # Errors
/// Whatever is missing in a folder or wrong with a file; [`Error::Format`] for anything else, with what
/// it is and what would be taken.
pub fn groups_of_paths(paths: &[PathBuf], task: &Task) -> Result<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::new();
    // The group of the mesh that regions and grasps belong to, and the last region on it.
    let mut mesh: Option<(usize, Option<Region>)> = None;
    for path in paths {
        if !path.is_dir() && extension(path) == "json" {
            let Some((at, region)) = &mut mesh else { return Err(json_alone(path)) };
            if is_grasps(path)? {
                let weights = region.as_ref().map(Region::weights);
                groups.extend(grasps_group(path, &groups[*at].panels[0].mesh, weights, task)?);
            } else {
                *region = Some(add_region(&mut groups[*at], path, task)?);
            }
            continue;
        }
        mesh = None;
        if path.is_dir() {
            groups.extend(groups_of_folder(path, task)?);
        } else if extension(path) == "mcap" {
            groups.push(group_of_mcap(path, task)?);
        } else {
            mesh = Some((groups.len(), None));
            groups.push(mesh_group(path, task)?);
        }
    }
    Ok(groups)
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

fn fault(path: &Path, place: &str, found: &str) -> Error {
    Error::Format {
        path: path.to_owned(),
        place: place.into(),
        expected: EXPECTED.into(),
        found: found.into(),
    }
}

/// A JSON file that stands where it cannot be shown, with what it is if it says so.
fn json_alone(path: &Path) -> Error {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(source) => return semfm::geom::Error::Io { path: path.to_owned(), source }.into(),
    };
    let value: Value = serde_json::from_slice(&bytes).unwrap_or_default();
    match value["format"].as_str() {
        Some(region_file::FORMAT) => fault(path, "file", "a region without a mesh before it"),
        Some(format) => fault(path, "format", &format!("`{format}`")),
        None => fault(path, "file", "JSON without a mesh before it"),
    }
}

/// Whether a JSON file says that it holds grasps.
fn is_grasps(path: &Path) -> Result<bool> {
    let value: Value = read_json(path)?;
    Ok(value["format"] == "semfm.grasps/1")
}

fn groups_of_folder(folder: &Path, task: &Task) -> Result<Vec<Group>> {
    if folder.join("report.json").is_file() {
        return transfer_groups(folder, task);
    }
    // The folder of a demonstration.
    let inner = folder.join("transfer");
    if inner.join("report.json").is_file() {
        return transfer_groups(&inner, task);
    }
    let found = match folder.join("results.json").is_file() {
        true => "an evaluation, which has its own page: index.html",
        false => "a folder without report.json",
    };
    Err(fault(folder, "folder", found))
}

#[cfg(feature = "mcap")]
fn group_of_mcap(path: &Path, task: &Task) -> Result<Group> {
    let report = semfm::views::mcap::inspect(path)?;
    let format = report.semfm.as_ref().and_then(|entries| entries.get("format"));
    match format.map(String::as_str) {
        Some("semfm.views/1") => super::views::views_group(path, task),
        Some("semfm.embeddings/1") => {
            Err(fault(path, "format", "embeddings, which hold no pictures: show their views file"))
        }
        Some("semfm.transfer/1") => {
            Err(fault(path, "format", "a scene for Foxglove: show the folder that it lies in"))
        }
        Some(format) => Err(fault(path, "format", &format!("`{format}`"))),
        None => Err(fault(path, "metadata", "an MCAP file that another program wrote")),
    }
}

#[cfg(not(feature = "mcap"))]
fn group_of_mcap(path: &Path, _task: &Task) -> Result<Group> {
    Err(fault(path, "file", "MCAP, which this build does not read"))
}

fn mesh_group(path: &Path, task: &Task) -> Result<Group> {
    match read_mesh(path) {
        Ok(file) => group_of_mesh(path, file, task),
        // A file without a telling name may be a mesh, or anything.
        Err(error @ semfm::geom::Error::Io { .. }) => Err(error.into()),
        Err(error) if MeshFormat::from_path(path).is_some() => Err(error.into()),
        Err(_) => Err(fault(path, "file", "something else")),
    }
}

fn group_of_mesh(path: &Path, file: MeshFile, task: &Task) -> Result<Group> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let layer = Layer {
        name: "colours".into(),
        legend: Vec::new(),
        paints: vec![Paint::Colors(own_colors(&file))],
    };
    let panel = Panel::new(&name, file.mesh, None, task).map_err(|error| Error::Format {
        path: path.to_owned(),
        place: "mesh".into(),
        expected: "a surface that can be drawn".into(),
        found: error.to_string(),
    })?;
    Ok(Group {
        panels: vec![panel],
        title: name,
        facts: Vec::new(),
        layers: vec![layer],
        source_of: None,
        pictures: Vec::new(),
    })
}

/// Puts a region in front of the other layers of a mesh, and looks at it from where it shows.
fn add_region(group: &mut Group, path: &Path, task: &Task) -> Result<Region> {
    let panel = &mut group.panels[0];
    let region = read_region(path, &panel.mesh)?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let inside = region.weights().iter().filter(|&&w| w >= Region::COUNTS).count();
    group.facts.push((name.clone(), format!("{inside} vertices")));
    let at = group.layers.len() - 1;
    if at == 0 {
        *panel = Panel::new(&panel.name, panel.mesh.clone(), Some(region.weights()), task)?;
    }
    let paints = vec![Paint::Weights(region.weights().to_vec())];
    group.layers.insert(at, Layer { name, legend: Vec::new(), paints });
    Ok(region)
}

/// Colours of the vertices as the file has them: its own, those of its images, or grey.
pub(super) fn own_colors(file: &MeshFile) -> Vec<[u8; 3]> {
    let mut colors = vec![[184; 3]; file.mesh.n_vertices()];
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

#[cfg(test)]
mod tests {
    use semfm::geom::io::write_mesh;
    use semfm::geom::zoo;
    use serde_json::json;

    use super::*;

    fn told(paths: &[PathBuf]) -> String {
        groups_of_paths(paths, &Task::default()).unwrap_err().to_string()
    }

    #[test]
    fn a_mesh_takes_the_regions_behind_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write_mesh(at("ball.ply"), &zoo::icosphere(2)).unwrap();
        std::fs::write(at("grip.json"), json!({ "vertices": [0, 1, 2] }).to_string()).unwrap();
        let paths = [at("ball.ply"), at("grip.json"), at("ball.ply")];
        let groups = groups_of_paths(&paths, &Task::default()).unwrap();
        let names = |group: &Group| group.layers.iter().map(|l| l.name.clone()).collect::<Vec<_>>();
        assert_eq!(groups.len(), 2);
        assert_eq!(
            (names(&groups[0]), names(&groups[1])),
            (vec!["grip.json".to_owned(), "colours".into()], vec!["colours".to_owned()],)
        );
        super::super::write_page(&at("page.html"), "t", &groups).unwrap();
    }

    #[test]
    fn what_cannot_be_shown_is_named_with_what_can() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("grip.json"), json!({ "vertices": [0] }).to_string()).unwrap();
        std::fs::write(at("g.json"), json!({ "format": "semfm.grasps/1" }).to_string()).unwrap();
        std::fs::write(at("notes.txt"), "nothing to see").unwrap();
        for (path, word) in [
            (at("grip.json"), "without a mesh before it"),
            (at("g.json"), "semfm.grasps/1"),
            (at("notes.txt"), "something else"),
            (folder.path().to_owned(), "without report.json"),
        ] {
            let error = told(&[path]);
            assert!(error.contains(word) && error.contains("transfer -o"), "{error}");
        }
        assert!(told(&[at("missing.obj")]).contains("missing.obj"));
    }
}
