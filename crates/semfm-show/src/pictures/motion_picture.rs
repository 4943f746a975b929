//! Pictures of a motion: the arm at the start, before the grasp, at the grasp and with the object lifted; and of a
//! motion that was not found, the arm where it came nearest, with what it would touch.

use std::path::Path;

use semfm::geom::math::DVec3;
use semfm::geom::{Mesh, Task};
use semfm::motion::SegmentKind;
use semfm::robot::Pose;
use semfm::views::{RigSettings, View, camera_towards};
use semfm::{MotionScene, PlannedMotion, SceneState};

use super::WeightedMesh;
use super::painted::Painted;
use super::sheet::{Entry, PICTURE_SIDE, Row, Sheet};
use super::viewpoints::viewpoints_around;
use crate::Result;
use crate::colors::{APPROACH, COLLIDING, HandColors, OBJECT, OBSTACLE, TABLE, link_color};
use crate::motion::{BodyKind, MotionBodies, affine_of};
use crate::surface::Surface;

/// Side of the pictures of a miss: what failed takes a long line above them.
const MISS_SIDE: u32 = 600;
/// Length of the arrow to where the hand should be, its gap from there, and its radius as a share of the length.
const ARROW: f64 = 0.12;
const ARROW_GAP: f64 = 0.02;
const ARROW_RADIUS: f64 = 0.06;
/// What does not collide is drawn this much nearer to white, so that what does is seen at once.
const PALER: f32 = 0.45;

/// The arm where it came nearest to a grasp that it cannot carry out.
#[derive(Clone, Debug)]
pub struct NearMiss {
    /// What is told above the picture, such as the failed gate with its numbers.
    pub title: String,
    /// Where the arm stands.
    pub state: SceneState,
    /// Names of the two things that touch: links, obstacles, the object.
    pub pair: Option<[String; 2]>,
    /// Where the hand should be, approaching along its z, in the base link's frame.
    pub goal: Option<Pose>,
}

/// Writes the picture of a motion as a PNG.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where a mesh of the robot cannot be read, where drawing or writing fails, and
/// where the task was cancelled.
pub fn write_motion_picture(path: &Path, motion: &PlannedMotion, task: &Task) -> Result<()> {
    write_motion_picture_of(path, motion, &MotionBodies::new(&motion.scene)?, task)
}

/// The same with the bodies at hand.
pub(crate) fn write_motion_picture_of(
    path: &Path,
    motion: &PlannedMotion,
    bodies: &MotionBodies,
    task: &Task,
) -> Result<()> {
    let moments = moments(motion);
    let painted: Vec<Scene> = moments
        .iter()
        .map(|moment| Scene::new(&motion.scene, bodies, &moment.state, |_| None))
        .collect();
    let Some(watched) = painted.iter().rev().nth(1).or(painted.last()) else {
        return Err(crate::Error::invalid("trajectory", "at least one point", "none"));
    };
    let towards_eye = watched.best_direction(&|kind| kind == BodyKind::Object, task)?[0];
    let mut all = Surface::default();
    painted.iter().for_each(|scene| all.add(&scene.framed));
    let all = Mesh::new(all.vertices, all.faces)?;
    let mut pictures = Vec::with_capacity(painted.len());
    for scene in &painted {
        pictures.push(scene.picture(&all, towards_eye, PICTURE_SIDE, task)?);
    }
    let columns: Vec<&str> = moments.iter().map(|moment| moment.name).collect();
    let rows = [Row { title: title(motion), pictures: &pictures }];
    Sheet { columns: &columns, rows: &rows, legend: &legend(bodies) }.write(path)
}

/// Writes the picture of a motion that was not found as a PNG: from two sides, what touches in one colour and all else
/// pale.
///
/// # Errors
/// As [`write_motion_picture`].
pub fn write_miss_picture(
    path: &Path,
    scene: &MotionScene,
    miss: &NearMiss,
    task: &Task,
) -> Result<()> {
    let bodies = MotionBodies::new(scene)?;
    let is_of_pair = |name: &str| miss.pair.iter().flatten().any(|of_pair| of_pair == name);
    let color = |name: &str| is_of_pair(name).then_some(COLLIDING);
    let mut drawn = Scene::new(scene, &bodies, &miss.state, color);
    if miss.pair.is_some() {
        drawn.fade(|name| !is_of_pair(name));
    }
    if let Some(goal) = miss.goal {
        let arrow = Surface::arrow(-ARROW - ARROW_GAP, -ARROW_GAP, ARROW_RADIUS * ARROW);
        let mut placed = Surface::default();
        placed.add_at(&arrow, affine_of(goal));
        drawn.framed.add(&placed);
        drawn.painted.add(&placed, APPROACH);
    }
    let has_pair = drawn.parts.iter().any(|part| is_of_pair(&part.name));
    let directions = match has_pair {
        true => drawn.best_directions(|part| is_of_pair(&part.name), task)?,
        false => drawn.best_direction(&|kind| kind == BodyKind::Object, task)?,
    };
    let all = Mesh::new(drawn.framed.vertices.clone(), drawn.framed.faces.clone())?;
    let mut pictures = Vec::with_capacity(2);
    for direction in directions {
        pictures.push(drawn.picture(&all, direction, MISS_SIDE, task)?);
    }
    let mut legend = legend(&bodies);
    if let Some([a, b]) = &miss.pair {
        legend.insert(0, Entry::Swatch(COLLIDING, format!("in collision: {a} with {b}")));
    }
    legend.extend(miss.goal.map(|_| Entry::Swatch(APPROACH, "where the hand should be".into())));
    let rows = [Row { title: miss.title.clone(), pictures: &pictures }];
    Sheet { columns: &[], rows: &rows, legend: &legend }.write(path)
}

/// A direction towards the eye that looks down a little, as people look at a robot: from 15° to 35° above.
pub(crate) fn lowered(towards_eye: DVec3) -> DVec3 {
    let [low, high] = [15f64, 35.0].map(|degrees| degrees.to_radians().tan());
    let along = towards_eye.with_z(0.0);
    let along = along.try_normalize().unwrap_or(-DVec3::Y);
    let slope = towards_eye.z / towards_eye.with_z(0.0).length().max(f64::MIN_POSITIVE);
    (along + slope.clamp(low, high) * DVec3::Z).normalize()
}

/// A moment of a motion that is worth a picture.
struct Moment {
    name: &'static str,
    state: SceneState,
}

/// The start, and the end of each segment that brings something new.
fn moments(motion: &PlannedMotion) -> Vec<Moment> {
    let end = |kind| {
        let points = &motion.trajectory.segment(kind)?.points;
        Some(points.last()?.time)
    };
    [
        ("start", Some(0.0)),
        ("before the grasp", end(SegmentKind::ToPreGrasp)),
        ("at the grasp", end(SegmentKind::Close).or(end(SegmentKind::Approach))),
        ("lifted", end(SegmentKind::Lift)),
    ]
    .into_iter()
    .filter_map(|(name, time)| Some(Moment { name, state: motion.state_at(time?)? }))
    .collect()
}

fn title(motion: &PlannedMotion) -> String {
    let grasp = motion.grasp.map(|grasp| format!(", grasp {grasp}")).unwrap_or_default();
    let (name, seconds) = (&motion.scene.robot.robot.name, motion.trajectory.duration());
    format!("{name}{grasp}: {seconds:.1} s")
}

fn legend(bodies: &MotionBodies) -> Vec<Entry> {
    let names = [
        (BodyKind::Link, link_color(1), "arm"),
        (BodyKind::Hand, HandColors::of_one().finger, "hand"),
        (BodyKind::Object, OBJECT, "object"),
        (BodyKind::Obstacle, OBSTACLE, "obstacle"),
        (BodyKind::Table, TABLE, "table"),
    ];
    let shown =
        names.into_iter().filter(|(kind, ..)| bodies.bodies.iter().any(|body| body.kind == *kind));
    shown.map(|(_, color, name)| Entry::Swatch(color, name.into())).collect()
}

/// All bodies at one state.
struct Scene {
    painted: Painted,
    parts: Vec<Part>,
    /// What the pictures must hold: all but tables, which have no end.
    framed: Surface,
}

/// The vertices of a body among those of the scene.
struct Part {
    name: String,
    kind: BodyKind,
    vertices: std::ops::Range<usize>,
}

impl Scene {
    /// `color` is asked for each body by its name; where it gives none, the body has its own.
    fn new(
        scene: &MotionScene,
        bodies: &MotionBodies,
        state: &SceneState,
        color: impl Fn(&str) -> Option<[f32; 3]>,
    ) -> Self {
        let poses = bodies.in_base(scene, state);
        let (mut painted, mut parts) = (Painted::default(), Vec::new());
        let mut framed = Surface::default();
        for body in &bodies.bodies {
            let mut placed = Surface::default();
            placed.add_at(&body.surface, affine_of(poses[body.frame]));
            let start = painted.surface.vertices.len();
            let name = bodies.name(body);
            painted.add(&placed, color(name).unwrap_or(body.color));
            let vertices = start..painted.surface.vertices.len();
            parts.push(Part { name: name.to_owned(), kind: body.kind, vertices });
            if body.kind != BodyKind::Table {
                framed.add(&placed);
            }
        }
        Self { painted, parts, framed }
    }

    /// Draws the bodies of some names nearer to white.
    fn fade(&mut self, is_faded: impl Fn(&str) -> bool) {
        for part in self.parts.iter().filter(|part| is_faded(&part.name)) {
            for color in &mut self.painted.colors[part.vertices.clone()] {
                *color = color.map(|c| c + PALER * (1.0 - c));
            }
        }
    }

    fn best_direction(&self, shows: &dyn Fn(BodyKind) -> bool, task: &Task) -> Result<[DVec3; 2]> {
        self.best_directions(|part| shows(part.kind), task)
    }

    /// Two directions towards the eye from which some bodies are seen best, a little from above.
    fn best_directions(&self, shows: impl Fn(&Part) -> bool, task: &Task) -> Result<[DVec3; 2]> {
        let mesh = self.painted.mesh()?;
        let mut weights = vec![0.0; mesh.n_vertices()];
        for part in self.parts.iter().filter(|part| shows(part)) {
            weights[part.vertices.clone()].fill(1.0);
        }
        let all = WeightedMesh { mesh: &mesh, weights: &weights };
        let found = viewpoints_around(DVec3::Z, all, PICTURE_SIDE, task)?;
        Ok([found.best, found.other].map(|c| lowered(-c.camera_from_world().matrix3.row(2))))
    }

    /// From a direction, so that `all` fits.
    fn picture(&self, all: &Mesh, towards_eye: DVec3, side: u32, task: &Task) -> Result<View> {
        let settings = RigSettings { size: side, ..Default::default() };
        let camera = camera_towards(all, towards_eye, DVec3::Z, &settings)?;
        self.painted.rendered(camera, 0.0, task)
    }
}
