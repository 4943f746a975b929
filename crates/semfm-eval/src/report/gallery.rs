//! Pairs to look at, worst first: source, target with truth, what was found, and the error from two
//! sides.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use semfm::{Task, Verdict};

use super::ReportSettings;
use super::context::Context;
use super::html::{escape, shown};
use super::thumbnails::{DrawnPair, Side, Thumbnails};
use crate::Result;
use crate::prediction::Prediction;
use crate::row::Row;
use crate::table::number;
use crate::variant::Variant;

/// The section; empty without pictures.
///
/// # Errors
/// Only cancellation.
pub(super) fn body(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    settings: &ReportSettings,
    task: &Task,
) -> Result<String> {
    let chosen = Chosen::new(context, thumbnails, settings);
    if chosen.rows.is_empty() {
        return Ok(String::new());
    }
    let cards = cards(context, thumbnails, &chosen.rows, task)?;
    Ok(format!(
        "<p>Each method’s worst answers first. The demonstrated region and the true one are green; \
         what a method found is orange, paler where it is less sure.{}</p>\n\
         <ul class=\"legend\"><li class=\"right\">right</li><li class=\"extra\">too much</li>\
         <li class=\"missed\">missed</li></ul>\n{}<div class=\"cards\" id=\"cards\">\n{}</div>\n",
        escape(&chosen.left_out),
        controls(context, &chosen.rows),
        cards.concat(),
    ))
}

/// The rows with a card, by method and from the worst.
struct Chosen<'a> {
    rows: Vec<&'a Row>,
    left_out: String,
}

/// A method of which only the worst rows have a card.
struct Truncated<'a> {
    method: &'a str,
    limit: usize,
}

impl<'a> Chosen<'a> {
    fn new(context: &Context<'a>, thumbnails: &Thumbnails<'_>, settings: &ReportSettings) -> Self {
        let (mut rows, mut truncated) = (Vec::new(), Vec::new());
        // The lower bound answers everything, always.
        let shown = context.methods.iter().filter(|method| **method != Variant::LOWER_BOUND.name());
        for &method in shown {
            let mut own: Vec<&Row> = context
                .rows_of(method)
                .filter(|row| row.iou.is_some() && row.prediction.is_some())
                .filter(|row| thumbnails.pair(row).is_some())
                .collect();
            own.sort_by(|a, b| {
                a.iou_or_zero().total_cmp(&b.iou_or_zero()).then_with(|| a.key().cmp(&b.key()))
            });
            let limit =
                if method == context.lead { settings.leading_cards } else { settings.other_cards };
            if own.len() > limit {
                truncated.push(Truncated { method, limit });
                own.truncate(limit);
            }
            rows.extend(own);
        }
        Self { rows, left_out: left_out(&truncated, settings) }
    }
}

/// One sentence on what has no card; empty where everything has one.
fn left_out(truncated: &[Truncated<'_>], settings: &ReportSettings) -> String {
    if truncated.is_empty() {
        return String::new();
    }
    let mut limits = Vec::new();
    for limit in [settings.leading_cards, settings.other_cards] {
        let own = truncated.iter().filter(|one| one.limit == limit);
        let methods: Vec<&str> = own.map(|one| one.method).collect();
        if !methods.is_empty() {
            limits.push(format!("the worst {limit} of {}", methods.join(", ")));
        }
    }
    limits.dedup();
    format!(
        " To keep this page small it holds {}; all scores are under “All pairs”, all answers in \
         the folder predictions.",
        limits.join(" and ")
    )
}

/// Drawn pair by pair, so that each file of answers is read once.
fn cards(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    rows: &[&Row],
    task: &Task,
) -> Result<Vec<String>> {
    let mut by_pair: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (place, row) in rows.iter().enumerate() {
        by_pair.entry(row.prediction.as_deref().unwrap_or_default()).or_default().push(place);
    }
    let pairs: Vec<Vec<usize>> = by_pair.into_values().collect();
    let done = AtomicUsize::new(0);
    let drawn: Vec<Result<Vec<(usize, String)>>> = pairs
        .par_iter()
        .map(|places| {
            task.check()?;
            let answers =
                places.first().map(|&first| thumbnails.answers(rows[first])).unwrap_or_default();
            let cards = places.iter().map(|&place| {
                let row = rows[place];
                (place, card(context, thumbnails, row, answers.get(&row.method)))
            });
            let cards = cards.collect();
            let count = done.fetch_add(places.len(), Ordering::Relaxed) + places.len();
            task.step("gallery", count, rows.len())?;
            Ok(cards)
        })
        .collect();
    let mut cards = vec![String::new(); rows.len()];
    for (place, card) in drawn.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        cards[place] = card;
    }
    Ok(cards)
}

fn card(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    row: &Row,
    answer: Option<&Prediction>,
) -> String {
    let (Some(DrawnPair { source, target }), Some(answer)) = (thumbnails.pair(row), answer) else {
        return String::new();
    };
    let iou = number(row.iou, 2);
    let by_method = format!("on {} by {}, IoU {iou}", row.target, row.method);
    let found = thumbnails.region(target, answer, &format!("region found {by_method}"));
    let error = thumbnails.error(target, answer, Side::Best, &format!("error {by_method}"));
    let other_side = format!("error {by_method}, from another side");
    let other_side = thumbnails.error(target, answer, Side::Other, &other_side);
    let mut pictures = shown(&source.own("with the demonstrated region"), "source");
    pictures += &shown(&target.own("with the true region"), "truth");
    for (picture, words) in [(found, "found"), (error, "error"), (other_side, "other side")] {
        if let Some(picture) = picture {
            pictures += &shown(&picture, words);
        }
    }
    let mut words = format!("IoU <b>{iou}</b>");
    if let Some(confidence) = row.confidence {
        words += &format!(" · confidence <b>{}</b>", number(Some(confidence), 2));
    }
    if let Some(verdict) = row.verdict {
        words += &format!(" · {}", verdict);
    }
    format!(
        "<article class=\"card\" data-method=\"{method}\" data-rank=\"{rank}\" data-group=\"{group}\" \
         data-verdict=\"{verdict}\" data-iou=\"{iou}\" data-confidence=\"{confidence}\" \
         data-name=\"{source} {target}\"><h3>{source} → {target}</h3>\
         <p>{method} · {group} · {words}</p><div class=\"five\">{pictures}</div></article>\n",
        method = escape(&row.method),
        rank = context.methods.iter().position(|m| *m == row.method).unwrap_or(0),
        group = escape(&row.group),
        verdict = row.verdict.map_or("", Verdict::name),
        iou = attribute(row.iou),
        confidence = attribute(row.confidence),
        source = escape(&row.source),
        target = escape(&row.target),
    )
}

/// A number as a `data-` attribute; empty for none.
fn attribute(value: Option<f64>) -> String {
    value.map_or(String::new(), |v| v.to_string())
}

/// Filters and orders; hidden until the script that serves them runs.
fn controls(context: &Context<'_>, rows: &[&Row]) -> String {
    let with_card =
        context.methods.iter().filter(|method| rows.iter().any(|row| row.method == ***method));
    let methods: String = with_card.map(|m| option(m, m, *m == context.lead)).collect();
    let groups: String = context.groups.iter().map(|g| option(g, g, false)).collect();
    let verdicts: String = Verdict::ALL.map(|v| option(v.name(), v.name(), false)).concat();
    let orders = [
        ("worst", "worst IoU first"),
        ("best", "best IoU first"),
        ("wrong", "most misplaced trust first"),
        ("sure", "most confident first"),
        ("unsure", "least confident first"),
        ("method", "by method, worst first"),
        ("group", "by group, worst first"),
    ];
    let orders: String = orders.map(|(value, words)| option(value, words, false)).concat();
    format!(
        "<form class=\"controls\" id=\"controls\" hidden aria-label=\"Which pairs are shown\">\n{}{}{}{}\
         <label>Name holds<input name=\"words\" type=\"search\"></label>\n\
         <output name=\"count\" aria-live=\"polite\"></output>\n</form>\n",
        select("method", "Method", option("", "all", false) + &methods),
        select("group", "Group", option("", "all", false) + &groups),
        select("verdict", "Verdict", option("", "all", false) + &verdicts),
        select("order", "Order", orders),
    )
}

/// One choice of a list.
fn option(value: &str, words: &str, chosen: bool) -> String {
    let chosen = if chosen { " selected" } else { "" };
    format!("<option value=\"{}\"{chosen}>{}</option>", escape(value), escape(words))
}

/// A list of choices with its label.
fn select(name: &str, label: &str, options: String) -> String {
    format!("<label>{label}<select name=\"{name}\">{options}</select></label>\n")
}
