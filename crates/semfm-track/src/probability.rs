//! How likely a pose is right, from what an image says for and against it.

use crate::evidence::Evidence;

/// Coefficients of a logistic function of [`features`].
///
/// The event is that the surface stands within a tenth of its diameter of where the pose puts it (in the mean, each point
/// to the nearest: symmetric objects have many right poses).
const COEFFICIENTS: [f64; 5] = [2.0, -12.0, 1.5, 6.0, -0.3];

/// Fewer samples than this, seen at their depth, say nothing.
pub(crate) const LEAST_SEEN: usize = 20;

/// 1, the share of the samples that were looked through, the logarithm of the share that was seen, the share of the outline
/// where the depth jumps, less ½, and the residual in hundredths of the diameter.
fn features(evidence: &Evidence, diameter: f64) -> [f64; 5] {
    [
        1.0,
        evidence.through_share(),
        evidence.visible_share().max(1e-3).ln(),
        evidence.outline_share() - 0.5,
        100.0 * evidence.residual / diameter,
    ]
}

/// The probability that a pose of an object of a diameter (metres) is right.
pub(crate) fn probability(evidence: &Evidence, diameter: f64) -> f64 {
    if evidence.n_here < LEAST_SEEN {
        return 0.0;
    }
    let score: f64 =
        features(evidence, diameter).iter().zip(COEFFICIENTS).map(|(x, c)| x * c).sum();
    1.0 / (1.0 + (-score).exp())
}
