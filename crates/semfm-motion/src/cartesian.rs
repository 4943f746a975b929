//! Straight lines of the tip: joint values along them, as close as asked for.
//!
//! A line is followed in steps. A step is taken where the straight way between the joint values at its two ends keeps to
//! the line: a quarter, half and three quarters of the way along, the tip is no farther than a tolerance from where the
//! line is at that share. Else the step is halved. A jump from one posture of the arm to another cannot pass, for on its
//! way the tip leaves the line, so there is no threshold for jumps.

use parry3d_f64::math::Pose;

use crate::planning::joint_space::between;

/// How close a straight line is followed.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSettings {
    /// Farthest that the tip may be from the line between two joint values, metres.
    pub tolerance: f64,
    /// Greatest angle between the tip and its rotation on the line, radians.
    pub rotation_tolerance: f64,
    /// Longest step, metres.
    pub longest_step: f64,
    /// Shortest step, metres: a line that would need shorter ones cannot be followed.
    pub shortest_step: f64,
}

impl Default for LineSettings {
    fn default() -> Self {
        Self { tolerance: 5e-4, rotation_tolerance: 5e-3, longest_step: 0.02, shortest_step: 1e-4 }
    }
}

impl LineSettings {
    /// Whether a frame is as close to where it should be as the tolerances ask.
    fn is_within_tolerance(&self, wanted: &Pose, found: &Pose) -> bool {
        wanted.translation.distance(found.translation) <= self.tolerance
            && wanted.rotation.angle_between(found.rotation) <= self.rotation_tolerance
    }
}

/// A straight line of a frame from one pose to another, turning evenly on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StraightLine {
    pub from: Pose,
    pub to: Pose,
}

impl StraightLine {
    /// The pose at a share of the way.
    pub fn at(&self, share: f64) -> Pose {
        Pose::from_parts(
            self.from.translation.lerp(self.to.translation, share),
            self.from.rotation.slerp(self.to.rotation, share),
        )
    }

    /// Metres.
    pub fn length(&self) -> f64 {
        self.from.translation.distance(self.to.translation)
    }
}

/// Where a line could not be followed any further.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LineFault {
    /// Metres along the line that could be followed.
    pub at: f64,
    /// Joint values up to there.
    pub q: Vec<f64>,
    /// Joint values of the best try for what comes next.
    pub beyond: Vec<f64>,
}

/// An arm as far as lines need it.
pub(crate) trait LineArm {
    /// Where the tip is.
    fn tip(&self, q: &[f64]) -> Pose;

    /// Joint values near `near` that put the tip at a pose, or those of the best try.
    fn reach(&self, base_from_tip: &Pose, near: &[f64]) -> Result<Vec<f64>, Vec<f64>>;
}

/// Joint values along a line from `start`, which reaches its beginning: the first is `start`, the last reaches the end.
pub(crate) fn follow_line(
    arm: &impl LineArm,
    line: &StraightLine,
    start: &[f64],
    settings: &LineSettings,
) -> Result<Vec<Vec<f64>>, LineFault> {
    let length = line.length();
    let share_of = |metres: f64| if length > 0.0 { (metres / length).min(1.0) } else { 1.0 };
    let (longest, shortest) = (share_of(settings.longest_step), share_of(settings.shortest_step));
    let mut waypoints = vec![start.to_vec()];
    let (mut share, mut step) = (0.0, longest);
    let mut q = start.to_vec();
    while share < 1.0 {
        let next_share = if share + step > 1.0 - 1e-9 { 1.0 } else { share + step };
        match step_along(arm, line, [share, next_share], &q, settings) {
            Ok(next) => {
                waypoints.push(next.clone());
                (q, share) = (next, next_share);
                step = (2.0 * step).min(longest);
            }
            Err(beyond) if step <= shortest => {
                return Err(LineFault { at: share * length, q, beyond });
            }
            Err(_) => step = (step / 2.0).max(shortest),
        }
    }
    Ok(waypoints)
}

/// Joint values at the end of a step that keeps to the line, or those of the best try.
fn step_along(
    arm: &impl LineArm,
    line: &StraightLine,
    [from, to]: [f64; 2],
    q: &[f64],
    settings: &LineSettings,
) -> Result<Vec<f64>, Vec<f64>> {
    let next = arm.reach(&line.at(to), q)?;
    for share in [0.5, 0.25, 0.75] {
        let on_the_way = arm.tip(&between(q, &next, share));
        if !settings.is_within_tolerance(&line.at(from + share * (to - from)), &on_the_way) {
            return Err(next);
        }
    }
    Ok(next)
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::{DQuat, DVec3};

    /// Two links of length 1 in the x-y plane; the tip does not turn (a third joint keeps it level).
    struct Planar {
        /// Whether the elbow may bend to the other side.
        flips: bool,
    }

    impl LineArm for Planar {
        fn tip(&self, q: &[f64]) -> Pose {
            let (a, b) = (q[0], q[0] + q[1]);
            Pose::from_parts(DVec3::new(a.cos() + b.cos(), a.sin() + b.sin(), 0.0), DQuat::IDENTITY)
        }

        fn reach(&self, pose: &Pose, near: &[f64]) -> Result<Vec<f64>, Vec<f64>> {
            let DVec3 { x, y, .. } = pose.translation;
            let cosine = (x * x + y * y - 2.0) / 2.0;
            if cosine.abs() > 1.0 {
                return Err(near.to_vec());
            }
            let side = if self.flips && x > 1.0 { -near[1].signum() } else { near[1].signum() };
            let elbow = side * cosine.acos();
            let shoulder = y.atan2(x) - elbow.sin().atan2(1.0 + elbow.cos());
            Ok(vec![shoulder, elbow])
        }
    }

    fn line(from: [f64; 2], to: [f64; 2]) -> StraightLine {
        let [from, to] = [from, to].map(|[x, y]| Pose::translation(x, y, 0.0));
        StraightLine { from, to }
    }

    #[test]
    fn the_tip_keeps_to_the_line_everywhere() {
        let (arm, settings) = (Planar { flips: false }, LineSettings::default());
        let line = line([0.5, 0.8], [1.4, -0.9]);
        let start = arm.reach(&line.from, &[0.0, 1.0]).unwrap();
        let waypoints = follow_line(&arm, &line, &start, &settings).unwrap();
        assert!(
            arm.tip(waypoints.last().unwrap()).translation.distance(line.to.translation) < 1e-9
        );
        let way = line.to.translation - line.from.translation;
        for pair in waypoints.windows(2) {
            for i in 0..=50 {
                let tip = arm.tip(&between(&pair[0], &pair[1], f64::from(i) / 50.0)).translation;
                let off = (tip - line.from.translation).cross(way).length() / way.length();
                assert!(off < settings.tolerance, "{off}");
            }
        }
    }

    #[test]
    fn a_line_ends_where_the_reach_ends() {
        let (arm, settings) = (Planar { flips: false }, LineSettings::default());
        let line = line([1.5, 0.0], [2.5, 0.0]);
        let start = arm.reach(&line.from, &[0.0, 1.0]).unwrap();
        let fault = follow_line(&arm, &line, &start, &settings).unwrap_err();
        assert!((fault.at - 0.5).abs() < 2e-3, "{fault:?}");
    }

    #[test]
    fn another_posture_is_no_way_along_the_line() {
        let (arm, settings) = (Planar { flips: true }, LineSettings::default());
        let line = line([0.6, 0.5], [1.4, 0.5]);
        let start = arm.reach(&line.from, &[0.0, 1.0]).unwrap();
        let fault = follow_line(&arm, &line, &start, &settings).unwrap_err();
        assert!((fault.at - 0.4).abs() < 2e-3, "{fault:?}");
    }

    #[test]
    fn a_line_of_no_length_is_its_end() {
        let (arm, settings) = (Planar { flips: false }, LineSettings::default());
        let line = line([0.6, 0.5], [0.6, 0.5]);
        let start = arm.reach(&line.from, &[0.0, 1.0]).unwrap();
        assert_eq!(follow_line(&arm, &line, &start, &settings).unwrap().len(), 2);
    }
}
