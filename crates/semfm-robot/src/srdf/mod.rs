//! SRDF: what a URDF does not say of a robot, as MoveIt keeps it: which pairs of links need no collision check, groups
//! of joints, named states, end effectors.
//!
//! The text is read under the limits of the URDF reader. What is unknown to the robot is a warning and is passed over:
//! one SRDF often serves several variants of a robot.

mod groups;
mod read;

use std::path::Path;

use semfm_geom::io::{foreign_kind, read_at_most};

use crate::Result;
use crate::robot::Robot;
use crate::urdf::{Fault, MAX_BYTES, XmlElements};

/// A semantic description that belongs to a robot; links and joints are places in the robot's lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Srdf {
    /// Name of the robot in the file.
    pub name: String,
    /// Pairs of links that are not checked for collisions, each once.
    pub disabled: Vec<DisabledPair>,
    /// Sets of joints and links with a name.
    pub groups: Vec<Group>,
    /// Positions with a name.
    pub states: Vec<GroupState>,
    /// Hands.
    pub end_effectors: Vec<EndEffector>,
    /// Joints between the robot and the world around it.
    pub virtual_joints: Vec<VirtualJoint>,
    /// Joints that no controller moves.
    pub passive_joints: Vec<usize>,
    /// What was passed over, in words.
    pub warnings: Vec<String>,
}

/// Two links that are not checked for collisions with each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisabledPair {
    /// The links, the lower place first.
    pub links: [usize; 2],
    /// Why, as the file says it: `Adjacent`, `Never`, …
    pub reason: String,
}

/// Joints and links with a name, subgroups and chains resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Joints in the robot's order: those named, those that lead to a link named, those of its chains.
    pub joints: Vec<usize>,
    /// Links in the robot's order: those named, those that its joints move, those of its chains.
    pub links: Vec<usize>,
    /// The ends of its own chains.
    pub chains: Vec<ChainEnds>,
}

/// The links at both ends of a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChainEnds {
    /// The link nearer the root.
    pub base: usize,
    /// The other one.
    pub tip: usize,
}

/// Positions of a group's joints with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupState {
    /// Its name, `ready` for example.
    pub name: String,
    /// The group that it is for.
    pub group: String,
    /// Joints and their positions, radians or metres.
    pub positions: Vec<(usize, f64)>,
}

/// A hand: a group of links on a link of an arm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EndEffector {
    /// Its name.
    pub name: String,
    /// The group of its links.
    pub group: String,
    /// The link of the arm that it sits on.
    pub parent_link: usize,
    /// The group of the arm, where told.
    pub parent_group: Option<String>,
}

/// A joint between a frame of the world and the robot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VirtualJoint {
    /// Its name.
    pub name: String,
    /// `fixed`, `floating` or `planar`.
    pub kind: String,
    /// The frame outside of the robot.
    pub parent_frame: String,
    /// The link that it leads to.
    pub child_link: usize,
}

impl Srdf {
    /// Reads an SRDF file that belongs to a robot.
    ///
    /// # Errors
    /// [`Error::Geom`](crate::Error::Geom) where it cannot be read or is no regular file;
    /// [`Error::Urdf`](crate::Error::Urdf) with code, line and element where the file is too large, is not plain XML in
    /// UTF-8, has another outermost element than `robot`, lacks an attribute, or holds a number that is not finite.
    pub fn read(path: impl AsRef<Path>, robot: &Robot) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(&read_at_most(path, MAX_BYTES + 1)?, path, robot)
    }

    /// Reads the bytes of an SRDF; `path` names it in messages.
    ///
    /// # Errors
    /// [`Error::Urdf`](crate::Error::Urdf), see [`Srdf::read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>, robot: &Robot) -> Result<Self> {
        let read = || {
            if bytes.len() as u64 > MAX_BYTES {
                let expected = format!("at most {} MB", MAX_BYTES >> 20);
                return Err(Fault::new("size", "whole file", expected, "more"));
            }
            if let Some(kind) = foreign_kind(bytes).filter(|kind| *kind != "XML") {
                return Err(Fault::new("srdf", "first bytes", "an SRDF", kind));
            }
            read::read(&XmlElements::read(bytes)?, robot)
        };
        read().map_err(|fault| fault.in_file(path.as_ref()))
    }

    /// The group of that name.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.groups.iter().find(|group| group.name == name)
    }

    /// The state of that name; where several groups have one, that of the group with the most joints.
    pub fn state(&self, name: &str) -> Option<&GroupState> {
        let named = self.states.iter().filter(|state| state.name == name);
        named.rev().max_by_key(|state| state.positions.len())
    }

    /// The ends of the chain with the most joints that move by themselves: the arm that the file means.
    pub fn arm_ends(&self, robot: &Robot) -> Option<ChainEnds> {
        let n_moving = |group: &&Group| {
            let joints = group.joints.iter().map(|&joint| &robot.joints[joint]);
            joints.filter(|joint| joint.kind.has_position() && joint.mimic.is_none()).count()
        };
        let of_one_chain = self.groups.iter().filter(|group| group.chains.len() == 1);
        of_one_chain.rev().max_by_key(n_moving).map(|group| group.chains[0])
    }
}

#[cfg(test)]
mod tests;
