//! Where the joints of an arm are: what collision checks need of its kinematics, once for each state.

use parry3d_f64::math::Pose;
use semfm_geom::math::{DMat3, DQuat, DVec3};
use semfm_robot::{Arm, JointKind};

use super::body::Frame;

/// The joints of a robot that the values of an arm move, with every fixed transform between them multiplied out; each
/// joint's frame is turned so that its axis is z.
///
/// > frame(q) = frame of the joint before · fixed · (turn about z by, or shift along z by, factor · q)
///
/// Offsets of mimics are part of what is fixed: everything is taken from where the links are at q = 0.
#[derive(Clone, Debug)]
pub(crate) struct JointFrames {
    joints: Vec<MovingJoint>,
    links: Vec<LinkPlace>,
    /// Where the base stands in case joints move it (a mimic below it): then the root is a frame, too, and all frames are
    /// told as seen from the base.
    moving_base: Option<LinkPlace>,
}

#[derive(Clone, Debug)]
struct MovingJoint {
    before: Option<usize>,
    fixed: JointFrame,
    slides: bool,
    variable: usize,
    factor: f64,
    /// The robot's joint; `None` for the root.
    index: Option<usize>,
}

/// What moves a link, and where it is in the frame of that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkPlace {
    /// Place in the list of frames; `None` for the base.
    pub(crate) joint: Option<usize>,
    pub(crate) joint_from_link: Pose,
}

/// A frame in that of the arm's base.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointFrame {
    pub(crate) turn: DMat3,
    pub(crate) at: DVec3,
}

impl JointFrames {
    pub(crate) fn new(arm: &Arm) -> Self {
        let robot = arm.robot();
        let leaders = robot.leaders();
        // Mimics are affine in their leader: two positions tell the factor.
        let at = |position: f64| robot.with_mimics(&vec![position; robot.joints.len()]);
        let (zero, one) = (at(0.0), at(1.0));
        let mut poses = Vec::new();
        arm.link_poses(&vec![0.0; arm.n_joints()], &mut poses);
        let variable_of = |index: usize| {
            let variable = arm.joints().iter().position(|own| own.index == leaders[index]);
            variable.filter(|_| robot.joints[index].kind.has_position())
        };
        let above = |link: &usize| robot.joint_to(*link).map(|joint| robot.joints[joint].parent);
        let mut to_root = std::iter::successors(Some(arm.base()), above);
        let base_moves =
            to_root.any(|link| robot.joint_to(link).is_some_and(|i| variable_of(i).is_some()));
        let mut joints: Vec<MovingJoint> = Vec::new();
        if base_moves {
            joints.push(MovingJoint::root());
        }
        let root = base_moves.then_some(0);
        let unmoved = |link: usize| LinkPlace { joint: root, joint_from_link: poses[link] };
        let mut links: Vec<LinkPlace> = (0..robot.links.len()).map(unmoved).collect();
        // Joints stand in order from the root outwards.
        for (index, joint) in robot.joints.iter().enumerate() {
            let before = links[joint.parent];
            // The parent's own link, then from it to the child as both stand at zero.
            let place = before.joint_from_link * poses[joint.parent].inv_mul(&poses[joint.child]);
            links[joint.child] = LinkPlace { joint: before.joint, joint_from_link: place };
            let Some(variable) = variable_of(index) else { continue };
            let to_axis = Pose::from_rotation(DQuat::from_rotation_arc(DVec3::Z, joint.axis));
            joints.push(MovingJoint {
                before: before.joint,
                fixed: JointFrame::new(&(place * to_axis)),
                slides: joint.kind == JointKind::Prismatic,
                variable,
                factor: one[index] - zero[index],
                index: Some(index),
            });
            let joint_from_link = to_axis.inverse();
            links[joint.child] = LinkPlace { joint: Some(joints.len() - 1), joint_from_link };
        }
        let moving_base = base_moves.then(|| links[arm.base()]);
        Self { joints, links, moving_base }
    }

    /// What moves a link.
    pub(crate) fn link(&self, link: usize) -> LinkPlace {
        self.links[link]
    }

    /// Place of one of the robot's joints in the list of frames.
    pub(crate) fn of_joint(&self, index: usize) -> Option<usize> {
        self.joints.iter().position(|joint| joint.index == Some(index))
    }

    /// Puts the frames of all joints at the values `q`.
    pub(crate) fn place(&self, q: &[f64], frames: &mut Vec<JointFrame>) {
        frames.clear();
        for joint in &self.joints {
            let fixed = &joint.fixed;
            let at = joint.before.map_or(*fixed, |before| frames[before].then(fixed));
            let position = joint.factor * q[joint.variable];
            frames.push(if joint.slides { at.shifted(position) } else { at.turned(position) });
        }
        if let Some(LinkPlace { joint: Some(joint), joint_from_link }) = self.moving_base {
            let root_from_base = frames[joint].then(&JointFrame::new(&joint_from_link));
            let back = root_from_base.turn.transpose();
            for frame in frames {
                *frame = JointFrame {
                    turn: back * frame.turn,
                    at: back * (frame.at - root_from_base.at),
                };
            }
        }
    }
}

impl MovingJoint {
    /// Stands for the root: a joint that does not move.
    fn root() -> Self {
        let fixed = JointFrame { turn: DMat3::IDENTITY, at: DVec3::ZERO };
        Self { before: None, fixed, slides: false, variable: 0, factor: 0.0, index: None }
    }
}

impl JointFrame {
    pub(crate) fn new(pose: &Pose) -> Self {
        Self { turn: DMat3::from_quat(pose.rotation), at: pose.translation }
    }

    /// A frame told in this one.
    pub(crate) fn then(&self, other: &Self) -> Self {
        Self { turn: self.turn * other.turn, at: self.point(other.at) }
    }

    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.at
    }

    pub(crate) fn as_frame(&self) -> Frame {
        Frame { pose: Pose::from_parts(self.at, DQuat::from_mat3(&self.turn)), turn: self.turn }
    }

    fn shifted(&self, by: f64) -> Self {
        Self { turn: self.turn, at: self.at + by * self.turn.z_axis }
    }

    fn turned(&self, by: f64) -> Self {
        let (sin, cos) = by.sin_cos();
        let DMat3 { x_axis, y_axis, z_axis } = self.turn;
        let turn =
            DMat3::from_cols(cos * x_axis + sin * y_axis, cos * y_axis - sin * x_axis, z_axis);
        Self { turn, at: self.at }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use proptest::prelude::*;
    use semfm_robot::{ArmSettings, RobotDescription};

    use super::*;

    /// A torso that a mimic of the elbow turns, an arm on it whose base is the torso, a slide, a side branch.
    const URDF: &str = r#"<robot name="r"><link name="ground"/><link name="torso"/><link name="a"/><link name="b"/>
        <link name="c"/><link name="tip"/><link name="side"/>
        <joint name="waist" type="revolute"><parent link="ground"/><child link="torso"/><origin xyz="0 0.1 0.5" rpy="0.3 0 0.2"/>
          <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="1"/><mimic joint="elbow" multiplier="-0.5" offset="0.2"/></joint>
        <joint name="shoulder" type="continuous"><parent link="torso"/><child link="a"/><origin xyz="0.2 0 0.1" rpy="0 1 0"/><axis xyz="0.6 0 0.8"/></joint>
        <joint name="fix" type="fixed"><parent link="a"/><child link="b"/><origin xyz="0 0.3 0" rpy="0.1 0.2 0.3"/></joint>
        <joint name="elbow" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.1 0 0"/><axis xyz="0 -1 0"/>
          <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
        <joint name="slide" type="prismatic"><parent link="c"/><child link="tip"/><origin xyz="0 0 0.2" rpy="1 0 0"/><axis xyz="1 0 0"/>
          <limit lower="0" upper="0.3" velocity="1" effort="1"/></joint>
        <joint name="branch" type="fixed"><parent link="b"/><child link="side"/><origin xyz="0 0 0.4"/></joint></robot>"#;

    proptest! {
        #[test]
        fn links_are_where_the_arm_has_them(q in prop::array::uniform3(-2.0..2.0_f64), from_ground in any::<bool>()) {
            let robot = RobotDescription::parse(URDF.as_bytes(), Path::new("r.urdf")).unwrap().tree().unwrap();
            let base = if from_ground { "ground" } else { "torso" };
            let settings = ArmSettings { base: Some(base.into()), tip: Some("tip".into()), ..Default::default() };
            let arm = Arm::new(Arc::new(robot), &settings).unwrap();
            let q = &q[..arm.n_joints()];
            let (frames, mut poses, mut placed) = (JointFrames::new(&arm), Vec::new(), Vec::new());
            arm.link_poses(q, &mut poses);
            frames.place(q, &mut placed);
            for (link, pose) in poses.iter().enumerate() {
                let LinkPlace { joint, joint_from_link } = frames.link(link);
                let place = JointFrame::new(&joint_from_link);
                let found = joint.map_or(place, |joint| placed[joint].then(&place)).as_frame().pose;
                prop_assert!(found.translation.distance(pose.translation) < 1e-12);
                prop_assert!(found.rotation.dot(pose.rotation).abs() > 1.0 - 1e-12);
            }
        }
    }
}
