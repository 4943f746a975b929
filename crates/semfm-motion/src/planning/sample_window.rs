//! Where random joint values are drawn: around the start and the goals first, then farther and farther out.
//!
//! Joints that turn once to either side, as those of Universal Robots' arms do, make a space of which a path needs the
//! smallest part: all else are the same postures, a turn away. Drawing from all of it grows trees into these turns.

use std::f64::consts::{PI, TAU};

use rand::{Rng, RngExt};

use super::joint_space::JointSpace;

/// How far beyond the start and the goals joint values are drawn at first, radians (metres).
const FIRST_MARGIN: f64 = 1.0;
/// Samples after which the margin is twice as wide.
const SAMPLES_A_MARGIN: usize = 100;
/// Margins beyond this reach all there is, radians.
const ALL: f64 = 100.0;

/// For each joint the values from which samples are drawn at first.
pub(super) struct SampleWindow<'a> {
    space: &'a JointSpace,
    /// Least and greatest value of the start and the goals, as seen from the start.
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a> SampleWindow<'a> {
    pub fn new<'b>(
        space: &'a JointSpace,
        start: &[f64],
        goals: impl Iterator<Item = &'b Vec<f64>>,
    ) -> Self {
        let (mut lower, mut upper) = (start.to_vec(), start.to_vec());
        for goal in goals {
            for (j, value) in space.toward(start, goal).into_iter().enumerate() {
                lower[j] = lower[j].min(value);
                upper[j] = upper[j].max(value);
            }
        }
        Self { space, lower, upper }
    }

    /// Joint values for the sample of that number, from 0: drawn evenly from the window with the margin of its turn.
    /// A continuous joint is drawn from a turn at most.
    pub fn sample(&self, number: usize, random: &mut impl Rng, q: &mut Vec<f64>) {
        let margin =
            (FIRST_MARGIN * 2f64.powi((number / SAMPLES_A_MARGIN).min(16) as i32)).min(ALL);
        q.clear();
        for (j, joint) in self.space.joints().iter().enumerate() {
            let (mut lower, mut upper) = (self.lower[j] - margin, self.upper[j] + margin);
            if !joint.is_continuous() {
                (lower, upper) = (lower.max(joint.lower), upper.min(joint.upper));
            } else if upper - lower > TAU {
                (lower, upper) = (-PI, PI);
            }
            q.push(lower + (upper - lower) * random.random::<f64>());
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::super::joint_space::JointRange;
    use super::*;

    #[test]
    fn samples_begin_around_the_ends_and_reach_everything_later() {
        let range = |lower, upper| JointRange { name: "j".into(), lower, upper };
        let joints = vec![range(-TAU, TAU), range(-0.5, 0.7), range(-f64::INFINITY, f64::INFINITY)];
        let space = JointSpace::new(joints).unwrap();
        let goals = [vec![0.5, 0.6, -3.0]];
        let window = SampleWindow::new(&space, &[0.0, 0.0, 3.0], goals.iter());
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let mut bounds = |numbers: std::ops::Range<usize>| {
            let mut bounds = [[f64::INFINITY, -f64::INFINITY]; 3];
            let mut q = Vec::new();
            for number in numbers {
                window.sample(number, &mut random, &mut q);
                for (bound, &value) in bounds.iter_mut().zip(&q) {
                    *bound = [bound[0].min(value), bound[1].max(value)];
                }
            }
            bounds
        };
        let first = bounds(0..SAMPLES_A_MARGIN);
        assert!(first[0][0] >= -FIRST_MARGIN && first[0][1] <= 0.5 + FIRST_MARGIN, "{first:?}");
        assert!(first[1][0] >= -0.5 && first[1][1] <= 0.7, "{first:?}");
        // Across π: from 3 to 2π − 3.
        assert!(first[2][0] >= 2.0 && first[2][1] <= TAU - 2.0, "{first:?}");
        let later = bounds(10 * SAMPLES_A_MARGIN..20 * SAMPLES_A_MARGIN);
        let whole = [[-TAU, TAU], [-0.5, 0.7], [-PI, PI]];
        for (found, whole) in later.iter().zip(whole) {
            let slack = 0.02 * (whole[1] - whole[0]);
            assert!(found[0] >= whole[0] && found[0] < whole[0] + slack, "{later:?}");
            assert!(found[1] <= whole[1] && found[1] > whole[1] - slack, "{later:?}");
        }
    }
}
