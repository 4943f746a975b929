//! An animated model of a motion: one glTF node per frame, moved by one animation.
//!
//! glTF 2.0 (Khronos, 2021), section 3.11. Its y points up, so everything stands in a node that turns z there. A node
//! of a link stands in that of the link it hangs on and only turns or slides about its joint, so viewers, which mix
//! rotations along the arc, move it exactly as the joint does.

use std::path::Path;

use semfm::PlannedMotion;
use semfm::geom::io::{refuse_input, write_atomically, write_glb};
use semfm::geom::math::DVec3;
use semfm::robot::Pose;
use serde_json::{Value, json};

use super::bodies::{Body, MotionBodies};
use super::frame_tracks::FrameTracks;
use crate::Result;
use crate::surface::Surface;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// x, y, z, w: from z up to y up.
const UPRIGHT: [f64; 4] =
    [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];

/// Writes the motion as a GLB, whole or not at all: a node for each link, part of the hand, the object and each
/// obstacle, named as it is, and one animation from the start to the end. Without the animation everything stands as at
/// the start.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where a mesh of the robot cannot be read or the file cannot be written.
pub fn write_animated_glb(path: &Path, motion: &PlannedMotion) -> Result<()> {
    let bodies = MotionBodies::new(&motion.scene)?;
    write_glb_of(path, motion, &bodies, &FrameTracks::new(motion))
}

/// The same of bodies and samples that are there already.
pub(super) fn write_glb_of(
    path: &Path,
    motion: &PlannedMotion,
    bodies: &MotionBodies,
    tracks: &FrameTracks,
) -> Result<()> {
    let mut arrays = Arrays::default();
    let meshes: Vec<Value> =
        bodies.bodies.iter().enumerate().map(|(i, body)| mesh(body, i, &mut arrays)).collect();
    let materials: Vec<Value> = bodies.bodies.iter().map(|body| material(body, bodies)).collect();
    let mut root = json!({
        "asset": {"version": "2.0", "generator": concat!("SemFM ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes(motion, bodies, tracks),
    });
    if !meshes.is_empty() {
        root["meshes"] = meshes.into();
        root["materials"] = materials.into();
    }
    if let Some(animation) = animation(bodies, tracks, &mut arrays) {
        root["animations"] = json!([animation]);
    }
    if !arrays.bytes.is_empty() {
        root["accessors"] = arrays.accessors.into();
        root["bufferViews"] = arrays.views.into();
        root["buffers"] = json!([{"byteLength": arrays.bytes.len()}]);
    }
    refuse_input(path)?;
    Ok(write_atomically(path, |out| {
        write_glb(out, &root, arrays.bytes.len(), |out| out.write_all(&arrays.bytes))
    })?)
}

/// Node 0 turns z upwards, node 1 + k is frame k.
fn nodes(motion: &PlannedMotion, bodies: &MotionBodies, tracks: &FrameTracks) -> Vec<Value> {
    let children = |parent: Option<usize>| -> Vec<usize> {
        let frames = bodies.frames.iter().enumerate();
        frames.filter(|(_, frame)| frame.parent == parent).map(|(k, _)| k + 1).collect()
    };
    let mut nodes =
        vec![json!({"name": "base frame, z up", "rotation": UPRIGHT, "children": children(None)})];
    for (k, frame) in bodies.frames.iter().enumerate() {
        let pose = match (frame.parent, tracks.poses.first()) {
            (Some(_), Some(poses)) => poses[k],
            // The root stands where it is seen from the base.
            (None, Some(poses)) => motion.scene.in_base(&bodies.frames, poses)[k],
            (_, None) => Pose::IDENTITY,
        };
        let mut node = json!({
            "name": frame.name,
            "translation": pose.translation.to_array(),
            "rotation": pose.rotation.to_array(),
        });
        let inside = children(Some(k));
        if !inside.is_empty() {
            node["children"] = inside.into();
        }
        if let Some(body) = bodies.bodies.iter().position(|body| body.frame == k) {
            node["mesh"] = body.into();
        }
        nodes.push(node);
    }
    nodes
}

/// The `i`-th body, in the material of the same number.
fn mesh(body: &Body, i: usize, arrays: &mut Arrays) -> Value {
    let Surface { vertices, faces } = &body.surface;
    let position = arrays.add_vectors(vertices, true);
    let normal = arrays.add_vectors(&body.surface.normals(), false);
    let indices = arrays.add(
        faces.as_flattened().iter().flat_map(|id| id.to_le_bytes()),
        Some(ELEMENT_ARRAY_BUFFER),
        json!({"componentType": UNSIGNED_INT, "type": "SCALAR", "count": 3 * faces.len()}),
    );
    let attributes = json!({"POSITION": position, "NORMAL": normal});
    json!({"primitives": [{"attributes": attributes, "indices": indices, "material": i}]})
}

fn material(body: &Body, bodies: &MotionBodies) -> Value {
    // glTF's colours are linear: IEC 61966-2-1.
    let linear = |c: f32| {
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let [r, g, b] = body.color.map(linear);
    json!({
        "name": bodies.name(body),
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7,
        },
    })
}

/// A channel for each rotation and translation that changes; `None` where nothing moves.
fn animation(bodies: &MotionBodies, tracks: &FrameTracks, arrays: &mut Arrays) -> Option<Value> {
    let moving: Vec<usize> =
        (0..bodies.frames.len()).filter(|&frame| tracks.moves(frame)).collect();
    if moving.is_empty() {
        return None;
    }
    let times: Vec<f64> = tracks.points.iter().map(|point| point.time).collect();
    let input = arrays.add_times(&times);
    let (mut channels, mut samplers) = (Vec::new(), Vec::new());
    for frame in moving {
        let track = tracks.track(frame);
        let mut add = |path: &str, output: Value| {
            channels.push(json!({
                "sampler": samplers.len(), "target": {"node": frame + 1, "path": path},
            }));
            samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
        };
        if track.iter().any(|pose| pose.rotation != track[0].rotation) {
            let numbers = track.iter().flat_map(|pose| pose.rotation.normalize().to_array());
            let rotation = json!({"componentType": FLOAT, "type": "VEC4", "count": track.len()});
            add("rotation", arrays.add(floats(numbers), None, rotation));
        }
        if track.iter().any(|pose| pose.translation != track[0].translation) {
            let numbers = track.iter().flat_map(|pose| pose.translation.to_array());
            let translation = json!({"componentType": FLOAT, "type": "VEC3", "count": track.len()});
            add("translation", arrays.add(floats(numbers), None, translation));
        }
    }
    Some(json!({"name": "motion", "channels": channels, "samplers": samplers}))
}

fn floats(numbers: impl Iterator<Item = f64>) -> impl Iterator<Item = u8> {
    numbers.flat_map(|x| (x as f32).to_le_bytes())
}

/// Arrays one after the other in one buffer; all have elements of 4 bytes or a multiple.
#[derive(Default)]
struct Arrays {
    accessors: Vec<Value>,
    views: Vec<Value>,
    bytes: Vec<u8>,
}

impl Arrays {
    /// Adds an array and returns the number of its accessor.
    fn add(
        &mut self,
        bytes: impl Iterator<Item = u8>,
        target: Option<u32>,
        mut accessor: Value,
    ) -> Value {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let mut view = json!({
            "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start,
        });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        accessor["bufferView"] = self.views.len().into();
        self.views.push(view);
        self.accessors.push(accessor);
        (self.accessors.len() - 1).into()
    }

    /// Points, with their bounds, or directions.
    fn add_vectors(&mut self, vectors: &[DVec3], with_bounds: bool) -> Value {
        let mut accessor = json!({"componentType": FLOAT, "type": "VEC3", "count": vectors.len()});
        if let Some((low, high)) = semfm::geom::math::bounds(vectors).filter(|_| with_bounds) {
            accessor["min"] = json!(low.as_vec3().to_array());
            accessor["max"] = json!(high.as_vec3().to_array());
        }
        let numbers = vectors.iter().flat_map(|v| v.to_array());
        self.add(floats(numbers), Some(ARRAY_BUFFER), accessor)
    }

    /// Times of samples, ascending.
    fn add_times(&mut self, times: &[f64]) -> Value {
        let end = |time: Option<&f64>| time.copied().unwrap_or(0.0) as f32;
        let accessor = json!({
            "componentType": FLOAT, "type": "SCALAR", "count": times.len(),
            "min": [end(times.first())], "max": [end(times.last())],
        });
        self.add(floats(times.iter().copied()), None, accessor)
    }
}
