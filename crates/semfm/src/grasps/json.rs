//! `grasps.json`: format `semfm.grasps/1`.

use std::path::Path;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Shape, TypedShape};
use semfm_geom::MeshIdentity;
use semfm_geom::io::write_json;
use semfm_grasp::Grasp;
use semfm_robot::{Gripper, GripperPart, Role};
use serde_json::{Map, Value, json};

use super::{GraspAnswer, position_and_rotation};
use crate::Result;

/// The format that is written.
pub const FORMAT: &str = "semfm.grasps/1";

/// Writes `grasps.json`, whole or not at all. `about` is put into the file as it is.
///
/// # Errors
/// [`semfm_geom::Error::Io`] where the file cannot be written.
pub fn write_grasps(
    path: &Path,
    answer: &GraspAnswer<'_>,
    about: Map<String, Value>,
) -> Result<()> {
    let mut value = grasps_json(answer);
    for (key, entry) in about {
        value[key] = entry;
    }
    Ok(write_json(path, &value)?)
}

/// The content of `grasps.json`. Matrices are 4 × 4, row-major, points as columns; lengths are
/// metres; quaternions are x, y, z, w. `hand` lists the poses of the gripper's parts at a grasp, so
/// that anybody can check a grasp with nothing but this file and the mesh.
pub fn grasps_json(answer: &GraspAnswer<'_>) -> Value {
    let found = answer.found;
    let grasps: Vec<Value> = found.grasps.iter().map(|grasp| grasp_json(answer, grasp)).collect();
    let rejected: Map<String, Value> = found
        .rejected
        .iter()
        .map(|(reason, count)| (reason.name().to_owned(), json!(count)))
        .collect();
    json!({
        "format": FORMAT,
        "mesh": MeshIdentity::of(answer.mesh),
        "object_scale": answer.object_scale,
        "camera_from_object": answer.camera_from_object.map(rows),
        "gripper": gripper_json(answer.gripper),
        "grasps": grasps,
        "rejected": rejected,
        "nearest_miss": found.nearest_miss.as_ref().map(|miss| {
            json!({
                "reason": miss.reason.name(),
                "explanation": miss.reason.explanation(),
                "by": miss.by,
                "unit": miss.reason.unit(),
                "object_from_tcp": rows(miss.grasp.object_from_tcp),
            })
        }),
        "n_candidates": found.n_candidates,
        "n_survivors": found.n_survivors,
    })
}

fn grasp_json(answer: &GraspAnswer<'_>, grasp: &Grasp) -> Value {
    let (frame, pose) = answer.framed(grasp.object_from_tcp);
    let (position, rotation) = position_and_rotation(pose);
    let terms: Map<String, Value> =
        grasp.terms.iter().map(|&(name, value)| (name.to_owned(), json!(value))).collect();
    // The robot holds the flange still while the fingers close; a linkage carries the pads along z,
    // so the open hand has its own TCP, seen here from that of the closed one.
    let flange_from_tcp = |width: f64| answer.gripper.flange_from_tcp_at(width);
    let hand = |width: f64| -> Vec<Value> {
        let shift = flange_from_tcp(grasp.width).inverse() * flange_from_tcp(width);
        let parts = answer.gripper.parts_at(width).into_iter();
        parts.map(|posed| json!(rows(shift * posed.tcp_from_part))).collect()
    };
    json!({
        "object_from_tcp": rows(grasp.object_from_tcp),
        "flange_from_tcp": rows(flange_from_tcp(grasp.width)),
        "camera_from_tcp": answer.camera_from_object.map(|_| rows(pose)),
        "frame": frame,
        "position": position.to_array(),
        "quaternion_xyzw": rotation.to_array(),
        "width": grasp.width,
        "opening": grasp.opening,
        "contacts": grasp.contacts.map(|point| point.to_array()),
        "normals": grasp.normals.map(|normal| normal.to_array()),
        "epsilon": grasp.epsilon,
        "score": grasp.score,
        "terms": terms,
        "hand": { "closed": hand(grasp.width), "open": hand(grasp.opening) },
    })
}

fn gripper_json(gripper: &Gripper) -> Value {
    json!({
        "name": gripper.name,
        "opening": [gripper.opening.start(), gripper.opening.end()],
        "pad": gripper.pad,
        "flange_from_tcp": rows(gripper.flange_from_tcp),
        "parts": gripper.parts.iter().map(part_json).collect::<Vec<_>>(),
    })
}

/// A part as the convex hulls of point sets, in its own frame.
fn part_json(part: &GripperPart) -> Value {
    let role = match part.role {
        Role::Palm => "palm",
        Role::Left => "left",
        Role::Right => "right",
    };
    let mut hulls = Vec::new();
    add_hulls(&*part.shape, Pose::IDENTITY, &mut hulls);
    json!({ "link": part.link, "role": role, "hulls": hulls })
}

/// The corners of each convex piece of a shape.
fn add_hulls(shape: &dyn Shape, pose: Pose, hulls: &mut Vec<Vec<[f64; 3]>>) {
    let corners = match shape.as_typed_shape() {
        TypedShape::Cuboid(cuboid) => cuboid.to_trimesh().0,
        TypedShape::ConvexPolyhedron(hull) => hull.points().to_vec(),
        TypedShape::Compound(compound) => {
            for (part_pose, part) in compound.shapes() {
                add_hulls(&**part, pose * *part_pose, hulls);
            }
            return;
        }
        _ => return,
    };
    hulls.push(corners.into_iter().map(|p| (pose * p).to_array()).collect());
}

/// A pose as rows of a 4 × 4 matrix.
pub(crate) fn rows(pose: Pose) -> [[f64; 4]; 4] {
    pose.to_mat4().transpose().to_cols_array_2d()
}
