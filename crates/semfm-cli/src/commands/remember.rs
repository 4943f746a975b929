//! `semfm-cli remember`: demonstrations into a memory.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use semfm::files::{EntryRecord, read_region};
use semfm::geom::io::{MeshFormat, printable, read_mesh};
use semfm::memory::{Demonstration, Memory};
use serde_json::json;

use super::encoder_options::EncoderOptions;
use super::{Outcome, memory_options};
use crate::console;
use crate::options::Common;

/// Add a demonstration to a memory: an object and where one acts on it
///
/// A memory is a folder of demonstrations, of one kind of object or of many. `transfer --memory` asks it, and
/// `info` lists it.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli remember mug.obj --region grip.json --memory mugs --kind mug\n  \
    semfm-cli remember pan.ply --region handle.json --memory kitchen --name 'frying pan' --kind pan\n  \
    semfm-cli remember --forget 'frying pan' --memory kitchen\n  \
    semfm-cli transfer kettle.ply --memory kitchen -o out")]
pub struct RememberCommand {
    #[arg(
        required_unless_present = "forget",
        help = format!("The demonstrated object's mesh: {}", MeshFormat::readable_names())
    )]
    mesh: Option<PathBuf>,
    /// The region on it (JSON)
    #[arg(long, value_name = "FILE", required_unless_present = "forget")]
    region: Option<PathBuf>,
    /// The memory's folder; made if it is not there
    #[arg(short, long, value_name = "FOLDER")]
    memory: PathBuf,
    /// Its name in the memory [default: that of the mesh file]
    #[arg(long, value_name = "TEXT")]
    name: Option<String>,
    /// What kind of object it is, in your words
    #[arg(long, value_name = "TEXT")]
    kind: Option<String>,
    /// Replace the entry of that name, or with the same mesh and region
    #[arg(long)]
    replace: bool,
    /// Take this entry away instead
    #[arg(long, value_name = "NAME", conflicts_with_all = ["mesh", "region", "name", "kind", "replace",
        "embeddings", "encoder", "rolls"])]
    forget: Option<String>,
    /// Embeddings of the object's views, instead of an encoder
    #[arg(long, value_name = "A.emb.mcap", conflicts_with_all = ["encoder", "rolls"],
        help_heading = "Features")]
    embeddings: Option<PathBuf>,
    #[command(flatten)]
    encoder: EncoderOptions,
    /// Neither use nor keep prepared shapes and embeddings
    #[arg(long)]
    no_cache: bool,
}

impl RememberCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        if let Some(name) = &self.forget {
            let mut memory = Memory::open(&self.memory)?;
            memory.forget(name)?;
            let left = memory.entries().len();
            match common.json {
                true => console::data(json!({ "forgotten": name, "n_entries": left })),
                false => console::data(format_args!("forgot {}, {left} left", printable(name))),
            }
            return Ok(Outcome::Done);
        }
        let (Some(path), Some(region)) = (&self.mesh, &self.region) else {
            bail!("remember: expected a mesh and --region");
        };
        let settings = memory_options::settings(self.no_cache, 0);
        let cache = settings.cache.clone();
        let mut memory = Memory::open_or_begin(&self.memory)?.with_settings(settings);
        let task = console::progress(common.quiet);
        let file = read_mesh(path)?;
        let demonstrated = read_region(region, &file.mesh)?;
        let name = match &self.name {
            Some(name) => name.clone(),
            None => stem(path)?,
        };
        let (given, own) = (self.embeddings.as_deref(), memory.encoder());
        let encoded =
            memory_options::embeddings(&file, given, &self.encoder, own, &cache, &task, common)
                .with_context(|| path.display().to_string())?;
        let demonstration = Demonstration {
            name,
            kind: self.kind.clone(),
            mesh: &file.mesh,
            region: &demonstrated,
            embeddings: &encoded.embeddings,
            mesh_file: Some(path.display().to_string()),
            region_file: Some(region.display().to_string()),
        };
        let entry = memory.remember(&demonstration, self.replace, &task)?.clone();
        print(&entry, &memory, common);
        Ok(Outcome::Done)
    }
}

/// The name of a file without its extension.
fn stem(path: &Path) -> Result<String> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    stem.map(str::to_owned).context("the mesh file's name is no text: give --name")
}

fn print(entry: &EntryRecord, memory: &Memory, common: &Common) {
    let n_entries = memory.entries().len();
    if common.json {
        let mut about = serde_json::to_value(entry).unwrap_or_default();
        if let Some(about) = about.as_object_mut() {
            about.remove("descriptor");
        }
        let folder = memory.folder().display().to_string();
        console::data(json!({ "entry": about, "memory": folder, "n_entries": n_entries }));
        return;
    }
    let kind = entry.kind.as_ref().map_or(String::new(), |kind| format!(", {}", printable(kind)));
    console::data(format_args!(
        "remembered {}{kind}: {} of {} vertices; {n_entries} in {}",
        printable(&entry.name),
        entry.n_region,
        entry.mesh.n_vertices,
        memory.folder().display()
    ));
}
