//! Kinematics of an arm: a chain of joints from a base link to a tip link.

mod arm;
mod arm_files;
mod arm_joint;
mod chain;
mod cholesky;
mod ends;
mod inverse;

pub use arm::{Arm, ArmSettings};
pub use arm_files::{ArmFiles, OpenedArm};
pub use arm_joint::{ArmJoint, DEFAULT_ACCELERATION, DEFAULT_VELOCITY};
pub use inverse::{IkAnswer, IkSettings, IkSolution, InverseKinematics, Preference};
