//! Everything that a transfer leaves behind: files for programs, for people and for viewers.

use std::path::{Path, PathBuf};

use semfm_geom::io::{Paint, write_painted_mesh};
use semfm_geom::{Mesh, Task};
use serde_json::{Map, Value, json};

use crate::picture::{weight_colors, write_picture};
use crate::region_file::{region_json, write_json};
use crate::{PreparedObject, Region, Result, Transfer};

/// Writes a transfer into `folder`, which is made if it is not there: `region.json`,
/// `report.json`, `point_map.json`, `source.ply`, `target.ply`, `target.glb`, `transfer.png` and (feature
/// `mcap`) `transfer.mcap`. Each file is written whole or not at all. `about` is put into the
/// report as it is.
///
/// # Errors
/// The first file that cannot be written.
pub fn write_transfer(
    folder: &Path,
    source: &PreparedObject,
    target: &PreparedObject,
    region: &Region,
    transfer: &Transfer,
    about: Map<String, Value>,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder)
        .map_err(|source| semfm_geom::Error::Io { path: folder.to_owned(), source })?;
    let at = |name: &str| folder.join(name);
    let mesh = target.shape.original();
    let report = report_json(source, target, transfer, about);

    write_json(&at("region.json"), &carried_json(target, transfer))?;
    write_json(&at("report.json"), &report)?;
    write_json(
        &at("point_map.json"),
        &json!({
            "format": "semfm.point_map/1",
            "source": source.shape.original().hash().to_string(),
            "target": mesh.hash().to_string(),
            "source_of": transfer.point_map.source_of,
        }),
    )?;
    write_weighted(&[at("source.ply")], source.shape.original(), region.weights())?;
    write_weighted(&[at("target.ply"), at("target.glb")], mesh, transfer.weights())?;
    write_picture(&at("transfer.png"), source, target, region, transfer, task)?;
    let mut names = vec![
        "region.json",
        "report.json",
        "point_map.json",
        "source.ply",
        "target.ply",
        "target.glb",
        "transfer.png",
    ];
    #[cfg(feature = "mcap")]
    {
        scene::write(&at("transfer.mcap"), source, target, region, transfer, &report)?;
        names.push("transfer.mcap");
    }
    Ok(names.into_iter().map(at).collect())
}

/// A mesh as read with a weight per vertex, as property and as colour.
fn write_weighted(paths: &[PathBuf], mesh: &Mesh, weights: &[f64]) -> Result<()> {
    let bytes = |[r, g, b]: [f32; 3]| [r, g, b, 1.0].map(|c: f32| (c * 255.0).round() as u8);
    let colors: Vec<[u8; 4]> = weight_colors(weights).into_iter().map(bytes).collect();
    let paint = Paint { colors: Some(&colors), scalars: &[("weight", weights)] };
    Ok(paths.iter().try_for_each(|path| write_painted_mesh(path, mesh, &paint))?)
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

fn report_json(
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
        "mesh": {
            "n_vertices": mesh.n_vertices(),
            "n_triangles": mesh.n_faces(),
            "hash": mesh.hash().to_string(),
        },
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

#[cfg(feature = "mcap")]
mod scene {
    //! `transfer.mcap`: both objects with their clouds, for Foxglove and its like.

    use semfm_geom::SemanticCloud;
    use semfm_views::mcap::{SceneMesh, ScenePoints, write_scene};

    use super::*;
    use crate::fmap::features::{CentredFeatures, JointFeatures};

    pub(super) fn write(
        path: &Path,
        source: &PreparedObject,
        target: &PreparedObject,
        region: &Region,
        transfer: &Transfer,
        report: &Value,
    ) -> Result<()> {
        let [source_meaning, target_meaning] = meaning_colors(&source.cloud, &target.cloud)?;
        let bytes = |weights: &[f64]| -> Vec<[u8; 3]> {
            let colors = weight_colors(weights).into_iter();
            colors.map(|c| c.map(|x| (x * 255.0).round() as u8)).collect()
        };
        let (marked, carried) = (bytes(region.weights()), bytes(transfer.weights()));
        let (source_mesh, target_mesh) = (source.shape.original(), target.shape.original());
        let meshes = [
            SceneMesh {
                topic: "/source/mesh",
                frame_id: "source",
                vertices: source_mesh.vertices(),
                faces: source_mesh.faces(),
                colors: Some(&marked),
            },
            SceneMesh {
                topic: "/target/mesh",
                frame_id: "target",
                vertices: target_mesh.vertices(),
                faces: target_mesh.faces(),
                colors: Some(&carried),
            },
        ];
        let clouds = [
            ScenePoints {
                topic: "/source/cloud",
                frame_id: "source",
                points: source.cloud.points(),
                colors: &source_meaning,
            },
            ScenePoints {
                topic: "/target/cloud",
                frame_id: "target",
                points: target.cloud.points(),
                colors: &target_meaning,
            },
        ];
        Ok(write_scene(path, "semfm.transfer/1", &meshes, &clouds, report)?)
    }

    /// The first three principal directions of the pair's features as colours, in one basis.
    fn meaning_colors(source: &SemanticCloud, target: &SemanticCloud) -> Result<[Vec<[u8; 3]>; 2]> {
        let (source, target) = (CentredFeatures::new(source)?, CentredFeatures::new(target)?);
        let joint = JointFeatures::new(&source, &target, 3)?;
        // Features have unit RMS length: this much on each side of grey shows all but the outliers.
        let spread = 1.5;
        let colors = |features: faer::MatRef<'_, f64>| {
            let channel = |i: usize, c: usize| {
                if c < features.ncols() { features[(i, c)] / (2.0 * spread) + 0.5 } else { 0.5 }
            };
            let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
            (0..features.nrows()).map(|i| std::array::from_fn(|c| byte(channel(i, c)))).collect()
        };
        Ok([colors(joint.source.as_ref()), colors(joint.target.as_ref())])
    }
}
