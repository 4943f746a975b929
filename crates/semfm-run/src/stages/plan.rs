//! The arm's motion to one of the grasps: what `plan` does.

use std::path::Path;
use std::sync::Arc;

use semfm::files::{GraspsFile, read_rigid_pose};
use semfm::geom::io::read_mesh;
use semfm::geom::math::DVec3;
use semfm::motion::{CollisionSettings, MotionSettings, Pose};
use semfm::robot::ArmFiles;
use semfm::{
    GraspPlan, ObjectPlace, PlanObject, PlanRequest, RobotArm, SceneContents, Task,
    plan as plan_grasps, pose_of_numbers,
};
use semfm_show::write_plan;

use super::grasp::GRASPS_FILE;
use super::{StageContext, StageEnd, no_answer};
use crate::recipe::{PoseValue, RobotTable, StartValue};
use crate::{Error, Result, Stage};

/// Plans the motion.
pub fn plan(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let Some(table) = &context.recipe.robot else { return Ok(StageEnd::default()) };
    let target = context.target_mesh();
    let mesh = read_mesh(&target)?.mesh;
    let grasps = GraspsFile::read(&context.file(Stage::Grasp, GRASPS_FILE), &mesh)?;
    let files = ArmFiles {
        urdf: table.urdf.clone(),
        srdf: table.srdf.clone(),
        limits: table.limits.clone(),
        base: table.base.clone(),
        tip: table.tip.clone(),
        fixed: Vec::new(),
    };
    let arm = RobotArm::open(&files, &table.packages, &CollisionSettings::default())?;
    let request = PlanRequest {
        base_from_object: place(table)?.base_from_object(&grasps)?,
        grasps,
        object: Some(PlanObject { mesh: Arc::new(mesh), file: Some(target) }),
        tip_from_tcp: pose("tip_from_tcp", table.tip_from_tcp.as_ref())?,
        start: start(table, &arm)?,
        scene: SceneContents::read(&table.scene)?,
        with_table: true,
        settings: settings(table, context.recipe.seed),
    };
    let plan = plan_grasps(&arm, &request, task)?;
    write_plan(folder, &arm, &plan, task)?;
    Ok(end(&plan))
}

fn place(table: &RobotTable) -> Result<ObjectPlace> {
    let object = pose("base_from_object", table.base_from_object.as_ref())?;
    let camera = pose("base_from_camera", table.base_from_camera.as_ref())?;
    // The recipe was checked to have one of them.
    Ok(match (object, camera) {
        (Some(pose), _) => ObjectPlace::Object(pose),
        (None, camera) => ObjectPlace::Camera(camera.unwrap_or(Pose::IDENTITY)),
    })
}

/// A pose of the table [robot].
fn pose(key: &str, value: Option<&PoseValue>) -> Result<Option<Pose>> {
    let read = |value: &PoseValue| match value {
        PoseValue::Numbers(numbers) => pose_of_numbers(numbers).map_err(|error| of_key(key, error)),
        PoseValue::File(path) => Ok(read_rigid_pose(path, key)?),
    };
    value.map(read).transpose()
}

/// An error about an argument, under the name of its key.
fn of_key(key: &str, error: semfm::Error) -> Error {
    match error {
        semfm::Error::Invalid { expected, found, .. } => {
            Error::Semfm(semfm::Error::Invalid { what: format!("robot.{key}"), expected, found })
        }
        other => Error::Semfm(other),
    }
}

fn start(table: &RobotTable, arm: &RobotArm) -> Result<Vec<f64>> {
    match &table.start {
        None => Ok(arm.ready_state()?),
        Some(StartValue::State(name)) => {
            Ok(arm.opened().named_state(name).map_err(semfm::Error::from)?)
        }
        Some(StartValue::Joints(joints)) => {
            arm.arm().check_positions("robot.start", joints).map_err(semfm::Error::from)?;
            Ok(joints.clone())
        }
    }
}

fn settings(table: &RobotTable, seed: u64) -> MotionSettings {
    let defaults = MotionSettings::default();
    MotionSettings {
        seed,
        approach: table.approach_length.unwrap_or(defaults.approach),
        lift: table.lift_height.map_or(defaults.lift, |height| DVec3::Z * height),
        speed: table.speed.unwrap_or(defaults.speed),
        line_speed: table.line_speed.unwrap_or(defaults.line_speed),
        ..defaults
    }
}

fn end(plan: &GraspPlan) -> StageEnd {
    let answer = &plan.answer;
    let n = answer.outcomes.len();
    let mut end = StageEnd::default();
    match &answer.motion {
        Some(motion) => end.summary.push(format!(
            "grasp {} of {n} in {:.2} s; {} states checked again",
            motion.grasp,
            motion.trajectory.duration(),
            motion.n_replayed
        )),
        None => end.summary.push(format!("none of {n} grasps can be carried out")),
    }
    let gates = answer.gates().into_iter();
    let gates =
        gates.map(|row| format!("{} of them: {}, {}", row.n, row.gate.name(), row.obstruction));
    if answer.motion.is_none() {
        end.summary.extend(gates);
        let advice = match (&answer.start_contact, &answer.nearest_miss) {
            (Some(start), _) => format!(
                "the start is in collision ({} with {}): another robot.start",
                start.contact.a, start.contact.b
            ),
            (None, Some(miss)) => miss.gate.advice().to_owned(),
            (None, None) => "another place of the object or of the arm (docs/motion.md)".into(),
        };
        end.no_answer = no_answer(format!("none of {n} grasps can be carried out"), advice);
    }
    end.summary.extend(plan.notes.iter().cloned());
    end
}
