//! `semfm-cli demo`: a transfer between built-in objects and the motion of an arm of our own to one of the grasps, from
//! the very files that `transfer` and `plan` read.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use semfm::encoder::builtin_encoder;
use semfm::files::{Provenance, SceneFile, TablePlaneRecord, read_embeddings, read_region};
use semfm::fmap::metrics::iou;
use semfm::fmap::transfer_with_anchors;
use semfm::geom::io::{read_mesh, write_atomically};
use semfm::geom::math::{DAffine3, DQuat, DVec3, bounds};
use semfm::motion::Pose;
use semfm::object_encoder::ObjectEncoder;
use semfm::upright::upright;
use semfm::views::mcap::Dtype;
use semfm::{FeatureSource, Mesh, PipelineSettings, Prepared, Task, pose_of_numbers, prepare};
use semfm_show::{TransferFiles, groups_of_paths, write_page};
use semfm_synth::{
    ARM_FLANGE, ARM_HOME, Category, Level, ObjectFiles, ObjectSettings, StandingObject,
    SynthObject, arm_urdf, make_object, write_demonstration_pictures, write_labelled_mesh,
    write_object,
};

use super::Outcome;
use super::grasp::GraspOptions;
use super::motion_options::MotionOptions;
use super::transfer_output::{ArmMotion, PLAN, TransferOutput};
use crate::console;
use crate::options::Common;
use crate::output::check_folder;

/// How large the object is made for the arm's hand: from corner to corner of its box, in metres.
const LONGEST: f64 = 0.25;
/// Files of the arm and of what stands around it, and the page of everything.
const ARM_FILE: &str = "arm.urdf";
const SCENE_FILE: &str = "scene.json";
const PAGE_FILE: &str = "page.html";
/// The folder of pictures for `semfm-cli run`, and how large the object in the hand is: from corner to corner of its box, in
/// metres.
const PICTURES: &str = "pictures";
const HELD: f64 = 0.25;
/// Where the middle of the object stands before the arm, metres.
const DISTANCE: f64 = 0.5;
/// How the upright object is turned on the table, radians. Of eight turns tried with the kettle this is one of four in
/// which the arm takes the best grasp, that of its handle.
const TURN: f64 = -std::f64::consts::FRAC_PI_2;
/// The top of the table below the arm's base and the object, metres: neither touches it where it stands.
const TABLE_TOP: f64 = -0.002;

/// Transfer a grip between two made-up objects and move an arm there, offline: meshes, transfer, grasps, motion
///
/// The objects and the arm are made on the spot and the built-in encoder is shown views of the objects; this is what
/// `transfer` and `plan` do, from the same files.
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
        let (source_object, target_object) = (self.object(0, common)?, self.object(1, common)?);
        let source = self.write_object(&source_object, &task)?;
        let target = self.write_object(&target_object, &task)?;
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
        let arm = DemoArm::write(&self.output, &target_mesh.mesh, scale)?;
        let gripper = arm.urdf.display().to_string();
        let grasps = GraspOptions::at_scale(scale).prepare(&gripper, self.seed, for_grasps)?;
        let objects = [&source_object, &target_object];
        let recipe = self.write_pictures(objects, [&source, &target], &arm, &task)?;
        let motion =
            arm.options().prepare(&arm.urdf, &[], std::slice::from_ref(&arm.scene), self.seed)?;

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
        let transferred = transfer_with_anchors(a, b, &region, &settings.transfer, &task)?;
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
            motion: Some(ArmMotion {
                motion,
                target: target.mesh.clone(),
                folder: self.output.join(PLAN),
            }),
        };
        let folder = self.output.join("transfer");
        // A demonstration shows where the time goes.
        let with_times = Common { verbose: !common.quiet, ..*common };
        let outcome = output.write(&folder, &task, &with_times)?;
        if !common.json {
            console::data(format_args!("IoU         {overlap:.2} with the true grip"));
            let pictures = ["transfer.png", "features.png", "grasps.png"].map(|p| folder.join(p));
            let of_plan = ["motion.png", "miss.png"].map(|name| self.output.join(PLAN).join(name));
            // A refused region is not grasped.
            for picture in pictures.iter().chain(&of_plan).filter(|picture| picture.is_file()) {
                console::data(format_args!("picture     {}", picture.display()));
            }
        }
        let page = self.output.join(PAGE_FILE);
        // Without a motion, one of an earlier demonstration may lie in the folder.
        let shown = if outcome == Outcome::Done { &self.output } else { &folder };
        let groups = groups_of_paths(std::slice::from_ref(shown), &task)?;
        write_page(&page, "SemFM demo", &groups)?;
        if !common.json {
            console::data(format_args!("page        {}: open it in a browser", page.display()));
            if !common.quiet {
                self.print_commands(&source, &target, &arm, &folder);
                if let Some(recipe) = &recipe {
                    console::data(
                        "from pictures (a hand on the first object, both before a depth camera)",
                    );
                    console::data(format_args!(
                        "  semfm-cli run {} -o {}",
                        quoted(recipe),
                        quoted(&self.output.join("run"))
                    ));
                }
            }
        }
        Ok(outcome)
    }

    /// The same transfer and motion as commands.
    fn print_commands(
        &self,
        source: &ObjectFiles,
        target: &ObjectFiles,
        arm: &DemoArm,
        folder: &Path,
    ) {
        let features = self.level.map_or_else(String::new, |_| {
            let (a, b) = (quoted(&source.embeddings), quoted(&target.embeddings));
            format!("--source-embeddings {a} --target-embeddings {b} \\\n    ")
        });
        console::data("by hand");
        console::data(format_args!(
            "  semfm-cli transfer {} {} --region {} \\\n    {features}\
             --gripper {} --scale {} -o {}",
            quoted(&source.mesh),
            quoted(&target.mesh),
            quoted(&source.truth),
            quoted(&arm.urdf),
            arm.scale,
            quoted(folder),
        ));
        console::data(format_args!(
            "  semfm-cli plan --robot {} --tip {ARM_FLANGE} --start {} \\\n    \
             --grasps {} --object {} --base-from-object {} \\\n    --scene {} -o {}",
            quoted(&arm.urdf),
            arm.start(),
            quoted(&folder.join("grasps.json")),
            quoted(&target.mesh),
            arm.place(),
            quoted(&arm.scene),
            quoted(&self.output.join(PLAN)),
        ));
        console::data(format_args!(
            "  semfm-cli show {} -o {}",
            quoted(&self.output),
            quoted(&self.output.join(PAGE_FILE))
        ));
    }

    /// Makes an object.
    fn object(&self, instance: usize, common: &Common) -> Result<SynthObject> {
        let settings = ObjectSettings { seed: self.seed, ..Default::default() };
        let object = make_object(self.category, instance, &settings)?;
        if !common.quiet && !common.json {
            let (n, category) = (object.mesh.n_vertices(), self.category);
            console::data(format_args!("made        a {} ({category}, {n} vertices)", object.kind));
        }
        Ok(object)
    }

    /// Writes the files of an object.
    fn write_object(&self, object: &SynthObject, task: &Task) -> Result<ObjectFiles> {
        Ok(match self.level {
            Some(level) => write_object(&self.output, object, level, task)?,
            None => write_labelled_mesh(&self.output, object)?,
        })
    }

    /// Writes what a depth camera sees of a hand on the first object and of the second one where the arm finds it, and the
    /// recipe for `semfm-cli run`; `None` where no hand gets hold of the first object.
    fn write_pictures(
        &self,
        [source, target]: [&SynthObject; 2],
        files: [&ObjectFiles; 2],
        arm: &DemoArm,
        task: &Task,
    ) -> Result<Option<PathBuf>> {
        let folder = self.output.join(PICTURES);
        let source_scale = HELD / source.mesh.diagonal();
        let at = |object, scale, numbers: [f64; 7]| -> Result<StandingObject<'_>> {
            let Pose { rotation, translation } = pose_of_numbers(&numbers)?;
            let world_from_object = DAffine3::from_rotation_translation(rotation, translation);
            Ok(StandingObject { object, scale, world_from_object })
        };
        let source_place = standing(&source.mesh, source_scale)?;
        let source = at(source, source_scale, source_place)?;
        let target = at(target, arm.scale, arm.base_from_object)?;
        if write_demonstration_pictures(&folder, &source, &target, task)?.is_none() {
            return Ok(None);
        }
        let recipe = folder.join("demo.toml");
        let text = recipe_of_pictures(files.map(|files| &files.mesh), arm);
        write_atomically(&recipe, |out| out.write_all(text.as_bytes()))?;
        Ok(Some(recipe))
    }
}

/// The recipe of the pictures; the files of the demo lie in the folder above.
fn recipe_of_pictures(meshes: [&PathBuf; 2], arm: &DemoArm) -> String {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let [source, target] = meshes.map(|mesh| name(mesh));
    let (urdf, scene, start) = (name(&arm.urdf), name(&arm.scene), arm.start());
    format!(
        "# A hand on one object, and another object of its kind before an arm: semfm-cli run demo.toml -o run\n\
         # All keys: semfm-cli run --template\n\n\
         title = \"From a hand on one object to a grasp on another\"\n\n\
         [demonstration]\nmesh = \"../{source}\"\n\
         grow = true                              # what the hand touched, completed to the part that it belongs to\n\n\
         [[demonstration.frames]]\n\
         color = \"demonstration/color.png\"\n\
         depth = \"demonstration/depth.png\"        # millimetres\n\
         intrinsics = \"demonstration/K.json\"\n\
         mask = \"demonstration/object.png\"\n\
         hand_mask = \"demonstration/hand.png\"\n\
         hand = \"demonstration/hand.obj\"          # without it, the hand is what its mask shows of the depth\n\n\
         [target]\nmesh = \"../{target}\"\n\n\
         [target.frame]\n\
         color = \"target/color.png\"\n\
         depth = \"target/depth.png\"\n\
         intrinsics = \"target/K.json\"\n\
         mask = \"target/object.png\"\n\n\
         [grasp]\ngripper = \"../{urdf}\"\n\n\
         [robot]\nurdf = \"../{urdf}\"\ntip = \"{ARM_FLANGE}\"\nstart = [{start}]\n\
         base_from_camera = \"target/base_from_camera.json\"\nscene = [\"../{scene}\"]\n"
    )
}

/// The arm of the demonstration with what stands around it, in files.
struct DemoArm {
    urdf: PathBuf,
    scene: PathBuf,
    /// Metres per unit of the object's mesh.
    scale: f64,
    /// As `--base-from-object` takes it: X, Y, Z, QX, QY, QZ, QW.
    base_from_object: [f64; 7],
}

impl DemoArm {
    /// Writes the arm and the table into `folder`. The object stands upright on the table.
    fn write(folder: &Path, object: &Mesh, scale: f64) -> Result<Self> {
        let (urdf, scene) = (folder.join(ARM_FILE), folder.join(SCENE_FILE));
        write_atomically(&urdf, |out| out.write_all(arm_urdf().as_bytes()))?;
        let (name, point, normal) = ("table".into(), [0.0, 0.0, TABLE_TOP], [0.0, 0.0, 1.0]);
        let table = TablePlaneRecord { name, point, normal };
        SceneFile { tables: vec![table], ..SceneFile::new() }.write(&scene)?;
        let base_from_object = standing(object, scale)?;
        Ok(Self { urdf, scene, scale, base_from_object })
    }

    fn options(&self) -> MotionOptions {
        MotionOptions::told(ARM_FLANGE, &self.place(), &self.start())
    }

    fn place(&self) -> String {
        self.base_from_object.map(|x| x.to_string()).join(",")
    }

    fn start(&self) -> String {
        ARM_HOME.map(|q| q.to_string()).join(",")
    }
}

/// Where an object stands upright on z = 0 before the arm: X, Y, Z, QX, QY, QZ, QW.
fn standing(object: &Mesh, scale: f64) -> Result<[f64; 7]> {
    let upright_from_object = DQuat::from_rotation_arc(upright(object)?.up, DVec3::Z);
    let turn = DQuat::from_rotation_z(TURN) * upright_from_object;
    let points: Vec<DVec3> = object.vertices().iter().map(|&p| turn * p * scale).collect();
    let (low, high) = bounds(&points).unwrap_or_default();
    let middle = (low + high) / 2.0;
    let numbers = [DISTANCE - middle.x, -middle.y, -low.z, turn.x, turn.y, turn.z, turn.w];
    // Rounded, so that the command says exactly what was done; `+ 0.0` leaves no minus before zero.
    Ok(numbers.map(|x| (1e5 * x).round() / 1e5 + 0.0))
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
