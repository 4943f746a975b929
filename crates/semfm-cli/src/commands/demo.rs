//! `semfm-cli demo`: the whole road on built-in objects, through the very files of `transfer`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use semfm::fmap::metrics::iou;
use semfm::region_file::read_region;
use semfm::{Meaning, PipelineSettings, PreparedObject, transfer};
use semfm_synth::{Category, Level, ObjectFiles, ObjectSettings, make_object, write_object};
use serde_json::{Map, json};

use super::Outcome;
use super::grasp::GraspOptions;
use super::transfer::{Job, Reach};
use crate::options::Common;
use crate::{load, talk};

/// The hand that grasps at the end, and how large the object is made for it: from corner to corner
/// of its box, in metres.
const HAND: &str = "franka";
const LONGEST: f64 = 0.25;

/// Carry a grip between two built-in objects, offline: meshes, embeddings, transfer, pictures
///
/// The objects are made on the spot and the encoder is simulated; everything after that is the road
/// that `transfer` takes, from the same files.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  semfm-cli demo --category scissors --level hard -o semfm-demo")]
pub struct Demo {
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

impl Demo {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = talk::watched(common.quiet);
        let settings = PipelineSettings::default();
        std::fs::create_dir_all(&self.output).with_context(|| self.output.display().to_string())?;
        let make = |instance: usize| -> Result<ObjectFiles> {
            let object = ObjectSettings { seed: self.seed, ..Default::default() };
            let object = make_object(self.category, instance, &object)?;
            if !common.quiet && !common.json {
                let (n, category) = (object.mesh.n_vertices(), self.category);
                talk::say(format_args!("made        a {} ({category}, {n} vertices)", object.kind));
            }
            Ok(write_object(&self.output, &object, self.level, &task)?)
        };
        let (source, target) = (make(0)?, make(1)?);
        let target_mesh = load::mesh(&target.mesh, None)?.mesh;
        // Rounded, so that the command below says exactly what was done.
        let scale = (1e4 * LONGEST / target_mesh.diagonal()).round() / 1e4;
        let hand = GraspOptions::at_scale(scale).prepare(HAND, target_mesh)?;

        let prepare = |files: &ObjectFiles| -> Result<PreparedObject> {
            let mesh = load::mesh(&files.mesh, None)?.mesh;
            let embeddings = load::embeddings(&files.embeddings, &mesh)?;
            Ok(PreparedObject::new(mesh, Meaning::Views(&embeddings.views), &settings, &task)?)
        };
        let (prepared_source, prepared_target) = (prepare(&source)?, prepare(&target)?);
        let region = read_region(&source.truth, prepared_source.shape.original())?;
        let carried =
            transfer(&prepared_source, &prepared_target, &region, &settings.transfer, &task)?;
        let truth = read_region(&target.truth, prepared_target.shape.original())?;
        let overlap = iou(&carried.region, &truth)?;

        let mut about = Map::new();
        about.insert("iou".into(), json!(overlap));
        about.insert("simulated".into(), json!(true));
        let job = Job {
            source: &prepared_source,
            target: &prepared_target,
            region: &region,
            carried: &carried,
        };
        let folder = self.output.join("transfer");
        // A demonstration shows where the time goes.
        let talkative = Common { verbose: !common.quiet, ..*common };
        let hand = Reach { job: hand, seed: self.seed };
        let outcome = job.finish(&folder, about, Some(&hand), &task, &talkative)?;
        if !common.json {
            talk::say(format_args!("IoU         {overlap:.2} with the true grip"));
            let pictures = ["transfer.png", "features.png", "grasps.png"];
            // A refused region is not grasped.
            for picture in pictures.map(|name| folder.join(name)).iter().filter(|p| p.is_file()) {
                talk::say(format_args!("picture     {}", picture.display()));
            }
            if !common.quiet {
                repeat_by_hand(&source, &target, scale, &folder);
            }
        }
        Ok(outcome)
    }
}

/// The same transfer as a command.
fn repeat_by_hand(source: &ObjectFiles, target: &ObjectFiles, scale: f64, folder: &Path) {
    let quoted = |path: &Path| {
        let text = path.display().to_string();
        let plain = text.bytes().all(|b| b.is_ascii_alphanumeric() || b"/._-".contains(&b));
        if plain { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
    };
    talk::say("by hand");
    talk::say(format_args!(
        "  semfm-cli transfer {} {} --region {} \\\n    --source-embeddings {} --target-embeddings {} \\\n    \
         --gripper {HAND} --scale {scale} -o {}",
        quoted(&source.mesh),
        quoted(&target.mesh),
        quoted(&source.truth),
        quoted(&source.embeddings),
        quoted(&target.embeddings),
        quoted(folder),
    ));
    talk::say("in three dimensions, in a browser");
    talk::say(format_args!("  semfm-cli show {} -o semfm-demo.html", quoted(folder)));
}
