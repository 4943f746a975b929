//! The check of a timed motion, in the curve itself that a controller follows.

use std::fmt;

use super::limits::MotionLimits;
use super::retime::Cubic;
use crate::planning::bisection::{Stretch, first_contact};
use crate::planning::joint_space::LIMIT_SLACK;
use crate::planning::{Contact, JointSpace, Validity};
use crate::{Error, Result, TrajectoryPoint};

/// How a motion is replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckSettings {
    /// Seconds between the states that are asked whether they are free.
    pub step: f64,
}

impl Default for CheckSettings {
    fn default() -> Self {
        Self { step: 1e-3 }
    }
}

/// The first thing that is wrong with a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Violation {
    /// Seconds since the trajectory began.
    pub time: f64,
    /// What is wrong.
    pub kind: ViolationKind,
}

/// What can be wrong with a motion. Numbers are radians, metres and seconds.
#[derive(Clone, Debug, PartialEq)]
pub enum ViolationKind {
    /// A sample is not later than the one before.
    TimeStands {
        /// Time of the sample before.
        before: f64,
    },
    /// A joint moves at the first or the last sample.
    NotAtRest {
        /// The joint.
        joint: String,
        /// Its velocity.
        velocity: f64,
    },
    /// A joint leaves its range.
    Position {
        /// The joint.
        joint: String,
        /// Its position.
        position: f64,
        /// The limit that it passes.
        limit: f64,
    },
    /// A joint is too fast.
    Velocity {
        /// The joint.
        joint: String,
        /// Its velocity.
        velocity: f64,
        /// Its limit.
        limit: f64,
    },
    /// A joint accelerates too much.
    Acceleration {
        /// The joint.
        joint: String,
        /// Its acceleration.
        acceleration: f64,
        /// Its limit.
        limit: f64,
    },
    /// A joint's acceleration changes too fast.
    Jerk {
        /// The joint.
        joint: String,
        /// Its jerk.
        jerk: f64,
        /// Its limit.
        limit: f64,
    },
    /// Something touches.
    Contact {
        /// Joint values at which it does.
        positions: Vec<f64>,
        /// What touches what and how deep, where the checker can tell.
        contact: Option<Contact>,
    },
}

/// By which share a limit may be passed: rounding, from numbers written and read again.
const ROUNDING: f64 = 1e-9;

/// The first violation along the cubics between `points`, or `None`: times rise, both ends are at rest; positions,
/// velocities, accelerations and jerk (where it is limited) are within limits at every time, by the extremes of each
/// cubic; nothing touches at every [`CheckSettings::step`], nor between, by bisection: a stretch is free where the clearance at
/// its middle is more than any point of the robot can move from there, or where that is below half a millimetre.
///
/// # Errors
/// [`Error::Invalid`] for fewer than two points, lists of another length than the space has joints, numbers that are not
/// finite, and a step that is not above 0.
pub fn check_trajectory(
    space: &JointSpace,
    validity: &impl Validity,
    limits: &MotionLimits,
    points: &[TrajectoryPoint],
    settings: &CheckSettings,
) -> Result<Option<Violation>> {
    check(space, limits, points, settings)?;
    let replay = Replay { space, limits };
    let (first, last) = (&points[0], &points[points.len() - 1]);
    if let Some(violation) = replay.moving(first) {
        return Ok(Some(violation));
    }
    if let Some(violation) = contact_at(validity, first.time, first.positions.clone()) {
        return Ok(Some(violation));
    }
    for pair in points.windows(2) {
        if pair[0].time.partial_cmp(&pair[1].time) != Some(std::cmp::Ordering::Less) {
            let kind = ViolationKind::TimeStands { before: pair[0].time };
            return Ok(Some(Violation { time: pair[1].time, kind }));
        }
        let part = Part { from: &pair[0], to: &pair[1], cubic: Cubic::between(&pair[0], &pair[1]) };
        let beyond = replay.beyond_limits(&part);
        let touching = touching(validity, &part, settings.step);
        let found =
            [beyond, touching].into_iter().flatten().min_by(|a, b| a.time.total_cmp(&b.time));
        if found.is_some() {
            return Ok(found);
        }
    }
    Ok(replay.moving(last))
}

/// The motion between two samples.
struct Part<'a> {
    from: &'a TrajectoryPoint,
    to: &'a TrajectoryPoint,
    cubic: Cubic,
}

impl Part<'_> {
    /// Position of one joint `since` seconds after the part's beginning.
    fn joint_position(&self, joint: usize, since: f64) -> f64 {
        let jerk = self.cubic.jerk(joint);
        let (v, a) = (self.from.velocities[joint], self.cubic.first[joint]);
        self.from.positions[joint] + (v + (0.5 * a + jerk * since / 6.0) * since) * since
    }

    fn joint_velocity(&self, joint: usize, since: f64) -> f64 {
        let jerk = self.cubic.jerk(joint);
        self.from.velocities[joint] + (self.cubic.first[joint] + 0.5 * jerk * since) * since
    }

    /// Seconds since the part's beginning at which a joint's velocity is zero inside.
    fn turns(&self, joint: usize) -> [Option<f64>; 2] {
        // The roots of v + a t + ½ j t² are q / j and 2v / q with q = −(a ± √(a² − 2 v j)), signs alike.
        let (v, a, jerk) =
            (self.from.velocities[joint], self.cubic.first[joint], self.cubic.jerk(joint));
        let q = -(a + (a * a - 2.0 * v * jerk).sqrt().copysign(a));
        [q / jerk, 2.0 * v / q]
            .map(|since| (since > 0.0 && since < self.cubic.duration).then_some(since))
    }
}

impl Stretch for Part<'_> {
    fn position(&self, at: f64) -> Vec<f64> {
        (0..self.from.positions.len())
            .map(|j| self.joint_position(j, at - self.from.time))
            .collect()
    }

    fn travel(&self, middle: f64, half: f64) -> Vec<f64> {
        let travel = (0..self.from.positions.len()).map(|j| {
            let velocity = self.joint_velocity(j, middle - self.from.time).abs();
            let acceleration = self.cubic.first[j].abs().max(self.cubic.last[j].abs());
            (velocity + 0.5 * acceleration * half) * half
        });
        travel.collect()
    }
}

struct Replay<'a> {
    space: &'a JointSpace,
    limits: &'a MotionLimits,
}

impl Replay<'_> {
    fn moving(&self, point: &TrajectoryPoint) -> Option<Violation> {
        let joint = point.velocities.iter().position(|&velocity| velocity != 0.0)?;
        let (velocity, joint) = (point.velocities[joint], self.space.joints()[joint].name.clone());
        Some(Violation { time: point.time, kind: ViolationKind::NotAtRest { joint, velocity } })
    }

    /// The earliest of the extremes of a part that pass a limit.
    fn beyond_limits(&self, part: &Part<'_>) -> Option<Violation> {
        let mut found: Option<Violation> = None;
        let mut add = |since: f64, kind: ViolationKind| {
            let time = part.from.time + since;
            if found.as_ref().is_none_or(|found| time < found.time) {
                found = Some(Violation { time, kind });
            }
        };
        let end = part.cubic.duration;
        for (j, (range, limit)) in self.space.joints().iter().zip(self.limits.joints()).enumerate()
        {
            let joint = || range.name.clone();
            let [turn, other_turn] = part.turns(j);
            for since in [Some(0.0), turn, other_turn, Some(end)].into_iter().flatten() {
                let position = part.joint_position(j, since);
                let nearest = position.clamp(range.lower, range.upper);
                if (position - nearest).abs() > LIMIT_SLACK {
                    add(
                        since,
                        ViolationKind::Position { joint: joint(), position, limit: nearest },
                    );
                }
            }
            for since in [Some(0.0), part.cubic.fastest_at(j), Some(end)].into_iter().flatten() {
                let velocity = part.joint_velocity(j, since);
                if velocity.abs() > limit.velocity * (1.0 + ROUNDING) {
                    let limit = limit.velocity;
                    add(since, ViolationKind::Velocity { joint: joint(), velocity, limit });
                }
            }
            for (since, acceleration) in [(0.0, part.cubic.first[j]), (end, part.cubic.last[j])] {
                if acceleration.abs() > limit.acceleration * (1.0 + ROUNDING) {
                    let limit = limit.acceleration;
                    add(since, ViolationKind::Acceleration { joint: joint(), acceleration, limit });
                }
            }
            let jerk = part.cubic.jerk(j);
            if let Some(limit) =
                limit.jerk.filter(|limit| jerk.abs() > limit * (1.0 + JERK_ROUNDING))
            {
                add(0.0, ViolationKind::Jerk { joint: joint(), jerk, limit });
            }
        }
        found
    }
}

/// By which share a jerk limit may be passed. Jerk is a third difference of positions, and steps can be 0.1 ms.
const JERK_ROUNDING: f64 = 1e-4;

/// The first contact of a part: every `step` seconds of the trajectory's time, at its end, and by bisection between.
fn touching(validity: &impl Validity, part: &Part<'_>, step: f64) -> Option<Violation> {
    let (from, to) = (part.from.time, part.to.time);
    let mut tick = (from / step).floor() + 1.0;
    while tick * step < to {
        if let Some(violation) = contact_at(validity, tick * step, part.position(tick * step)) {
            return Some(violation);
        }
        tick += 1.0;
    }
    contact_at(validity, to, part.to.positions.clone()).or_else(|| {
        let time = first_contact(validity, part, from, to)?;
        let positions = part.position(time);
        let contact = validity.first_contact(&positions);
        Some(Violation { time, kind: ViolationKind::Contact { positions, contact } })
    })
}

fn contact_at(validity: &impl Validity, time: f64, positions: Vec<f64>) -> Option<Violation> {
    if validity.is_free(&positions) {
        return None;
    }
    let contact = validity.first_contact(&positions);
    Some(Violation { time, kind: ViolationKind::Contact { positions, contact } })
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.4} s ", self.time)?;
        match &self.kind {
            ViolationKind::TimeStands { before } => {
                write!(f, "time does not rise: the sample before is at {before} s")
            }
            ViolationKind::NotAtRest { joint, velocity } => {
                write!(f, "joint `{joint}` should be at rest and moves by {velocity} a second")
            }
            ViolationKind::Position { joint, position, limit } => {
                write!(f, "joint `{joint}` is at {position}, its limit is {limit}")
            }
            ViolationKind::Velocity { joint, velocity, limit } => {
                write!(f, "joint `{joint}` has velocity {velocity}, its limit is {limit}")
            }
            ViolationKind::Acceleration { joint, acceleration, limit } => {
                write!(f, "joint `{joint}` has acceleration {acceleration}, its limit is {limit}")
            }
            ViolationKind::Jerk { joint, jerk, limit } => {
                write!(f, "joint `{joint}` has jerk {jerk}, its limit is {limit}")
            }
            ViolationKind::Contact { contact: Some(Contact { a, b, depth }), .. } => {
                write!(f, "`{a}` touches `{b}`, {:.2} mm deep", 1e3 * depth)
            }
            ViolationKind::Contact { positions, contact: None } => {
                write!(f, "something touches at {positions:?}")
            }
        }
    }
}

fn check(
    space: &JointSpace,
    limits: &MotionLimits,
    points: &[TrajectoryPoint],
    settings: &CheckSettings,
) -> Result<()> {
    let invalid = |what: String, expected: String, found: String| {
        Err(Error::Invalid { what, expected, found })
    };
    if limits.joints().len() != space.n_joints() {
        let expected = format!("one for each of {} joints", space.n_joints());
        return invalid("motion limits".into(), expected, limits.joints().len().to_string());
    }
    if points.len() < 2 {
        return invalid("points".into(), "at least two".into(), points.len().to_string());
    }
    for (index, point) in points.iter().enumerate() {
        for (name, values) in [("positions", &point.positions), ("velocities", &point.velocities)] {
            if values.len() != space.n_joints() || values.iter().any(|value| !value.is_finite()) {
                let expected = format!("{} finite numbers", space.n_joints());
                return invalid(
                    format!("{name} of point {index}"),
                    expected,
                    format!("{values:?}"),
                );
            }
        }
        if !point.time.is_finite() {
            return invalid(
                format!("time of point {index}"),
                "a finite number".into(),
                point.time.to_string(),
            );
        }
    }
    if !(settings.step > 0.0 && settings.step.is_finite()) {
        return invalid(
            "step".into(),
            "a number of seconds above 0".into(),
            settings.step.to_string(),
        );
    }
    Ok(())
}
