//! How well the points determine the pose: noise, standard deviations, and what is not determined.

use nalgebra::SymmetricEigen;
use semfm_geom::math::DVec3;

use super::sim3::Sim3;
use super::solve::{Matching, Matrix7, Problem, Pull, Vector7, geman_mcclure};

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
        let turns = SymmetricEigen::new(covariance.fixed_view::<3, 3>(0, 0).into_owned());
        let shifts = SymmetricEigen::new(covariance.fixed_view::<3, 3>(3, 3).into_owned());
        let variance = turns.eigenvalues.max();
        let mut rotation_std = variance.max(0.0).sqrt();
        if rotation_std > DOUBTED {
            let axis = turns.eigenvectors.column(turns.eigenvalues.imax()).into_owned();
            // What else moves along when the rotation does, at the least cost.
            let along = covariance.fixed_view::<7, 3>(0, 0) * axis / variance;
            rotation_std = rotation_std.max(measured_std(problem, pose, ids, width, &along));
        }
        Self {
            residual_m: if weights > 0.0 { (squares / weights).sqrt() } else { f64::INFINITY },
            inlier_share: share,
            growth_std: covariance[(6, 6)].max(0.0).sqrt(),
            rotation_std,
            position_std: pose.scale * shifts.eigenvalues.max().max(0.0).sqrt(),
        }
    }
}

/// A standard deviation of the rotation (radians) above which the quadratic model of the cost is put
/// to the test.
const DOUBTED: f64 = 0.01;

/// The standard deviation that the cost itself shows when the pose is moved by 10° along a
/// direction (per radian). The triangles of a ball hold a rotation as if it were determined, for a
/// degree or two; turned by more, the ball costs no more than before.
fn measured_std(
    problem: &Problem<'_>,
    pose: &Sim3,
    ids: &[u32],
    width: f64,
    along: &Vector7,
) -> f64 {
    const TURN: f64 = 0.17;
    // The kernel is that many standard deviations of the noise wide.
    let variance = (width / super::NOISE_WIDTH).powi(2);
    let cost = |step: Vector7| {
        let turn = DVec3::new(step[0], step[1], step[2]);
        let shift = DVec3::new(step[3], step[4], step[5]);
        let pose = pose.then_within(turn, shift, step[6]);
        // A point without a match costs what the kernel costs far away.
        let mut cost = width * width * ids.len() as f64;
        problem.pulls(&pose, ids, width, Matching::Exact, |_, pull| {
            cost -= width * width / (1.0 + pull.squared / (width * width));
        });
        cost
    };
    let here = cost(Vector7::zeros());
    let least = cost(along * TURN).min(cost(-along * TURN));
    let increase = ((least - here) / variance).max(0.0);
    (TURN / increase.sqrt()).min(std::f64::consts::PI)
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
