//! `semfm-cli run`: from pictures of a demonstration to a grasp, by one recipe.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::{RunStageRecord, StageState};
use semfm_run::{PlannedStage, Run, RunProgress, RunSettings, TEMPLATE};
use serde_json::json;

use super::Outcome;
use crate::console;
use crate::options::Common;

/// Go from pictures of a demonstration to a grasp: pose, region, transfer, grasps and motion by one recipe
///
/// Each stage does what one command does (`align`, `region`, `transfer`, `align`, `grasp`, `plan`) and keeps its files in a
/// folder of its own. A stage is done again only when something that it was made from has changed. One page, index.html,
/// shows how it went.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli run --template > demo.toml\n  \
    semfm-cli run demo.toml -o out --dry-run\n  \
    semfm-cli run demo.toml -o out\n\n\
    Exit code 0: an answer. 1: a stage has none (a pose or a region with the verdict `refuse`, no grasp, no motion): the \
    page says which, why and what to do next. 2: bad input; stages that were done are kept. More: docs/observations.md")]
pub struct RunCommand {
    /// The recipe (TOML)
    #[arg(value_name = "demo.toml", required_unless_present = "template")]
    recipe: Option<PathBuf>,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER", required_unless_present = "template")]
    output: Option<PathBuf>,
    /// Say which stages would be done, and why, and do nothing
    #[arg(long, conflicts_with = "template")]
    dry_run: bool,
    /// Neither use nor keep prepared shapes and embeddings between runs
    #[arg(long, conflicts_with = "template")]
    no_cache: bool,
    /// Print a recipe with every key explained, to start from
    #[arg(long, conflicts_with_all = ["recipe", "output"])]
    template: bool,
}

impl RunCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        if self.template {
            console::data(TEMPLATE.trim_end());
            return Ok(Outcome::Done);
        }
        let (Some(recipe), Some(output)) = (&self.recipe, &self.output) else {
            bail!("expected a recipe and -o FOLDER, or --template");
        };
        if output == std::path::Path::new("-") {
            bail!("-o -: expected a folder, for there are several files; found stdout");
        }
        let run = Run::open(recipe, output)?;
        if self.dry_run {
            print_planned(&run.planned(), common);
            return Ok(Outcome::Done);
        }
        let settings =
            RunSettings { threads: common.threads, quiet: common.quiet, cache: !self.no_cache };
        let task = console::progress(common.quiet);
        let mut tell = |progress: RunProgress<'_>| print_progress(progress, common);
        let done = run.carry_out(&settings, &mut tell, &task)?;
        let page = run.page();
        if common.json {
            let mut summary = done.to_json();
            let output = output.to_str().context("-o: expected a path in UTF-8")?;
            summary["output"] = json!(output);
            console::data(summary);
        } else {
            console::data(format_args!("page        {}", page.display()));
        }
        let Some(none) = &done.no_answer else { return Ok(Outcome::Done) };
        console::message(format_args!("no answer: {}", none.reason));
        console::message(format_args!("next: {}", none.next));
        Ok(Outcome::NoAnswer)
    }
}

fn print_planned(planned: &[PlannedStage], common: &Common) {
    if common.json {
        let stage = |planned: &PlannedStage| {
            let state = if planned.why.is_some() { "do" } else { "keep" };
            json!({ "stage": planned.stage.name(), "state": state, "why": planned.why })
        };
        console::data(json!({ "stages": planned.iter().map(stage).collect::<Vec<_>>() }));
        return;
    }
    for PlannedStage { stage, why } in planned {
        match why {
            Some(why) => console::data(format_args!("{:20} do: {why}", stage.name())),
            None => console::data(format_args!("{:20} keep", stage.name())),
        }
    }
}

/// A line for each stage; all that came out of it with `--verbose`.
fn print_progress(progress: RunProgress<'_>, common: &Common) {
    match progress {
        RunProgress::Begun { stage, why } if common.verbose => {
            console::message(format_args!("{}: {why}", stage.name()));
        }
        RunProgress::Finished(record) if !common.json => print_stage(record, common),
        _ => {}
    }
}

fn print_stage(record: &RunStageRecord, common: &Common) {
    let RunStageRecord { stage, state, seconds, summary, files } = record;
    let time = match state {
        StageState::Done => format!("{seconds:6.2} s"),
        StageState::Kept => "    kept".into(),
    };
    let first = summary.first().map_or("", String::as_str);
    console::data(format_args!("{stage:20} {time}  {first}"));
    if common.verbose {
        let rest = summary.iter().skip(1);
        rest.for_each(|line| console::data(format_args!("{:30} {line}", "")));
        console::data(format_args!("{:30} {}", "", files.join(", ")));
    }
}
