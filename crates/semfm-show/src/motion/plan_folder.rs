//! The folder of a plan: what a program, a controller, a viewer and a person take from a motion.

use std::path::{Path, PathBuf};

use semfm::files::TrajectoryFile;
use semfm::geom::io::StagedFolder;
use semfm::{PlannedMotion, Task};

use super::animated_glb::write_glb_of;
use super::bodies::MotionBodies;
use super::frame_tracks::FrameTracks;
use crate::Result;
use crate::pictures::write_motion_picture_of;

/// Every file that the folder of a plan can have, that for programs last.
pub const PLAN_FILES: &[&str] = &[
    "motion.glb",
    "motion.png",
    "scene.mcap",
    "trajectory.mcap",
    "metadata.yaml",
    "trajectory.json",
];

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
    let at = |name: &str| staged.path().join(name);
    let (bodies, tracks) = (MotionBodies::new(&motion.scene)?, FrameTracks::new(motion));
    let file = TrajectoryFile::new(motion, folder)?;
    file.write(&at("trajectory.json"))?;
    write_glb_of(&at("motion.glb"), motion, &bodies, &tracks)?;
    write_motion_picture_of(&at("motion.png"), motion, &bodies, task)?;
    #[cfg(feature = "mcap")]
    {
        semfm::files::write_ros2_trajectory(staged.path(), motion)?;
        let about = file.to_json();
        crate::foxglove::write_motion_scene(&at("scene.mcap"), motion, &bodies, &tracks, &about)?;
    }
    // Files of an earlier plan that this build does not write.
    let gone: Vec<&str> =
        PLAN_FILES.iter().copied().filter(|name| !staged.path().join(name).exists()).collect();
    Ok(staged.put(&PLAN_FILES[PLAN_FILES.len() - 2..], &gone)?)
}
