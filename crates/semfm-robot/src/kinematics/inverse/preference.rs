//! What an arm with more joints than it needs does with them.

use super::super::arm::Arm;
use super::super::chain::Frame;
use super::super::cholesky;
use super::descent::Descent;

/// Where an arm goes among the positions that keep its tip at the target. It matters where there are more than six
/// joints, or a singular position; other solutions stay what they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preference {
    /// Where the search arrived.
    #[default]
    None,
    /// Nearest to the positions where the search began.
    Near,
    /// Away from limits.
    Limits,
    /// To where the tip moves most easily in every direction.
    Manipulability,
}

/// Most steps within the null space.
const MAX_STEPS: usize = 40;
/// The first step, radians or metres for the joint that moves most, and one too small to try.
const FIRST_STEP: f64 = 0.2;
const LEAST_STEP: f64 = 1e-3;
/// Step for differences of the manipulability.
const DIFFERENCE: f64 = 1e-5;
/// Keeps J Jᵀ invertible where the Jacobian is singular.
const REGULARISATION: f64 = 1e-10;

impl Preference {
    /// What is to become large.
    fn objective(self, arm: &Arm, near: &[f64], q: &[f64]) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Near => -near.iter().zip(q).map(|(near, q)| (near - q).powi(2)).sum::<f64>(),
            // Half the squared distance from the middle, in half ranges: Liégeois 1977, "Automatic supervisory control
            // of the configuration and behavior of multibody mechanisms", eq. 12.
            Self::Limits => {
                let share = |(joint, q): (&crate::ArmJoint, &f64)| {
                    let (middle, half) =
                        (0.5 * (joint.lower + joint.upper), 0.5 * (joint.upper - joint.lower));
                    if half.is_finite() && half > 0.0 { ((q - middle) / half).powi(2) } else { 0.0 }
                };
                -0.5 * arm.joints().iter().zip(q).map(share).sum::<f64>()
            }
            Self::Manipulability => arm.manipulability(q).max(f64::MIN_POSITIVE).ln(),
        }
    }

    /// ∂objective/∂q by central differences: every objective is smooth and cheap.
    fn gradient(self, arm: &Arm, near: &[f64], q: &[f64]) -> Vec<f64> {
        let mut at = q.to_vec();
        (0..q.len())
            .map(|i| {
                let [low, high] = [-DIFFERENCE, DIFFERENCE].map(|difference| {
                    at[i] = q[i] + difference;
                    self.objective(arm, near, &at)
                });
                at[i] = q[i];
                (high - low) / (2.0 * DIFFERENCE)
            })
            .collect()
    }
}

impl Descent<'_> {
    /// Climbs the preference from positions that reach the target, without leaving it: steps along the gradient's part
    /// in the null space of the Jacobian, each brought back to the target by a descent, kept where they gain.
    pub fn prefer(&mut self, preference: Preference, target: &Frame, near: &[f64], q: &mut [f64]) {
        if preference == Preference::None {
            return;
        }
        let arm = self.arm;
        let mut value = preference.objective(arm, near, q);
        let mut size = FIRST_STEP;
        for _ in 0..MAX_STEPS {
            let mut direction = preference.gradient(arm, near, q);
            into_null_space(arm, q, &mut direction);
            let longest = direction.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            if longest < 1e-9 || size < LEAST_STEP {
                return;
            }
            let joints = arm.joints().iter();
            let mut trial: Vec<f64> = joints
                .zip(q.iter().zip(&direction))
                .map(|(joint, (q, d))| (q + d * (size / longest)).clamp(joint.lower, joint.upper))
                .collect();
            let arrived = self.run(target, &mut trial);
            let trial_value = preference.objective(arm, near, &trial);
            if arrived && trial_value > value {
                q.copy_from_slice(&trial);
                value = trial_value;
            } else {
                size *= 0.5;
            }
        }
    }
}

/// Takes the part of a direction that moves the tip, and the parts that lead beyond limits, out of it:
///
/// > d − Jᵀ (J Jᵀ)⁻¹ J d   on the joints that are free
fn into_null_space(arm: &Arm, q: &[f64], direction: &mut [f64]) {
    let n = q.len();
    let mut jacobian = vec![0.0; 6 * n];
    arm.jacobian(q, &mut jacobian);
    // A joint that is stopped changes what the others may do, so each stop starts anew.
    let wanted = direction.to_vec();
    let mut is_free = vec![true; n];
    for _ in 0..=n {
        for i in 0..n {
            direction[i] = if is_free[i] { wanted[i] } else { 0.0 };
        }
        let row = |r: usize| &jacobian[r * n..(r + 1) * n];
        let product = |a: &[f64], b: &[f64]| -> f64 {
            (0..n).filter(|&i| is_free[i]).map(|i| a[i] * b[i]).sum()
        };
        let (mut gram, mut motion) = (vec![0.0; 36], [0.0; 6]);
        for r in 0..6 {
            for s in 0..=r {
                gram[r * 6 + s] = product(row(r), row(s));
            }
            gram[r * 7] += REGULARISATION;
            motion[r] = product(row(r), direction);
        }
        if !cholesky::factor(&mut gram, 6) {
            direction.fill(0.0);
            return;
        }
        cholesky::solve(&gram, &mut motion);
        for i in (0..n).filter(|&i| is_free[i]) {
            direction[i] -= (0..6).map(|r| jacobian[r * n + i] * motion[r]).sum::<f64>();
        }
        let beyond = arm.joints().iter().enumerate().position(|(i, joint)| {
            let d = direction[i];
            is_free[i] && (q[i] <= joint.lower && d < 0.0 || q[i] >= joint.upper && d > 0.0)
        });
        match beyond {
            Some(joint) => is_free[joint] = false,
            None => return,
        }
    }
}
