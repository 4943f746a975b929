//! The paper's tables and its figure of accuracy and runtime against views, its rows beside ours.

use super::context::{Context, in_words};
use super::html::{Cell, Table, escape, plot};
use super::plots::DrawError;
use super::plots::against_views::{self, AtViews};
use crate::dataset::DatasetOrigin;
use crate::published::{self, PublishedRow};
use crate::summary::{Scope, Summary, is_bound};
use crate::table::number;

/// The section; empty where no category is one of the paper's.
pub(super) fn body(context: &Context<'_>) -> Result<String, DrawError> {
    if context.paper_columns.iter().all(Option::is_none) {
        return Ok(String::new());
    }
    let mut html = String::from(
        "<p>Tables and figures are laid out as in Dong &amp; Zhi, <cite>Affordance Transfer Across \
         Object Instances via Semantically Anchored Functional Map</cite>. Rows in italics are \
         <em>quoted</em> from there: they were measured on other meshes, with another encoder and on \
         another machine, so they show where things stand and are no contest.</p>\n",
    );
    html += &accuracy(context).html();
    html += &context.vlm_note();
    let time = Time::of(context);
    html += &runtime(context, time).html();
    html += &format!("<p><small>{}</small></p>\n", escape(time.in_words()));
    html += &figures(context, time)?;
    Ok(html)
}

/// What stands beside the paper's runtimes.
#[derive(Clone, Copy, PartialEq)]
enum Time {
    /// From meshes to the region, as the paper measures.
    Whole,
    /// The same with a simulated encoder.
    Simulated,
    /// From embeddings: nobody timed the encoder.
    WithoutEncoder,
}

impl Time {
    fn of(context: &Context<'_>) -> Self {
        let timed = context.results.rows.iter().any(|row| row.paper_runtime.is_some());
        let simulated = matches!(context.results.about.origin, DatasetOrigin::Synthetic { .. });
        match (timed, simulated) {
            (false, _) => Self::WithoutEncoder,
            (true, true) => Self::Simulated,
            (true, false) => Self::Whole,
        }
    }

    fn seconds(self, summary: &Summary) -> Option<f64> {
        match self {
            Self::Whole | Self::Simulated => summary.median_paper_runtime,
            Self::WithoutEncoder => summary.median_cold_ms.map(|ms| ms / 1e3),
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Whole => {
                "Ours are medians from meshes to the region: views, embedding, shapes and matching, \
                 nothing cached; reconstruction is left out on both sides. The paper gives means."
            }
            Self::Simulated => {
                "Ours are medians from meshes to the region, nothing cached; reconstruction is left out on \
                 both sides. The encoder is simulated, and its time stands for no network’s: with a real \
                 one, add what its pictures take. The paper gives means."
            }
            Self::WithoutEncoder => {
                "Ours are medians from embeddings to the region, nothing cached: nobody timed views and \
                 encoder in this run, which the paper's times include. The paper gives means."
            }
        }
    }
}

fn head() -> Vec<String> {
    let names = published::CATEGORIES.iter().zip(1..).map(|(name, n)| format!("C. {n} {name}"));
    ["Method".to_owned()].into_iter().chain(names).chain(["Mean".into()]).collect()
}

/// Quoted rows, then ours. The best of each column among ours is strong, bounds aside.
fn table(
    context: &Context<'_>,
    caption: &str,
    quoted: &[PublishedRow],
    digits: usize,
    better: fn(f64, f64) -> f64,
    of: impl Fn(&Summary) -> Option<f64>,
) -> Table {
    let mut table = Table::new(caption, head());
    for row in quoted {
        let values = row.values.iter().map(|&value| Cell::number(Some(value), digits));
        let mean = Cell::number(Some(row.mean()), digits + 1);
        table.line("quoted", row.method, "quoted", values.chain([mean]));
    }
    let ours: Vec<Line<'_>> = context
        .methods
        .iter()
        .map(|&method| Line { method, values: columns(context, method, &of) })
        .collect();
    // What is written alike is equally good; means have a digit more, as in `table.md`.
    let mut class = "first";
    for Line { method, values } in &ours {
        if values.iter().all(Option::is_none) {
            continue;
        }
        let cells = values.iter().enumerate().map(|(column, &value)| {
            let digits = if column == published::CATEGORIES.len() { digits + 1 } else { digits };
            let alike = number(value, digits) == number(best(&ours, column, better), digits);
            Cell::number(value, digits).strong_if(alike && value.is_some() && !is_bound(method))
        });
        let own = if *method == context.lead { format!("{class} lead") } else { class.to_owned() };
        table.line(own.trim(), &in_words(method), bound_note(method), cells);
        class = "";
    }
    table
}

/// One of our methods.
struct Line<'a> {
    method: &'a str,
    values: Vec<Option<f64>>,
}

/// The best value of a column, bounds aside.
fn best(ours: &[Line<'_>], column: usize, better: fn(f64, f64) -> f64) -> Option<f64> {
    let compared = ours.iter().filter(|line| !is_bound(line.method));
    compared.filter_map(|line| line.values[column]).reduce(better)
}

/// One value for each of the paper's categories, and their mean where all are there.
fn columns(
    context: &Context<'_>,
    method: &str,
    of: impl Fn(&Summary) -> Option<f64>,
) -> Vec<Option<f64>> {
    let mut values: Vec<Option<f64>> = context
        .paper_columns
        .iter()
        .map(|name| of(context.summary(&Scope::Category((*name)?.into()), method)?))
        .collect();
    let known: Vec<f64> = values.iter().flatten().copied().collect();
    let mean = known.iter().sum::<f64>() / known.len() as f64;
    values.push((!known.is_empty()).then_some(mean));
    values
}

fn bound_note(method: &str) -> &'static str {
    match method {
        "oracle" => "upper bound: true part labels",
        "whole" => "lower bound: every vertex",
        _ => "",
    }
}

fn accuracy(context: &Context<'_>) -> Table {
    let caption =
        "Accuracy: mean IoU of all ordered pairs (higher is better). Mean: of the categories.";
    table(context, caption, &published::IOU, 2, f64::max, |summary| summary.mean)
}

fn runtime(context: &Context<'_>, time: Time) -> Table {
    let caption = "Runtime: seconds for one transfer (lower is better).";
    table(context, caption, &published::SECONDS, 2, f64::min, |summary| time.seconds(summary))
}

impl Context<'_> {
    fn vlm_note(&self) -> String {
        let real =
            self.results.rows.iter().filter_map(|row| row.vlm.as_ref()).any(|vlm| vlm.real_model);
        let words = if real {
            "VLM rows in italics are the paper's; the others are answers of the model named in them."
        } else {
            "All VLM numbers that stand for a model's answers are the paper's: no model was asked in this run."
        };
        format!("<p><small>{words}</small></p>\n")
    }
}

/// A method's answers by number of views, for one category.
fn by_views(
    context: &Context<'_>,
    category: &str,
    of: impl Fn(&Summary) -> Option<f64>,
) -> Vec<AtViews> {
    let mut points = Vec::new();
    for &method in &context.methods {
        let vlm = context.rows_of(method).find_map(|row| row.vlm.as_ref());
        let summary = context.summary(&Scope::Category(category.into()), method);
        if let Some((vlm, summary)) = vlm.filter(|vlm| vlm.real_model).zip(summary) {
            let value = of(summary);
            points.extend(value.map(|value| AtViews { n_views: vlm.n_views as f64, value }));
        }
    }
    points.sort_by(|a, b| a.n_views.total_cmp(&b.n_views));
    points
}

fn figures(context: &Context<'_>, time: Time) -> Result<String, DrawError> {
    let second = ["semfm", "semfm-image", "semfm+", "semfm+image"];
    let second = second.into_iter().find(|m| *m != context.lead && context.methods.contains(m));
    let accuracy = panels(context, &published::IOU, second, |summary| summary.mean);
    let seconds = panels(context, &published::SECONDS, second, |summary| time.seconds(summary));
    let mut legend = format!(
        "<ul class=\"legend\"><li class=\"solid vlmline\">VLM, quoted (solid)</li>\
         <li class=\"dashed quotedline\">the paper’s SemFM, quoted (dashed)</li>\
         <li class=\"dotted right\">{}, this run (dotted)</li>",
        escape(context.lead)
    );
    if let Some(second) = second {
        legend +=
            &format!("<li class=\"dotted secondline\">{}, this run (dotted)</li>", escape(second));
    }
    if accuracy.iter().any(|panel| !panel.model.is_empty()) {
        legend += "<li class=\"solid extra\">VLM, this run (solid, triangles)</li>";
    }
    legend += "</ul>\n";
    let mut html = String::from("<h3>Accuracy and runtime against the number of VLM views</h3>\n");
    html += &legend;
    html += &plot(
        &against_views::draw(&accuracy, against_views::Scale::Share)?,
        "Six panels, one per category: IoU against 1 to 6 views shown to a vision-language model, with \
         horizontal lines for the methods that need no such model. The numbers are in the tables above.",
        "Mean IoU against views shown to the VLM. The paper states IoU at one and at six views; what \
         it found at three is only drawn there.",
    );
    html += &plot(
        &against_views::draw(&seconds, against_views::Scale::Seconds)?,
        "Six panels, one per category: seconds per transfer against 1 to 6 views, logarithmic.",
        &format!("Seconds for one transfer, logarithmic. {}", escape(time.in_words())),
    );
    Ok(html)
}

/// One panel for each of the paper's categories.
fn panels(
    context: &Context<'_>,
    quoted: &[PublishedRow],
    second: Option<&str>,
    of: impl Fn(&Summary) -> Option<f64>,
) -> Vec<against_views::Panel> {
    let mut panels = Vec::new();
    for (place, category) in published::CATEGORIES.iter().enumerate() {
        let column = context.paper_columns[place];
        let ours = |method: &str| of(context.summary(&Scope::Category(column?.into()), method)?);
        let models = quoted.iter().filter_map(|row| {
            Some(AtViews { n_views: row.n_views? as f64, value: row.values[place] })
        });
        let quoted_semfm = quoted.iter().find(|row| row.method == "SemFM");
        panels.push(against_views::Panel {
            title: format!("C. {} {category}", place + 1),
            quoted_model: models.collect(),
            quoted_semfm: quoted_semfm.map(|row| row.values[place]),
            model: column.map_or_else(Vec::new, |name| by_views(context, name, &of)),
            lead: ours(context.lead),
            second: second.and_then(ours),
        });
    }
    panels
}
