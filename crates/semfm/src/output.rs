//! What a transfer leaves behind for programs. Pictures and scenes are made by `semfm-show`.

use std::path::{Path, PathBuf};

use semfm_fmap::Anchor;
use semfm_geom::io::{VertexAttributes, write_json, write_mesh_with_attributes};
use semfm_geom::{Mesh, MeshIdentity, Task};
use serde_json::{Map, Value, json};

use crate::region_file::region_json;
use crate::weight_colors::{color_bytes, weight_colors};
use crate::{PreparedObject, Region, Result, Transfer};

/// Writes a transfer into `folder`, which is made if it is not there: `region.json`,
/// `report.json` (see [`report_json`]), `point_map.json`, `source.ply`, `target.ply` and `target.glb`.
/// Each file is written whole or not at all.
///
/// # Errors
/// The first file that cannot be written.
pub fn write_transfer(
    folder: &Path,
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    transfer: &Transfer,
    report: &Value,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder)
        .map_err(|source| semfm_geom::Error::Io { path: folder.to_owned(), source })?;
    let at = |name: &str| folder.join(name);
    let mesh = target.shape.original();

    write_json(&at("region.json"), &carried_json(target, transfer))?;
    write_json(&at("report.json"), report)?;
    let AnchorRanks { source: source_anchor, target: target_anchor } =
        anchor_ranks(source, target, transfer, task)?;
    write_json(
        &at("point_map.json"),
        &json!({
            "format": "semfm.point_map/1",
            "source": source.shape.original().hash().to_string(),
            "target": mesh.hash().to_string(),
            "source_of": transfer.point_map.source_of,
            "source_anchor": source_anchor.of_vertex,
            "target_anchor": target_anchor.of_vertex,
            "source_weight": rounded(region.weights()),
            "target_weight": rounded(transfer.weights()),
        }),
    )?;
    write_weighted(&[at("source.ply")], source.shape.original(), region.weights())?;
    write_weighted(&[at("target.ply"), at("target.glb")], mesh, transfer.weights())?;
    let names =
        ["region.json", "report.json", "point_map.json", "source.ply", "target.ply", "target.glb"];
    Ok(names.into_iter().map(at).collect())
}

/// Where the anchors of a transfer lie on both objects.
pub struct AnchorRanks {
    /// On the source.
    pub source: ObjectAnchors,
    /// On the target.
    pub target: ObjectAnchors,
}

/// Where the anchors of a transfer lie on one object.
pub struct ObjectAnchors {
    /// Cluster of each cloud point.
    pub cluster_of_point: Vec<u32>,
    /// Rank of the anchor that each cloud point's cluster is, best first; −1 for none.
    pub of_point: Vec<i64>,
    /// The same for each vertex of the mesh as read.
    pub of_vertex: Vec<i64>,
}

/// Where the anchors of a transfer lie. The clusters are those that the objects keep.
///
/// # Errors
/// Whatever clustering reports.
pub fn anchor_ranks(
    source: &PreparedObject,
    target: &PreparedObject,
    transfer: &Transfer,
    task: &Task,
) -> Result<AnchorRanks> {
    let of = |object: &PreparedObject, side: fn(&Anchor) -> u32| -> Result<ObjectAnchors> {
        let settings = &transfer.report.settings.clusters;
        let clusters = object.object.clusters(settings, task)?;
        let anchors = &transfer.report.anchors;
        let rank = |&label: &u32| {
            anchors.iter().position(|a| side(&a.anchor) == label).map_or(-1, |rank| rank as i64)
        };
        let of_point: Vec<i64> = clusters.labels().iter().map(rank).collect();
        let point_of_vertex = object.object.point_of_original_vertex();
        let of_vertex = point_of_vertex.iter().map(|&j| of_point[j as usize]).collect();
        Ok(ObjectAnchors { cluster_of_point: clusters.labels().to_vec(), of_point, of_vertex })
    };
    Ok(AnchorRanks { source: of(source, |a| a.source)?, target: of(target, |a| a.target)? })
}

/// Weights to four digits: enough for eyes, and a third of the bytes.
/// Never up to where a vertex begins to count.
fn rounded(weights: &[f64]) -> Vec<f64> {
    let to_four_digits = |w: f64| (w * 1e4).round() / 1e4;
    let counts = |w: f64| w >= Region::COUNTS;
    let below = Region::COUNTS - 1e-4;
    let round = |&w: &f64| Some(to_four_digits(w)).filter(|&r| counts(r) == counts(w));
    weights.iter().map(|w| round(w).unwrap_or(below)).collect()
}

/// A mesh as read with a weight per vertex, as property and as colour.
fn write_weighted(paths: &[PathBuf], mesh: &Mesh, weights: &[f64]) -> Result<()> {
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, u8::MAX];
    let colors: Vec<[u8; 4]> =
        weight_colors(weights).into_iter().map(|color| opaque(color_bytes(color))).collect();
    let attributes = VertexAttributes { colors: Some(&colors), scalars: &[("weight", weights)] };
    for path in paths {
        write_mesh_with_attributes(path, mesh, &attributes)?;
    }
    Ok(())
}

/// The region as in a region file, with method, confidence, verdict and the other places it may be.
fn carried_json(target: &PreparedObject, transfer: &Transfer) -> Value {
    let mesh = target.shape.original();
    let mut carried = region_json(&transfer.region, mesh);
    let hypotheses: Vec<Value> = transfer
        .hypotheses
        .iter()
        .map(|hypothesis| {
            let vertices = hypothesis.region.vertices();
            let weights: Vec<f64> =
                vertices.iter().map(|&v| hypothesis.region.weights()[v as usize]).collect();
            json!({ "vertices": vertices, "weights": weights, "probability": hypothesis.probability })
        })
        .collect();
    carried["method"] = json!(transfer.report.settings.method);
    carried["confidence"] = json!(transfer.confidence);
    carried["verdict"] = json!(transfer.verdict);
    carried["hypotheses"] = json!(hypotheses);
    carried
}

/// The report of a transfer; `about` is put into it as it is.
pub fn report_json(
    source: &PreparedObject,
    target: &PreparedObject,
    transfer: &Transfer,
    about: Map<String, Value>,
) -> Value {
    let mut report = json!({
        "format": "semfm.report/1",
        "confidence": transfer.confidence,
        "verdict": transfer.verdict,
        "source": object_json(source),
        "target": object_json(target),
    });
    let stages =
        stages_ms(source, target, transfer).into_iter().map(|(name, ms)| (name, json!(ms)));
    if let Value::Object(details) = json!(transfer.report) {
        for (key, value) in details {
            report[key] = value;
        }
    }
    report["stages_ms"] = Value::Object(stages.collect());
    for (key, value) in about {
        report[key] = value;
    }
    report
}

/// Milliseconds of every stage, preparation of both objects included.
pub fn stages_ms(
    source: &PreparedObject,
    target: &PreparedObject,
    transfer: &Transfer,
) -> Vec<(String, f64)> {
    let of = |side: &'static str, object: &PreparedObject| {
        object
            .stages_ms
            .iter()
            .map(move |&(name, ms)| (format!("{name}_{side}"), ms))
            .collect::<Vec<_>>()
    };
    let mut stages = of("source", source);
    stages.extend(of("target", target));
    stages.extend(transfer.report.stages_ms.iter().map(|(name, ms)| (name.to_owned(), ms)));
    stages
}

fn object_json(object: &PreparedObject) -> Value {
    let mesh = object.shape.original();
    let mut value = json!({
        "mesh": MeshIdentity::of(mesh),
        "shape": object.shape.report(),
        "from_cache": object.from_cache,
        "cloud": { "n_points": object.cloud.n_points(), "dim": object.cloud.dim() },
    });
    if let Some(lifted) = &object.lifted {
        value["cloud"]["n_seen"] = json!(lifted.n_seen);
        value["cloud"]["lifted_by_view"] = json!(lifted.lifted_by_view);
    }
    value
}
