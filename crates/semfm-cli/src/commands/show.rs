//! `semfm-cli show`: results as one HTML page.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use semfm_show::{groups_of_paths, write_page};
use serde_json::json;

use super::Outcome;
use crate::console;
use crate::options::Common;

/// Put results on one HTML page, in three dimensions: transfers, meshes with regions and grasps, views
///
/// The page needs no network. Pointing at the source lights the matched place of the target, and the
/// other way round.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  semfm-cli show semfm-demo/transfer -o demo.html\n  \
    semfm-cli show mug.obj grip.json mug.views.mcap -o mug.html")]
pub struct ShowCommand {
    /// Folders that `transfer -o` wrote, meshes, regions and grasps (after their mesh), views files
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Where to write the page
    #[arg(short, long, value_name = "PAGE.html")]
    output: PathBuf,
    /// Heading of the page
    #[arg(long, default_value = "SemFM", value_name = "TEXT")]
    title: String,
}

impl ShowCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let groups = groups_of_paths(&self.paths, &console::progress(common.quiet))?;
        write_page(&self.output, &self.title, &groups)?;
        let output = self.output.display();
        if common.json {
            console::data(json!({ "page": output.to_string(), "n_groups": groups.len() }));
        } else {
            console::data(output);
        }
        Ok(Outcome::Done)
    }
}
