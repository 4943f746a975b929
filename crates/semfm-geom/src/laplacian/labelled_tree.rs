//! The nearest point with another label: a k-d tree whose nodes know whether all their points have
//! one label.
//!
//! This is the search inside Borůvka's algorithm for the Euclidean minimum spanning tree (March,
//! Ram & Gray 2010): a branch in which every point has the query's own label cannot hold the
//! answer, so a point deep inside its own component is done after a few steps.

use crate::math::{DVec3, bounds};

/// Points in a leaf. Not tuned: 149 components of 34 k vertices take 26 ms with it.
const LEAF: usize = 16;

/// A branch of the tree over a range of the sorted points.
struct Node {
    low: DVec3,
    high: DVec3,
    range: std::ops::Range<usize>,
    /// The two halves; `None` for a leaf.
    halves: Option<[usize; 2]>,
    /// The label that all points of the branch have, if it is one.
    label: Option<u32>,
}

/// A k-d tree over points with labels, which may be changed.
pub(super) struct LabelledTree {
    points: Vec<DVec3>,
    /// Position in the caller's order of each sorted point.
    ids: Vec<u32>,
    labels: Vec<u32>,
    /// Parents come before their halves.
    nodes: Vec<Node>,
}

/// A pair of points with different labels, and their squared distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Link {
    pub distance_squared: f64,
    pub from: u32,
    pub to: u32,
}

impl Link {
    /// No link yet, and none to be taken that is longer than this.
    pub fn limit(distance_squared: f64) -> Self {
        Self { distance_squared, from: u32::MAX, to: u32::MAX }
    }

    /// Whether it joins two points, rather than being a limit.
    pub fn is_found(&self) -> bool {
        self.to != u32::MAX
    }

    /// Shorter first; among equals the one with the smaller ids, whichever way it runs.
    pub fn is_before(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || (self.distance_squared == other.distance_squared && self.ends() < other.ends())
    }

    /// Its two points, the smaller id first.
    pub fn ends(&self) -> [u32; 2] {
        [self.from.min(self.to), self.from.max(self.to)]
    }
}

impl LabelledTree {
    pub fn new(points: &[DVec3], labels: &[u32]) -> Self {
        let mut ids: Vec<u32> = (0..points.len() as u32).collect();
        let mut nodes = Vec::with_capacity(4 * points.len() / LEAF + 1);
        build(points, &mut ids, 0, &mut nodes);
        let sorted = ids.iter().map(|&id| points[id as usize]).collect();
        let mut index = Self { points: sorted, labels: vec![0; ids.len()], ids, nodes };
        index.relabel(labels);
        index
    }

    /// Gives point i the label `labels[i]`.
    pub fn relabel(&mut self, labels: &[u32]) {
        for (label, &id) in self.labels.iter_mut().zip(&self.ids) {
            *label = labels[id as usize];
        }
        for at in (0..self.nodes.len()).rev() {
            self.nodes[at].label = match self.nodes[at].halves {
                Some([left, right]) => self.nodes[left]
                    .label
                    .filter(|_| self.nodes[left].label == self.nodes[right].label),
                None => {
                    let labels = &self.labels[self.nodes[at].range.clone()];
                    labels
                        .first()
                        .copied()
                        .filter(|first| labels.iter().all(|label| label == first))
                }
            };
        }
    }

    /// The shortest link from point `from` at `point` to one with another label than `label`, if
    /// it comes before `best`; otherwise `best`.
    pub fn nearest(&self, from: u32, point: DVec3, label: u32, best: Link) -> Link {
        let mut best = best;
        self.search(0, from, point, label, &mut best);
        best
    }

    fn search(&self, at: usize, from: u32, point: DVec3, label: u32, best: &mut Link) {
        let node = &self.nodes[at];
        if node.label == Some(label) || node.distance_squared(point) > best.distance_squared {
            return;
        }
        if let Some([left, right]) = node.halves {
            let [to_left, to_right] =
                [left, right].map(|half| self.nodes[half].distance_squared(point));
            let order = if to_left <= to_right { [left, right] } else { [right, left] };
            order.into_iter().for_each(|half| self.search(half, from, point, label, best));
            return;
        }
        for i in node.range.clone().filter(|&i| self.labels[i] != label) {
            let distance_squared = self.points[i].distance_squared(point);
            let link = Link { distance_squared, from, to: self.ids[i] };
            if link.is_before(best) {
                *best = link;
            }
        }
    }
}

impl Node {
    fn distance_squared(&self, point: DVec3) -> f64 {
        point.distance_squared(point.clamp(self.low, self.high))
    }
}

/// Sorts `ids` (the points from `start` on) into a balanced tree; returns the place of its root.
fn build(points: &[DVec3], ids: &mut [u32], start: usize, nodes: &mut Vec<Node>) -> usize {
    let at = nodes.len();
    let corners: Vec<DVec3> = ids.iter().map(|&id| points[id as usize]).collect();
    let (low, high) = bounds(&corners).unwrap_or_default();
    nodes.push(Node { low, high, range: start..start + ids.len(), halves: None, label: None });
    if ids.len() > LEAF {
        let axis = (high - low).max_position();
        let middle = ids.len() / 2;
        ids.select_nth_unstable_by(middle, |&a, &b| {
            let [along_a, along_b] = [a, b].map(|id| points[id as usize][axis]);
            along_a.total_cmp(&along_b).then(a.cmp(&b))
        });
        let (left, right) = ids.split_at_mut(middle);
        let left = build(points, left, start, nodes);
        let right = build(points, right, start + middle, nodes);
        nodes[at].halves = Some([left, right]);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    #[test]
    fn it_finds_what_a_full_search_finds_before_and_after_relabelling() {
        let points = zoo::spiral_cloud(700);
        let mut labels: Vec<u32> =
            points.iter().map(|p| u32::from(p.z > 0.3) + u32::from(p.x > 0.0)).collect();
        let mut index = LabelledTree::new(&points, &labels);
        for _ in 0..2 {
            for (i, &point) in points.iter().enumerate() {
                let found = index.nearest(i as u32, point, labels[i], Link::limit(f64::INFINITY));
                let expected = (0..points.len())
                    .filter(|&j| labels[j] != labels[i])
                    .map(|j| points[j].distance_squared(point))
                    .fold(f64::INFINITY, f64::min);
                assert_eq!(found.distance_squared, expected);
                assert_ne!(labels[found.to as usize], labels[i]);
            }
            labels.iter_mut().for_each(|label| *label = (*label).min(1));
            index.relabel(&labels);
        }
    }
}
