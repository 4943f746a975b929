//! How far to trust a transfer.
//!
//! The confidence of an answer is the probability that its vertex IoU reaches one half, given that
//! the two objects are of one kind, times the probability that they are ([`likeness`](crate::likeness)), where the
//! encoder's scale of likeness is known. For `fused` it is a logistic function of three numbers that
//! the answer itself yields ([`Evidence`]); for `semfm`, `anchored` and `wks` it is one of the
//! **agreement** of their region with a second opinion formed in another way, the transport between the
//! clouds. `nearest` and `sinkhorn` get the second opinion, a whole map of `fused`, and with it that
//! same confidence, only where [`second_opinion`](crate::TransferSettings::second_opinion) asks for
//! it; without it their confidence is the formula of `fused`, which was not fitted to their
//! answers. On 72 procedural pairs a level (seeds 3 to 5) it has AUC .96 and .90 (medium) and .90 and .83
//! (hard) for `nearest` and `sinkhorn`, and a calibration error of .09 and .04, and of .14 and .16;
//! with the second opinion .98 and .83, .97 and .94, and .06 and .04, and .11 and .12.
//!
//! `wks` between objects without features has no second opinion either: it gets the same formula over
//! the distances of wave kernel signatures, never more than .75, so that its verdict is `check` at best.
//!
//! Dirichlet energy, orthogonality, commutativity and the margin of the anchors do not predict success
//! (AUC .42–.57); they are reported, and nothing is decided by them.

use faer::{Mat, RowRef};
use semfm_geom::{ConfidenceWeights, Verdict};
use serde::{Deserialize, Serialize};

use crate::Region;
use crate::features::JointFeatures;
use crate::metrics::overlap;
use crate::nearest_rows::nearest_rows;
use crate::point_map::rows_of;

/// From this probability on the answer is accepted: it is right in more than nine of ten such cases.
pub const ACCEPT: f64 = 0.8;
/// Below this probability the answer is more likely wrong than right: no answer.
pub const CHECK: f64 = 0.5;
/// The most that an answer from geometry alone is trusted: it has nothing to be held against, so somebody
/// should look at it.
pub(crate) const MOST_WITHOUT_FEATURES: f64 = 0.75;
/// Votes that are neither clearly in nor clearly out, on the scale on which [`Region::COUNTS`] is the threshold.
const AMBIGUOUS: std::ops::Range<f64> = 0.3..0.65;
/// More ambiguity than this says nothing more.
const MOST_AMBIGUITY: f64 = 2.0;

/// The verdict on a transfer whose confidence is this probability in [0, 1].
pub fn verdict(confidence: f64) -> Verdict {
    if confidence >= ACCEPT {
        Verdict::Accept
    } else if confidence >= CHECK {
        Verdict::Check
    } else {
        Verdict::Refuse
    }
}

/// What an answer says about itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Area of the vertices whose vote is neither clearly in nor clearly out, over the area of the
    /// region, at most 2. An outline that falls on an edge between parts leaves hardly any.
    pub ambiguity: f64,
    /// How much nearer, in the features, the points of the answer are to the source's region than
    /// to the rest of the source: mean of (d_rest − d_region)/(d_rest + d_region) over them, by
    /// mass, d the squared distance to the nearest; in [−1, 1].
    pub margin: f64,
    /// IoU, by mass on the source's points, of the region with what comes back from the answer:
    /// by transport, or by the nearest points where no transport was computed (`nearest`).
    pub round_trip: f64,
    /// How alike the two objects are as a whole ([`likeness`](crate::likeness)); none for objects without
    /// features.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likeness: Option<f64>,
}

/// An answer on both clouds, as its evidence is read off it.
#[derive(Clone, Copy)]
pub(crate) struct Answer<'a> {
    /// The answer's votes (n) with the threshold at [`Region::COUNTS`].
    pub votes: &'a [f64],
    /// Areas of their vertices (n).
    pub areas: &'a [f64],
    /// Which of the source's points (M_source) are in the region.
    pub region: &'a [bool],
    /// Which of the target's points (M_target) are in the answer.
    pub answer: &'a [bool],
    /// Which of the source's points (M_source) the answer leads back to.
    pub back: &'a [bool],
    /// Masses of the source's points (M_source).
    pub source_masses: &'a [f64],
    /// Masses of the target's points (M_target).
    pub target_masses: &'a [f64],
}

impl Evidence {
    /// Reads the three numbers off an answer, whose points have these features.
    pub(crate) fn of(answer: &Answer<'_>, joint: &JointFeatures) -> Self {
        Self {
            ambiguity: ambiguity(answer.votes, answer.areas),
            margin: margin(joint, answer.region, answer.answer, answer.target_masses),
            round_trip: overlap(answer.region, answer.back, answer.source_masses),
            likeness: None,
        }
    }

    /// The probability that IoU ≥ .5, given that the objects are of one kind, for an answer of `fused`: a logistic
    /// function of the first three numbers whose coefficients belong to the features.
    pub fn probability(&self, weights: &ConfidenceWeights) -> f64 {
        weights.probability(self.ambiguity, self.margin, self.round_trip)
    }
}

/// The probability that IoU ≥ .5 by the agreement of two opinions alone, σ(7.5 agreement − 3.05): AUC
/// .84 and .93 where the three numbers of [`Evidence`] have .93 and .95, from the same pairs.
pub(crate) fn probability_by_agreement(agreement: f64) -> f64 {
    logistic(7.5 * agreement - 3.05)
}

/// σ(x) = 1/(1 + e⁻ˣ)
fn logistic(x: f64) -> f64 {
    (1.0 + (-x).exp()).recip()
}

/// Area of the ambiguous votes over that of the votes that count.
fn ambiguity(votes: &[f64], areas: &[f64]) -> f64 {
    let weighted = votes.iter().zip(areas);
    let counted = weighted.clone().filter(|(v, _)| **v >= Region::COUNTS);
    let found: f64 = counted.map(|(_, a)| a).sum();
    let ambiguous: f64 = weighted.filter(|(v, _)| AMBIGUOUS.contains(*v)).map(|(_, a)| a).sum();
    if found > 0.0 { (ambiguous / found).min(MOST_AMBIGUITY) } else { MOST_AMBIGUITY }
}

/// Mean of (d_rest − d_region)/(d_rest + d_region) over the answer's points; 0 where there are none,
/// or where the region is all of the source or nothing.
fn margin(joint: &JointFeatures, region: &[bool], answer: &[bool], masses: &[f64]) -> f64 {
    let (inside, outside) = (ids_where(region, true), ids_where(region, false));
    let answer = ids_where(answer, true);
    if inside.is_empty() || outside.is_empty() || answer.is_empty() {
        return 0.0;
    }
    let queries = rows_of(joint.target.as_ref(), &answer);
    let to_region = squares_to_nearest(&queries, &rows_of(joint.source.as_ref(), &inside));
    let to_rest = squares_to_nearest(&queries, &rows_of(joint.source.as_ref(), &outside));
    let (mut sum, mut mass) = (0.0, 0.0);
    for ((&j, region), rest) in answer.iter().zip(to_region).zip(to_rest) {
        let both = rest + region;
        sum += masses[j as usize] * if both > 0.0 { (rest - region) / both } else { 0.0 };
        mass += masses[j as usize];
    }
    sum / mass
}

fn ids_where(mask: &[bool], wanted: bool) -> Vec<u32> {
    (0..).zip(mask).filter(|(_, b)| **b == wanted).map(|(i, _)| i).collect()
}

/// Squared distance of each query to the nearest of the points, rows in one space.
fn squares_to_nearest(queries: &Mat<f64>, points: &Mat<f64>) -> Vec<f64> {
    let nearest = nearest_rows(queries.as_ref(), points.as_ref());
    let nearest = nearest
        .expect("features of a cloud are finite, and there is a point inside and one outside");
    let rows = nearest.iter().enumerate();
    rows.map(|(q, &p)| square(queries.row(q), points.row(p as usize))).collect()
}

fn square(a: RowRef<'_, f64>, b: RowRef<'_, f64>) -> f64 {
    a.iter().zip(b.iter()).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn verdicts_follow_the_bands() {
        use Verdict::{Accept, Check, Refuse};
        assert_eq!(
            [0.0, 0.49, 0.5, 0.79, 0.8, 1.0].map(verdict),
            [Refuse, Refuse, Check, Check, Accept, Accept]
        );
    }

    #[test]
    fn better_evidence_is_more_probable_and_none_is_refused() {
        let weights = ConfidenceWeights::default();
        let sure = Evidence { ambiguity: 0.05, margin: 0.4, round_trip: 0.9, likeness: None };
        assert_eq!(verdict(sure.probability(&weights)), Verdict::Accept);
        for worse in [
            Evidence { ambiguity: 1.0, ..sure },
            Evidence { margin: 0.0, ..sure },
            Evidence { round_trip: 0.3, ..sure },
        ] {
            assert!(worse.probability(&weights) < sure.probability(&weights));
        }
        let lost =
            Evidence { ambiguity: MOST_AMBIGUITY, margin: -0.1, round_trip: 0.0, likeness: None };
        assert_eq!(verdict(lost.probability(&weights)), Verdict::Refuse);
        assert!(probability_by_agreement(0.9) > 0.9 && probability_by_agreement(0.2) < 0.5);
    }

    #[test]
    fn the_margin_is_for_points_that_resemble_the_region_and_against_the_rest() {
        let joint = JointFeatures {
            source: mat![[0.0], [0.1], [1.0], [1.1]],
            target: mat![[0.05], [1.05]],
        };
        let (region, masses) = ([true, true, false, false], [0.5; 2]);
        assert!(margin(&joint, &region, &[true, false], &masses) > 0.9);
        assert!(margin(&joint, &region, &[false, true], &masses) < -0.9);
        assert!(margin(&joint, &region, &[true, true], &masses).abs() < 1e-9);
        assert_eq!(margin(&joint, &region, &[false, false], &masses), 0.0);
        assert_eq!(margin(&joint, &[true; 4], &[true, true], &masses), 0.0);
    }
}
