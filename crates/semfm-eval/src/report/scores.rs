//! Every method on every group, intervals, and the other methods against the leading one.

use std::collections::BTreeSet;

use super::context::Context;
use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, forest};
use crate::row::Row;
use crate::summary::{Scope, is_bound};
use crate::table;

/// The section.
pub(super) fn body(context: &Context<'_>) -> Result<String, DrawError> {
    let lines: Vec<forest::Line> =
        context.methods.iter().filter_map(|method| line(context, method)).collect();
    let mut html = String::new();
    if !lines.is_empty() {
        let level = 100.0 * context.results.bootstrap.level;
        html += &plot(
            &forest::draw(&lines)?,
            "Mean IoU of each method with its interval; the numbers are in the table below.",
            &format!(
                "Mean IoU over all pairs with its {level:.0} % interval (objects resampled); small \
                 dots are groups. The bounds are grey."
            ),
        );
    }
    html += &by_group(context).html();
    html += &overall(context).html();
    let differences = differences(context);
    if !differences.is_empty() {
        html += &differences.html();
    }
    html += &times(context);
    Ok(html)
}

fn line(context: &Context<'_>, method: &str) -> Option<forest::Line> {
    let summary = context.overall(method)?;
    let groups = context.groups.iter();
    let groups = groups.filter_map(|&name| {
        context.summary(&Scope::Group(name.into()), method).and_then(|summary| summary.mean)
    });
    Some(forest::Line {
        name: method.into(),
        is_bound: is_bound(method),
        is_lead: method == context.lead,
        mean: summary.mean?,
        interval: summary.interval,
        groups: groups.collect(),
    })
}

fn class(context: &Context<'_>, method: &str) -> &'static str {
    if method == context.lead { "lead" } else { "" }
}

fn by_group(context: &Context<'_>) -> Table {
    let scopes: Vec<Scope> = context.groups.iter().map(|g| Scope::Group((*g).into())).collect();
    let columns = context.groups.iter().zip(&scopes).map(|(name, scope)| {
        let n = context.methods.iter().filter_map(|m| Some(context.summary(scope, m)?.n)).max();
        format!("{name} ({})", n.unwrap_or(0))
    });
    let head = ["Method".to_owned()].into_iter().chain(columns);
    let head = head.chain(["All", "± std", "Mean of categories"].map(str::to_owned));
    let caption = "Mean IoU by group (number of pairs)";
    let mut table = Table::new(caption, head).sortable();
    for &method in &context.methods {
        let std = context.overall(method).and_then(|s| s.std);
        let mut cells: Vec<Cell> =
            scopes.iter().map(|scope| mean_cell(context, scope, method, 2)).collect();
        cells.push(mean_cell(context, &Scope::All, method, 3));
        cells.push(Cell::number(std, 2));
        cells.push(mean_cell(context, &Scope::MeanOfCategories, method, 3));
        table.line(class(context, method), method, "", cells);
    }
    table
}

fn mean_cell(context: &Context<'_>, scope: &Scope, method: &str, digits: usize) -> Cell {
    Cell::number(context.summary(scope, method).and_then(|summary| summary.mean), digits)
}

/// The ends of an interval; empty for none.
fn ends(interval: Option<[f64; 2]>, signed: bool) -> String {
    interval.map_or_else(String::new, |ends| table::interval(Some(ends), signed))
}

fn overall(context: &Context<'_>) -> Table {
    let head = [
        "Method",
        "Mean IoU",
        "IoU by area",
        "Below .3",
        "Between bounds",
        "Anchors landed",
        "Pairs",
        "Failed",
        "What it is",
    ];
    let mut table = Table::new("All pairs together", head).sortable();
    for &method in &context.methods {
        let Some(s) = context.overall(method) else { continue };
        let cells = [
            Cell::number(s.mean, 3).with_small(&ends(s.interval, false)),
            Cell::number(s.area_mean, 2),
            percent(s.below_poor),
            percent(s.between_bounds.filter(|_| !is_bound(method))),
            percent(s.anchor_landed),
            Cell::written(Some(s.n as f64), s.n.to_string()),
            Cell::written(Some(s.n_failed as f64), s.n_failed.to_string()),
            Cell::text(context.about(method)),
        ];
        table.line(class(context, method), method, "", cells);
    }
    table
}

/// A share as a whole percentage.
fn percent(share: Option<f64>) -> Cell {
    Cell::written(share, table::percent(share))
}

/// The other methods against the leading one, group by group.
fn differences(context: &Context<'_>) -> Table {
    let caption = format!(
        "IoU minus that of {}, pair by pair; strong where the interval excludes zero",
        context.lead
    );
    let scopes = context.groups.iter().map(|group| Scope::Group((*group).into()));
    let scopes: Vec<Scope> = scopes.chain([Scope::All]).collect();
    let head = ["Method"].into_iter().chain(context.groups.iter().copied());
    let mut table =
        Table::new(&caption, head.chain(["All", "Better / worse on (pairs)"])).sortable();
    for &method in context.methods.iter().filter(|m| **m != context.lead) {
        let Some(over_all) = gain(context, &Scope::All, method) else { continue };
        let mut cells: Vec<Cell> = Vec::new();
        for scope in &scopes {
            cells.push(match gain(context, scope, method) {
                None => Cell::number(None, 2),
                Some(gain) => {
                    let interval = gain.interval.filter(|_| *scope == Scope::All);
                    Cell::written(Some(gain.mean), format!("{:+.2}", gain.mean))
                        .strong_if(gain.is_certain)
                        .with_small(&ends(interval, true))
                }
            });
        }
        let Gain { better, worse, .. } = over_all;
        let balance = better as f64 - worse as f64;
        cells.push(Cell::written(Some(balance), format!("{better} / {worse}")));
        table.line("", method, "", cells);
    }
    table
}

/// How much better a method is than the leading one.
struct Gain {
    mean: f64,
    interval: Option<[f64; 2]>,
    /// Whether the interval excludes zero.
    is_certain: bool,
    better: usize,
    worse: usize,
}

/// Differences are kept for each two methods once, in either order.
fn gain(context: &Context<'_>, scope: &Scope, method: &str) -> Option<Gain> {
    let lead = context.lead;
    for d in context.results.differences.iter().filter(|d| d.scope == *scope) {
        let (mean, interval, is_certain) = (d.mean, d.interval, d.sign() != 0);
        let [better, worse] = d.better_worse;
        if d.method == method && d.against == lead {
            return Some(Gain { mean, interval, is_certain, better, worse });
        }
        if d.method == lead && d.against == method {
            let interval = interval.map(|[low, high]| [-high, -low]);
            let (better, worse) = (worse, better);
            return Some(Gain { mean: -mean, interval, is_certain, better, worse });
        }
    }
    None
}

/// Medians of the stages, and of what they add up to.
fn times(context: &Context<'_>) -> String {
    let names = context.results.rows.iter().flat_map(|row| row.stages_ms.keys());
    let stages: BTreeSet<Stage<'_>> = names.map(|name| Stage::of(name)).collect();
    let stages: Vec<Stage<'_>> = stages.into_iter().rev().collect(); // preparation first
    if stages.is_empty() {
        return String::new();
    }
    let head = ["Method", "Matching", "Cold", "Whole"].map(str::to_owned);
    let head = head.into_iter().chain(stages.iter().map(Stage::heading));
    let mut table = Table::new("Median milliseconds", head).sortable();
    for &method in &context.methods {
        let rows: Vec<&Row> =
            context.rows_of(method).filter(|row| !row.stages_ms.is_empty()).collect();
        let Some(s) = context.overall(method).filter(|_| !rows.is_empty()) else { continue };
        let whole = s.median_paper_runtime.map(|seconds| 1e3 * seconds);
        let sums = [s.median_matching_ms, s.median_cold_ms, whole];
        let of_stages = stages.iter().map(|stage| stage.median_ms(&rows));
        let cells: Vec<Cell> = sums.into_iter().chain(of_stages).map(milliseconds).collect();
        table.line(class(context, method), method, "", cells);
    }
    format!(
        "<h3>Time</h3>\n<p>{}</p>\n{}",
        escape(
            "Matching: from prepared objects to the region. Cold: from embeddings, nothing cached. \
             Whole: from meshes, views and encoder included, where the encoder was timed. Then each \
             stage; “both” adds up source and target."
        ),
        table.html()
    )
}

/// Milliseconds, with a digit after the point below ten.
fn milliseconds(ms: Option<f64>) -> Cell {
    let text = match ms {
        None => "–".into(),
        Some(ms) if ms < 10.0 => format!("{ms:.1}"),
        Some(ms) => format!("{ms:.0}"),
    };
    Cell::written(ms, text)
}

/// A stage of the work, in the order of the columns from the right.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Stage<'a> {
    /// Whether it is done for each of the two objects.
    is_of_both: bool,
    name: &'a str,
}

impl<'a> Stage<'a> {
    fn of(name: &'a str) -> Self {
        let bare = name.strip_suffix("_source").or_else(|| name.strip_suffix("_target"));
        Self { is_of_both: bare.is_some(), name: bare.unwrap_or(name) }
    }

    fn heading(&self) -> String {
        if self.is_of_both { format!("{} (both)", self.name) } else { self.name.to_owned() }
    }

    /// What it took in one row, both objects added up.
    fn ms(&self, row: &Row) -> Option<f64> {
        let parts = row.stages_ms.iter().filter(|(name, _)| Stage::of(name) == *self);
        let parts: Vec<f64> = parts.map(|(_, ms)| *ms).collect();
        (!parts.is_empty()).then(|| parts.iter().sum::<f64>())
    }

    fn median_ms(&self, rows: &[&Row]) -> Option<f64> {
        let mut values: Vec<f64> = rows.iter().filter_map(|row| self.ms(row)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }
}
