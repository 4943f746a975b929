//! `transfer.mcap`: a transfer as a scene for Foxglove and its like.
//!
//! Frames `source` and `target` stand upright side by side in `world`. Topics below each: `mesh` (the
//! weights as colours), `places` (the colour transfer), `cloud` (the semantic cloud, coloured by its
//! features), `vertices` (one point for each vertex with its numbers), `view` (the picture of
//! `transfer.png` with its camera). Beside them `/anchors` and `/labels` (text), `/matches` (lines),
//! `/hypotheses` where the region may belong elsewhere, and `/answer`, the verdict as a log message.

use std::path::Path;

use semfm::fmap::Hypothesis;
use semfm::geom::math::DVec3;
use semfm::geom::sampling::farthest_points;
use semfm::views::{RenderSettings, SurfaceColor, View, render};
use semfm::{Mesh, Region, Task, Verdict};

use super::items::{
    NamedNumbers, SceneFrame, SceneLabel, SceneLink, SceneLog, SceneMesh, SceneNumbers,
    ScenePicture, ScenePoint, ScenePoints, Severity,
};
use super::scene::FoxgloveScene;
use crate::Result;
use crate::colors::{anchor_color, color_bytes, weight_colors};
use crate::pictures::{ObjectFigure, TransferFigure};

/// Frame and topics of one object.
struct Names {
    frame: &'static str,
    mesh: &'static str,
    places: &'static str,
    cloud: &'static str,
    vertices: &'static str,
}

const SOURCE: Names = Names {
    frame: "source",
    mesh: "/source/mesh",
    places: "/source/places",
    cloud: "/source/cloud",
    vertices: "/source/vertices",
};
const TARGET: Names = Names {
    frame: "target",
    mesh: "/target/mesh",
    places: "/target/places",
    cloud: "/target/cloud",
    vertices: "/target/vertices",
};
const HYPOTHESES: &str = "/hypotheses";

/// Lines between matched places: more hide the objects.
const N_MATCHES: usize = 80;
const INK: [u8; 3] = [40, 40, 40];

/// Writes `transfer.mcap`; `report` goes with it.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where rendering or writing fails, and where the task was
/// cancelled.
pub(crate) fn write_transfer_scene(
    path: &Path,
    figure: &TransferFigure<'_>,
    report: &serde_json::Value,
    task: &Task,
) -> Result<()> {
    let source_of = &figure.transfer.point_map.source_of;
    let source = SceneObject::new(&SOURCE, &figure.source, None, task)?;
    let target = SceneObject::new(&TARGET, &figure.target, Some(source_of), task)?;
    let (on_source, on_target) = (source.vertex_numbers(), target.vertex_numbers());
    let (in_source, in_target) = (source.cloud_numbers(), target.cloud_numbers());
    let places = other_places(figure);

    let mut scene = FoxgloveScene::default();
    source.add_to(&mut scene, &on_source, &in_source);
    target.add_to(&mut scene, &on_target, &in_target);
    places.iter().for_each(|place| place.add_to(&mut scene));
    scene.labels.extend(titles(figure));
    scene.labels.extend(anchor_labels(figure));
    scene.links = matches(figure, &target.places);
    scene.log = Some(log(figure));
    scene.write(path, "semfm.transfer/1", report)
}

/// One object as the scene wants it.
struct SceneObject<'a> {
    names: &'static Names,
    figure: &'a ObjectFigure<'a>,
    /// Colours of the vertices.
    marked: Vec<[u8; 3]>,
    places: Vec<[u8; 3]>,
    /// Colours of the cloud.
    features: Vec<[u8; 3]>,
    view: View,
    /// By vertex.
    weight: Vec<f32>,
    anchor: Vec<i32>,
    source_vertex: Option<&'a [u32]>,
    /// By cloud point.
    cloud_anchor: Vec<i32>,
}

impl<'a> SceneObject<'a> {
    fn new(
        names: &'static Names,
        figure: &'a ObjectFigure<'a>,
        source_vertex: Option<&'a [u32]>,
        task: &Task,
    ) -> Result<Self> {
        let marked = weight_colors(figure.weights);
        let cameras = [figure.viewpoints.best];
        let light = RenderSettings::default();
        let mut views =
            render(figure.mesh(), &SurfaceColor::Vertices(&marked), &cameras, &light, task)?;
        let anchors = &figure.anchors;
        Ok(Self {
            names,
            figure,
            marked: all_bytes(&marked),
            places: all_bytes(&figure.match_colors),
            features: all_bytes(&figure.feature_colors),
            view: views.swap_remove(0),
            weight: figure.weights.iter().map(|&w| w as f32).collect(),
            anchor: anchors.of_vertex.iter().map(|&rank| rank as i32).collect(),
            source_vertex,
            cloud_anchor: anchors.of_point.iter().map(|&rank| rank as i32).collect(),
        })
    }

    fn vertex_numbers(&self) -> Vec<NamedNumbers<'_>> {
        let mut named = vec![
            NamedNumbers { name: "weight", numbers: SceneNumbers::F32(&self.weight) },
            NamedNumbers { name: "anchor", numbers: SceneNumbers::I32(&self.anchor) },
        ];
        if let Some(ids) = self.source_vertex {
            let numbers = SceneNumbers::U32(ids);
            named.push(NamedNumbers { name: "source_vertex", numbers });
        }
        named
    }

    fn cloud_numbers(&self) -> [NamedNumbers<'_>; 3] {
        let clusters = SceneNumbers::U32(&self.figure.anchors.cluster_of_point);
        let n_views = SceneNumbers::U32(self.figure.object.cloud().n_views());
        [
            NamedNumbers { name: "cluster", numbers: clusters },
            NamedNumbers { name: "anchor", numbers: SceneNumbers::I32(&self.cloud_anchor) },
            NamedNumbers { name: "n_views", numbers: n_views },
        ]
    }

    fn add_to<'s>(
        &'s self,
        scene: &mut FoxgloveScene<'s>,
        vertex_numbers: &'s [NamedNumbers<'s>],
        cloud_numbers: &'s [NamedNumbers<'s>],
    ) {
        let Names { frame, mesh, places, cloud, vertices } = *self.names;
        let viewpoints = &self.figure.viewpoints;
        let world_from_frame = viewpoints.upright_from_object;
        scene.frames.push(SceneFrame { frame_id: frame, world_from_frame });
        scene.meshes.extend([self.mesh(mesh, &self.marked), self.mesh(places, &self.places)]);
        scene.clouds.push(ScenePoints {
            topic: cloud,
            frame_id: frame,
            points: self.figure.object.cloud().points(),
            colors: &self.features,
            numbers: cloud_numbers,
        });
        scene.clouds.push(ScenePoints {
            topic: vertices,
            frame_id: frame,
            points: self.figure.mesh().vertices(),
            colors: &self.places,
            numbers: vertex_numbers,
        });
        scene.pictures.push(ScenePicture { frame_id: frame, name: "view", view: &self.view });
    }

    fn mesh<'s>(&'s self, topic: &'static str, colors: &'s [[u8; 3]]) -> SceneMesh<'s> {
        SceneMesh {
            topic,
            frame_id: self.names.frame,
            name: self.names.frame,
            vertices: self.figure.mesh().vertices(),
            faces: self.figure.mesh().faces(),
            colors: Some(colors),
        }
    }
}

fn all_bytes(colors: &[[f32; 3]]) -> Vec<[u8; 3]> {
    colors.iter().copied().map(color_bytes).collect()
}

/// A place where the region may belong, with vertices of its own.
struct OtherPlace {
    name: String,
    label: String,
    color: [u8; 3],
    colors: Vec<[u8; 3]>,
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
}

/// Nothing where there is one place alone.
fn other_places(figure: &TransferFigure<'_>) -> Vec<OtherPlace> {
    let hypotheses = &figure.transfer.hypotheses[..];
    let hypotheses = if hypotheses.len() > 1 { hypotheses } else { &[] };
    let mesh = figure.target.mesh();
    hypotheses.iter().enumerate().map(|(rank, h)| OtherPlace::new(mesh, rank, h)).collect()
}

impl OtherPlace {
    fn new(mesh: &Mesh, rank: usize, hypothesis: &Hypothesis) -> Self {
        let weights = hypothesis.region.weights();
        let is_inside =
            |face: &&[u32; 3]| face.iter().any(|&v| weights[v as usize] >= Region::COUNTS);
        let chosen: Vec<[u32; 3]> = mesh.faces().iter().filter(is_inside).copied().collect();
        let mut used: Vec<u32> = chosen.as_flattened().to_vec();
        used.sort_unstable();
        used.dedup();
        let renumbered =
            chosen.iter().map(|face| face.map(|v| used.partition_point(|&u| u < v) as u32));
        let name = format!("place {}", rank + 1);
        let color = color_bytes(anchor_color(rank as i64));
        Self {
            label: format!("{name}: {:.0} %", 100.0 * hypothesis.probability),
            name,
            color,
            colors: vec![color; used.len()],
            faces: renumbered.collect(),
            vertices: used.iter().map(|&v| mesh.vertices()[v as usize]).collect(),
        }
    }

    fn add_to<'s>(&'s self, scene: &mut FoxgloveScene<'s>) {
        scene.meshes.push(SceneMesh {
            topic: HYPOTHESES,
            frame_id: TARGET.frame,
            name: &self.name,
            vertices: &self.vertices,
            faces: &self.faces,
            colors: Some(&self.colors),
        });
        scene.labels.push(SceneLabel {
            topic: HYPOTHESES,
            frame_id: TARGET.frame,
            at: Some(mean(self.vertices.iter().copied())),
            text: self.label.clone(),
            color: self.color,
        });
    }
}

/// What stands above the objects.
fn titles<'s>(figure: &TransferFigure<'_>) -> [SceneLabel<'s>; 2] {
    let on_target = format!("target: {}", figure.verdict_line());
    [title(&SOURCE, "source: the demonstrated region".to_owned()), title(&TARGET, on_target)]
}

fn title<'s>(names: &Names, text: String) -> SceneLabel<'s> {
    SceneLabel { topic: "/labels", frame_id: names.frame, at: None, text, color: INK }
}

/// The rank and cosine of each anchor, on both objects.
fn anchor_labels<'s>(figure: &TransferFigure<'_>) -> Vec<SceneLabel<'s>> {
    let mut labels = Vec::new();
    for (rank, anchor) in figure.transfer.report.anchors.iter().enumerate() {
        for (names, object) in [(&SOURCE, &figure.source), (&TARGET, &figure.target)] {
            let points = object.object.cloud().points().iter().zip(&object.anchors.of_point);
            let own = points.filter(|(_, of_point)| **of_point == rank as i64).map(|(&p, _)| p);
            labels.push(SceneLabel {
                topic: "/anchors",
                frame_id: names.frame,
                at: Some(mean(own)),
                text: format!("anchor {}: cosine {:.2}", rank + 1, anchor.anchor.cosine),
                color: color_bytes(anchor_color(rank as i64)),
            });
        }
    }
    labels
}

/// Lines from places spread over the target to where they are matched on the source.
fn matches<'s>(figure: &TransferFigure<'_>, colors: &[[u8; 3]]) -> Vec<SceneLink<'s>> {
    let (source, target) = (figure.source.mesh().vertices(), figure.target.mesh().vertices());
    farthest_points(target, N_MATCHES)
        .into_iter()
        .map(|i| {
            let matched = figure.transfer.point_map.source_of[i as usize];
            SceneLink {
                topic: "/matches",
                from: ScenePoint { frame_id: TARGET.frame, position: target[i as usize] },
                to: ScenePoint { frame_id: SOURCE.frame, position: source[matched as usize] },
                color: colors[i as usize],
            }
        })
        .collect()
}

/// The verdict as a log message.
fn log<'s>(figure: &TransferFigure<'_>) -> SceneLog<'s> {
    let method = figure.transfer.report.settings.method;
    SceneLog {
        topic: "/answer",
        severity: match figure.transfer.verdict {
            Verdict::Accept => Severity::Info,
            Verdict::Check => Severity::Warning,
            Verdict::Refuse => Severity::Error,
        },
        text: format!("{}, method {method}", figure.verdict_line()),
    }
}

fn mean(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (sum, n) = points.fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
    sum / f64::max(n, 1.0)
}
