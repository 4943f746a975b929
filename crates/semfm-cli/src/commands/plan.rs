//! `semfm-cli plan`: from grasps to a motion of an arm.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use semfm::files::GraspsFile;
use semfm::geom::io::read_mesh;
use semfm::{PlanObject, Task};
use semfm_show::{PLAN_FILES, write_plan};

use super::Outcome;
use super::motion_options::{MotionOptions, PreparedMotion, print_plan, summary};
use crate::console;
use crate::options::{Common, parse_package};
use crate::output::{check_folder, check_folder_again};

/// Plan the motion of an arm to one of several grasps: reach, approach, close, lift
///
/// Grasps are tried in the order in which the arm can best reach them. The motion that is written was checked as it is
/// timed, against the robot, the scene and the object.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli plan --robot arm.urdf --tip flange --grasps out/grasps.json --object kettle.obj \\\n    \
    --base-from-object 0.5,0,0,0,0,0 --start 0,-0.35,0,1.9,0,1.55,0 -o plan\n  \
    semfm-cli plan --robot panda.urdf --srdf panda.srdf --limits joint_limits.yaml --grasps grasps.json \\\n    \
    --object kettle.obj --base-from-camera base_from_camera.json --scene scene.json -o plan\n\n\
    Exit code 0: a motion. 1: no grasp can be carried out; plan.json says which gate each did not pass, miss.png shows \
    the nearest miss. 2: bad input, and nothing is written. More: docs/motion.md")]
pub struct PlanCommand {
    /// The robot (URDF)
    #[arg(long, value_name = "URDF")]
    robot: PathBuf,
    /// The grasps, from `semfm-cli grasp` or `transfer`
    #[arg(long, value_name = "grasps.json")]
    grasps: PathBuf,
    /// The mesh that the grasps belong to; without it nothing keeps the arm away from the object
    #[arg(long, value_name = "MESH")]
    object: Option<PathBuf>,
    /// What stands around, in the frame of the arm's base, metres: scene.json, meshes and point clouds
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    scene: Vec<PathBuf>,
    /// Folder of a package that the robot's URDF names (`package://NAME/…`)
    #[arg(long, value_name = "NAME=FOLDER", value_parser = parse_package, help_heading = "Arm")]
    package: Vec<(String, PathBuf)>,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Seed of everything drawn by chance
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    motion: MotionOptions,
}

impl PlanCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        check_folder(&self.output, PLAN_FILES, &self.inputs())?;
        let task = console::progress(common.quiet);
        let motion = self.motion.prepare(&self.robot, &self.package, &self.scene, self.seed)?;
        let (grasps, object) = self.read_grasps(common)?;
        check_folder_again(&self.output, PLAN_FILES)?;
        carry_out(&motion, grasps, object, &self.output, &task, common)
    }

    fn inputs(&self) -> Vec<&Path> {
        let files = [&self.robot, &self.grasps].into_iter().chain(&self.object).chain(&self.scene);
        files.map(PathBuf::as_path).chain(self.motion.inputs()).collect()
    }

    /// The grasps, with the mesh that they belong to where it is given.
    fn read_grasps(&self, common: &Common) -> Result<(GraspsFile, Option<PlanObject>)> {
        let Some(file) = &self.object else {
            if !common.quiet {
                console::message(
                    "warning: --object is not given: nothing keeps the arm away from the object",
                );
            }
            return Ok((GraspsFile::read_alone(&self.grasps)?, None));
        };
        let mesh = read_mesh(file)?.mesh;
        let grasps = GraspsFile::read(&self.grasps, &mesh)?;
        Ok((grasps, Some(PlanObject { mesh: Arc::new(mesh), file: Some(file.clone()) })))
    }
}

/// Plans, writes the folder, prints the answer, and says how the run ended.
pub fn carry_out(
    motion: &PreparedMotion,
    grasps: GraspsFile,
    object: Option<PlanObject>,
    folder: &Path,
    task: &Task,
    common: &Common,
) -> Result<Outcome> {
    let plan = motion.plan(grasps, object, task)?;
    let files = write_plan(folder, &motion.arm, &plan, task)?;
    if common.json {
        console::data(summary(&plan, &files));
    } else {
        print_plan(&plan, common);
        console::data("wrote");
        files.iter().for_each(|file| console::data(format_args!("  {}", file.display())));
    }
    Ok(if plan.answer.motion.is_some() { Outcome::Done } else { Outcome::NoAnswer })
}
