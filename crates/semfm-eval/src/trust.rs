//! How much a method's confidence is worth: does it tell right answers from wrong ones, and is it
//! a probability?

use serde::{Deserialize, Serialize};

use crate::row::Row;

/// An answer of this IoU is right.
pub const RIGHT: f64 = 0.5;
/// Bins of the reliability diagram.
const BINS: usize = 10;

/// What a method's confidence is worth, over all its scored rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trust {
    /// Name of the method.
    pub method: String,
    /// Rows with a confidence and a score.
    pub n: usize,
    /// Share of right answers (IoU ≥ .5).
    pub right: f64,
    /// Chance that a right answer is trusted more than a wrong one (ties count half); none where all
    /// are right or all are wrong.
    pub auc: Option<f64>,
    /// Expected calibration error: mean distance, over the bins and by their counts, between mean
    /// confidence and share of right answers.
    pub calibration_error: f64,
    /// Reliability by confidence, in tenths; empty bins are left out.
    pub bins: Vec<TrustBin>,
    /// How each verdict did.
    pub verdicts: Vec<VerdictBin>,
}

/// The answers with a confidence in [low, high).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrustBin {
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
pub struct VerdictBin {
    /// The verdict.
    pub verdict: semfm::Verdict,
    /// Answers.
    pub n: usize,
    /// Share of them that is right.
    pub right: f64,
    /// Their mean IoU.
    pub mean_iou: f64,
}

impl Trust {
    /// The worth of the confidence in `rows`, all of one method; none where none has one.
    pub fn of<'a>(method: &str, rows: impl Iterator<Item = &'a Row>) -> Option<Self> {
        let rows: Vec<(f64, f64, Option<semfm::Verdict>)> =
            rows.filter_map(|row| Some((row.confidence?, row.iou?, row.verdict))).collect();
        if rows.is_empty() {
            return None;
        }
        let bins: Vec<TrustBin> = (0..BINS).filter_map(|b| bin(&rows, b)).collect();
        let n = rows.len() as f64;
        let gap = |bin: &TrustBin| bin.n as f64 * (bin.mean_confidence - bin.right).abs();
        let verdicts = [semfm::Verdict::Accept, semfm::Verdict::Check, semfm::Verdict::Refuse];
        let verdicts = verdicts.into_iter().filter_map(|verdict| {
            let ious: Vec<f64> =
                rows.iter().filter(|r| r.2 == Some(verdict)).map(|r| r.1).collect();
            let (n, right, mean_iou) = sums(&ious)?;
            Some(VerdictBin { verdict, n, right, mean_iou })
        });
        Some(Self {
            method: method.into(),
            n: rows.len(),
            right: rows.iter().filter(|row| row.1 >= RIGHT).count() as f64 / n,
            auc: auc(&rows),
            calibration_error: bins.iter().map(gap).sum::<f64>() / n,
            verdicts: verdicts.collect(),
            bins,
        })
    }
}

/// Count, share of right answers, mean; none for nothing.
fn sums(ious: &[f64]) -> Option<(usize, f64, f64)> {
    let n = ious.len() as f64;
    let right = ious.iter().filter(|&&iou| iou >= RIGHT).count() as f64;
    (n > 0.0).then(|| (ious.len(), right / n, ious.iter().sum::<f64>() / n))
}

fn bin(rows: &[(f64, f64, Option<semfm::Verdict>)], number: usize) -> Option<TrustBin> {
    let of = |confidence: f64| ((confidence * BINS as f64) as usize).min(BINS - 1);
    let inside: Vec<_> = rows.iter().filter(|row| of(row.0) == number).collect();
    let (n, right, mean_iou) = sums(&inside.iter().map(|row| row.1).collect::<Vec<_>>())?;
    Some(TrustBin {
        low: number as f64 / BINS as f64,
        high: (number + 1) as f64 / BINS as f64,
        n,
        mean_confidence: inside.iter().map(|row| row.0).sum::<f64>() / n as f64,
        right,
        mean_iou,
    })
}

/// Mann–Whitney's U over the number of (right, wrong) pairs.
fn auc(rows: &[(f64, f64, Option<semfm::Verdict>)]) -> Option<f64> {
    let trusts = |wanted: bool| -> Vec<f64> {
        rows.iter().filter(|row| (row.1 >= RIGHT) == wanted).map(|row| row.0).collect()
    };
    let (right, wrong) = (trusts(true), trusts(false));
    if right.is_empty() || wrong.is_empty() {
        return None;
    }
    let beats = |a: f64, b: f64| {
        if a > b {
            1.0
        } else if a == b {
            0.5
        } else {
            0.0
        }
    };
    let wins: f64 = right.iter().map(|&r| wrong.iter().map(|&w| beats(r, w)).sum::<f64>()).sum();
    Some(wins / (right.len() * wrong.len()) as f64)
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
        let trust = Trust::of("m", knows.iter()).unwrap();
        assert_eq!((trust.auc, trust.right, trust.n), (Some(1.0), 0.5, 4));
        let guesses = [row(0.5, 0.8), row(0.5, 0.1), row(0.5, 0.9), row(0.5, 0.3)];
        let trust = Trust::of("m", guesses.iter()).unwrap();
        assert_eq!((trust.auc, trust.calibration_error), (Some(0.5), 0.0));
        assert_eq!(trust.bins.len(), 1);
        assert!(Trust::of("m", [Row::default()].iter()).is_none());
        assert_eq!(Trust::of("m", [row(1.0, 0.9)].iter()).unwrap().auc, None);
    }

    #[test]
    fn calibration_error_is_the_gap_by_count() {
        // .95 said and .5 right (gap .45, two answers); .05 said and none right (gap .05, two).
        let rows = [row(0.95, 0.9), row(0.95, 0.1), row(0.05, 0.1), row(0.05, 0.2)];
        let trust = Trust::of("m", rows.iter()).unwrap();
        assert!((trust.calibration_error - 0.25).abs() < 1e-12, "{}", trust.calibration_error);
        assert_eq!(trust.bins[1].n, 2);
        assert!((trust.bins[1].mean_iou - 0.5).abs() < 1e-12);
    }
}
