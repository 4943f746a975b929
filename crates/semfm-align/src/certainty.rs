//! How well the points determine the pose: noise, standard deviations, and what is not determined.

use nalgebra::SymmetricEigen;
use semfm_geom::math::DVec3;

use crate::sim3::Sim3;
use crate::solve::{Matching, Matrix7, Problem, Pull, Vector7, geman_mcclure};

/// What is left over at a pose, and what that means for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Certainty {
    /// Root mean square of the weighted distances to the surface, metres.
    pub residual_m: f64,
    /// Weighted share of the points that lie on the model.
    pub inlier_share: f64,
    /// Of turn, shift and growth in the model's inner frame (7 × 7).
    covariance: Matrix7,
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
        Self {
            residual_m: if weights > 0.0 { (squares / weights).sqrt() } else { f64::INFINITY },
            inlier_share: weights / ids.len().max(1) as f64,
            covariance: sandwich(a, b),
        }
    }

    /// Unit directions in which the pose is hardly determined, the weakest first; four at most: a
    /// flat face leaves as many.
    pub fn weak(&self) -> Vec<Vector7> {
        let eigen = SymmetricEigen::new(self.covariance);
        let mut order: Vec<usize> =
            (0..7).filter(|&i| eigen.eigenvalues[i] > WEAK * WEAK).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        order.iter().take(4).map(|&i| eigen.eigenvectors.column(i).into_owned()).collect()
    }

    /// Takes over what is known from elsewhere: the standard deviation along a unit direction.
    pub fn know(&mut self, direction: &Vector7, std: f64) {
        let variance = (direction.transpose() * self.covariance * direction)[(0, 0)];
        let rest = Matrix7::identity() - direction * direction.transpose();
        self.covariance = rest * self.covariance * rest
            + direction * direction.transpose() * variance.min(std * std);
    }

    /// Standard deviation of the scale relative to itself.
    pub fn growth_std(&self) -> f64 {
        self.covariance[(6, 6)].max(0.0).sqrt()
    }

    /// Standard deviation of the position in its least certain direction, in radii.
    pub fn shift_std(&self) -> f64 {
        let block = self.covariance.fixed_view::<3, 3>(3, 3).into_owned();
        SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
    }

    /// Standard deviation of the rotation about its least certain axis, radians; put to the test
    /// where it is not small.
    pub fn rotation_std(&self, problem: &Problem<'_>, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        let turns = SymmetricEigen::new(self.covariance.fixed_view::<3, 3>(0, 0).into_owned());
        let variance = turns.eigenvalues.max();
        let told = variance.max(0.0).sqrt();
        if told <= DOUBTED {
            return told;
        }
        let axis = turns.eigenvectors.column(turns.eigenvalues.imax()).into_owned();
        // What else moves along when the rotation does, at the least cost.
        let along = self.covariance.fixed_view::<7, 3>(0, 0) * axis / variance;
        told.max(measured_std(problem, pose, ids, width, &along))
    }
}

/// A standard deviation (radian, radius, logarithm) beyond which a direction is weak: the silhouette
/// knows more.
const WEAK: f64 = 0.015;

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
    let variance = (width / crate::align::NOISE_WIDTH).powi(2);
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
pub(crate) fn noise(pulls: &[Pull], width: f64) -> Option<f64> {
    let near = pulls.iter().filter(|pull| pull.squared < width * width);
    let mut residuals: Vec<f64> = near.map(|pull| pull.residual.abs()).collect();
    let middle = residuals.len() / 2;
    (residuals.len() >= 7)
        .then(|| 1.4826 * *residuals.select_nth_unstable_by(middle, f64::total_cmp).1)
}
