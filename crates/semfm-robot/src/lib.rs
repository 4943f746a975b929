//! Robot descriptions, arms and parallel-jaw grippers.
//!
//! [`RobotDescription`] reads URDF files under limits and gives a [`Robot`]: links and joints as
//! plain data, with forward kinematics. An [`Arm`] is a chain of its joints with limits ([`JointLimitsFile`], [`Srdf`])
//! and kinematics on flat arrays; [`InverseKinematics`] finds joint values for a pose. A [`Gripper`] comes from such a description or from the
//! table of built-in ones. Its frame (TCP) has its origin between the finger pads, +z along the
//! approach and y along the closing direction. Lengths are metres, angles radians.
//!
//! ```
//! use semfm_robot::Gripper;
//! let gripper = Gripper::builtin("robotiq-2f85")?;
//! assert_eq!(gripper.opening, 0.0..=0.085);
//! // A linkage carries the pads away from the flange as it closes.
//! let [closed, open] = [0.0, 0.085].map(|width| gripper.flange_from_tcp_at(width).translation.z);
//! assert!(closed > open);
//! # Ok::<(), semfm_robot::Error>(())
//! ```

mod error;
mod gripper;
mod joint;
mod joint_limits_file;
mod kinematics;
mod link;
mod link_shape;
mod link_surface;
mod robot;
mod srdf;
mod urdf;
mod yaml;

pub use error::{Error, Result};
pub use gripper::{
    BUILTIN_GRIPPERS, BuiltinGripper, DriveJoint, Gripper, GripperPart, GripperSettings,
    JointPosition, MAX_SPAN, Motion, PosedPart, Role,
};
pub use joint::{Joint, JointKind, JointLimits, Mimic, SafetyController};
pub use joint_limits_file::{JointLimitsFile, ToldLimits};
pub use kinematics::{
    Arm, ArmFiles, ArmJoint, ArmSettings, DEFAULT_ACCELERATION, DEFAULT_VELOCITY, IkAnswer,
    IkSettings, IkSolution, InverseKinematics, OpenedArm, Preference,
};
pub use link::{Geometry, Inertial, Link, LinkGeometry};
pub use link_shape::{ConvexPiece, ConvexPieces, LinkShape};
pub use link_surface::LinkSurface;
/// A rotation and a translation, metres: the pose type of the whole crate.
pub use parry3d_f64::math::Pose;
pub use robot::Robot;
pub use srdf::{ChainEnds, DisabledPair, EndEffector, Group, GroupState, Srdf, VirtualJoint};
pub use urdf::{MeshPaths, MeshPlace, MeshUse, RobotDescription};

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_send_sync<T: Send + Sync>() {}

    #[test]
    fn public_types_can_be_shared_between_threads() {
        assert_send_sync::<Arm>();
        assert_send_sync::<BuiltinGripper>();
        assert_send_sync::<Error>();
        assert_send_sync::<Gripper>();
        assert_send_sync::<GripperSettings>();
        assert_send_sync::<InverseKinematics>();
        assert_send_sync::<MeshPaths>();
        assert_send_sync::<Robot>();
        assert_send_sync::<RobotDescription>();
        assert_send_sync::<Srdf>();
    }
}
