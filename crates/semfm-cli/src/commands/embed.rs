//! Embeddings through the Python sidecar, kept between runs: what `--encoder` does.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFile, write_atomically};
use semfm::views::Renderer;
use semfm::views::mcap::EmbeddingsFile;
use serde::{Deserialize, Serialize};

use super::views::{Coloring, ViewSettings, make_views};
use crate::options::Common;
use crate::{load, talk};

/// Names the program that embeds; else `semfm-embed` is looked for on the PATH.
const PROGRAM: &str = "SEMFM_EMBED";

/// What making the embeddings of an object took, the encoder's start included.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Took {
    /// Milliseconds for the pictures.
    pub views_ms: f64,
    /// Milliseconds for the encoder.
    pub embed_ms: f64,
}

/// An encoder and where its work is kept.
pub struct Encoder {
    model: String,
    rolls: u32,
    folder: PathBuf,
}

impl Encoder {
    /// `rolls` rotations of each view are averaged; `keep` false works in `scratch`.
    pub fn new(model: &str, rolls: u32, keep: bool, scratch: &Path) -> Result<Self> {
        let beside_shapes = |shapes: &Path| shapes.with_file_name("embeddings");
        let kept = ShapeCache::of_user().folder().filter(|_| keep).map(beside_shapes);
        let folder = kept.unwrap_or_else(|| scratch.to_owned());
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        Ok(Self { model: model.to_owned(), rolls, folder })
    }

    /// The embeddings of an object's default views, made where they are not there yet.
    pub fn embed(&self, file: &MeshFile, colored: bool, common: &Common) -> Result<EmbeddingsFile> {
        Ok(self.embed_timed(file, colored, common)?.0)
    }

    /// The same, and what making them took, now or then.
    pub fn embed_timed(
        &self,
        file: &MeshFile,
        colored: bool,
        common: &Common,
    ) -> Result<(EmbeddingsFile, Option<Took>)> {
        let path = self.folder.join(format!("{}.emb.mcap", self.key(file, colored)));
        // Whatever is wrong with a kept file, a new one is the cure.
        if let Ok(kept) = load::embeddings(&path, &file.mesh) {
            let took = std::fs::read(path.with_extension("took.json")).ok();
            let took = took.and_then(|bytes| serde_json::from_slice(&bytes).ok());
            return Ok((kept, took));
        }
        let start = Instant::now();
        let scratch = tempfile::tempdir().context("a folder for the views")?;
        let views = scratch.path().join("object.views.mcap");
        // By the CPU on every machine: what is kept must not depend on the driver that was there.
        make_views(file, &shown(colored), &Renderer::cpu(), &views, common)?;
        let views_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        self.run(&views, &path, common)?;
        let took = Took { views_ms, embed_ms: start.elapsed().as_secs_f64() * 1e3 };
        // The times are beside the point: embeddings without them are as good.
        let _ = write_atomically(path.with_extension("took.json"), |out| {
            Ok(serde_json::to_writer(out, &took)?)
        });
        Ok((load::embeddings(&path, &file.mesh)?, Some(took)))
    }

    fn run(&self, views: &Path, output: &Path, common: &Common) -> Result<()> {
        let program = std::env::var_os(PROGRAM).unwrap_or_else(|| "semfm-embed".into());
        let mut arguments: Vec<OsString> = vec![views.into(), "-o".into(), output.into()];
        arguments.extend(["--model".into(), (&self.model).into()]);
        arguments.extend(["--rolls".into(), self.rolls.to_string().into()]);
        if common.threads > 0 {
            arguments.extend(["--threads".into(), common.threads.to_string().into()]);
        }
        if common.quiet {
            arguments.push("--quiet".into());
        }
        let status = Command::new(&program).args(arguments).stdout(Stdio::null()).status();
        let status = status.map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => anyhow::anyhow!(
                "--encoder needs the program `{}`, which is not there: install it with \
                 `pip install '.[onnx]'` (or `'.[embed]'` for SigLIP and DINOv2), or name it in {PROGRAM}",
                program.display()
            ),
            _ => anyhow::anyhow!("{}: {error}", program.display()),
        })?;
        if !status.success() {
            bail!("{} ended with {status} (its reason stands above)", program.display());
        }
        Ok(())
    }

    /// A name for the embeddings: of this mesh, these pictures, this encoder.
    fn key(&self, file: &MeshFile, colored: bool) -> String {
        let mut words =
            vec![file.mesh.hash().to_string(), self.model.clone(), self.rolls.to_string()];
        words.push(format!("{:?}", shown(colored)));
        if colored {
            words.push(format!("{:?}", file.appearance));
        }
        // A local model is known by when it was written; a hub name by itself.
        if let Ok(written) = std::fs::metadata(&self.model).and_then(|about| about.modified()) {
            words.push(format!("{written:?}"));
        }
        blake3::hash(words.join("\n").as_bytes()).to_hex().to_string()
    }
}

/// How an encoder is shown an object, in its own colours or in grey.
fn shown(colored: bool) -> ViewSettings {
    let coloring = if colored { Coloring::Own } else { Coloring::Grey };
    ViewSettings { coloring, ..Default::default() }
}

/// Says which encoder made the embeddings that are used.
pub fn announce(name: &str, embeddings: &EmbeddingsFile, common: &Common) {
    if common.verbose {
        let about = &embeddings.metadata;
        let views = embeddings.views.len();
        talk::remark(format_args!(
            "{name}: {views} views by {} ({} rolls)",
            about.encoder, about.rolls
        ));
    }
}
