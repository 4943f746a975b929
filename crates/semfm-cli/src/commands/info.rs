//! `semfm-cli info`: what is in a file, or why it is refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use semfm::geom::connectivity::MeshReport;
use semfm::geom::io::{MeshFormat, printable_name, read_at_most, read_mesh};
use semfm::memory::Memory;
use semfm::robot::{Arm, ArmJoint, ArmSettings, MeshPaths, MeshPlace, RobotDescription};
use semfm::views::mcap::inspect;
use serde_json::{Value, json};

use super::Outcome;
use crate::console;
use crate::options::{Common, parse_package};

/// Say what is in a mesh, MCAP or URDF file or in a memory, or why it is refused
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli info mug.obj mug.emb.mcap --json\n\n\
    With --json, one object a line: `kind` and counts, or `error` with code, message and place.")]
pub struct InfoCommand {
    #[arg(
        required = true,
        help = format!("Mesh files ({}), MCAP files, robots (URDF) and memories (folders)", MeshFormat::readable_names())
    )]
    files: Vec<PathBuf>,
    /// Folder of a package that a URDF names as package://NAME/…; may be given again
    #[arg(long = "package", value_name = "NAME=DIR", value_parser = parse_package)]
    packages: Vec<(String, PathBuf)>,
}

impl InfoCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let mut outcome = Outcome::Done;
        let packages = self.packages.into_iter().collect();
        for path in &self.files {
            let report = match look(path, &packages) {
                Ok(report) => report,
                Err(error) => {
                    outcome = Outcome::Refused;
                    let (code, place) = (error.code(), error.place());
                    json!({ "error": { "code": code, "message": error.to_string(), "place": place } })
                }
            };
            if common.json {
                let mut line = json!({ "file": path.display().to_string() });
                line.as_object_mut()
                    .into_iter()
                    .for_each(|line| line.extend(report.as_object().cloned().unwrap_or_default()));
                console::data(line);
            } else if let Some(error) = report.get("error") {
                console::message(format_args!(
                    "error: {}",
                    error["message"].as_str().unwrap_or_default()
                ));
            } else {
                show(path, &report);
            }
        }
        Ok(outcome)
    }
}

/// The report on one file.
fn look(path: &Path, packages: &BTreeMap<String, PathBuf>) -> semfm::Result<Value> {
    if path.is_dir() {
        return look_at_memory(path);
    }
    if is_mcap(path) {
        let report = serde_json::to_value(inspect(path)?);
        return Ok(with_kind("mcap", report.unwrap_or_default()));
    }
    if is_urdf(path) {
        return look_at_urdf(path, packages);
    }
    let file = read_mesh(path)?;
    let report = serde_json::to_value(MeshReport::new(&file.mesh));
    let mut value = with_kind("mesh", report.unwrap_or_default());
    let (low, high) = file.mesh.bounds();
    value["n_vertices"] = json!(file.mesh.n_vertices());
    value["n_faces"] = json!(file.n_faces);
    value["n_triangles"] = json!(file.mesh.n_faces());
    value["hash"] = json!(file.mesh.hash().to_string());
    value["area"] = json!(file.mesh.area());
    value["bounds"] = json!([low.to_array(), high.to_array()]);
    value["size"] = json!((high - low).to_array());
    value["format"] = json!(file.format.name());
    value["has_colors"] = json!(!file.appearance.is_plain());
    value["notes"] = json!(file.appearance.notes);
    Ok(value)
}

/// The report on a memory: its encoder, and what each demonstration is.
fn look_at_memory(path: &Path) -> semfm::Result<Value> {
    let memory = Memory::open(path)?;
    let entries: Vec<Value> = memory
        .entries()
        .iter()
        .map(|entry| {
            json!({
                "name": entry.name,
                "kind": entry.kind,
                "n_region": entry.n_region,
                "n_vertices": entry.mesh.n_vertices,
                "hash": entry.mesh.hash.to_string(),
                "provenance": entry.provenance,
            })
        })
        .collect();
    Ok(
        json!({ "kind": "memory", "encoder": memory.encoder(), "n_entries": entries.len(), "entries": entries }),
    )
}

/// The report on a robot: counts, what keeps it from being one tree, and meshes that are missing.
fn look_at_urdf(path: &Path, packages: &BTreeMap<String, PathBuf>) -> semfm::Result<Value> {
    let description = RobotDescription::read(path)?;
    let meshes = description.meshes(&MeshPaths::new(path, packages))?;
    let missing: Vec<Value> = meshes
        .iter()
        .filter_map(|mesh| match &mesh.place {
            MeshPlace::Found(_) => None,
            MeshPlace::Missing(why) => {
                Some(json!({ "link": mesh.link, "filename": mesh.filename, "reason": why }))
            }
        })
        .collect();
    let arm = look_for_arm(&description);
    Ok(json!({
        "kind": "urdf",
        "name": description.name(),
        "links": description.n_links(),
        "joints": description.n_joints(),
        "movable_joints": description.n_movable(),
        "roots": description.roots(),
        "meshes": meshes.len(),
        "missing_meshes": missing,
        "tree": description.tree_findings(),
        "notes": description.notes(),
        "arm": arm,
    }))
}

/// The arm of a robot: ends, joints with limits, what was assumed; or why none is found. `null` for a fragment.
fn look_for_arm(description: &RobotDescription) -> Value {
    let Ok(robot) = description.tree() else { return Value::Null };
    let arm = match Arm::new(Arc::new(robot), &ArmSettings::default()) {
        Ok(arm) => arm,
        Err(error) => return json!({ "none": error.to_string() }),
    };
    let link = |index: usize| &arm.robot().links[index].name;
    // Infinite limits are null: JSON has no infinity.
    let joint = |joint: &ArmJoint| {
        json!({
            "name": joint.name,
            "kind": joint.kind.name(),
            "lower": joint.lower,
            "upper": joint.upper,
            "velocity": joint.velocity,
            "acceleration": joint.acceleration,
        })
    };
    json!({
        "base": link(arm.base()),
        "tip": link(arm.tip()),
        "joints": arm.joints().iter().map(joint).collect::<Vec<Value>>(),
        "assumed": arm.notes(),
    })
}

/// URDF by its extension, or by a first element where no other extension speaks against it.
fn is_urdf(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if extension.eq_ignore_ascii_case("urdf") || extension.eq_ignore_ascii_case("xacro") {
        return true;
    }
    MeshFormat::from_path(path).is_none()
        && read_at_most(path, 64).is_ok_and(|start| {
            let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start).trim_ascii_start();
            text.starts_with(b"<?xml") || text.starts_with(b"<robot")
        })
}

/// MCAP by its extension or by its first bytes; a mesh's extension wins over the bytes.
fn is_mcap(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if extension.eq_ignore_ascii_case("mcap") {
        return true;
    }
    MeshFormat::from_path(path).is_none()
        && read_at_most(path, 8).is_ok_and(|start| start == b"\x89MCAP0\r\n")
}

fn with_kind(kind: &str, report: Value) -> Value {
    let mut value = json!({ "kind": kind });
    if let (Some(value), Value::Object(report)) = (value.as_object_mut(), report) {
        value.extend(report);
    }
    value
}

/// The report as a table for people.
fn show(path: &Path, report: &Value) {
    console::data(printable_name(&path.display().to_string()));
    for (key, value) in report.as_object().into_iter().flatten() {
        match value {
            Value::Array(items) if items.is_empty() => {}
            Value::Null => {}
            Value::Array(entries) if key == "entries" => entries.iter().for_each(show_entry),
            Value::Array(items) if items.iter().any(Value::is_object) => {
                console::data(format_args!("  {key}"));
                items.iter().for_each(|item| console::data(format_args!("    {item}")));
            }
            Value::String(text) => console::data(format_args!("  {key:24} {text}")),
            Value::Object(arm) if key == "arm" => show_arm(arm),
            Value::Array(sides) if key == "size" => {
                let sides: Vec<String> = sides
                    .iter()
                    .map(|x| format!("{:.4}", x.as_f64().unwrap_or_default()))
                    .collect();
                // A mesh has no unit of its own: metres matter where one is said.
                console::data(format_args!("  {key:24} {} in the mesh's unit", sides.join(" × ")));
            }
            other => console::data(format_args!("  {key:24} {other}")),
        }
    }
}

/// A demonstration of a memory as a line.
fn show_entry(entry: &Value) {
    let text = |value: &Value| printable_name(value.as_str().unwrap_or("-")).into_owned();
    console::data(format_args!(
        "    {:24} {:16} {} of {} vertices, from {}",
        text(&entry["name"]),
        text(&entry["kind"]),
        entry["n_region"],
        entry["n_vertices"],
        text(&entry["provenance"]["mesh_file"])
    ));
}

/// The arm as a table: a line a joint.
fn show_arm(arm: &serde_json::Map<String, Value>) {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    if let Some(none) = arm.get("none") {
        console::data(format_args!("  {:24} none: {}", "arm", text(none)));
        return;
    }
    let ends = format!("{} to {}", text(&arm["base"]), text(&arm["tip"]));
    console::data(format_args!("  {:24} {ends}", "arm"));
    for joint in arm["joints"].as_array().into_iter().flatten() {
        let number = |key: &str| joint[key].as_f64().map_or("unlimited".into(), |x| format!("{x}"));
        let range = match (joint["lower"].is_null(), joint["upper"].is_null()) {
            (true, true) => "unlimited".to_owned(),
            _ => format!("{} to {}", number("lower"), number("upper")),
        };
        let (name, kind) = (text(&joint["name"]), text(&joint["kind"]));
        console::data(format_args!(
            "    {name:22} {kind}, {range}; velocity {}, acceleration {}",
            number("velocity"),
            number("acceleration")
        ));
    }
    for note in arm["assumed"].as_array().into_iter().flatten() {
        console::data(format_args!("    {}", text(note)));
    }
}
