//! What `bench/planning_problems.py unpack` wrote of one robot: its files and its problems.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm::files::SceneFile;
use semfm::motion::{CollisionModel, CollisionSettings};
use semfm::robot::{Arm, ArmSettings, MeshPaths, RobotDescription, Srdf};
use serde::Deserialize;

/// The content of `problems.json`.
#[derive(Deserialize)]
pub struct Problems {
    tip: String,
    joints: Vec<String>,
    pub problems: Vec<Problem>,
}

#[derive(Deserialize)]
pub struct Problem {
    pub name: String,
    pub start: Vec<f64>,
    pub goal: Vec<f64>,
    pub scene: SceneFile,
}

/// The robot that the problems are set for.
pub struct ProblemRobot {
    pub arm: Arc<Arm>,
    srdf: Srdf,
    urdf: PathBuf,
}

impl Problems {
    pub fn path(folder: &Path) -> PathBuf {
        folder.join("problems.json")
    }

    pub fn read(folder: &Path) -> Result<Self, Box<dyn Error>> {
        Ok(serde_json::from_slice(&std::fs::read(Self::path(folder))?)?)
    }
}

impl ProblemRobot {
    /// The robot in `folder`; its joints are those that the problems name.
    pub fn read(folder: &Path, problems: &Problems) -> Result<Self, Box<dyn Error>> {
        let urdf = folder.join("robot.urdf");
        let robot = Arc::new(RobotDescription::read(&urdf)?.tree()?);
        let srdf = Srdf::read(folder.join("robot.srdf"), &robot)?;
        let settings = ArmSettings { tip: Some(problems.tip.clone()), ..Default::default() };
        let arm = Arc::new(Arm::new(robot, &settings)?);
        let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        if names != problems.joints {
            return Err(format!("expected joints {:?}, found {names:?}", problems.joints).into());
        }
        Ok(Self { arm, srdf, urdf })
    }

    /// Its links, in contact from this distance on (metres).
    pub fn model(&self, contact: f64) -> Result<CollisionModel, Box<dyn Error>> {
        let paths = MeshPaths::new(&self.urdf, &Default::default());
        let settings = CollisionSettings { contact, ..Default::default() };
        Ok(CollisionModel::new(self.arm.clone(), &paths, Some(&self.srdf), &settings)?)
    }
}
