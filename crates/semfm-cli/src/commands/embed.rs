//! `semfm-cli embed`: what an encoder makes of an object, as a file.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use semfm::Method;
use semfm::encoder::rendered_views::Coloring;
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFormat, read_mesh};
use semfm::views::mcap::Dtype;
use serde_json::json;

use super::Outcome;
use super::encoder_options::EncoderOptions;
use crate::console;
use crate::options::Common;

/// Make the embeddings of an object: rendered views, encoded
///
/// `transfer` and `eval` do this by themselves; a file serves several programs.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  semfm-cli embed mug.obj -o mug.emb.mcap\n  \
    semfm-cli embed mug.obj -o mug.emb.mcap --encoder google/siglip2-base-patch16-224")]
pub struct EmbedCommand {
    #[arg(help = format!("The mesh: {}", MeshFormat::readable_names()))]
    mesh: PathBuf,
    /// Where to write (`NAME.emb.mcap`)
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    encoder: EncoderOptions,
    /// Store numbers in half precision: half the size
    #[arg(long)]
    half: bool,
    /// Show the object in its own colours, where the encoder reads colours
    #[arg(long)]
    colors: bool,
    /// Neither use nor keep embeddings
    #[arg(long)]
    no_cache: bool,
}

impl EmbedCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = console::progress(common.quiet);
        let file = read_mesh(&self.mesh)?;
        let cache = if self.no_cache { ShapeCache::off() } else { ShapeCache::of_user() };
        let rolls = Method::default().info().features.rolls;
        let encoder = self.encoder.open(rolls, &cache, common)?;
        let coloring = if self.colors { Coloring::Own } else { Coloring::Grey };
        let encoded = encoder.embed(&file, coloring, &task);
        let embeddings = encoded.with_context(|| self.mesh.display().to_string())?.embeddings;
        let dtype = if self.half { Dtype::F16 } else { Dtype::F32 };
        embeddings.write(&self.output, dtype)?;
        let about = &embeddings.metadata;
        if common.json {
            console::data(json!({
                "file": self.output.display().to_string(),
                "encoder": about.encoder,
                "version": about.revision,
                "rolls": about.rolls,
                "n_views": embeddings.views.len(),
                "dim": embeddings.dim(),
            }));
        } else {
            console::data(self.output.display());
        }
        Ok(Outcome::Done)
    }
}
