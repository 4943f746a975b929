//! `table.md` of an evaluation of maps, beside numbers of another library.

use super::map_method::MapMethod;
use super::results::{MapResults, MapSummary};
use crate::table::{dash, failures, header, line};

/// A mean error × 100 measured with pyFM 1.3.1 on the same pairs (all samples, geodesics of
/// potpourri3d).
pub(crate) struct PyfmRow {
    pub method: &'static str,
    pub set: &'static str,
    pub error: f64,
}

const fn row(method: &'static str, set: &'static str, error: f64) -> PyfmRow {
    PyfmRow { method, set, error }
}

/// What pyFM gives.
pub(crate) const PYFM: [PyfmRow; 10] = [
    row("WKS, k 50", "FAUST_r", 19.5),
    row("WKS, k 50", "SMAL_r", 40.8),
    row("WKS + orientation, k 30, ZoomOut 30→200", "FAUST_r", 6.2),
    row("WKS + orientation, k 30, ZoomOut 30→200", "SMAL_r", 32.6),
    row("5 true landmarks, k 30", "FAUST_r", 3.6),
    row("5 true landmarks, k 30", "SMAL_r", 7.1),
    row("5 true landmarks, k 30, ZoomOut", "FAUST_r", 2.1),
    row("5 true landmarks, k 30, ZoomOut", "SMAL_r", 5.8),
    row("true 20 × 20 map, ZoomOut", "FAUST_r", 1.8),
    row("true 20 × 20 map, ZoomOut", "SMAL_r", 4.0),
];

impl MapResults {
    /// The results as Markdown: `table.md`.
    pub fn to_markdown(&self) -> String {
        let samples = if self.n_samples == 0 { "all".into() } else { self.n_samples.to_string() };
        let to = if self.precise { "points of triangles" } else { "vertices" };
        let mut text = format!(
            "# Maps against true correspondences\n\nFolder `{}`, {} rows, {samples} samples a pair, sent to {to}. \
             Dataset {}.\n\n\
             Mean geodesic error × 100 / √area. Mirror: against the mirrored truth. Flips: pairs whose \
             mirrored answer is the nearer one.\n",
            self.path.display(),
            self.rows.len(),
            self.dataset,
        );
        for set in self.sets() {
            text += &self.set_table(set);
        }
        text + &self.failures()
    }

    fn set_table(&self, set: &str) -> String {
        let mut text = format!("\n## {set}\n\n");
        let names =
            ["method", "pairs", "error", "95 %", "mirror", "nearer of both", "flips", "map, ms"];
        text += &header(names.map(str::to_owned));
        for quoted in PYFM.iter().filter(|row| row.set == set) {
            let mut cells = vec![
                format!("*{} (pyFM 1.3.1, quoted)*", quoted.method),
                String::new(),
                format!("{:.1}", quoted.error),
            ];
            cells.resize(names.len(), String::new());
            text += &line(cells);
        }
        for summary in self.of_set(set) {
            text += &line(cells(summary));
        }
        text
    }

    fn failures(&self) -> String {
        failures(self.rows.iter().filter_map(|row| {
            let reason = row.failure.as_ref()?;
            Some(format!("{}: {} → {}, {}: {reason}", row.set, row.source, row.target, row.method))
        }))
    }
}

fn cells(summary: &MapSummary) -> [String; 8] {
    let method = summary.method.parse::<MapMethod>().map_or("", MapMethod::about);
    [
        format!("{method} (`{}`)", summary.method),
        summary.n.to_string(),
        one_digit(summary.error),
        interval(summary.interval),
        one_digit(summary.mirror_error),
        one_digit(summary.best_error),
        percent(summary.flip_rate),
        whole(summary.median_map_ms),
    ]
}

/// A value with one digit after the point; a dash for none.
pub(crate) fn one_digit(value: Option<f64>) -> String {
    value.map_or_else(dash, |x| format!("{x:.1}"))
}

/// The ends of an interval with one digit after the point.
pub(crate) fn interval(ends: Option<[f64; 2]>) -> String {
    ends.map_or_else(dash, |[low, high]| format!("{low:.1} … {high:.1}"))
}

/// A share as a whole percentage.
pub(crate) fn percent(share: Option<f64>) -> String {
    share.map_or_else(dash, |x| format!("{:.0} %", 100.0 * x))
}

/// A value without digits after the point.
pub(crate) fn whole(value: Option<f64>) -> String {
    value.map_or_else(dash, |x| format!("{x:.0}"))
}
