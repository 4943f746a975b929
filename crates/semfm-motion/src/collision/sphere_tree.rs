//! Convex pieces covered by spheres, as trees: the quick "no" before the exact answer.

use std::panic::catch_unwind;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::{Cuboid, Cylinder};
use parry3d_f64::transformation::try_convex_hull;
use semfm_geom::math::{DQuat, DVec3, bounds};

use super::body::Relative;
use super::convex::{Convex, Core, PlacedConvex};

/// Spheres smaller than this are not split, metres: what they would save is less than a look at the piece itself.
const SMALL: f64 = 0.012;

/// Segments of the prism around a cylinder that is to be covered.
const N_SEGMENTS: u32 = 16;

/// A sphere around a part of a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SphereNode {
    pub(crate) centre: DVec3,
    pub(crate) radius: f64,
    /// The node that follows when this one and all below it are left out.
    pub(crate) next: u32,
}

/// Spheres around ever smaller parts of a convex piece, depth first: each node covers its part of the piece, and the
/// leaves together cover all of it.
#[derive(Clone, Debug)]
pub(crate) struct SphereTree {
    nodes: Vec<SphereNode>,
}

impl SphereTree {
    /// Trees for the pieces of a body, in the body's frame, with at most `most` leaves (or one a piece, if that is
    /// more): the largest sphere is split first, wherever it is.
    pub(crate) fn of_pieces(pieces: &[PlacedConvex], most: usize) -> Vec<Self> {
        let mut growing: Vec<Growing> = pieces.iter().map(Growing::new).collect();
        let mut n_leaves = growing.len();
        while n_leaves < most {
            // The first of the largest: the same on every machine.
            let mut largest = (SMALL, None);
            for (piece, tree) in growing.iter().enumerate() {
                for &leaf in &tree.leaves {
                    if tree.cells[leaf].radius > largest.0 {
                        largest = (tree.cells[leaf].radius, Some((piece, leaf)));
                    }
                }
            }
            let Some((piece, leaf)) = largest.1 else { break };
            n_leaves += growing[piece].split(leaf);
        }
        growing.iter().map(Growing::finished).collect()
    }

    /// The sphere around the whole piece.
    pub(crate) fn bound(&self) -> &SphereNode {
        &self.nodes[0]
    }

    /// The least of `distance(centre) − radius` over the leaves, `most` where none is below that; `distance` is a
    /// lower bound of the distance to something, and the answer is one for the whole piece.
    pub(crate) fn least_gap(&self, most: f64, distance: impl Fn(DVec3) -> f64) -> f64 {
        let mut least = most;
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            let gap = distance(node.centre) - node.radius;
            if gap >= least {
                at = node.next as usize;
                continue;
            }
            if node.next as usize == at + 1 {
                least = gap;
                if least <= 0.0 {
                    return least;
                }
            }
            at += 1;
        }
        least
    }

    /// The least gap between leaves of two trees, `most` where none is below that; 0 or less where two spheres meet.
    pub(crate) fn least_gap_between(a: &Self, b: &Self, a_from_b: &Relative, most: f64) -> f64 {
        // Depth first; of a pair the larger sphere is looked into. A tree of n leaves is at most n deep.
        let mut stack: Vec<[u32; 2]> = Vec::new();
        let mut pair = Some([0, 0]);
        let mut least = most;
        while let Some([i, j]) = pair {
            let (node_a, node_b) = (&a.nodes[i as usize], &b.nodes[j as usize]);
            let apart = node_a.centre.distance(a_from_b.point(node_b.centre));
            let gap = apart - node_a.radius - node_b.radius;
            let (a_is_leaf, b_is_leaf) = (node_a.next == i + 1, node_b.next == j + 1);
            pair = if gap >= least {
                stack.pop()
            } else if a_is_leaf && b_is_leaf {
                least = gap;
                if least <= 0.0 {
                    return least;
                }
                stack.pop()
            } else if b_is_leaf || (!a_is_leaf && node_a.radius >= node_b.radius) {
                stack.push([a.nodes[i as usize + 1].next, j]);
                Some([i + 1, j])
            } else {
                stack.push([i, b.nodes[j as usize + 1].next]);
                Some([i, j + 1])
            };
        }
        least
    }

    pub(crate) fn n_leaves(&self) -> usize {
        self.leaves().count()
    }

    /// The spheres that cover the piece.
    pub(crate) fn leaves(&self) -> impl Iterator<Item = &SphereNode> {
        self.nodes
            .iter()
            .enumerate()
            .filter(|(i, node)| node.next as usize == i + 1)
            .map(|(_, n)| n)
    }
}

/// A tree while its leaves are split.
struct Growing {
    surface: Surface,
    rounding: f64,
    body_from_surface: Pose,
    cells: Vec<Cell>,
    leaves: Vec<usize>,
}

/// A part of a piece: what lies in a box of the piece's frame.
struct Cell {
    low: DVec3,
    high: DVec3,
    centre: DVec3,
    radius: f64,
    children: Option<[usize; 2]>,
}

/// A closed convex surface.
struct Surface {
    triangles: Vec<[DVec3; 3]>,
    /// Outward normals and offsets of the triangles' planes.
    planes: Vec<(DVec3, f64)>,
}

impl Growing {
    fn new(piece: &PlacedConvex) -> Self {
        let (surface, turn) = Surface::of(&piece.convex);
        let points: Vec<DVec3> = surface.triangles.iter().flatten().copied().collect();
        let (low, high) = bounds(&points).unwrap_or_default();
        let rounding = piece.convex.rounding;
        let body_from_surface = piece.body_from_convex * turn;
        let mut tree =
            Self { surface, rounding, body_from_surface, cells: Vec::new(), leaves: Vec::new() };
        if let Some(cell) = tree.cell(low, high) {
            tree.cells.push(cell);
        }
        tree.leaves.push(0);
        tree
    }

    /// The part of the piece in a box; `None` where there is nothing.
    fn cell(&self, low: DVec3, high: DVec3) -> Option<Cell> {
        let (centre, radius) = enclosing_sphere(&self.surface.corners_within(low, high))?;
        let radius = radius * (1.0 + 1e-9) + 1e-12 + self.rounding;
        Some(Cell { low, high, centre, radius, children: None })
    }

    /// Splits a leaf across the longest edge of its box; returns how many leaves were added.
    fn split(&mut self, leaf: usize) -> usize {
        let (low, high) = (self.cells[leaf].low, self.cells[leaf].high);
        let axis = (high - low).max_position();
        let middle = low[axis].midpoint(high[axis]);
        let (mut left_high, mut right_low) = (high, low);
        left_high[axis] = middle;
        right_low[axis] = middle;
        let halves = [self.cell(low, left_high), self.cell(right_low, high)];
        self.leaves.retain(|&other| other != leaf);
        match halves {
            [Some(left), Some(right)] => {
                // A part of a rounded core may be no smaller than the whole.
                if left.radius.max(right.radius) > 0.98 * self.cells[leaf].radius {
                    return 0;
                }
                let at = self.cells.len();
                self.cells[leaf].children = Some([at, at + 1]);
                self.cells.extend([left, right]);
                self.leaves.extend([at, at + 1]);
                1
            }
            [Some(only), None] | [None, Some(only)] => {
                // The box was larger than what is in it.
                self.cells[leaf] = only;
                self.leaves.push(leaf);
                0
            }
            [None, None] => 0,
        }
    }

    fn finished(&self) -> SphereTree {
        let mut nodes = Vec::with_capacity(self.cells.len());
        self.push(0, &mut nodes);
        SphereTree { nodes }
    }

    fn push(&self, cell: usize, nodes: &mut Vec<SphereNode>) {
        let at = nodes.len();
        let Cell { centre, radius, children, .. } = &self.cells[cell];
        let centre = self.body_from_surface * *centre;
        nodes.push(SphereNode { centre, radius: *radius, next: 0 });
        for &child in children.iter().flatten() {
            self.push(child, nodes);
        }
        nodes[at].next = nodes.len() as u32;
    }
}

impl Surface {
    /// The surface of the core, of round ones that of a prism around it, and how it is turned in the core's frame.
    fn of(convex: &Convex) -> (Self, Pose) {
        let box_of = |half: DVec3| Cuboid::new(half.max(DVec3::splat(1e-9))).to_trimesh();
        let (points, faces) = match &convex.core {
            Core::Point => box_of(DVec3::ZERO),
            Core::Segment { half } => box_of(DVec3::new(0.0, 0.0, *half)),
            Core::Cuboid { half } => box_of(*half),
            Core::Cylinder { radius, half } => {
                // The prism's edges touch the cylinder, so its corners lie outside.
                let around = radius / (std::f64::consts::PI / f64::from(N_SEGMENTS)).cos();
                let (points, faces) = Cylinder::new(*half, around).to_trimesh(N_SEGMENTS);
                let turn = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
                return (Self::new(&points, &faces), Pose::from_rotation(turn));
            }
            Core::Triangle(corners) => box_around(corners),
            Core::Hull(hull) => {
                // parry's hull may panic on what is nearly flat; the box around covers as well.
                let corners = hull.corners();
                catch_unwind(|| try_convex_hull(corners).ok())
                    .ok()
                    .flatten()
                    .unwrap_or_else(|| box_around(corners))
            }
        };
        (Self::new(&points, &faces), Pose::IDENTITY)
    }

    fn new(points: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let triangles: Vec<[DVec3; 3]> =
            faces.iter().map(|face| face.map(|i| points[i as usize])).collect();
        let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let planes = triangles
            .iter()
            .filter_map(|&[a, b, c]| {
                let normal = (b - a).cross(c - a).try_normalize()?;
                let outward = if normal.dot(a - middle) < 0.0 { -normal } else { normal };
                Some((outward, outward.dot(a)))
            })
            .collect();
        Self { triangles, planes }
    }

    /// Points whose hull is the part of the solid in a box: what the box leaves of the surface, and the box's corners
    /// that are inside.
    fn corners_within(&self, low: DVec3, high: DVec3) -> Vec<DVec3> {
        let mut corners: Vec<DVec3> = (0..8)
            .map(|i| {
                let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
                DVec3::new(pick(0), pick(1), pick(2))
            })
            .filter(|p| self.planes.iter().all(|(normal, offset)| normal.dot(*p) <= offset + 1e-9))
            .collect();
        let (mut polygon, mut rest) = (Vec::new(), Vec::new());
        for triangle in &self.triangles {
            polygon.clear();
            polygon.extend_from_slice(triangle);
            for axis in 0..3 {
                clip(&mut polygon, &mut rest, |p| p[axis] - low[axis]);
                clip(&mut polygon, &mut rest, |p| high[axis] - p[axis]);
            }
            corners.extend_from_slice(&polygon);
        }
        corners
    }
}

/// Cuts off where `side` is negative (Sutherland & Hodgman 1974).
fn clip(polygon: &mut Vec<DVec3>, rest: &mut Vec<DVec3>, side: impl Fn(DVec3) -> f64) {
    rest.clear();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (at_p, at_q) = (side(p), side(q));
        if at_p >= 0.0 {
            rest.push(p);
        }
        if (at_p >= 0.0) != (at_q >= 0.0) {
            rest.push(p + (q - p) * (at_p / (at_p - at_q)));
        }
    }
    std::mem::swap(polygon, rest);
}

/// The box with the frame's axes around points, a little grown.
fn box_around(points: &[DVec3]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (low, high) = bounds(points).unwrap_or_default();
    let (middle, half) = (low.midpoint(high), (high - low) / 2.0 + 1e-9);
    let (corners, faces) = Cuboid::new(half).to_trimesh();
    (corners.into_iter().map(|corner| corner + middle).collect(), faces)
}

/// A sphere around points, nearly the smallest: the centre steps towards the farthest point, ever less (Bădoiu &
/// Clarkson, Smaller core-sets for balls, 2003). `None` for no points.
fn enclosing_sphere(points: &[DVec3]) -> Option<(DVec3, f64)> {
    let (low, high) = bounds(points)?;
    let farthest = |centre: DVec3| {
        points.iter().fold((-1.0, centre), |best, &p| {
            let square = p.distance_squared(centre);
            if square > best.0 { (square, p) } else { best }
        })
    };
    let mut centre = low.midpoint(high);
    let mut best = (centre, farthest(centre).0);
    for step in 0..60 {
        let (_, point) = farthest(centre);
        centre += (point - centre) / f64::from(step + 8);
        let (square, _) = farthest(centre);
        if square < best.1 {
            best = (centre, square);
        }
    }
    Some((best.0, best.1.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::super::hull::Hull;
    use super::*;
    use proptest::prelude::*;
    use std::sync::Arc;

    fn any_core() -> impl Strategy<Value = Convex> {
        let length = 0.01..0.4_f64;
        let points = proptest::collection::vec(prop::array::uniform3(-0.2..0.2_f64), 8..60);
        prop_oneof![
            prop::array::uniform3(length.clone())
                .prop_map(|half| Core::Cuboid { half: half.into() }),
            (length.clone(), length.clone())
                .prop_map(|(radius, half)| Core::Cylinder { radius, half }),
            length.prop_map(|half| Core::Segment { half }),
            Just(Core::Point),
            points.prop_map(|points| {
                Core::Hull(Arc::new(Hull::new(points.into_iter().map(DVec3::from).collect())))
            }),
        ]
        .prop_map(|core| Convex {
            rounding: if matches!(core, Core::Hull(_)) { 0.0 } else { 0.03 },
            core,
        })
    }

    /// A point of the shape: a mixture of support points.
    fn inner_point(convex: &Convex, ways: &[[f64; 3]], shares: &[f64]) -> DVec3 {
        use parry3d_f64::shape::SupportMap;
        let total: f64 = shares.iter().sum();
        let mixed: DVec3 = ways
            .iter()
            .zip(shares)
            .map(|(&way, share)| {
                let way = DVec3::from(way).normalize_or(DVec3::X);
                (convex.core.local_support_point(way) + convex.rounding * way) * (share / total)
            })
            .sum();
        mixed
    }

    proptest! {
        #[test]
        fn spheres_cover_the_piece(
            convex in any_core(),
            at in prop::array::uniform3(-1.0..1.0_f64),
            turn in prop::array::uniform3(-1.0..1.0_f64),
            most in 1..80_usize,
            probes in proptest::collection::vec(
                (prop::array::uniform4(prop::array::uniform3(-1.0..1.0_f64)), prop::array::uniform4(0.001..1.0_f64)),
                60,
            ),
        ) {
            let body_from_convex = Pose::new(at.into(), turn.into());
            let piece = PlacedConvex { body_from_convex, convex };
            let tree = &SphereTree::of_pieces(std::slice::from_ref(&piece), most)[0];
            prop_assert!(tree.leaves().count() <= most);
            for (ways, shares) in &probes {
                let p = body_from_convex * inner_point(&piece.convex, ways, shares);
                prop_assert!(tree.leaves().any(|leaf| leaf.centre.distance(p) <= leaf.radius));
                prop_assert!(tree.bound().centre.distance(p) <= tree.bound().radius);
                prop_assert!(tree.least_gap(9.0, |centre| centre.distance(p)) <= 0.0);
            }
        }
    }

    #[test]
    fn more_spheres_hug_the_piece_more_closely() {
        let convex = Convex::sharp(Core::Cuboid { half: DVec3::new(0.05, 0.05, 0.2) });
        let piece = [PlacedConvex { body_from_convex: Pose::IDENTITY, convex }];
        let excess = |most| {
            let tree = &SphereTree::of_pieces(&piece, most)[0];
            let ball = DVec3::new(0.4, 0.0, 0.0); // of radius .35: it touches the box
            let inside = tree.leaves().map(|leaf| leaf.radius + 0.35 - leaf.centre.distance(ball));
            inside.fold(0.0, f64::max)
        };
        assert!(excess(1) > 0.1 && excess(16) < 0.06 && excess(64) < 0.04);
    }
}
