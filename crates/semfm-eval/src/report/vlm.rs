//! What a vision-language model marked in its views, beside what became of it on the surface.

use std::path::{Path, PathBuf};

use image::imageops::FilterType;
use semfm::Task;
use semfm::geom::io::read_file;
use semfm_show::html::jpeg_data_uri;

use super::ReportSettings;
use super::context::Context;
use super::html::{escape, img, shown};
use super::thumbnails::{Side, Thumbnails};
use crate::Result;
use crate::row::Row;
use crate::table::number;

/// Rows that are shown: half the best, half the worst.
const ROWS: usize = 6;
/// Views of each.
const VIEWS: usize = 3;

/// The section: pictures where there are answers, else one line.
///
/// # Errors
/// Only cancellation.
pub(super) fn body(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    settings: &ReportSettings,
    task: &Task,
) -> Result<String> {
    let rows = context.results.rows.iter();
    let mut rows: Vec<&Row> = rows
        .filter(|row| row.vlm.is_some() && row.iou.is_some() && row.prediction.is_some())
        .collect();
    if rows.is_empty() {
        return Ok(
            "<p>No rows of a vision-language model are in these results, so there is no overlay \
                   to show beside its lift; its numbers above are quoted from the paper.</p>\n"
                .into(),
        );
    }
    rows.sort_by(|a, b| {
        b.iou_or_zero().total_cmp(&a.iou_or_zero()).then_with(|| a.key().cmp(&b.key()))
    });
    let middle = rows.len().saturating_sub(ROWS);
    if middle > 0 {
        rows.drain(ROWS / 2..ROWS / 2 + middle);
    }
    let mut html = format!(
        "<p>Left: the region that the model marked in views of the target, in red. Right: the same lifted \
         to the surface, and its error.{}</p>\n",
        if middle > 0 { " The best answers, then the worst." } else { "" }
    );
    for row in rows {
        task.check()?;
        html += &strip(thumbnails, row, settings).unwrap_or_default();
    }
    Ok(html)
}

fn strip(thumbnails: &Thumbnails<'_>, row: &Row, settings: &ReportSettings) -> Option<String> {
    let (vlm, target) = (row.vlm.as_ref()?, thumbnails.pair(row)?.target);
    let answer = thumbnails.answer(row)?;
    let model =
        if vlm.real_model { vlm.model.clone() } else { format!("stand-in “{}”", vlm.model) };
    let inconsistency =
        vlm.inconsistency.map(|x| format!(", inconsistency {}", number(Some(x), 2)));
    let title = format!(
        "{} → {}: {model}, {} {}, IoU {}{}",
        row.source,
        row.target,
        vlm.n_views,
        if vlm.n_views == 1 { "view" } else { "views" },
        number(row.iou, 2),
        inconsistency.unwrap_or_default()
    );
    let mut strip = String::new();
    let folder = settings.vlm_pictures.as_deref().map(|root| folder_of(root, row, vlm.n_views));
    for view in 1..=vlm.n_views.min(VIEWS) {
        let overlay =
            folder.as_deref().and_then(|folder| overlay(folder, view, settings.picture_side));
        if let Some(uri) = overlay {
            let alt = format!("answer in view {view} of {}", row.target);
            strip += &shown(&img(&uri, &alt), &format!("answer, view {view}"));
        }
    }
    let alt = format!("on {}, IoU {}", row.target, number(row.iou, 2));
    strip +=
        &shown(&thumbnails.region(target, &answer, &format!("lifted region {alt}"))?, "lifted");
    for (side, words) in [(Side::Best, "error"), (Side::Other, "error, other side")] {
        strip +=
            &shown(&thumbnails.error(target, &answer, side, &format!("{words} {alt}"))?, words);
    }
    Some(format!("<h3>{}</h3>\n<div class=\"strip\">{strip}</div>\n", escape(&title)))
}

/// Where `semfm-vlm --pictures` keeps what was asked and answered on a pair.
fn folder_of(root: &Path, row: &Row, n_views: usize) -> PathBuf {
    let group: String = row.group.chars().map(|c| if is_kept(c) { c } else { '_' }).collect();
    root.join(group).join(format!("{}--{}--{n_views}", row.source, row.target))
}

/// Whether `semfm-vlm` leaves a character of a folder's name as it is.
fn is_kept(c: char) -> bool {
    c.is_alphanumeric() || "-_. ".contains(c)
}

/// The answer in one view, made small.
fn overlay(folder: &Path, view: usize, side: u32) -> Option<String> {
    let bytes = read_file(folder.join(format!("answer-T{view}.png"))).ok()?;
    let picture = image::load_from_memory(&bytes).ok()?;
    let small = picture.resize(side, side, FilterType::Triangle).to_rgb8();
    jpeg_data_uri(small.as_raw(), small.width(), small.height())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_found_and_made_small() {
        let root = tempfile::tempdir().unwrap();
        let row = Row {
            group: "1 tools/x".into(),
            source: "a".into(),
            target: "b".into(),
            ..Row::default()
        };
        let folder = folder_of(root.path(), &row, 3);
        assert_eq!(folder, root.path().join("1 tools_x/a--b--3"));
        std::fs::create_dir_all(&folder).unwrap();
        image::RgbImage::from_pixel(512, 512, image::Rgb([200, 0, 0]))
            .save(folder.join("answer-T1.png"))
            .unwrap();
        let uri = overlay(&folder, 1, 64).unwrap();
        assert!(uri.len() < 3000, "{} bytes", uri.len());
        assert_eq!(overlay(&folder, 2, 64), None);
    }
}
