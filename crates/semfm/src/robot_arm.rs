//! An arm from its files, ready to plan with.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use semfm_motion::{CollisionModel, CollisionSettings, MotionPlanner};
use semfm_robot::{Arm, ArmFiles, MeshPaths, OpenedArm};

use crate::{Error, Result};

/// Names of states in which arms stand ready, in the order in which they are looked for.
const READY: [&str; 3] = ["ready", "home", "up"];

/// An arm with its collision model: read once, planned with often.
#[derive(Clone, Debug)]
pub struct RobotArm {
    urdf: PathBuf,
    packages: BTreeMap<String, PathBuf>,
    opened: OpenedArm,
    planner: MotionPlanner,
    notes: Vec<String>,
}

impl RobotArm {
    /// Reads the files of an arm and makes its collision model. `packages` maps the names of `package://NAME/…`.
    ///
    /// # Errors
    /// [`Error::Robot`] for files that are not what they should be, links that are not there, joints whose limits are
    /// crossed, a base that floats; [`Error::Motion`] where the collision model cannot be made;
    /// [`Error::Invalid`] where a mesh of a link is missing: nothing would keep that link from touching something.
    pub fn open(
        files: &ArmFiles,
        packages: &BTreeMap<String, PathBuf>,
        collision: &CollisionSettings,
    ) -> Result<Self> {
        Self::of(files.open()?, &files.urdf, packages, collision)
    }

    /// The arm that was read from `urdf`, with its collision model.
    ///
    /// # Errors
    /// As [`RobotArm::open`], but for the files that were read.
    pub fn of(
        opened: OpenedArm,
        urdf: &Path,
        packages: &BTreeMap<String, PathBuf>,
        collision: &CollisionSettings,
    ) -> Result<Self> {
        let paths = MeshPaths::new(urdf, packages);
        let model =
            CollisionModel::new(opened.arm.clone(), &paths, opened.srdf.as_ref(), collision)?;
        if let Some(first) = model.missing().first() {
            let expected = "every mesh, so that no link moves unchecked: map its package (--package NAME=FOLDER, or packages={NAME: FOLDER})";
            let found = format!("{} that are missing, first {first}", model.missing().len());
            return Err(Error::invalid("collision meshes of the robot", expected, found));
        }
        let mut notes = opened.notes.clone();
        notes.extend(model.notes().iter().cloned());
        let planner = MotionPlanner::new(Arc::new(model))?;
        notes.extend(planner.notes().iter().cloned());
        let (urdf, packages) = (urdf.to_owned(), packages.clone());
        Ok(Self { urdf, packages, opened, planner, notes })
    }

    /// The chain of joints.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.opened.arm
    }

    /// The arm with what was read beside it.
    pub fn opened(&self) -> &OpenedArm {
        &self.opened
    }

    /// The planner of this arm.
    pub fn planner(&self) -> &MotionPlanner {
        &self.planner
    }

    /// The file of the description.
    pub fn urdf(&self) -> &Path {
        &self.urdf
    }

    /// Folders of the packages in `package://NAME/…`.
    pub fn packages(&self) -> &BTreeMap<String, PathBuf> {
        &self.packages
    }

    /// What was found or assumed, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Joint values of the state in which the arm stands ready by its SRDF: `ready`, `home` or `up`.
    ///
    /// # Errors
    /// [`Error::Invalid`] where it tells none.
    pub fn ready_state(&self) -> Result<Vec<f64>> {
        let names: Vec<&str> =
            self.arm().joints().iter().map(|joint| joint.name.as_str()).collect();
        READY.iter().find_map(|name| self.opened.named_state(name).ok()).ok_or_else(|| {
            let expected = format!("joint values of {}", names.join(", "));
            Error::invalid("start", expected, "none, and no SRDF with a state `ready` or `home`")
        })
    }
}
