//! The HTML report that `semfm-cli eval` writes beside its results.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use semfm_eval::report::{self, WrittenReport};
use semfm_eval::{ReportSettings, Results, table};

use super::Outcome;
use crate::console;
use crate::options::Common;

/// What the report holds.
#[derive(Debug, Args)]
#[command(next_help_heading = "Report")]
pub struct ReportOptions {
    /// Measure nothing: make index.html and table.md anew from the results in the output folder
    #[arg(long)]
    pub report_only: bool,
    /// Pairs in the gallery for the default method, worst first
    #[arg(long, default_value_t = ReportSettings::default().leading_cards, value_name = "N")]
    gallery: usize,
    /// Pairs in the gallery for each other method, worst first
    #[arg(long, default_value_t = ReportSettings::default().other_cards, value_name = "N")]
    gallery_others: usize,
    /// What `semfm-vlm --pictures` kept, to be shown beside its lift
    #[arg(long, value_name = "FOLDER")]
    vlm_pictures: Option<PathBuf>,
}

/// Why a page has fewer pictures than it could have.
pub fn print_notes(page: &WrittenReport, common: &Common) {
    if !common.quiet {
        page.notes.iter().for_each(|note| console::message(format_args!("note: {note}")));
    }
}

impl ReportOptions {
    /// As settings.
    pub fn settings(&self) -> ReportSettings {
        ReportSettings {
            leading_cards: self.gallery,
            other_cards: self.gallery_others,
            vlm_pictures: self.vlm_pictures.clone(),
            ..ReportSettings::default()
        }
    }

    /// Makes the report and the table in a folder of results anew.
    pub fn write_again(&self, folder: &Path, common: &Common) -> Result<Outcome> {
        let task = console::progress(common.quiet);
        let table = table::write(&Results::read(folder)?, folder)?;
        let page = report::again(folder, &self.settings(), &task)?;
        print_notes(&page, common);
        let files = [table, page.path];
        files.iter().for_each(|file| console::data(file.display()));
        Ok(Outcome::Done)
    }
}
