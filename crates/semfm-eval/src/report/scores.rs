//! Every method on every group, intervals, and the other methods against the leading one.

use std::collections::BTreeSet;

use super::context::{Context, is_bound};
use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, forest};
use crate::row::Row;
use crate::summary::Scope;
use crate::table::number;

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
                 dots are groups. Floor and ceiling are grey."
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
    let group = |name: &&str| context.summary(&Scope::Group((*name).into()), method)?.mean;
    Some(forest::Line {
        name: method.into(),
        is_bound: is_bound(method),
        is_lead: method == context.lead,
        mean: summary.mean?,
        interval: summary.interval,
        groups: context.groups.iter().filter_map(group).collect(),
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
        let mean = |scope: &Scope| context.summary(scope, method).and_then(|s| s.mean);
        let all = context.overall(method);
        let cells = scopes
            .iter()
            .map(|scope| Cell::number(mean(scope), 2))
            .chain([Cell::number(mean(&Scope::All), 3), Cell::number(all.and_then(|s| s.std), 2)])
            .chain([Cell::number(mean(&Scope::MeanOfCategories), 3)])
            .collect::<Vec<_>>();
        table.line(class(context, method), method, "", cells);
    }
    table
}

fn interval(ends: Option<[f64; 2]>, signed: bool) -> String {
    let one = |x: f64| if signed { format!("{x:+.3}") } else { number(Some(x), 3) };
    ends.map_or_else(String::new, |[low, high]| format!("{} … {}", one(low), one(high)))
}

fn overall(context: &Context<'_>) -> Table {
    let head = [
        "Method",
        "Mean IoU",
        "IoU by area",
        "Below .3",
        "Floor to ceiling",
        "Anchors landed",
        "Pairs",
        "Failed",
        "What it is",
    ];
    let mut table = Table::new("All pairs together", head).sortable();
    for &method in &context.methods {
        let Some(s) = context.overall(method) else { continue };
        let percent = |share: Option<f64>| {
            Cell::written(share, share.map_or("–".into(), |x| format!("{:.0} %", 100.0 * x)))
        };
        let cells = [
            Cell::number(s.mean, 3).with_small(&interval(s.interval, false)),
            Cell::number(s.area_mean, 2),
            percent(s.below_poor),
            percent(s.way.filter(|_| !is_bound(method))),
            percent(s.anchor_landed),
            Cell::written(Some(s.n as f64), s.n.to_string()),
            Cell::written(Some(s.n_failed as f64), s.n_failed.to_string()),
            Cell::text(context.about(method)),
        ];
        table.line(class(context, method), method, "", cells);
    }
    table
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
        // Differences are kept for each two methods once, in either order.
        let find = |scope: &Scope| {
            context.results.differences.iter().filter(|d| d.scope == *scope).find_map(|d| {
                match (d.method.as_str(), d.against.as_str()) {
                    (a, b) if (a, b) == (method, context.lead) => {
                        Some((d.mean, d.interval, d.sign(), d.better_worse))
                    }
                    (a, b) if (a, b) == (context.lead, method) => {
                        let ends = d.interval.map(|[low, high]| [-high, -low]);
                        let [better, worse] = d.better_worse;
                        Some((-d.mean, ends, -d.sign(), [worse, better]))
                    }
                    _ => None,
                }
            })
        };
        let Some((_, _, _, [better, worse])) = find(&Scope::All) else { continue };
        let mut cells: Vec<Cell> = Vec::new();
        for scope in &scopes {
            cells.push(match find(scope) {
                None => Cell::number(None, 2),
                Some((mean, ends, sign, _)) => {
                    let ends = if *scope == Scope::All { ends } else { None };
                    Cell::written(Some(mean), format!("{mean:+.2}"))
                        .strong_if(sign != 0)
                        .with_small(&interval(ends, true))
                }
            });
        }
        let balance = better as f64 - worse as f64;
        cells.push(Cell::written(Some(balance), format!("{better} / {worse}")));
        table.line("", method, "", cells);
    }
    table
}

/// Medians of the stages, and of what they add up to.
fn times(context: &Context<'_>) -> String {
    let rows = |method: &str| {
        context.rows_of(method).filter(|row| !row.stages_ms.is_empty()).collect::<Vec<_>>()
    };
    let names = context.results.rows.iter().flat_map(|row| row.stages_ms.keys());
    let names: BTreeSet<(bool, &str)> = names.map(|name| stage_of(name)).collect();
    let stages: Vec<(bool, &str)> = names.into_iter().rev().collect(); // preparation first
    if stages.is_empty() {
        return String::new();
    }
    let head = ["Method", "Matching", "Cold", "Whole"].map(str::to_owned);
    let of_both = |&(both, name): &(bool, &str)| {
        if both { format!("{name} (both)") } else { name.to_owned() }
    };
    let head = head.into_iter().chain(stages.iter().map(of_both));
    let mut table = Table::new("Median milliseconds", head).sortable();
    for &method in &context.methods {
        let rows = rows(method);
        let Some(s) = context.overall(method).filter(|_| !rows.is_empty()) else { continue };
        let ms = |x: Option<f64>| {
            Cell::written(
                x,
                x.map_or("–".into(), |x| {
                    if x < 10.0 { format!("{x:.1}") } else { format!("{x:.0}") }
                }),
            )
        };
        let whole = s.median_paper_runtime.map(|seconds| 1e3 * seconds);
        let sums = [s.median_matching_ms, s.median_cold_ms, whole];
        let of_stage = |stage: &(bool, &str)| {
            let of_row = |row: &&Row| {
                let parts = row.stages_ms.iter().filter(|(name, _)| stage_of(name) == *stage);
                let parts: Vec<f64> = parts.map(|(_, ms)| *ms).collect();
                (!parts.is_empty()).then(|| parts.iter().sum::<f64>())
            };
            let mut values: Vec<f64> = rows.iter().filter_map(of_row).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        let cells = sums.into_iter().chain(stages.iter().map(of_stage)).map(ms);
        table.line(class(context, method), method, "", cells.collect::<Vec<_>>());
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

/// Whether a stage is done for each of the objects, and its name.
fn stage_of(name: &str) -> (bool, &str) {
    let bare = name.strip_suffix("_source").or_else(|| name.strip_suffix("_target"));
    (bare.is_some(), bare.unwrap_or(name))
}
