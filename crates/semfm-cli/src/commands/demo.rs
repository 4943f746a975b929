//! `semfm-cli demo`: a transfer between built-in objects, from the very files that `transfer` reads.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use semfm::encoder::builtin_encoder;
use semfm::files::{Provenance, read_embeddings, read_region};
use semfm::fmap::metrics::iou;
use semfm::geom::io::read_mesh;
use semfm::object_encoder::ObjectEncoder;
use semfm::views::mcap::Dtype;
use semfm::{FeatureSource, Mesh, PipelineSettings, Prepared, Task, prepare, transfer};
use semfm_show::TransferFiles;
use semfm_synth::{
    Category, Level, ObjectFiles, ObjectSettings, make_object, write_labelled_mesh, write_object,
};

use super::Outcome;
use super::grasp::GraspOptions;
use super::transfer_output::TransferOutput;
use crate::console;
use crate::options::Common;
use crate::output::check_folder;

/// The gripper that grasps at the end, and how large the object is made for it: from corner to
/// corner of its box, in metres.
const GRIPPER: &str = "franka";
const LONGEST: f64 = 0.25;

/// Transfer a grip between two made-up objects, offline: meshes, embeddings, transfer, pictures
///
/// The objects are made on the spot and the built-in encoder is shown views of them; this is what
/// `transfer` does, from the same files.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli demo --category scissors -o semfm-demo")]
pub struct DemoCommand {
    /// tools, shoes, cutting, containers, controllers or scissors
    #[arg(long, default_value_t = Category::Containers)]
    category: Category,
    /// Simulate the encoder, instead of the built-in one: features that are easy, medium or hard
    #[arg(long)]
    level: Option<Level>,
    /// Seed of the objects
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Folder for everything
    #[arg(short, long, default_value = "semfm-demo", value_name = "FOLDER")]
    output: PathBuf,
}

impl DemoCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = console::progress(common.quiet);
        let settings = PipelineSettings::default();
        check_folder(&self.output, &[], &[])?;
        std::fs::create_dir_all(&self.output).with_context(|| self.output.display().to_string())?;
        let source = self.make(0, &task, common)?;
        let target = self.make(1, &task, common)?;
        let (source_mesh, target_mesh) = (read_mesh(&source.mesh)?, read_mesh(&target.mesh)?);
        let encoded = match self.level {
            Some(_) => None,
            None => {
                let encoder = ObjectEncoder::new(builtin_encoder()?, &settings.cache);
                let pair = encoder.embed_pair(&source_mesh, &target_mesh, &task)?;
                pair.source.embeddings.write(&source.embeddings, Dtype::F32)?;
                pair.target.embeddings.write(&target.embeddings, Dtype::F32)?;
                Some(pair)
            }
        };
        // Rounded, so that the command below says exactly what was done.
        let scale = (1e4 * LONGEST / target_mesh.mesh.diagonal()).round() / 1e4;
        let for_grasps = target_mesh.mesh.clone();
        let grasps = GraspOptions::at_scale(scale).prepare(GRIPPER, self.seed, for_grasps)?;

        let (prepared_source, prepared_target) = match &encoded {
            Some(pair) => (
                pair.source.prepare(source_mesh.mesh, &settings, &task)?,
                pair.target.prepare(target_mesh.mesh, &settings, &task)?,
            ),
            None => (
                prepare_files(&source, source_mesh.mesh, &settings, &task)?,
                prepare_files(&target, target_mesh.mesh, &settings, &task)?,
            ),
        };
        let (a, b) = (&prepared_source.object, &prepared_target.object);
        let region = read_region(&source.truth, a.shape().original())?;
        let transferred = transfer(a, b, &region, &settings.transfer, &task)?;
        let truth = read_region(&target.truth, b.shape().original())?;
        let overlap = iou(&transferred.region, &truth)?;

        let output = TransferOutput {
            source: &prepared_source,
            target: &prepared_target,
            region: &region,
            transfer: &transferred,
            provenance: Provenance {
                iou: Some(overlap),
                simulated: self.level.map(|_| true),
                ..Provenance::default()
            },
            files: TransferFiles::All,
            grasps: Some(grasps),
            motion: None,
        };
        let folder = self.output.join("transfer");
        // A demonstration shows where the time goes.
        let with_times = Common { verbose: !common.quiet, ..*common };
        let outcome = output.write(&folder, &task, &with_times)?;
        if !common.json {
            console::data(format_args!("IoU         {overlap:.2} with the true grip"));
            let pictures = ["transfer.png", "features.png", "grasps.png"];
            // A refused region is not grasped.
            for picture in pictures.map(|name| folder.join(name)).iter().filter(|p| p.is_file()) {
                console::data(format_args!("picture     {}", picture.display()));
            }
            if !common.quiet {
                self.print_commands(&source, &target, scale, &folder);
            }
        }
        Ok(outcome)
    }

    /// The same transfer as commands.
    fn print_commands(
        &self,
        source: &ObjectFiles,
        target: &ObjectFiles,
        scale: f64,
        folder: &Path,
    ) {
        let features = self.level.map_or_else(String::new, |_| {
            let (a, b) = (quoted(&source.embeddings), quoted(&target.embeddings));
            format!("--source-embeddings {a} --target-embeddings {b} \\\n    ")
        });
        console::data("by hand");
        console::data(format_args!(
            "  semfm-cli transfer {} {} --region {} \\\n    {features}\
             --gripper {GRIPPER} --scale {scale} -o {}",
            quoted(&source.mesh),
            quoted(&target.mesh),
            quoted(&source.truth),
            quoted(folder),
        ));
        console::data("in three dimensions, in a browser");
        console::data(format_args!("  semfm-cli show {} -o semfm-demo.html", quoted(folder)));
    }

    /// Makes an object and writes its files.
    fn make(&self, instance: usize, task: &Task, common: &Common) -> Result<ObjectFiles> {
        let settings = ObjectSettings { seed: self.seed, ..Default::default() };
        let object = make_object(self.category, instance, &settings)?;
        if !common.quiet && !common.json {
            let (n, category) = (object.mesh.n_vertices(), self.category);
            console::data(format_args!("made        a {} ({category}, {n} vertices)", object.kind));
        }
        Ok(match self.level {
            Some(level) => write_object(&self.output, &object, level, task)?,
            None => write_labelled_mesh(&self.output, &object)?,
        })
    }
}

fn prepare_files(
    files: &ObjectFiles,
    mesh: Mesh,
    settings: &PipelineSettings,
    task: &Task,
) -> Result<Prepared> {
    let embeddings = read_embeddings(&files.embeddings, &mesh)?;
    Ok(prepare(mesh, FeatureSource::from(&embeddings), settings, task)?)
}

/// A path as a word of a command.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = text.bytes().all(|b| b.is_ascii_alphanumeric() || b"/._-".contains(&b));
    if plain { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}
