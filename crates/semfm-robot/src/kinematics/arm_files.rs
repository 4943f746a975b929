//! An arm out of its files: description, semantic description, limits.

use std::path::PathBuf;
use std::sync::Arc;

use semfm_geom::suggestion::unknown_name;

use super::arm::{Arm, ArmSettings};
use crate::joint_limits_file::JointLimitsFile;
use crate::srdf::Srdf;
use crate::urdf::RobotDescription;
use crate::{Error, Result};

/// The files of an arm, and what they do not say.
#[derive(Clone, Debug, Default)]
pub struct ArmFiles {
    /// URDF: links and joints.
    pub urdf: PathBuf,
    /// SRDF: the chain that is meant as the arm, and named states.
    pub srdf: Option<PathBuf>,
    /// MoveIt's `joint_limits.yaml`, or another file with that table.
    pub limits: Option<PathBuf>,
    /// The link in whose frame poses are told; by default that of the SRDF's chain where no tip is given, else the root.
    pub base: Option<String>,
    /// The link that the arm moves; by default that of the SRDF's chain where no base is given, else the end of the one
    /// chain of joints.
    pub tip: Option<String>,
    /// Positions of joints outside the chain by name.
    pub fixed: Vec<(String, f64)>,
}

/// An arm and what was read beside it.
#[derive(Clone, Debug)]
pub struct OpenedArm {
    /// The arm.
    pub arm: Arc<Arm>,
    /// The semantic description, where there is one.
    pub srdf: Option<Srdf>,
    /// What was found, assumed or passed over, in words.
    pub notes: Vec<String>,
}

impl ArmFiles {
    /// Reads the files.
    ///
    /// # Errors
    /// Those of [`RobotDescription::read`], [`RobotDescription::tree`], [`Srdf::read`], [`JointLimitsFile::read`] and
    /// [`Arm::new`].
    pub fn open(&self) -> Result<OpenedArm> {
        let description = RobotDescription::read(&self.urdf)?;
        let robot = Arc::new(description.tree()?);
        let srdf = self.srdf.as_ref().map(|path| Srdf::read(path, &robot)).transpose()?;
        let limits = self.limits.as_ref().map(JointLimitsFile::read).transpose()?;
        let mut notes = description.notes().to_vec();
        notes.extend(srdf.iter().flat_map(|srdf| srdf.warnings.iter().cloned()));
        let (mut base, mut tip) = (self.base.clone(), self.tip.clone());
        let ends = srdf.as_ref().and_then(|srdf| srdf.arm_ends(&robot));
        if let (None, None, Some(ends)) = (&base, &tip, ends) {
            let [from, to] = [ends.base, ends.tip].map(|link| robot.links[link].name.clone());
            notes.push(format!("base and tip: `{from}` and `{to}`, the chain of the SRDF"));
            (base, tip) = (Some(from), Some(to));
        }
        let arm = Arm::new(robot, &ArmSettings { base, tip, limits, fixed: self.fixed.clone() })?;
        notes.extend(arm.notes().iter().cloned());
        Ok(OpenedArm { arm: Arc::new(arm), srdf, notes })
    }
}

impl OpenedArm {
    /// Joint values of a state that the SRDF names; the first of that name that tells every joint of the arm.
    ///
    /// # Errors
    /// [`Error::Arm`] where there is none.
    pub fn named_state(&self, name: &str) -> Result<Vec<f64>> {
        let states = || self.srdf.iter().flat_map(|srdf| &srdf.states);
        let of_arm = |state: &crate::GroupState| -> Option<Vec<f64>> {
            let of_joint = |index| state.positions.iter().find(|(joint, _)| *joint == index);
            self.arm.joints().iter().map(|joint| of_joint(joint.index).map(|(_, q)| *q)).collect()
        };
        states().filter(|state| state.name == name).find_map(of_arm).ok_or_else(|| Error::Arm {
            what: "state".into(),
            expected: "a state of the SRDF that tells every joint of the arm".into(),
            found: unknown_name(name, states().map(|state| state.name.as_str())),
        })
    }
}
