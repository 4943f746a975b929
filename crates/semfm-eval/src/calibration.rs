//! Calibration of a method's confidence: does it tell right answers from wrong ones, and is it a
//! probability?

use semfm::Verdict;
use serde::{Deserialize, Serialize};

use crate::row::Row;

/// An answer of this IoU is right.
pub const RIGHT: f64 = 0.5;
/// Bins of the reliability diagram.
const BINS: usize = 10;

/// Calibration of one method's confidence, over all its scored rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Name of the method.
    pub method: String,
    /// Rows with a confidence and a score.
    pub n: usize,
    /// Share of right answers (IoU ≥ .5).
    pub right: f64,
    /// Chance that a right answer has more confidence than a wrong one (ties count half); none where
    /// all are right or all are wrong.
    pub auc: Option<f64>,
    /// Expected calibration error: mean distance, over the bins and by their counts, between mean
    /// confidence and share of right answers.
    pub calibration_error: f64,
    /// Reliability by confidence, in tenths; empty bins are left out.
    pub bins: Vec<ReliabilityBin>,
    /// How each verdict did.
    pub verdicts: Vec<VerdictScore>,
}

/// The answers with a confidence in [low, high).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// From here.
    pub low: f64,
    /// To here; the last bin holds its end.
    pub high: f64,
    /// Answers.
    pub n: usize,
    /// Their mean confidence.
    pub mean_confidence: f64,
    /// Share of them that is right.
    pub right: f64,
    /// Their mean IoU.
    pub mean_iou: f64,
}

/// The answers with one verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VerdictScore {
    /// The verdict.
    pub verdict: Verdict,
    /// Answers.
    pub n: usize,
    /// Share of them that is right.
    pub right: f64,
    /// Their mean IoU.
    pub mean_iou: f64,
}

/// One answer with a confidence and a score.
#[derive(Clone, Copy)]
struct Answer {
    confidence: f64,
    iou: f64,
    verdict: Option<Verdict>,
}

/// What some answers have in common.
struct Scores {
    n: usize,
    right: f64,
    mean_iou: f64,
}

impl Calibration {
    /// Calibration of the confidence in `rows`, all of one method; none where none has one.
    pub fn of<'a>(method: &str, rows: impl Iterator<Item = &'a Row>) -> Option<Self> {
        let answers: Vec<Answer> = rows.filter_map(Answer::of).collect();
        if answers.is_empty() {
            return None;
        }
        let bins: Vec<ReliabilityBin> =
            (0..BINS).filter_map(|number| ReliabilityBin::of(&answers, number)).collect();
        let n = answers.len() as f64;
        // ECE = Σ_b n_b / n · |mean confidence of b − share of right answers in b|
        let gaps = bins.iter().map(|bin| bin.n as f64 * (bin.mean_confidence - bin.right).abs());
        let calibration_error = gaps.sum::<f64>() / n;
        let verdicts = [Verdict::Accept, Verdict::Check, Verdict::Refuse];
        Some(Self {
            method: method.into(),
            n: answers.len(),
            right: answers.iter().filter(|answer| answer.iou >= RIGHT).count() as f64 / n,
            auc: auc(&answers),
            calibration_error,
            verdicts: verdicts.into_iter().filter_map(|v| VerdictScore::of(&answers, v)).collect(),
            bins,
        })
    }
}

impl Answer {
    fn of(row: &Row) -> Option<Self> {
        Some(Self { confidence: row.confidence?, iou: row.iou?, verdict: row.verdict })
    }

    /// Number of the bin that its confidence is in; the last one holds 1.
    fn bin(&self) -> usize {
        ((self.confidence * BINS as f64) as usize).min(BINS - 1)
    }
}

impl Scores {
    /// None for nothing.
    fn of(answers: &[Answer]) -> Option<Self> {
        let n = answers.len() as f64;
        let right = answers.iter().filter(|answer| answer.iou >= RIGHT).count() as f64;
        let total = answers.iter().map(|answer| answer.iou).sum::<f64>();
        (n > 0.0).then(|| Self { n: answers.len(), right: right / n, mean_iou: total / n })
    }
}

impl ReliabilityBin {
    fn of(answers: &[Answer], number: usize) -> Option<Self> {
        let inside: Vec<Answer> = answers.iter().copied().filter(|a| a.bin() == number).collect();
        let Scores { n, right, mean_iou } = Scores::of(&inside)?;
        let total = inside.iter().map(|answer| answer.confidence).sum::<f64>();
        Some(Self {
            low: number as f64 / BINS as f64,
            high: (number + 1) as f64 / BINS as f64,
            n,
            mean_confidence: total / n as f64,
            right,
            mean_iou,
        })
    }
}

impl VerdictScore {
    fn of(answers: &[Answer], verdict: Verdict) -> Option<Self> {
        let own: Vec<Answer> =
            answers.iter().copied().filter(|answer| answer.verdict == Some(verdict)).collect();
        let Scores { n, right, mean_iou } = Scores::of(&own)?;
        Some(Self { verdict, n, right, mean_iou })
    }
}

/// AUC = U / (n_r n_w), with Mann and Whitney's U = Σ over right r and wrong w of
/// [c_r > c_w] + ½ [c_r = c_w], c the confidence.
fn auc(answers: &[Answer]) -> Option<f64> {
    let (right, wrong): (Vec<Answer>, Vec<Answer>) =
        answers.iter().copied().partition(|answer: &Answer| answer.iou >= RIGHT);
    if right.is_empty() || wrong.is_empty() {
        return None;
    }
    let mut u = 0.0;
    for r in &right {
        for w in &wrong {
            if r.confidence > w.confidence {
                u += 1.0;
            } else if r.confidence == w.confidence {
                u += 0.5;
            }
        }
    }
    Some(u / (right.len() * wrong.len()) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(confidence: f64, iou: f64) -> Row {
        Row { confidence: Some(confidence), iou: Some(iou), ..Row::default() }
    }

    #[test]
    fn a_confidence_that_knows_has_auc_one_and_one_that_guesses_a_half() {
        let knows = [row(0.9, 0.8), row(0.8, 0.6), row(0.3, 0.2), row(0.1, 0.0)];
        let calibration = Calibration::of("m", knows.iter()).unwrap();
        assert_eq!((calibration.auc, calibration.right, calibration.n), (Some(1.0), 0.5, 4));
        let guesses = [row(0.5, 0.8), row(0.5, 0.1), row(0.5, 0.9), row(0.5, 0.3)];
        let calibration = Calibration::of("m", guesses.iter()).unwrap();
        assert_eq!((calibration.auc, calibration.calibration_error), (Some(0.5), 0.0));
        assert_eq!(calibration.bins.len(), 1);
        assert!(Calibration::of("m", [Row::default()].iter()).is_none());
        assert_eq!(Calibration::of("m", [row(1.0, 0.9)].iter()).unwrap().auc, None);
    }

    #[test]
    fn calibration_error_is_the_gap_by_count() {
        // .95 said and .5 right (gap .45, two answers); .05 said and none right (gap .05, two).
        let rows = [row(0.95, 0.9), row(0.95, 0.1), row(0.05, 0.1), row(0.05, 0.2)];
        let calibration = Calibration::of("m", rows.iter()).unwrap();
        assert!(
            (calibration.calibration_error - 0.25).abs() < 1e-12,
            "{}",
            calibration.calibration_error
        );
        assert_eq!(calibration.bins[1].n, 2);
        assert!((calibration.bins[1].mean_iou - 0.5).abs() < 1e-12);
    }
}
