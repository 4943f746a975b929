//! `semfm-cli eval-maps`: point maps measured on true correspondences.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{ArgGroup, Args};
use semfm::geom::ShapeCache;
use semfm_eval::workers::Workers;
use semfm_eval::{CorrespondenceDataset, MapSettings, OutputFolder, report, run_maps};
use serde_json::json;

use super::Outcome;
use super::eval::{parsed, print_files};
use crate::console;
use crate::options::Common;
use crate::output::check_folder;

/// Measure point maps against true correspondences: functional maps beside another library
///
/// SETS is a folder of sets: `SET/pairs.txt` with a line "source target" for each pair, and
/// `SET/NAME.npz` with vertices, triangles and the vertex at each sample of a template.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("what").required(true).args(["sets", "report_only"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli eval-maps matching -o report\n  \
    semfm-cli eval-maps matching --methods wks,landmarks+zoomout --samples 0 -o report\n\n\
    Exit code 0: measured (failed pairs are named in the results). 2: bad input, or nothing could be measured.")]
pub struct EvalMapsCommand {
    /// Folder of sets
    sets: Option<PathBuf>,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Which methods, by comma: wks, wks+zoomout, wks+orientation+zoomout, landmarks,
    /// landmarks+zoomout, true20+zoomout [default: all]
    #[arg(long, value_delimiter = ',', value_name = "A,B")]
    methods: Vec<String>,
    /// Samples that an error is the mean of; 0 takes all
    #[arg(long, default_value_t = MapSettings::default().n_samples, value_name = "N")]
    samples: usize,
    /// Send vertices to points of triangles instead of vertices (Ezuz & Ben-Chen 2017)
    #[arg(long)]
    precise: bool,
    /// Pairs at once; 0 takes one for each thread. Results do not depend on it
    #[arg(long, default_value_t = 0, value_name = "N")]
    jobs: usize,
    /// Neither use nor keep prepared shapes
    #[arg(long)]
    no_cache: bool,
    /// Measure nothing: make index.html and table.md anew from the results in the output folder
    #[arg(long)]
    report_only: bool,
}

impl EvalMapsCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        check_folder(&self.output, &["results.json", "table.md", "index.html"], &[])?;
        let folder = OutputFolder::open(&self.output)?;
        let Some(sets) = &self.sets else {
            let files = report::maps_again(folder.path())?;
            files.iter().for_each(|file| console::data(file.display()));
            return Ok(Outcome::Done);
        };
        let dataset = CorrespondenceDataset::open(sets)?;
        let task = console::progress_with_time_left(common.quiet);
        let results = run_maps(&dataset, &self.settings(common)?, &task)?;
        let files = report::write_maps(&results, folder.path())?;
        if common.json {
            let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
            console::data(json!({ "summaries": results.summaries, "files": files }));
        } else {
            console::data(results.to_markdown());
            print_files(&files);
        }
        if results.rows.iter().all(|row| row.error.is_none()) {
            let first = results.rows.iter().find_map(|row| row.failure.as_deref());
            bail!("no map could be measured; the first: {}", first.unwrap_or("no pair"));
        }
        Ok(Outcome::Done)
    }

    fn settings(&self, common: &Common) -> Result<MapSettings> {
        let mut settings = MapSettings {
            n_samples: self.samples,
            precise: self.precise,
            workers: Workers::new(common.threads, self.jobs),
            cache: if self.no_cache { ShapeCache::off() } else { ShapeCache::of_user() },
            ..MapSettings::default()
        };
        if !self.methods.is_empty() {
            settings.methods = parsed(&self.methods)?;
        }
        Ok(settings)
    }
}
