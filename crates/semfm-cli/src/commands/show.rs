//! `semfm-cli show`: results as one HTML page.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use semfm::show::{group_of_path, write_page};
use serde_json::json;

use super::Outcome;
use crate::options::Common;
use crate::talk;

/// Put results on one HTML page, in three dimensions: folders of transfers and meshes
///
/// The page needs no network. Pointing at the source lights the matched place of the target.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli show semfm-demo/transfer -o demo.html")]
pub struct Show {
    /// Folders that `transfer -o` wrote, and mesh files
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Where to write the page
    #[arg(short, long, value_name = "PAGE.html")]
    output: PathBuf,
    /// Heading of the page
    #[arg(long, default_value = "SemFM", value_name = "TEXT")]
    title: String,
}

impl Show {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let groups =
            self.paths.iter().map(|path| group_of_path(path)).collect::<semfm::Result<Vec<_>>>()?;
        write_page(&self.output, &self.title, &groups)?;
        let output = self.output.display();
        if common.json {
            talk::say(json!({ "page": output.to_string(), "n_groups": groups.len() }));
        } else {
            talk::say(output);
        }
        Ok(Outcome::Done)
    }
}
