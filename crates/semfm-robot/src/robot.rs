//! A robot as a kinematic tree: rigid links, joints with limits, and where each link is.

use parry3d_f64::math::Pose;

use crate::joint::Joint;
use crate::link::Link;

/// A kinematic tree, checked: one root, every joint between two of its links.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name in the file.
    pub name: String,
    /// Rigid bodies.
    pub links: Vec<Link>,
    /// Connections between them, every parent's joint before its children's.
    pub joints: Vec<Joint>,
    /// The link that no joint leads to.
    pub root: usize,
}

impl Robot {
    /// The link of that name.
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// The joint of that name.
    pub fn joint(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// The joint that leads to a link, `None` for the root.
    pub fn joint_to(&self, link: usize) -> Option<usize> {
        self.joints.iter().position(|joint| joint.child == link)
    }

    /// The top link of the rigid body that a link belongs to: the one that all of it is fixed to.
    pub fn body_of(&self, mut link: usize) -> usize {
        while let Some(joint) = self.joint_to(link) {
            if self.joints[joint].kind.has_position() {
                break;
            }
            link = self.joints[joint].parent;
        }
        link
    }

    /// The pose of every link in the root's frame (forward kinematics). `positions` (one a joint:
    /// radians or metres) are taken as they are: limits and mimics are the caller's, see
    /// [`Robot::with_mimics`]. A position that is not given counts as zero.
    ///
    /// > root_from_child = root_from_parent · parent_from_joint · motion(position)
    pub fn link_poses(&self, positions: &[f64]) -> Vec<Pose> {
        let mut poses = vec![Pose::IDENTITY; self.links.len()];
        for (joint, position) in
            self.joints.iter().zip(positions.iter().copied().chain(std::iter::repeat(0.0)))
        {
            poses[joint.child] =
                poses[joint.parent] * joint.parent_from_joint * joint.motion(position);
        }
        poses
    }

    /// Positions with every mimic following its leader. Limits of followers are not applied: the
    /// mechanism couples them, and published descriptions contradict themselves there.
    pub fn with_mimics(&self, positions: &[f64]) -> Vec<f64> {
        (0..self.joints.len()).map(|joint| self.position(joint, positions)).collect()
    }

    fn position(&self, joint: usize, positions: &[f64]) -> f64 {
        match self.joints[joint].mimic {
            // Chains end: that was checked when the description was read.
            Some(mimic) => mimic.multiplier * self.position(mimic.joint, positions) + mimic.offset,
            None => positions.get(joint).copied().unwrap_or(0.0),
        }
    }
}
