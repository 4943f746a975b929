//! The curves of a grasp's motion as one trajectory in time, looked at again as a whole.

use semfm_robot::Arm;

use crate::motion_request::MotionRequest;
use crate::step_checks::StepChecks;
use crate::timing::{
    CheckSettings, JointMotionLimit, MotionLimits, RetimeSettings, Violation, ViolationKind,
    check_trajectory, retime,
};
use crate::{
    CollisionChecker, Curve, JointSpace, Obstruction, Result, Segment, SegmentKind, TargetGrasp,
    Trajectory, TrajectoryPoint,
};

/// The curves of a motion, each beginning where the one before ends.
pub(crate) struct MotionCurves {
    pub to_pre_grasp: Curve,
    pub approach: Curve,
    pub lift: Curve,
}

/// A motion in time that was looked at again.
pub(crate) struct TimedMotion {
    pub trajectory: Trajectory,
    /// States that were looked at.
    pub n_replayed: usize,
}

/// Times the curves within the joints' limits and checks the cubics of the finished trajectory: positions, velocities,
/// accelerations, and contacts at each step of the replay and in between.
pub(crate) fn timed_motion(
    space: &JointSpace,
    arm: &Arm,
    curves: &MotionCurves,
    target: &TargetGrasp,
    checks: &StepChecks,
    request: &MotionRequest,
) -> Result<std::result::Result<TimedMotion, Obstruction>> {
    let settings = &request.settings;
    let limits = limits_of(arm)?;
    let (free, line) = (limits.at_speed(settings.speed)?, limits.at_speed(settings.line_speed)?);
    let parts = [
        (SegmentKind::ToPreGrasp, Some(&curves.to_pre_grasp), &free, target.opening),
        (SegmentKind::Approach, Some(&curves.approach), &line, target.opening),
        (SegmentKind::Close, None, &line, target.width),
        (SegmentKind::Lift, Some(&curves.lift), &line, target.width),
    ];
    let mut segments: Vec<Segment> = Vec::new();
    let mut start = 0.0;
    for (kind, curve, limits, opening) in parts {
        let mut points = match curve {
            Some(curve) => retime(curve, limits, opening, &RetimeSettings::default())?.points,
            None => closing(curves.approach.end(), target, settings.close_seconds),
        };
        points.iter_mut().for_each(|point| point.time += start);
        start = points.last().map_or(start, |point| point.time);
        segments.push(Segment { kind, points });
    }
    let joint_names = arm.joints().iter().map(|joint| joint.name.clone()).collect();
    let trajectory = Trajectory { joint_names, segments };
    let replay = CheckSettings { step: settings.replay_step };
    for segment in &trajectory.segments {
        for checker in checkers(checks, segment.kind) {
            let found = check_trajectory(space, checker, &limits, &segment.points, &replay)?;
            if let Some(violation) = found {
                return Ok(Err(obstruction(violation)));
            }
        }
    }
    let n_replayed = (trajectory.duration() / settings.replay_step).ceil() as usize;
    Ok(Ok(TimedMotion { trajectory, n_replayed }))
}

/// The limits of an arm's joints.
fn limits_of(arm: &Arm) -> Result<MotionLimits> {
    let limits = arm.joints().iter().map(|joint| JointMotionLimit {
        name: joint.name.clone(),
        velocity: joint.velocity,
        acceleration: joint.acceleration,
        jerk: joint.jerk,
    });
    MotionLimits::new(limits.collect())
}

/// The arm stands while the fingers close.
fn closing(positions: &[f64], target: &TargetGrasp, seconds: f64) -> Vec<TrajectoryPoint> {
    let standing = |time: f64, opening: f64| TrajectoryPoint {
        time,
        positions: positions.to_vec(),
        velocities: vec![0.0; positions.len()],
        accelerations: vec![0.0; positions.len()],
        opening,
    };
    vec![standing(0.0, target.opening), standing(seconds, target.width)]
}

/// What a segment is checked against.
fn checkers(checks: &StepChecks, kind: SegmentKind) -> Vec<&CollisionChecker> {
    match kind {
        SegmentKind::ToPreGrasp => vec![&checks.free],
        SegmentKind::Approach => vec![&checks.approach],
        SegmentKind::Close => checks.closing.iter().collect(),
        SegmentKind::Lift => vec![&checks.lift],
    }
}

fn obstruction(violation: Violation) -> Obstruction {
    let time = violation.time;
    let passed = |joint: String, quantity: &str, value: f64, limit: f64| Obstruction::LimitAtTime {
        time,
        joint,
        quantity: quantity.into(),
        value,
        limit,
    };
    match violation.kind {
        ViolationKind::Contact { contact: Some(contact), .. } => {
            let crate::Contact { a, b, depth } = contact;
            Obstruction::ContactAtTime { time, a, b, depth }
        }
        ViolationKind::Position { joint, position, limit } => {
            passed(joint, "position", position, limit)
        }
        ViolationKind::Velocity { joint, velocity, limit } => {
            passed(joint, "velocity", velocity, limit)
        }
        ViolationKind::Acceleration { joint, acceleration, limit } => {
            passed(joint, "acceleration", acceleration, limit)
        }
        ViolationKind::Jerk { joint, jerk, limit } => passed(joint, "jerk", jerk, limit),
        _ => Obstruction::Other { what: violation.to_string() },
    }
}
