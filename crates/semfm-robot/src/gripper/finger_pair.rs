//! Two fingers of a robot that close on each other: which joints move them, along which axis, where
//! their pads are.

use std::collections::BTreeMap;

use parry3d_f64::math::Pose;
use semfm_geom::math::{DVec3, bounds};

use super::pads;
use crate::link_shape::LinkShape;
use crate::robot::Robot;

/// Samples of a drive in which fingers are compared.
const N_SAMPLES: usize = 17;
/// Fingers keep their direction within this angle, radians.
const MAX_TURN: f64 = 0.02;
/// Links that come less than this closer are not fingers, metres.
const MIN_STROKE: f64 = 2e-3;
/// How far the fingers may drift apart across the closing direction, metres.
const MAX_DRIFT: f64 = 1e-3;
/// Smallest side of a pad, metres.
const MIN_PAD: f64 = 1e-3;
/// Two joints are alike where their ranges differ by less than this share.
const SAME_RANGE: f64 = 1e-3;
/// Links in all drives that are tried: each costs [`N_SAMPLES`] poses, so that this is a second's work. A humanoid with
/// two hands of five fingers has 100 drives and 100 links.
const MAX_POSES: usize = 1_000_000;
/// Most joints with a range on one body, and most bodies with a surface that one drive moves: pairs of them are tried.
const MAX_JOINTS_ON_BODY: usize = 256;
/// See [`MAX_JOINTS_ON_BODY`].
const MAX_BODIES: usize = 256;

/// A joint that a drive moves from one end of its range to the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrivenJoint {
    pub joint: usize,
    /// Position at share 0.
    pub from: f64,
    /// Position at share 1.
    pub to: f64,
}

impl DrivenJoint {
    /// Position at a share of the drive's way.
    pub fn at(&self, share: f64) -> f64 {
        self.from + (self.to - self.from) * share
    }

    fn reversed(self) -> Self {
        Self { from: self.to, to: self.from, ..self }
    }
}

/// Joints that one motor moves, or two that move alike.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    pub joints: Vec<DrivenJoint>,
}

impl Drive {
    /// Every link's pose in the frame of `base` when the drive is at `share` of its way.
    pub fn poses(&self, robot: &Robot, base: usize, share: f64) -> Vec<Pose> {
        let mut positions = vec![0.0; robot.joints.len()];
        for driven in &self.joints {
            positions[driven.joint] = driven.at(share);
        }
        let poses = robot.link_poses(&robot.with_mimics(&positions));
        let base_from_root = poses[base].inverse();
        poses.into_iter().map(|pose| base_from_root * pose).collect()
    }

    /// Whether a joint with that leader is one of the drive's or follows one.
    fn moves(&self, leader: usize) -> bool {
        self.joints.iter().any(|driven| driven.joint == leader)
    }

    /// For each link, the drive's joint nearest the root above it.
    fn branches(&self, tree: &Tree<'_>) -> Vec<Option<usize>> {
        let mut branches = vec![None; tree.robot.links.len()];
        // Joints stand in order from the root outwards.
        for (i, joint) in tree.robot.joints.iter().enumerate() {
            let own = (joint.kind.has_position() && self.moves(tree.leaders[i])).then_some(i);
            branches[joint.child] = branches[joint.parent].or(own);
        }
        branches
    }
}

/// A robot with what is asked of it for every drive, computed once.
struct Tree<'a> {
    robot: &'a Robot,
    shapes: &'a [LinkShape],
    /// For each link, the top link of its rigid body.
    bodies: Vec<usize>,
    /// For each joint, the joint that it follows at last.
    leaders: Vec<usize>,
    /// For each body, by its top link, whether any of its links has a surface.
    has_surface: Vec<bool>,
}

impl<'a> Tree<'a> {
    fn new(robot: &'a Robot, shapes: &'a [LinkShape]) -> Self {
        let (bodies, leaders) = (robot.bodies(), robot.leaders());
        let mut has_surface = vec![false; robot.links.len()];
        for (shape, &body) in shapes.iter().zip(&bodies) {
            has_surface[body] |= !shape.triangles.is_empty();
        }
        Self { robot, shapes, bodies, leaders, has_surface }
    }

    /// For each joint, whether it is above one of the links, or leads one that is.
    fn above(&self, links: [usize; 2]) -> Vec<bool> {
        let mut is_above = vec![false; self.robot.joints.len()];
        let mut reaches = vec![false; self.robot.links.len()];
        links.iter().for_each(|&link| reaches[link] = true);
        for (i, joint) in self.robot.joints.iter().enumerate().rev() {
            if reaches[joint.child] {
                reaches[joint.parent] = true;
                is_above[self.leaders[i]] = true;
            }
        }
        is_above
    }
}

/// A pair of opposing fingers.
#[derive(Clone, Debug)]
pub(super) struct FingerPair {
    pub drive: Drive,
    /// The link that the fingers' first joints sit on.
    pub palm: usize,
    /// For each link, the first joint of the finger it belongs to.
    pub branches: Vec<Option<usize>>,
    /// The body with the pad at −y, then that at +y: the link at the top of each.
    pub fingers: [usize; 2],
    /// Closing axis in the palm's frame, from the first finger to the second.
    pub closing: DVec3,
    /// Approach axis in the palm's frame.
    pub approach: DVec3,
    /// The pads at share 0.
    pub pads: PadGap,
    /// The pad's sides across and along the approach, metres.
    pub pad: [f64; 2],
}

/// The space between two pads.
#[derive(Clone, Copy, Debug)]
pub(super) struct PadGap {
    /// Distance between their faces; negative where they overlap.
    pub width: f64,
    /// Middle between their faces, in the palm's frame.
    pub middle: DVec3,
}

impl FingerPair {
    /// All pairs of fingers in a robot with the shapes of its links, best pad first; `None` where there are too many
    /// candidates to try. `only` names the links that bear the pads.
    pub fn find(
        robot: &Robot,
        shapes: &[LinkShape],
        only: Option<[usize; 2]>,
    ) -> Option<Vec<Self>> {
        let tree = Tree::new(robot, shapes);
        let mut found = Vec::new();
        let mut n_poses = 0;
        for drive in drives(&tree, only)? {
            n_poses += robot.links.len();
            if n_poses > MAX_POSES {
                return None;
            }
            let Some(drive) = SampledDrive::new(&tree, drive) else { continue };
            let bodies = drive.bodies(only);
            if bodies.len() > MAX_BODIES {
                return None;
            }
            found.extend(drive.pairs(&bodies));
        }
        found.sort_by(|a: &Self, b| b.pad_area().total_cmp(&a.pad_area()));
        Some(found)
    }

    fn pad_area(&self) -> f64 {
        self.pad[0] * self.pad[1]
    }

    /// A link in neither finger that closes beside them, of those that the drive moves or of others alike on the same
    /// palm: the hand has three fingers or more.
    pub fn third_finger(&self, robot: &Robot, shapes: &[LinkShape]) -> Option<usize> {
        let tree = Tree::new(robot, shapes);
        let sampled = SampledDrive::new(&tree, self.drive.clone())?;
        let own = self.fingers.map(|finger| self.branches[finger]);
        let coupled = sampled
            .bodies(None)
            .into_iter()
            .find(|&body| !own.contains(&self.branches[body]) && sampled.closes_beside(body, self));
        coupled.or_else(|| self.uncoupled_finger(&tree))
    }

    /// A link on the palm whose joint is like one of the drive's and not coupled to it.
    fn uncoupled_finger(&self, tree: &Tree<'_>) -> Option<usize> {
        let joints = &tree.robot.joints;
        let range = |joint: usize| joints[joint].limits.position.map(|[low, high]| high - low);
        let is_alike = |a: usize, b: usize| match (range(a), range(b)) {
            (Some(a_range), Some(b_range)) => {
                joints[a].kind == joints[b].kind && (a_range - b_range).abs() < SAME_RANGE * a_range
            }
            _ => false,
        };
        let other = (0..joints.len()).find(|&i| {
            tree.bodies[joints[i].parent] == tree.bodies[self.palm]
                && !self.drive.moves(tree.leaders[i])
                && tree.has_surface[tree.bodies[joints[i].child]]
                && self.drive.joints.iter().any(|driven| is_alike(driven.joint, i))
        });
        other.map(|joint| joints[joint].child)
    }

    /// The pads where links have these poses in the palm's frame.
    pub fn pads_at(&self, robot: &Robot, poses: &[Pose]) -> PadGap {
        let start = self.drive.poses(robot, self.palm, 0.0);
        let moved = self.fingers.map(|link| poses[link].translation - start[link].translation);
        PadGap {
            width: self.pads.width + (moved[1] - moved[0]).dot(self.closing),
            middle: self.pads.middle + (moved[0] + moved[1]) / 2.0,
        }
    }
}

/// Joints with a range that lead others, then pairs of equal ones on one body: some descriptions leave the coupling of
/// the fingers to the controller. `None` where there are too many pairs.
fn drives(tree: &Tree<'_>, only: Option<[usize; 2]>) -> Option<Vec<Drive>> {
    let robot = tree.robot;
    let is_above = only.map(|links| tree.above(links));
    let ranges: Vec<DrivenJoint> = robot
        .joints
        .iter()
        .enumerate()
        .filter(|(i, joint)| {
            let wanted = is_above.as_ref().is_none_or(|above| above[*i]);
            wanted && joint.mimic.is_none() && joint.kind.has_position()
        })
        .filter_map(|(i, joint)| {
            let [low, high] = joint.limits.position?;
            let range = DrivenJoint { joint: i, from: low, to: high };
            (low.is_finite() && high.is_finite() && low < high).then_some(range)
        })
        .collect();
    // A joint alone moves one finger: only those that others follow can drive two.
    let mut is_followed = vec![false; robot.joints.len()];
    for (i, &leader) in tree.leaders.iter().enumerate() {
        is_followed[leader] |= leader != i;
    }
    let leading = ranges.iter().filter(|range| is_followed[range.joint]);
    let mut drives: Vec<Drive> = leading.map(|&range| Drive { joints: vec![range] }).collect();
    let mut on_body: BTreeMap<usize, Vec<DrivenJoint>> = BTreeMap::new();
    for &range in &ranges {
        on_body.entry(tree.bodies[robot.joints[range.joint].parent]).or_default().push(range);
    }
    let mut pairs = Vec::new();
    for ranges in on_body.values() {
        if ranges.len() > MAX_JOINTS_ON_BODY {
            return None;
        }
        for (n, &a) in ranges.iter().enumerate() {
            let alike = ranges[n + 1..].iter().filter(|b| {
                let (first, second) = (&robot.joints[a.joint], &robot.joints[b.joint]);
                first.kind == second.kind
                    && ((a.to - a.from) - (b.to - b.from)).abs() < SAME_RANGE * (a.to - a.from)
            });
            pairs.extend(alike.map(|&b| [a, b]));
        }
    }
    pairs.sort_by_key(|pair| pair.map(|driven| driven.joint));
    for [a, b] in pairs {
        drives.push(Drive { joints: vec![a, b] });
        drives.push(Drive { joints: vec![a, b.reversed()] });
    }
    Some(drives)
}

/// A drive whose fingers sit on one palm, with the poses of all links on its way.
struct SampledDrive<'a> {
    tree: &'a Tree<'a>,
    drive: Drive,
    palm: usize,
    branches: Vec<Option<usize>>,
    /// In the palm's frame, at equal steps of the drive.
    samples: Vec<Vec<Pose>>,
}

impl<'a> SampledDrive<'a> {
    /// `None` for a drive that moves fewer than two fingers, or fingers on several palms.
    fn new(tree: &'a Tree<'a>, drive: Drive) -> Option<Self> {
        let robot = tree.robot;
        let branches = drive.branches(tree);
        let mut tops: Vec<usize> = branches.iter().flatten().copied().collect();
        tops.sort_unstable();
        tops.dedup();
        let palm = robot.joints[*tops.first()?].parent;
        let one_palm =
            tops.iter().all(|&top| tree.bodies[robot.joints[top].parent] == tree.bodies[palm]);
        if tops.len() < 2 || !one_palm {
            return None;
        }
        let samples = (0..N_SAMPLES)
            .map(|i| drive.poses(robot, palm, i as f64 / (N_SAMPLES - 1) as f64))
            .collect();
        Some(Self { tree, drive, palm, branches, samples })
    }

    /// The bodies that it moves, that may bear pads, and that are asked for.
    fn bodies(&self, only: Option<[usize; 2]>) -> Vec<usize> {
        let only = only.map(|links| links.map(|link| self.tree.bodies[link]));
        (0..self.branches.len())
            .filter(|&link| self.branches[link].is_some() && self.tree.bodies[link] == link)
            .filter(|&link| self.tree.has_surface[link] && self.keeps_direction(link))
            .filter(|link| only.is_none_or(|pair| pair.contains(link)))
            .collect()
    }

    /// The pairs of fingers among some bodies that it moves.
    fn pairs(&self, bodies: &[usize]) -> Vec<FingerPair> {
        let mut found = Vec::new();
        for (n, &a) in bodies.iter().enumerate() {
            for &b in &bodies[n + 1..] {
                if self.branches[a] != self.branches[b] {
                    found.extend(self.pair([a, b]));
                }
            }
        }
        found
    }

    fn keeps_direction(&self, link: usize) -> bool {
        let first = self.samples[0][link].rotation;
        self.samples.iter().all(|poses| poses[link].rotation.angle_between(first) <= MAX_TURN)
    }

    /// Whether two bodies move towards each other along one line, with pads that face each other.
    fn pair(&self, bodies: [usize; 2]) -> Option<FingerPair> {
        let mut fingers = bodies;
        let (start, end) = (&self.samples[0], self.samples.last()?);
        let first_between = between(start, fingers);
        let stroke = between(end, fingers) - first_between;
        if stroke.length() < MIN_STROKE {
            return None;
        }
        let mut closing = stroke.normalize();
        if closing.to_array()[closing.abs().max_position()] < 0.0 {
            closing = -closing;
        }
        let drifts = self.samples.iter().any(|poses| {
            across(between(poses, fingers) - first_between, closing).length() > MAX_DRIFT
        });
        if drifts {
            return None;
        }
        let ways = fingers
            .map(|finger| (end[finger].translation - start[finger].translation).dot(closing));
        if ways[0] * ways[1] >= 0.0 {
            return None;
        }
        let mut surfaces = fingers.map(|finger| self.surface(finger));
        if mean_along(&surfaces[0], closing) > mean_along(&surfaces[1], closing) {
            surfaces.swap(0, 1);
            fingers.swap(0, 1);
        }
        let left = pads::innermost(&surfaces[0], closing)?;
        let right = pads::innermost(&surfaces[1], -closing)?;
        let width = -right.height - left.height;
        let (low, high) = bounds(&[left.points.as_slice(), right.points.as_slice()].concat())?;
        let approach = approach(closing, across((low + high) / 2.0, closing))?;
        let x_axis = closing.cross(approach);
        let x = shared(&left.points, &right.points, x_axis)?;
        let z = shared(&left.points, &right.points, approach)?;
        let y = (left.height - right.height) / 2.0;
        let middle = x_axis * x.middle + closing * y + approach * z.middle;
        Some(FingerPair {
            drive: self.drive.clone(),
            palm: self.palm,
            branches: self.branches.clone(),
            fingers,
            closing,
            approach,
            pads: PadGap { width, middle },
            pad: [x.length, z.length],
        })
    }

    /// Whether a body moves along the closing axis of two fingers, beside their pads.
    fn closes_beside(&self, body: usize, pair: &FingerPair) -> bool {
        let [first, last] = [self.samples.first(), self.samples.last()]
            .map(|poses| poses.map_or(DVec3::ZERO, |poses| poses[body].translation));
        let x_axis = pair.closing.cross(pair.approach);
        let from_middle = self.surface(body).into_iter().flatten();
        let from_middle = from_middle.map(|p| (p - pair.pads.middle).dot(x_axis));
        let (low, high) = from_middle
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let rim = pair.pad[0] / 2.0 - MIN_PAD;
        (last - first).dot(pair.closing).abs() >= MIN_STROKE && (low > rim || high < -rim)
    }

    /// The triangles of a body at share 0, in the palm's frame.
    fn surface(&self, body: usize) -> Vec<[DVec3; 3]> {
        (0..self.tree.bodies.len())
            .filter(|&link| self.tree.bodies[link] == body)
            .flat_map(|link| {
                let pose = self.samples[0][link];
                self.tree.shapes[link]
                    .triangles
                    .iter()
                    .map(move |t| t.map(|p| pose.transform_point(p)))
            })
            .collect()
    }
}

/// From the first finger to the second.
fn between(poses: &[Pose], fingers: [usize; 2]) -> DVec3 {
    poses[fingers[1]].translation - poses[fingers[0]].translation
}

/// The component of `v` across a unit axis.
fn across(v: DVec3, axis: DVec3) -> DVec3 {
    v - axis * v.dot(axis)
}

/// Mean position of a surface's corners along an axis.
fn mean_along(surface: &[[DVec3; 3]], axis: DVec3) -> f64 {
    surface.iter().flatten().map(|p| p.dot(axis)).sum::<f64>() / (3 * surface.len()).max(1) as f64
}

/// From the palm to the pads, across the closing axis: along an axis of the palm's frame where one
/// is near, since grippers are drawn along their axes.
fn approach(closing: DVec3, to_pads: DVec3) -> Option<DVec3> {
    let wish = to_pads.try_normalize()?;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let near = axes
        .into_iter()
        .flat_map(|axis| [axis, -axis])
        .find(|axis| axis.dot(wish) > 0.7 && axis.dot(closing).abs() < 0.02);
    across(near.unwrap_or(wish), closing).try_normalize()
}

/// An interval on an axis.
struct Interval {
    length: f64,
    middle: f64,
}

/// The interval along an axis that two pads share; `None` where it is too short for a pad.
fn shared(left: &[DVec3], right: &[DVec3], axis: DVec3) -> Option<Interval> {
    let [a, b] = [left, right].map(|points| {
        points
            .iter()
            .map(|p| p.dot(axis))
            .fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
    });
    let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
    (high - low >= MIN_PAD).then_some(Interval { length: high - low, middle: (high + low) / 2.0 })
}
