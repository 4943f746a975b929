//! What each path given to `show` becomes.

use std::path::{Path, PathBuf};

use semfm::files::{GRASPS_FORMAT, REGION_FORMAT, TRAJECTORY_FORMAT};
use semfm::geom::io::{FormatError, MeshFormat, read_json};
use semfm::{Region, Task};
use serde_json::Value;

use super::grasps::grasps_group;
use super::group::Group;
use super::mesh::{add_region, mesh_group};
use super::motion::motion_group;
use super::transfer_folder::{add_truth, transfer_groups};
use crate::{Error, Result};

/// What `show` takes, for its messages.
fn expected() -> String {
    format!(
        "the folder that `transfer -o` wrote, with the true region (JSON) after it where that is known, \
         a mesh ({}), a region or grasps (JSON) after their mesh, a views file (MCAP), or a motion (the \
         folder of a plan, or its trajectory.json)",
        MeshFormat::readable_names()
    )
}

/// The groups of all paths: one for each folder of a transfer (and one for its grasps), mesh, views file and
/// motion; a region file is shown on the mesh before it, a file of grasps beside it. A region file after a
/// transfer's folder is the true region on its target.
///
/// # Errors
/// [`Error::Format`] for a path that cannot be shown, with what it is and what would be taken, and for
/// files of a folder that do not fit each other; [`Error::Semfm`] where a file cannot be read or drawn.
pub fn groups_of_paths(paths: &[PathBuf], task: &Task) -> Result<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::new();
    // What regions and grasps belong to.
    let mut before: Option<Before> = None;
    for path in paths {
        if !path.is_dir() && extension(path) == "json" {
            if format_of(path).is_ok_and(|format| format.as_deref() == Some(TRAJECTORY_FORMAT)) {
                groups.push(motion_group(path, task)?);
                before = None;
                continue;
            }
            match &mut before {
                None => return Err(json_alone(path)),
                Some(Before::Mesh(mesh)) => mesh.add_json(path, &mut groups, task)?,
                Some(Before::Transfer(group)) => add_truth(&mut groups[*group], path)?,
            }
            continue;
        }
        before = None;
        if path.is_dir() {
            before = Some(Before::Transfer(groups.len()));
            groups.extend(groups_of_folder(path, task)?);
        } else if extension(path) == "mcap" {
            groups.push(group_of_mcap(path, task)?);
        } else {
            before = Some(Before::Mesh(MeshBefore { group: groups.len(), region: None }));
            groups.push(group_of_mesh(path, task)?);
        }
    }
    Ok(groups)
}

/// What the files after it belong to: a mesh, or a transfer by the number of its group.
enum Before {
    Mesh(MeshBefore),
    Transfer(usize),
}

/// A mesh that files after it belong to: the number of its group, and the last region on it.
struct MeshBefore {
    group: usize,
    region: Option<Region>,
}

impl MeshBefore {
    /// Adds a region to the mesh's group, or grasps in a group of their own.
    fn add_json(&mut self, path: &Path, groups: &mut Vec<Group>, task: &Task) -> Result<()> {
        if format_of(path)?.as_deref() == Some(GRASPS_FORMAT) {
            let mesh = &groups[self.group].panels[0].mesh;
            let weights = self.region.as_ref().map(Region::weights);
            groups.extend(grasps_group(path, mesh, weights, task)?);
        } else {
            self.region = Some(add_region(&mut groups[self.group], path, task)?);
        }
        Ok(())
    }
}

/// The file of a motion in the folder of a plan.
const TRAJECTORY: &str = "trajectory.json";

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

fn unknown(path: &Path, place: &str, found: &str) -> Error {
    FormatError::new(path, place, expected(), found).into()
}

/// A JSON file without a mesh before it, with its format where it names one.
fn json_alone(path: &Path) -> Error {
    match format_of(path) {
        Ok(Some(format)) if format == REGION_FORMAT => {
            unknown(path, "file", "a region without a mesh before it")
        }
        Ok(Some(format)) => unknown(path, "format", &format!("`{format}`")),
        Err(error) if error.code() != "format" => error,
        Ok(None) | Err(_) => unknown(path, "file", "JSON without a mesh before it"),
    }
}

/// The `format` that a JSON file names.
fn format_of(path: &Path) -> Result<Option<String>> {
    let value: Value = read_json(path)?;
    Ok(value["format"].as_str().map(str::to_owned))
}

fn groups_of_folder(folder: &Path, task: &Task) -> Result<Vec<Group>> {
    // `demo` writes its transfer and its motion into folders of their own.
    let of_demo = folder.join("transfer");
    let transfer = [folder, &of_demo].into_iter().find(|f| f.join("report.json").is_file());
    let mut groups = transfer.map_or(Ok(Vec::new()), |folder| transfer_groups(folder, task))?;
    let motions = [folder.join(TRAJECTORY), folder.join("plan").join(TRAJECTORY)];
    for motion in motions.iter().filter(|path| path.is_file()) {
        groups.push(motion_group(motion, task)?);
    }
    if !groups.is_empty() {
        return Ok(groups);
    }
    let found = match folder.join("results.json").is_file() {
        true => "an evaluation, which has its own page: index.html",
        false => "a folder without report.json",
    };
    Err(unknown(folder, "folder", found))
}

#[cfg(feature = "mcap")]
fn group_of_mcap(path: &Path, task: &Task) -> Result<Group> {
    let report = semfm::views::mcap::inspect(path)?;
    let format = report.semfm.as_ref().and_then(|entries| entries.get("format"));
    match format.map(String::as_str) {
        Some("semfm.views/1") => super::views::views_group(path, task),
        Some("semfm.embeddings/1") => Err(unknown(
            path,
            "format",
            "embeddings, which hold no pictures: show their views file",
        )),
        Some("semfm.transfer/1") => {
            Err(unknown(path, "format", "a scene for Foxglove: show the folder that it lies in"))
        }
        Some(format) => Err(unknown(path, "format", &format!("`{format}`"))),
        None => Err(unknown(path, "metadata", "an MCAP file that another program wrote")),
    }
}

#[cfg(not(feature = "mcap"))]
fn group_of_mcap(path: &Path, _task: &Task) -> Result<Group> {
    Err(unknown(path, "file", "MCAP, which this build does not read"))
}

fn group_of_mesh(path: &Path, task: &Task) -> Result<Group> {
    match mesh_group(path, task) {
        // A file without a mesh's extension may be a mesh, or anything.
        Err(Error::Semfm(semfm::Error::Geom(error)))
            if MeshFormat::from_path(path).is_none()
                && !matches!(error, semfm::geom::Error::Io { .. }) =>
        {
            Err(unknown(path, "file", "something else"))
        }
        group => group,
    }
}

#[cfg(test)]
mod tests {
    use semfm::geom::io::write_mesh;
    use semfm_geom::zoo;
    use serde_json::json;

    use super::super::write_page;
    use super::*;

    #[test]
    fn a_mesh_takes_the_regions_behind_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write_mesh(at("ball.ply"), &zoo::icosphere(2)).unwrap();
        std::fs::write(at("grip.json"), json!({ "vertices": [0, 1, 2] }).to_string()).unwrap();
        let paths = [at("ball.ply"), at("grip.json"), at("ball.ply")];
        let groups = groups_of_paths(&paths, &Task::default()).unwrap();
        let names: Vec<Vec<&str>> =
            groups.iter().map(|group| group.layers.iter().map(|l| &*l.name).collect()).collect();
        assert_eq!(names, [vec!["grip.json", "colours"], vec!["colours"]]);
        write_page(&at("page.html"), "t", &groups).unwrap();
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn a_views_file_of_a_mesh_with_the_zero_below_zero_is_shown() {
        use semfm::encoder::rendered_views::{RenderedObject, ViewSettings};
        use semfm::geom::math::DVec3;
        use semfm::views::{Renderer, RigSettings};

        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let turned = zoo::icosphere(1).vertices().iter().map(|&p| -p).collect::<Vec<DVec3>>();
        assert!(turned.iter().any(|p| p.x == 0.0 && p.x.is_sign_negative()));
        let mesh = semfm::Mesh::new(turned, zoo::icosphere(1).faces().to_vec()).unwrap();
        write_mesh(at("ball.ply"), &mesh).unwrap();
        let file = semfm::geom::io::read_mesh(at("ball.ply")).unwrap();
        let rig = RigSettings { count: 2, size: 32, ..Default::default() };
        let settings = ViewSettings { rig, ..Default::default() };
        let (views, task) = (at("ball.views.mcap"), Task::default());
        let drawn = RenderedObject::new(&file, &settings, &Renderer::cpu(), &task).unwrap();
        drawn.write(&views).unwrap();
        std::fs::write(at("grip.json"), json!({ "vertices": [0] }).to_string()).unwrap();
        let paths = [at("ball.ply"), at("grip.json"), views];
        assert_eq!(groups_of_paths(&paths, &task).unwrap().len(), 2);
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
            (at("missing.obj"), "missing.obj"),
        ] {
            let error = groups_of_paths(&[path], &Task::default()).unwrap_err().to_string();
            let is_missing = word == "missing.obj";
            assert!(error.contains(word), "{error}");
            assert!(is_missing || error.contains("transfer -o"), "{error}");
        }
    }
}
