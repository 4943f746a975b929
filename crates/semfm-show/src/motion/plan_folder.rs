//! The folder of a plan: what a program, a controller, a viewer and a person take from a motion.

use std::path::{Path, PathBuf};

use semfm::files::{PlanFile, TrajectoryFile};
use semfm::geom::io::StagedFolder;
use semfm::motion::{NearestMiss, Obstruction};
use semfm::{GraspPlan, PlannedMotion, RobotArm, Task};

use super::animated_glb::write_glb_of;
use super::bodies::MotionBodies;
use super::frame_tracks::FrameTracks;
use crate::Result;
use crate::pictures::{NearMiss, write_miss_picture, write_motion_picture_of};

/// Every file that the folder of a plan can have, that for programs last.
pub const PLAN_FILES: &[&str] = &[
    "motion.glb",
    "motion.png",
    "miss.png",
    "scene.mcap",
    "trajectory.mcap",
    "metadata.yaml",
    "trajectory.json",
    "plan.json",
];

/// Those among them that are put in their places last, in this order: where they are, the others are.
const LAST: usize = 3;

/// Writes a motion into `folder`, which is made if it is not there: `trajectory.json`; a ROS 2 bag (feature `mcap`:
/// `trajectory.mcap` with `metadata.yaml`, so that `ros2 bag play FOLDER` plays it) and a scene for Foxglove
/// (`scene.mcap`); an animated model (`motion.glb`) and a picture (`motion.png`). The folder has all of them or, where
/// something fails, what it had before. Returns the paths.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) for the first file that cannot be read, drawn or written, and where the task
/// was cancelled.
pub fn write_plan_folder(
    folder: &Path,
    motion: &PlannedMotion,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    write_motion_files(staged.path(), folder, motion, task)?;
    put(staged)
}

/// Writes a plan into `folder`, which is made if it is not there: `plan.json`, what became of each grasp, and either the
/// motion as [`write_plan_folder`] does or, where there is none, a picture of the nearest miss (`miss.png`). The folder
/// has all of them or, where something fails, what it had before; files of an earlier plan are removed. Returns the
/// paths.
///
/// # Errors
/// As [`write_plan_folder`].
pub fn write_plan(
    folder: &Path,
    arm: &RobotArm,
    plan: &GraspPlan,
    task: &Task,
) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    match (plan.motion(), &plan.answer.nearest_miss) {
        (Some(motion), _) => write_motion_files(staged.path(), folder, &motion, task)?,
        (None, Some(miss)) => {
            let picture = staged.path().join("miss.png");
            write_miss_picture(&picture, &plan.scene, &near_miss(arm, plan, miss), task)?;
        }
        (None, None) => {}
    }
    PlanFile::new(plan).write(&staged.path().join("plan.json"))?;
    put(staged)
}

/// The nearest miss as its picture shows it.
fn near_miss(arm: &RobotArm, plan: &GraspPlan, miss: &NearestMiss) -> NearMiss {
    let pair = match &miss.obstruction {
        Obstruction::Contact { a, b, .. }
        | Obstruction::ContactOnLine { a, b, .. }
        | Obstruction::ContactAtTime { a, b, .. } => Some([a.clone(), b.clone()]),
        _ => None,
    };
    NearMiss {
        title: format!("grasp {}, {}: {}", miss.grasp, miss.gate, miss.obstruction),
        state: plan.miss_state(arm, miss),
        pair,
        goal: Some(miss.target.base_from_tcp),
    }
}

/// Writes the files of a motion into `stage`, from where they go to `folder`.
fn write_motion_files(
    stage: &Path,
    folder: &Path,
    motion: &PlannedMotion,
    task: &Task,
) -> Result<()> {
    let at = |name: &str| stage.join(name);
    let (bodies, tracks) = (MotionBodies::new(&motion.scene)?, FrameTracks::new(motion));
    let file = TrajectoryFile::new(motion, folder)?;
    file.write(&at("trajectory.json"))?;
    write_glb_of(&at("motion.glb"), motion, &bodies, &tracks)?;
    write_motion_picture_of(&at("motion.png"), motion, &bodies, task)?;
    #[cfg(feature = "mcap")]
    {
        semfm::files::write_ros2_trajectory(stage, motion)?;
        let about = file.to_json();
        crate::foxglove::write_motion_scene(&at("scene.mcap"), motion, &bodies, &tracks, &about)?;
    }
    Ok(())
}

fn put(staged: StagedFolder) -> Result<Vec<PathBuf>> {
    // Files of an earlier plan that this one does not have.
    let gone: Vec<&str> =
        PLAN_FILES.iter().copied().filter(|name| !staged.path().join(name).exists()).collect();
    Ok(staged.put(&PLAN_FILES[PLAN_FILES.len() - LAST..], &gone)?)
}
