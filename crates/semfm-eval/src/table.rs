//! `table.md`: the results for people who read text.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use semfm::geom::io::{printable, write_atomically};

use crate::Result;
use crate::dataset::DatasetOrigin;
use crate::published::{self, PublishedRow};
use crate::results::Results;
use crate::summary::{Difference, Scope, ScoreTable, Summary};

/// The file in the output folder.
pub const FILE: &str = "table.md";
/// Failures are listed up to this many.
const LISTED: usize = 20;

/// Writes `table.md` into `folder`.
///
/// # Errors
/// [`crate::Error::Facade`] where it cannot be written.
pub fn write(results: &Results, folder: &Path) -> Result<PathBuf> {
    let path = folder.join(FILE);
    let text = render(results);
    write_atomically(&path, |out| out.write_all(text.as_bytes()))?;
    Ok(path)
}

/// The whole page as Markdown, safe for a terminal: names and failures are other people's text.
pub fn render(results: &Results) -> String {
    let table = ScoreTable::new(&results.rows);
    let page = Markdown {
        results,
        groups: table.groups(),
        categories: table.categories(),
        methods: table.methods,
    };
    let sections = [
        page.head(),
        page.accuracy(),
        page.intervals(),
        page.differences(),
        page.calibration(),
        page.times(),
        page.paper(),
        page.failures(),
    ];
    let sections: Vec<String> = sections.into_iter().filter(|text| !text.is_empty()).collect();
    printable(&sections.join("\n")).into_owned()
}

struct Markdown<'a> {
    results: &'a Results,
    methods: Vec<&'a str>,
    groups: Vec<&'a str>,
    categories: Vec<&'a str>,
}

/// One of our categories that is the paper's number `place`.
struct PaperCategory<'a> {
    place: usize,
    name: &'a str,
}

struct Column {
    name: String,
    scope: Scope,
}

impl Markdown<'_> {
    fn summary(&self, scope: &Scope, method: &str) -> Option<&Summary> {
        self.results.summary(scope, method)
    }

    fn head(&self) -> String {
        let about = &self.results.about;
        let what = match &about.origin {
            DatasetOrigin::Folder { path } => format!("folder `{}`", path.display()),
            DatasetOrigin::Synthetic { level, seeds, n_objects } => format!(
                "procedural objects, simulated features of level {level}, seeds {seeds:?}, \
                 {n_objects} objects of each category and seed"
            ),
        };
        let pairs = self.results.rows.iter().map(|row| (&row.group, &row.source, &row.target));
        let n_pairs = pairs.collect::<std::collections::BTreeSet<_>>().len();
        format!(
            "# Evaluation\n\n{what}: {n_pairs} ordered pairs of {} objects; features from {}; seed {}.\n\
             Dataset {}.\n",
            self.results.objects.len(),
            about.identity.embeddings,
            about.seed,
            about.identity.dataset,
        )
    }

    /// A column for each group, and one for all pairs.
    fn columns(&self) -> Vec<Column> {
        let groups = self
            .groups
            .iter()
            .map(|&name| Column { name: name.to_owned(), scope: Scope::Group(name.into()) });
        groups.chain([Column { name: "all".into(), scope: Scope::All }]).collect()
    }

    fn accuracy(&self) -> String {
        let columns = self.columns();
        let names = columns.iter().map(|Column { name, scope }| {
            let n = self.methods.iter().filter_map(|m| Some(self.summary(scope, m)?.n)).max();
            format!("{name} ({})", n.unwrap_or(0))
        });
        let last = ["mean of categories", "± std", "< .3", "by area"].map(str::to_owned);
        let mut text = String::from("## Accuracy\n\nMean vertex IoU (pairs).\n\n");
        text += &header(["method".to_owned()].into_iter().chain(names).chain(last));
        for &method in &self.methods {
            let mut cells = vec![method.to_owned()];
            for Column { scope, .. } in &columns {
                cells.push(number(self.summary(scope, method).and_then(|s| s.mean), 2));
            }
            let all = self.summary(&Scope::All, method);
            let categories = self.summary(&Scope::MeanOfCategories, method);
            cells.push(number(categories.and_then(|s| s.mean), 3));
            cells.push(number(all.and_then(|s| s.std), 2));
            cells.push(number(all.and_then(|s| s.below_poor), 2));
            cells.push(number(all.and_then(|s| s.area_mean), 2));
            text += &line(cells);
        }
        if let Some(first) = self.methods.first().filter(|_| self.methods.contains(&"oracle")) {
            let mut cells = vec![format!("{first} between the bounds")];
            for Column { scope, .. } in &columns {
                cells.push(percent(self.summary(scope, first).and_then(|s| s.between_bounds)));
            }
            cells.push(percent(
                self.summary(&Scope::MeanOfCategories, first).and_then(|s| s.between_bounds),
            ));
            cells.extend([const { String::new() }; 3]);
            text += &line(cells);
        }
        text
    }

    fn intervals(&self) -> String {
        let names =
            ["method", "mean", "95 %", "anchors landed", "anchor distance, √area", "failed"];
        let mut text = String::from("## Over all pairs\n\nIntervals by resampling objects.\n\n");
        text += &header(names.map(str::to_owned));
        for &method in &self.methods {
            let Some(s) = self.summary(&Scope::All, method) else { continue };
            text += &line([
                method.to_owned(),
                number(s.mean, 3),
                interval(s.interval, false),
                number(s.anchor_landed, 2),
                number(s.anchor_distance, 3),
                s.n_failed.to_string(),
            ]);
        }
        text
    }

    /// The other methods against the first.
    fn differences(&self) -> String {
        let Some(&first) = self.methods.first() else { return String::new() };
        let ours: Vec<&Difference> =
            self.results.differences.iter().filter(|d| d.against == first).collect();
        if ours.is_empty() {
            return String::new();
        }
        let columns = self.columns();
        let mut text = format!(
            "## Against {first}\n\nMean difference in IoU, pair by pair; **bold** where the 95 % interval \
             excludes 0.\n\n"
        );
        let names = columns.iter().map(|column| column.name.clone());
        text += &header(["method".to_owned()].into_iter().chain(names).chain(["95 %, all".into()]));
        for &method in &self.methods[1..] {
            let own: Vec<&Difference> =
                ours.iter().copied().filter(|d| d.method == method).collect();
            let Some(over_all) = own.iter().find(|d| d.scope == Scope::All) else { continue };
            let mut cells = vec![method.to_owned()];
            for Column { scope, .. } in &columns {
                let found = own.iter().find(|d| d.scope == *scope);
                cells.push(found.map_or_else(dash, |d| {
                    let text = format!("{:+.2}", d.mean);
                    if d.sign() == 0 { text } else { format!("**{text}**") }
                }));
            }
            cells.push(interval(over_all.interval, true));
            text += &line(cells);
        }
        text
    }

    fn calibration(&self) -> String {
        if self.results.calibration.is_empty() {
            return String::new();
        }
        let mut text = String::from(
            "## Confidence\n\nA right answer has IoU ≥ .5. AUC: chance that a right answer is trusted \
             more than a wrong one. Verdicts: answers (mean IoU).\n\n",
        );
        let names = ["method", "right", "AUC", "calibration error", "accept", "check", "refuse"];
        text += &header(names.map(str::to_owned));
        for calibration in &self.results.calibration {
            let mut cells = vec![
                calibration.method.clone(),
                number(Some(calibration.right), 2),
                number(calibration.auc, 2),
                number(Some(calibration.calibration_error), 2),
            ];
            use semfm::Verdict::{Accept, Check, Refuse};
            for verdict in [Accept, Check, Refuse] {
                let found = calibration.verdicts.iter().find(|v| v.verdict == verdict);
                cells.push(found.map_or_else(dash, |v| format!("{} ({:.2})", v.n, v.mean_iou)));
            }
            text += &line(cells);
        }
        text
    }

    fn times(&self) -> String {
        let mut text = String::from(
            "## Time\n\nMedians. Matching: from prepared objects to the region. Cold: from embeddings, nothing \
             cached. Whole: from meshes, views and encoder included.\n\n",
        );
        text += &header(["method", "matching, ms", "cold, ms", "whole, s"].map(str::to_owned));
        for &method in &self.methods {
            let Some(s) = self.summary(&Scope::All, method) else { continue };
            text += &line([
                method.into(),
                whole_number(s.median_matching_ms),
                whole_number(s.median_cold_ms),
                s.median_paper_runtime.map_or_else(dash, |x| format!("{x:.2}")),
            ]);
        }
        text
    }

    /// The paper's table beside ours, where the categories are the paper's.
    fn paper(&self) -> String {
        let places: Vec<PaperCategory<'_>> = self
            .categories
            .iter()
            .filter_map(|&name| {
                Some(PaperCategory { place: published::paper_category(name)?, name })
            })
            .collect();
        if places.len() < published::CATEGORIES.len() {
            return String::new();
        }
        let mut text = String::from(
            "## Beside the paper\n\n*Quoted* rows are the paper's own numbers: other meshes and another \
             encoder, so no contest.\n",
        );
        text += &self.paper_table(&places, "Mean IoU.", &published::IOU, |s| s.mean);
        let title = "Seconds a transfer, from meshes.";
        text += &self.paper_table(&places, title, &published::SECONDS, |s| s.median_paper_runtime);
        text
    }

    /// Quoted rows, then ours; `categories` holds the place of each of ours among the paper's.
    fn paper_table(
        &self,
        categories: &[PaperCategory<'_>],
        title: &str,
        quoted: &[PublishedRow],
        of: fn(&Summary) -> Option<f64>,
    ) -> String {
        let mut text = format!("\n{title}\n\n");
        let names = published::CATEGORIES.map(str::to_owned);
        text += &header(["method".to_owned()].into_iter().chain(names).chain(["mean".into()]));
        for row in quoted {
            let values = row.values.iter().map(|x| format!("{x:.2}"));
            let name = format!("*{} (quoted)*", row.method);
            text += &line([name].into_iter().chain(values).chain([format!("{:.3}", row.mean())]));
        }
        for &method in &self.methods {
            let values: Vec<Option<f64>> = (0..published::CATEGORIES.len())
                .map(|place| {
                    let own = categories.iter().find(|category| category.place == place)?;
                    of(self.summary(&Scope::Category(own.name.into()), method)?)
                })
                .collect();
            if values.iter().all(Option::is_none) {
                continue;
            }
            let known: Vec<f64> = values.iter().flatten().copied().collect();
            let mean = known.iter().sum::<f64>() / known.len() as f64;
            let cells = values.iter().map(|x| number(*x, 2));
            text +=
                &line([method.to_owned()].into_iter().chain(cells).chain([number(Some(mean), 3)]));
        }
        text
    }

    fn failures(&self) -> String {
        let failed: Vec<_> =
            self.results.rows.iter().filter_map(|row| Some((row, row.failure.as_ref()?))).collect();
        if failed.is_empty() {
            return String::new();
        }
        let mut text = format!("## Failures ({})\n\n", failed.len());
        for (row, failure) in failed.iter().take(LISTED) {
            let [group, source, target, method] = row.key();
            let words = failure.text.replace('\n', " ");
            let _ = writeln!(
                text,
                "- {group}: {source} → {target}, {method}: {} ({words})",
                failure.kind
            );
        }
        if failed.len() > LISTED {
            let _ = writeln!(text, "- and {} more in `results.json`", failed.len() - LISTED);
        }
        text
    }
}

/// A section that lists what failed, one line each; nothing where nothing did.
pub(crate) fn failures(lines: impl IntoIterator<Item = String>) -> String {
    let lines: Vec<String> = lines.into_iter().map(|line| format!("- {line}\n")).collect();
    match lines.len() {
        0 => String::new(),
        n => format!("\n## Failures ({n})\n\n{}", lines.concat()),
    }
}

pub(crate) fn header(names: impl IntoIterator<Item = String>) -> String {
    let names: Vec<String> = names.into_iter().collect();
    let rule = vec!["---".to_owned(); names.len()];
    line(names) + &line(rule)
}

pub(crate) fn line(cells: impl IntoIterator<Item = String>) -> String {
    let escaped: Vec<String> = cells.into_iter().map(|cell| cell.replace('|', "\\|")).collect();
    format!("| {} |\n", escaped.join(" | "))
}

pub(crate) fn dash() -> String {
    "–".into()
}

/// `0.74` as `.74`, as the paper and this project's pages write shares.
pub(crate) fn number(value: Option<f64>, digits: usize) -> String {
    let Some(value) = value else { return dash() };
    let text = format!("{value:.digits$}");
    match text.strip_prefix("0.") {
        Some(rest) => format!(".{rest}"),
        None => text,
    }
}

pub(crate) fn percent(value: Option<f64>) -> String {
    value.map_or_else(dash, |x| format!("{:.0} %", 100.0 * x))
}

pub(crate) fn interval(ends: Option<[f64; 2]>, signed: bool) -> String {
    match ends {
        None => dash(),
        Some([low, high]) if signed => format!("{low:+.3} … {high:+.3}"),
        Some([low, high]) => format!("{} … {}", number(Some(low), 3), number(Some(high), 3)),
    }
}

fn whole_number(value: Option<f64>) -> String {
    value.map_or_else(dash, |x| format!("{x:.0}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::tests::some_results;

    #[test]
    fn every_method_and_group_has_its_place() {
        let text = render(&some_results());
        for word in ["| fused |", "| whole |", "cups (2)", "Against fused", "*SemFM (quoted)*"] {
            assert_eq!(text.contains(word), word != "*SemFM (quoted)*", "{word} in\n{text}");
        }
        assert!(text.contains("fused between the bounds"), "{text}");
        assert!(text.contains("## Failures (1)") && text.contains("a → b"), "{text}");
        // Every line of a table has as many cells as its header.
        for table in text.split("\n\n").filter(|block| block.starts_with('|')) {
            let cells: Vec<usize> = table
                .lines()
                .filter(|l| l.starts_with('|'))
                .map(|l| l.matches(" | ").count())
                .collect();
            assert!(cells.iter().all(|&n| n == cells[0]), "{table}");
        }
    }

    #[test]
    fn numbers_are_written_as_the_paper_does() {
        assert_eq!(number(Some(0.744), 2), ".74");
        assert_eq!(number(Some(1.0), 2), "1.00");
        assert_eq!(number(None, 2), "–");
        assert_eq!(interval(Some([-0.1, 0.2]), true), "-0.100 … +0.200");
    }
}
