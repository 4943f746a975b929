//! How well the points determine the pose: standard deviations, and what is not determined.

use nalgebra::SymmetricEigen;
use semfm_geom::math::DVec3;

use crate::correspondence::{NearestBy, Problem};
use crate::gauss_newton::Matrix7;
use crate::kernel::{WIDTH_PER_NOISE, geman_mcclure};
use crate::sim3::{Sim3, Tangent};

/// A standard deviation (radian, radius, logarithm) beyond which a direction is weak: the silhouette
/// knows more.
const WEAK: f64 = 0.015;

/// So many weak directions at most: a flat face leaves as many.
const MAX_WEAK: usize = 4;

/// A standard deviation of the rotation (radians) above which the quadratic model of the cost is
/// checked against the cost itself.
const DOUBTFUL: f64 = 0.01;

/// An eigenvalue of A below this share of the largest is not determined; rounding leaves 1e-16, real
/// views more than 1e-5.
const UNDETERMINED: f64 = 1e-7;

/// What is left over at a pose, and what that means for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Uncertainty {
    /// Root mean square of the weighted distances to the surface, metres.
    pub residual_m: f64,
    /// Weighted share of the points that lie on the model.
    pub inlier_share: f64,
    /// Of turn, shift and growth in the model's inner frame (7 × 7).
    covariance: Matrix7,
}

impl Uncertainty {
    /// Huber's sandwich covariance for M-estimators (Huber 1964), which needs no noise level. With
    /// ψ(r) = w(r) r, the kernel's influence:
    ///
    /// > cov = A⁻¹ B A⁻¹,  A = Σ ψ'(rᵢ) Jᵢ Jᵢᵀ,  B = Σ ψ(rᵢ)² Jᵢ Jᵢᵀ
    pub fn of(problem: &Problem<'_>, pose: &Sim3, ids: &[u32], width: f64) -> Self {
        let (mut a, mut b) = (Matrix7::zeros(), Matrix7::zeros());
        let (mut weights, mut squares) = (0.0, 0.0);
        problem.for_each_correspondence(pose, ids, width, NearestBy::Triangles, |c| {
            let weight = geman_mcclure(c.squared, width) * c.agreement;
            weights += geman_mcclure(c.squared, width);
            squares += geman_mcclure(c.squared, width) * c.residual.powi(2);
            let outer = c.jacobian * c.jacobian.transpose();
            // ψ' = w (1 − 3x)/(1 + x) with x = r²/width².
            let x = c.residual.powi(2) / (width * width);
            a += outer * (weight * (1.0 - 3.0 * x) / (1.0 + x));
            b += outer * (weight * c.residual).powi(2);
        });
        Self {
            residual_m: if weights > 0.0 { (squares / weights).sqrt() } else { f64::INFINITY },
            inlier_share: weights / ids.len().max(1) as f64,
            covariance: sandwich(a, b),
        }
    }

    /// Unit directions in which the pose is hardly determined, the weakest first.
    pub fn weak_directions(&self) -> Vec<Tangent> {
        let eigen = SymmetricEigen::new(self.covariance);
        let mut order: Vec<usize> =
            (0..7).filter(|&i| eigen.eigenvalues[i] > WEAK * WEAK).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        order.iter().take(MAX_WEAK).map(|&i| eigen.eigenvectors.column(i).into_owned()).collect()
    }

    /// Takes over what is known from elsewhere: the standard deviation s along a unit direction d.
    ///
    /// > C ← (I − ddᵀ) C (I − ddᵀ) + min(dᵀCd, s²) ddᵀ
    pub fn limit_std_along(&mut self, direction: &Tangent, std: f64) {
        let variance = (direction.transpose() * self.covariance * direction)[(0, 0)];
        let rest = Matrix7::identity() - direction * direction.transpose();
        self.covariance = rest * self.covariance * rest
            + direction * direction.transpose() * variance.min(std * std);
    }

    /// Covariance of turn, shift and growth in the model's inner frame.
    pub fn covariance(&self) -> &Matrix7 {
        &self.covariance
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

    /// Standard deviation of the rotation about its least certain axis, radians; where it is not
    /// small, the greater of the covariance's and the cost's own.
    pub fn rotation_std(&self, problem: &Problem<'_>, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
        let turns = SymmetricEigen::new(self.covariance.fixed_view::<3, 3>(0, 0).into_owned());
        let variance = turns.eigenvalues.max();
        let std = variance.max(0.0).sqrt();
        if std <= DOUBTFUL {
            return std;
        }
        let axis = turns.eigenvectors.column(turns.eigenvalues.imax()).into_owned();
        // What else moves along when the rotation does, at the least cost.
        let along = self.covariance.fixed_view::<7, 3>(0, 0) * axis / variance;
        std.max(measured_std(problem, pose, ids, width, &along))
    }
}

/// The standard deviation that the cost itself shows when the pose is moved by 10° along a
/// direction (per radian). The triangles of a ball resist a rotation of a degree or two as if it
/// were determined; turned by more, the ball costs no more than before.
///
/// > std = τ / √((min(cost(τ), cost(−τ)) − cost(0)) / σ²)
fn measured_std(
    problem: &Problem<'_>,
    pose: &Sim3,
    ids: &[u32],
    width: f64,
    along: &Tangent,
) -> f64 {
    /// 10°.
    const TURN: f64 = 0.17;
    let variance = (width / WIDTH_PER_NOISE).powi(2);
    let [here, forward, back] = [0.0, TURN, -TURN].map(|turn| {
        let step = along * turn;
        let turn = DVec3::new(step[0], step[1], step[2]);
        let shift = DVec3::new(step[3], step[4], step[5]);
        robust_cost(problem, &pose.moved_within(turn, shift, step[6]), ids, width)
    });
    let least = forward.min(back);
    let increase = ((least - here) / variance).max(0.0);
    (TURN / increase.sqrt()).min(std::f64::consts::PI)
}

/// Sum of the kernel's cost over the points; one without a match costs σ², what the kernel costs far
/// away.
///
/// > Σ σ² − σ²/(1 + d²/σ²)
fn robust_cost(problem: &Problem<'_>, pose: &Sim3, ids: &[u32], width: f64) -> f64 {
    let mut cost = width * width * ids.len() as f64;
    problem.for_each_correspondence(pose, ids, width, NearestBy::Triangles, |c| {
        cost -= width * width / (1.0 + c.squared / (width * width));
    });
    cost
}

/// A⁻¹BA⁻¹ by A's eigenvectors; a direction that A does not determine has a variance of at least 1 (a
/// radian, a radius of the object, a factor e), which is to say that nothing is known.
fn sandwich(a: Matrix7, b: Matrix7) -> Matrix7 {
    let eigen = SymmetricEigen::new(a);
    let largest = eigen.eigenvalues.max();
    if largest <= 0.0 {
        return Matrix7::identity();
    }
    let mut covariance = Matrix7::zeros();
    let mut inverse = Matrix7::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let outer = vector * vector.transpose();
        if *value > UNDETERMINED * largest {
            inverse += outer / *value;
        } else {
            covariance += outer;
        }
    }
    covariance + inverse * b * inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_without_evidence_is_weak_until_its_std_is_known() {
        let mut a = Matrix7::identity() * 1e6;
        a[(6, 6)] = 0.0;
        let covariance = sandwich(a, a);
        let mut uncertainty = Uncertainty { residual_m: 0.0, inlier_share: 1.0, covariance };
        let weak = uncertainty.weak_directions();
        assert_eq!(weak.len(), 1);
        assert!((weak[0][6].abs() - 1.0).abs() < 1e-12 && uncertainty.growth_std() == 1.0);
        uncertainty.limit_std_along(&weak[0], 0.01);
        assert!((uncertainty.growth_std() - 0.01).abs() < 1e-12);
        assert!(uncertainty.weak_directions().is_empty());
        assert!((uncertainty.shift_std() - 1e-3).abs() < 1e-9);
    }
}
