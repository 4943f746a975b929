//! Whether a method knows when it is wrong.

use semfm::Verdict::{self, Accept, Check, Refuse};

use super::context::Context;
use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, calibration};
use crate::calibration::Calibration;
use crate::table::number;

/// The section; empty where no method says how sure it is.
pub(super) fn body(context: &Context<'_>) -> Result<String, DrawError> {
    let Some(first) = context.results.calibration.first() else { return Ok(String::new()) };
    let lead =
        context.results.calibration.iter().find(|t| t.method == context.lead).unwrap_or(first);
    let answers: Vec<calibration::Answer> = context
        .rows_of(&lead.method)
        .filter_map(|row| {
            let (confidence, iou) = (row.confidence?, row.iou?);
            Some(calibration::Answer { confidence, iou, verdict: row.verdict })
        })
        .collect();
    let method = escape(&lead.method);
    let scatter = plot(
        &calibration::scatter(&answers)?,
        "Scatter of confidence against IoU, one mark for each pair.",
        &format!(
            "{method}: one mark for each of {} pairs. Circles: accept; triangles: check; crosses: \
             refuse. Dashed: IoU .5.",
            answers.len()
        ),
    );
    let reliability = plot(
        &calibration::reliability(&lead.bins)?,
        "Reliability diagram: share of right answers against confidence, in tenths.",
        &format!(
            "{method}: share of right answers in each tenth of confidence, with the number of \
             answers. On the dashed line a confidence is a probability; the expected calibration \
             error is {}.",
            number(Some(lead.calibration_error), 3)
        ),
    );
    Ok(format!(
        "<ul class=\"legend\"><li class=\"right\">accept</li><li class=\"missed\">check</li>\
         <li class=\"extra\">refuse</li></ul>\n<div class=\"side\">{}{}</div>\n{}",
        half_wide(&scatter),
        half_wide(&reliability),
        table(context).html()
    ))
}

/// A plot beside another.
fn half_wide(plot: &str) -> String {
    plot.replace("class=\"plot\"", "class=\"plot half\"")
}

fn table(context: &Context<'_>) -> Table {
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
    for calibration in &context.results.calibration {
        let cells = [
            Cell::number(Some(calibration.right), 2),
            Cell::number(calibration.auc, 2),
            Cell::number(Some(calibration.calibration_error), 3),
            verdict_cell(calibration, Accept),
            verdict_cell(calibration, Check),
            verdict_cell(calibration, Refuse),
        ];
        let class = if calibration.method == context.lead { "lead" } else { "" };
        table.line(class, &calibration.method, "", cells);
    }
    table
}

/// Answers with this verdict and their mean IoU.
fn verdict_cell(calibration: &Calibration, verdict: Verdict) -> Cell {
    let found = calibration.verdicts.iter().find(|v| v.verdict == verdict);
    let text = found.map_or("–".into(), |v| format!("{} ({})", v.n, number(Some(v.mean_iou), 2)));
    Cell::written(found.map(|v| v.n as f64), text)
}
