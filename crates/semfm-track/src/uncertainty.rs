//! The covariance of a pose.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use semfm_align::Sim3;

use crate::depth_view::{DepthView, Pixel};
use crate::model::TrackModel;
use crate::motion::{Matrix6, Twist, matrix, moved};
use crate::outline::Shown;
use crate::register::{Beside, OutlineLine, Registration};

/// What errors of neighbouring pixels, of the camera and of the mesh add, which the normal equations take for independent:
/// factor of the covariance. With 4, of 3,575 poses of eight real meshes 94 % lie within the bound of 95 % (`bench/README.md`);
/// by the median of the errors 1.5 would do, which leaves the tail of those that slide along themselves untold.
const INFLATION: f64 = 4.0;

/// A direction is uncertain by half a turn at most: more is not known of any.
const MOST: f64 = std::f64::consts::PI;

/// A turn about the least certain axis at which the image is asked itself, radians (10°): the facets of a round wall resist
/// a degree or two as a handle does.
const TRIAL_TURN: f64 = 0.17;

/// A standard deviation of the rotation (radians) above which the image is asked.
const DOUBTFUL: f64 = 0.003;

/// The covariance of shift and turn about the object's middle, along the camera's axes (6 × 6, metres and radians), from the
/// information of the last step:
///
/// > C = f (Σ w Jᵀ J / σ²)⁻¹
///
/// with turns measured in radii while it is inverted, so that weak directions are told from strong ones in one unit, and
/// none is more uncertain than half a turn. Where the rotation is not certain, it is turned by 10° either way, and what the
/// image objects decides, if that is less:
///
/// > std = τ / √(min(χ²(τ), χ²(−τ)) − χ²(0))
pub(crate) fn covariance(
    model: &TrackModel,
    view: &DepthView<'_>,
    shown: &Shown,
    found: &Registration,
) -> Matrix6 {
    let mut covariance = inverted(&(found.information / INFLATION), model.radius);
    let turns = SymmetricEigen::new(covariance.fixed_view::<3, 3>(3, 3).into_owned());
    let variance = turns.eigenvalues.max();
    if variance.sqrt() <= DOUBTFUL {
        return covariance;
    }
    let axis: Vector3<f64> = turns.eigenvectors.column(turns.eigenvalues.imax()).into_owned();
    // What moves along with a turn about this axis at the least cost.
    let along: Twist = covariance.fixed_view::<6, 3>(0, 3) * axis / variance;
    let cost = |turn: f64| {
        truncated_cost(model, view, shown, &moved(&found.pose, &(along * turn)), found.noise)
    };
    let here = cost(0.0);
    let increase = (cost(TRIAL_TURN).min(cost(-TRIAL_TURN)) - here).max(0.0) / INFLATION;
    let measured = (TRIAL_TURN / increase.sqrt()).min(MOST).powi(2);
    if measured > variance {
        covariance += along * along.transpose() * (measured - variance);
    }
    covariance
}

/// The covariance of a pose that was not measured again: shift and turn walk at random, standard deviations per frame.
pub(crate) fn after_a_frame(covariance: &Matrix6) -> Matrix6 {
    /// Metres and radians that an object out of sight moves from one frame to the next.
    const WALK: [f64; 2] = [0.005, 0.03];
    let mut grown = *covariance;
    for k in 0..6 {
        let most: f64 = if k < 3 { 10.0 } else { MOST };
        grown[(k, k)] += WALK[k / 3].powi(2);
        // Row and column together, so that it stays a covariance.
        let shrink = (most / grown[(k, k)].sqrt()).min(1.0);
        grown.row_mut(k).scale_mut(shrink);
        grown.column_mut(k).scale_mut(shrink);
    }
    grown
}

fn inverted(information: &Matrix6, radius: f64) -> Matrix6 {
    let mut units = Matrix6::identity();
    (3..6).for_each(|k| units[(k, k)] = 1.0 / radius);
    let eigen = SymmetricEigen::new(units * information * units);
    let least = 1.0 / (MOST * radius).powi(2);
    let mut inverse = Matrix6::zeros();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        inverse += vector * vector.transpose() / value.max(least);
    }
    units * inverse * units
}

/// Sum over what a pose shows of how much the image objects: r²/σ² of a sample up to that of one that does not match, and
/// as much for a point of the outline without a jump.
fn truncated_cost(
    model: &TrackModel,
    view: &DepthView<'_>,
    shown: &Shown,
    pose: &Sim3,
    noise: f64,
) -> f64 {
    const MOST_COST: f64 = 16.0;
    let turn = matrix(pose);
    let of_sample = |&id: &u32| {
        let sample = &model.samples[id as usize];
        let place = turn * sample.point + pose.translation;
        let normal = turn * sample.normal;
        let at = view.project(place)?;
        match view.at(at) {
            // What hides it says nothing.
            Pixel::Depth(z) if z > place.z - 10.0 * noise => {
                let distance = normal.dot(view.point(at, z) - place) / noise;
                Some((distance * distance).min(MOST_COST))
            }
            _ => None,
        }
    };
    let of_outline = |rim: &crate::outline::OutlinePoint| {
        let line = OutlineLine::new(view, pose, rim)?;
        match line.jump(view, 4, 8.0 * noise) {
            Some(jump) => Some((jump * jump).min(MOST_COST)),
            None if line.beside(view, -4.0, 8.0 * noise) == Beside::Ground => Some(MOST_COST),
            None => None,
        }
    };
    let samples: f64 = shown.samples.iter().filter_map(of_sample).sum();
    samples + shown.outline.iter().filter_map(of_outline).sum::<f64>()
}

/// The greatest standard deviation of a block of a covariance.
pub(crate) fn greatest_std(block: Matrix3<f64>) -> f64 {
    SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainty_grows_up_to_half_a_turn_and_stays_a_covariance() {
        let mut covariance = Matrix6::identity() * 1e-6;
        covariance[(3, 4)] = 9e-7;
        covariance[(4, 3)] = 9e-7;
        for _ in 0..20_000 {
            covariance = after_a_frame(&covariance);
            let eigen = SymmetricEigen::new(covariance);
            assert!(eigen.eigenvalues.min() > -1e-12, "{}", eigen.eigenvalues);
        }
        for k in 3..6 {
            assert!((covariance[(k, k)].sqrt() - MOST).abs() < 1e-6, "{}", covariance[(k, k)]);
        }
        // Nothing is known of any direction.
        let unknown = inverted(&Matrix6::zeros(), 0.1);
        assert!((3..6).all(|k| unknown[(k, k)].sqrt() <= MOST * (1.0 + 1e-12)));
    }
}
