//! `table.md` of a matching evaluation, beside numbers of another library.

use super::{MapMethod, MatchingResults, MatchingSummary};
use crate::table::{header, line};

/// Mean errors × 100 measured with pyFM 1.3.1 on the same pairs (all samples, geodesics of
/// potpourri3d): method, set, error.
pub const PYFM: [(&str, &str, f64); 10] = [
    ("WKS, k 50", "FAUST_r", 19.5),
    ("WKS, k 50", "SMAL_r", 40.8),
    ("WKS + orientation, k 30, ZoomOut 30→200", "FAUST_r", 6.2),
    ("WKS + orientation, k 30, ZoomOut 30→200", "SMAL_r", 32.6),
    ("5 true landmarks, k 30", "FAUST_r", 3.6),
    ("5 true landmarks, k 30", "SMAL_r", 7.1),
    ("5 true landmarks, k 30, ZoomOut", "FAUST_r", 2.1),
    ("5 true landmarks, k 30, ZoomOut", "SMAL_r", 5.8),
    ("true 20 × 20 map, ZoomOut", "FAUST_r", 1.8),
    ("true 20 × 20 map, ZoomOut", "SMAL_r", 4.0),
];

impl MapMethod {
    /// What it is, for people.
    pub fn about(self) -> &'static str {
        match self {
            Self::Wks => "WKS, k 50",
            Self::WksZoomOut => "WKS, k 30, ZoomOut 30→200",
            Self::WksOrientationZoomOut => "WKS + orientation, k 30, ZoomOut 30→200",
            Self::Landmarks => "5 true landmarks, k 30",
            Self::LandmarksZoomOut => "5 true landmarks, k 30, ZoomOut 30→200",
            Self::TrueZoomOut => "true 20 × 20 map, ZoomOut 20→200",
        }
    }
}

/// The whole page as Markdown.
pub fn render(results: &MatchingResults) -> String {
    let mut sets: Vec<&str> = Vec::new();
    for summary in &results.summaries {
        if !sets.contains(&summary.set.as_str()) {
            sets.push(&summary.set);
        }
    }
    let samples = if results.n_samples == 0 { "all".into() } else { results.n_samples.to_string() };
    let mut text = format!(
        "# Maps against true correspondences\n\nFolder `{}`, {} rows, {samples} samples a pair. Dataset {}.\n\n\
         Mean geodesic error × 100 / √area. Mirror: against the mirrored truth. Flips: pairs whose \
         mirrored answer is the nearer one.\n",
        results.path.display(),
        results.rows.len(),
        results.dataset,
    );
    for set in sets {
        text += &format!("\n## {set}\n\n");
        let names =
            ["method", "pairs", "error", "95 %", "mirror", "nearer of both", "flips", "map, ms"];
        text += &header(names.map(str::to_owned));
        for (name, _, error) in PYFM.iter().filter(|row| row.1 == set) {
            let mut cells = vec![
                format!("*{name} (pyFM 1.3.1, quoted)*"),
                String::new(),
                format!("{error:.1}"),
            ];
            cells.resize(names.len(), String::new());
            text += &line(cells);
        }
        for summary in results.summaries.iter().filter(|summary| summary.set == set) {
            text += &line(cells(summary));
        }
    }
    let failed: Vec<_> = results.rows.iter().filter(|row| row.failure.is_some()).collect();
    if !failed.is_empty() {
        text += &format!("\n## Failures ({})\n\n", failed.len());
        for row in failed {
            let reason = row.failure.as_deref().unwrap_or_default();
            text += &format!(
                "- {}: {} → {}, {}: {reason}\n",
                row.set, row.source, row.target, row.method
            );
        }
    }
    text
}

fn cells(summary: &MatchingSummary) -> [String; 8] {
    let one = |x: Option<f64>| x.map_or_else(|| "–".into(), |x| format!("{x:.1}"));
    let method = summary.method.parse::<MapMethod>().map_or("", MapMethod::about);
    let ends = |[low, high]: [f64; 2]| format!("{low:.1} … {high:.1}");
    [
        format!("{method} (`{}`)", summary.method),
        summary.n.to_string(),
        one(summary.error),
        summary.interval.map_or_else(|| "–".into(), ends),
        one(summary.mirror_error),
        one(summary.best_error),
        summary.flip_rate.map_or_else(|| "–".into(), |x| format!("{:.0} %", 100.0 * x)),
        summary.median_map_ms.map_or_else(|| "–".into(), |x| format!("{x:.0}")),
    ]
}
