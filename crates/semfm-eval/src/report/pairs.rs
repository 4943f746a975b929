//! Every pair with every method's IoU, and everything that failed.

use std::collections::BTreeMap;

use super::context::Context;
use super::html::{Cell, Table};

/// Longer lists belong to `results.json`.
const LISTED: usize = 2000;
const FAILURES_LISTED: usize = 200;

/// The section.
pub(super) fn body(context: &Context<'_>) -> String {
    let mut pairs: BTreeMap<[&str; 3], BTreeMap<&str, Option<f64>>> = BTreeMap::new();
    for row in &context.results.rows {
        let [group, source, target, method] = row.key();
        pairs.entry([group, source, target]).or_default().insert(method, row.iou);
    }
    let head = ["Pair", "Group"].into_iter().chain(context.methods.iter().copied());
    let caption = match pairs.len() {
        n if n > LISTED => format!("IoU of {LISTED} of {n} pairs; the others are in results.json"),
        n => format!("IoU of all {n} pairs"),
    };
    let mut table = Table::new(&caption, head).sortable();
    for ([group, source, target], ious) in pairs.iter().take(LISTED) {
        let mut cells = vec![Cell::text(group)];
        for method in &context.methods {
            cells.push(Cell::number(ious.get(method).copied().flatten(), 2));
        }
        table.line("", &format!("{source} → {target}"), "", cells);
    }
    format!(
        "<details><summary>Show all pairs</summary>\n{}</details>\n{}",
        table.html(),
        failures(context)
    )
}

fn failures(context: &Context<'_>) -> String {
    let failed = context.results.rows.iter().filter_map(|row| Some((row, row.failure.as_ref()?)));
    let failed: Vec<_> = failed.collect();
    if failed.is_empty() {
        return "<p>Every method answered on every pair.</p>\n".into();
    }
    let caption = match failed.len() {
        n if n > FAILURES_LISTED => format!("{FAILURES_LISTED} of {n} rows without an answer"),
        n => format!("{n} rows without an answer"),
    };
    let mut table = Table::new(&caption, ["Pair", "Group", "Method", "Kind", "What happened"]);
    for (row, failure) in failed.iter().take(FAILURES_LISTED) {
        let cells = [&row.group, &row.method, &failure.kind, &failure.text].map(|x| Cell::text(x));
        table.line("", &format!("{} → {}", row.source, row.target), "", cells);
    }
    format!("<h3>Failures</h3>\n{}", table.html())
}
