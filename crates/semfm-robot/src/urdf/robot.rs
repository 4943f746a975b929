//! A robot as a kinematic tree: rigid links, joints with limits, and where each link is.

use std::collections::{HashMap, VecDeque};

use glam::EulerRot;
use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3};

use super::Fault;

/// A kinematic tree, checked: one root, every joint between two of its links.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name in the file.
    pub name: String,
    /// Rigid bodies.
    pub links: Vec<Link>,
    /// Connections between them, every parent's joint before its children's.
    pub joints: Vec<Joint>,
    /// The link that no joint leads to.
    pub root: usize,
}

/// A rigid body with its solids, in its own frame, metres.
#[derive(Clone, Debug)]
pub struct Link {
    /// Name in the file.
    pub name: String,
    /// What collides.
    pub collisions: Vec<Solid>,
    /// What is seen.
    pub visuals: Vec<Solid>,
    /// Mass in kilograms, zero where none is given.
    pub mass: f64,
    /// Centre of mass and principal axes' frame, in the link's frame.
    pub link_from_inertia: Pose,
    /// Moments about the axes of that frame (xx, yy, zz), kg m².
    pub moments: [f64; 3],
}

/// A shape at its place in a link.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Its place.
    pub link_from_solid: Pose,
    /// Its shape, metres.
    pub geometry: Geometry,
}

/// Shapes of URDF, about their own origin; cylinders and capsules along z.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A box by its full edge lengths.
    Box {
        /// Lengths along x, y and z.
        size: DVec3,
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// A cylinder with half spheres at its ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length between the centres of the half spheres.
        length: f64,
    },
    /// A ball.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// A mesh file.
    Mesh {
        /// Its name as written.
        filename: String,
        /// Factors along x, y and z; a negative one mirrors.
        scale: DVec3,
    },
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis, between limits or for ever; radians.
    Turning,
    /// Slides along its axis; metres.
    Sliding,
    /// Does not move, or in a way that one number does not tell (floating, planar, spherical);
    /// it is held at zero.
    Held,
}

/// A joint between two links.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Name in the file.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// The link nearer the root.
    pub parent: usize,
    /// The link it moves.
    pub child: usize,
    /// Where it sits in its parent at zero.
    pub parent_from_joint: Pose,
    /// Unit axis in the joint's frame.
    pub axis: DVec3,
    /// Lowest and highest position; `None` for a joint that turns for ever.
    pub limits: Option<[f64; 2]>,
    /// The joint that it follows.
    pub mimic: Option<Mimic>,
}

/// `position = multiplier × position of the other + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// The other joint.
    pub joint: usize,
    /// Factor.
    pub multiplier: f64,
    /// Summand.
    pub offset: f64,
}

impl Robot {
    /// The link of that name.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// The joint that leads to a link, `None` for the root.
    pub fn joint_to(&self, link: usize) -> Option<usize> {
        self.joints.iter().position(|joint| joint.child == link)
    }

    /// The pose of every link in the root's frame. `positions` (one a joint: radians or metres)
    /// are taken as they are: limits and mimics are the caller's, see [`Robot::follow`]. A position
    /// that is not given counts as zero.
    pub fn link_poses(&self, positions: &[f64]) -> Vec<Pose> {
        let mut poses = vec![Pose::IDENTITY; self.links.len()];
        for (joint, position) in
            self.joints.iter().zip(positions.iter().copied().chain(std::iter::repeat(0.0)))
        {
            let motion = match joint.kind {
                JointKind::Turning => {
                    Pose::from_rotation(DQuat::from_axis_angle(joint.axis, position))
                }
                JointKind::Sliding => Pose::from_translation(joint.axis * position),
                JointKind::Held => Pose::IDENTITY,
            };
            poses[joint.child] = poses[joint.parent] * joint.parent_from_joint * motion;
        }
        poses
    }

    /// Positions with every mimic following its leader. Limits of followers are not applied: the
    /// mechanism couples them, and published descriptions contradict themselves there.
    pub fn follow(&self, positions: &[f64]) -> Vec<f64> {
        (0..self.joints.len()).map(|joint| self.position(joint, positions)).collect()
    }

    fn position(&self, joint: usize, positions: &[f64]) -> f64 {
        match self.joints[joint].mimic {
            // Chains end: that was checked when the description was read.
            Some(mimic) => mimic.multiplier * self.position(mimic.joint, positions) + mimic.offset,
            None => positions.get(joint).copied().unwrap_or(0.0),
        }
    }
}

/// The tree of a description whose checks found nothing.
pub(crate) fn build(robot: &urdf_rs::Robot) -> Result<Robot, Fault> {
    let by_name: HashMap<&str, usize> =
        robot.links.iter().enumerate().map(|(i, link)| (link.name.as_str(), i)).collect();
    let link = |name: &str| {
        let missing = || Fault::new("reference", "robot", "a link", format!("`{name}`"));
        by_name.get(name).copied().ok_or_else(missing)
    };
    let mut ends = Vec::new();
    for joint in &robot.joints {
        ends.push((link(&joint.parent.link)?, link(&joint.child.link)?));
    }
    let is_child = |i: usize| ends.iter().any(|&(_, child)| child == i);
    let Some(root) = (0..robot.links.len()).find(|&i| !is_child(i)) else {
        return Err(Fault::new("tree", "robot", "a root", "none"));
    };
    let order = outwards(root, &ends);
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
    let links = robot.links.iter().map(body).collect();
    Ok(Robot { name: robot.name.clone(), links, joints, root })
}

/// Joints so that each comes after the one that leads to its parent.
fn outwards(root: usize, ends: &[(usize, usize)]) -> Vec<usize> {
    let (mut order, mut front) = (Vec::new(), VecDeque::from([root]));
    while let Some(link) = front.pop_front() {
        for (joint, &(parent, child)) in ends.iter().enumerate() {
            if parent == link {
                order.push(joint);
                front.push_back(child);
            }
        }
    }
    order
}

fn joint(
    joint: &urdf_rs::Joint,
    (parent, child): (usize, usize),
    by_name: &HashMap<&str, usize>,
) -> Result<Joint, Fault> {
    use urdf_rs::JointType;
    let kind = match joint.joint_type {
        JointType::Revolute | JointType::Continuous => JointKind::Turning,
        JointType::Prismatic => JointKind::Sliding,
        _ => JointKind::Held,
    };
    let limited = matches!(joint.joint_type, JointType::Revolute | JointType::Prismatic);
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
        kind,
        parent,
        child,
        parent_from_joint: pose(&joint.origin),
        axis: vector(&joint.axis.xyz).normalize_or(DVec3::X),
        limits: limited.then_some([joint.limit.lower, joint.limit.upper]),
        mimic,
    })
}

fn body(link: &urdf_rs::Link) -> Link {
    let solid = |origin, shape| Solid { link_from_solid: pose(origin), geometry: geometry(shape) };
    let inertia = &link.inertial.inertia;
    Link {
        name: link.name.clone(),
        collisions: link.collision.iter().map(|c| solid(&c.origin, &c.geometry)).collect(),
        visuals: link.visual.iter().map(|v| solid(&v.origin, &v.geometry)).collect(),
        mass: link.inertial.mass.value,
        link_from_inertia: pose(&link.inertial.origin),
        moments: [inertia.ixx, inertia.iyy, inertia.izz],
    }
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
