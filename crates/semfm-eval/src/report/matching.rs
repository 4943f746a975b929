//! The page of a matching evaluation: maps against true correspondences, beside another library.

use std::path::{Path, PathBuf};

use semfm::geom::io::write_atomically;
use serde::Deserialize;

use super::html::{Cell, Table, escape, plot};
use super::plots::{DrawError, curves};
use super::{FILE, shell};
use crate::matching::table::PYFM;
use crate::matching::{FORMAT, MapMethod, MatchingResults, MatchingSummary};
use crate::{Error, Result, results};

/// The results of a matching evaluation in a folder; none where its results are of another kind.
///
/// # Errors
/// [`Error::Io`] where there are no results, [`Error::Format`].
pub fn read(folder: &Path) -> Result<Option<MatchingResults>> {
    #[derive(Deserialize)]
    struct Kind {
        format: String,
    }
    let path = folder.join(results::FILE);
    let bytes = std::fs::read(&path).map_err(Error::io(&path))?;
    let unfit = |error: serde_json::Error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        Error::format(&path, place, "results of an evaluation", error.to_string())
    };
    let kind: Kind = serde_json::from_slice(&bytes).map_err(unfit)?;
    if kind.format != FORMAT {
        return Ok(None);
    }
    serde_json::from_slice(&bytes).map(Some).map_err(unfit)
}

/// Writes the page into `folder`.
///
/// # Errors
/// [`Error::Facade`] where it cannot be written.
pub fn write(results: &MatchingResults, folder: &Path) -> Result<PathBuf> {
    let page = page(results).map_err(|error: DrawError| Error::Io {
        path: FILE.into(),
        source: std::io::Error::other(error.to_string()),
    })?;
    let path = folder.join(FILE);
    write_atomically(&path, |out| out.write_all(page.as_bytes()))?;
    Ok(path)
}

fn page(results: &MatchingResults) -> std::result::Result<String, DrawError> {
    let mut sets: Vec<&str> = Vec::new();
    for summary in &results.summaries {
        if !sets.contains(&summary.set.as_str()) {
            sets.push(&summary.set);
        }
    }
    let name = results.path.file_name().unwrap_or(results.path.as_os_str()).to_string_lossy();
    let samples = match results.n_samples {
        0 => "all".to_owned(),
        n => format!("at most {n}"),
    };
    let head = format!(
        "<p>Functional maps on pairs of shapes whose true correspondence is known (folder “{}”, {samples} \
         samples a pair). The error is the mean geodesic distance between where a point is sent and \
         where it belongs, × 100 / √area of the source: lower is better. Rows in italics are \
         <em>quoted</em>: pyFM 1.3.1 on the same pairs, with all samples and another implementation of \
         geodesic distances.</p>\n",
        escape(&name)
    );
    let mut sections: Vec<(String, &str, String)> = Vec::new();
    for (number, set) in sets.iter().enumerate() {
        let body = table(results, set).html() + &figure(results, set)?;
        sections.push((format!("set{number}"), set, body));
    }
    let pairs = sets.iter().map(|set| pairs(results, set)).collect::<String>();
    sections.push(("pairs".into(), "All pairs", pairs + &failures(results)));
    let sections: Vec<(&str, &str, String)> =
        sections.iter().map(|(id, title, body)| (id.as_str(), *title, body.clone())).collect();
    Ok(shell("Maps against true correspondences", &head, "", &sections))
}

fn about(method: &str) -> &str {
    match method.parse::<MapMethod>() {
        Ok(known) => known.about(),
        Err(_) => method,
    }
}

fn of_set<'a>(results: &'a MatchingResults, set: &str) -> Vec<&'a MatchingSummary> {
    results.summaries.iter().filter(|summary| summary.set == set).collect()
}

fn table(results: &MatchingResults, set: &str) -> Table {
    let head = ["Method", "Error", "95 %", "Mirror", "Nearer of both", "Flips", "Map, ms", "Pairs"];
    let caption = "Mean error. Mirror: against the mirrored truth. Flips: pairs whose mirrored answer is nearer.";
    let mut table = Table::new(caption, head);
    for (name, _, error) in PYFM.iter().filter(|row| row.1 == set) {
        let rest = (0..6).map(|_| Cell::written(None, String::new()));
        let cells = [Cell::written(Some(*error), format!("{error:.1}"))].into_iter().chain(rest);
        table.line("quoted", name, "pyFM 1.3.1, quoted", cells);
    }
    let one = |x: Option<f64>| Cell::written(x, x.map_or("–".into(), |x| format!("{x:.1}")));
    for (place, s) in of_set(results, set).into_iter().enumerate() {
        let ends = s.interval.map_or("–".into(), |[low, high]| format!("{low:.1} … {high:.1}"));
        let flips = s.flip_rate.map_or("–".into(), |x| format!("{:.0} %", 100.0 * x));
        let ms = s.median_map_ms.map_or("–".into(), |x| format!("{x:.0}"));
        let cells = [
            one(s.error),
            Cell::written(None, ends),
            one(s.mirror_error),
            one(s.best_error),
            Cell::written(s.flip_rate, flips),
            Cell::written(s.median_map_ms, ms),
            Cell::written(Some(s.n as f64), s.n.to_string()),
        ];
        table.line(if place == 0 { "first" } else { "" }, about(&s.method), &s.method, cells);
    }
    table
}

fn figure(results: &MatchingResults, set: &str) -> std::result::Result<String, DrawError> {
    let summaries = of_set(results, set);
    let errors = |method: &str| {
        let rows = results.rows.iter().filter(|row| row.set == set && row.method == method);
        rows.filter_map(|row| row.error).collect::<Vec<f64>>()
    };
    let lines: Vec<Vec<f64>> = summaries.iter().map(|s| errors(&s.method)).collect();
    let high = lines.iter().flatten().copied().fold(0.0, f64::max);
    if high <= 0.0 {
        return Ok(String::new());
    }
    let legend: String = summaries
        .iter()
        .zip(curves::COLORS.iter().cycle())
        .map(|(s, [r, g, b])| {
            format!(
                "<li class=\"solid\" style=\"--c:rgb({r} {g} {b})\">{}</li>",
                escape(about(&s.method))
            )
        })
        .collect();
    let plot = plot(
        &curves::draw(&lines, (high * 1.02).ceil())?,
        "Share of pairs below each error, one line for each method.",
        "Share of pairs whose mean error is at most that on the horizontal axis: further left is better.",
    );
    Ok(format!("<ul class=\"legend\">{legend}</ul>\n{plot}"))
}

fn pairs(results: &MatchingResults, set: &str) -> String {
    let methods: Vec<&str> = of_set(results, set).iter().map(|s| s.method.as_str()).collect();
    let head = ["Pair"].into_iter().chain(methods.iter().copied());
    let mut table = Table::new(&format!("{set}: error of each pair"), head).sortable();
    let mut seen: Vec<(&str, &str)> = Vec::new();
    for row in results.rows.iter().filter(|row| row.set == set) {
        let pair = (row.source.as_str(), row.target.as_str());
        if seen.contains(&pair) {
            continue;
        }
        seen.push(pair);
        let error = |method: &&str| {
            let same = |r: &&crate::matching::MatchingRow| {
                r.set == set
                    && (r.source.as_str(), r.target.as_str()) == pair
                    && r.method == **method
            };
            let found = results.rows.iter().find(same).and_then(|row| row.error);
            Cell::written(found, found.map_or("–".into(), |x| format!("{x:.1}")))
        };
        table.line(
            "",
            &format!("{} → {}", pair.0, pair.1),
            "",
            methods.iter().map(error).collect::<Vec<_>>(),
        );
    }
    table.html()
}

fn failures(results: &MatchingResults) -> String {
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
    use crate::matching::MatchingRow;

    fn some_results() -> MatchingResults {
        let row = |target: &str, method: &str, error: Option<f64>| MatchingRow {
            set: "FAUST_r".into(),
            source: "a".into(),
            target: target.into(),
            method: method.into(),
            error,
            failure: error.is_none().then(|| "no <map>".into()),
            ..MatchingRow::default()
        };
        let summary = |method: &str, error: f64| MatchingSummary {
            set: "FAUST_r".into(),
            method: method.into(),
            n: 2,
            error: Some(error),
            interval: Some([error - 1.0, error + 1.0]),
            mirror_error: None,
            best_error: None,
            flip_rate: Some(0.5),
            median_map_ms: Some(12.0),
        };
        MatchingResults {
            format: FORMAT.into(),
            path: "matching".into(),
            dataset: "blake3:1".into(),
            n_samples: 0,
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
        assert_eq!(read(folder.path()).unwrap().unwrap(), results);
        let path = super::super::again(folder.path(), &Default::default(), &Default::default());
        let page = std::fs::read_to_string(path.unwrap()).unwrap();
        for word in ["FAUST_r", "quoted", "17.5", "no &lt;map&gt;", "<svg", "a → c"] {
            assert!(page.contains(word), "{word}");
        }
        // Quoted rows of this set only.
        let quoted = PYFM.iter().filter(|row| row.1 == "FAUST_r").count();
        assert_eq!(page.matches("<tr class=\"quoted\">").count(), quoted);
    }
}
