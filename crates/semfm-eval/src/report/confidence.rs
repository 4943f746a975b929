//! Whether a method knows when it is wrong.

use super::context::Context;
use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, trust};
use crate::table::number;

/// The section; empty where no method says how sure it is.
pub(super) fn body(context: &Context<'_>) -> Result<String, DrawError> {
    let Some(first) = context.results.trust.first() else { return Ok(String::new()) };
    let lead = context.results.trust.iter().find(|t| t.method == context.lead).unwrap_or(first);
    let answers: Vec<trust::Answer> = context
        .rows_of(&lead.method)
        .filter_map(|row| {
            let (confidence, iou) = (row.confidence?, row.iou?);
            Some(trust::Answer { confidence, iou, verdict: row.verdict })
        })
        .collect();
    let method = escape(&lead.method);
    let scatter = plot(
        &trust::scatter(&answers)?,
        "Scatter of confidence against IoU, one mark for each pair.",
        &format!(
            "{method}: one mark for each of {} pairs. Circles: accept; triangles: check; crosses: \
             refuse. Dashed: IoU .5.",
            answers.len()
        ),
    );
    let reliability = plot(
        &trust::reliability(&lead.bins)?,
        "Reliability diagram: share of right answers against confidence, in tenths.",
        &format!(
            "{method}: share of right answers in each tenth of confidence, with the number of \
             answers. On the dashed line a confidence is a probability; the expected calibration \
             error is {}.",
            number(Some(lead.calibration_error), 3)
        ),
    );
    let half = |plot: String| plot.replace("class=\"plot\"", "class=\"plot half\"");
    Ok(format!(
        "<ul class=\"legend\"><li class=\"right\">accept</li><li class=\"missed\">check</li>\
         <li class=\"extra\">refuse</li></ul>\n<div class=\"side\">{}{}</div>\n{}",
        half(scatter),
        half(reliability),
        table(context).html()
    ))
}

fn table(context: &Context<'_>) -> Table {
    use semfm::Verdict::{Accept, Check, Refuse};
    let head = [
        "Method",
        "Right (IoU ≥ .5)",
        "AUC",
        "Calibration error",
        "Accepted (mean IoU)",
        "To check (mean IoU)",
        "Refused (mean IoU)",
    ];
    let mut table = Table::new("What each method’s confidence is worth", head).sortable();
    for trust in &context.results.trust {
        let verdict = |verdict| {
            let found = trust.verdicts.iter().find(|v| v.verdict == verdict);
            let text = found
                .map_or("–".into(), |v| format!("{} ({})", v.n, number(Some(v.mean_iou), 2)));
            Cell::written(found.map(|v| v.n as f64), text)
        };
        let cells = [
            Cell::number(Some(trust.right), 2),
            Cell::number(trust.auc, 2),
            Cell::number(Some(trust.calibration_error), 3),
            verdict(Accept),
            verdict(Check),
            verdict(Refuse),
        ];
        let class = if trust.method == context.lead { "lead" } else { "" };
        table.line(class, &trust.method, "", cells);
    }
    table
}
