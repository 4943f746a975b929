//! The paper's picture sheets from our own runs: categories, maps as colours, failures of geometry.
//!
//! What is shown is chosen by rule, not by looks: in each group the source whose mean IoU is nearest
//! to the group's, with targets spread evenly from its best to its worst.

use rayon::prelude::*;
use semfm::{Method, Task};

use super::context::Context;
use super::html::{escape, shown};
use super::thumbnails::{DrawnObject, DrawnPair, Side, Thumbnails};
use crate::Result;
use crate::row::Row;
use crate::table::number;

/// Targets of each group in the category sheet.
const SHEET_TARGETS: usize = 5;
/// Targets of each group under the coloured source, as in the paper.
const COLOURED_TARGETS: usize = 3;

/// Each group: a source with its region, and targets with the transferred region.
pub(super) fn categories(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    task: &Task,
) -> Result<String> {
    let groups = each_group(context, context.lead, task, |rows| category_strip(thumbnails, rows))?;
    if groups.is_empty() {
        return Ok(String::new());
    }
    let mut html = format!(
        "<p>What {} carries over. Green: the demonstrated region; orange: what was found, with its IoU. \
         Of each group: the source nearest to the group’s mean, and targets spread from its best to its \
         worst.</p>\n",
        escape(context.lead)
    );
    html += &blocks(&groups);
    Ok(html)
}

fn category_strip(thumbnails: &Thumbnails<'_>, rows: &[&Row]) -> Option<String> {
    let rows = typical(thumbnails, rows, SHEET_TARGETS);
    let source = thumbnails.pair(rows.first()?)?.source;
    let mut strip = demonstrated(source, &format!("{}: demonstrated", source.name));
    let mut n_shown = 0;
    for row in rows {
        let Some((pair, answer)) = thumbnails.pair(row).zip(thumbnails.answer(row)) else {
            continue;
        };
        let words = format!("{} ({})", pair.target.name, number(row.iou, 2));
        let alt = format!("region found on {words}");
        if let Some(picture) = thumbnails.region(pair.target, &answer, &alt) {
            strip += &shown(&picture, &words);
            n_shown += 1;
        }
    }
    (n_shown > 0).then(|| format!("<div class=\"strip\">{strip}</div>\n"))
}

/// A source with its region, at the start of a strip.
fn demonstrated(source: &DrawnObject, caption: &str) -> String {
    format!(
        "<figure class=\"start\">{}<figcaption>{}</figcaption></figure>",
        source.own("with the demonstrated region"),
        escape(caption)
    )
}

/// A column for each group: the source coloured by position, and targets in the colours that the map
/// brings.
pub(super) fn colours(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    task: &Task,
) -> Result<String> {
    let columns = each_group(context, context.lead, task, |rows| colour_column(thumbnails, rows))?;
    if columns.is_empty() {
        return Ok(String::new());
    }
    let columns: String = columns
        .into_iter()
        .map(|(group, column)| format!("<div><h3>{}</h3>{column}</div>\n", escape(group)))
        .collect();
    Ok(format!(
        "<p>The whole map of {}, not only the region: each source (top) is painted by position, and each \
         target vertex has the colour of the place that it is mapped to. Equal colours are matched \
         places. Sources and targets are chosen as above; numbers are IoU.</p>\n\
         <div class=\"columns\">{columns}</div>\n",
        escape(context.lead)
    ))
}

fn colour_column(thumbnails: &Thumbnails<'_>, rows: &[&Row]) -> Option<String> {
    let rows = typical(thumbnails, rows, COLOURED_TARGETS);
    let source = thumbnails.pair(rows.first()?)?.source;
    let coloured = thumbnails.places(source, &format!("{} painted by position", source.name))?;
    let mut column = shown(&coloured, &source.name);
    let mut n_shown = 0;
    for row in rows {
        let Some((pair, answer)) = thumbnails.pair(row).zip(thumbnails.answer(row)) else {
            continue;
        };
        let alt = format!("{} in the colours of {}", row.target, row.source);
        if let Some(picture) = thumbnails.mapped(&pair, &answer, &alt) {
            column += &shown(&picture, &format!("{} ({})", row.target, number(row.iou, 2)));
            n_shown += 1;
        }
    }
    (n_shown > 0).then_some(column)
}

/// The worst pair of each group by geometry alone, with the leading method's answer beside it.
pub(super) fn wks(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    task: &Task,
) -> Result<String> {
    let method = Method::Wks.name();
    if !context.methods.contains(&method) {
        return Ok(String::new());
    }
    let groups = each_group(context, method, task, |rows| wks_strip(context, thumbnails, rows))?;
    if groups.is_empty() {
        return Ok(String::new());
    }
    let mut html = String::from(
        "<p>Functional maps from wave kernel signatures, the paper’s geometric baseline: the pair of each \
         group where it does worst.</p>\n",
    );
    html += &blocks(&groups);
    Ok(html)
}

fn wks_strip(context: &Context<'_>, thumbnails: &Thumbnails<'_>, rows: &[&Row]) -> Option<String> {
    let worst = by_iou(rows.to_vec()).into_iter().next_back()?;
    let pair = thumbnails.pair(worst)?;
    let DrawnPair { source, target } = pair;
    let mut answers = thumbnails.answers(worst);
    let answer = answers.remove(Method::Wks.name())?;
    let iou = number(worst.iou, 2);
    let on_target = format!("on {}, WKS, IoU {iou}", worst.target);
    let mut strip = demonstrated(source, &source.name);
    strip += &shown(&target.own("with the true region"), &format!("{}: truth", target.name));
    let found = thumbnails.region(target, &answer, &format!("region found {on_target}"))?;
    strip += &shown(&found, &format!("WKS ({iou})"));
    let error = thumbnails.error(target, &answer, Side::Best, &format!("error {on_target}"))?;
    strip += &shown(&error, "WKS: right, too much, missed");
    if answer.point_map.is_some() {
        let mapped = thumbnails.mapped(&pair, &answer, &format!("map {on_target}"))?;
        strip += &shown(&mapped, "WKS: colours of the source");
    }
    if let Some((answer, row)) = answers.remove(context.lead).zip(leading_row(context, worst)) {
        let words = format!("{} ({})", context.lead, number(row.iou, 2));
        let alt = format!("region found on {} by {words}", worst.target);
        strip += &shown(&thumbnails.region(target, &answer, &alt)?, &words);
    }
    Some(format!("<div class=\"strip\">{strip}</div>\n"))
}

/// One block for each group, side by side where there is space.
fn blocks(groups: &[(&str, String)]) -> String {
    let mut html = String::from("<div class=\"sheets\">\n");
    for (group, strip) in groups {
        html += &format!("<div><h3>{}</h3>\n{strip}</div>\n", escape(group));
    }
    html + "</div>\n"
}

/// The leading method's row on the same pair.
fn leading_row<'a>(context: &Context<'a>, row: &Row) -> Option<&'a Row> {
    let pair = row.pair_key();
    context.rows_of(context.lead).find(|other| other.pair_key() == pair)
}

/// What `draw` makes of each group's scored rows of a method, in the order of the groups.
fn each_group<'a>(
    context: &Context<'a>,
    method: &str,
    task: &Task,
    draw: impl Fn(&[&'a Row]) -> Option<String> + Sync,
) -> Result<Vec<(&'a str, String)>> {
    let drawn: Result<Vec<Option<(&str, String)>>> = context
        .groups
        .par_iter()
        .map(|&group| {
            task.check()?;
            let rows: Vec<&Row> = context
                .rows_of(method)
                .filter(|row| row.group == group && row.iou.is_some() && row.prediction.is_some())
                .collect();
            Ok(draw(&rows).map(|html| (group, html)))
        })
        .collect();
    Ok(drawn?.into_iter().flatten().collect())
}

/// The rows of the source that is nearest to the mean, at most `n`, spread from best to worst.
fn typical<'a>(thumbnails: &Thumbnails<'_>, rows: &[&'a Row], n: usize) -> Vec<&'a Row> {
    let rows: Vec<&Row> =
        rows.iter().copied().filter(|row| thumbnails.pair(row).is_some()).collect();
    spread(by_iou(of_typical_source(rows)), n)
}

/// The rows of the source whose mean IoU is nearest to that of all rows.
fn of_typical_source(rows: Vec<&Row>) -> Vec<&Row> {
    let mut sources: Vec<&str> = rows.iter().map(|row| row.source.as_str()).collect();
    sources.sort_unstable();
    sources.dedup();
    let by_source: Vec<Vec<&Row>> =
        sources.into_iter().map(|source| of_source(&rows, source)).collect();
    // A source with several targets shows more than one with a single target.
    let most = by_source.iter().map(|own| own.len().min(COLOURED_TARGETS)).max().unwrap_or(0);
    let overall = mean_iou(&rows);
    by_source
        .into_iter()
        .filter(|own| own.len() >= most)
        .map(|own| ((mean_iou(&own) - overall).abs(), own))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, own)| own)
        .unwrap_or_default()
}

fn of_source<'a>(rows: &[&'a Row], source: &str) -> Vec<&'a Row> {
    rows.iter().copied().filter(|row| row.source == source).collect()
}

fn mean_iou(rows: &[&Row]) -> f64 {
    rows.iter().filter_map(|row| row.iou).sum::<f64>() / rows.len() as f64
}

/// From the best to the worst.
fn by_iou(mut rows: Vec<&Row>) -> Vec<&Row> {
    rows.sort_by(|a, b| {
        b.iou_or_zero().total_cmp(&a.iou_or_zero()).then_with(|| a.key().cmp(&b.key()))
    });
    rows
}

/// At most `n` of them, evenly spread, first and last included.
fn spread<T: Copy>(all: Vec<T>, n: usize) -> Vec<T> {
    if all.len() <= n || n < 2 {
        return all.into_iter().take(n).collect();
    }
    (0..n).map(|i| all[i * (all.len() - 1) / (n - 1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(source: &str, target: &str, iou: f64) -> Row {
        let (source, target) = (source.into(), target.into());
        Row { source, target, iou: Some(iou), ..Row::default() }
    }

    #[test]
    fn the_typical_source_is_neither_the_best_nor_the_worst() {
        let rows = [
            row("best", "a", 0.9),
            row("best", "b", 1.0),
            row("middle", "a", 0.4),
            row("middle", "b", 0.7),
            row("worst", "a", 0.1),
            row("worst", "b", 0.2),
            row("lonely", "a", 0.55),
        ];
        let chosen = by_iou(of_typical_source(rows.iter().collect()));
        let names: Vec<_> = chosen.iter().map(|r| (&*r.source, &*r.target)).collect();
        assert_eq!(names, [("middle", "b"), ("middle", "a")]);
        assert!(of_typical_source(Vec::new()).is_empty());
    }

    #[test]
    fn a_spread_keeps_both_ends() {
        assert_eq!(spread((0..10).collect(), 3), [0, 4, 9]);
        assert_eq!(spread(vec![1, 2], 5), [1, 2]);
        assert_eq!(spread(vec![1, 2], 0), Vec::<i32>::new());
    }
}
