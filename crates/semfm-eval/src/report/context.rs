//! What all sections need of the results: methods, groups, the paper's columns, the leading method.

use std::fmt::Write;

use semfm::Method;

use super::html::escape;
use crate::dataset::DatasetOrigin;
use crate::published;
use crate::results::Results;
use crate::row::Row;
use crate::summary::{Scope, ScoreTable, Summary, is_bound};
use crate::table::number;
use crate::variant::Variant;

/// The results, with what is often needed of them.
pub(super) struct Context<'a> {
    pub results: &'a Results,
    /// In the order of the tables.
    pub methods: Vec<&'a str>,
    pub groups: Vec<&'a str>,
    /// The method that pictures are shown of: the default one, or the first that is no bound.
    pub lead: &'a str,
    /// Our category for each of the paper's six.
    pub paper_columns: [Option<&'a str>; 6],
}

impl<'a> Context<'a> {
    pub fn new(results: &'a Results) -> Self {
        let ScoreTable { methods, .. } = ScoreTable::new(&results.rows);
        let table = ScoreTable::new(&results.rows);
        let default = Method::default().name();
        let lead = methods.iter().find(|m| **m == default);
        let lead = lead.or_else(|| methods.iter().find(|m| !is_bound(m))).or(methods.first());
        let categories = table.categories();
        let paper_columns = std::array::from_fn(|place| {
            categories.iter().copied().find(|name| published::paper_category(name) == Some(place))
        });
        Self {
            results,
            lead: lead.copied().unwrap_or_default(),
            groups: table.groups(),
            methods,
            paper_columns,
        }
    }

    pub fn summary(&self, scope: &Scope, method: &str) -> Option<&'a Summary> {
        self.results.summary(scope, method)
    }

    /// Mean of a method over all pairs.
    pub fn overall(&self, method: &str) -> Option<&'a Summary> {
        self.summary(&Scope::All, method)
    }

    pub fn rows_of<'b>(&'b self, method: &'b str) -> impl Iterator<Item = &'a Row> + 'b {
        self.results.rows.iter().filter(move |row| row.method == method)
    }

    /// What a method is, in a few words.
    pub fn about(&self, method: &str) -> &'static str {
        if let Ok(variant) = method.parse::<Variant>() {
            return variant.about();
        }
        let vlm = self.rows_of(method).find_map(|row| row.vlm.as_ref());
        match vlm {
            Some(vlm) if vlm.real_model => "a vision-language model shown views",
            Some(_) => "a stand-in for a vision-language model, no model's answers",
            None => "",
        }
    }

    /// Title, key numbers and where everything came from.
    pub fn head(&self) -> String {
        let about = &self.results.about;
        let what = match &about.origin {
            DatasetOrigin::Folder { path } => {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                format!("Labelled meshes of the folder “{name}”")
            }
            DatasetOrigin::Synthetic { level, seeds, n_objects } => format!(
                "Procedural objects of six categories with simulated features of level {level} \
                 ({n_objects} objects of each category for {})",
                match &seeds[..] {
                    [seed] => format!("seed {seed}"),
                    seeds => format!("each of {} seeds", seeds.len()),
                }
            ),
        };
        let mut html = format!(
            "<p>{}: {} ordered pairs of {} objects, {} methods. A region is demonstrated on the \
             source and carried to the target; the score is the intersection over union (IoU) with \
             the true region there, in vertices.</p>\n",
            escape(&what),
            self.n_pairs(),
            self.results.objects.len(),
            self.methods.len(),
        );
        html += &self.tiles();
        let identity = &about.identity;
        html += "<details><summary>Where these numbers come from</summary><dl class=\"facts\">";
        let settings = serde_json::json!(identity.settings).to_string();
        let facts = [
            ("features", &identity.embeddings),
            ("program", &identity.program),
            ("dataset", &identity.dataset),
            ("settings", &settings),
        ];
        for (name, value) in facts {
            let _ = write!(html, "<dt>{name}</dt><dd>{}</dd>", escape(value));
        }
        let bootstrap = &self.results.bootstrap;
        let _ = writeln!(
            html,
            "<dt>intervals</dt><dd>{:.0} %, objects resampled {} times</dd></dl></details>",
            100.0 * bootstrap.level,
            bootstrap.draws
        );
        html
    }

    fn tiles(&self) -> String {
        let mut tiles = Vec::new();
        if let Some(lead) = self.overall(self.lead) {
            let ends = lead.interval.map_or_else(String::new, |[low, high]| {
                format!(", {} to {}", number(Some(low), 2), number(Some(high), 2))
            });
            tiles.push((number(lead.mean, 2), format!("mean IoU of {}{ends}", self.lead)));
            let poor = lead.below_poor.map(|share| format!("{:.1} %", 100.0 * share));
            tiles.push((poor.unwrap_or("–".into()), "of its answers below IoU .3".into()));
            let ms = lead.median_matching_ms.map(|ms| format!("{ms:.0} ms"));
            tiles.push((ms.unwrap_or("–".into()), "to match prepared objects, median".into()));
        }
        if let Some(calibration) = self.results.calibration.iter().find(|t| t.method == self.lead) {
            let words = "AUC of its confidence for IoU ≥ .5".to_owned();
            tiles.push((number(calibration.auc, 2), words));
        }
        let mut html = String::from("<ul class=\"tiles\">");
        for (value, words) in tiles {
            let (value, words) = (escape(&value), escape(&words));
            let _ = write!(html, "<li><b>{value}</b><span>{words}</span></li>");
        }
        html + "</ul>\n"
    }

    fn n_pairs(&self) -> usize {
        let pairs = self.results.rows.iter().map(Row::pair_key);
        pairs.collect::<std::collections::BTreeSet<_>>().len()
    }
}

/// What a method is called beside the paper's.
pub(super) fn in_words(method: &str) -> String {
    match method {
        "wks" => "FM-WKS, ours".into(),
        "semfm" => "SemFM, ours (preimage rule)".into(),
        "semfm-image" => "SemFM, ours (image rule)".into(),
        "fused" => "fused, our default".into(),
        other => other.into(),
    }
}
