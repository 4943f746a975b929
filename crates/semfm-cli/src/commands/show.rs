//! `semfm-cli show`: results as one HTML page.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use semfm_show::{groups_of_paths, write_page};
use serde_json::json;

use super::Outcome;
use crate::console;
use crate::options::Common;
use crate::output::OutputFile;

/// Put results on one HTML page, in three dimensions: transfers, meshes with regions and grasps, views, motions
///
/// The page needs no network. Pointing at the source lights the matched place of the target, and the
/// other way round. A region after a transfer's folder is the true one, which the answer is held against.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  semfm-cli show semfm-demo/transfer -o demo.html\n  \
    semfm-cli show mug.obj grip.json mug.views.mcap -o mug.html\n  \
    semfm-cli show out true-grip.json -o judged.html\n  semfm-cli show plan/trajectory.json -o motion.html")]
pub struct ShowCommand {
    /// Folders that `transfer -o` wrote (the true region on the target may follow), meshes, regions and
    /// grasps (after their mesh), views files, folders that `plan -o` wrote or their trajectory.json
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Where to write the page; `-` is stdout
    #[arg(short, long, value_name = "PAGE.html")]
    output: PathBuf,
    /// Heading of the page
    #[arg(long, default_value = "SemFM", value_name = "TEXT")]
    title: String,
}

impl ShowCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let read = files_of(&self.paths);
        let inputs: Vec<&Path> = read.iter().map(PathBuf::as_path).collect();
        let page = OutputFile::new(&self.output, &inputs, common)?;
        let groups = groups_of_paths(&self.paths, &console::progress(common.quiet))?;
        write_page(page.path(), &self.title, &groups)?;
        if common.json {
            let output = self.output.display().to_string();
            console::data(json!({ "page": output, "n_groups": groups.len() }));
        }
        page.finish(common)?;
        Ok(Outcome::Done)
    }
}

/// The files themselves and those in folders: `show` reads a folder of `transfer` or `plan`, or of `demo` with
/// such inside.
fn files_of(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for path in paths {
        let folders = [path.clone(), path.join("transfer"), path.join("plan")];
        let entries = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
        files.extend(entries.flatten().map(|entry| entry.path()));
        files.push(path.clone());
    }
    files
}
