//! `semfm-cli demo`: a transfer between built-in objects, from the very files that `transfer` reads.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use semfm::files::{Provenance, read_embeddings, read_region};
use semfm::fmap::metrics::iou;
use semfm::geom::io::read_mesh;
use semfm::{FeatureSource, PipelineSettings, Prepared, Task, prepare, transfer};
use semfm_synth::{Category, Level, ObjectFiles, ObjectSettings, make_object, write_object};

use super::Outcome;
use super::grasp::GraspOptions;
use super::transfer_output::TransferOutput;
use crate::console;
use crate::options::Common;

/// The gripper that grasps at the end, and how large the object is made for it: from corner to
/// corner of its box, in metres.
const GRIPPER: &str = "franka";
const LONGEST: f64 = 0.25;

/// Transfer a grip between two built-in objects, offline: meshes, embeddings, transfer, pictures
///
/// The objects are made on the spot and the encoder is simulated; everything after that is what
/// `transfer` does, from the same files.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli demo --category scissors --level hard -o semfm-demo")]
pub struct DemoCommand {
    /// tools, shoes, cutting, containers, controllers or scissors
    #[arg(long, default_value_t = Category::Containers)]
    category: Category,
    /// How hard the simulated features are: easy, medium or hard
    #[arg(long, default_value_t = Level::Medium)]
    level: Level,
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
        std::fs::create_dir_all(&self.output).with_context(|| self.output.display().to_string())?;
        let source = self.make(0, &task, common)?;
        let target = self.make(1, &task, common)?;
        let target_mesh = read_mesh(&target.mesh)?.mesh;
        // Rounded, so that the command below says exactly what was done.
        let scale = (1e4 * LONGEST / target_mesh.diagonal()).round() / 1e4;
        let grasps = GraspOptions::at_scale(scale).prepare(GRIPPER, self.seed, target_mesh)?;

        let prepared_source = prepare_files(&source, &settings, &task)?;
        let prepared_target = prepare_files(&target, &settings, &task)?;
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
                simulated: Some(true),
                ..Provenance::default()
            },
            grasps: Some(grasps),
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
                print_commands(&source, &target, scale, &folder);
            }
        }
        Ok(outcome)
    }

    /// Makes an object and writes its files.
    fn make(&self, instance: usize, task: &Task, common: &Common) -> Result<ObjectFiles> {
        let settings = ObjectSettings { seed: self.seed, ..Default::default() };
        let object = make_object(self.category, instance, &settings)?;
        if !common.quiet && !common.json {
            let (n, category) = (object.mesh.n_vertices(), self.category);
            console::data(format_args!("made        a {} ({category}, {n} vertices)", object.kind));
        }
        Ok(write_object(&self.output, &object, self.level, task)?)
    }
}

fn prepare_files(
    files: &ObjectFiles,
    settings: &PipelineSettings,
    task: &Task,
) -> Result<Prepared> {
    let mesh = read_mesh(&files.mesh)?.mesh;
    let embeddings = read_embeddings(&files.embeddings, &mesh)?;
    Ok(prepare(mesh, FeatureSource::Views(&embeddings.views), settings, task)?)
}

/// The same transfer as commands.
fn print_commands(source: &ObjectFiles, target: &ObjectFiles, scale: f64, folder: &Path) {
    console::data("by hand");
    console::data(format_args!(
        "  semfm-cli transfer {} {} --region {} \\\n    --source-embeddings {} --target-embeddings {} \\\n    \
         --gripper {GRIPPER} --scale {scale} -o {}",
        quoted(&source.mesh),
        quoted(&target.mesh),
        quoted(&source.truth),
        quoted(&source.embeddings),
        quoted(&target.embeddings),
        quoted(folder),
    ));
    console::data("in three dimensions, in a browser");
    console::data(format_args!("  semfm-cli show {} -o semfm-demo.html", quoted(folder)));
}

/// A path as a word of a command.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = text.bytes().all(|b| b.is_ascii_alphanumeric() || b"/._-".contains(&b));
    if plain { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}
