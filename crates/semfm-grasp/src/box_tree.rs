//! A tree of axis-aligned boxes that is asked millions of times: single precision, rounded outwards, so that it may say
//! yes for a near miss and never no for a hit.

use glam::Vec3A;
use semfm_geom::math::DVec3;

/// Items of a leaf. With 1 as with 8 a query of a pad's prism on 16,000 triangles takes a tenth longer.
const LEAF: usize = 4;

/// Halving a 32-bit number of items goes no deeper.
const DEEPEST: usize = 40;

/// A box in single precision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) low: Vec3A,
    pub(crate) high: Vec3A,
}

impl Bounds {
    const EMPTY: Self =
        Self { low: Vec3A::splat(f32::INFINITY), high: Vec3A::splat(f32::NEG_INFINITY) };

    /// The least single-precision box around one in double precision.
    fn around(low: DVec3, high: DVec3) -> Self {
        let down = |x: f64| if f64::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
        let up = |x: f64| if f64::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
        Self {
            low: Vec3A::new(down(low.x), down(low.y), down(low.z)),
            high: Vec3A::new(up(high.x), up(high.y), up(high.z)),
        }
    }

    fn joined(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

/// An inner node, whose children are the next one and `next`, or a leaf of `n` items from `next` on.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    next: u32,
    n: u32,
}

/// Boxes of items, numbered from 0.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    nodes: Vec<Node>,
    items: Vec<(Bounds, u32)>,
}

impl BoxTree {
    /// Of the low and high corners of each item's box.
    pub(crate) fn new(boxes: impl Iterator<Item = (DVec3, DVec3)>) -> Self {
        let items = (0u32..).zip(boxes).map(|(id, (low, high))| (Bounds::around(low, high), id));
        let mut items: Vec<(Bounds, u32)> = items.collect();
        let mut nodes = Vec::with_capacity(items.len());
        let n = items.len();
        if n > 0 {
            split(&mut items, 0, n, &mut nodes);
        }
        Self { nodes, items }
    }

    /// The box around everything.
    pub(crate) fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, |node| node.bounds)
    }

    /// Ids of the items whose boxes, and all boxes around these, pass the test; in the order of the tree.
    pub(crate) fn passing<F: Fn(&Bounds) -> bool>(&self, test: F) -> Passing<'_, F> {
        let mut stack = [0; DEEPEST];
        stack[0] = 0;
        let depth = usize::from(!self.nodes.is_empty());
        Passing { tree: self, test, stack, depth, leaf: 0..0 }
    }
}

/// The items that pass a test.
pub(crate) struct Passing<'a, F> {
    tree: &'a BoxTree,
    test: F,
    stack: [u32; DEEPEST],
    depth: usize,
    leaf: std::ops::Range<usize>,
}

impl<F: Fn(&Bounds) -> bool> Iterator for Passing<'_, F> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        loop {
            for i in self.leaf.by_ref() {
                let (bounds, id) = &self.tree.items[i];
                if (self.test)(bounds) {
                    return Some(*id);
                }
            }
            if self.depth == 0 {
                return None;
            }
            self.depth -= 1;
            let at = self.stack[self.depth];
            let node = &self.tree.nodes[at as usize];
            if !(self.test)(&node.bounds) {
                continue;
            }
            if node.n > 0 {
                self.leaf = node.next as usize..(node.next + node.n) as usize;
            } else {
                self.stack[self.depth] = node.next;
                self.stack[self.depth + 1] = at + 1;
                self.depth += 2;
            }
        }
    }
}

/// Adds the node of items[from..to] and those below it: halves by number along the longest side of the middles' box.
fn split(items: &mut [(Bounds, u32)], from: usize, to: usize, nodes: &mut Vec<Node>) {
    let own = &mut items[from..to];
    let bounds = own.iter().fold(Bounds::EMPTY, |sum, item| sum.joined(item.0));
    let at = nodes.len();
    nodes.push(Node { bounds, next: from as u32, n: own.len() as u32 });
    if own.len() <= LEAF {
        return;
    }
    let middle = |item: &(Bounds, u32)| item.0.low + item.0.high;
    let around = own.iter().fold(Bounds::EMPTY, |sum, item| {
        let middle = middle(item);
        sum.joined(Bounds { low: middle, high: middle })
    });
    let sides = around.high - around.low;
    let axis = if sides.x >= sides.y && sides.x >= sides.z {
        0
    } else if sides.y >= sides.z {
        1
    } else {
        2
    };
    let half = own.len() / 2;
    own.select_nth_unstable_by(half, |a, b| {
        middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.1.cmp(&b.1))
    });
    split(items, from, from + half, nodes);
    let next = nodes.len() as u32;
    split(items, from + half, to, nodes);
    nodes[at] = Node { bounds, next, n: 0 };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_that_passes_is_found_once() {
        let at = |i: u32| {
            let t = f64::from(i);
            DVec3::new((7.3 * t).sin(), (3.1 * t).cos(), (1.7 * t).sin())
        };
        for n in [0u32, 1, 4, 5, 1000] {
            let tree = BoxTree::new((0..n).map(|i| (at(i), at(i) + 0.01)));
            let mut all: Vec<u32> = tree.passing(|_| true).collect();
            all.sort_unstable();
            assert_eq!(all, (0..n).collect::<Vec<_>>());
            let mut near: Vec<u32> = tree.passing(|b| b.low.x <= 0.2 && b.high.x >= 0.1).collect();
            near.sort_unstable();
            let expected = (0..n).filter(|&i| at(i).x <= 0.2 && at(i).x + 0.01 >= 0.1);
            assert_eq!(near, expected.collect::<Vec<_>>());
        }
    }

    #[test]
    fn boxes_are_rounded_outwards() {
        let (low, high) = (DVec3::splat(0.1), DVec3::splat(0.3));
        let bounds = Bounds::around(low, high);
        assert!(f64::from(bounds.low.x) <= 0.1 && f64::from(bounds.high.x) >= 0.3);
        assert!(f64::from(bounds.high.x) < 0.3 + 1e-7);
    }
}
