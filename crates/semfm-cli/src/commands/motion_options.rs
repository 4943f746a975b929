//! The options of a motion, wherever the grasps come from, and what is printed of a plan.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::{GraspsFile, PlanFile};
use semfm::geom::math::DVec3;
use semfm::motion::{CollisionSettings, MotionSettings, Pose};
use semfm::{GraspPlan, ObjectPlace, PlanObject, PlanRequest, RobotArm, SceneContents, Task, plan};
use serde_json::{Value, json};

use super::ik::{ArmOptions, near, pose_option};
use crate::console;
use crate::options::Common;

/// How an arm is to move.
#[derive(Debug, Args)]
pub struct MotionOptions {
    #[command(flatten, next_help_heading = "Arm")]
    arm: ArmOptions,
    /// Where the TCP of the closed hand is in the frame of --tip; by default --tip, which must then be given, is the flange that
    /// the gripper's `flange_from_tcp` starts from. X,Y,Z and QX,QY,QZ,QW or ROLL,PITCH,YAW, or a JSON file
    #[arg(long, value_name = "POSE|FILE", allow_hyphen_values = true, help_heading = "Arm")]
    tip_from_tcp: Option<String>,
    /// Joint values at the start, base to tip, or a state of the SRDF; by default its state `ready` or `home`
    #[arg(long, value_name = "Q1,…|NAME", allow_hyphen_values = true, help_heading = "Arm")]
    start: Option<String>,
    /// Where the object, in metres, stands in the frame of the arm's base
    #[arg(
        long,
        value_name = "POSE|FILE",
        allow_hyphen_values = true,
        conflicts_with = "base_from_camera",
        help_heading = "Frames"
    )]
    base_from_object: Option<String>,
    /// Where the camera that the grasps were found with stands in the frame of the arm's base
    #[arg(long, value_name = "POSE|FILE", allow_hyphen_values = true, help_heading = "Frames")]
    base_from_camera: Option<String>,
    /// Leave out the table that the grasps were found with
    #[arg(long, help_heading = "Scene")]
    no_table: bool,
    /// Length of the straight way to the grasp, metres
    #[arg(long, default_value_t = MotionSettings::default().approach, value_name = "METRES", help_heading = "Motion")]
    approach_length: f64,
    /// Height of the straight way up with the object, metres along z of the arm's base
    #[arg(long, default_value_t = MotionSettings::default().lift.z, value_name = "METRES", help_heading = "Motion")]
    lift_height: f64,
    /// Share of the joints' velocity limits that is used; accelerations follow with its square
    #[arg(long, default_value_t = MotionSettings::default().speed, value_name = "SHARE", help_heading = "Motion")]
    speed: f64,
    /// The same on the straight ways
    #[arg(long, default_value_t = MotionSettings::default().line_speed, value_name = "SHARE", help_heading = "Motion")]
    line_speed: f64,
    /// Most iterations of each search for a path
    #[arg(long, default_value_t = MotionSettings::default().iterations, value_name = "N", help_heading = "Motion")]
    iterations: usize,
    /// Grasps for which a path is searched at most
    #[arg(long, default_value_t = MotionSettings::default().searches, value_name = "N", help_heading = "Motion")]
    searches: usize,
}

impl MotionOptions {
    /// The defaults, for a hand on the link `tip`; the object's place and the start as they are told at the shell.
    pub fn told(tip: &str, base_from_object: &str, start: &str) -> Self {
        let defaults = MotionSettings::default();
        Self {
            arm: ArmOptions { tip: Some(tip.into()), ..ArmOptions::default() },
            tip_from_tcp: None,
            start: Some(start.into()),
            base_from_object: Some(base_from_object.into()),
            base_from_camera: None,
            no_table: false,
            approach_length: defaults.approach,
            lift_height: defaults.lift.z,
            speed: defaults.speed,
            line_speed: defaults.line_speed,
            iterations: defaults.iterations,
            searches: defaults.searches,
        }
    }
}

/// Options that were read, with the files that they name.
#[derive(Clone, Debug)]
pub struct PreparedMotion {
    pub arm: RobotArm,
    place: ObjectPlace,
    tip_from_tcp: Option<Pose>,
    start: Vec<f64>,
    scene: SceneContents,
    with_table: bool,
    settings: MotionSettings,
}

impl MotionOptions {
    /// The files that it reads; poses may be files, too.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let poses = [&self.tip_from_tcp, &self.base_from_object, &self.base_from_camera];
        self.arm.inputs().chain(poses.into_iter().flatten().map(Path::new))
    }

    /// Reads all that a motion of the robot needs but the grasps.
    pub fn prepare(
        &self,
        robot: &Path,
        packages: &[(String, PathBuf)],
        scene: &[PathBuf],
        seed: u64,
    ) -> Result<PreparedMotion> {
        let place = match (&self.base_from_object, &self.base_from_camera) {
            (Some(text), _) => ObjectPlace::Object(pose_option("base_from_object", text)?),
            (None, Some(text)) => ObjectPlace::Camera(pose_option("base_from_camera", text)?),
            (None, None) => bail!(
                "where does the object stand? expected --base-from-object, or --base-from-camera with grasps in a \
                 camera's frame, found neither"
            ),
        };
        if self.arm.tip.is_none() && self.tip_from_tcp.is_none() {
            bail!(
                "where is the hand mounted? expected --tip, the link that the gripper's flange sits on \
                 (`semfm-cli info {}` names the links), or --tip-from-tcp, found neither",
                robot.display()
            );
        }
        let packages = packages.iter().cloned().collect();
        let arm = RobotArm::open(&self.arm.files(robot), &packages, &CollisionSettings::default())?;
        let start = match &self.start {
            Some(text) => near(arm.opened(), Some(text)).context("--start")?,
            None => arm.ready_state().context("--start")?,
        };
        let tip_from_tcp = self.tip_from_tcp.as_ref().map(|text| pose_option("tip_from_tcp", text));
        Ok(PreparedMotion {
            place,
            tip_from_tcp: tip_from_tcp.transpose()?,
            start,
            scene: SceneContents::read(scene)?,
            with_table: !self.no_table,
            settings: MotionSettings {
                seed,
                approach: self.approach_length,
                lift: DVec3::Z * self.lift_height,
                speed: self.speed,
                line_speed: self.line_speed,
                iterations: self.iterations,
                searches: self.searches,
                ..Default::default()
            },
            arm,
        })
    }
}

impl PreparedMotion {
    /// With grasps that are there.
    pub fn plan(
        &self,
        grasps: GraspsFile,
        object: Option<PlanObject>,
        task: &Task,
    ) -> Result<GraspPlan> {
        let request = PlanRequest {
            base_from_object: self.place.base_from_object(&grasps)?,
            grasps,
            object,
            tip_from_tcp: self.tip_from_tcp,
            start: self.start.clone(),
            scene: self.scene.clone(),
            with_table: self.with_table,
            settings: self.settings.clone(),
        };
        Ok(plan(&self.arm, &request, task)?)
    }
}

/// The plan in short, for `--json`.
pub fn summary(plan: &GraspPlan, files: &[PathBuf]) -> Value {
    let PlanFile { grasp, segments, gates, start_contact, notes, .. } = PlanFile::new(plan);
    json!({
        "grasp": grasp,
        "duration": plan.answer.motion.as_ref().map(|motion| motion.trajectory.duration()),
        "segments": segments,
        "gates": gates,
        "start_contact": start_contact,
        "notes": notes,
        "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
    })
}

/// The motion on stdout; the gates as a table, on stderr beside a motion that was asked for with `--verbose`.
pub fn print_plan(plan: &GraspPlan, common: &Common) {
    let answer = &plan.answer;
    let n = answer.outcomes.len();
    if !common.quiet {
        plan.notes.iter().for_each(|note| console::message(format_args!("note: {note}")));
    }
    match &answer.motion {
        Some(motion) => {
            let seconds: Vec<String> = PlanFile::new(plan)
                .segments
                .iter()
                .map(|segment| format!("{} {:.2} s", segment.kind.name(), segment.seconds))
                .collect();
            console::data(format_args!(
                "motion      grasp {} of {n} in {:.2} s: {}",
                motion.grasp,
                motion.trajectory.duration(),
                seconds.join(", ")
            ));
            console::data(format_args!("replayed    {} states, none refused", motion.n_replayed));
        }
        None => console::data(format_args!("motion      none of {n} grasps can be carried out")),
    }
    if answer.motion.is_some() && !common.verbose {
        return;
    }
    for row in answer.gates() {
        console::message(format_args!(
            "{:8}  {:10} grasp {}: {}",
            row.n,
            row.gate.name(),
            row.grasp,
            row.obstruction
        ));
    }
    if answer.motion.is_some() {
        return;
    }
    if let Some(start) = &answer.start_contact {
        let free = start.nearest_free.as_ref().map_or_else(String::new, |q| {
            let words: Vec<String> = q.iter().map(|q| format!("{q:.4}")).collect();
            format!("; the nearest free start that was found: --start {}", words.join(","))
        });
        console::message(format_args!(
            "the start is in collision: {} is {:.1} mm inside {}{free}",
            start.contact.a,
            1e3 * start.contact.depth,
            start.contact.b
        ));
    } else if let Some(miss) = &answer.nearest_miss {
        console::message(format_args!("what would change it: {}", miss.gate.advice()));
    }
}
