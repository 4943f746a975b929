//! What stands in the frames of a scene, as surfaces with colours.

use std::collections::BTreeSet;

use semfm::files::PartRecord;
use semfm::geom::math::{DAffine3, DMat3, DVec3};
use semfm::robot::{LinkSurface, Pose};
use semfm::{FrameOwner, MotionFrame, MotionScene, ObstacleShape, SceneState};

use crate::Result;
use crate::colors::{HandColors, OBJECT, OBSTACLE, TABLE, link_color};
use crate::hand::{PartKind, drawn_piece};
use crate::surface::Surface;

/// The drawn part of a table reaches so far from the base, metres.
const TABLE_REACH: f64 = 1.0;
/// Most points of a cloud that are drawn, and the side of the cube that stands for one, metres.
const N_POINTS: usize = 3000;
const POINT_SIDE: f64 = 0.004;

/// What a body is, for its colour and for the choice of what is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BodyKind {
    /// A link of the arm.
    Link,
    /// A link that moves with the fingers, or a part of a mounted hand.
    Hand,
    /// The object.
    Object,
    /// An obstacle.
    Obstacle,
    /// A table, which has no end.
    Table,
}

/// A body in one of the frames of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// The frame that it stands in, by its number among [`MotionBodies::frames`].
    pub frame: usize,
    pub kind: BodyKind,
    /// sRGB in 0..1.
    pub color: [f32; 3],
    /// In its frame, metres; sharp edges have vertices on each side.
    pub surface: Surface,
}

/// The frames of a scene and what stands in them.
#[derive(Clone, Debug)]
pub(crate) struct MotionBodies {
    pub frames: Vec<MotionFrame>,
    pub bodies: Vec<Body>,
    /// Meshes that cannot be read, and why.
    pub missing: Vec<String>,
    /// Links whose visuals cannot be read, with the first reason: their collisions are shown.
    replaced: Vec<Replaced>,
}

/// A link that is shown by its collisions.
#[derive(Clone, Debug)]
struct Replaced {
    link: String,
    why: String,
}

impl MotionBodies {
    /// Reads the meshes of the links, inside the robot's folder and the mapped packages. Frames in which nothing is to
    /// be seen have no body.
    ///
    /// # Errors
    /// [`Error::Semfm`](crate::Error::Semfm) for a mesh that breaks its format or lies elsewhere.
    pub(crate) fn new(scene: &MotionScene) -> Result<Self> {
        let frames = scene.frames();
        let paths = scene.robot.mesh_paths();
        let fingers = finger_links(scene);
        let (mut bodies, mut missing, mut replaced) = (Vec::new(), Vec::new(), Vec::new());
        let mut n_links = 0;
        for (frame, MotionFrame { owner, .. }) in frames.iter().enumerate() {
            let (kind, color, surface) = match *owner {
                FrameOwner::Link(i) => {
                    let link = &scene.robot.robot.links[i];
                    let read = LinkSurface::new(link, &paths).map_err(semfm::Error::from)?;
                    missing.extend(read.missing);
                    let why = read.replaced.into_iter().next();
                    replaced.extend(why.map(|why| Replaced { link: link.name.clone(), why }));
                    let surface = Surface { vertices: read.points, faces: read.faces };
                    if fingers.contains(&i) {
                        (BodyKind::Hand, HandColors::of_one().finger, surface)
                    } else {
                        n_links += usize::from(!surface.faces.is_empty());
                        (BodyKind::Link, link_color(n_links), surface)
                    }
                }
                FrameOwner::HandPart(i) => {
                    let part = scene.hand.as_ref().map(|hand| &hand.parts[i]);
                    let kind = part.map_or(PartKind::Palm, part_kind);
                    let surface = part.map(|part| part_surface(part, kind)).unwrap_or_default();
                    (BodyKind::Hand, HandColors::of_one().of(kind), surface)
                }
                FrameOwner::Object => {
                    let surface = scene.object.as_ref().map(|object| Surface {
                        vertices: object
                            .mesh
                            .vertices()
                            .iter()
                            .map(|&p| p * object.scale)
                            .collect(),
                        faces: object.mesh.faces().to_vec(),
                    });
                    (BodyKind::Object, OBJECT, surface.unwrap_or_default())
                }
                FrameOwner::Obstacle(i) => {
                    let obstacle = &scene.obstacles[i];
                    match obstacle.shape {
                        ObstacleShape::HalfSpace => {
                            (BodyKind::Table, TABLE, table(obstacle.base_from_obstacle))
                        }
                        _ => (BodyKind::Obstacle, OBSTACLE, obstacle_surface(&obstacle.shape)),
                    }
                }
            };
            if !surface.faces.is_empty() {
                let surface = surface.with_creases();
                bodies.push(Body { frame, kind, color, surface });
            }
        }
        Ok(Self { frames, bodies, missing, replaced })
    }

    /// What is not shown as the robot's description has it, in words.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(first) = self.replaced.first() {
            let links: Vec<&str> = self.replaced.iter().map(|r| r.link.as_str()).collect();
            notes.push(format!(
                "pictures show the collision shapes of {}: their visual meshes cannot be read ({})",
                links.join(", "),
                first.why
            ));
        }
        if let Some(first) = self.missing.first() {
            notes.push(format!(
                "pictures leave out {} meshes of the robot that cannot be read, first {first}",
                self.missing.len()
            ));
        }
        notes
    }

    /// The pose of each frame in the base link's frame.
    pub(crate) fn in_base(&self, scene: &MotionScene, state: &SceneState) -> Vec<Pose> {
        scene.in_base(&self.frames, &scene.poses(state))
    }

    /// The frame's name of a body.
    pub(crate) fn name(&self, body: &Body) -> &str {
        &self.frames[body.frame].name
    }
}

/// A motion of ours as a map of points.
pub(crate) fn affine_of(pose: Pose) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_quat(pose.rotation), pose.translation)
}

/// Links that a finger's joint moves, and those that hang on them.
fn finger_links(scene: &MotionScene) -> BTreeSet<usize> {
    let robot = &scene.robot.robot;
    let leaders = robot.leaders();
    let is_finger = |joint: usize| {
        let name = &robot.joints[leaders[joint]].name;
        scene.robot.fingers.iter().any(|finger| finger.name() == name)
    };
    let mut links = BTreeSet::new();
    for (i, joint) in robot.joints.iter().enumerate() {
        if is_finger(i) || links.contains(&joint.parent) {
            links.insert(joint.child);
        }
    }
    links
}

fn part_kind(part: &PartRecord) -> PartKind {
    match (part.role.as_str(), part.link.as_str()) {
        ("palm", _) => PartKind::Palm,
        (_, "pad") => PartKind::Pad,
        _ => PartKind::Finger,
    }
}

fn part_surface(part: &PartRecord, kind: PartKind) -> Surface {
    let mut surface = Surface::default();
    part.hulls.iter().for_each(|hull| surface.add(&drawn_piece(hull, kind)));
    surface
}

/// The part of a table around the base, in the table's frame.
fn table(base_from_table: Pose) -> Surface {
    let base = base_from_table.inverse() * DVec3::ZERO;
    Surface::disc(DVec3::new(base.x, base.y, 0.0), DVec3::Z, TABLE_REACH)
}

fn obstacle_surface(shape: &ObstacleShape) -> Surface {
    match shape {
        ObstacleShape::Primitive(geometry) => {
            let surface = LinkSurface::of_primitive(geometry).unwrap_or_default();
            Surface { vertices: surface.points, faces: surface.faces }
        }
        ObstacleShape::Mesh(mesh) => {
            Surface { vertices: mesh.vertices().to_vec(), faces: mesh.faces().to_vec() }
        }
        ObstacleShape::Points(points) => cloud(points),
        _ => Surface::default(),
    }
}

/// A small cube at each point, at every so manieth where there are many.
fn cloud(points: &[DVec3]) -> Surface {
    let (vertices, faces) =
        parry3d_f64::shape::Cuboid::new(DVec3::splat(POINT_SIDE / 2.0)).to_trimesh();
    let cube = Surface { vertices, faces };
    let mut surface = Surface::default();
    for &point in points.iter().step_by(points.len().div_ceil(N_POINTS).max(1)) {
        surface.add_at(&cube, DAffine3::from_translation(point));
    }
    surface
}
