//! `index.html`: the evaluation as one page that needs no other file and no network.
//!
//! It opens from the results alone ([`again`] makes it anew). Where the objects and the predictions
//! are at hand as well, it holds pictures: categories, maps as colours, failures, and a gallery of
//! pairs. Numbers are those of [`Results`], written as in `table.md`.

mod confidence;
mod context;
mod gallery;
mod html;
mod maps;
mod pairs;
mod paper;
mod plots;
mod scores;
mod sheets;
mod thumbnails;
mod vlm;

use std::path::{Path, PathBuf};

use semfm::Task;
use semfm::geom::io::write_atomically;
use semfm_show::colors::{
    EXTRA, MISSED, NamedColor, QUOTED, QUOTED_VLM, RIGHT, SECOND, css_properties,
};
use semfm_show::html::policy;

use crate::dataset::Dataset;
use crate::results::Results;
use crate::{Error, Result};
use context::Context;
use html::{escape, section};
use thumbnails::Thumbnails;

pub use maps::{maps_again, write_maps};

/// The file in the output folder.
pub const FILE: &str = "index.html";

/// What the page holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportSettings {
    /// Side of each picture in pixels.
    pub picture_side: u32,
    /// Pairs in the gallery for the leading method, worst first.
    pub leading_cards: usize,
    /// Pairs in the gallery for each other method, worst first.
    pub other_cards: usize,
    /// What a vision-language model was shown and answered, as `semfm-vlm --pictures` keeps it.
    pub vlm_pictures: Option<PathBuf>,
}

impl Default for ReportSettings {
    /// Eleven methods on two hundred pairs make a page of some 10 MB.
    fn default() -> Self {
        Self { picture_side: 180, leading_cards: 240, other_cards: 30, vlm_pictures: None }
    }
}

/// Writes the page into `out`; `folder` is where the predictions of `results` are. Progress is counted in
/// pictures of the gallery.
///
/// # Errors
/// [`Error::Facade`] where the page cannot be written, cancellation. A picture that cannot be made
/// is missing from the page, which says so.
pub fn write(
    results: &Results,
    dataset: &Dataset,
    folder: &Path,
    out: &Path,
    settings: &ReportSettings,
    task: &Task,
) -> Result<WrittenReport> {
    let thumbnails = if dataset.hash == results.about.identity.dataset {
        Thumbnails::draw(dataset, results, folder, settings, task)?
    } else {
        Thumbnails::none("the objects have changed since they were evaluated")
    };
    write_with(results, &thumbnails, out, settings, task)
}

/// Makes the page in a folder anew from its results. Objects that are gone or have changed leave
/// the page without pictures, and it says so.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`] for the results; [`Error::Facade`] where the page cannot be
/// written, cancellation.
pub fn again(folder: &Path, settings: &ReportSettings, task: &Task) -> Result<WrittenReport> {
    let results = Results::read(folder)?;
    match Dataset::open(&results.about.origin) {
        Ok(dataset) => write(&results, &dataset, folder, folder, settings, task),
        Err(error) => {
            let thumbnails = Thumbnails::none(&format!("the objects cannot be opened ({error})"));
            write_with(&results, &thumbnails, folder, settings, task)
        }
    }
}

fn write_with(
    results: &Results,
    thumbnails: &Thumbnails<'_>,
    folder: &Path,
    settings: &ReportSettings,
    task: &Task,
) -> Result<WrittenReport> {
    let page = page(&Context::new(results), thumbnails, settings, task)?;
    let path = folder.join(FILE);
    write_atomically(&path, |out| out.write_all(page.as_bytes()))?;
    Ok(WrittenReport { path, notes: thumbnails.notes() })
}

/// A page that was written.
#[derive(Clone, Debug)]
pub struct WrittenReport {
    /// Where.
    pub path: PathBuf,
    /// Why it has fewer pictures than it could have; empty where nothing is missing.
    pub notes: Vec<String>,
}

fn page(
    context: &Context<'_>,
    thumbnails: &Thumbnails<'_>,
    settings: &ReportSettings,
    task: &Task,
) -> Result<String> {
    let paper = paper::body(context).map_err(cannot_draw)?;
    let scores = scores::body(context).map_err(cannot_draw)?;
    let confidence = confidence::body(context).map_err(cannot_draw)?;
    let sections = [
        ("paper", "Beside the paper", paper),
        ("scores", "Methods and groups", scores),
        ("categories", "Category sheet", sheets::categories(context, thumbnails, task)?),
        ("colours", "Maps as colours", sheets::colours(context, thumbnails, task)?),
        ("wks", "Where geometry alone fails", sheets::wks(context, thumbnails, task)?),
        ("vlm", "Vision-language model", vlm::body(context, thumbnails, settings, task)?),
        ("confidence", "Confidence", confidence),
        ("gallery", "Gallery of pairs", gallery::body(context, thumbnails, settings, task)?),
        ("pairs", "All pairs", pairs::body(context)),
    ];
    let sections = sections.map(|(id, title, body)| Section {
        id: id.to_owned(),
        title: title.to_owned(),
        body,
    });
    let head = context.head() + &thumbnails.missing();
    Ok(shell("How well regions are carried over", &head, &thumbnails.shared_style(), &sections))
}

/// A plot that cannot be drawn leaves no page.
fn cannot_draw(error: plots::DrawError) -> Error {
    Error::Io { path: FILE.into(), source: std::io::Error::other(error.to_string()) }
}

/// A part of the page with its heading; left out where the body is empty.
struct Section {
    id: String,
    title: String,
    body: String,
}

/// The document around some sections.
fn shell(title: &str, head: &str, style: &str, sections: &[Section]) -> String {
    let (mut links, mut bodies) = (String::new(), String::new());
    for Section { id, title, body } in sections.iter().filter(|s| !s.body.is_empty()) {
        links += &format!("<li><a href=\"#{id}\">{}</a></li>", escape(title));
        bodies += &section(id, title, body);
    }
    let style = format!(":root {{ {} }}\n{}{style}", style_colors(), include_str!("style.css"));
    let script = include_str!("page.js");
    // The policy makes sure of it: whatever is not in this page is not loaded.
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n{}\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}</title>\n<style>{style}</style>\n</head>\n<body>\n\
         <header>\n<h1>{title}</h1>\n{head}<nav aria-label=\"Contents\"><ul>{links}</ul></nav>\n\
         </header>\n<main>\n{bodies}</main>\n\
         <footer>Written by semfm {} from <code>results.json</code>; <code>table.md</code> holds the \
         same numbers as text.</footer>\n<script>{script}</script>\n</body>\n</html>\n",
        policy(&style, script),
        env!("CARGO_PKG_VERSION"),
    )
}

/// The colours that the plots and pictures have, too.
fn style_colors() -> String {
    css_properties(&[
        NamedColor { name: "right", color: RIGHT },
        NamedColor { name: "extra", color: EXTRA },
        NamedColor { name: "missed", color: MISSED },
        NamedColor { name: "quoted", color: QUOTED },
        NamedColor { name: "second", color: SECOND },
        NamedColor { name: "vlm", color: QUOTED_VLM },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::some_results;

    #[test]
    fn results_without_objects_still_make_a_page_that_says_so() {
        let folder = tempfile::tempdir().unwrap();
        some_results().write(folder.path()).unwrap();
        let WrittenReport { path, notes } =
            again(folder.path(), &ReportSettings::default(), &Task::default()).unwrap();
        assert!(notes[0].contains("the objects cannot be opened"), "{notes:?}");
        let page = std::fs::read_to_string(path).unwrap();
        assert!(page.contains("the objects cannot be opened"), "{page}");
        for word in ["fused", "nearest", "<svg", "no file", "cups"] {
            assert!(page.contains(word), "{word}");
        }
        for (open, close) in
            [("<section", "</section>"), ("<figure", "</figure>"), ("<table", "</table>")]
        {
            assert_eq!(page.matches(open).count(), page.matches(close).count(), "{open}");
        }
        for outside in ["http://", "https://"] {
            let found: Vec<_> =
                page.match_indices(outside).map(|(at, _)| &page[at..at + 40]).collect();
            let names = ["http://www.w3.org/2000/svg"]; // a name, not an address
            assert!(found.iter().all(|f| names.iter().any(|n| f.starts_with(n))), "{found:?}");
        }
    }

    #[test]
    fn a_cancelled_task_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (mut results, task) = (some_results(), Task::default());
        task.cancel();
        let origin = crate::dataset::DatasetOrigin::Synthetic {
            level: "easy".into(),
            seeds: vec![0],
            n_objects: 2,
        };
        let dataset = Dataset::open(&origin).unwrap();
        results.about.identity.dataset = dataset.hash.clone();
        let (at, settings) = (folder.path(), ReportSettings::default());
        let error = write(&results, &dataset, at, at, &settings, &task).unwrap_err();
        assert!(error.is_cancelled(), "{error}");
        assert!(!folder.path().join(FILE).exists());
    }

    /// A model's answer, which is the truth, on one pair of tools; its picture is kept in `pictures`.
    fn answered(folder: &Path, pictures: &Path) -> (Results, Dataset) {
        let origin = crate::dataset::DatasetOrigin::Synthetic {
            level: "easy".into(),
            seeds: vec![0],
            n_objects: 2,
        };
        let dataset = Dataset::open(&origin).unwrap();
        let truth = dataset.objects[1].load().unwrap().truth.vertices();
        let rows = folder.join("rows.json");
        let row = serde_json::json!({
            "group": "tools", "source": "tools_0_s0", "target": "tools_1_s0", "n_views": 1,
            "mode": "polygons", "model": "m", "real_model": false, "inconsistency": 0.25,
            "region": { "vertices": truth },
        });
        let file = serde_json::json!({ "format": crate::vlm::FORMAT, "rows": [row] });
        std::fs::write(&rows, file.to_string()).unwrap();
        let mut scored = crate::vlm::read(&rows, &dataset).unwrap();
        crate::vlm::keep(&rows, &mut scored, folder).unwrap();
        let own = pictures.join("tools/tools_0_s0--tools_1_s0--1");
        std::fs::create_dir_all(&own).unwrap();
        image::RgbImage::new(64, 64).save(own.join("answer-T1.png")).unwrap();
        let mut results = some_results();
        results.about.origin = origin;
        results.about.identity.dataset = dataset.hash.clone();
        results.rows.clear();
        (results.with_rows(scored), dataset)
    }

    #[test]
    fn a_model_s_answer_is_shown_beside_its_lift_and_called_what_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let pictures = folder.path().join("pictures");
        let (results, dataset) = answered(folder.path(), &pictures);
        let settings =
            ReportSettings { vlm_pictures: Some(pictures), picture_side: 48, ..Default::default() };
        let at = folder.path();
        let made = write(&results, &dataset, at, at, &settings, &Task::default()).unwrap();
        assert!(made.notes.is_empty(), "{:?}", made.notes);
        let page = std::fs::read_to_string(made.path).unwrap();
        for words in [
            "stand-in “m”, 1 view, IoU 1.00, inconsistency .25",
            "alt=\"answer in view 1 of tools_1_s0\"",
            "alt=\"lifted region on tools_1_s0, IoU 1.00\"",
            "no model was asked in this run",
        ] {
            assert!(page.contains(words), "{words}");
        }
        // Another set of objects: scores stay, pictures go, and the page says why.
        let mut other = results.clone();
        other.about.identity.dataset = "blake3:0".into();
        let made = write(&other, &dataset, at, at, &settings, &Task::default()).unwrap();
        let page = std::fs::read_to_string(made.path).unwrap();
        assert!(page.contains("the objects have changed") && !page.contains("<img"));
        // A file of predictions that is broken, or gone, is named.
        let kept = at.join(results.rows[0].prediction.as_deref().unwrap());
        for (text, word) in [(Some("{\"format\": 3"), "line 1"), (None, "No such file")] {
            match text {
                Some(text) => std::fs::write(&kept, text).unwrap(),
                None => std::fs::remove_file(&kept).unwrap(),
            }
            let made = write(&results, &dataset, at, at, &settings, &Task::default()).unwrap();
            let said = made.notes.join("; ");
            assert!(said.contains("1 file of predictions") && said.contains(word), "{said}");
            assert!(std::fs::read_to_string(made.path).unwrap().contains("of predictions cannot"));
        }
    }
}
