//! From the grasps of an object to a motion of an arm.
//!
//! Grasps stand in the object's frame and the arm's poses in that of its base:
//!
//! > base_from_tip = base_from_object · object_from_tcp · tip_from_tcp⁻¹
//!
//! The hand is mounted to the arm's tip: `tip_from_tcp` is each grasp's `flange_from_tcp`, or what the caller says.

use std::path::PathBuf;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};
use semfm_motion::{
    CollisionBody, Hand, HandPart, MotionAnswer, MotionRequest, MotionSettings, NearestMiss,
    TargetGrasp, TargetObject,
};
use semfm_robot::Role;

use crate::files::{GraspRecord, GraspsFile, MatrixRows, PartRecord, TableRecord, rigid_pose};
use crate::hand_mounting::{Mounting, check_mounting};
use crate::{
    Error, FingerJoint, FrameOwner, MotionObject, MotionObstacle, MotionRobot, MotionScene,
    MountedHand, PlannedMotion, Result, RobotArm, SceneContents, SceneState,
};

/// The name of the table that grasps were found with.
const TABLE: &str = "table";

/// What an arm is to grasp, and how.
#[derive(Clone, Debug)]
pub struct PlanRequest {
    /// The grasps, best first.
    pub grasps: GraspsFile,
    /// The object's mesh and its file; `None` where there is none: then nothing keeps the arm away from the object.
    pub object: Option<PlanObject>,
    /// Where the object, in metres, stands in the frame of the arm's base.
    pub base_from_object: Pose,
    /// The TCP of the closed hand in the frame of the arm's tip; `None` where the tip is the gripper's flange.
    pub tip_from_tcp: Option<Pose>,
    /// Joint values at the start.
    pub start: Vec<f64>,
    /// What stands around, in the frame of the arm's base.
    pub scene: SceneContents,
    /// Whether the table that the grasps were found with stands there, too.
    pub with_table: bool,
    /// How the motion is made.
    pub settings: MotionSettings,
}

/// The object's mesh.
#[derive(Clone, Debug)]
pub struct PlanObject {
    /// The mesh, in its own units.
    pub mesh: Arc<Mesh>,
    /// The file that it was read from, if it was: `trajectory.json` names it, and else has the mesh beside it.
    pub file: Option<PathBuf>,
}

/// A motion, or what kept the grasps from one.
#[derive(Clone, Debug)]
pub struct GraspPlan {
    /// The motion and what became of each grasp.
    pub answer: MotionAnswer,
    /// What is seen: robot, object, obstacles.
    pub scene: MotionScene,
    /// The hand as it was checked.
    pub hand: Hand,
    /// How the motion was made.
    pub settings: MotionSettings,
    /// What was found or assumed, of the arm too, in words.
    pub notes: Vec<String>,
}

/// The motion of an arm that takes an object by the best of its grasps that can be carried out (paper, section IV-D:
/// the highest-scoring grasp becomes an end-effector pose, and is "executed using inverse kinematics and a motion
/// planner").
///
/// # Errors
/// [`Error::Invalid`] where there is no grasp, for grasps of another format or poses that are none, and for a hand that
/// cannot sit at the arm's tip; [`Error::Motion`] for a request that is not sound, such as a start out of limits. That no
/// grasp can be carried out is no error: see [`GraspPlan::answer`].
pub fn plan(arm: &RobotArm, request: &PlanRequest, task: &Task) -> Result<GraspPlan> {
    if request.grasps.grasps.is_empty() {
        let expected = "at least one to carry out";
        return Err(Error::invalid("grasps", expected, "none (their file says why)"));
    }
    let scene = surroundings(request)?;
    let (object, of_object) = target_object(request)?;
    let mut notes = arm.notes().to_vec();
    notes.extend(check_mounting(arm, &mounting(request)?)?);
    notes.extend(of_object);
    let hand = hand(&request.grasps)?;
    let motion_request = MotionRequest {
        start: request.start.clone(),
        hand: hand.clone(),
        grasps: target_grasps(request)?,
        object,
        scene: scene.scene,
        settings: request.settings.clone(),
    };
    let answer = arm.planner().plan(&motion_request, task)?;
    let scene = motion_scene(arm, request, scene.obstacles, &answer)?;
    Ok(GraspPlan { answer, scene, hand, settings: request.settings.clone(), notes })
}

impl GraspPlan {
    /// The motion with what is shown of it; `None` where no grasp can be carried out.
    pub fn motion(&self) -> Option<PlannedMotion> {
        let motion = self.answer.motion.as_ref()?;
        Some(PlannedMotion {
            scene: self.scene.clone(),
            trajectory: motion.trajectory.clone(),
            grasp: Some(motion.grasp),
            notes: self.notes.clone(),
        })
    }

    /// The two things that touch at a miss, by the names of their frames in the scene.
    pub fn miss_pair(&self, miss: &NearestMiss) -> Option<[String; 2]> {
        let (a, b) = miss.obstruction.pair()?;
        let names = self.hand.part_names();
        let frame = |name: &str| {
            let Some(part) = names.iter().position(|other| other == name) else {
                return name.to_owned();
            };
            let frames = self.scene.frames();
            let mounted = frames.into_iter().find(|f| f.owner == FrameOwner::HandPart(part));
            mounted.map_or_else(|| self.hand.parts[part].name.clone(), |frame| frame.name)
        };
        Some([frame(a), frame(b)])
    }

    /// Where everything stands at the nearest miss, to be drawn.
    pub fn miss_state(&self, arm: &RobotArm, miss: &NearestMiss) -> SceneState {
        let names = arm.arm().joints().iter().map(|joint| joint.name.clone());
        let object = self.scene.object.as_ref();
        SceneState {
            arm: names.zip(miss.positions.iter().copied()).collect(),
            opening: miss.target.opening,
            base_from_object: object.map_or(Pose::IDENTITY, |object| object.base_from_object),
        }
    }
}

/// What stands around, with the table of the grasps.
fn surroundings(request: &PlanRequest) -> Result<SceneContents> {
    let contents = request.scene.clone();
    let Some(TableRecord { point, normal }) = request.grasps.table.filter(|_| request.with_table)
    else {
        return Ok(contents);
    };
    let point = request.base_from_object * DVec3::from_array(point);
    let normal = request.base_from_object.rotation * DVec3::from_array(normal);
    contents.with_table(TABLE, point, normal)
}

/// The closed hand at the arm's tip.
fn mounting(request: &PlanRequest) -> Result<Mounting<'_>> {
    let gripper = &request.grasps.gripper;
    let flange_from_tcp = pose("gripper.flange_from_tcp", gripper.flange_from_tcp)?;
    let tip_from_tcp = request.tip_from_tcp.unwrap_or(flange_from_tcp);
    Ok(Mounting { gripper, flange_from_tcp, tip_from_tcp })
}

/// The object for collision checks, and notes on how its mesh was cut.
fn target_object(request: &PlanRequest) -> Result<(Option<TargetObject>, Vec<String>)> {
    let Some(object) = &request.object else {
        let note = "the object's mesh is not given: nothing keeps the arm away from the object";
        return Ok((None, vec![note.into()]));
    };
    request
        .grasps
        .mesh
        .check(&object.mesh)
        .map_err(|error| Error::invalid(error.field, error.expected, error.found))?;
    let (body, note) = CollisionBody::from_mesh(&object.mesh, request.grasps.object_scale)?;
    let base_from_object = request.base_from_object;
    let note = note.map(|note| format!("object: {note}"));
    Ok((Some(TargetObject { body, base_from_object }), note.into_iter().collect()))
}

/// The gripper of a file of grasps as rigid parts.
fn hand(grasps: &GraspsFile) -> Result<Hand> {
    let parts: Result<Vec<HandPart>> = grasps.gripper.parts.iter().map(hand_part).collect();
    let tcp_from_parts = match grasps.grasps.first() {
        Some(grasp) => poses("grasps[0].hand.closed", &grasp.hand.closed)?,
        None => vec![Pose::IDENTITY; grasps.gripper.parts.len()],
    };
    Ok(Hand::new(parts?, &tcp_from_parts))
}

fn hand_part(record: &PartRecord) -> Result<HandPart> {
    let what = || format!("gripper part `{}`", record.link);
    let role = match record.role.as_str() {
        "palm" => Role::Palm,
        "left" => Role::Left,
        "right" => Role::Right,
        other => return Err(Error::invalid(what(), "the role palm, left or right", other)),
    };
    let piece = |hull: &Vec<[f64; 3]>| {
        let corners: Vec<DVec3> = hull.iter().map(|&corner| DVec3::from_array(corner)).collect();
        let is_sound = corners.len() >= 4 && corners.iter().all(|corner| corner.is_finite());
        let shape = if is_sound { SharedShape::convex_hull(&corners) } else { None };
        let found = || format!("{} corners", hull.len());
        let shape = shape
            .ok_or_else(|| Error::invalid(what(), "corners of a solid, finite numbers", found()))?;
        Ok((Pose::IDENTITY, shape))
    };
    let pieces: Result<Vec<(Pose, SharedShape)>> = record.hulls.iter().map(piece).collect();
    Ok(HandPart { name: record.link.clone(), role, pieces: pieces? })
}

fn target_grasps(request: &PlanRequest) -> Result<Vec<TargetGrasp>> {
    let Mounting { flange_from_tcp, tip_from_tcp, .. } = mounting(request)?;
    let tip_from_flange = match request.tip_from_tcp {
        Some(_) => tip_from_tcp * flange_from_tcp.inverse(),
        None => Pose::IDENTITY,
    };
    let target = |(i, grasp): (usize, &GraspRecord)| -> Result<TargetGrasp> {
        let what = |field: &str| format!("grasps[{i}].{field}");
        let object_from_tcp = pose(&what("object_from_tcp"), grasp.object_from_tcp)?;
        let flange_from_tcp = pose(&what("flange_from_tcp"), grasp.flange_from_tcp)?;
        Ok(TargetGrasp {
            base_from_tcp: request.base_from_object * object_from_tcp,
            tip_from_tcp: tip_from_flange * flange_from_tcp,
            width: grasp.width,
            opening: grasp.opening,
            score: grasp.score,
            closed: poses(&what("hand.closed"), &grasp.hand.closed)?,
            open: poses(&what("hand.open"), &grasp.hand.open)?,
        })
    };
    request.grasps.grasps.iter().enumerate().map(target).collect()
}

/// What is shown: fingers move where the description has the gripper's joints; else the hand is drawn by its parts.
fn motion_scene(
    arm: &RobotArm,
    request: &PlanRequest,
    obstacles: Vec<MotionObstacle>,
    answer: &MotionAnswer,
) -> Result<MotionScene> {
    let robot = arm.arm().robot();
    let joints = request.grasps.gripper.joints.iter();
    let of_robot = joints.filter(|finger| robot.joint(&finger.joint).is_some());
    let fingers: Vec<FingerJoint> = of_robot
        .filter_map(|finger| FingerJoint::new(&finger.joint, finger.positions.clone()))
        .collect();
    // The hand as the motion, the nearest miss or the first grasp has it.
    let target = match (&answer.motion, &answer.nearest_miss) {
        (Some(motion), _) => Some(motion.target.clone()),
        (None, Some(miss)) => Some(miss.target.clone()),
        (None, None) => target_grasps(request)?.into_iter().next(),
    };
    let hand = target.filter(|_| fingers.is_empty()).map(|target| mounted_hand(request, &target));
    let object = request.object.as_ref().map(|object| MotionObject {
        mesh: object.mesh.clone(),
        file: object.file.clone(),
        scale: request.grasps.object_scale,
        base_from_object: request.base_from_object,
    });
    let motion_robot =
        MotionRobot::new(robot.clone(), arm.urdf(), arm.arm().base(), arm.arm().tip());
    let robot = MotionRobot { packages: arm.packages().clone(), fingers, ..motion_robot };
    Ok(MotionScene { robot, hand, object, obstacles })
}

/// The gripper at the arm's tip, open and closed.
fn mounted_hand(request: &PlanRequest, target: &TargetGrasp) -> MountedHand {
    let gripper = &request.grasps.gripper;
    let (closed, open) = (target.tip_from_parts(1.0), target.tip_from_parts(0.0));
    let (openings, tip_from_part) = if target.opening > target.width {
        (vec![target.width, target.opening], vec![closed, open])
    } else {
        (vec![target.width], vec![closed])
    };
    let (name, parts) = (gripper.name.clone(), gripper.parts.clone());
    MountedHand { name, parts, openings, tip_from_part }
}

fn poses(what: &str, rows: &[MatrixRows]) -> Result<Vec<Pose>> {
    rows.iter().map(|&rows| pose(what, rows)).collect()
}

/// A rotation and a translation.
fn pose(what: &str, rows: MatrixRows) -> Result<Pose> {
    let expected = "rows of a rotation and a translation";
    rigid_pose(rows).map_err(|found| Error::invalid(what, expected, found))
}
