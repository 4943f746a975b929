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

    /// The embeddings of the objects' default views, made where they are not there yet: in one call
    /// of the encoder, which may take longer to start than to look at an object.
    pub fn embed<const N: usize>(
        &self,
        files: [&MeshFile; N],
        colored: bool,
        common: &Common,
    ) -> Result<[EmbeddingsFile; N]> {
        let paths = files.map(|file| self.kept(file, colored));
        let mut embeddings: Vec<Option<EmbeddingsFile>> = Vec::with_capacity(N);
        // Whatever is wrong with a kept file, a new one is the cure.
        let mut missing: Vec<(&Path, &MeshFile)> = Vec::new();
        for (path, file) in paths.iter().zip(files) {
            let kept = load::embeddings(path, &file.mesh).ok();
            if kept.is_none() && missing.iter().all(|(other, _)| other != path) {
                missing.push((path, file));
            }
            embeddings.push(kept);
        }
        if !missing.is_empty() {
            self.make(&missing, colored, common)?;
        }
        let made = embeddings.into_iter().zip(paths.iter().zip(files));
        let all: Vec<EmbeddingsFile> = made
            .map(|(kept, (path, file))| kept.map_or_else(|| load::embeddings(path, &file.mesh), Ok))
            .collect::<Result<_>>()?;
        all.try_into().map_err(|_| anyhow::anyhow!("one embedding for each of {N} objects"))
    }

    /// The same of one object, and what making them took, now or then.
    pub fn embed_timed(
        &self,
        file: &MeshFile,
        colored: bool,
        common: &Common,
    ) -> Result<(EmbeddingsFile, Option<Took>)> {
        let [embeddings] = self.embed([file], colored, common)?;
        let took = std::fs::read(took_path(&self.kept(file, colored))).ok();
        Ok((embeddings, took.and_then(|bytes| serde_json::from_slice(&bytes).ok())))
    }

    /// Draws the objects and has them embedded, each into its place.
    fn make(&self, objects: &[(&Path, &MeshFile)], colored: bool, common: &Common) -> Result<()> {
        let scratch = tempfile::tempdir().context("a folder for the views")?;
        let (mut drawn, mut views_ms) = (Vec::new(), Vec::new());
        for (path, file) in objects {
            let start = Instant::now();
            let name = path.file_name().context("a name for the views")?;
            let views = scratch.path().join(name).with_extension("").with_extension("views.mcap");
            // By the CPU on every machine: what is kept must not depend on the driver that was there.
            make_views(file, &shown(colored), &Renderer::cpu(), &views, common)?;
            views_ms.push(start.elapsed().as_secs_f64() * 1e3);
            drawn.push(views);
        }
        let start = Instant::now();
        self.run(&drawn, common)?;
        let embed_ms = start.elapsed().as_secs_f64() * 1e3 / objects.len() as f64;
        for ((path, _), views_ms) in objects.iter().zip(views_ms) {
            // The times are beside the point: embeddings without them are as good.
            let _ = write_atomically(took_path(path), |out| {
                Ok(serde_json::to_writer(out, &Took { views_ms, embed_ms })?)
            });
        }
        Ok(())
    }

    /// Calls the sidecar: `NAME.views.mcap` becomes `NAME.emb.mcap` in the folder.
    fn run(&self, views: &[PathBuf], common: &Common) -> Result<()> {
        let program = std::env::var_os(PROGRAM).unwrap_or_else(|| "semfm-embed".into());
        let mut arguments: Vec<OsString> = views.iter().map(OsString::from).collect();
        arguments.extend(["--output-folder".into(), OsString::from(&self.folder)]);
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

    /// Where the embeddings of an object are kept.
    fn kept(&self, file: &MeshFile, colored: bool) -> PathBuf {
        self.folder.join(format!("{}.emb.mcap", self.key(file, colored)))
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

/// Where it stands what making embeddings took.
fn took_path(embeddings: &Path) -> PathBuf {
    embeddings.with_extension("took.json")
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
