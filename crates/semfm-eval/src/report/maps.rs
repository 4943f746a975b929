//! The page of an evaluation of maps: error against true correspondences, beside another library.

use std::path::{Path, PathBuf};

use semfm::geom::io::{StagedFolder, printable, write_atomically};
use semfm_show::colors::{SERIES, hex};

use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, error_curves};
use super::{FILE, Section, cannot_draw, shell};
use crate::correspondence::{
    MapMethod, MapResults, MapRow, MapSummary, PYFM, interval, one_digit, percent, whole,
};
use crate::{Result, results, table};

/// Writes `results.json`, `table.md` and `index.html` into `folder`, which is made: all of them or
/// none.
///
/// # Errors
/// [`Error::Facade`](crate::Error::Facade) for what cannot be written.
pub fn write_maps(results: &MapResults, folder: &Path) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    results.write(staged.path())?;
    write_pages(results, staged.path())?;
    Ok(staged.put(&[results::FILE], &[])?)
}

/// Makes `table.md` and `index.html` in a folder anew from its results.
///
/// # Errors
/// As [`MapResults::read`]; [`Error::Facade`](crate::Error::Facade) for what cannot be written.
pub fn maps_again(folder: &Path) -> Result<Vec<PathBuf>> {
    let staged = StagedFolder::new(folder)?;
    write_pages(&MapResults::read(folder)?, staged.path())?;
    Ok(staged.put(&[], &[])?)
}

fn write_pages(results: &MapResults, folder: &Path) -> Result<()> {
    let page = page(results).map_err(cannot_draw)?;
    let markdown = results.to_markdown();
    let markdown = printable(&markdown);
    write_atomically(folder.join(table::FILE), |out| out.write_all(markdown.as_bytes()))?;
    write_atomically(folder.join(FILE), |out| out.write_all(page.as_bytes()))?;
    Ok(())
}

fn page(results: &MapResults) -> std::result::Result<String, DrawError> {
    let sets = results.sets();
    let name = results.path.file_name().unwrap_or(results.path.as_os_str()).to_string_lossy();
    let samples = match results.n_samples {
        0 => "all".to_owned(),
        n => format!("at most {n}"),
    };
    let head = format!(
        "<p>Functional maps on pairs of shapes whose true correspondence is known (folder “{}”, {samples} \
         samples a pair). The error is the mean geodesic distance between where a point is sent and \
         where it belongs, × 100 / √area of the source: lower is better. Between parts that no path joins \
         the greatest distance within a part counts. Rows in italics are \
         <em>quoted</em>: pyFM 1.3.1 on the same pairs, with all samples and another implementation of \
         geodesic distances.</p>\n",
        escape(&name)
    );
    let mut sections = Vec::new();
    for (number, set) in sets.iter().enumerate() {
        let body = set_table(results, set).html() + &figure(results, set)?;
        sections.push(Section { id: format!("set{number}"), title: (*set).to_owned(), body });
    }
    let pairs = sets.iter().map(|set| pairs(results, set)).collect::<String>();
    sections.push(Section {
        id: "pairs".into(),
        title: "All pairs".into(),
        body: pairs + &failures(results),
    });
    Ok(shell("Maps against true correspondences", &head, &series_style(), &sections))
}

/// The colour of each series for the style sheet: the page's policy lets no element bring its own.
fn series_style() -> String {
    let rules = SERIES.iter().enumerate();
    rules.map(|(i, &color)| format!(".series{i} {{ --c: {}; }}\n", hex(color))).collect()
}

fn about(method: &str) -> &str {
    match method.parse::<MapMethod>() {
        Ok(known) => known.about(),
        Err(_) => method,
    }
}

fn set_table(results: &MapResults, set: &str) -> Table {
    let head = ["Method", "Error", "95 %", "Mirror", "Nearer of both", "Flips", "Map, ms", "Pairs"];
    let caption = "Mean error. Mirror: against the mirrored truth. Flips: pairs whose mirrored answer is nearer.";
    let mut table = Table::new(caption, head);
    for quoted in PYFM.iter().filter(|row| row.set == set) {
        let error = one_value(Some(quoted.error));
        let rest = (0..6).map(|_| Cell::written(None, String::new()));
        table.line("quoted", quoted.method, "pyFM 1.3.1, quoted", [error].into_iter().chain(rest));
    }
    for (place, s) in results.of_set(set).into_iter().enumerate() {
        let class = if place == 0 { "first" } else { "" };
        table.line(class, about(&s.method), &s.method, cells(s));
    }
    table
}

fn cells(s: &MapSummary) -> [Cell; 7] {
    [
        one_value(s.error),
        Cell::written(None, interval(s.interval)),
        one_value(s.mirror_error),
        one_value(s.best_error),
        Cell::written(s.flip_rate, percent(s.flip_rate)),
        Cell::written(s.median_map_ms, whole(s.median_map_ms)),
        Cell::written(Some(s.n as f64), s.n.to_string()),
    ]
}

/// A value with one digit after the point.
fn one_value(x: Option<f64>) -> Cell {
    Cell::written(x, one_digit(x))
}

fn figure(results: &MapResults, set: &str) -> std::result::Result<String, DrawError> {
    let summaries = results.of_set(set);
    let errors: Vec<Vec<f64>> =
        summaries.iter().map(|s| errors_of(results, set, &s.method)).collect();
    let high = errors.iter().flatten().copied().fold(0.0, f64::max);
    if high <= 0.0 {
        return Ok(String::new());
    }
    let mut legend = String::new();
    for (s, series) in summaries.iter().zip((0..SERIES.len()).cycle()) {
        let words = escape(about(&s.method));
        legend += &format!("<li class=\"solid series{series}\">{words}</li>");
    }
    let plot = plot(
        &error_curves::draw(&errors, (high * 1.02).ceil())?,
        "Share of pairs below each error, one line for each method.",
        "Share of pairs whose mean error is at most that on the horizontal axis: further left is better.",
    );
    Ok(format!("<ul class=\"legend\">{legend}</ul>\n{plot}"))
}

fn errors_of(results: &MapResults, set: &str, method: &str) -> Vec<f64> {
    let rows = results.rows.iter().filter(|row| row.set == set && row.method == method);
    // Results that another program wrote may hold anything; an axis has an end.
    rows.filter_map(|row| row.error).filter(|error| error.is_finite()).collect()
}

fn pairs(results: &MapResults, set: &str) -> String {
    let methods: Vec<&str> = results.of_set(set).iter().map(|s| s.method.as_str()).collect();
    let head = ["Pair"].into_iter().chain(methods.iter().copied());
    let mut table = Table::new(&format!("{set}: error of each pair"), head).sortable();
    let mut seen: Vec<[&str; 2]> = Vec::new();
    for row in results.rows.iter().filter(|row| row.set == set) {
        let pair = [row.source.as_str(), row.target.as_str()];
        if seen.contains(&pair) {
            continue;
        }
        seen.push(pair);
        let own = results.rows.iter().filter(|r| is_of_pair(r, set, pair)).collect::<Vec<_>>();
        let cells: Vec<Cell> = methods
            .iter()
            .map(|method| own.iter().find(|row| row.method == *method))
            .map(|row| one_value(row.and_then(|row| row.error)))
            .collect();
        table.line("", &format!("{} → {}", row.source, row.target), "", cells);
    }
    table.html()
}

fn is_of_pair(row: &MapRow, set: &str, [source, target]: [&str; 2]) -> bool {
    row.set == set && row.source == source && row.target == target
}

fn failures(results: &MapResults) -> String {
    let mut table = Table::new("Pairs without a map", ["Pair", "Set", "Method", "What happened"]);
    for row in &results.rows {
        if let Some(failure) = &row.failure {
            let cells = [&row.set, &row.method, failure].map(|text| Cell::text(text));
            table.line("", &format!("{} → {}", row.source, row.target), "", cells);
        }
    }
    if table.is_empty() { String::new() } else { table.html() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::MAP_FORMAT;

    fn row(target: &str, method: &str, error: Option<f64>) -> MapRow {
        MapRow {
            set: "FAUST_r".into(),
            source: "a".into(),
            target: target.into(),
            method: method.into(),
            error,
            failure: error.is_none().then(|| "no <map>".into()),
            ..MapRow::default()
        }
    }

    fn summary(method: &str, error: f64) -> MapSummary {
        MapSummary {
            set: "FAUST_r".into(),
            method: method.into(),
            n: 2,
            error: Some(error),
            interval: Some([error - 1.0, error + 1.0]),
            mirror_error: None,
            best_error: None,
            flip_rate: Some(0.5),
            median_map_ms: Some(12.0),
        }
    }

    fn some_results() -> MapResults {
        MapResults {
            format: MAP_FORMAT.into(),
            path: "matching".into(),
            dataset: "blake3:1".into(),
            n_samples: 0,
            precise: false,
            rows: vec![
                row("b", "wks", Some(17.5)),
                row("c", "wks", None),
                row("b", "landmarks", Some(3.2)),
                row("c", "landmarks", Some(4.1)),
            ],
            summaries: vec![summary("wks", 17.5), summary("landmarks", 3.65)],
        }
    }

    #[test]
    fn the_page_is_made_again_from_its_results() {
        let folder = tempfile::tempdir().unwrap();
        let results = some_results();
        results.write(folder.path()).unwrap();
        let read = MapResults::read(folder.path()).unwrap();
        assert_eq!(read, results);
        assert_eq!(write_maps(&read, folder.path()).unwrap().len(), 3);
        let files = maps_again(folder.path()).unwrap();
        assert_eq!(files, [FILE, table::FILE].map(|name| folder.path().join(name)));
        let page = std::fs::read_to_string(&files[0]).unwrap();
        for word in ["FAUST_r", "quoted", "17.5", "no &lt;map&gt;", "<svg", "a → c"] {
            assert!(page.contains(word), "{word}");
        }
        // An error without end does not reach the axis, which has one.
        let mut endless = read;
        endless.rows[0].error = Some(f64::INFINITY);
        assert!(write_maps(&endless, folder.path()).is_ok());
        // Quoted rows of this set only.
        let quoted = PYFM.iter().filter(|row| row.set == "FAUST_r").count();
        assert_eq!(page.matches("<tr class=\"quoted\">").count(), quoted);
    }
}
