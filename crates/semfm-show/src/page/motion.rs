//! A motion as a group of the page: the arm, the object and what stands around, over time.

use std::path::Path;

use semfm::files::read_motion;
use semfm::geom::math::{DAffine3, DVec3, bounds};
use semfm::motion::SegmentKind;
use semfm::robot::{JointKind, Pose};
use semfm::views::{RigSettings, camera_towards};
use semfm::{Mesh, MotionScene, PlannedMotion, Task};
use serde::Serialize;

use super::encoding::{EncodedMesh, encode_numbers};
use super::group::{Fact, Group, Layer, Panel, VIEWPOINT_SIDE, VertexColors};
use crate::Result;
use crate::colors::{SERIES, color_bytes, hex};
use crate::motion::{Body, BodyKind, FrameTracks, MotionBodies, affine_of, continuous};
use crate::pictures::{Viewpoints, WeightedMesh, lowered, viewpoints_around};
use crate::surface::Surface;

/// Steps in which numbers are written: a hundredth of a millimetre, a millionth of a quaternion's unit, of a radian and
/// of a metre.
const LENGTH_STEP: f64 = 1e-5;
const ROTATION_STEP: f64 = 1e-6;
const JOINT_STEP: f64 = 1e-6;
/// Length of the axes at the base, metres, and their radius as a share of it.
const AXIS: f64 = 0.12;
const AXIS_RADIUS: f64 = 0.03;
/// Of the lines of joints: the six of the table of colours and a grey, since most arms have seven.
const LINES: [[u8; 3]; 7] = {
    let [a, b, c, d, e, f] = SERIES;
    [a, b, c, d, e, f, [125, 125, 125]]
};
/// Red, green and blue for x, y and z.
const AXES: [[u8; 3]; 3] = [[200, 60, 50], [60, 150, 70], [60, 100, 200]];

/// The motion of the trajectory at `path`, with the robot and the object that it names.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where a file cannot be read or drawn, or is another than the motion was planned
/// with.
pub(super) fn motion_group(path: &Path, task: &Task) -> Result<Group> {
    let motion = read_motion(path)?;
    let bodies = MotionBodies::new(&motion.scene)?;
    let tracks = FrameTracks::new(&motion);
    let in_base = tracks.in_base(&motion.scene);
    let fixed = FixedBodies::new(&bodies, &in_base)?;
    let panel = Panel {
        name: motion.scene.robot.robot.name.clone(),
        note: format!("{} joints, {:.1} s", n_joints(&motion), motion.trajectory.duration()),
        viewpoints: viewpoint(&motion, &bodies, task)?,
        mesh: fixed.mesh.clone(),
    };
    Ok(Group {
        title: super::mesh::file_name(path),
        facts: facts(&motion),
        notes: notes(&motion, &bodies),
        panels: vec![panel],
        layers: vec![Layer {
            name: "colours".into(),
            legend: Vec::new(),
            colors: vec![VertexColors::Colors(fixed.colors.clone())],
        }],
        source_of: None,
        pictures: Vec::new(),
        hands: None,
        motion: Some(Motion { data: MotionData::new(&motion, &bodies, &tracks, &in_base, &fixed) }),
    })
}

fn n_joints(motion: &PlannedMotion) -> usize {
    motion.trajectory.joint_names.len()
}

fn facts(motion: &PlannedMotion) -> Vec<Fact> {
    let trajectory = &motion.trajectory;
    let n_points: usize = trajectory.segments.iter().map(|segment| segment.points.len()).sum();
    let mut facts = vec![
        Fact::new("robot", &motion.scene.robot.robot.name),
        Fact::new("seconds", format!("{:.2}", trajectory.duration())),
        Fact::new("points", n_points),
    ];
    facts.extend(motion.grasp.map(|grasp| Fact::new("grasp", grasp)));
    facts
}

/// What was assumed when the motion was made, and what is not shown as it is.
fn notes(motion: &PlannedMotion, bodies: &MotionBodies) -> Vec<String> {
    let shown = bodies.notes().into_iter().filter(|note| !motion.notes.contains(note));
    motion.notes.iter().cloned().chain(shown).collect()
}

/// From where the object at the grasp is seen best, or the arm where there is none.
fn viewpoint(motion: &PlannedMotion, bodies: &MotionBodies, task: &Task) -> Result<Viewpoints> {
    let grasp =
        motion.trajectory.segment(SegmentKind::Approach).or(motion.trajectory.segments.last());
    let time = grasp.and_then(|segment| segment.points.last()).map_or(0.0, |point| point.time);
    let poses = motion.state_at(time).map(|state| bodies.in_base(&motion.scene, &state));
    let (mut surface, mut weights) = (Surface::default(), Vec::new());
    for body in &bodies.bodies {
        let pose = poses.as_ref().map_or(Pose::IDENTITY, |poses| poses[body.frame]);
        surface.add_at(&body.surface, affine_of(pose));
        let weight = if body.kind == BodyKind::Object { 1.0 } else { 0.0 };
        weights.resize(surface.vertices.len(), weight);
    }
    surface.add(&axes().0);
    weights.resize(surface.vertices.len(), 0.0);
    let mesh = Mesh::new(surface.vertices, surface.faces)?;
    let all = WeightedMesh { mesh: &mesh, weights: &weights };
    let found = viewpoints_around(DVec3::Z, all, VIEWPOINT_SIDE, task)?;
    let eye = lowered(-found.best.camera_from_world().matrix3.row(2));
    let settings = RigSettings { size: VIEWPOINT_SIDE, ..Default::default() };
    Ok(Viewpoints { best: camera_towards(&mesh, eye, DVec3::Z, &settings)?, ..found })
}

/// The axes of the base's frame, with their colours.
fn axes() -> (Surface, Vec<[u8; 3]>) {
    let arrow = Surface::arrow(0.0, AXIS, AXIS_RADIUS * AXIS);
    let (mut surface, mut colors) = (Surface::default(), Vec::new());
    let directions = [
        [DVec3::Y, DVec3::Z, DVec3::X],
        [DVec3::Z, DVec3::X, DVec3::Y],
        [DVec3::X, DVec3::Y, DVec3::Z],
    ];
    for (columns, color) in directions.into_iter().zip(AXES) {
        let [x, y, z] = columns;
        surface.add_at(&arrow, DAffine3::from_cols(x, y, z, DVec3::ZERO));
        colors.resize(surface.vertices.len(), color);
    }
    (surface, colors)
}

/// What never moves, as one mesh: the axes of the base and bodies in still frames, but for tables.
struct FixedBodies {
    mesh: Mesh,
    colors: Vec<[u8; 3]>,
    /// Middle of the mesh's box: the origin of the panel's frame.
    middle: DVec3,
}

impl FixedBodies {
    fn new(bodies: &MotionBodies, in_base: &[Vec<Pose>]) -> Result<Self> {
        let (mut surface, mut colors) = axes();
        for body in bodies.bodies.iter().filter(|body| is_fixed(body, in_base)) {
            let pose = in_base.first().map_or(Pose::IDENTITY, |poses| poses[body.frame]);
            surface.add_at(&body.surface, affine_of(pose));
            colors.resize(surface.vertices.len(), color_bytes(body.color));
        }
        let (low, high) = bounds(&surface.vertices).unwrap_or_default();
        let mesh = Mesh::new(surface.vertices, surface.faces)?;
        Ok(Self { mesh, colors, middle: (low + high) / 2.0 })
    }
}

fn is_fixed(body: &Body, in_base: &[Vec<Pose>]) -> bool {
    let is_still = in_base.iter().all(|poses| poses[body.frame] == in_base[0][body.frame]);
    is_still && matches!(body.kind, BodyKind::Link | BodyKind::Hand | BodyKind::Obstacle)
}

/// An arm that moves in a panel.
#[derive(Clone, Debug)]
pub struct Motion {
    data: MotionData,
}

impl Motion {
    /// What the viewer reads.
    pub(super) fn data(&self) -> &MotionData {
        &self.data
    }
}

/// What `viewer/motion.js` reads. The panel's frame has the axes of the base and its origin in the middle of the
/// panel's mesh.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MotionData {
    duration: f64,
    n_samples: usize,
    length_step: f64,
    rotation_step: f64,
    joint_step: f64,
    bodies: Vec<BodyData>,
    joints: Vec<JointData>,
    /// Distance between the pads at each sample, in steps of joints.
    opening: String,
    segments: Vec<SegmentData>,
    /// Away from a table, where there is one.
    table_normal: Option<[f64; 3]>,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct BodyData {
    name: String,
    is_table: bool,
    /// sRGB in 0..1.
    color: [f32; 3],
    #[serde(flatten)]
    mesh: EncodedMesh,
    /// Positions at each sample, all x, then all y, then all z; of the middle of the mesh's box.
    translations: String,
    /// Quaternions at each sample, all x, then all y, all z, all w.
    rotations: String,
}

#[derive(Clone, Debug, Serialize)]
struct JointData {
    name: String,
    /// `rad` or `m`.
    unit: &'static str,
    color: String,
    /// Whether its colour was given to a joint before it.
    dashed: bool,
    /// Lowest and highest position.
    range: Option<[f64; 2]>,
    /// Greatest speed.
    fastest: Option<f64>,
    positions: String,
    velocities: String,
}

#[derive(Clone, Debug, Serialize)]
struct SegmentData {
    name: &'static str,
    start: f64,
    end: f64,
}

impl MotionData {
    fn new(
        motion: &PlannedMotion,
        bodies: &MotionBodies,
        tracks: &FrameTracks,
        in_base: &[Vec<Pose>],
        fixed: &FixedBodies,
    ) -> Self {
        let moving = bodies.bodies.iter().filter(|body| !is_fixed(body, in_base));
        let opening = tracks.points.iter().map(|point| in_steps(point.opening, JOINT_STEP));
        Self {
            duration: motion.trajectory.duration(),
            n_samples: tracks.points.len(),
            length_step: LENGTH_STEP,
            rotation_step: ROTATION_STEP,
            joint_step: JOINT_STEP,
            bodies: moving.map(|body| BodyData::new(body, bodies, in_base, fixed.middle)).collect(),
            joints: (0..n_joints(motion)).map(|j| JointData::new(j, motion, tracks)).collect(),
            opening: encode_numbers(opening),
            segments: segments(motion),
            table_normal: table_normal(&motion.scene),
        }
    }
}

fn segments(motion: &PlannedMotion) -> Vec<SegmentData> {
    let segments = motion.trajectory.segments.iter();
    let ends = segments.filter_map(|segment| {
        let (first, last) = (segment.points.first()?, segment.points.last()?);
        Some(SegmentData { name: shown_name(segment.kind), start: first.time, end: last.time })
    });
    ends.collect()
}

fn shown_name(kind: SegmentKind) -> &'static str {
    match kind {
        SegmentKind::ToPreGrasp => "to pre-grasp",
        SegmentKind::Approach => "approach",
        SegmentKind::Close => "close",
        SegmentKind::Lift => "lift",
    }
}

fn table_normal(scene: &MotionScene) -> Option<[f64; 3]> {
    let mut obstacles = scene.obstacles.iter();
    let table = obstacles.find(|obstacle| obstacle.shape == semfm::ObstacleShape::HalfSpace)?;
    Some((table.base_from_obstacle.rotation * DVec3::Z).to_array())
}

impl BodyData {
    fn new(body: &Body, bodies: &MotionBodies, in_base: &[Vec<Pose>], panel_middle: DVec3) -> Self {
        // Positions of the mesh are counted from the middle of its box.
        let (low, high) = bounds(&body.surface.vertices).unwrap_or_default();
        let middle = (low + high) / 2.0;
        let track = continuous(in_base.iter().map(|poses| poses[body.frame]));
        let components = |at: &dyn Fn(&Pose, usize) -> f64, n: usize, step: f64| {
            let numbers =
                (0..n).flat_map(|k| track.iter().map(move |pose| in_steps(at(pose, k), step)));
            encode_numbers(numbers)
        };
        let position = |pose: &Pose, k: usize| (pose.transform_point(middle) - panel_middle)[k];
        let rotation = |pose: &Pose, k: usize| pose.rotation.normalize().to_array()[k];
        Self {
            name: bodies.name(body).to_owned(),
            is_table: body.kind == BodyKind::Table,
            color: body.color,
            mesh: EncodedMesh::of(&body.surface.vertices, &body.surface.faces),
            translations: components(&position, 3, LENGTH_STEP),
            rotations: components(&rotation, 4, ROTATION_STEP),
        }
    }
}

impl JointData {
    /// The `j`-th joint of the arm.
    fn new(j: usize, motion: &PlannedMotion, tracks: &FrameTracks) -> Self {
        let name = &motion.trajectory.joint_names[j];
        let robot = &motion.scene.robot.robot;
        let joint = robot.joint(name).map(|joint| &robot.joints[joint]);
        let is_slide = joint.is_some_and(|joint| joint.kind == JointKind::Prismatic);
        let points = || tracks.points.iter();
        let positions = points().map(|point| in_steps(point.positions[j], JOINT_STEP));
        let velocities = points().map(|point| in_steps(point.velocities[j], JOINT_STEP));
        Self {
            name: name.clone(),
            unit: if is_slide { "m" } else { "rad" },
            color: hex(LINES[j % LINES.len()]),
            dashed: j >= LINES.len(),
            range: joint.and_then(|joint| joint.limits.position),
            fastest: joint.and_then(|joint| joint.limits.velocity),
            positions: encode_numbers(positions),
            velocities: encode_numbers(velocities),
        }
    }
}

/// A number in steps, as the bits of a signed whole number.
fn in_steps(x: f64, step: f64) -> u32 {
    ((x / step).round() as i32) as u32
}
