//! The folder of a plan: what a program, a controller, a viewer and a person take from a motion.

use std::path::{Path, PathBuf};

use semfm::files::{OBJECT_FILE, PlanFile, TrajectoryFile};
use semfm::geom::io::{StagedFolder, shown_path, write_mesh};
use semfm::motion::NearestMiss;
use semfm::{GraspPlan, MotionScene, PlannedMotion, RobotArm, Task};

use super::animated_glb::write_glb_of;
use super::bodies::MotionBodies;
use super::frame_tracks::FrameTracks;
use crate::Result;
use crate::pictures::{
    NearMiss, write_miss_picture, write_motion_picture, write_motion_picture_of,
};

/// Every file that the folder of a plan can have, that for programs last.
pub const PLAN_FILES: &[&str] = &[
    OBJECT_FILE,
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
/// (`scene.mcap`); an animated model (`motion.glb`) and a picture (`motion.png`); where the object's mesh came from no
/// file, that too (`planned_object.ply`). The folder has all of them or, where something fails, what it had before. Returns the
/// paths.
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
    let drawn = Drawn::new(motion)?;
    drawn.write(staged.path(), folder, task)?;
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
    let mut file = PlanFile::new(plan);
    match (plan.motion(), &plan.answer.nearest_miss) {
        (Some(motion), _) => {
            let drawn = Drawn::new(&motion)?;
            // The folder may itself be on its way to another place, and the trajectory names files from there.
            drawn.write(staged.path(), &shown_path(folder), task)?;
            file.notes = drawn.motion.notes;
        }
        (None, Some(miss)) => {
            let picture = staged.path().join("miss.png");
            write_miss_picture(&picture, &plan.scene, &near_miss(arm, plan, miss), task)?;
        }
        (None, None) => {}
    }
    file.write(&staged.path().join("plan.json"))?;
    put(staged)
}

/// Writes the picture of a plan as a PNG: its motion or, where there is none, the nearest miss.
///
/// # Errors
/// As [`write_plan_folder`]; [`Error::Invalid`](crate::Error::Invalid) where neither is there to be drawn.
pub fn write_plan_picture(
    path: &Path,
    arm: &RobotArm,
    plan: &GraspPlan,
    task: &Task,
) -> Result<()> {
    match (plan.motion(), &plan.answer.nearest_miss) {
        (Some(motion), _) => write_motion_picture(path, &motion, task),
        (None, Some(miss)) => {
            write_miss_picture(path, &plan.scene, &near_miss(arm, plan, miss), task)
        }
        (None, None) => Err(crate::Error::invalid("plan", "a motion or a nearest miss", "neither")),
    }
}

/// The nearest miss as its picture shows it.
fn near_miss(arm: &RobotArm, plan: &GraspPlan, miss: &NearestMiss) -> NearMiss {
    NearMiss {
        title: format!("grasp {}, {}: {}", miss.grasp, miss.gate, miss.obstruction),
        state: plan.miss_state(arm, miss),
        pair: plan.miss_pair(miss),
        goal: Some(miss.target.base_from_tcp),
    }
}

/// A motion with its bodies and where they are over time.
struct Drawn {
    motion: PlannedMotion,
    bodies: MotionBodies,
    tracks: FrameTracks,
}

impl Drawn {
    /// Adds to the motion's notes what is not shown as it is.
    fn new(motion: &PlannedMotion) -> Result<Self> {
        let (bodies, tracks) = (MotionBodies::new(&motion.scene)?, FrameTracks::new(motion));
        let mut motion = motion.clone();
        let more = bodies.notes().into_iter().filter(|note| !motion.notes.contains(note));
        motion.notes = motion.notes.iter().cloned().chain(more).collect();
        Ok(Self { motion, bodies, tracks })
    }

    /// Writes the files of the motion into `stage`, from where they go to `folder`.
    fn write(&self, stage: &Path, folder: &Path, task: &Task) -> Result<()> {
        let Self { motion, bodies, tracks } = self;
        let at = |name: &str| stage.join(name);
        write_object(&at(OBJECT_FILE), &motion.scene)?;
        let file = TrajectoryFile::new(motion, folder)?;
        file.write(&at("trajectory.json"))?;
        write_glb_of(&at("motion.glb"), motion, bodies, tracks)?;
        write_motion_picture_of(&at("motion.png"), motion, bodies, task)?;
        #[cfg(feature = "mcap")]
        {
            semfm::files::write_ros2_trajectory(stage, motion)?;
            let about = file.to_json();
            crate::foxglove::write_motion_scene(&at("scene.mcap"), motion, bodies, tracks, &about)?;
        }
        Ok(())
    }
}

/// The object's mesh, where it came from no file that could be named.
fn write_object(path: &Path, scene: &MotionScene) -> Result<()> {
    match scene.object.as_ref().filter(|object| object.file.is_none()) {
        Some(object) => Ok(write_mesh(path, &object.mesh).map_err(semfm::Error::from)?),
        None => Ok(()),
    }
}

fn put(staged: StagedFolder) -> Result<Vec<PathBuf>> {
    // Files of an earlier plan that this one does not have.
    let gone: Vec<&str> =
        PLAN_FILES.iter().copied().filter(|name| !staged.path().join(name).exists()).collect();
    Ok(staged.put(&PLAN_FILES[PLAN_FILES.len() - LAST..], &gone)?)
}
