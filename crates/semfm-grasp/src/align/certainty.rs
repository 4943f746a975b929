//! How well the points determine the pose: noise, standard deviations, and what is not determined.

use nalgebra::SymmetricEigen;

use super::sim3::Sim3;
use super::solve::{Matching, Matrix7, Problem, Pull, geman_mcclure};

/// What is left over at a pose, and what that means for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Certainty {
    /// Root mean square of the weighted distances to the surface, metres.
    pub residual_m: f64,
    /// Weighted share of the points that lie on the model.
    pub inlier_share: f64,
    /// Standard deviation of the scale relative to itself.
    pub growth_std: f64,
    /// Standard deviation of the rotation about its least certain axis, radians.
    pub rotation_std: f64,
    /// Standard deviation of the position in its least certain direction, metres.
    pub position_std: f64,
}

impl Certainty {
    /// Huber's sandwich A⁻¹BA⁻¹ for M-estimators (Huber 1964): A sums ψ'·JJᵀ, B sums ψ²·JJᵀ over
    /// the points, ψ being the kernel's influence. It needs no noise level.
    pub fn of(problem: &Problem<'_>, pose: &Sim3, ids: &[u32], width: f64) -> Self {
        let (mut a, mut b) = (Matrix7::zeros(), Matrix7::zeros());
        let (mut weights, mut squares) = (0.0, 0.0);
        problem.pulls(pose, ids, width, Matching::Exact, |_, pull| {
            let weight = geman_mcclure(pull.squared, width) * pull.agreement;
            weights += geman_mcclure(pull.squared, width);
            squares += geman_mcclure(pull.squared, width) * pull.residual.powi(2);
            let outer = pull.jacobian * pull.jacobian.transpose();
            // ψ(r) = w(r)·r, so ψ' = w·(1 − 3x)/(1 + x) with x = r²/width².
            let x = pull.residual.powi(2) / (width * width);
            a += outer * (weight * (1.0 - 3.0 * x) / (1.0 + x));
            b += outer * (weight * pull.residual).powi(2);
        });
        let share = weights / ids.len().max(1) as f64;
        let covariance = sandwich(a, b);
        let largest = |at: usize| {
            let block = covariance.fixed_view::<3, 3>(at, at).into_owned();
            SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
        };
        Self {
            residual_m: if weights > 0.0 { (squares / weights).sqrt() } else { f64::INFINITY },
            inlier_share: share,
            growth_std: covariance[(6, 6)].max(0.0).sqrt(),
            rotation_std: largest(0),
            position_std: pose.scale * largest(3),
        }
    }
}

/// A⁻¹BA⁻¹ by A's eigenvectors; a direction that A does not see has a variance of at least 1 (a
/// radian, a radius of the object, a factor e), which is to say that nothing is known.
fn sandwich(a: Matrix7, b: Matrix7) -> Matrix7 {
    /// Relative to the best determined direction; rounding leaves 1e-16, real views more than 1e-5.
    const UNSEEN: f64 = 1e-7;
    let eigen = SymmetricEigen::new(a);
    let largest = eigen.eigenvalues.max();
    if largest <= 0.0 {
        return Matrix7::identity();
    }
    let mut covariance = Matrix7::zeros();
    let mut inverse = Matrix7::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let outer = vector * vector.transpose();
        if *value > UNSEEN * largest {
            inverse += outer / *value;
        } else {
            covariance += outer;
        }
    }
    covariance + inverse * b * inverse
}

/// Noise of the points that lie on the model: 1.4826 times the median distance to their planes,
/// among those matched within `width`. `None` where none is.
pub(super) fn noise(pulls: &[Pull], width: f64) -> Option<f64> {
    let near = pulls.iter().filter(|pull| pull.squared < width * width);
    let mut residuals: Vec<f64> = near.map(|pull| pull.residual.abs()).collect();
    let middle = residuals.len() / 2;
    (residuals.len() >= 7)
        .then(|| 1.4826 * *residuals.select_nth_unstable_by(middle, f64::total_cmp).1)
}
