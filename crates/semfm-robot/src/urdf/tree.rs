//! The kinematic tree of a description whose checks found nothing.

use std::collections::{HashMap, VecDeque};

use glam::EulerRot;
use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3};

use super::fault::Fault;
use crate::joint::{Joint, JointKind, JointLimits, Mimic, SafetyController};
use crate::link::{Geometry, Inertial, Link, LinkGeometry};
use crate::robot::Robot;

/// The links at the ends of a joint.
#[derive(Clone, Copy)]
struct Ends {
    parent: usize,
    child: usize,
}

/// The tree, joints from the root outwards.
pub(crate) fn build(robot: &urdf_rs::Robot) -> Result<Robot, Fault> {
    let by_name: HashMap<&str, usize> =
        robot.links.iter().enumerate().map(|(i, link)| (link.name.as_str(), i)).collect();
    let mut ends = Vec::new();
    for joint in &robot.joints {
        let parent = link_by_name(&by_name, &joint.parent.link)?;
        ends.push(Ends { parent, child: link_by_name(&by_name, &joint.child.link)? });
    }
    let mut is_child = vec![false; robot.links.len()];
    ends.iter().for_each(|ends| is_child[ends.child] = true);
    let Some(root) = is_child.iter().position(|is_child| !is_child) else {
        return Err(Fault::new("tree", "robot", "a root", "none"));
    };
    let order = outwards(root, robot.links.len(), &ends);
    if order.len() != ends.len() {
        return Err(Fault::new("tree", "robot", "joints that hang together", "some that do not"));
    }
    let mut rank = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, &old)| rank[old] = new);
    let by_joint: HashMap<&str, usize> =
        robot.joints.iter().enumerate().map(|(i, joint)| (joint.name.as_str(), rank[i])).collect();
    let mut joints = Vec::new();
    for &old in &order {
        joints.push(joint(&robot.joints[old], ends[old], &by_joint)?);
    }
    let links = robot.links.iter().map(link).collect();
    Ok(Robot { name: robot.name.clone(), links, joints, root })
}

fn link_by_name(by_name: &HashMap<&str, usize>, name: &str) -> Result<usize, Fault> {
    by_name
        .get(name)
        .copied()
        .ok_or_else(|| Fault::new("reference", "robot", "a link", format!("`{name}`")))
}

/// Joints so that each comes after the one that leads to its parent.
fn outwards(root: usize, n_links: usize, ends: &[Ends]) -> Vec<usize> {
    let mut joints_on = vec![Vec::new(); n_links];
    for (joint, ends) in ends.iter().enumerate() {
        joints_on[ends.parent].push(joint);
    }
    let (mut order, mut front) = (Vec::new(), VecDeque::from([root]));
    while let Some(link) = front.pop_front() {
        // Each link is left once: a second parent would bring its joints in again.
        for joint in std::mem::take(&mut joints_on[link]) {
            order.push(joint);
            front.push_back(ends[joint].child);
        }
    }
    order
}

fn joint(
    joint: &urdf_rs::Joint,
    ends: Ends,
    by_name: &HashMap<&str, usize>,
) -> Result<Joint, Fault> {
    let mimic = match &joint.mimic {
        Some(mimic) => Some(Mimic {
            joint: *by_name.get(mimic.joint.as_str()).ok_or_else(|| {
                Fault::new("reference", joint.name.clone(), "a joint", mimic.joint.clone())
            })?,
            multiplier: mimic.multiplier.unwrap_or(1.0),
            offset: mimic.offset.unwrap_or(0.0),
        }),
        None => None,
    };
    Ok(Joint {
        name: joint.name.clone(),
        kind: kind(&joint.joint_type),
        parent: ends.parent,
        child: ends.child,
        parent_from_joint: pose(&joint.origin),
        axis: vector(&joint.axis.xyz).normalize_or(DVec3::X),
        limits: limits(joint),
        mimic,
        safety: joint.safety_controller.as_ref().map(|safety| SafetyController {
            soft_limits: [safety.soft_lower_limit, safety.soft_upper_limit],
            k_position: safety.k_position,
            k_velocity: safety.k_velocity,
        }),
    })
}

fn kind(kind: &urdf_rs::JointType) -> JointKind {
    match kind {
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Continuous => JointKind::Continuous,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Floating => JointKind::Floating,
        urdf_rs::JointType::Planar => JointKind::Planar,
        urdf_rs::JointType::Spherical => JointKind::Spherical,
    }
}

/// The specification demands velocity and effort, and files that leave them out are read as 0: a
/// joint that never moves would be `fixed`, so 0 counts as not told.
fn limits(joint: &urdf_rs::Joint) -> JointLimits {
    let limited =
        matches!(joint.joint_type, urdf_rs::JointType::Revolute | urdf_rs::JointType::Prismatic);
    let [velocity, effort] = [joint.limit.velocity, joint.limit.effort]
        .map(|most| (most > 0.0 && most.is_finite()).then_some(most));
    let position = limited.then_some([joint.limit.lower, joint.limit.upper]);
    JointLimits { position, velocity, effort }
}

fn link(link: &urdf_rs::Link) -> Link {
    let urdf_rs::Inertia { ixx, ixy, ixz, iyy, iyz, izz } = link.inertial.inertia;
    Link {
        name: link.name.clone(),
        collisions: link.collision.iter().map(|c| placed(&c.origin, &c.geometry)).collect(),
        visuals: link.visual.iter().map(|v| placed(&v.origin, &v.geometry)).collect(),
        inertial: Inertial {
            mass: link.inertial.mass.value,
            link_from_inertial: pose(&link.inertial.origin),
            moments: [ixx, iyy, izz],
            products: [ixy, ixz, iyz],
        },
    }
}

fn placed(origin: &urdf_rs::Pose, shape: &urdf_rs::Geometry) -> LinkGeometry {
    LinkGeometry { link_from_geometry: pose(origin), geometry: geometry(shape) }
}

fn geometry(geometry: &urdf_rs::Geometry) -> Geometry {
    match geometry {
        urdf_rs::Geometry::Box { size } => Geometry::Box { size: vector(size) },
        &urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
        &urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius, length },
        &urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius },
        urdf_rs::Geometry::Mesh { filename, scale } => Geometry::Mesh {
            filename: filename.clone(),
            scale: scale.as_ref().map_or(DVec3::ONE, vector),
        },
    }
}

fn vector(vector: &urdf_rs::Vec3) -> DVec3 {
    DVec3::from_array(vector.0)
}

/// Fixed-axis roll, pitch, yaw: turn about x, then y, then z.
fn pose(pose: &urdf_rs::Pose) -> Pose {
    let [roll, pitch, yaw] = pose.rpy.0;
    let rotation = DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll);
    Pose::from_parts(vector(&pose.xyz), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<robot name="arm"><link name="base"/><link name="upper"/><link name="tool"/>
        <joint name="wrist" type="fixed"><parent link="upper"/><child link="tool"/>
        <origin xyz="0 0 0.5"/></joint>
        <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
        <axis xyz="0 2 0"/><limit lower="-1" upper="2" effort="87" velocity="2.5"/>
        <safety_controller soft_lower_limit="-0.9" soft_upper_limit="1.9" k_position="100"
        k_velocity="40"/></joint></robot>"#;

    #[test]
    fn joints_go_outwards_and_keep_limits_and_safety_controller() {
        let robot = build(&urdf_rs::read_from_string(ARM).unwrap()).unwrap();
        let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(names, ["shoulder", "wrist"]);
        let shoulder = &robot.joints[0];
        assert_eq!((shoulder.kind, shoulder.axis), (JointKind::Revolute, DVec3::Y));
        let limits =
            JointLimits { position: Some([-1.0, 2.0]), velocity: Some(2.5), effort: Some(87.0) };
        assert_eq!(shoulder.limits, limits);
        assert_eq!(shoulder.safety.unwrap().soft_limits, [-0.9, 1.9]);
        assert_eq!(robot.joints[1].limits, JointLimits::default());
        let tool = robot.link("tool").unwrap();
        assert_eq!(robot.body_of(tool), robot.link("upper").unwrap());
        let pose = robot.link_poses(&[std::f64::consts::FRAC_PI_2])[tool];
        assert!((pose.translation - DVec3::X * 0.5).length() < 1e-12);
    }
}
