//! A tree of joint values that grows and is asked for the nearest of them.

use super::joint_space::{JointSpace, short_way};

/// Joint values with a parent each. Roots come first and have themselves as parent.
///
/// The nearest node is found by a scan that leaves a node as soon as its partial distance is too long. On the
/// 1 400 problems of MotionBenchMaker nine trees in ten stay below 300 nodes, where a scan takes under 2 µs; a
/// k-d tree (kiddo) would need the number of joints at compile time and copies for the turns of continuous joints.
pub(super) struct Tree {
    n_joints: usize,
    /// Flat, `n_joints` a node.
    values: Vec<f64>,
    parents: Vec<u32>,
}

impl Tree {
    pub fn new(n_joints: usize) -> Self {
        Self { n_joints, values: Vec::new(), parents: Vec::new() }
    }

    pub fn len(&self) -> usize {
        self.parents.len()
    }

    pub fn add_root(&mut self, q: &[f64]) {
        let index = self.parents.len() as u32;
        self.values.extend_from_slice(q);
        self.parents.push(index);
    }

    pub fn add(&mut self, q: &[f64], parent: usize) -> usize {
        self.values.extend_from_slice(q);
        self.parents.push(parent as u32);
        self.parents.len() - 1
    }

    pub fn node(&self, index: usize) -> &[f64] {
        &self.values[index * self.n_joints..(index + 1) * self.n_joints]
    }

    /// Index of the node nearest to `q`; the earliest of equals.
    pub fn nearest(&self, space: &JointSpace, q: &[f64]) -> usize {
        let mut nearest = 0;
        let mut least = f64::INFINITY;
        'nodes: for (index, node) in self.values.chunks_exact(self.n_joints).enumerate() {
            let mut squares = 0.0;
            for (joint, (&a, &b)) in space.joints().iter().zip(node.iter().zip(q)) {
                let way = short_way(joint, a, b);
                squares += way * way;
                if squares >= least {
                    continue 'nodes;
                }
            }
            (nearest, least) = (index, squares);
        }
        nearest
    }

    /// Joint values from `index` up to its root, in that order.
    pub fn to_root(&self, mut index: usize) -> Vec<Vec<f64>> {
        let mut branch = vec![self.node(index).to_vec()];
        while self.parents[index] as usize != index {
            index = self.parents[index] as usize;
            branch.push(self.node(index).to_vec());
        }
        branch
    }

    /// The root above `index`.
    pub fn root(&self, mut index: usize) -> usize {
        while self.parents[index] as usize != index {
            index = self.parents[index] as usize;
        }
        index
    }
}
