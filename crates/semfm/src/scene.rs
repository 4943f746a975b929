//! `transfer.mcap`: a transfer as a scene for Foxglove and its like.
//!
//! Frames `source` and `target` stand upright side by side in `world`. Topics below each: `mesh` (the
//! weights as colours), `places` (the colour transfer), `cloud` (the semantic cloud, coloured by its
//! features), `vertices` (one point for each vertex with its numbers), `view` (the picture of
//! `transfer.png` with its camera). Beside them `/anchors` and `/labels` (words), `/matches` (lines),
//! `/hypotheses` where the region may belong elsewhere, and `/answer`, the verdict as a log message.

use std::path::Path;

use semfm_geom::math::DVec3;
use semfm_geom::sampling::farthest_points;
use semfm_geom::{Mesh, Task};
use semfm_views::mcap::{
    Scene, SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers, ScenePicture,
    ScenePoints, Severity,
};
use semfm_views::{Paint, RenderSettings, View, render};

use crate::picture::{Exhibit, anchor_color, bytes, weight_colors};
use crate::{Region, Result, Verdict};

const FRAMES: [&str; 2] = ["source", "target"];
/// Topics of each frame.
const MESH: [&str; 2] = ["/source/mesh", "/target/mesh"];
const PLACES: [&str; 2] = ["/source/places", "/target/places"];
const CLOUD: [&str; 2] = ["/source/cloud", "/target/cloud"];
const VERTICES: [&str; 2] = ["/source/vertices", "/target/vertices"];
/// Lines between matched places: more hide the objects.
const N_MATCHES: usize = 80;
const INK: [u8; 3] = [40, 40, 40];

pub(crate) fn write(
    path: &Path,
    exhibit: &Exhibit<'_>,
    report: &serde_json::Value,
    task: &Task,
) -> Result<()> {
    let sides = [Side::new(exhibit, 0, task)?, Side::new(exhibit, 1, task)?];
    let transfer = exhibit.transfer;
    let others: Vec<Part> = if transfer.hypotheses.len() > 1 {
        transfer
            .hypotheses
            .iter()
            .map(|h| Part::of(exhibit.meshes()[1], h.region.weights()))
            .collect()
    } else {
        Vec::new()
    };
    let names: Vec<String> = (1..=others.len()).map(|i| format!("place {i}")).collect();
    let colors: Vec<Vec<[u8; 3]>> = others
        .iter()
        .enumerate()
        .map(|(i, part)| vec![bytes(anchor_color(i as i64)); part.vertices.len()])
        .collect();
    let numbers = [0, 1].map(|k| sides[k].numbers());
    let cloud_numbers = [0, 1].map(|k| sides[k].cloud_numbers());

    let mut scene = Scene::default();
    for (k, side) in sides.iter().enumerate() {
        let (mesh, cloud) = (exhibit.meshes()[k], &exhibit.objects()[k].cloud);
        let frame_id = FRAMES[k];
        let world_from_frame = exhibit.sides[k].upright_from_object;
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
            colors: &side.meaning,
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
            color: bytes(anchor_color(i as i64)),
        });
    }
    scene.labels.extend(labels(exhibit));
    scene.links = matches(exhibit, &sides[1].places);
    let method = serde_json::json!(transfer.report.settings.method);
    scene.log = Some(SceneLog {
        topic: "/answer",
        severity: match transfer.verdict {
            Verdict::Accept => Severity::Info,
            Verdict::Check => Severity::Warning,
            Verdict::Refuse => Severity::Error,
        },
        text: format!("{}, method {}", exhibit.answer(), method.as_str().unwrap_or_default()),
    });
    Ok(scene.write(path, "semfm.transfer/1", report)?)
}

/// What one frame holds, as the scene wants it.
struct Side<'a> {
    marked: Vec<[u8; 3]>,
    places: Vec<[u8; 3]>,
    meaning: Vec<[u8; 3]>,
    view: View,
    /// By vertex.
    weight: Vec<f32>,
    anchor: Vec<i32>,
    source_vertex: &'a [u32],
    /// By cloud point.
    cluster: Vec<u32>,
    cloud_anchor: Vec<i32>,
    n_views: Vec<u32>,
}

impl<'a> Side<'a> {
    fn new(exhibit: &'a Exhibit<'_>, k: usize, task: &Task) -> Result<Self> {
        let all_bytes = |colors: &[[f32; 3]]| colors.iter().copied().map(bytes).collect();
        let (mesh, weights) = (exhibit.meshes()[k], exhibit.weights()[k]);
        let marked = weight_colors(weights);
        let cameras = [exhibit.sides[k].best];
        let light = RenderSettings::default();
        let mut views = render(mesh, &Paint::Vertices(&marked), &cameras, &light, task)?;
        let clusters = &exhibit.clusters[k];
        Ok(Self {
            marked: all_bytes(&marked),
            places: all_bytes(&exhibit.places[k]),
            meaning: all_bytes(&exhibit.meaning[k]),
            view: views.swap_remove(0),
            weight: weights.iter().map(|&w| w as f32).collect(),
            anchor: exhibit.anchors[k].iter().map(|&rank| rank as i32).collect(),
            source_vertex: &exhibit.transfer.point_map.source_of,
            cluster: clusters.iter().map(|cluster| cluster.0).collect(),
            cloud_anchor: clusters.iter().map(|c| c.1.map_or(-1, |rank| rank as i32)).collect(),
            n_views: exhibit.objects()[k].cloud.n_views().to_vec(),
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
            ("cluster", SceneNumbers::U32(&self.cluster)),
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
fn labels<'a>(exhibit: &Exhibit<'_>) -> Vec<SceneLabel<'a>> {
    let titles =
        ["source: the demonstrated region".to_owned(), format!("target: {}", exhibit.answer())];
    let title = |(k, text): (usize, String)| SceneLabel {
        topic: "/labels",
        frame_id: FRAMES[k],
        at: None,
        text,
        color: INK,
    };
    let mut labels: Vec<SceneLabel<'a>> = titles.into_iter().enumerate().map(title).collect();
    for (rank, anchor) in exhibit.transfer.report.anchors.iter().enumerate() {
        for (k, frame_id) in FRAMES.into_iter().enumerate() {
            let points = exhibit.objects()[k].cloud.points().iter().zip(&exhibit.clusters[k]);
            let own = points.filter(|(_, cluster)| cluster.1 == Some(rank)).map(|(&p, _)| p);
            labels.push(SceneLabel {
                topic: "/anchors",
                frame_id,
                at: Some(mean(own)),
                text: format!("anchor {}: cosine {:.2}", rank + 1, anchor.anchor.cosine),
                color: bytes(anchor_color(rank as i64)),
            });
        }
    }
    labels
}

/// Lines from places spread over the target to where they are matched on the source.
fn matches<'a>(exhibit: &Exhibit<'_>, colors: &[[u8; 3]]) -> Vec<SceneLink<'a>> {
    let [source, target] = exhibit.meshes();
    farthest_points(target.vertices(), N_MATCHES)
        .into_iter()
        .map(|i| {
            let matched = exhibit.transfer.point_map.source_of[i as usize];
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
