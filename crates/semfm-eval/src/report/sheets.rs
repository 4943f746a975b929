//! The paper's picture sheets from our own runs: categories, maps as colours, failures of geometry.
//!
//! What is shown is chosen by rule, not by looks: in each group the source whose mean IoU is nearest
//! to the group's, with targets spread evenly from its best to its worst.

use rayon::prelude::*;
use semfm::Task;

use super::album::{Album, Side};
use super::context::Context;
use super::html::{escape, shown};
use crate::Result;
use crate::candidate::Candidate;
use crate::row::Row;
use crate::table::number;

/// Targets of each group in the category sheet.
const SHEET_TARGETS: usize = 5;
/// Targets of each group under the coloured source, as in the paper.
const COLOURED_TARGETS: usize = 3;

/// Each group: a source with its region, and targets with what arrived there.
pub(super) fn categories(context: &Context<'_>, album: &Album<'_>, task: &Task) -> Result<String> {
    let groups = each_group(context, task, |rows| {
        let rows = typical(album, rows, SHEET_TARGETS);
        let (source, _) = album.pair(rows.first()?)?;
        let mut strip = format!(
            "<figure class=\"start\">{}<figcaption>{}: demonstrated</figcaption></figure>",
            source.own("with the demonstrated region"),
            escape(&source.name)
        );
        let mut n_shown = 0;
        for row in rows {
            let Some(((_, target), answer)) = album.pair(row).zip(album.answer(row)) else {
                continue;
            };
            let words = format!("{} ({})", target.name, number(row.iou, 2));
            let alt = format!("region found on {words}");
            if let Some(picture) = album.region(target, &answer, &alt) {
                strip += &shown(&picture, &words);
                n_shown += 1;
            }
        }
        (n_shown > 0).then(|| format!("<div class=\"strip\">{strip}</div>\n"))
    })?;
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

/// A column for each group: the source painted by position, and targets in the colours that the map
/// brings.
pub(super) fn colours(context: &Context<'_>, album: &Album<'_>, task: &Task) -> Result<String> {
    let columns = each_group(context, task, |rows| {
        let rows = typical(album, rows, COLOURED_TARGETS);
        let (source, _) = album.pair(rows.first()?)?;
        let painted = album.places(source, &format!("{} painted by position", source.name))?;
        let mut column = shown(&painted, &source.name);
        let mut n_shown = 0;
        for row in rows {
            let Some((pair, answer)) = album.pair(row).zip(album.answer(row)) else { continue };
            let alt = format!("{} in the colours of {}", row.target, row.source);
            if let Some(picture) = album.carried(pair, &answer, &alt) {
                column += &shown(&picture, &format!("{} ({})", row.target, number(row.iou, 2)));
                n_shown += 1;
            }
        }
        (n_shown > 0).then_some(column)
    })?;
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

/// The worst pair of each group by geometry alone, with the leading method's answer beside it.
pub(super) fn wks(context: &Context<'_>, album: &Album<'_>, task: &Task) -> Result<String> {
    let method = Candidate::Wks.name();
    if !context.methods.contains(&method) {
        return Ok(String::new());
    }
    let groups = each_group_of(context, method, task, |rows| {
        let worst = by_iou(rows.to_vec()).into_iter().next_back()?;
        let (source, target) = album.pair(worst)?;
        let mut answers = album.answers(worst);
        let answer = answers.remove(method)?;
        let iou = number(worst.iou, 2);
        let alt = |what: &str| format!("{what} on {}, WKS, IoU {iou}", worst.target);
        let mut strip = format!(
            "<figure class=\"start\">{}<figcaption>{}</figcaption></figure>",
            source.own("with the demonstrated region"),
            escape(&source.name)
        );
        strip += &shown(&target.own("with the true region"), &format!("{}: truth", target.name));
        strip +=
            &shown(&album.region(target, &answer, &alt("region found"))?, &format!("WKS ({iou})"));
        strip += &shown(
            &album.error(target, &answer, Side::Best, &alt("error"))?,
            "WKS: right, too much, missed",
        );
        if answer.has_map() {
            strip += &shown(
                &album.carried((source, target), &answer, &alt("map"))?,
                "WKS: colours of the source",
            );
        }
        if let Some((answer, row)) = answers.remove(context.lead).zip(twin(context, worst)) {
            let words = format!("{} ({})", context.lead, number(row.iou, 2));
            let alt = format!("region found on {} by {words}", worst.target);
            strip += &shown(&album.region(target, &answer, &alt)?, &words);
        }
        Some(format!("<div class=\"strip\">{strip}</div>\n"))
    })?;
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

/// One block for each group, side by side where there is room.
fn blocks(groups: &[(&str, String)]) -> String {
    let block = |(group, strip): &(&str, String)| {
        format!("<div><h3>{}</h3>\n{strip}</div>\n", escape(group))
    };
    format!("<div class=\"sheets\">\n{}</div>\n", groups.iter().map(block).collect::<String>())
}

/// The leading method's row on the same pair.
fn twin<'a>(context: &Context<'a>, row: &Row) -> Option<&'a Row> {
    let pair = |row: &Row| (row.group.clone(), row.source.clone(), row.target.clone());
    context.rows_of(context.lead).find(|other| pair(other) == pair(row))
}

fn each_group<'a>(
    context: &Context<'a>,
    task: &Task,
    draw: impl Fn(&[&'a Row]) -> Option<String> + Sync,
) -> Result<Vec<(&'a str, String)>> {
    each_group_of(context, context.lead, task, draw)
}

/// What `draw` makes of each group's scored rows of a method, in the order of the groups.
fn each_group_of<'a>(
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
            let scored =
                |row: &&Row| row.group == group && row.iou.is_some() && row.prediction.is_some();
            let rows: Vec<&Row> = context.rows_of(method).filter(scored).collect();
            Ok(draw(&rows).map(|html| (group, html)))
        })
        .collect();
    Ok(drawn?.into_iter().flatten().collect())
}

/// The rows of the source that is nearest to the mean, at most `n`, spread from best to worst.
fn typical<'a>(album: &Album<'_>, rows: &[&'a Row], n: usize) -> Vec<&'a Row> {
    let rows: Vec<&Row> = rows.iter().copied().filter(|row| album.pair(row).is_some()).collect();
    spread(by_iou(of_typical_source(rows)), n)
}

fn of_typical_source(rows: Vec<&Row>) -> Vec<&Row> {
    let mean =
        |rows: &[&Row]| rows.iter().filter_map(|row| row.iou).sum::<f64>() / rows.len() as f64;
    let of =
        |source: &str| rows.iter().copied().filter(|row| row.source == source).collect::<Vec<_>>();
    let mut sources: Vec<&str> = rows.iter().map(|row| row.source.as_str()).collect();
    sources.sort_unstable();
    sources.dedup();
    // A source with several targets shows more than one with a single target.
    let most =
        sources.iter().map(|source| of(source).len().min(COLOURED_TARGETS)).max().unwrap_or(0);
    let overall = mean(&rows);
    let off = |source: &str| (mean(&of(source)) - overall).abs();
    let rich = sources.into_iter().filter(|source| of(source).len() >= most);
    let chosen = rich.min_by(|a, b| off(a).total_cmp(&off(b)));
    chosen.map(of).unwrap_or_default()
}

/// From the best to the worst.
fn by_iou(mut rows: Vec<&Row>) -> Vec<&Row> {
    let iou = |row: &Row| row.iou.unwrap_or(0.0);
    rows.sort_by(|a, b| iou(b).total_cmp(&iou(a)).then_with(|| a.key().cmp(&b.key())));
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
