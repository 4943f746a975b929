//! `semfm-cli transfer`: transfer a region from one object to another.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use semfm::files::{
    Provenance, RegionFile, Seeds, TransferInputs, read_embeddings, read_region,
    read_vertex_features,
};
use semfm::fmap::transfer_with_anchors;
use semfm::geom::ShapeCache;
use semfm::geom::io::{MeshFile, read_mesh};
use semfm::memory::MemorySettings;
use semfm::object_encoder::EncodedPair;
use semfm::{
    FeatureSource, Mesh, Method, PairFiles, PipelineSettings, Prepared, Rule, Task,
    embeddings_of_both, prepare, transfer,
};
use semfm_show::{PLAN_FILES, TRANSFER_FILES, TransferFiles};

use super::Outcome;
use super::encoder_options::EncoderOptions;
use super::grasp::{GraspOptions, gripper_help};
use super::memory_transfer::MemoryQuestion;
use super::motion_options::MotionOptions;
use super::region::grown;
use super::size::print_size;
use super::transfer_output::{ArmMotion, PLAN, TransferOutput};
use crate::console;
use crate::options::Common;
use crate::output::{check_folder, check_folder_again};

/// Transfer a region from one object, or from a memory of several, to another
///
/// Features say which places of the two surfaces are alike. The built-in encoder makes them, or
/// another one; or they come as embeddings files of both objects, or per vertex from any network. The
/// method `wks` needs none.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out --encoder google/siglip2-base-patch16-224\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out \\\n    \
    --source-embeddings mug.emb.mcap --target-embeddings kettle.emb.mcap\n  \
    semfm-cli transfer kettle.ply --memory kitchen -o out\n  \
    semfm-cli transfer mug.obj kettle.ply --region grip.json -o out --gripper franka --metres \\\n    \
    --robot panda.urdf --srdf panda.srdf --base-from-object 0.5,0,0,0,0,0\n\n\
    Exit code 0: an answer to use or to check. 1: verdict `refuse`, no grasp, or none that the arm can carry out (every \
    file is written all the same). 2: bad input.")]
pub struct TransferCommand {
    /// The demonstrated object's mesh; with --memory that of the object to act on
    source: PathBuf,
    /// The mesh of the object to act on
    #[arg(required_unless_present = "memory", conflicts_with = "memory")]
    target: Option<PathBuf>,
    /// The region on the source (JSON)
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present = "memory",
        conflicts_with = "memory"
    )]
    region: Option<PathBuf>,
    /// First complete the region, where one camera saw it, to the part that it belongs to
    #[arg(long, conflicts_with = "memory")]
    grow: bool,
    /// Folder for the results
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Write the answer alone: region.json and report.json
    #[arg(long, value_name = "region", value_parser = ["region"])]
    only: Option<String>,
    /// Write no pictures and no scene for Foxglove
    #[arg(long, conflicts_with = "only")]
    no_pictures: bool,
    #[command(flatten)]
    memory: MemoryOptions,
    #[command(flatten)]
    features: FeatureOptions,
    #[command(flatten)]
    matching: MatchingOptions,
    #[arg(long, value_name = "NAME|URDF", help_heading = "Gripper",
        help = gripper_help("Go on to grasps with this gripper"))]
    gripper: Option<String>,
    #[command(flatten)]
    grasps: GraspOptions,
    /// Go on to the motion of this arm (URDF); its folder is `plan` in that of the results
    #[arg(long, value_name = "URDF", requires = "gripper", help_heading = "Arm")]
    robot: Option<PathBuf>,
    /// What stands around the arm, in the frame of its base, metres: scene.json, meshes and point clouds
    #[arg(long, value_name = "FILE", requires = "robot", help_heading = "Scene")]
    robot_scene: Vec<PathBuf>,
    #[command(flatten)]
    motion: MotionOptions,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Memory")]
struct MemoryOptions {
    /// Ask the demonstrations in this folder (`semfm-cli remember`) in place of one source; its grasps:
    /// `semfm-cli grasp TARGET --region out/region.json`
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["gripper", "robot", "source_embeddings",
        "source_features", "target_features", "features", "method", "rule", "working_vertices", "k",
        "second_opinion"])]
    memory: Option<PathBuf>,
    /// Only demonstrations of this kind
    #[arg(long, value_name = "TEXT", requires = "memory")]
    kind: Option<String>,
    /// Demonstrations that are matched, the most similar ones
    #[arg(long, value_name = "N", requires = "memory", default_value_t = MemorySettings::default().shortlist)]
    shortlist: usize,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Features")]
struct FeatureOptions {
    /// Embeddings of the source's views; where only one object has them, the other is shown to the encoder that made them
    #[arg(long, value_name = "A.emb.mcap", conflicts_with_all = ["rolls", "source_features"])]
    source_embeddings: Option<PathBuf>,
    /// Embeddings of the target's views
    #[arg(long, value_name = "B.emb.mcap", conflicts_with_all = ["rolls", "target_features"])]
    target_embeddings: Option<PathBuf>,
    #[command(flatten)]
    encoder: EncoderOptions,
    /// Per-vertex features of the source (n × d)
    #[arg(long, value_name = "A.npy", requires = "target_features",
        conflicts_with_all = ["encoder", "rolls"])]
    source_features: Option<PathBuf>,
    /// Per-vertex features of the target (n × d)
    #[arg(long, value_name = "B.npy", requires = "source_features")]
    target_features: Option<PathBuf>,
    /// Lift with the settings of this method instead of the method's own
    #[arg(long, value_name = "METHOD")]
    features: Option<Method>,
}

impl FeatureOptions {
    /// The embeddings of the one object that has them, and whether it is the source.
    fn one_sided(&self) -> Option<(&Path, bool)> {
        match (&self.source_embeddings, &self.target_embeddings) {
            (Some(path), None) => Some((path, true)),
            (None, Some(path)) => Some((path, false)),
            _ => None,
        }
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
        check_folder(&self.output, TRANSFER_FILES, &self.inputs())?;
        let given = &self.features;
        let is_complete = given.source_embeddings.is_some() || self.memory.memory.is_some();
        if given.target_embeddings.is_some() && is_complete && given.encoder.encoder.is_some() {
            bail!("--encoder: expected none, since there are embeddings of all objects, found one");
        }
        if let Some(memory) = &self.memory.memory {
            return self.question(memory).answer(&self.output, common);
        }
        if self.robot.is_some() {
            check_folder(&self.output.join(PLAN), PLAN_FILES, &self.inputs())?;
        }
        let task = console::progress(common.quiet);
        let settings = self.matching.settings(self.features.features);
        let files = Pair { source: read_mesh(&self.source)?, target: read_mesh(self.target())? };
        let mut region = read_region(self.region(), &files.source.mesh)
            .map_err(|error| self.or_region_of_target(error, &files.target.mesh))?;
        if self.grow {
            region = grown(&files.source.mesh, &region, None, common)?;
        }
        let grasps = match &self.gripper {
            Some(gripper) => {
                let (mesh, seed) = (files.target.mesh.clone(), self.matching.seed);
                Some(self.grasps.prepare(gripper, seed, mesh)?)
            }
            None => None,
        };
        let motion = self.prepare_motion()?;
        check_folder_again(&self.output, TRANSFER_FILES)?;
        if let Some(problem) = grasps.as_ref().filter(|_| !common.quiet) {
            print_size(&problem.size());
        }
        let Pair { source, target } = self.prepare(files, &settings, &task, common)?;
        for (name, prepared) in [("source", &source), ("target", &target)] {
            if let Some(encoder) = prepared.report.encoder.as_ref().filter(|_| common.verbose) {
                console::message(format_args!("{name}: {encoder}"));
            }
        }
        let (a, b) = (&source.object, &target.object);
        // The answer alone is asked for by programs: nobody looks at the anchors.
        let carry = if self.only.is_some() { transfer } else { transfer_with_anchors };
        let transferred = carry(a, b, &region, &settings.transfer, &task)?;
        let output = TransferOutput {
            source: &source,
            target: &target,
            region: &region,
            transfer: &transferred,
            provenance: self.provenance(&settings),
            files: self.files(),
            grasps,
            motion,
        };
        output.write(&self.output, &task, common)
    }

    /// The question to a memory.
    fn question<'a>(&'a self, memory: &'a Path) -> MemoryQuestion<'a> {
        MemoryQuestion {
            memory,
            target: &self.source,
            embeddings: self.features.target_embeddings.as_deref(),
            encoder: &self.features.encoder,
            settings: MemorySettings {
                shortlist: self.memory.shortlist,
                kind: self.memory.kind.clone(),
                ..MemorySettings::default()
            },
            files: self.files(),
            no_cache: self.matching.no_cache,
            seed: self.matching.seed,
        }
    }

    /// Which files are written.
    fn files(&self) -> TransferFiles {
        match (&self.only, self.no_pictures) {
            (Some(_), _) => TransferFiles::Region,
            (None, true) => TransferFiles::WithoutPictures,
            (None, false) => TransferFiles::All,
        }
    }

    /// The mesh file of the target, which there always is without --memory.
    fn target(&self) -> &Path {
        self.target.as_deref().unwrap_or(&self.source)
    }

    /// The file of the region, which there always is without --memory.
    fn region(&self) -> &Path {
        self.region.as_deref().unwrap_or(Path::new(""))
    }

    /// The arm, where one is given.
    fn prepare_motion(&self) -> Result<Option<ArmMotion>> {
        let Some(robot) = &self.robot else { return Ok(None) };
        let (packages, seed) = (self.grasps.packages(), self.matching.seed);
        let motion = self.motion.prepare(robot, packages, &self.robot_scene, seed)?;
        let (target, folder) = (self.target().to_owned(), self.output.join(PLAN));
        Ok(Some(ArmMotion { motion, target, folder }))
    }

    /// The files that it reads; the encoder and the gripper may be files, too.
    fn inputs(&self) -> Vec<&Path> {
        let features = &self.features;
        let files = [
            &features.source_embeddings,
            &features.target_embeddings,
            &features.source_features,
            &features.target_features,
        ];
        let named = [&features.encoder.encoder, &self.gripper];
        let memory = &self.memory.memory;
        let pair = [&self.target, &self.region, memory];
        std::iter::once(&self.source)
            .chain(pair.into_iter().flatten())
            .chain(files.into_iter().flatten())
            .map(PathBuf::as_path)
            .chain(named.into_iter().flatten().map(Path::new))
            .chain(self.grasps.files())
            .chain(self.robot.iter().chain(&self.robot_scene).map(PathBuf::as_path))
            .chain(self.motion.inputs())
            .collect()
    }

    /// The error of a region that does not fit the source, or, where it fits the target, one that
    /// says so.
    fn or_region_of_target(&self, error: semfm::Error, target: &Mesh) -> anyhow::Error {
        if RegionFile::read(self.region()).is_ok_and(|file| file.names(target)) {
            return anyhow!(
                "{}: this is a region of the target {}, but expected one of the source: are source and \
                 target swapped?",
                self.region().display(),
                self.target().display()
            );
        }
        error.into()
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
        if let (Some(a), Some(b)) = (&options.source_features, &options.target_features) {
            let a = read_vertex_features(a, &files.source.mesh)?;
            let b = read_vertex_features(b, &files.target.mesh)?;
            let features =
                Pair { source: FeatureSource::PerVertex(&a), target: FeatureSource::PerVertex(&b) };
            return self.prepare_both(files, features, settings, task);
        }
        if let (Some(a), Some(b)) = (&options.source_embeddings, &options.target_embeddings) {
            let paths = PairFiles { source: a.clone(), target: b.clone() };
            let [a, b] = embeddings_of_both(&paths, &files.source, &files.target)?;
            let features =
                Pair { source: FeatureSource::from(&a), target: FeatureSource::from(&b) };
            return self.prepare_both(files, features, settings, task);
        }
        if let Some((path, is_source)) = options.one_sided() {
            let (with, without) = match is_source {
                true => (&files.source, &files.target),
                false => (&files.target, &files.source),
            };
            let there = read_embeddings(path, &with.mesh)?;
            let made = options.encoder.open_beside(&there, &settings.cache, common)?;
            let made = made.embed_beside(&there, without, task)?.embeddings;
            let (a, b) = if is_source { (&there, &made) } else { (&made, &there) };
            let features = Pair { source: FeatureSource::from(a), target: FeatureSource::from(b) };
            return self.prepare_both(files, features, settings, task);
        }
        let method = self.matching.method.info();
        if !method.reads_features && options.encoder.is_default() {
            let features =
                Pair { source: FeatureSource::Geometry, target: FeatureSource::Geometry };
            return self.prepare_both(files, features, settings, task);
        }
        let most_rolls = method.features.rolls;
        let encoder = options.encoder.open(most_rolls, &settings.cache, common)?;
        let EncodedPair { source, target } =
            encoder.embed_pair(&files.source, &files.target, task)?;
        if let Some(note) = encoder.why_not_kept().filter(|_| !common.quiet) {
            console::message(format_args!("note: {note}"));
        }
        self.side_by_side(
            || source.prepare(files.source.mesh, settings, task),
            || target.prepare(files.target.mesh, settings, task),
        )
    }

    /// Both objects with features that are there.
    fn prepare_both(
        &self,
        files: Pair<MeshFile>,
        features: Pair<FeatureSource<'_>>,
        settings: &PipelineSettings,
        task: &Task,
    ) -> Result<Pair<Prepared>> {
        self.side_by_side(
            || prepare(files.source.mesh, features.source, settings, task),
            || prepare(files.target.mesh, features.target, settings, task),
        )
    }

    /// Both objects prepared side by side, or the first failure, which names its file.
    fn side_by_side(
        &self,
        source: impl FnOnce() -> semfm::Result<Prepared> + Send,
        target: impl FnOnce() -> semfm::Result<Prepared> + Send,
    ) -> Result<Pair<Prepared>> {
        let (source, target) = rayon::join(source, target);
        let named = |path: &Path| path.display().to_string();
        Ok(Pair {
            source: source.with_context(|| named(&self.source))?,
            target: target.with_context(|| named(self.target()))?,
        })
    }

    fn provenance(&self, settings: &PipelineSettings) -> Provenance {
        let files = TransferInputs {
            source: self.source.display().to_string(),
            target: self.target().display().to_string(),
            region: self.region().display().to_string(),
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
