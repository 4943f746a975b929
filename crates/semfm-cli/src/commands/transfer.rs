//! `semfm-cli transfer`: carry a region from one object to another.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::{ArgGroup, Args};
use semfm::geom::ShapeCache;
use semfm::geom::io::MeshFile;
use semfm::grasp::Grasps;
use semfm::output::stages_ms;
use semfm::region_file::read_region;
use semfm::views::LiftSettings;
use semfm::{
    Meaning, Method, PipelineSettings, PreparedObject, Region, Rule, Task, Transfer, Verdict,
    transfer,
};
use semfm_show::write_transfer;
use serde_json::{Map, Value, json};

use super::Outcome;
use super::embed::{Encoder, announce};
use super::grasp::{GraspJob, GraspOptions, grasps_summary, gripper_help, tell as tell_grasps};
use crate::options::Common;
use crate::{load, talk};

/// Carry a region from one object to another
///
/// Needs to know what the surfaces mean: embeddings files of both objects, an encoder that makes
/// them, or per-vertex features from anybody's network.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("meaning").required(true)
    .args(["source_embeddings", "encoder", "source_features"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out --encoder google/siglip2-base-patch16-224\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out \\\n    \
    --source-embeddings mug.emb.mcap --target-embeddings kettle.emb.mcap\n\n\
    Exit code 0: an answer to use or to check. 1: verdict `refuse` (every file is written all the same). 2: bad input.")]
pub struct Carry {
    /// The demonstrated object's mesh
    source: PathBuf,
    /// The mesh of the object to act on
    target: PathBuf,
    /// The region on the source (JSON)
    #[arg(long, value_name = "FILE")]
    region: PathBuf,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    meaning: MeaningOptions,
    #[command(flatten)]
    matching: MatchingOptions,
    #[arg(long, value_name = "NAME|URDF", help_heading = "Gripper", help = gripper_help("Go on to grasps with this gripper"))]
    gripper: Option<String>,
    #[command(flatten)]
    grasps: GraspOptions,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "What the surfaces mean")]
struct MeaningOptions {
    /// Embeddings of the source's views
    #[arg(long, value_name = "A.emb.mcap", requires = "target_embeddings")]
    source_embeddings: Option<PathBuf>,
    /// Embeddings of the target's views
    #[arg(long, value_name = "B.emb.mcap", requires = "source_embeddings")]
    target_embeddings: Option<PathBuf>,
    /// Make the embeddings: a Hugging Face name, a local checkpoint, or an ONNX encoder's JSON
    #[arg(long, value_name = "MODEL")]
    encoder: Option<String>,
    /// Rotations of each view that the encoder averages [default: 4, for `semfm` 1]
    #[arg(long, value_name = "1|2|4", requires = "encoder")]
    rolls: Option<u32>,
    /// Per-vertex features of the source (n × d)
    #[arg(long, value_name = "A.npy", requires = "target_features")]
    source_features: Option<PathBuf>,
    /// Per-vertex features of the target (n × d)
    #[arg(long, value_name = "B.npy", requires = "source_features")]
    target_features: Option<PathBuf>,
    /// Lift with the settings of this method instead of the method's own
    #[arg(long, value_name = "METHOD")]
    features: Option<Method>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Matching")]
struct MatchingOptions {
    /// fused, semfm (the paper to the letter), anchored, sinkhorn, nearest or wks
    #[arg(long, default_value_t = Method::Fused)]
    method: Method,
    /// How a map carries the region: preimage, or image as in the paper's text
    #[arg(long, default_value_t = Rule::Preimage)]
    rule: Rule,
    /// Compute a second opinion beside `nearest` and `sinkhorn`, as costly as `fused`: their
    /// confidence is then the agreement with it (other methods have theirs in any case)
    #[arg(long)]
    second_opinion: bool,
    /// Seed of everything drawn by chance
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Simplify larger meshes to this many vertices; 0 keeps them all
    #[arg(long, value_name = "N")]
    working_vertices: Option<usize>,
    /// Eigenpairs of each shape [default: 60, or what the mesh allows]
    #[arg(short, value_name = "N")]
    k: Option<usize>,
    /// Neither use nor keep prepared shapes and embeddings
    #[arg(long)]
    no_cache: bool,
}

impl MatchingOptions {
    fn settings(&self, features: Option<Method>) -> PipelineSettings {
        let mut settings = PipelineSettings::of(self.method);
        if let Some(method) = features {
            settings.lift = PipelineSettings::of(method).lift;
        }
        settings.transfer.rule = self.rule;
        settings.transfer.second_opinion |= self.second_opinion;
        if let Some(n) = self.working_vertices {
            settings.shape.working_vertices = n;
        }
        if let Some(k) = self.k {
            (settings.shape.k, settings.shape.clip_k) = (k, false);
        }
        settings.cache = if self.no_cache { ShapeCache::off() } else { ShapeCache::of_user() };
        settings.with_seed(self.seed)
    }
}

impl Carry {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = talk::watched(common.quiet);
        let settings = self.matching.settings(self.meaning.features);
        let [source, target] = [&self.source, &self.target].map(|path| load::mesh(path, None));
        let (source, target) = (source?, target?);
        let region = read_region(&self.region, &source.mesh)?;
        let hand = self.gripper.as_ref();
        let hand = hand.map(|hand| self.grasps.prepare(hand, target.mesh.clone())).transpose()?;
        let (source, target) = self.prepare(source, target, &settings, &task, common)?;
        let carried = transfer(&source, &target, &region, &settings.transfer, &task)?;
        let job = Job { source: &source, target: &target, region: &region, carried: &carried };
        let about = self.about(&settings.lift);
        let hand = hand.map(|hand| Reach { job: hand, seed: self.matching.seed });
        job.finish(&self.output, about, hand.as_ref(), &task, common)
    }

    /// Both objects, with their meaning from wherever the caller said.
    fn prepare(
        &self,
        source: MeshFile,
        target: MeshFile,
        settings: &PipelineSettings,
        task: &Task,
        common: &Common,
    ) -> Result<(PreparedObject, PreparedObject)> {
        let meaning = &self.meaning;
        if let (Some(a), Some(b)) = (&meaning.source_features, &meaning.target_features) {
            let (a, b) = (load::features(a, &source.mesh)?, load::features(b, &target.mesh)?);
            let (a, b) = (Meaning::PerVertex(&a), Meaning::PerVertex(&b));
            return self.both((source, a), (target, b), settings, task);
        }
        let (a, b) =
            if let (Some(a), Some(b)) = (&meaning.source_embeddings, &meaning.target_embeddings) {
                (load::embeddings(a, &source.mesh)?, load::embeddings(b, &target.mesh)?)
            } else {
                let model = meaning.encoder.as_deref().context("--encoder is missing")?;
                let scratch = tempfile::tempdir().context("a folder for embeddings")?;
                let rolls = meaning.rolls.unwrap_or(self.matching.method.info().features.rolls);
                let encoder = Encoder::new(model, rolls, !self.matching.no_cache, scratch.path())?;
                // Colour on one side alone misleads the encoder.
                let colored = !source.appearance.is_plain() && !target.appearance.is_plain();
                encoder.embed([&source, &target], colored, common)?.into()
            };
        announce("source", &a, common);
        announce("target", &b, common);
        let (a, b) = (Meaning::Views(&a.views), Meaning::Views(&b.views));
        self.both((source, a), (target, b), settings, task)
    }

    /// Both objects prepared side by side, or the first failure, which names its file.
    fn both(
        &self,
        source: (MeshFile, Meaning<'_>),
        target: (MeshFile, Meaning<'_>),
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<(PreparedObject, PreparedObject)> {
        let new = |(file, meaning): (MeshFile, Meaning<'_>), path: &Path| {
            PreparedObject::new(file.mesh, meaning, settings, task)
                .with_context(|| path.display().to_string())
        };
        let (source, target) =
            rayon::join(|| new(source, &self.source), || new(target, &self.target));
        Ok((source?, target?))
    }

    fn about(&self, lift: &LiftSettings) -> Map<String, Value> {
        let mut about = Map::new();
        let files = json!({
            "source": self.source.display().to_string(),
            "target": self.target.display().to_string(),
            "region": self.region.display().to_string(),
        });
        about.insert("files".into(), files);
        about.insert("lift".into(), json!(format!("{lift:?}")));
        about.insert("seeds".into(), json!({ "lift": lift.seed, "clusters": self.matching.seed }));
        about.insert("version".into(), json!(env!("CARGO_PKG_VERSION")));
        about
    }
}

/// A finished transfer and what it was made from.
pub struct Job<'a> {
    pub source: &'a PreparedObject,
    pub target: &'a PreparedObject,
    pub region: &'a Region,
    pub carried: &'a Transfer,
}

/// The hand that shall grasp in the carried region.
pub struct Reach {
    pub job: GraspJob,
    pub seed: u64,
}

impl Job<'_> {
    /// Writes every file, tells the answer, and says how the run ended. A refused region is not
    /// grasped.
    pub fn finish(
        &self,
        output: &Path,
        about: Map<String, Value>,
        hand: Option<&Reach>,
        task: &Task,
        common: &Common,
    ) -> Result<Outcome> {
        let Self { source, target, region, carried } = *self;
        let mut files = write_transfer(output, source, target, region, carried, about, task)?;
        let refused = carried.verdict == Verdict::Refuse;
        let mut grasps = None;
        if let Some(Reach { job, seed }) = hand.filter(|_| !refused) {
            let found = job.find(carried.weights(), *seed, task)?;
            let (answer, picture) = (output.join("grasps.json"), output.join("grasps.png"));
            job.write(&answer, &found, *seed)?;
            job.draw(&picture, carried.weights(), &found, task)?;
            files.extend([answer, picture]);
            grasps = Some(found);
        } else {
            forget_grasps(output)?;
        }
        let stages = stages_ms(source, target, carried);
        if common.json {
            talk::say(self.summary(&stages, &files, grasps.as_ref()));
        } else {
            tell(self, &stages, common);
            grasps.iter().for_each(|found| tell_grasps(found, common));
            talk::say("wrote");
            files.iter().for_each(|file| talk::say(format_args!("  {}", file.display())));
        }
        let without = grasps.is_some_and(|found| found.grasps.is_empty());
        Ok(if refused || without { Outcome::NoAnswer } else { Outcome::Done })
    }

    fn summary(
        &self,
        stages: &[(String, f64)],
        files: &[PathBuf],
        grasps: Option<&Grasps>,
    ) -> Value {
        let stages: Map<String, Value> =
            stages.iter().map(|(name, ms)| (name.clone(), json!(ms))).collect();
        let mut summary = json!({
            "verdict": self.carried.verdict,
            "confidence": self.carried.confidence,
            "method": self.carried.report.settings.method,
            "n_vertices": self.carried.region.vertices().len(),
            "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
            "stages_ms": stages,
        });
        if let Some(found) = grasps {
            summary["grasps"] = grasps_summary(found);
        }
        summary
    }
}

/// Removes what an earlier run left in the folder: its hands would stand at a region that is gone.
fn forget_grasps(folder: &Path) -> Result<()> {
    for path in ["grasps.json", "grasps.png"].map(|name| folder.join(name)) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).with_context(|| path.display().to_string());
            }
            _ => {}
        }
    }
    Ok(())
}

fn tell(job: &Job<'_>, stages: &[(String, f64)], common: &Common) {
    let carried = job.carried;
    let n = carried.region.vertices().len();
    let verdict = json!(carried.verdict);
    let (verdict, confidence) = (verdict.as_str().unwrap_or_default(), carried.confidence);
    talk::say(format_args!("verdict     {verdict} (confidence {confidence:.2})"));
    talk::say(format_args!(
        "region      {n} of {} vertices of the target",
        carried.region.n_vertices()
    ));
    if carried.hypotheses.len() > 1 {
        let shares: Vec<String> =
            carried.hypotheses.iter().map(|h| format!("{:.0} %", 100.0 * h.probability)).collect();
        talk::say(format_args!("places      {}", shares.join(", ")));
    }
    let total: f64 = stages.iter().map(|(_, ms)| ms).sum();
    talk::say(format_args!("time        {total:.0} ms"));
    if common.verbose {
        stages.iter().for_each(|(name, ms)| talk::say(format_args!("  {name:20} {ms:8.1} ms")));
        for (name, object) in [("source", job.source), ("target", job.target)] {
            talk::say(format_args!("{name:11} {}", object.shape.report().cleaning));
        }
    }
}
