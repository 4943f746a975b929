//! One descent: Levenberg and Marquardt's method within limits.

use super::super::arm::Arm;
use super::super::chain::Frame;
use super::super::cholesky;
use super::IkSettings;
use super::pose_error::PoseError;

/// Iterations after which a descent is given up. Nearly all that arrive do so within 20.
const MAX_ITERATIONS: usize = 60;

/// Share of the tolerances at which a descent ends. Convergence is quadratic, so this takes one step more than the
/// tolerances themselves, and neighbouring poses get answers that differ as little as they do.
const ARRIVAL: f64 = 1e-3;

/// A descent that does not lower its cost by this factor in [`PATIENCE`] iterations is in a local minimum. Half the
/// patience gives up on one in six that would arrive; twice as much takes a third longer for few more.
const LEAST_PROGRESS: f64 = 0.8;
const PATIENCE: usize = 6;

/// Metres weigh as much as so many radians. On Panda, FR3, UR5, UR5e and Gen3, 2 needs some 3 % fewer descents than 1.
const RADIANS_PER_METRE: f64 = 2.0;

/// The damping λ of (JᵀJ + λ) step = g is this times the cost (Sugihara 2011, "Solvability-unconcerned inverse
/// kinematics by the Levenberg-Marquardt method"): large far away and near singular poses that cannot be reached, and
/// gone at the target. At a tenth, arms of six joints find some branches more rarely.
const FIRST_DAMPING: f64 = 0.1;
/// Damping that stays at the target, where the cost is zero and the Jacobian may be singular.
const LEAST_DAMPING: f64 = 1e-12;
/// What steps that lower the cost, and those that raise it, do to the damping.
const EASED: f64 = 0.3;
const TIGHTENED: f64 = 8.0;
/// Damping at which steps are too small to matter.
const MOST_DAMPING: f64 = 1e6;

/// Arrays for descents of one arm, made once for a call.
pub(super) struct Descent<'a> {
    pub arm: &'a Arm,
    settings: &'a IkSettings,
    /// 6 × n, at the positions reached and at those tried.
    jacobian: Vec<f64>,
    trial_jacobian: Vec<f64>,
    trial: Vec<f64>,
    gradient: Vec<f64>,
    step: Vec<f64>,
    is_free: Vec<bool>,
    /// n × n, lower triangle.
    normal: Vec<f64>,
}

impl<'a> Descent<'a> {
    pub fn new(arm: &'a Arm, settings: &'a IkSettings) -> Self {
        let n = arm.n_joints();
        Self {
            arm,
            settings,
            jacobian: vec![0.0; 6 * n],
            trial_jacobian: vec![0.0; 6 * n],
            trial: vec![0.0; n],
            gradient: vec![0.0; n],
            step: vec![0.0; n],
            is_free: vec![true; n],
            normal: vec![0.0; n * n],
        }
    }

    /// Brings the tip to the target from `q`, which holds the last positions afterwards, whether it arrived or not.
    pub fn run(&mut self, target: &Frame, q: &mut [f64]) -> bool {
        let tip = self.arm.chain().tip_with_jacobian(q, &mut self.jacobian);
        let mut error = PoseError::between(&tip, target);
        let mut cost = cost(&error);
        let (mut damping, mut cost_before) = (FIRST_DAMPING, cost);
        for iteration in 1..=MAX_ITERATIONS {
            if self.is_reached(&error) {
                return true;
            }
            if iteration % PATIENCE == 0 {
                if cost > LEAST_PROGRESS * cost_before {
                    return false;
                }
                cost_before = cost;
            }
            self.set_up_normal_equations(&error, q, damping * cost + LEAST_DAMPING);
            if !cholesky::factor(&mut self.normal, q.len()) {
                return false;
            }
            cholesky::solve(&self.normal, &mut self.step);
            let trial_error = self.try_step(target, q);
            let trial_cost = self::cost(&trial_error);
            if trial_cost < cost {
                q.copy_from_slice(&self.trial);
                std::mem::swap(&mut self.jacobian, &mut self.trial_jacobian);
                (error, cost) = (trial_error, trial_cost);
                damping *= EASED;
            } else {
                damping *= TIGHTENED;
                if damping > MOST_DAMPING {
                    return false;
                }
            }
        }
        self.is_reached(&error)
    }

    fn is_reached(&self, error: &PoseError) -> bool {
        error.distance() <= ARRIVAL * self.settings.position_tolerance
            && error.angle() <= ARRIVAL * self.settings.rotation_tolerance
    }

    /// With e weighted and J the tip's Jacobian, the step solves (projected at limits)
    ///
    /// > (Jᵀ W J + λ) step = Jᵀ W e
    ///
    /// A joint at a limit is left out where the gradient points beyond.
    fn set_up_normal_equations(&mut self, error: &PoseError, q: &[f64], damping: f64) {
        let n = q.len();
        let square = RADIANS_PER_METRE * RADIANS_PER_METRE;
        let weights = [square, square, square, 1.0, 1.0, 1.0];
        let e = [error.displacement.to_array(), error.rotation.to_array()];
        self.gradient.fill(0.0);
        self.normal.fill(0.0);
        for ((row, e), weight) in self.jacobian.chunks_exact(n).zip(e.as_flattened()).zip(weights) {
            for i in 0..n {
                let weighted = weight * row[i];
                self.gradient[i] += weighted * e;
                let normal_row = &mut self.normal[i * n..=i * n + i];
                for (entry, other) in normal_row.iter_mut().zip(row) {
                    *entry += weighted * other;
                }
            }
        }
        for (i, joint) in self.arm.joints().iter().enumerate() {
            let g = self.gradient[i];
            self.is_free[i] = !(q[i] <= joint.lower && g < 0.0 || q[i] >= joint.upper && g > 0.0);
        }
        for i in 0..n {
            for j in 0..i {
                if !(self.is_free[i] && self.is_free[j]) {
                    self.normal[i * n + j] = 0.0;
                }
            }
            self.normal[i * n + i] += damping;
            self.step[i] = if self.is_free[i] { self.gradient[i] } else { 0.0 };
        }
    }

    /// Takes the step as far as limits allow.
    fn try_step(&mut self, target: &Frame, q: &[f64]) -> PoseError {
        for (i, joint) in self.arm.joints().iter().enumerate() {
            self.trial[i] = (q[i] + self.step[i]).clamp(joint.lower, joint.upper);
        }
        let tip = self.arm.chain().tip_with_jacobian(&self.trial, &mut self.trial_jacobian);
        PoseError::between(&tip, target)
    }
}

fn cost(error: &PoseError) -> f64 {
    let displacement = RADIANS_PER_METRE * RADIANS_PER_METRE * error.displacement.length_squared();
    0.5 * (displacement + error.rotation.length_squared())
}
