//! `semfm-cli transfer`: transfer a region from one object to another.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{ArgGroup, Args};
use semfm::encoder_command::{EncodedPair, EncoderCommand, EncoderSettings};
use semfm::files::{
    Provenance, Seeds, TransferInputs, read_embeddings, read_region, read_vertex_features,
};
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::rendered_views::Coloring;
use semfm::{FeatureSource, Method, PipelineSettings, Prepared, Rule, Task, prepare, transfer};

use super::Outcome;
use super::grasp::{GraspOptions, gripper_help};
use super::transfer_output::TransferOutput;
use crate::console;
use crate::options::Common;

/// Transfer a region from one object to another
///
/// Features say which places of the two surfaces are alike: embeddings files of both objects, an
/// encoder that makes them, or per-vertex features from any network. The method `wks` needs none.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("features_from")
    .args(["source_embeddings", "encoder", "source_features"]))]
#[command(after_help = "Examples:\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out --encoder google/siglip2-base-patch16-224\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out \\\n    \
    --source-embeddings mug.emb.mcap --target-embeddings kettle.emb.mcap\n\n\
    Exit code 0: an answer to use or to check. 1: verdict `refuse` (every file is written all the same). 2: bad input.")]
pub struct TransferCommand {
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
    features: FeatureOptions,
    #[command(flatten)]
    matching: MatchingOptions,
    #[arg(long, value_name = "NAME|URDF", help_heading = "Gripper",
        help = gripper_help("Go on to grasps with this gripper"))]
    gripper: Option<String>,
    #[command(flatten)]
    grasps: GraspOptions,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Features")]
struct FeatureOptions {
    /// Embeddings of the source's views
    #[arg(long, value_name = "A.emb.mcap", requires = "target_embeddings")]
    source_embeddings: Option<PathBuf>,
    /// Embeddings of the target's views
    #[arg(long, value_name = "B.emb.mcap", requires = "source_embeddings")]
    target_embeddings: Option<PathBuf>,
    /// Make the embeddings: a Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or a
    /// class of Python as package.module:Class
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

impl FeatureOptions {
    fn are_missing(&self) -> bool {
        self.encoder.is_none() && self.source_embeddings.is_none() && self.source_features.is_none()
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Matching")]
struct MatchingOptions {
    #[arg(long, default_value_t = Method::Fused, help = method_help())]
    method: Method,
    /// How a map transfers the region: preimage, or image as in the paper's text
    #[arg(long, default_value_t = Rule::Preimage)]
    rule: Rule,
    /// Seed of everything drawn by chance
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Simplify larger meshes to this many vertices; 0 keeps them all
    #[arg(long, value_name = "N")]
    working_vertices: Option<usize>,
    /// Eigenpairs of each shape [default: 60, or what the mesh allows]
    #[arg(short, value_name = "N")]
    k: Option<usize>,
    /// Compute a second opinion beside `nearest` and `sinkhorn`, as costly as `fused`: their
    /// confidence is then the agreement with it (other methods have theirs in any case)
    #[arg(long)]
    second_opinion: bool,
    /// Neither use nor keep prepared shapes and embeddings
    #[arg(long)]
    no_cache: bool,
}

impl MatchingOptions {
    fn settings(&self, lift_as: Option<Method>) -> PipelineSettings {
        let mut settings = PipelineSettings::of(self.method);
        if let Some(method) = lift_as {
            settings.lift = PipelineSettings::of(method).lift;
        }
        settings.transfer.rule = self.rule;
        if let Some(n) = self.working_vertices {
            settings.shape.working_vertices = n;
        }
        if let Some(k) = self.k {
            (settings.shape.k, settings.shape.clip_k) = (k, false);
        }
        settings.transfer.second_opinion |= self.second_opinion;
        settings.cache = if self.no_cache { ShapeCache::off() } else { ShapeCache::of_user() };
        settings.with_seed(self.seed)
    }
}

/// The methods with what each does.
fn method_help() -> String {
    let methods: Vec<String> =
        Method::ALL.iter().map(|method| format!("{method}: {}", method.info().summary)).collect();
    methods.join("; ")
}

/// Both objects of a transfer.
struct Pair<T> {
    source: T,
    target: T,
}

impl TransferCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = console::progress(common.quiet);
        let settings = self.matching.settings(self.features.features);
        let files = Pair { source: read_mesh(&self.source)?, target: read_mesh(&self.target)? };
        let region = read_region(&self.region, &files.source.mesh)?;
        let grasps = match &self.gripper {
            Some(gripper) => {
                let (mesh, seed) = (files.target.mesh.clone(), self.matching.seed);
                Some(self.grasps.prepare(gripper, seed, mesh)?)
            }
            None => None,
        };
        let Pair { source, target } = self.prepare(files, &settings, &task, common)?;
        let (a, b) = (&source.object, &target.object);
        let transferred = transfer(a, b, &region, &settings.transfer, &task)?;
        let output = TransferOutput {
            source: &source,
            target: &target,
            region: &region,
            transfer: &transferred,
            provenance: self.provenance(&settings),
            grasps,
        };
        output.write(&self.output, &task, common)
    }

    /// Both objects, with features from wherever the caller said.
    fn prepare(
        &self,
        files: Pair<MeshFile>,
        settings: &PipelineSettings,
        task: &Task,
        common: &Common,
    ) -> Result<Pair<Prepared>> {
        let options = &self.features;
        if options.are_missing() {
            let method = self.matching.method;
            if method.info().reads_features {
                bail!(
                    "--method {method} needs features of both objects: give --encoder, \
                     --source-embeddings with --target-embeddings, or --source-features with \
                     --target-features (--method wks needs none)"
                );
            }
            let features =
                Pair { source: FeatureSource::Geometry, target: FeatureSource::Geometry };
            return self.prepare_both(files, features, settings, task);
        }
        if let (Some(a), Some(b)) = (&options.source_features, &options.target_features) {
            let a = read_vertex_features(a, &files.source.mesh)?;
            let b = read_vertex_features(b, &files.target.mesh)?;
            let features =
                Pair { source: FeatureSource::PerVertex(&a), target: FeatureSource::PerVertex(&b) };
            return self.prepare_both(files, features, settings, task);
        }
        let (a, b) =
            if let (Some(a), Some(b)) = (&options.source_embeddings, &options.target_embeddings) {
                let a = read_embeddings(a, &files.source.mesh)?;
                (a, read_embeddings(b, &files.target.mesh)?)
            } else {
                let coloring = Coloring::of_pair(&files.source, &files.target);
                let encoder = EncoderCommand::new(self.encoder_settings(common)?)?;
                let EncodedPair { source, target } =
                    encoder.embed_pair(&files.source, &files.target, coloring, task)?;
                if let Some(note) = encoder.note().filter(|_| !common.quiet) {
                    console::message(format_args!("note: {note}"));
                }
                (source.embeddings, target.embeddings)
            };
        for (name, embeddings) in [("source", &a), ("target", &b)] {
            if common.verbose {
                let (n, about) = (embeddings.views.len(), &embeddings.metadata);
                let (encoder, rolls) = (&about.encoder, about.rolls);
                console::message(format_args!("{name}: {n} views by {encoder} ({rolls} rolls)"));
            }
        }
        let features =
            Pair { source: FeatureSource::Views(&a.views), target: FeatureSource::Views(&b.views) };
        self.prepare_both(files, features, settings, task)
    }

    /// Both objects prepared side by side, or the first failure, which names its file.
    fn prepare_both(
        &self,
        files: Pair<MeshFile>,
        features: Pair<FeatureSource<'_>>,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Pair<Prepared>> {
        let (source, target) = rayon::join(
            || prepare(files.source.mesh, features.source, settings, task),
            || prepare(files.target.mesh, features.target, settings, task),
        );
        let named = |path: &Path| path.display().to_string();
        Ok(Pair {
            source: source.with_context(|| named(&self.source))?,
            target: target.with_context(|| named(&self.target))?,
        })
    }

    fn encoder_settings(&self, common: &Common) -> Result<EncoderSettings> {
        let model = self.features.encoder.clone().context("--encoder is missing")?;
        Ok(EncoderSettings {
            model,
            rolls: self.features.rolls.unwrap_or(self.matching.method.info().features.rolls),
            keep: !self.matching.no_cache,
            threads: common.threads,
            quiet: common.quiet,
        })
    }

    fn provenance(&self, settings: &PipelineSettings) -> Provenance {
        let files = TransferInputs {
            source: self.source.display().to_string(),
            target: self.target.display().to_string(),
            region: self.region.display().to_string(),
        };
        Provenance {
            files: Some(files),
            lift: Some(settings.lift.clone()),
            seeds: Some(Seeds { lift: settings.lift.seed, clusters: self.matching.seed }),
            version: Some(env!("CARGO_PKG_VERSION").into()),
            ..Provenance::default()
        }
    }
}
