//! `transfer.mcap`: a transfer as a scene for Foxglove and its like.
//!
//! Frames `source` and `target` stand upright side by side in `world`. Topics below each: `mesh` (the
//! weights as colours), `places` (the colour transfer), `cloud` (the semantic cloud, coloured by its
//! features), `vertices` (one point for each vertex with its numbers), `view` (the picture of
//! `transfer.png` with its camera). Beside them `/anchors` and `/labels` (words), `/matches` (lines),
//! `/hypotheses` where the region may belong elsewhere, and `/answer`, the verdict as a log message.

use std::path::Path;

use semfm::geom::math::DVec3;
use semfm::geom::sampling::farthest_points;
use semfm::geom::{Mesh, Task};
use semfm::views::mcap::{
    Scene, SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers, ScenePicture,
    ScenePoints, Severity,
};
use semfm::views::{Paint, RenderSettings, View, render};
use semfm::weight_colors::{color_bytes, weight_colors};
use semfm::{Region, Verdict};

use crate::Result;
use crate::pictures::{TransferFigure, anchor_color};

const FRAMES: [&str; 2] = ["source", "target"];
/// Topics of each frame.
const MESH: [&str; 2] = ["/source/mesh", "/target/mesh"];
const PLACES: [&str; 2] = ["/source/places", "/target/places"];
const CLOUD: [&str; 2] = ["/source/cloud", "/target/cloud"];
const VERTICES: [&str; 2] = ["/source/vertices", "/target/vertices"];
/// Lines between matched places: more hide the objects.
const N_MATCHES: usize = 80;
const INK: [u8; 3] = [40, 40, 40];

/// Writes `transfer.mcap`; `report` goes with it.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails.
pub(crate) fn write_transfer_scene(
    path: &Path,
    figure: &TransferFigure<'_>,
    report: &serde_json::Value,
    task: &Task,
) -> Result<()> {
    let sides = [Side::new(figure, 0, task)?, Side::new(figure, 1, task)?];
    let transfer = figure.transfer;
    let others: Vec<Part> = if transfer.hypotheses.len() > 1 {
        transfer
            .hypotheses
            .iter()
            .map(|h| Part::of(figure.meshes()[1], h.region.weights()))
            .collect()
    } else {
        Vec::new()
    };
    let names: Vec<String> = (1..=others.len()).map(|i| format!("place {i}")).collect();
    let colors: Vec<Vec<[u8; 3]>> = others
        .iter()
        .enumerate()
        .map(|(i, part)| vec![color_bytes(anchor_color(i as i64)); part.vertices.len()])
        .collect();
    let numbers = [0, 1].map(|k| sides[k].numbers());
    let cloud_numbers = [0, 1].map(|k| sides[k].cloud_numbers());

    let mut scene = Scene::default();
    for (k, side) in sides.iter().enumerate() {
        let (mesh, cloud) = (figure.meshes()[k], &figure.objects()[k].cloud);
        let frame_id = FRAMES[k];
        let world_from_frame = figure.sides[k].upright_from_object;
        scene.frames.push(SceneFrame { frame_id, world_from_frame });
        let shown = |topic, colors| SceneMesh {
            topic,
            frame_id,
            name: frame_id,
            vertices: mesh.vertices(),
            faces: mesh.faces(),
            colors: Some(colors),
        };
        scene.meshes.extend([shown(MESH[k], &side.marked), shown(PLACES[k], &side.places)]);
        scene.clouds.push(ScenePoints {
            topic: CLOUD[k],
            frame_id,
            points: cloud.points(),
            colors: &side.features,
            numbers: &cloud_numbers[k],
        });
        scene.clouds.push(ScenePoints {
            topic: VERTICES[k],
            frame_id,
            points: mesh.vertices(),
            colors: &side.places,
            numbers: if k == 0 { &numbers[k][..2] } else { &numbers[k] },
        });
        scene.pictures.push(ScenePicture { frame_id, name: "view", view: &side.view });
    }
    for (i, part) in others.iter().enumerate() {
        scene.meshes.push(SceneMesh {
            topic: "/hypotheses",
            frame_id: FRAMES[1],
            name: &names[i],
            vertices: &part.vertices,
            faces: &part.faces,
            colors: Some(&colors[i]),
        });
        scene.labels.push(SceneLabel {
            topic: "/hypotheses",
            frame_id: FRAMES[1],
            at: Some(mean(part.vertices.iter().copied())),
            text: format!("{}: {:.0} %", names[i], 100.0 * transfer.hypotheses[i].probability),
            color: color_bytes(anchor_color(i as i64)),
        });
    }
    scene.labels.extend(labels(figure));
    scene.links = matches(figure, &sides[1].places);
    let method = serde_json::json!(transfer.report.settings.method);
    scene.log = Some(SceneLog {
        topic: "/answer",
        severity: match transfer.verdict {
            Verdict::Accept => Severity::Info,
            Verdict::Check => Severity::Warning,
            Verdict::Refuse => Severity::Error,
        },
        text: format!("{}, method {}", figure.answer(), method.as_str().unwrap_or_default()),
    });
    Ok(scene.write(path, "semfm.transfer/1", report)?)
}

/// What one frame holds, as the scene wants it.
struct Side<'a> {
    marked: Vec<[u8; 3]>,
    places: Vec<[u8; 3]>,
    features: Vec<[u8; 3]>,
    view: View,
    /// By vertex.
    weight: Vec<f32>,
    anchor: Vec<i32>,
    source_vertex: &'a [u32],
    /// By cloud point.
    cluster: &'a [u32],
    cloud_anchor: Vec<i32>,
    n_views: Vec<u32>,
}

impl<'a> Side<'a> {
    fn new(figure: &'a TransferFigure<'_>, k: usize, task: &Task) -> Result<Self> {
        let all_bytes = |colors: &[[f32; 3]]| colors.iter().copied().map(color_bytes).collect();
        let (mesh, weights) = (figure.meshes()[k], figure.weights()[k]);
        let marked = weight_colors(weights);
        let cameras = [figure.sides[k].best];
        let light = RenderSettings::default();
        let mut views = render(mesh, &Paint::Vertices(&marked), &cameras, &light, task)?;
        let anchors = &figure.anchors[k];
        Ok(Self {
            marked: all_bytes(&marked),
            places: all_bytes(&figure.places[k]),
            features: all_bytes(&figure.feature_colors[k]),
            view: views.swap_remove(0),
            weight: weights.iter().map(|&w| w as f32).collect(),
            anchor: anchors.of_vertex.iter().map(|&rank| rank as i32).collect(),
            source_vertex: &figure.transfer.point_map.source_of,
            cluster: &anchors.cluster_of_point,
            cloud_anchor: anchors.of_point.iter().map(|&rank| rank as i32).collect(),
            n_views: figure.objects()[k].cloud.n_views().to_vec(),
        })
    }

    /// Numbers of the vertices; the last is the target's alone.
    fn numbers(&self) -> [(&str, SceneNumbers<'_>); 3] {
        [
            ("weight", SceneNumbers::F32(&self.weight)),
            ("anchor", SceneNumbers::I32(&self.anchor)),
            ("source_vertex", SceneNumbers::U32(self.source_vertex)),
        ]
    }

    fn cloud_numbers(&self) -> [(&str, SceneNumbers<'_>); 3] {
        [
            ("cluster", SceneNumbers::U32(self.cluster)),
            ("anchor", SceneNumbers::I32(&self.cloud_anchor)),
            ("n_views", SceneNumbers::U32(&self.n_views)),
        ]
    }
}

/// The triangles of a mesh that lie in a region, with vertices of their own.
struct Part {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

impl Part {
    fn of(mesh: &Mesh, weights: &[f64]) -> Self {
        let inside = |&&[a, b, c]: &&[u32; 3]| {
            [a, b, c].iter().any(|&v| weights[v as usize] >= Region::COUNTS)
        };
        let chosen: Vec<[u32; 3]> = mesh.faces().iter().filter(inside).copied().collect();
        let mut used: Vec<u32> = chosen.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let place = |v: u32| used.partition_point(|&u| u < v) as u32;
        Self {
            vertices: used.iter().map(|&v| mesh.vertices()[v as usize]).collect(),
            faces: chosen.iter().map(|face| face.map(place)).collect(),
        }
    }
}

/// What stands above the objects, and at the anchors.
fn labels<'a>(figure: &TransferFigure<'_>) -> Vec<SceneLabel<'a>> {
    let titles =
        ["source: the demonstrated region".to_owned(), format!("target: {}", figure.answer())];
    let title = |(k, text): (usize, String)| SceneLabel {
        topic: "/labels",
        frame_id: FRAMES[k],
        at: None,
        text,
        color: INK,
    };
    let mut labels: Vec<SceneLabel<'a>> = titles.into_iter().enumerate().map(title).collect();
    for (rank, anchor) in figure.transfer.report.anchors.iter().enumerate() {
        for (k, frame_id) in FRAMES.into_iter().enumerate() {
            let points = figure.objects()[k].cloud.points().iter().zip(&figure.anchors[k].of_point);
            let own = points.filter(|(_, of_point)| **of_point == rank as i64).map(|(&p, _)| p);
            labels.push(SceneLabel {
                topic: "/anchors",
                frame_id,
                at: Some(mean(own)),
                text: format!("anchor {}: cosine {:.2}", rank + 1, anchor.anchor.cosine),
                color: color_bytes(anchor_color(rank as i64)),
            });
        }
    }
    labels
}

/// Lines from places spread over the target to where they are matched on the source.
fn matches<'a>(figure: &TransferFigure<'_>, colors: &[[u8; 3]]) -> Vec<SceneLink<'a>> {
    let [source, target] = figure.meshes();
    farthest_points(target.vertices(), N_MATCHES)
        .into_iter()
        .map(|i| {
            let matched = figure.transfer.point_map.source_of[i as usize];
            SceneLink {
                topic: "/matches",
                from: (FRAMES[1], target.vertices()[i as usize]),
                to: (FRAMES[0], source.vertices()[matched as usize]),
                color: colors[i as usize],
            }
        })
        .collect()
}

fn mean(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
    sum / f64::max(n, 1.0)
}
