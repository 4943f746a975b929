//! A serial chain as flat constants, and where its tip is.

use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};

use crate::joint::JointKind;
use crate::robot::Robot;

/// How the position of a joint of the robot follows from the arm's joint values:
/// `multiplier × q[variable] + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follows {
    /// Place among the arm's joints; `None` for a joint that stands at `offset`.
    pub variable: Option<usize>,
    pub multiplier: f64,
    pub offset: f64,
}

impl Follows {
    pub fn position(&self, q: &[f64]) -> f64 {
        self.variable.map_or(self.offset, |variable| self.multiplier * q[variable] + self.offset)
    }
}

/// A moving joint of the chain. Its frame is turned so that its axis is z.
#[derive(Clone, Debug)]
struct ChainJoint {
    /// From the frame of the moving joint before it (or the base), all fixed transforms between included.
    rotation: DMat3,
    translation: DVec3,
    slides: bool,
    variable: usize,
    multiplier: f64,
    offset: f64,
}

/// The moving joints from base to tip with every fixed transform between them multiplied out.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    joints: Vec<ChainJoint>,
    /// From the last moving joint's frame to the tip.
    rotation: DMat3,
    translation: DVec3,
}

/// A rotation and a translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub rotation: DMat3,
    pub translation: DVec3,
}

impl Frame {
    pub fn pose(&self) -> Pose {
        Pose::from_parts(self.translation, DQuat::from_mat3(&self.rotation).normalize())
    }
}

impl From<&Pose> for Frame {
    fn from(pose: &Pose) -> Self {
        Self { rotation: DMat3::from_quat(pose.rotation), translation: pose.translation }
    }
}

impl Chain {
    /// `path`: joints of the robot from where it starts to the tip; `follows`: one a joint of the robot.
    pub fn new(robot: &Robot, base_from_start: Pose, path: &[usize], follows: &[Follows]) -> Self {
        let mut before = base_from_start;
        let mut joints = Vec::new();
        for &index in path {
            let joint = &robot.joints[index];
            let here = before * joint.parent_from_joint;
            let Follows { variable: Some(variable), multiplier, offset } = follows[index] else {
                before = here * joint.motion(follows[index].offset);
                continue;
            };
            let joint_from_axis =
                Pose::from_rotation(DQuat::from_rotation_arc(DVec3::Z, joint.axis));
            let Frame { rotation, translation } = Frame::from(&(here * joint_from_axis));
            let slides = joint.kind == JointKind::Prismatic;
            joints.push(ChainJoint { rotation, translation, slides, variable, multiplier, offset });
            before = joint_from_axis.inverse();
        }
        let Frame { rotation, translation } = Frame::from(&before);
        Self { joints, rotation, translation }
    }

    /// The tip's frame in that of the base.
    pub fn tip(&self, q: &[f64]) -> Frame {
        let mut at = Frame { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
        for joint in &self.joints {
            at = joint.moved(joint.placed(at), q);
        }
        self.ended(at)
    }

    /// The tip's frame, and the Jacobian of its velocity: 6 × n, row-major, rows vx vy vz ωx ωy ωz in the base's frame.
    ///
    /// > v = z × (p_tip − p), ω = z for a joint that turns about z through p; v = z, ω = 0 for one that slides.
    pub fn tip_with_jacobian(&self, q: &[f64], jacobian: &mut [f64]) -> Frame {
        let n = q.len();
        jacobian.fill(0.0);
        let mut at = Frame { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
        for joint in &self.joints {
            at = joint.placed(at);
            let axis = at.rotation.z_axis * joint.multiplier;
            // The tip is not known before the last joint: −z × p first, ω × p_tip below.
            let (linear, angular) =
                if joint.slides { (axis, DVec3::ZERO) } else { (at.translation.cross(axis), axis) };
            for row in 0..3 {
                jacobian[row * n + joint.variable] += linear[row];
                jacobian[(row + 3) * n + joint.variable] += angular[row];
            }
            at = joint.moved(at, q);
        }
        let tip = self.ended(at);
        for variable in 0..n {
            let [x, y, z] = [3, 4, 5].map(|row| jacobian[row * n + variable]);
            let linear = DVec3::new(x, y, z).cross(tip.translation);
            for row in 0..3 {
                jacobian[row * n + variable] += linear[row];
            }
        }
        tip
    }

    fn ended(&self, at: Frame) -> Frame {
        Frame {
            rotation: at.rotation * self.rotation,
            translation: at.translation + at.rotation * self.translation,
        }
    }
}

impl ChainJoint {
    /// The joint's own frame, before it moves.
    fn placed(&self, before: Frame) -> Frame {
        Frame {
            rotation: before.rotation * self.rotation,
            translation: before.translation + before.rotation * self.translation,
        }
    }

    /// After its motion along or about z.
    fn moved(&self, at: Frame, q: &[f64]) -> Frame {
        let position = self.multiplier * q[self.variable] + self.offset;
        let DMat3 { x_axis, y_axis, z_axis } = at.rotation;
        if self.slides {
            return Frame { translation: at.translation + z_axis * position, ..at };
        }
        let (sin, cos) = position.sin_cos();
        let (x, y) = (x_axis * cos + y_axis * sin, y_axis * cos - x_axis * sin);
        Frame { rotation: DMat3::from_cols(x, y, z_axis), ..at }
    }
}
