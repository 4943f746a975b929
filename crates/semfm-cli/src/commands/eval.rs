//! `semfm-cli eval`: how well regions are transferred, measured.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{ArgGroup, Args};
use semfm::Method;
use semfm::geom::ShapeCache;
use semfm::geom::io::StagedFolder;
use semfm::memory::MemorySettings;
use semfm_eval::compare::Comparison;
use semfm_eval::dataset::synthetic::{SyntheticSettings, make};
use semfm_eval::dataset::{Dataset, folder};
use semfm_eval::workers::Workers;
use semfm_eval::{
    EmbeddingSource, EvalSettings, MemoryEvalSettings, OutputFolder, Override, PreparationSettings,
    Results, Variant, report, run_kinds, run_memory, table, vlm,
};
use semfm_synth::Level;
use serde_json::json;

use super::Outcome;
use super::encoder_options::EncoderOptions;
use super::report_options::{ReportOptions, print_notes};
use crate::console;
use crate::options::Common;
use crate::output::check_folder;
use crate::process::CtrlC;

/// Measure how well regions are transferred: every method, every ordered pair
///
/// DATASET is a folder of `CATEGORY/NAME.obj` beside `NAME.json` with the true region, or none with
/// `--synthetic`. An interrupted run goes on where it stopped when the same command is given again.
/// Point maps are measured on true correspondences by `eval-maps`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("what").required(true).args(["dataset", "synthetic", "report_only"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli eval --synthetic -o report\n  \
    semfm-cli eval objects -o report\n  \
    semfm-cli eval objects --encoder google/siglip2-base-patch16-224 --methods fused,nearest,whole,oracle -o report\n  \
    semfm-cli eval objects --memory 1,2,3,5,10 --distractors 10 -o report\n  \
    semfm-cli eval objects --embeddings embedded -o report --compare earlier/results.json\n\n\
    Exit code 0: measured (failed pairs are named in the results). 2: bad input, or nothing could be measured. 130: interrupted; what is done is kept.")]
pub struct EvalCommand {
    /// Folder of labelled objects
    dataset: Option<PathBuf>,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    synthetic: SyntheticOptions,
    #[command(flatten)]
    features: FeatureOptions,
    #[command(flatten)]
    methods: MethodOptions,
    #[command(flatten)]
    memory: MemoryEvalOptions,
    #[command(flatten)]
    work: WorkOptions,
    #[command(flatten)]
    report: ReportOptions,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Procedural objects")]
struct SyntheticOptions {
    /// Evaluate on procedural objects, with a simulated encoder unless --encoder names a real one
    #[arg(long)]
    synthetic: bool,
    /// How hard the simulated features are: easy, medium or hard
    #[arg(long, requires = "synthetic", default_value_t = Level::Medium)]
    level: Level,
    /// Seeds of the objects: 0..2, or 0,3,7
    #[arg(long, requires = "synthetic", default_value = "0..2", value_name = "SEEDS")]
    seeds: Seeds,
    /// Objects of each category and seed
    #[arg(long, requires = "synthetic", default_value_t = 4, value_name = "N")]
    objects: usize,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Features")]
struct FeatureOptions {
    /// Folder of `NAME.emb.mcap` [default: beside the meshes, where there are any]
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["encoder", "rolls", "synthetic"])]
    embeddings: Option<PathBuf>,
    #[command(flatten)]
    encoder: EncoderOptions,
    /// `fused`: give the published method our views and lifting instead of its own
    #[arg(long, value_name = "METHOD", value_parser = ["fused", "semfm"])]
    features: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Methods")]
struct MethodOptions {
    /// Which methods, by comma: fused, anchored, sinkhorn, nearest, semfm+, semfm+image, semfm,
    /// semfm-image, wks, oracle, whole [default: all]
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    methods: Vec<String>,
    /// Change a setting of a method, as fused.threshold=0.35 (repeatable)
    #[arg(long, value_name = "METHOD.KEY=VALUE")]
    set: Vec<Override>,
    /// Seed of everything drawn by chance
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Score a vision-language model's rows (`semfm.vlm/1`) beside the methods
    #[arg(long, value_name = "ROWS.json")]
    vlm: Option<PathBuf>,
    /// Simplify larger meshes to this many vertices; 0 keeps them all
    #[arg(long, value_name = "N")]
    working_vertices: Option<usize>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Several demonstrations, and other kinds")]
struct MemoryEvalOptions {
    /// Measure memories of so many demonstrations of the target's kind instead of pairs, by `fused`
    #[arg(long, value_name = "N,N", value_delimiter = ',', conflicts_with_all = ["methods", "set", "vlm",
        "compare", "fresh", "no_predictions"])]
    memory: Vec<usize>,
    /// Measure, beside the pairs, so many pairs of different categories instead: are they refused?
    #[arg(long, value_name = "N", conflicts_with_all = ["memory", "methods", "set", "vlm", "compare", "fresh",
        "no_predictions"])]
    nonsense: Option<usize>,
    /// Objects of other kinds in each memory
    #[arg(long, value_name = "N", requires = "memory", default_value_t = 0)]
    distractors: usize,
    /// Demonstrations that are matched, the most similar ones
    #[arg(long, value_name = "N", requires = "memory", default_value_t = MemorySettings::default().shortlist)]
    shortlist: usize,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Work")]
struct WorkOptions {
    /// Pairs at once; 0 takes one for each thread. Results do not depend on it
    #[arg(long, default_value_t = 0, value_name = "N")]
    jobs: usize,
    /// Say what changed since these results, worst first
    #[arg(long, value_name = "OLD/results.json")]
    compare: Option<PathBuf>,
    /// Forget what an interrupted run left
    #[arg(long)]
    fresh: bool,
    /// Do not keep the predictions, only their scores
    #[arg(long)]
    no_predictions: bool,
    /// Neither use nor keep prepared shapes and embeddings
    #[arg(long)]
    no_cache: bool,
}

impl EvalCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let compared = self.work.compare.as_deref().map(results_file);
        let inputs: Vec<&Path> =
            compared.iter().chain(&self.methods.vlm).map(PathBuf::as_path).collect();
        check_folder(&self.output, OUTPUTS, &inputs)?;
        // Locked before anything is read: another run that goes on for hours is known at once.
        let folder = OutputFolder::open(&self.output)?;
        if self.report.report_only {
            return self.report.write_again(&self.output, common);
        }
        let ctrl_c = CtrlC::listen();
        let outcome = self.evaluate(folder, &ctrl_c, common);
        if outcome.is_err() && ctrl_c.was_pressed() {
            console::message(format_args!(
                "interrupted: what is done is kept in {}; the same command goes on from there",
                self.output.display()
            ));
            return Ok(Outcome::Interrupted);
        }
        outcome
    }

    fn evaluate(&self, folder: OutputFolder, ctrl_c: &CtrlC, common: &Common) -> Result<Outcome> {
        // What cannot be compared with should be known before the work is done.
        let before = self.work.compare.as_deref().map(Results::read).transpose()?;
        let dataset = self.dataset()?;
        check_folder(&self.output, OUTPUTS, &dataset.files())?;
        if !common.quiet {
            dataset.notes.iter().for_each(|note| console::message(format_args!("note: {note}")));
        }
        let embeddings = self.embeddings(&dataset, common)?;
        if !self.memory.memory.is_empty() {
            return self.evaluate_memory(&dataset, &embeddings, ctrl_c, common);
        }
        if let Some(n) = self.memory.nonsense {
            return self.evaluate_kinds(n, &dataset, &embeddings, ctrl_c, common);
        }
        let settings = self.settings(common)?;
        self.announce(&dataset, &embeddings, &settings, common);
        let task = console::progress_with_time_left(common.quiet).with_cancel_flag(ctrl_c.flag());
        let vlm = self.methods.vlm.as_deref().map(|path| vlm::read(path, &dataset)).transpose()?;
        let mut finished = semfm_eval::run(&dataset, &embeddings, &settings, folder, &task)?;
        if finished.resumed > 0 && !common.quiet {
            console::message(format_args!("went on after {} pairs done before", finished.resumed));
        }
        if let Some(mut rows) = vlm {
            if let Some(path) = self.methods.vlm.as_deref().filter(|_| !self.work.no_predictions) {
                vlm::keep(path, &mut rows, &self.output)?;
            }
            finished.results = finished.results.with_rows(rows);
        }
        let results = &finished.results;
        // All of it appears together, the results last.
        let staged = StagedFolder::new(&self.output)?;
        results.write(staged.path())?;
        table::write(results, staged.path())?;
        let comparison = before.map(|before| Comparison::new(&before, results));
        if let Some(comparison) = &comparison {
            comparison.write(staged.path())?;
        }
        let settings = self.report.settings();
        let page =
            report::write(results, &dataset, finished.folder(), staged.path(), &settings, &task)?;
        print_notes(&page, common);
        let files = staged.put(&["results.json"], &[])?;
        let results = finished.close()?;
        print_results(&results, comparison.as_ref(), &files, common);
        outcome_of(&results, common)
    }

    /// Memories of several demonstrations in place of pairs.
    fn evaluate_memory(
        &self,
        dataset: &Dataset,
        embeddings: &EmbeddingSource,
        ctrl_c: &CtrlC,
        common: &Common,
    ) -> Result<Outcome> {
        let mut settings = MemoryEvalSettings {
            counts: self.memory.memory.clone(),
            n_distractors: self.memory.distractors,
            preparation: self.preparation(common),
            ..MemoryEvalSettings::default()
        };
        settings.memory.shortlist = self.memory.shortlist;
        let task = console::progress_with_time_left(common.quiet).with_cancel_flag(ctrl_c.flag());
        let results = run_memory(dataset, embeddings, &settings, &task)?;
        let staged = StagedFolder::new(&self.output)?;
        results.write(staged.path())?;
        let files = staged.put(&["memory.json"], &[])?;
        if common.json {
            let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
            console::data(json!({ "summaries": results.summaries, "files": files }));
        } else {
            console::data(results.to_markdown());
            print_files(&files);
        }
        match results.rows.iter().find_map(|row| row.failure.as_ref()) {
            Some(first) if results.summaries.is_empty() => {
                bail!("no memory could be asked; the first: {}", first.text)
            }
            _ => Ok(Outcome::Done),
        }
    }

    /// Pairs of different kinds beside those of one.
    fn evaluate_kinds(
        &self,
        n_nonsense: usize,
        dataset: &Dataset,
        embeddings: &EmbeddingSource,
        ctrl_c: &CtrlC,
        common: &Common,
    ) -> Result<Outcome> {
        let task = console::progress_with_time_left(common.quiet).with_cancel_flag(ctrl_c.flag());
        let settings = self.preparation(common);
        let results = run_kinds(dataset, embeddings, n_nonsense, &settings, &task)?;
        let staged = StagedFolder::new(&self.output)?;
        results.write(staged.path())?;
        let files = staged.put(&["kinds.json"], &[])?;
        if common.json {
            let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
            console::data(
                json!({ "summaries": results.summaries, "scale": results.scale, "files": files }),
            );
        } else {
            console::data(results.to_markdown());
            print_files(&files);
        }
        Ok(Outcome::Done)
    }

    fn preparation(&self, common: &Common) -> PreparationSettings {
        let mut settings = PreparationSettings {
            seed: self.methods.seed,
            workers: Workers::new(common.threads, self.work.jobs),
            cache: if self.work.no_cache { ShapeCache::off() } else { ShapeCache::of_user() },
            ..PreparationSettings::default()
        };
        if let Some(n) = self.methods.working_vertices {
            settings.shape.working_vertices = n;
        }
        settings
    }

    /// Files where some are named or lie beside the meshes; the simulated encoder for procedural
    /// objects; else the encoder that is named, or the built-in one.
    fn embeddings(&self, dataset: &Dataset, common: &Common) -> Result<EmbeddingSource> {
        let FeatureOptions { embeddings, encoder, .. } = &self.features;
        if embeddings.is_some() {
            return Ok(EmbeddingSource::Files(embeddings.clone()));
        }
        if encoder.is_default() {
            if self.synthetic.synthetic {
                return Ok(EmbeddingSource::Simulated);
            }
            if EmbeddingSource::any_beside(dataset) {
                return Ok(EmbeddingSource::Files(None));
            }
        }
        let cache = if self.work.no_cache { ShapeCache::off() } else { ShapeCache::of_user() };
        // Several encoders at work at once share the cores, as the pairs do.
        let threads = Workers::new(common.threads, self.work.jobs).threads;
        let quiet = Common { threads, quiet: true, ..*common };
        let most_rolls = Method::default().info().features.rolls;
        let (rolls, encoder) = (encoder.rolls, encoder.open(most_rolls, &cache, &quiet)?);
        let source = EmbeddingSource::of_encoder(encoder, rolls)?;
        if let Some(note) = source.note().filter(|_| !common.quiet) {
            console::message(format_args!("note: {note}"));
        }
        Ok(source)
    }

    fn dataset(&self) -> Result<Dataset> {
        if let Some(path) = &self.dataset {
            return Ok(folder::open(path)?);
        }
        let SyntheticOptions { level, ref seeds, objects, .. } = self.synthetic;
        Ok(make(&SyntheticSettings { level, seeds: seeds.0.clone(), n_objects: objects })?)
    }

    fn settings(&self, common: &Common) -> Result<EvalSettings> {
        let mut settings = EvalSettings {
            overrides: self.methods.set.clone(),
            seed: self.methods.seed,
            workers: Workers::new(common.threads, self.work.jobs),
            cache: if self.work.no_cache { ShapeCache::off() } else { ShapeCache::of_user() },
            keep_predictions: !self.work.no_predictions,
            fresh: self.work.fresh,
            program: program()?,
            ..EvalSettings::default()
        };
        if !self.methods.methods.is_empty() {
            settings.variants = parsed(&self.methods.methods)?;
        }
        if self.features.features.as_deref() == Some("fused") {
            let mut variants: Vec<Variant> = Vec::new();
            for variant in settings.variants.iter().map(|c| c.with_our_features()) {
                if !variants.contains(&variant) {
                    variants.push(variant);
                }
            }
            settings.variants = variants;
        }
        if let Some(n) = self.methods.working_vertices {
            settings.shape.working_vertices = n;
        }
        Ok(settings)
    }

    fn announce(
        &self,
        dataset: &Dataset,
        embeddings: &EmbeddingSource,
        settings: &EvalSettings,
        common: &Common,
    ) {
        if !common.quiet {
            console::message(format_args!(
                "{} pairs of {} objects in {} groups, {} methods, {} at once; features: {}",
                dataset.n_pairs(),
                dataset.objects.len(),
                dataset.groups.len(),
                settings.variants.len(),
                settings.workers.jobs,
                embeddings.identity(dataset),
            ));
        }
    }
}

/// The files in the folder of results.
const OUTPUTS: &[&str] = &[
    "results.json",
    "table.md",
    "index.html",
    "compare.json",
    "compare.md",
    "journal.jsonl",
    "memory.json",
    "memory.md",
    "kinds.json",
    "kinds.md",
];

/// The file itself, or the results in a folder.
fn results_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("results.json") } else { path.to_owned() }
}

/// Names of methods, read.
pub(super) fn parsed<T: std::str::FromStr<Err = semfm_eval::Error>>(
    names: &[String],
) -> Result<Vec<T>> {
    Ok(names.iter().map(|name| name.trim().parse()).collect::<Result<_, _>>()?)
}

/// Hash of the running program: rows of another build are no rows of this one.
fn program() -> Result<String> {
    let path = std::env::current_exe().context("the path of this program")?;
    let bytes = std::fs::read(&path).with_context(|| path.display().to_string())?;
    Ok(format!("{} {}", env!("CARGO_PKG_VERSION"), &blake3::hash(&bytes).to_hex()[..16]))
}

/// Seeds as a range or a list.
#[derive(Clone, Debug)]
struct Seeds(Vec<u64>);

impl std::str::FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |text: &str| {
            text.trim().parse::<u64>().map_err(|_| format!("expected 0..2 or 0,3,7, found {text}"))
        };
        let seeds: Vec<u64> = match text.split_once("..") {
            Some((first, end)) => {
                let (first, end) = (number(first)?, number(end)?);
                if end.saturating_sub(first) > 10_000 {
                    return Err(format!("expected at most 10000 seeds, found {text}"));
                }
                (first..end).collect()
            }
            None => text.split(',').map(number).collect::<std::result::Result<_, _>>()?,
        };
        if seeds.is_empty() {
            Err(format!("expected at least one seed, found {text}"))
        } else {
            Ok(Self(seeds))
        }
    }
}

fn print_results(
    results: &Results,
    comparison: Option<&Comparison>,
    files: &[PathBuf],
    common: &Common,
) {
    if common.json {
        console::data(json!({
            "n_rows": results.rows.len(),
            "n_failed": results.rows.iter().filter(|row| row.failure.is_some()).count(),
            "summaries": results.summaries,
            "comparison": comparison.map(|comparison| &comparison.methods),
            "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
        }));
        return;
    }
    console::data(table::render(results));
    if let Some(comparison) = comparison {
        console::data(comparison.render());
    }
    print_files(files);
}

pub(super) fn print_files(files: &[PathBuf]) {
    console::data("wrote");
    files.iter().for_each(|file| console::data(format_args!("  {}", file.display())));
}

/// Failed rows are counted on stderr; a run without a single score has failed.
fn outcome_of(results: &Results, common: &Common) -> Result<Outcome> {
    let failed = results.rows.iter().filter(|row| row.failure.is_some()).count();
    if results.rows.iter().all(|row| row.iou.is_none()) {
        let first = results.rows.iter().find_map(|row| row.failure.as_ref());
        bail!("no pair could be measured; the first: {}", first.map_or("no pair", |f| &f.text));
    }
    if failed > 0 && !common.quiet {
        console::message(format_args!(
            "{failed} of {} rows failed, see the results",
            results.rows.len()
        ));
    }
    Ok(Outcome::Done)
}
