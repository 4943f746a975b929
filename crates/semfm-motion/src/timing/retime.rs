//! A curve as samples over time.

use super::limits::MotionLimits;
use super::profile::{State, TimedCurve};
use super::smoothing::{Smoothed, window};
use crate::planning::Curve;
use crate::{Error, Result, TrajectoryPoint};

/// How samples are made.
#[derive(Clone, Debug, PartialEq)]
pub struct RetimeSettings {
    /// Greatest distance of any joint from the curve, radians or metres.
    pub tolerance: f64,
    /// Longest time between samples, seconds.
    pub longest_step: f64,
    /// Seconds over which accelerations change at least, see [`Retimed`].
    pub ramp: f64,
}

impl Default for RetimeSettings {
    fn default() -> Self {
        Self { tolerance: 1e-3, longest_step: 0.02, ramp: 0.01 }
    }
}

/// A motion along a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Retimed {
    /// At least two, times strictly rising from 0, at rest at the first and the last. On the cubics between them
    /// ([`TrajectoryPoint::between`]) velocities, accelerations and, where it is limited, jerk are within the limits at
    /// every time.
    pub points: Vec<TrajectoryPoint>,
    /// A bound of the distance of any joint from the curve, at most the tolerance.
    pub deviation: f64,
    /// Seconds that the fastest motion takes whose acceleration may jump (TOPP-RA).
    pub fastest: f64,
    /// True where every joint has a jerk limit. Otherwise accelerations of the others still change over at least
    /// [`RetimeSettings::ramp`] seconds, and how fast is not limited in advance.
    pub jerk_limited: bool,
}

impl Retimed {
    /// Seconds from the first sample to the last.
    pub fn duration(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point.time)
    }
}

/// What a motion between two equal points takes, seconds: times must rise.
const STANDING: f64 = 1e-3;

/// Samples closer than this become one, seconds.
const CLOSEST: f64 = 5e-4;

/// The fastest motion along `curve` within `limits`, from rest to rest, while the hand's opening stays as it is.
///
/// TOPP-RA finds the fastest motion; its mean over a short window of time limits the jerk; samples stand where
/// the jerk of that mean changes. Between samples on parabolas a cubic is not exactly the curve; where it passes a
/// limit (some 10⁻⁴ of it) the whole motion is stretched in time by as much.
///
/// # Errors
/// [`Error::Invalid`] for limits of another number of joints and for settings that are not above 0.
pub fn retime(
    curve: &Curve,
    limits: &MotionLimits,
    opening: f64,
    settings: &RetimeSettings,
) -> Result<Retimed> {
    check(curve, limits, settings)?;
    let jerk_limited = limits.joints().iter().all(|joint| joint.jerk.is_some());
    if curve.length() == 0.0 {
        let points = [0.0, STANDING].map(|time| standing(curve.start(), time, opening));
        return Ok(Retimed { points: points.to_vec(), deviation: 0.0, fastest: 0.0, jerk_limited });
    }
    // Half of the tolerance is for what the window cuts, half for the cubics.
    let window = window(limits, 0.5 * settings.tolerance, settings.ramp);
    let velocity: Vec<f64> = limits.joints().iter().map(|joint| joint.velocity).collect();
    let motion = TimedCurve::fastest(curve, &velocity, &window.accelerations);
    let smoothed = Smoothed { motion: &motion, window: window.length };

    let mut longest_step = settings.longest_step;
    loop {
        let times = sample_times(&smoothed, longest_step);
        let mut points = sampled(&smoothed, &times, opening);
        let cut = window
            .accelerations
            .iter()
            .fold(0.0, |most, a| f64::max(most, a * window.length.powi(2) / 24.0));
        let deviation = cut + cubic_deviation(&smoothed, &points);
        if deviation > settings.tolerance && longest_step > CLOSEST {
            longest_step *= 0.5;
            continue;
        }
        stretch(&mut points, limits);
        return Ok(Retimed { points, deviation, fastest: motion.duration(), jerk_limited });
    }
}

/// Times at which the smoothed motion's jerk changes, and enough between.
fn sample_times(smoothed: &Smoothed<'_>, longest_step: f64) -> Vec<f64> {
    let mut knots: Vec<f64> = Vec::new();
    for interval in &smoothed.motion.intervals {
        knots.extend([interval.time, interval.time + smoothed.window]);
    }
    let end = smoothed.duration();
    knots.extend([smoothed.motion.duration(), end]);
    knots.sort_by(f64::total_cmp);

    let mut times = vec![0.0];
    let mut last = 0.0;
    for knot in knots {
        if knot - last < CLOSEST || (end - knot < CLOSEST && knot < end) {
            continue;
        }
        let parts = ((knot - last) / longest_step).ceil().max(1.0);
        times.extend((1..=parts as usize).map(|part| last + (knot - last) * part as f64 / parts));
        last = knot;
    }
    times
}

fn sampled(smoothed: &Smoothed<'_>, times: &[f64], opening: f64) -> Vec<TrajectoryPoint> {
    let last = times.len() - 1;
    let curve = smoothed.motion.curve;
    let mut points: Vec<TrajectoryPoint> = Vec::with_capacity(times.len());
    for (index, &time) in times.iter().enumerate() {
        let State { positions, velocities } = smoothed.state(time);
        let accelerations = vec![0.0; positions.len()];
        points.push(match index {
            0 => standing(curve.start(), time, opening),
            _ if index == last => standing(curve.end(), time, opening),
            _ => TrajectoryPoint { time, positions, velocities, accelerations, opening },
        });
    }
    // Between the accelerations at the end of one cubic and at the beginning of the next.
    for index in 0..points.len() {
        let before = index.checked_sub(1).map(|i| Cubic::between(&points[i], &points[index]));
        let after = points.get(index + 1).map(|next| Cubic::between(&points[index], next));
        let accelerations = (0..curve.n_joints())
            .map(|j| match (&before, &after) {
                (Some(before), Some(after)) => 0.5 * (before.last[j] + after.first[j]),
                (Some(before), None) => before.last[j],
                (None, after) => after.as_ref().map_or(0.0, |after| after.first[j]),
            })
            .collect();
        points[index].accelerations = accelerations;
    }
    points
}

fn standing(positions: &[f64], time: f64, opening: f64) -> TrajectoryPoint {
    let zero = vec![0.0; positions.len()];
    TrajectoryPoint {
        time,
        positions: positions.to_vec(),
        velocities: zero.clone(),
        accelerations: zero,
        opening,
    }
}

/// Accelerations at both ends of the cubics between two samples; linear between.
pub(super) struct Cubic {
    pub duration: f64,
    pub first: Vec<f64>,
    pub last: Vec<f64>,
}

impl Cubic {
    pub fn between(from: &TrajectoryPoint, to: &TrajectoryPoint) -> Self {
        let h = to.time - from.time;
        let n_joints = from.positions.len();
        let (mut first, mut last) = (Vec::with_capacity(n_joints), Vec::with_capacity(n_joints));
        for j in 0..n_joints {
            let mean = (to.positions[j] - from.positions[j]) / h;
            first.push((6.0 * mean - 4.0 * from.velocities[j] - 2.0 * to.velocities[j]) / h);
            last.push((2.0 * from.velocities[j] + 4.0 * to.velocities[j] - 6.0 * mean) / h);
        }
        Self { duration: h, first, last }
    }

    /// Jerk of a joint.
    pub fn jerk(&self, joint: usize) -> f64 {
        (self.last[joint] - self.first[joint]) / self.duration
    }

    /// Seconds after the beginning at which a joint's velocity has an extreme inside.
    pub fn fastest_at(&self, joint: usize) -> Option<f64> {
        let (first, last) = (self.first[joint], self.last[joint]);
        (first * last < 0.0).then(|| self.duration * first / (first - last))
    }
}

/// Greatest distance of any joint between the cubics and the motion that they stand for, at their middles, where it is
/// greatest for what a cubic misses first.
fn cubic_deviation(smoothed: &Smoothed<'_>, points: &[TrajectoryPoint]) -> f64 {
    let mut greatest = 0.0f64;
    for pair in points.windows(2) {
        let middle = 0.5 * (pair[0].time + pair[1].time);
        let (cubic, motion) = (pair[0].between(&pair[1], middle), smoothed.state(middle));
        for (a, b) in cubic.positions.iter().zip(&motion.positions) {
            greatest = greatest.max((a - b).abs());
        }
    }
    greatest
}

/// What second differences of positions over [`CLOSEST`] lose of an acceleration limit to rounding, generously.
const ROUNDING: f64 = 1e-6;

/// Stretches time until the cubics keep all limits.
fn stretch(points: &mut [TrajectoryPoint], limits: &MotionLimits) {
    let mut factor = 0.0f64;
    for pair in points.windows(2) {
        let cubic = Cubic::between(&pair[0], &pair[1]);
        for (j, limit) in limits.joints().iter().enumerate() {
            let mut velocity = pair[0].velocities[j].abs().max(pair[1].velocities[j].abs());
            if let Some(at) = cubic.fastest_at(j) {
                // From first to zero in `at` seconds, linearly.
                velocity = velocity.max((pair[0].velocities[j] + 0.5 * cubic.first[j] * at).abs());
            }
            let acceleration = cubic.first[j].abs().max(cubic.last[j].abs());
            factor = factor
                .max(velocity / limit.velocity)
                .max((acceleration / limit.acceleration).sqrt());
            if let Some(jerk) = limit.jerk {
                factor = factor.max((cubic.jerk(j).abs() / jerk).cbrt());
            }
        }
    }
    if factor > 1.0 - ROUNDING {
        factor *= 1.0 + ROUNDING;
        for point in points {
            point.time *= factor;
            point.velocities.iter_mut().for_each(|v| *v /= factor);
            point.accelerations.iter_mut().for_each(|a| *a /= factor * factor);
        }
    }
}

fn check(curve: &Curve, limits: &MotionLimits, settings: &RetimeSettings) -> Result<()> {
    let invalid = |what: &str, expected: String, found: String| {
        Err(Error::Invalid { what: what.into(), expected, found })
    };
    if limits.joints().len() != curve.n_joints() {
        let expected = format!("one for each of {} joints", curve.n_joints());
        return invalid("motion limits", expected, limits.joints().len().to_string());
    }
    let settings = [
        ("tolerance", settings.tolerance),
        ("longest_step", settings.longest_step),
        ("ramp", settings.ramp),
    ];
    for (what, value) in settings {
        if !(value > 0.0 && value.is_finite()) {
            return invalid(what, "a number above 0".into(), value.to_string());
        }
    }
    Ok(())
}
