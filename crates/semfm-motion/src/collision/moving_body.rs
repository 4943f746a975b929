//! A body that an arm moves, and bounds of how far the arm's joints carry it.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;
use semfm_robot::{Arm, JointKind};

use super::body::{CollisionBody, Frame};
use super::joint_frames::{JointFrame, JointFrames};

/// Stands for a reach without bound, metres.
const UNBOUNDED: f64 = 1e9;

/// A body fixed to a link.
#[derive(Clone, Debug)]
pub(crate) struct MovingBody {
    pub(crate) name: String,
    pub(crate) link: usize,
    pub(crate) link_from_body: Pose,
    pub(crate) body: CollisionBody,
    /// The joints that move it, base to link.
    pub(crate) path: Vec<PathJoint>,
}

/// Bodies that never move against each other, within one sphere.
#[derive(Clone, Debug)]
pub(crate) struct RigidGroup {
    /// Places in the list of bodies, ascending.
    pub(crate) members: Vec<usize>,
    /// The joint in whose frame the group is told; `None` for that of the base.
    joint: Option<usize>,
    /// One a member.
    joint_from_body: Vec<JointFrame>,
    centre: DVec3,
    pub(crate) radius: f64,
    /// The joints that move it, base to link.
    pub(crate) path: Vec<PathJoint>,
}

/// A joint that moves a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PathJoint {
    /// Place in the arm's list of values.
    pub(crate) variable: usize,
    /// The robot's joint.
    pub(crate) joint: usize,
    /// How much it moves when the value changes by one.
    pub(crate) factor: f64,
    /// Its place in the list of frames; only in paths of groups.
    frame: usize,
    /// The link after it, whose frame's origin lies on its axis.
    child: usize,
    /// Its axis in that frame; `None` where it slides.
    axis: Option<DVec3>,
    /// Greatest distance of a point of the body from the axis, whatever the joints after it do, metres.
    reach: f64,
}

/// Upper bounds of how far a motion carries a group, up to each joint of its path: entry k sums over the first k joints.
#[derive(Clone, Debug, Default)]
pub(crate) struct Carried {
    /// Σ |Δ| · reach, metres, wherever the arm is.
    pub(crate) anywhere: Vec<f64>,
    /// Σ |Δ| of joints that turn, radians.
    pub(crate) turn: Vec<f64>,
    /// Σ |Δ| · distance from the axis, metres, at one state of the arm.
    pub(crate) here: Vec<f64>,
}

/// How fast two things can come closer along a motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach {
    anywhere: f64,
    turn: f64,
    here: f64,
}

impl MovingBody {
    pub(crate) fn new(
        arm: &Arm,
        name: String,
        link: usize,
        link_from_body: Pose,
        body: CollisionBody,
    ) -> Self {
        let path = path(arm, link, link_from_body * body.centre(), body.radius());
        Self { name, link, link_from_body, body, path }
    }

    pub(crate) fn frame(&self, base_from_link: &[Pose]) -> Frame {
        Frame::new(base_from_link[self.link] * self.link_from_body)
    }

    /// Whether the two never move against each other.
    pub(crate) fn is_fixed_to(&self, other: &Self) -> bool {
        let common = n_common(&self.path, &other.path);
        common == self.path.len() && common == other.path.len()
    }
}

impl RigidGroup {
    /// Sorts bodies into groups, in the order of their first members.
    pub(crate) fn of_bodies(arm: &Arm, joints: &JointFrames, bodies: &[MovingBody]) -> Vec<Self> {
        let mut members: Vec<Vec<usize>> = Vec::new();
        for (i, body) in bodies.iter().enumerate() {
            match members.iter_mut().find(|group| bodies[group[0]].is_fixed_to(body)) {
                Some(group) => group.push(i),
                None => members.push(vec![i]),
            }
        }
        let mut poses = Vec::new();
        arm.link_poses(&vec![0.0; arm.n_joints()], &mut poses);
        let group = |members| Self::new(arm, joints, bodies, members, &poses);
        members.into_iter().map(group).collect()
    }

    fn new(
        arm: &Arm,
        joints: &JointFrames,
        bodies: &[MovingBody],
        members: Vec<usize>,
        poses: &[Pose],
    ) -> Self {
        let link = bodies[members[0]].link;
        let ball = |&i: &usize| {
            let at = poses[link].inv_mul(&(poses[bodies[i].link] * bodies[i].link_from_body));
            (at * bodies[i].body.centre(), bodies[i].body.radius())
        };
        let balls: Vec<(DVec3, f64)> = members.iter().map(ball).collect();
        let (low, high) = balls
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &(centre, radius)| {
                (low.min(centre - radius), high.max(centre + radius))
            });
        let centre = if let [only] = balls[..] { only.0 } else { low.midpoint(high) };
        let reach = balls.iter().map(|ball| ball.0.distance(centre) + ball.1);
        let radius = reach.fold(0.0, f64::max);
        let mut path = path(arm, link, centre, radius);
        for joint in &mut path {
            joint.frame = joints.of_joint(joint.joint).unwrap_or(0);
        }
        let place = |&i: &usize| {
            let MovingBody { link, link_from_body, .. } = &bodies[i];
            JointFrame::new(&(joints.link(*link).joint_from_link * *link_from_body))
        };
        let joint_from_body = members.iter().map(place).collect();
        let first = joints.link(link);
        let centre = first.joint_from_link * centre;
        Self { members, joint: first.joint, joint_from_body, centre, radius, path }
    }

    /// Where the centre of the group's sphere is.
    pub(crate) fn centre(&self, frames: &[JointFrame]) -> DVec3 {
        self.joint.map_or(self.centre, |joint| frames[joint].point(self.centre))
    }

    /// Where the members are, in the order of the list.
    pub(crate) fn frames(&self, frames: &[JointFrame]) -> impl Iterator<Item = (usize, Frame)> {
        let joint = self.joint.map(|joint| frames[joint]);
        self.members.iter().zip(&self.joint_from_body).map(move |(&member, body)| {
            (member, joint.map_or(*body, |joint| joint.then(body)).as_frame())
        })
    }

    /// Number of joints that move this group and the other alike.
    pub(crate) fn n_common(&self, other: &Self) -> usize {
        n_common(&self.path, &other.path)
    }

    /// Sums for a motion in which each joint value changes by `travel`.
    pub(crate) fn set_travel(&self, travel: &[f64], carried: &mut Carried) {
        carried.anywhere.clear();
        carried.turn.clear();
        carried.anywhere.push(0.0);
        carried.turn.push(0.0);
        let (mut anywhere, mut turn) = (0.0, 0.0);
        for joint in &self.path {
            let way = (travel[joint.variable] * joint.factor).abs();
            // A joint that stands adds nothing, whatever its reach.
            if way > 0.0 {
                anywhere += way * joint.reach;
                turn += if joint.axis.is_some() { way } else { 0.0 };
            }
            carried.anywhere.push(anywhere);
            carried.turn.push(turn);
        }
    }

    /// Sums at one state of the arm; `centre` is that of the group's sphere.
    pub(crate) fn set_state(
        &self,
        travel: &[f64],
        frames: &[JointFrame],
        centre: DVec3,
        carried: &mut Carried,
    ) {
        carried.here.clear();
        carried.here.push(0.0);
        let mut sum = 0.0;
        for joint in &self.path {
            let way = (travel[joint.variable] * joint.factor).abs();
            let frame = &frames[joint.frame];
            let arm_length = match joint.axis {
                Some(_) => (centre - frame.at).cross(frame.turn.z_axis).length() + self.radius,
                None => 1.0,
            };
            sum += way * arm_length;
            carried.here.push(sum);
        }
    }
}

fn n_common(a: &[PathJoint], b: &[PathJoint]) -> usize {
    a.iter().zip(b).take_while(|(a, b)| a.joint == b.joint).count()
}

impl Carried {
    /// How fast the body moves against what only the first `common` joints move.
    pub(crate) fn after(&self, common: usize) -> Approach {
        let last = |sums: &[f64]| sums.last().map_or(0.0, |sum| sum - sums[common]);
        Approach { anywhere: last(&self.anywhere), turn: last(&self.turn), here: last(&self.here) }
    }

    /// The bound that holds wherever the arm is, metres.
    pub(crate) fn anywhere(&self) -> f64 {
        self.anywhere.last().copied().unwrap_or(0.0)
    }
}

/// Let each value move evenly, by its travel within time 1. A point at distance ρ from the axis of a turning joint goes
/// ρ |Δ| in that time, and ρ itself changes by no more than the way that the joints after it make the point go. With
/// S = Σ |Δ| ρ now and W = Σ |Δ|, the way D of any point after time t obeys D' ≤ S + W D, so that it is at most `gap`
/// until
///
/// > t = gap / (S + W · gap),
///
/// and with reaches that hold anywhere, R = Σ |Δ| ρ_max, until t = gap / R. The later of the two counts.
impl Approach {
    /// Share of the motion during which a gap (metres) does not close.
    pub(crate) fn share(&self, gap: f64) -> f64 {
        let by_reach = if self.anywhere > 0.0 { gap / self.anywhere } else { f64::INFINITY };
        let by_state = gap / (self.here + self.turn * gap);
        if by_state > by_reach { by_state } else { by_reach }
    }

    /// The gap (metres) that does not close during a share of the motion: the inverse of [`Approach::share`].
    pub(crate) fn gap(&self, share: f64) -> f64 {
        let by_reach = self.anywhere * share;
        let left = 1.0 - self.turn * share;
        if left > 0.0 { by_reach.min(self.here * share / left) } else { by_reach }
    }

    /// Two things that both move: their ways add up.
    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            anywhere: self.anywhere + other.anywhere,
            turn: self.turn + other.turn,
            here: self.here + other.here,
        }
    }
}

/// The joints that move a link, with the reach of each to a ball around `centre` (in the link's frame).
fn path(arm: &Arm, link: usize, centre: DVec3, radius: f64) -> Vec<PathJoint> {
    let robot = arm.robot();
    let leaders = robot.leaders();
    // Mimics are affine in their leader: two positions tell the factor.
    let at = |position: f64| robot.with_mimics(&vec![position; robot.joints.len()]);
    let (zero, one) = (at(0.0), at(1.0));
    let mut path = Vec::new();
    let mut below = link;
    while let Some(index) = robot.joint_to(below) {
        let joint = &robot.joints[index];
        let variable = arm.joints().iter().position(|own| own.index == leaders[index]);
        if let Some(variable) = variable.filter(|_| joint.kind.has_position()) {
            let axis = (joint.kind != JointKind::Prismatic).then_some(joint.axis);
            let factor = one[index] - zero[index];
            path.push(PathJoint {
                variable,
                joint: index,
                factor,
                frame: 0,
                child: below,
                axis,
                reach: 1.0,
            });
        }
        below = joint.parent;
    }
    path.reverse();
    let mut poses = Vec::new();
    arm.link_poses(&vec![0.0; arm.n_joints()], &mut poses);
    let centre = poses[link] * centre;
    for first in 0..path.len() {
        let Some(axis) = path[first].axis else { continue };
        let pose = poses[path[first].child];
        // From joint to joint along the path; what comes before the next joint is at a fixed distance from the axis.
        let mut from = pose.translation;
        let mut reach = radius;
        let after = path[first + 1..].iter().map(|joint| poses[joint.child].translation);
        for (i, to) in after.chain([centre]).enumerate() {
            let step = to - from;
            reach += if i == 0 { step.cross(pose.rotation * axis).length() } else { step.length() };
            from = to;
        }
        for slide in path[first + 1..].iter().filter(|joint| joint.axis.is_none()) {
            let limits = &arm.joints()[slide.variable];
            reach += slide.factor.abs() * limits.lower.abs().max(limits.upper.abs());
        }
        // Without limits on a slide there is no bound; a large number does as well, and sums stay numbers.
        path[first].reach = reach.min(UNBOUNDED);
    }
    path
}
