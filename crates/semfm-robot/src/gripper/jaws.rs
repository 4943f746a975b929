//! Two fingers of a robot that close on each other: which joints move them, along which axis, where
//! their pads are.

use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3, bounds};

use super::pads;
use super::solids::LinkShape;
use crate::urdf::{JointKind, Robot};

/// Samples of a drive in which fingers are watched.
const N_WATCHED: usize = 17;
/// Jaws keep their direction within this angle, radians.
const MAX_TURN: f64 = 0.02;
/// Jaws that come less than this closer are not jaws, metres.
const MIN_STROKE: f64 = 2e-3;
/// How far the fingers may drift apart across the closing direction, metres.
const MAX_DRIFT: f64 = 1e-3;
/// Smallest side of a pad, metres.
const MIN_PAD: f64 = 1e-3;

/// Joints that one motor moves, or two that move alike.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    /// Joint, position at share 0, position at share 1.
    pub leaders: Vec<(usize, f64, f64)>,
}

impl Drive {
    /// Every link's pose in the frame of `base` when the drive is at `share` of its way.
    pub fn poses(&self, robot: &Robot, base: usize, share: f64) -> Vec<Pose> {
        let mut positions = vec![0.0; robot.joints.len()];
        for &(joint, from, to) in &self.leaders {
            positions[joint] = from + (to - from) * share;
        }
        let poses = robot.link_poses(&robot.follow(&positions));
        let base_from_root = poses[base].inverse();
        poses.into_iter().map(|pose| base_from_root * pose).collect()
    }
}

/// A pair of opposing fingers.
#[derive(Clone, Debug)]
pub(super) struct Jaws {
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
    /// Middle between the pads' faces at share 0, in the palm's frame.
    pub middle: DVec3,
    /// Distance between the faces at share 0; negative where they overlap.
    pub gap: f64,
    /// The pad's sides across and along the approach, metres.
    pub pad: [f64; 2],
}

impl Jaws {
    /// All pairs of fingers in a robot with the shapes of its links, best pad first.
    pub fn find(robot: &Robot, shapes: &[LinkShape], only: Option<[usize; 2]>) -> Vec<Self> {
        let mut found = Vec::new();
        for drive in drives(robot) {
            found.extend(of_drive(robot, shapes, &drive, only));
        }
        let area = |jaws: &Self| jaws.pad[0] * jaws.pad[1];
        found.sort_by(|a, b| area(b).total_cmp(&area(a)));
        found
    }

    /// Width between the pads and the middle between them in the palm's frame, at a share.
    pub fn at(&self, robot: &Robot, poses: &[Pose]) -> (f64, DVec3) {
        let start = self.drive.poses(robot, self.palm, 0.0);
        let moved = self.fingers.map(|link| poses[link].translation - start[link].translation);
        let gap = self.gap + (moved[1] - moved[0]).dot(self.closing);
        (gap, self.middle + (moved[0] + moved[1]) / 2.0)
    }
}

/// The top link of the rigid body that a link belongs to.
pub(super) fn body_of(robot: &Robot, mut link: usize) -> usize {
    while let Some(joint) = robot.joint_to(link) {
        if robot.joints[joint].kind != JointKind::Held {
            break;
        }
        link = robot.joints[joint].parent;
    }
    link
}

/// Joints with a range that lead others or only themselves, then pairs of equal ones on one body:
/// some descriptions leave the coupling of the fingers to the controller.
fn drives(robot: &Robot) -> Vec<Drive> {
    let ranges: Vec<(usize, f64, f64)> = robot
        .joints
        .iter()
        .enumerate()
        .filter(|(_, joint)| joint.mimic.is_none() && joint.kind != JointKind::Held)
        .filter_map(|(i, joint)| {
            let [low, high] = joint.limits?;
            (low.is_finite() && high.is_finite() && low < high).then_some((i, low, high))
        })
        .collect();
    let mut drives: Vec<Drive> =
        ranges.iter().map(|&range| Drive { leaders: vec![range] }).collect();
    for (n, &a) in ranges.iter().enumerate() {
        for &b in &ranges[n + 1..] {
            let (first, second) = (&robot.joints[a.0], &robot.joints[b.0]);
            let alike = first.kind == second.kind
                && body_of(robot, first.parent) == body_of(robot, second.parent)
                && ((a.2 - a.1) - (b.2 - b.1)).abs() < 1e-3 * (a.2 - a.1);
            if alike {
                drives.push(Drive { leaders: vec![a, b] });
                drives.push(Drive { leaders: vec![a, (b.0, b.2, b.1)] });
            }
        }
    }
    drives
}

/// For each link, the drive's joint nearest the root above it.
fn branches(robot: &Robot, drive: &Drive) -> Vec<Option<usize>> {
    let moves = |mut joint: usize| {
        while let Some(mimic) = robot.joints[joint].mimic {
            joint = mimic.joint;
        }
        drive.leaders.iter().any(|leader| leader.0 == joint)
    };
    let mut branches = vec![None; robot.links.len()];
    // Joints stand in order from the root outwards.
    for (i, joint) in robot.joints.iter().enumerate() {
        let own = (joint.kind != JointKind::Held && moves(i)).then_some(i);
        branches[joint.child] = branches[joint.parent].or(own);
    }
    branches
}

fn of_drive(
    robot: &Robot,
    shapes: &[LinkShape],
    drive: &Drive,
    only: Option<[usize; 2]>,
) -> Vec<Jaws> {
    let branches = branches(robot, drive);
    let mut tops: Vec<usize> = branches.iter().flatten().copied().collect();
    tops.sort_unstable();
    tops.dedup();
    let Some(&first) = tops.first() else { return Vec::new() };
    let palm = robot.joints[first].parent;
    let one_palm =
        tops.iter().all(|&top| body_of(robot, robot.joints[top].parent) == body_of(robot, palm));
    if tops.len() < 2 || !one_palm {
        return Vec::new();
    }
    let watched: Vec<Vec<Pose>> = (0..N_WATCHED)
        .map(|i| drive.poses(robot, palm, i as f64 / (N_WATCHED - 1) as f64))
        .collect();
    let jaws: Vec<usize> = (0..robot.links.len())
        .filter(|&link| branches[link].is_some() && body_of(robot, link) == link)
        .filter(|&link| keeps_direction(&watched, link))
        .collect();
    let mut found = Vec::new();
    for (n, &a) in jaws.iter().enumerate() {
        for &b in &jaws[n + 1..] {
            let wanted = only.is_none_or(|pair| {
                let pair = pair.map(|link| body_of(robot, link));
                pair == [a, b] || pair == [b, a]
            });
            if wanted && branches[a] != branches[b] {
                found.extend(pair(robot, shapes, drive, palm, &branches, &watched, [a, b]));
            }
        }
    }
    found
}

fn keeps_direction(watched: &[Vec<Pose>], link: usize) -> bool {
    let first: DQuat = watched[0][link].rotation;
    watched.iter().all(|poses| poses[link].rotation.angle_between(first) <= MAX_TURN)
}

/// Whether two bodies move towards each other along one line, with pads that face each other.
fn pair(
    robot: &Robot,
    shapes: &[LinkShape],
    drive: &Drive,
    palm: usize,
    branches: &[Option<usize>],
    watched: &[Vec<Pose>],
    fingers: [usize; 2],
) -> Option<Jaws> {
    let place = |i: usize, finger: usize| watched[i][fingers[finger]].translation;
    let between = |i: usize| place(i, 1) - place(i, 0);
    let last = watched.len() - 1;
    let stroke = between(last) - between(0);
    if stroke.length() < MIN_STROKE {
        return None;
    }
    let mut closing = stroke.normalize();
    if closing.to_array()[closing.abs().max_position()] < 0.0 {
        closing = -closing;
    }
    let across = |v: DVec3| v - closing * v.dot(closing);
    if (0..=last).any(|i| across(between(i) - between(0)).length() > MAX_DRIFT) {
        return None;
    }
    let ways = [0, 1].map(|finger| (place(last, finger) - place(0, finger)).dot(closing));
    if ways[0] * ways[1] >= 0.0 {
        return None;
    }
    let surface = |finger: usize| -> Vec<[DVec3; 3]> {
        (0..robot.links.len())
            .filter(|&link| body_of(robot, link) == fingers[finger])
            .flat_map(|link| {
                let pose = watched[0][link];
                shapes[link].triangles.iter().map(move |t| t.map(|p| pose.transform_point(p)))
            })
            .collect()
    };
    let mut fingers = fingers;
    let mut surfaces = [surface(0), surface(1)];
    let side = |surface: &[[DVec3; 3]]| {
        surface.iter().flatten().map(|p| p.dot(closing)).sum::<f64>()
            / (3 * surface.len()).max(1) as f64
    };
    if side(&surfaces[0]) > side(&surfaces[1]) {
        surfaces.swap(0, 1);
        fingers.swap(0, 1);
    }
    let left = pads::innermost(&surfaces[0], closing)?;
    let right = pads::innermost(&surfaces[1], -closing)?;
    let gap = -right.height - left.height;
    let (low, high) = bounds(&[left.points.as_slice(), right.points.as_slice()].concat())?;
    let approach = approach(closing, across((low + high) / 2.0))?;
    let (pad, [x, z]) = overlap(&left.points, &right.points, closing.cross(approach), approach)?;
    let y = (left.height - right.height) / 2.0;
    let middle = closing.cross(approach) * x + closing * y + approach * z;
    let (drive, branches) = (drive.clone(), branches.to_vec());
    Some(Jaws { drive, palm, branches, fingers, closing, approach, middle, gap, pad })
}

/// From the palm to the pads, across the closing axis: along an axis of the palm's frame where one
/// is near, since hands are drawn along their axes.
fn approach(closing: DVec3, to_pads: DVec3) -> Option<DVec3> {
    let wish = to_pads.try_normalize()?;
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let near = axes
        .into_iter()
        .flat_map(|axis| [axis, -axis])
        .find(|axis| axis.dot(wish) > 0.7 && axis.dot(closing).abs() < 0.02);
    let axis = near.unwrap_or(wish);
    (axis - closing * axis.dot(closing)).try_normalize()
}

/// Sides and middle of the rectangle that two pads share, in the plane of x and z.
fn overlap(left: &[DVec3], right: &[DVec3], x: DVec3, z: DVec3) -> Option<([f64; 2], [f64; 2])> {
    let span = |points: &[DVec3], axis: DVec3| {
        points
            .iter()
            .map(|p| p.dot(axis))
            .fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
    };
    let shared = |axis: DVec3| {
        let (a, b) = (span(left, axis), span(right, axis));
        let (low, high) = (a[0].max(b[0]), a[1].min(b[1]));
        (high - low >= MIN_PAD).then_some((high - low, (high + low) / 2.0))
    };
    let ((width, middle_x), (length, middle_z)) = (shared(x)?, shared(z)?);
    Some(([width, length], [middle_x, middle_z]))
}
