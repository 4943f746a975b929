//! The folder of a transfer as a group of the page.

use std::path::Path;

use semfm::Region;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::geom::{Mesh, Task};
#[cfg(feature = "mcap")]
use semfm::views::Fault;
use semfm::weight_colors::{MARKED, PLAIN, color_bytes};
use serde::Deserialize;
use serde_json::Value;

use super::grasps::grasps_group;
use super::paths::own_colors;
use super::{Group, Layer, Paint, Panel};
use crate::pictures::{Sides, anchor_color, paired_viewpoints};
use crate::{Error, Result};

/// What the files of `folder` say of one transfer, and its grasps, where there are some.
///
/// # Errors
/// Whatever is missing in the folder or wrong with its files; parts that are not of one transfer.
pub(super) fn transfer_groups(folder: &Path, task: &Task) -> Result<Vec<Group>> {
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
    map.check(&folder.join("point_map.json"), &source.mesh, &target.mesh)?;

    let carried: Carried = read_json(&folder.join("region.json"))?;
    let n_target = target.mesh.n_vertices();
    let places: Vec<Place> =
        carried.hypotheses.into_iter().filter(|place| place.fits(n_target)).collect();
    let mut layers = vec![region_layer(&map, &source, &target)];
    layers.push(Layer {
        name: "colour transfer".into(),
        legend: vec![(None, "equal colours: matched places".into())],
        paints: vec![Paint::Places, Paint::Places],
    });
    layers.extend(features_layer(folder, [&source.mesh, &target.mesh])?);
    layers.push(anchor_layer(&map, &report));
    if places.len() > 1 {
        layers.push(places_layer(&places, &map, source.mesh.n_vertices(), n_target));
    }
    let weights = |of: &Option<Vec<f64>>, n: usize| of.clone().unwrap_or_else(|| vec![0.0; n]);
    let on_source = weights(&map.source_weight, source.mesh.n_vertices());
    let on_target = weights(&map.target_weight, n_target);
    let sides = paired_viewpoints(
        (&source.mesh, &on_source),
        (&target.mesh, &on_target),
        &map.source_of,
        64,
        task,
    )?;
    let grasps = folder.join("grasps.json");
    let grasps = match grasps.is_file() {
        true => grasps_group(&grasps, &target.mesh, Some(&on_target), task)?,
        false => None,
    };
    let panel = |name: &str, file: MeshFile, sides: Sides| Panel {
        name: name.into(),
        note: format!("{} vertices, {} triangles", file.mesh.n_vertices(), file.mesh.n_faces()),
        mesh: file.mesh,
        sides,
    };
    let panels = vec![panel("source", source, sides[0]), panel("target", target, sides[1])];
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
    let transfer = Group {
        title: title(folder),
        facts: facts.into_iter().flatten().collect(),
        panels,
        layers,
        source_of: Some(map.source_of),
        pictures: Vec::new(),
    };
    Ok([Some(transfer), grasps].into_iter().flatten().collect())
}

/// The folder's name, after that of the folder it lies in.
fn title(folder: &Path) -> String {
    let names: Vec<_> = folder.iter().map(|name| name.to_string_lossy()).collect();
    names[names.len().saturating_sub(2)..].join("/")
}

fn region_layer(map: &PointMapFile, source: &MeshFile, target: &MeshFile) -> Layer {
    let paints = match (&map.source_weight, &map.target_weight) {
        (Some(source), Some(target)) => {
            vec![Paint::Weights(source.clone()), Paint::Weights(target.clone())]
        }
        // Folders written before the weights were in the file have them as colours.
        _ => [source, target].map(|file| Paint::Colors(own_colors(file))).into(),
    };
    Layer { name: "region".into(), legend: Vec::new(), paints }
}

fn anchor_layer(map: &PointMapFile, report: &Value) -> Layer {
    let ranks = map.source_anchor.iter().chain(&map.target_anchor);
    let n_anchors = ranks.copied().max().map_or(0, |most| most.saturating_add(1).clamp(0, 200));
    let mut legend = vec![(Some(color_bytes(anchor_color(-1))), "no anchor".to_owned())];
    legend.extend((0..n_anchors).map(|rank| {
        let cosine = report["anchors"][rank as usize]["cosine"].as_f64();
        let cosine = cosine.map_or(String::new(), |cosine| format!(": cosine {cosine:.2}"));
        (Some(color_bytes(anchor_color(rank))), format!("anchor {}{cosine}", rank + 1))
    }));
    let classes = |ranks: &[i64]| {
        Paint::Classes(
            ranks.iter().map(|&rank| rank.saturating_add(1).clamp(0, n_anchors) as u8).collect(),
        )
    };
    let paints = vec![classes(&map.source_anchor), classes(&map.target_anchor)];
    Layer { name: "anchors".into(), legend, paints }
}

/// The places that the region may belong to, each in its own colour.
fn places_layer(places: &[Place], map: &PointMapFile, n_source: usize, n_target: usize) -> Layer {
    let mut legend = vec![
        (Some(color_bytes(PLAIN)), "elsewhere".to_owned()),
        (Some(color_bytes(MARKED)), "the demonstrated region".to_owned()),
    ];
    let mut on_target = vec![0u8; n_target];
    for (i, place) in places.iter().enumerate().take(200) {
        let words = format!("place {}: {:.0} %", i + 1, 100.0 * place.probability);
        legend.push((Some(color_bytes(anchor_color(i as i64))), words));
        place.vertices.iter().for_each(|&v| on_target[v as usize] = i as u8 + 2);
    }
    let weights = map.source_weight.iter().flatten();
    let mut on_source: Vec<u8> = weights.map(|&w| u8::from(w >= Region::COUNTS)).collect();
    on_source.resize(n_source, 0);
    let paints = vec![Paint::Classes(on_source), Paint::Classes(on_target)];
    Layer { name: "other places".into(), legend, paints }
}

/// Features as colours, from the clouds of the scene, where it is there and this build reads it.
#[cfg(feature = "mcap")]
fn features_layer(folder: &Path, meshes: [&Mesh; 2]) -> Result<Option<Layer>> {
    let path = folder.join("transfer.mcap");
    if !path.is_file() {
        return Ok(None);
    }
    let mut paints = Vec::new();
    for (topic, mesh) in ["/source/cloud", "/target/cloud"].into_iter().zip(meshes) {
        let (points, colors) = match semfm::views::mcap::read_cloud(&path, topic) {
            Ok(Some(cloud)) => cloud,
            Ok(None) => return Ok(None),
            // A scene of millions of vertices is beyond the reader: that costs this layer, not the page.
            Err(semfm::views::Error::Container { fault: Fault::OverLimit, .. }) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let index = semfm::geom::PointIndex::new(&points)?;
        let nearest = |&p: &semfm::geom::math::DVec3| colors[index.nearest(p).0];
        paints.push(Paint::Colors(mesh.vertices().iter().map(nearest).collect()));
    }
    let words = "three principal components of the features: equal colours mean the same";
    Ok(Some(Layer { name: "features".into(), legend: vec![(None, words.into())], paints }))
}

#[cfg(not(feature = "mcap"))]
fn features_layer(_folder: &Path, _meshes: [&Mesh; 2]) -> Result<Option<Layer>> {
    Ok(None)
}

/// `point_map.json`.
#[derive(Deserialize)]
struct PointMapFile {
    source: String,
    target: String,
    source_of: Vec<u32>,
    source_anchor: Vec<i64>,
    target_anchor: Vec<i64>,
    source_weight: Option<Vec<f64>>,
    target_weight: Option<Vec<f64>>,
}

impl PointMapFile {
    /// Refuses arrays of other lengths than the meshes and ids beyond the source.
    fn check(&self, path: &Path, source: &Mesh, target: &Mesh) -> Result<()> {
        let (n_source, n_target) = (source.n_vertices(), target.n_vertices());
        let length = |of: &Option<Vec<f64>>| of.as_ref().map(Vec::len);
        let lengths = [
            ("source_of", Some(self.source_of.len()), n_target),
            ("source_anchor", Some(self.source_anchor.len()), n_source),
            ("target_anchor", Some(self.target_anchor.len()), n_target),
            ("source_weight", length(&self.source_weight), n_source),
            ("target_weight", length(&self.target_weight), n_target),
        ];
        let fault = |place: &str, expected: String, found: String| {
            Err(Error::Format { path: path.to_owned(), place: place.into(), expected, found })
        };
        for (name, found, n) in lengths {
            if let Some(found) = found.filter(|&found| found != n) {
                return fault(name, format!("{n} numbers, one per vertex"), found.to_string());
            }
        }
        match self.source_of.iter().find(|&&v| v as usize >= n_source) {
            Some(v) => fault("source_of", format!("ids below {n_source}"), v.to_string()),
            None => Ok(()),
        }
    }
}

/// `region.json`, what is of interest here.
#[derive(Deserialize)]
struct Carried {
    #[serde(default)]
    hypotheses: Vec<Place>,
}

/// A place where the region may belong.
#[derive(Deserialize)]
struct Place {
    vertices: Vec<u32>,
    probability: f64,
}

impl Place {
    fn fits(&self, n_vertices: usize) -> bool {
        self.vertices.iter().all(|&v| (v as usize) < n_vertices)
    }
}

pub(super) fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T> {
    let bytes = std::fs::read(path)
        .map_err(|source| semfm::geom::Error::Io { path: path.to_owned(), source })?;
    serde_json::from_slice(&bytes).map_err(|error| Error::Format {
        path: path.to_owned(),
        place: format!("line {}", error.line()),
        expected: "the JSON that a transfer writes".into(),
        found: error.to_string(),
    })
}
