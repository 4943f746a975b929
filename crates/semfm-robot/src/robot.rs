//! A robot as a kinematic tree: rigid links, joints with limits, and where each link is.

use parry3d_f64::math::Pose;

use crate::joint::{Joint, Mimic};
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
    pub fn body_of(&self, link: usize) -> usize {
        self.bodies()[link]
    }

    /// For each link, the top link of its rigid body, see [`Robot::body_of`]; all at once in linear time.
    pub fn bodies(&self) -> Vec<usize> {
        let mut bodies: Vec<usize> = (0..self.links.len()).collect();
        // Joints stand in order from the root outwards.
        for joint in self.joints.iter().filter(|joint| !joint.kind.has_position()) {
            bodies[joint.child] = bodies[joint.parent];
        }
        bodies
    }

    /// For each joint, the one that it follows at last: the end of its chain of mimics, or itself.
    pub fn leaders(&self) -> Vec<usize> {
        self.along_mimics(|joint| joint, |leader, _| leader)
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
        self.along_mimics(
            |joint| positions.get(joint).copied().unwrap_or(0.0),
            |leader, mimic| mimic.multiplier * leader + mimic.offset,
        )
    }

    /// A value for every joint: that of `leader` for joints that follow none, else what `follow` makes of the value of
    /// the joint followed. Chains end: that was checked when the description was read. Each link of a chain is walked
    /// once, without recursion.
    fn along_mimics<T: Copy>(
        &self,
        leader: impl Fn(usize) -> T,
        follow: impl Fn(T, Mimic) -> T,
    ) -> Vec<T> {
        let mut values: Vec<Option<T>> = vec![None; self.joints.len()];
        let mut chain = Vec::new();
        (0..self.joints.len())
            .map(|joint| {
                let mut at = joint;
                let mut value = loop {
                    match (values[at], self.joints[at].mimic) {
                        (Some(known), _) => break known,
                        (None, None) => break leader(at),
                        (None, Some(mimic)) => {
                            chain.push((at, mimic));
                            at = mimic.joint;
                        }
                    }
                };
                for (follower, mimic) in chain.drain(..).rev() {
                    value = follow(value, mimic);
                    values[follower] = Some(value);
                }
                value
            })
            .collect()
    }
}
