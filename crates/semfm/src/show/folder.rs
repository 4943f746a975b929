//! The folder of a transfer, and single meshes, as groups of the page.

use std::path::Path;

use semfm_geom::io::{MeshFile, read_mesh};
use serde::Deserialize;
use serde_json::Value;

use super::{Group, Panel};
use crate::picture::{anchor_color, bytes, position_colors};
use crate::{Error, Result};

/// What a `path` shows: the folder of a transfer (`transfer -o`), or a mesh with its colours.
///
/// # Errors
/// Whatever is missing in the folder or wrong with its files; parts that are not of one transfer.
pub fn group_of_path(path: &Path) -> Result<Group> {
    if path.is_dir() { transfer_group(path) } else { mesh_group(path) }
}

fn mesh_group(path: &Path) -> Result<Group> {
    let file = read_mesh(path)?;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let note = format!("{} vertices", file.mesh.n_vertices());
    let layers = vec![("colours".to_owned(), own_colors(&file))];
    let panel = Panel { name: name.clone(), note, mesh: file.mesh, layers };
    Ok(Group { title: name, facts: Vec::new(), panels: vec![panel], source_of: None })
}

fn transfer_group(folder: &Path) -> Result<Group> {
    let report: Value = read_json(&folder.join("report.json"))?;
    let map: PointMapFile = read_json(&folder.join("point_map.json"))?;
    let [source, target] = ["source.ply", "target.ply"].map(|name| read_mesh(folder.join(name)));
    let (source, target) = (source?, target?);
    for (name, file, hash) in [("source", &source, &map.source), ("target", &target, &map.target)] {
        let found = file.mesh.hash().to_string();
        if found != *hash {
            return Err(Error::Format {
                path: folder.join(format!("{name}.ply")),
                place: "mesh".into(),
                expected: format!("the mesh {hash} of point_map.json"),
                found,
            });
        }
    }
    let places = position_colors(source.mesh.vertices());
    let source_places: Vec<[u8; 3]> = places.into_iter().map(bytes).collect();
    // Ids beyond the source are refused when the page is written.
    let matched = map.source_of.iter();
    let target_places =
        matched.map(|&v| source_places.get(v as usize).copied().unwrap_or_default()).collect();
    let panel = |name: &str, file: MeshFile, places: Vec<[u8; 3]>, anchors: &[i64]| Panel {
        name: name.into(),
        note: format!("{} vertices", file.mesh.n_vertices()),
        layers: vec![
            ("region".into(), own_colors(&file)),
            ("colour transfer".into(), places),
            ("anchors".into(), anchors.iter().map(|&rank| bytes(anchor_color(rank))).collect()),
        ],
        mesh: file.mesh,
    };
    let panels = vec![
        panel("source", source, source_places, &map.source_anchor),
        panel("target", target, target_places, &map.target_anchor),
    ];
    let fact = |name: &str, value: &Value| match value {
        Value::String(text) => Some((name.to_owned(), text.clone())),
        Value::Number(number) => Some((name.to_owned(), format!("{:.2}", number.as_f64()?))),
        _ => None,
    };
    let facts = [
        fact("verdict", &report["verdict"]),
        fact("confidence", &report["confidence"]),
        fact("method", &report["settings"]["method"]),
        fact("IoU", &report["iou"]),
    ];
    Ok(Group {
        title: folder.display().to_string(),
        facts: facts.into_iter().flatten().collect(),
        panels,
        source_of: Some(map.source_of),
    })
}

/// `point_map.json`.
#[derive(Deserialize)]
struct PointMapFile {
    source: String,
    target: String,
    source_of: Vec<u32>,
    source_anchor: Vec<i64>,
    target_anchor: Vec<i64>,
}

fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path)
        .map_err(|source| semfm_geom::Error::Io { path: path.to_owned(), source })?;
    serde_json::from_slice(&bytes).map_err(|error| Error::Format {
        path: path.to_owned(),
        place: format!("line {}", error.line()),
        expected: "the JSON that a transfer writes".into(),
        found: error.to_string(),
    })
}

/// Colours of the vertices as the file has them: its own, those of its images, or grey.
fn own_colors(file: &MeshFile) -> Vec<[u8; 3]> {
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
