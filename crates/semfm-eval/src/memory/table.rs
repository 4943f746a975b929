//! `memory.md`: several demonstrations beside one.

use super::results::{MemoryResults, MemorySummary};
use crate::table::{dash, failures, header, line, number, percent};

impl MemoryResults {
    /// The results as Markdown.
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "# Memories of demonstrations\n\n{} rows. Dataset {}. Features: {}. At most {} demonstrations matched; \
             {} objects of other kinds in each memory.\n\n\
             Means over targets. One: a single demonstration. Chosen: the most confident answer. Best: the best of \
             all answers, which no method knows. Right: IoU of at least one half.\n\n",
            self.rows.len(),
            self.dataset,
            self.embeddings,
            self.shortlist,
            self.n_distractors,
        );
        let names = [
            "demonstrations",
            "targets",
            "of the kind, matched",
            "one",
            "chosen",
            "fused",
            "fused, categories",
            "best",
            "below .3",
            "AUC",
            "calibration error",
            "accepted, of these right",
            "chosen: AUC",
            "chosen: accepted, right",
            "answer, ms",
        ];
        text += &header(names.map(str::to_owned));
        for summary in &self.summaries {
            text += &line(cells(summary));
        }
        text + &self.failures()
    }

    fn failures(&self) -> String {
        failures(self.rows.iter().filter_map(|row| {
            let failure = row.failure.as_ref()?;
            Some(format!(
                "{} {}, {} demonstrations: {}",
                row.group, row.target, row.n, failure.text
            ))
        }))
    }
}

fn cells(summary: &MemorySummary) -> Vec<String> {
    let three = |value: f64| number(Some(value), 3);
    let (fused, chosen) = (summary.calibration.as_ref(), summary.chosen_calibration.as_ref());
    let accepted = |calibration: Option<&crate::Calibration>| {
        let scores = calibration.and_then(|calibration| {
            calibration.verdicts.iter().find(|score| score.verdict == semfm::Verdict::Accept)
        });
        let n = calibration.map_or(0, |calibration| calibration.n);
        scores.map_or_else(dash, |score| format!("{} of {n}, {:.3}", score.n, score.right))
    };
    vec![
        format!("{} ({})", summary.n, summary.targets),
        summary.n_targets.to_string(),
        number(Some(summary.mean_of_kind), 1),
        three(summary.single),
        three(summary.chosen),
        three(summary.fused),
        three(summary.fused_by_category),
        three(summary.best),
        percent(Some(summary.poor)),
        number(fused.and_then(|calibration| calibration.auc), 3),
        number(fused.map(|calibration| calibration.calibration_error), 3),
        accepted(fused),
        number(chosen.and_then(|calibration| calibration.auc), 3),
        accepted(chosen),
        number(Some(summary.median_ms), 0),
    ]
}
