//! `semfm-cli grasp`: ranked, collision-free grasps inside a region.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use semfm::Mesh;
use semfm::geom::io::{read_mesh, read_points};
use semfm::geom::math::DVec3;
use semfm::grasp::{ApproachCone, GraspObject, GraspSettings, Grasps, Pose, Scene, find_grasps};
use semfm::grasps::{GraspAnswer, write_grasps, write_isaac, write_ros2};
use semfm::region_file::read_region;
use semfm::robot::{BuiltinGripper, Gripper, GripperSettings};
use semfm::{Task, aligned::read_aligned};
use semfm_show::write_grasp_picture;
use serde_json::{Map, Value, json};

use super::Outcome;
use crate::options::{Common, numbers};
use crate::talk;

/// Metres: the noise of a depth camera at arm's length.
const SCENE_MARGIN: f64 = 0.005;
/// Degrees.
const APPROACH_CONE: f64 = 45.0;

/// Find parallel-jaw grasps inside a region of a mesh
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli grasp mug.obj --region grip.json --gripper franka --metres -o grasps.json\n  \
    semfm-cli grasp mug.obj --region grip.json --gripper hand.urdf --aligned aligned.json \\\n    \
    --scene table.ply --format ros2 -o grasps.mcap\n\n\
    Exit code 0: grasps. 1: none survived; the file is written all the same and says why. 2: bad input.")]
pub struct FindGrasps {
    /// The object's mesh
    mesh: PathBuf,
    /// The region in which the pads shall close (JSON)
    #[arg(long, value_name = "FILE")]
    region: PathBuf,
    /// Where to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[arg(long, value_name = "NAME|URDF", help = gripper_help("The gripper"))]
    gripper: String,
    /// File format
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,
    /// Also draw the best grasps (PNG)
    #[arg(long, value_name = "PICTURE.png")]
    picture: Option<PathBuf>,
    /// Seed of everything drawn by chance
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    options: GraspOptions,
}

/// What `--gripper` takes, after the words that lead the help.
pub fn gripper_help(lead: &str) -> String {
    format!("{lead}: {}, or a URDF", BuiltinGripper::names())
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// grasps.json (docs/formats.md)
    Json,
    /// ROS 2 MCAP: geometry_msgs/msg/PoseArray
    Ros2,
    /// Isaac's grasp YAML
    Isaac,
}

/// What is asked of grasps, wherever the region comes from.
#[derive(Debug, Args)]
pub struct GraspOptions {
    #[command(flatten)]
    metric: MetricOptions,
    /// Folder of a package that the gripper's URDF names (`package://NAME/…`)
    #[arg(long, value_name = "NAME=FOLDER", value_parser = parse_package, help_heading = "Gripper")]
    package: Vec<(String, PathBuf)>,
    /// What stands around the object: meshes and point clouds, in the frame of the answer, metres
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    scene: Vec<PathBuf>,
    /// Distance that the hand keeps from the points of a scene, metres
    #[arg(long, default_value_t = SCENE_MARGIN, allow_negative_numbers = true, value_name = "METRES", help_heading = "Scene")]
    scene_margin: f64,
    /// A table: a point of it and its normal, away from the table
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = parse_table, allow_hyphen_values = true, help_heading = "Scene")]
    table: Option<[DVec3; 2]>,
    /// Grasps to return
    #[arg(long, default_value_t = GraspSettings::default().top, value_name = "N", help_heading = "Grasps")]
    top: usize,
    /// Points of the region from which candidates are grown
    #[arg(long, default_value_t = GraspSettings::default().n_samples, value_name = "N", help_heading = "Grasps")]
    samples: usize,
    /// Friction coefficient between pad and object
    #[arg(long, default_value_t = GraspSettings::default().friction, value_name = "MU", help_heading = "Grasps")]
    friction: f64,
    /// Least and largest distance between the closed pads, metres
    #[arg(long, value_name = "LEAST,MOST", value_parser = parse_range, help_heading = "Grasps")]
    width_range: Option<[f64; 2]>,
    /// Middle of the allowed directions of approach; with a cone of half-angle --approach-cone
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, help_heading = "Grasps")]
    approach: Option<DVec3>,
    /// Half-angle of the allowed directions around --approach, degrees
    #[arg(long, default_value_t = APPROACH_CONE, value_name = "DEGREES", requires = "approach", help_heading = "Grasps")]
    approach_cone: f64,
    /// The direction in which the demonstrator's hand came: agreement raises the score
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true, help_heading = "Grasps")]
    demonstrated: Option<DVec3>,
    /// Least distance of the open hand to everything, metres
    #[arg(long, default_value_t = 0.0, value_name = "METRES", help_heading = "Grasps")]
    clearance: f64,
    /// Share of each pad's contact that must lie in the region
    #[arg(long, default_value_t = GraspSettings::default().limits.pad_in_region, value_name = "SHARE", help_heading = "Grasps")]
    pad_in_region: f64,
}

/// How units of the mesh become metres.
#[derive(Debug, Args)]
#[group(multiple = false)]
struct MetricOptions {
    /// Pose and scale before a camera, from `semfm-cli align`; the answer is in the camera's frame
    #[arg(long, value_name = "aligned.json", help_heading = "Metres")]
    aligned: Option<PathBuf>,
    /// Metres per unit of the mesh
    #[arg(long, value_name = "S", allow_negative_numbers = true, help_heading = "Metres")]
    scale: Option<f64>,
    /// The mesh is in metres already
    #[arg(long, help_heading = "Metres")]
    metres: bool,
}

impl FindGrasps {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let task = talk::watched(common.quiet);
        let mesh = read_mesh(&self.mesh)?.mesh;
        let region = read_region(&self.region, &mesh)?;
        let job = self.options.prepare(&self.gripper, mesh)?;
        let found = job.find(region.weights(), self.seed, &task)?;
        match self.format {
            Format::Json => job.write(&self.output, &found, self.seed)?,
            Format::Ros2 => write_ros2(&self.output, &job.answer(&found))?,
            Format::Isaac => write_isaac(&self.output, &job.answer(&found))?,
        }
        if let Some(picture) = &self.picture {
            job.draw(picture, region.weights(), &found, &task)?;
        }
        if common.json {
            talk::say(grasps_summary(&found));
        } else {
            tell(&found, common);
            talk::say(self.output.display());
            self.picture.iter().for_each(|picture| talk::say(picture.display()));
        }
        Ok(if found.grasps.is_empty() { Outcome::NoAnswer } else { Outcome::Done })
    }
}

impl GraspOptions {
    /// The defaults, for an object of `scale` metres per unit.
    pub fn at_scale(scale: f64) -> Self {
        let GraspSettings { top, n_samples, friction, limits, .. } = GraspSettings::default();
        Self {
            metric: MetricOptions { aligned: None, scale: Some(scale), metres: false },
            package: Vec::new(),
            scene: Vec::new(),
            scene_margin: SCENE_MARGIN,
            table: None,
            top,
            samples: n_samples,
            friction,
            width_range: None,
            approach: None,
            approach_cone: APPROACH_CONE,
            demonstrated: None,
            clearance: limits.clearance,
            pad_in_region: limits.pad_in_region,
        }
    }

    /// Reads everything that grasps of `mesh` need.
    pub fn prepare(&self, gripper: &str, mesh: Mesh) -> Result<GraspJob> {
        let (scale, camera_from_object) = self.metric.read(&mesh)?;
        let packages = self.package.iter().cloned().collect();
        let gripper = Gripper::open(gripper, &GripperSettings { packages, ..Default::default() })
            .context("--gripper")?;
        let object_from_answer = camera_from_object.map_or(Pose::IDENTITY, |pose| pose.inverse());
        let settings = self.settings(object_from_answer);
        let scene = self.scene(object_from_answer)?;
        let object = GraspObject::from_mesh(&mesh, scale)?;
        Ok(GraspJob { mesh, scale, camera_from_object, gripper, object, scene, settings })
    }

    /// Directions turned into the object's frame.
    fn settings(&self, object_from_answer: Pose) -> GraspSettings {
        let turned = |direction: DVec3| object_from_answer.rotation * direction;
        let half_angle = self.approach_cone.to_radians();
        let mut settings = GraspSettings {
            top: self.top,
            n_samples: self.samples,
            friction: self.friction,
            demonstrated_approach: self.demonstrated.map(turned),
            ..Default::default()
        };
        settings.limits.width = self.width_range.map(|[least, most]| least..=most);
        settings.limits.approach =
            self.approach.map(|axis| ApproachCone { axis: turned(axis), half_angle });
        settings.limits.clearance = self.clearance;
        settings.limits.pad_in_region = self.pad_in_region;
        settings
    }

    /// The scene in the object's frame.
    fn scene(&self, object_from_answer: Pose) -> Result<Scene> {
        let mut scene = Scene::new();
        if let Some([point, normal]) = self.table {
            let normal = object_from_answer.rotation * normal;
            scene = scene.with_table(object_from_answer * point, normal).context("--table")?;
        }
        for path in &self.scene {
            scene = match read_mesh(path) {
                Ok(file) => {
                    let moved = file.mesh.vertices().iter().map(|&p| object_from_answer * p);
                    scene.with_mesh(&Mesh::new(moved.collect(), file.mesh.faces().to_vec())?)
                }
                // No faces: points. Any other fault shows again here, and in the same words.
                Err(_) => {
                    let cloud = read_points(path)?;
                    let moved: Vec<DVec3> =
                        cloud.points.iter().map(|&p| object_from_answer * p).collect();
                    scene
                        .with_cloud(&moved, self.scene_margin)
                        .with_context(|| path.display().to_string())?
                }
            };
        }
        Ok(scene)
    }
}

impl MetricOptions {
    /// Metres per unit, and the pose of the object in metres before the camera.
    fn read(&self, mesh: &Mesh) -> Result<(f64, Option<Pose>)> {
        if let Some(path) = &self.aligned {
            let aligned = read_aligned(path, Some(mesh))?;
            let pose = aligned.camera_from_object;
            return Ok((pose.scale, Some(pose.rigid())));
        }
        match (self.scale, self.metres) {
            (Some(scale), _) => Ok((scale, None)),
            (None, true) => Ok((1.0, None)),
            (None, false) => bail!(
                "the mesh has no unit: expected --metres, --scale S or --aligned FILE, found none"
            ),
        }
    }
}

/// Grasps of one object, asked for.
pub struct GraspJob {
    mesh: Mesh,
    scale: f64,
    camera_from_object: Option<Pose>,
    gripper: Gripper,
    object: GraspObject,
    scene: Scene,
    settings: GraspSettings,
}

impl GraspJob {
    /// Grasps in a region, one weight per vertex.
    pub fn find(&self, weights: &[f64], seed: u64, task: &Task) -> Result<Grasps> {
        let settings = GraspSettings { seed, ..self.settings.clone() };
        Ok(find_grasps(&self.object, weights, &self.gripper, &self.scene, &settings, task)?)
    }

    /// The grasps with all that gives them meaning.
    pub fn answer<'a>(&'a self, found: &'a Grasps) -> GraspAnswer<'a> {
        GraspAnswer {
            mesh: &self.mesh,
            object_scale: self.scale,
            camera_from_object: self.camera_from_object,
            gripper: &self.gripper,
            found,
        }
    }

    /// Writes `grasps.json`.
    pub fn write(&self, path: &Path, found: &Grasps, seed: u64) -> Result<()> {
        let settings = json!({
            "seed": seed,
            "friction": self.settings.friction,
            "n_samples": self.settings.n_samples,
            "version": env!("CARGO_PKG_VERSION"),
        });
        let about = Map::from_iter([("settings".to_owned(), settings)]);
        Ok(write_grasps(path, &self.answer(found), about)?)
    }

    /// Draws the best grasps.
    pub fn draw(&self, path: &Path, weights: &[f64], found: &Grasps, task: &Task) -> Result<()> {
        let metric = self.mesh.vertices().iter().map(|&p| p * self.scale).collect();
        let mesh = Mesh::new(metric, self.mesh.faces().to_vec())?;
        Ok(write_grasp_picture(path, &mesh, weights, &self.gripper, &found.grasps, task)?)
    }
}

/// The answer in short, for `--json`.
pub fn grasps_summary(found: &Grasps) -> Value {
    let rejected: Map<String, Value> =
        found.rejected.iter().map(|(reason, n)| (reason.name().to_owned(), json!(n))).collect();
    json!({
        "n_grasps": found.grasps.len(),
        "best_score": found.grasps.first().map(|grasp| grasp.score),
        "n_candidates": found.n_candidates,
        "rejected": rejected,
    })
}

/// The best grasps as a table on stdout, the reasons of the others on stderr where none is left.
pub fn tell(found: &Grasps, common: &Common) {
    let (n, candidates) = (found.grasps.len(), found.n_candidates);
    talk::say(format_args!("grasps      {n} of {candidates} candidates"));
    for (rank, grasp) in found.grasps.iter().take(5).enumerate() {
        let p = grasp.object_from_tcp.translation;
        talk::say(format_args!(
            "  {rank}  score {:.2}  width {:5.1} mm  at ({:.3}, {:.3}, {:.3}) m",
            grasp.score,
            1e3 * grasp.width,
            p.x,
            p.y,
            p.z
        ));
    }
    if n > 0 && !common.verbose {
        return;
    }
    for (reason, count) in found.rejected.iter() {
        talk::remark(format_args!("{count:8}  {:14} {}", reason.name(), reason.explanation()));
    }
    if let Some(miss) = &found.nearest_miss {
        let unit = miss.reason.unit();
        talk::remark(format_args!(
            "the nearest miss failed by {:.4} {unit}: {}",
            miss.by,
            miss.reason.explanation()
        ));
    }
}

fn parse_package(text: &str) -> Result<(String, PathBuf)> {
    match text.split_once('=') {
        Some((name, folder)) if !name.is_empty() && !folder.is_empty() => {
            Ok((name.to_owned(), folder.into()))
        }
        _ => bail!("expected NAME=FOLDER, found `{text}`"),
    }
}

fn parse_vector(text: &str) -> Result<DVec3> {
    Ok(DVec3::from_array(numbers(text).context("expected X,Y,Z")?))
}

fn parse_table(text: &str) -> Result<[DVec3; 2]> {
    let [x, y, z, nx, ny, nz] = numbers(text).context("expected X,Y,Z,NX,NY,NZ")?;
    Ok([DVec3::new(x, y, z), DVec3::new(nx, ny, nz)])
}

fn parse_range(text: &str) -> Result<[f64; 2]> {
    numbers(text).context("expected LEAST,MOST")
}
