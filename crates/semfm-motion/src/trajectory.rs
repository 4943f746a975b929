//! A timed motion: positions, velocities and accelerations of joints over time.

use serde::{Deserialize, Serialize};

/// What an arm does over time, in segments that follow one another without a gap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trajectory {
    /// The arm's joints, from base to tip; the order of every list of joint values.
    pub joint_names: Vec<String>,
    /// The segments in order; each begins at the time and in the state in which the one before ends.
    pub segments: Vec<Segment>,
}

/// A part of a trajectory with one purpose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// What it is for.
    pub kind: SegmentKind,
    /// At least two, times strictly rising; the first and the last at rest. Between two points each joint follows the
    /// cubic polynomial that their positions and velocities determine.
    pub points: Vec<TrajectoryPoint>,
}

/// What a segment is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmentKind {
    /// Through free space from the start to before the grasp, hand open.
    ToPreGrasp,
    /// Straight along the approach direction to the grasp.
    Approach,
    /// The arm stands, the fingers close.
    Close,
    /// Straight up with the object.
    Lift,
}

/// The state of an arm at a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryPoint {
    /// Seconds since the trajectory began.
    pub time: f64,
    /// Radians or metres, one a joint.
    pub positions: Vec<f64>,
    /// Per second.
    pub velocities: Vec<f64>,
    /// Per second squared.
    pub accelerations: Vec<f64>,
    /// Distance between the finger pads, metres.
    pub opening: f64,
}

impl Trajectory {
    /// Seconds from the first point to the last; 0 without any.
    pub fn duration(&self) -> f64 {
        let last = self.segments.last().and_then(|segment| segment.points.last());
        last.map_or(0.0, |point| point.time)
    }

    /// The first segment of a kind.
    pub fn segment(&self, kind: SegmentKind) -> Option<&Segment> {
        self.segments.iter().find(|segment| segment.kind == kind)
    }

    /// The state at a time, see [`TrajectoryPoint::between`]; before the first point and after the last, theirs. `None`
    /// without any point.
    pub fn at(&self, time: f64) -> Option<TrajectoryPoint> {
        let begun = |segment: &&Segment| segment.points.first().is_some_and(|p| p.time <= time);
        let segment = self.segments.iter().rfind(begun).or(self.segments.first())?;
        let after = segment.points.partition_point(|point| point.time <= time);
        match (after.checked_sub(1).map(|i| &segment.points[i]), segment.points.get(after)) {
            (Some(from), Some(to)) => Some(from.between(to, time)),
            (from, to) => from.or(to).cloned(),
        }
    }
}

impl SegmentKind {
    /// Its name, as in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::ToPreGrasp => "to_pre_grasp",
            Self::Approach => "approach",
            Self::Close => "close",
            Self::Lift => "lift",
        }
    }
}

impl TrajectoryPoint {
    /// The state between this point and a later one: each joint on the cubic that positions and velocities at both
    /// determine, with its first and second derivative. With s = (t − t₀)/h, h = t₁ − t₀,
    ///
    /// > q(t) = (2s³ − 3s² + 1) q₀ + (s³ − 2s² + s) h v₀ + (3s² − 2s³) q₁ + (s³ − s²) h v₁
    ///
    /// The opening is linear. Times outside count as the nearest inside.
    pub fn between(&self, to: &Self, time: f64) -> Self {
        let h = to.time - self.time;
        let s = ((time - self.time) / h).clamp(0.0, 1.0);
        // The four basis functions, and their derivatives by t.
        let value = [
            (2.0 * s - 3.0) * s * s + 1.0,
            s * (s - 1.0) * (s - 1.0),
            s * s * (3.0 - 2.0 * s),
            s * s * (s - 1.0),
        ];
        let slope = [
            6.0 * s * (s - 1.0),
            (3.0 * s - 1.0) * (s - 1.0),
            6.0 * s * (1.0 - s),
            s * (3.0 * s - 2.0),
        ];
        let bend = [12.0 * s - 6.0, 6.0 * s - 4.0, 6.0 - 12.0 * s, 6.0 * s - 2.0];
        let mix = |basis: [f64; 4], scale: f64| -> Vec<f64> {
            (0..self.positions.len())
                .map(|j| {
                    let [v0, v1] = [self.velocities[j], to.velocities[j]].map(|v| h * v);
                    let [q0, q1] = [self.positions[j], to.positions[j]];
                    scale * (basis[0] * q0 + basis[1] * v0 + basis[2] * q1 + basis[3] * v1)
                })
                .collect()
        };
        Self {
            time: time.clamp(self.time, to.time),
            positions: mix(value, 1.0),
            velocities: mix(slope, 1.0 / h),
            accelerations: mix(bend, 1.0 / (h * h)),
            opening: self.opening + s * (to.opening - self.opening),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cubic t³ − 2t at time t.
    fn on_cubic(t: f64) -> TrajectoryPoint {
        TrajectoryPoint {
            time: t,
            positions: vec![t * t * t - 2.0 * t],
            velocities: vec![3.0 * t * t - 2.0],
            accelerations: vec![6.0 * t],
            opening: 0.01 * t,
        }
    }

    #[test]
    fn a_cubic_is_met_between_its_points_with_its_derivatives() {
        let segment = |kind, times: &[f64]| Segment {
            kind,
            points: times.iter().map(|&t| on_cubic(t)).collect(),
        };
        let trajectory = Trajectory {
            joint_names: vec!["a".into()],
            segments: vec![
                segment(SegmentKind::ToPreGrasp, &[0.0, 0.3, 1.0]),
                segment(SegmentKind::Lift, &[1.0, 2.5]),
            ],
        };
        assert_eq!(trajectory.duration(), 2.5);
        for t in [0.0, 0.1, 0.3, 0.77, 1.0, 1.9, 2.5] {
            let (found, expected) = (trajectory.at(t).unwrap(), on_cubic(t));
            let [a, b] = [&found, &expected]
                .map(|p| [p.positions[0], p.velocities[0], p.accelerations[0], p.opening, p.time]);
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
        }
        assert_eq!(trajectory.at(-1.0).unwrap(), on_cubic(0.0));
        assert_eq!(trajectory.at(9.0).unwrap(), on_cubic(2.5));
    }
}
