//! One answer out of several: the same region demonstrated on several objects, each carried to one target.
//!
//! Each answer says how likely it is right by itself ([`confidence`](crate::confidence)); beside that stands what
//! the others say. Demonstrations that went different ways and arrive at one place are hardly all wrong, and one
//! that arrives elsewhere most likely is. So the vote of a vertex is the mean of the answers' votes, weighted by
//! trust,
//!
//! V = Σᵢ tᵢ vᵢ / Σᵢ tᵢ, tᵢ = (pᵢ · (ε + aᵢ))^γ,
//!
//! pᵢ the probability that answer i is right, aᵢ = Σⱼ pⱼ IoU(i, j) / Σⱼ pⱼ over the other answers j: a weighted
//! consensus of segmentations (compare STAPLE, Warfield, Zou & Wells 2004, which has the labels alone and so
//! estimates how good each is from the agreement; here each brings a probability of its own).

use semfm_geom::Verdict;
use serde::{Deserialize, Serialize};

use crate::confidence::verdict;
use crate::hypotheses::{Hypothesis, hypotheses, is_connected};
use crate::matching::onto_original;
use crate::methods::{at_threshold, mask};
use crate::metrics::overlap;
use crate::{Error, PreparedObject, Region, Result, Transfer};

/// How answers are fused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FusionSettings {
    /// γ: how much less the less trusted answers count. Mean IoU of five demonstrations on real objects (built-in
    /// encoder, threshold .5): .786 at ½, .783 at 1, .778 at 2, .770 at 4, and .749 for the most confident alone.
    pub sharpness: f64,
    /// ε: what an answer still counts with which no other agrees. Between .03 and 10, where agreement decides
    /// nothing, the means differ by .006; a single stray one is outvoted only where ε is small.
    pub least_agreement: f64,
    /// Mean votes from here on count, where there are several answers; one keeps its own threshold. .45 costs .02
    /// IoU, .5 gives .783, .55 .794 and .6 .777: what only some answers include is more often wrong than right.
    pub threshold: f64,
    /// Most places that are listed.
    pub n_hypotheses: usize,
}

impl Default for FusionSettings {
    fn default() -> Self {
        Self { sharpness: 1.0, least_agreement: 0.1, threshold: 0.55, n_hypotheses: 3 }
    }
}

/// One demonstration's answer.
#[derive(Clone, Copy, Debug)]
pub struct Answer<'a> {
    /// The demonstrated object.
    pub source: &'a PreparedObject,
    /// The region on its mesh as read.
    pub region: &'a Region,
    /// What was found on the target.
    pub transfer: &'a Transfer,
}

/// How far one answer was trusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trust {
    /// Its share of the fused vote; the shares sum to 1.
    pub share: f64,
    /// Mean IoU (by area) of its region with those of the others, weighted by their confidence; none where
    /// it is alone.
    pub agreement: Option<f64>,
    /// IoU (by area) of its region with the fused one.
    pub iou_with_fused: f64,
}

/// The fused answer.
#[derive(Clone, Debug)]
pub struct FusedAnswer {
    /// The region on the target, the threshold at [`Region::COUNTS`].
    pub region: Region,
    /// The probability that its IoU with the truth is at least one half.
    pub confidence: f64,
    /// What to do with it.
    pub verdict: Verdict,
    /// Where it may belong, by falling probability.
    pub hypotheses: Vec<Hypothesis>,
    /// Mean IoU of the answers with the fused region, weighted by their shares: 1 where all say the same.
    pub agreement: f64,
    /// The numbers behind the confidence.
    pub evidence: FusionEvidence,
    /// One for each answer, in their order.
    pub trusts: Vec<Trust>,
}

/// What a fused answer says about itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FusionEvidence {
    /// Answers that were fused.
    pub n: usize,
    /// The largest probability of a single answer.
    pub best: f64,
    /// Mean probability of the answers, by their shares.
    pub trusted: f64,
    /// Mean IoU of the answers with the fused one, by their shares.
    pub agreement: f64,
    /// Mean IoU of the answers with each other, by the products of their probabilities; 1 for one alone.
    pub pairwise: f64,
}

/// Fuses the answers of several demonstrations on one target. Their order does not matter, up to rounding.
///
/// # Errors
/// [`Error::OutOfRange`] for no answers and impossible settings, [`Error::Length`] for an answer on another mesh.
pub fn fuse(
    target: &PreparedObject,
    answers: &[Answer<'_>],
    settings: &FusionSettings,
) -> Result<FusedAnswer> {
    settings.check()?;
    if answers.is_empty() {
        return Error::out_of_range("answers", "at least one to be fused", "none");
    }
    let shape = target.shape();
    let (mesh, areas) = (shape.mesh(), &shape.basis().mass);
    let votes = answers.iter().map(|answer| votes_on_working(target, answer));
    let votes = votes.collect::<Result<Vec<_>>>()?; // (answers × n)
    let masks: Vec<Vec<bool>> = votes.iter().map(|votes| mask(votes)).collect();
    let probabilities: Vec<f64> = answers.iter().map(|answer| answer.transfer.confidence).collect();
    let overlaps = Overlaps::new(&masks, areas);
    let agreements: Vec<Option<f64>> =
        (0..answers.len()).map(|i| overlaps.with_others(i, &probabilities)).collect();
    let shares = settings.shares(&probabilities, &agreements);
    let mean: Vec<f64> = (0..areas.len())
        .map(|v| votes.iter().zip(&shares).map(|(votes, share)| share * votes[v]).sum())
        .collect();
    let threshold = if answers.len() == 1 { Region::COUNTS } else { settings.threshold };
    let fused = at_threshold(&mean, threshold);
    let region = onto_original(shape, &fused)?;
    let inside = mask(&fused);
    let trusts: Vec<Trust> = masks
        .iter()
        .zip(&shares)
        .zip(agreements)
        .map(|((own, &share), agreement)| Trust {
            share,
            agreement,
            iou_with_fused: overlap(own, &inside, areas),
        })
        .collect();
    let evidence = FusionEvidence {
        n: answers.len(),
        best: probabilities.iter().copied().fold(0.0, f64::max),
        trusted: shares.iter().zip(&probabilities).map(|(share, p)| share * p).sum(),
        agreement: trusts.iter().map(|trust| trust.share * trust.iou_with_fused).sum(),
        pairwise: overlaps.mean(&probabilities),
    };
    let confidence = if region.is_empty() { 0.0 } else { evidence.probability() };
    let connected: f64 = answers
        .iter()
        .zip(&shares)
        .map(|(answer, share)| if is_connected_on(answer) { *share } else { 0.0 })
        .sum();
    let places = hypotheses(mesh, &fused, areas, connected >= 0.5, settings.n_hypotheses);
    let places = places.into_iter().map(|place| {
        let region = onto_original(shape, &place.weights)?;
        Ok(Hypothesis { region, probability: place.probability })
    });
    Ok(FusedAnswer {
        region,
        confidence,
        verdict: verdict(confidence),
        hypotheses: places.collect::<Result<Vec<_>>>()?,
        agreement: evidence.agreement,
        evidence,
        trusts,
    })
}

impl FusionSettings {
    fn check(&self) -> Result<()> {
        let Self { sharpness, least_agreement, threshold, n_hypotheses } = *self;
        if !(sharpness.is_finite() && sharpness >= 0.0) {
            return Error::out_of_range(
                "sharpness of the fusion",
                "a number of at least 0",
                sharpness,
            );
        }
        if !(least_agreement > 0.0 && least_agreement.is_finite()) {
            let what = "least agreement of the fusion";
            return Error::out_of_range(what, "a number above 0", least_agreement);
        }
        if !(threshold > 0.0 && threshold < 1.0) {
            let what = "threshold of the fusion";
            return Error::out_of_range(what, "a number between 0 and 1", threshold);
        }
        if n_hypotheses == 0 {
            return Error::out_of_range("hypotheses of the fusion", "at least 1", n_hypotheses);
        }
        Ok(())
    }

    /// tᵢ / Σ tⱼ with tᵢ = (pᵢ · (ε + aᵢ))^γ; equal shares where nothing is trusted at all.
    fn shares(&self, probabilities: &[f64], agreements: &[Option<f64>]) -> Vec<f64> {
        let trusts: Vec<f64> = probabilities
            .iter()
            .zip(agreements)
            .map(|(p, agreement)| {
                (p * (self.least_agreement + agreement.unwrap_or(1.0))).powf(self.sharpness)
            })
            .collect();
        let total: f64 = trusts.iter().sum();
        match total > 0.0 {
            true => trusts.iter().map(|trust| trust / total).collect(),
            false => vec![1.0 / trusts.len() as f64; trusts.len()],
        }
    }
}

/// IoU by area of every two answers.
struct Overlaps {
    n: usize,
    /// n × n, row-major, 1 on the diagonal.
    values: Vec<f64>,
}

impl Overlaps {
    fn new(masks: &[Vec<bool>], areas: &[f64]) -> Self {
        let n = masks.len();
        let mut values = vec![1.0; n * n];
        for i in 0..n {
            for j in 0..i {
                let value = overlap(&masks[i], &masks[j], areas);
                (values[i * n + j], values[j * n + i]) = (value, value);
            }
        }
        Self { n, values }
    }

    /// aᵢ = Σⱼ pⱼ IoU(i, j) / Σⱼ pⱼ over the others; none where there are none.
    fn with_others(&self, i: usize, probabilities: &[f64]) -> Option<f64> {
        let others = (0..self.n).filter(|&j| j != i);
        let (mut sum, mut weight) = (0.0, 0.0);
        for j in others {
            let p = probabilities[j].max(LEAST_PROBABILITY);
            sum += p * self.values[i * self.n + j];
            weight += p;
        }
        (weight > 0.0).then(|| sum / weight)
    }

    /// Σ pᵢ pⱼ IoU(i, j) / Σ pᵢ pⱼ over the pairs; 1 where there are none.
    fn mean(&self, probabilities: &[f64]) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in 0..self.n {
            for j in 0..i {
                let p = [i, j].map(|k| probabilities[k].max(LEAST_PROBABILITY));
                sum += p[0] * p[1] * self.values[i * self.n + j];
                weight += p[0] * p[1];
            }
        }
        if weight > 0.0 { sum / weight } else { 1.0 }
    }
}

/// Answers that are refused altogether still say where they are.
const LEAST_PROBABILITY: f64 = 1e-3;

/// An answer's votes on the target's working vertices (n).
fn votes_on_working(target: &PreparedObject, answer: &Answer<'_>) -> Result<Vec<f64>> {
    let weights = answer.transfer.weights();
    let n_vertices = target.shape().original().n_vertices();
    Error::length("weights of an answer on the target", n_vertices, weights.len())?;
    let of_working = &target.shape().working().to_original;
    Ok(of_working.iter().map(|&v| weights[v as usize]).collect())
}

/// Whether the region of a demonstration is in one piece.
fn is_connected_on(answer: &Answer<'_>) -> bool {
    let (source, shape) = (answer.source, answer.source.shape());
    let inside = source.region_on_working(&answer.region.mask());
    is_connected(shape.mesh(), &inside, &shape.basis().mass)
}

/// Coefficients of the fused confidence: constant, of the log-odds of the trusted probability, of the agreement in
/// pairs. A logistic regression (ridge 1e-3 on standardised inputs) on 300 memories of two, three and five
/// demonstrations of real objects (built-in encoder), fitted on one half of the targets and read on the other: AUC .94,
/// calibration error .03, .97 of the accepted are right. The largest single probability has .92, .06 and .96.
const CONSTANT: f64 = -1.01;
const OF_TRUSTED: f64 = 2.03;
const OF_PAIRWISE: f64 = 1.59;

/// Probabilities are kept this far from 0 and 1 before their log-odds are taken.
const LEAST_DOUBT: f64 = 1e-3;

impl FusionEvidence {
    /// The probability that the fused answer is right: that of the answer itself where there is one, else
    ///
    /// σ(c + a · ln(p/(1 − p)) + b · r)
    ///
    /// with p the mean probability of the answers by their shares and r their agreement in pairs.
    pub fn probability(&self) -> f64 {
        if self.n == 1 {
            return self.best;
        }
        let p = self.trusted.clamp(LEAST_DOUBT, 1.0 - LEAST_DOUBT);
        let log_odds = CONSTANT + OF_TRUSTED * (p / (1.0 - p)).ln() + OF_PAIRWISE * self.pairwise;
        (1.0 + (-log_odds).exp()).recip()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use semfm_geom::Task;

    use super::*;
    use crate::test_objects::{blob, cloud, shape};
    use crate::{TransferSettings, transfer};

    fn object(stretch: f64) -> PreparedObject {
        let mesh = blob(stretch);
        let (shape, cloud) = (Arc::new(shape(&mesh, 30)), Arc::new(cloud(&mesh, stretch, 0.3)));
        PreparedObject::new(shape, cloud, &Task::default()).unwrap()
    }

    /// One end of a blob.
    fn tip(object: &PreparedObject, sign: f64) -> Region {
        let vertices = object.shape().original().vertices();
        Region::from_mask(&vertices.iter().map(|p| sign * p.x > 0.6).collect::<Vec<_>>())
    }

    /// A target, and a transfer to it that others are made from.
    struct Case {
        source: PreparedObject,
        target: PreparedObject,
        region: Region,
        transfer: Transfer,
    }

    fn case() -> Case {
        let (source, target) = (object(1.0), object(1.4));
        let region = tip(&source, 1.0);
        let settings = TransferSettings::default();
        let transfer = transfer(&source, &target, &region, &settings, &Task::default()).unwrap();
        Case { source, target, region, transfer }
    }

    impl Case {
        /// The same transfer with another answer.
        fn saying(&self, region: &Region, confidence: f64) -> Transfer {
            Transfer { region: region.clone(), confidence, ..self.transfer.clone() }
        }

        fn fuse(&self, transfers: &[Transfer]) -> FusedAnswer {
            let answer = |transfer| Answer { source: &self.source, region: &self.region, transfer };
            let answers: Vec<Answer<'_>> = transfers.iter().map(answer).collect();
            fuse(&self.target, &answers, &FusionSettings::default()).unwrap()
        }
    }

    #[test]
    fn one_answer_stays_what_it_was() {
        let case = case();
        let fused = case.fuse(std::slice::from_ref(&case.transfer));
        assert_eq!(fused.region.mask(), case.transfer.region.mask());
        assert_eq!(fused.confidence, case.transfer.confidence);
        assert_eq!((fused.agreement, fused.trusts[0].share), (1.0, 1.0));
        assert_eq!(fused.trusts[0].agreement, None);
    }

    #[test]
    fn answers_that_agree_are_worth_more_than_one_and_those_that_do_not_less() {
        let case = case();
        let (right, wrong) = (tip(&case.target, 1.0), tip(&case.target, -1.0));
        let alone = case.fuse(&[case.saying(&right, 0.7)]).confidence;
        let together = case.fuse(&vec![case.saying(&right, 0.7); 3]);
        assert_eq!((together.region.mask(), together.agreement), (right.mask(), 1.0));
        assert!(together.confidence > alone, "{} and {alone}", together.confidence);
        let apart = case.fuse(&[case.saying(&right, 0.7), case.saying(&wrong, 0.7)]);
        assert!(apart.confidence < alone, "{} and {alone}", apart.confidence);
        assert!(apart.agreement < 0.6, "{}", apart.agreement);
    }

    #[test]
    fn the_order_of_the_answers_does_not_matter() {
        let case = case();
        let said = [(1.0, 0.9), (-1.0, 0.4), (1.0, 0.6)];
        let transfers = said.map(|(sign, p)| case.saying(&tip(&case.target, sign), p));
        let mut backwards = transfers.to_vec();
        backwards.reverse();
        let (a, b) = (case.fuse(&transfers), case.fuse(&backwards));
        assert_eq!(a.region.mask(), b.region.mask());
        assert!((a.confidence - b.confidence).abs() < 1e-12);
        for (trust, same) in a.trusts.iter().zip(b.trusts.iter().rev()) {
            assert!((trust.share - same.share).abs() < 1e-12);
        }
    }

    #[test]
    fn one_that_strays_is_outvoted_however_sure_it_is() {
        let case = case();
        let (right, wrong) = (tip(&case.target, 1.0), tip(&case.target, -1.0));
        let mut transfers = vec![case.saying(&right, 0.8); 3];
        transfers.push(case.saying(&wrong, 0.95));
        let fused = case.fuse(&transfers);
        assert_eq!(fused.region.mask(), right.mask());
        assert!(fused.trusts[3].share < 0.1, "{:?}", fused.trusts[3]);
        // Two places, of which the likelier is first.
        let (first, second) = (case.saying(&right, 0.9), case.saying(&wrong, 0.85));
        let torn = case.fuse(&[first, second]);
        let areas = case.target.shape().original().vertex_areas();
        let iou = overlap(&torn.hypotheses[0].region.mask(), &right.mask(), &areas);
        assert!(iou > 0.5, "{iou}");
    }

    #[test]
    fn nothing_to_fuse_and_impossible_settings_are_refused() {
        let case = case();
        let settings = FusionSettings::default();
        assert!(fuse(&case.target, &[], &settings).is_err());
        let (source, region) = (&case.source, &case.region);
        let answer = Answer { source, region, transfer: &case.transfer };
        for settings in [
            FusionSettings { sharpness: -1.0, ..settings },
            FusionSettings { least_agreement: 0.0, ..settings },
            FusionSettings { threshold: 1.0, ..settings },
            FusionSettings { n_hypotheses: 0, ..settings },
        ] {
            let error = fuse(&case.target, &[answer], &settings).unwrap_err().to_string();
            assert!(error.contains("of the fusion"), "{error}");
        }
        let elsewhere = Transfer { region: Region::from_mask(&[true; 3]), ..case.transfer.clone() };
        let answer = Answer { transfer: &elsewhere, ..answer };
        assert!(matches!(fuse(&case.target, &[answer], &settings), Err(Error::Length { .. })));
        // Refused by all: still no panic, and no answer.
        let nowhere = Region::from_mask(&vec![false; case.transfer.region.n_vertices()]);
        let fused = case.fuse(&vec![case.saying(&nowhere, 0.0); 2]);
        assert_eq!((fused.confidence, fused.verdict), (0.0, Verdict::Refuse));
        assert!(fused.region.is_empty() && fused.hypotheses.is_empty());
    }
}
