//! Limited jerk: the mean over a short window of time of a motion with limited acceleration.
//!
//! p(t) = 1/T ∫ q(τ) dτ over t − T … t has velocity (q(t) − q(t − T)) / T and acceleration (q̇(t) − q̇(t − T)) / T. As
//! means they keep the limits of q̇ and q̈; jerk is at most 2A/T; and p is within A T²/24 of q(t − T/2), since the
//! linear part of q cancels. On straight lines p stays on the line. The motion takes T longer, and its acceleration
//! is continuous, so that controllers that interpolate by cubics or by quintics run the same curve.

use super::limits::MotionLimits;
use super::profile::{State, TimedCurve};

/// A window of time and the accelerations with which it keeps jerk limits and tolerance.
pub(super) struct Window {
    /// Seconds.
    pub length: f64,
    /// One a joint, at most the limit.
    pub accelerations: Vec<f64>,
}

/// Longest window that is tried, seconds.
const LONGEST: f64 = 0.5;

/// Windows tried, each longer than the one before by the same factor.
const TRIED: i32 = 60;

/// The window for jerk limits and a tolerance, at least `least` seconds where the tolerance allows it: the shortest with
/// which accelerations are scaled down the least. Of joint j with window T remain A = min(Aⱼ, Jⱼ T / 2, 24 tolerance / T²).
pub(super) fn window(limits: &MotionLimits, tolerance: f64, least: f64) -> Window {
    let allowed = |length: f64| -> Vec<f64> {
        let allowed = limits.joints().iter().map(|joint| {
            let by_jerk = joint.jerk.map_or(f64::INFINITY, |jerk| 0.5 * jerk * length);
            joint.acceleration.min(by_jerk).min(24.0 * tolerance / (length * length))
        });
        allowed.collect()
    };
    let share = |accelerations: &[f64]| {
        let shares =
            limits.joints().iter().zip(accelerations).map(|(joint, a)| a / joint.acceleration);
        shares.fold(1.0, f64::min)
    };
    let greatest = limits.joints().iter().map(|joint| joint.acceleration).fold(0.0, f64::max);
    let least = least.min((24.0 * tolerance / greatest).sqrt());
    let jerks =
        limits.joints().iter().filter_map(|joint| Some(2.0 * joint.acceleration / joint.jerk?));
    // Long enough for every jerk limit; where the tolerance forbids it, the best between.
    let enough = jerks.fold(least, f64::max).min(LONGEST.max(least));
    let mut best = Window { length: enough, accelerations: allowed(enough) };
    let mut best_share = share(&best.accelerations);
    for step in 0..TRIED {
        let length = enough * (least / enough).powf(f64::from(step + 1) / f64::from(TRIED));
        let accelerations = allowed(length);
        if share(&accelerations) > best_share {
            best_share = share(&accelerations);
            best = Window { length, accelerations };
        }
    }
    best
}

/// The mean of a motion over a window.
pub(super) struct Smoothed<'a> {
    pub motion: &'a TimedCurve<'a>,
    pub window: f64,
}

impl Smoothed<'_> {
    pub fn duration(&self) -> f64 {
        self.motion.duration() + self.window
    }

    /// Joint values and velocities at a time.
    pub fn state(&self, time: f64) -> State {
        let (from, to) = (time - self.window, time);
        let (first, last) = (self.motion.state(from), self.motion.state(to));
        let velocities = first
            .positions
            .iter()
            .zip(&last.positions)
            .map(|(a, b)| (b - a) / self.window)
            .collect();
        State { positions: self.mean(from, to), velocities }
    }

    /// Mean of the positions. Within an interval they are polynomials of degree four at most, for which three Gauss
    /// points are exact.
    fn mean(&self, from: f64, to: f64) -> Vec<f64> {
        let intervals = &self.motion.intervals;
        let mut sum = vec![0.0; self.motion.curve.n_joints()];
        let mut add = |positions: &[f64], weight: f64| {
            sum.iter_mut().zip(positions).for_each(|(sum, q)| *sum += weight * q);
        };
        let end = self.motion.duration();
        if from < 0.0 {
            add(self.motion.curve.start(), to.min(0.0) - from);
        }
        if to > end {
            add(self.motion.curve.end(), to - from.max(end));
        }
        let (mut at, stop) = (from.max(0.0), to.min(end));
        let mut interval = self.motion.interval_at(at);
        while at < stop {
            let part_end = intervals.get(interval + 1).map_or(end, |next| next.time).min(stop);
            let (middle, half) = (0.5 * (at + part_end), 0.5 * (part_end - at));
            for (node, weight) in GAUSS {
                add(&self.motion.state(middle + node * half).positions, weight * half);
            }
            at = part_end;
            interval += 1;
        }
        sum.iter_mut().for_each(|sum| *sum /= self.window);
        sum
    }
}

/// Nodes and weights on −1 … 1.
const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];
