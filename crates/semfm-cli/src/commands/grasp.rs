//! `semfm-cli grasp`: ranked, collision-free grasps inside a region.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use semfm::align::Verdict;
use semfm::demonstration::is_one_sided;
use semfm::files::{
    AlignedPose, read_aligned, read_obstacle, read_region, write_isaac_grasps, write_ros2_grasps,
};
use semfm::geom::io::{read_mesh, refuse_input};
use semfm::geom::math::DVec3;
use semfm::grasp::{
    ApproachCone, GraspSettings, Grasps, Reason, Selection, SurfaceReport, SurfaceSettings,
};
use semfm::robot::{BuiltinGripper, Gripper, GripperSettings};
use semfm::{GraspProblem, GraspRequest, Mesh, POINT_MARGIN, Table, Task};
use semfm_show::write_grasp_picture;
use serde_json::{Map, Value, json};

use super::size::print_size;
use super::{NoAnswer, Outcome};
use crate::console;
use crate::options::{Common, numbers, parse_package};
use crate::output::{OutputFile, check_distinct, check_file};

/// Degrees.
const APPROACH_CONE: f64 = 45.0;

/// Find parallel-jaw grasps inside a region of a mesh
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    semfm-cli grasp mug.obj --region grip.json --gripper franka --metres -o grasps.json\n  \
    semfm-cli grasp mug.obj --region grip.json --gripper hand.urdf --aligned aligned.json \\\n    \
    --scene table.ply --format ros2 -o grasps.mcap\n\n\
    Exit code 0: grasps. 1: none survived; the file is written all the same and says why. Also 1, without a file: \
    the pose of --aligned has the verdict `refuse`. 2: bad input.")]
pub struct GraspCommand {
    /// The object's mesh
    mesh: PathBuf,
    /// The region in which the pads shall close (JSON)
    #[arg(long, value_name = "FILE")]
    region: PathBuf,
    /// Where to write; `-` is stdout
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

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// grasps.json (docs/formats.md)
    Json,
    /// ROS 2 MCAP: geometry_msgs/msg/PoseArray, widths and scores beside it
    Ros2,
    /// Isaac's grasp YAML
    Isaac,
}

/// Settings of grasps, wherever the region comes from.
#[derive(Debug, Args)]
pub struct GraspOptions {
    #[command(flatten)]
    metric: MetricOptions,
    /// Grasp at a pose whose verdict is `refuse`, too
    #[arg(long, requires = "aligned", help_heading = "Metres")]
    use_refused: bool,
    /// Folder of a package that a URDF names (`package://NAME/…`)
    #[arg(long, value_name = "NAME=FOLDER", value_parser = parse_package, help_heading = "Gripper")]
    package: Vec<(String, PathBuf)>,
    /// What stands around the object: meshes and point clouds, in the frame of the answer, metres
    #[arg(long, value_name = "FILE", help_heading = "Scene")]
    scene: Vec<PathBuf>,
    /// Distance that the gripper keeps from the points of a scene, metres
    #[arg(long, default_value_t = POINT_MARGIN, allow_negative_numbers = true, value_name = "METRES", help_heading = "Scene")]
    scene_margin: f64,
    /// A table: a point of it and its normal, away from the table
    #[arg(long, value_name = "X,Y,Z,NX,NY,NZ", value_parser = parse_table, allow_hyphen_values = true, help_heading = "Scene")]
    table: Option<Table>,
    /// Keep out of what lies behind a surface that one camera saw (`semfm-cli surface`), up to so many metres or down to the
    /// table: nobody knows what is there
    #[arg(
        long,
        value_name = "METRES",
        conflicts_with = "aligned",
        allow_negative_numbers = true,
        help_heading = "Scene"
    )]
    unseen: Option<f64>,
    /// Where that camera stood [default: in the origin of the mesh, as for the surface of one frame]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, requires = "unseen", allow_hyphen_values = true, help_heading = "Scene")]
    seen_from: Option<DVec3>,
    /// Grasps to return
    #[arg(long, default_value_t = GraspSettings::default().top, value_name = "N", help_heading = "Grasps")]
    top: usize,
    /// Share of the score that grasps may give up to differ from each other; 0 returns the best, however near
    #[arg(long, default_value_t = GraspSettings::default().diversity, value_name = "SHARE", help_heading = "Grasps")]
    diversity: f64,
    /// Draw the grasps at random from all that pass every check, whatever their score (to measure a score)
    #[arg(long, help_heading = "Grasps")]
    random: bool,
    /// Points of the region from which candidates are grown
    #[arg(long, default_value_t = GraspSettings::default().n_samples, value_name = "N", help_heading = "Grasps")]
    samples: usize,
    /// Vertices of the surface on which contacts are sought on larger meshes; 0: on the mesh as it is, not simplified
    /// and, where it is noisy, not smoothed. Collisions are always with the mesh as it is
    #[arg(long, value_name = "N", help_heading = "Grasps")]
    contact_vertices: Option<usize>,
    /// Friction coefficient between pad and object
    #[arg(long, default_value_t = GraspSettings::default().friction, value_name = "MU", help_heading = "Grasps")]
    friction: f64,
    /// Mass of the object, kilograms: the score is then the probability that the grasp holds
    #[arg(long, value_name = "KG", help_heading = "Grasps")]
    mass: Option<f64>,
    /// Force with which each pad presses, newtons
    #[arg(long, default_value_t = GraspSettings::default().grip_force, value_name = "N", help_heading = "Grasps")]
    grip_force: f64,
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
    /// Least distance of the open gripper to everything, metres
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

/// Help of an argument that takes a gripper: the built-in ones by name.
pub fn gripper_help(what: &str) -> String {
    format!("{what}: {}, or a URDF of a hand with two parallel pads", BuiltinGripper::names())
}

impl GraspCommand {
    pub fn run(self, common: &Common) -> Result<Outcome> {
        let mut inputs = vec![self.mesh.as_path(), self.region.as_path(), Path::new(&self.gripper)];
        inputs.extend(self.options.files());
        let output = OutputFile::new(&self.output, &inputs, common)?;
        if let Some(picture) = &self.picture {
            check_file(picture, &inputs)?;
            check_distinct(&self.output, picture)?;
        }
        let task = console::progress(common.quiet);
        let mesh = read_mesh(&self.mesh)?.mesh;
        let region = read_region(&self.region, &mesh)?;
        let problem = self.options.prepare(&self.gripper, self.seed, mesh)?;
        output.check_again()?;
        self.picture.iter().try_for_each(refuse_input)?;
        if !common.quiet {
            print_size(&problem.size());
            print_pose_margin(problem.settings().pose_margin);
        }
        let found = problem.find(region.weights(), &task)?;
        let result = problem.result(&found);
        // The answer comes last: where the picture fails, there is none.
        if let Some(picture) = &self.picture {
            draw_grasps(picture, &problem, region.weights(), &found, &task)?;
        }
        let path = output.path();
        match self.format {
            Format::Json => {
                problem.file(region.weights(), &found)?.write(path)?;
            }
            Format::Ros2 => write_ros2_grasps(path, &result)?,
            Format::Isaac => write_isaac_grasps(path, &result)?,
        }
        if common.json {
            console::data(summary(&found));
        } else {
            print_grasps(&found, common);
        }
        if !common.quiet {
            print_surface(&found.surface);
        }
        warn_of_dependent_grasps(&problem, region.weights(), &found)?;
        if found.grasps.is_empty() && !common.quiet {
            let opening = problem.gripper().opening.end();
            console::message(format_args!(
                "the object is {}; its shortest side is {:.2} of the gripper's opening of {:.0} mm",
                problem.size(),
                result.size_to_opening(),
                1e3 * opening
            ));
            let reason = small_region(&problem, region.weights())?;
            reason.iter().for_each(console::message);
            if is_one_sided(problem.mesh(), &region)? {
                console::message(format_args!(
                    "the region is what one camera sees of its part; the pads need both sides: \
                     semfm-cli region {} --region {} --grow -o whole.json",
                    self.mesh.display(),
                    self.region.display()
                ));
            }
        }
        output.finish(common)?;
        if !common.json {
            self.picture.iter().for_each(|picture| console::data(picture.display()));
        }
        Ok(if found.grasps.is_empty() { Outcome::NoAnswer } else { Outcome::Done })
    }
}

impl GraspOptions {
    /// The defaults, for an object of `scale` metres per unit.
    pub fn at_scale(scale: f64) -> Self {
        let GraspSettings { top, diversity, n_samples, friction, grip_force, limits, .. } =
            GraspSettings::default();
        Self {
            metric: MetricOptions { aligned: None, scale: Some(scale), metres: false },
            use_refused: false,
            package: Vec::new(),
            scene: Vec::new(),
            scene_margin: POINT_MARGIN,
            table: None,
            unseen: None,
            seen_from: None,
            top,
            diversity,
            random: false,
            samples: n_samples,
            contact_vertices: None,
            friction,
            mass: None,
            grip_force,
            width_range: None,
            approach: None,
            approach_cone: APPROACH_CONE,
            demonstrated: None,
            clearance: limits.clearance,
            pad_in_region: limits.pad_in_region,
        }
    }

    /// Folders of packages that URDFs name.
    pub fn packages(&self) -> &[(String, PathBuf)] {
        &self.package
    }

    /// The files it reads.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.scene.iter().chain(&self.metric.aligned).map(PathBuf::as_path)
    }

    /// Reads everything that grasps of `mesh` need.
    pub fn prepare(&self, gripper: &str, seed: u64, mesh: Mesh) -> Result<GraspProblem> {
        let mut request = self.metric.request(&mesh, self.use_refused)?;
        let packages = self.package.iter().cloned().collect();
        let gripper = Gripper::open(gripper, &GripperSettings { packages, ..Default::default() })
            .context("--gripper")?;
        let pose_margin = request.settings.pose_margin;
        request.settings = GraspSettings { pose_margin, ..self.settings(seed) };
        if let Some(working_vertices) = self.contact_vertices {
            let smooth = working_vertices > 0;
            request.surface = SurfaceSettings { working_vertices, smooth };
        }
        request.table = self.table;
        request.point_margin = self.scene_margin;
        for path in &self.scene {
            request.obstacles.push(read_obstacle(path)?);
        }
        if let Some(depth) = self.unseen {
            let eye = self.seen_from.unwrap_or(DVec3::ZERO);
            let hidden = request.hidden_behind(&mesh, eye, depth).context("--unseen")?;
            request.obstacles.extend(hidden);
        }
        Ok(request.prepare(Arc::new(mesh), gripper)?)
    }

    fn settings(&self, seed: u64) -> GraspSettings {
        let half_angle = self.approach_cone.to_radians();
        let mut settings = GraspSettings {
            top: self.top,
            n_samples: self.samples,
            friction: self.friction,
            mass: self.mass,
            diversity: self.diversity,
            grip_force: self.grip_force,
            demonstrated_approach: self.demonstrated,
            seed,
            ..Default::default()
        };
        if self.random {
            settings.selection = Selection::Random;
        }
        settings.limits.width = self.width_range.map(|[least, most]| least..=most);
        settings.limits.approach = self.approach.map(|axis| ApproachCone { axis, half_angle });
        settings.limits.clearance = self.clearance;
        settings.limits.pad_in_region = self.pad_in_region;
        settings
    }
}

impl MetricOptions {
    /// A request with metres per unit, and the pose before the camera where one is given.
    fn request(&self, mesh: &Mesh, use_refused: bool) -> Result<GraspRequest> {
        if let Some(path) = &self.aligned {
            let aligned = read_aligned(path, Some(mesh))?;
            warn_of_pose(path, &aligned, use_refused)?;
            return Ok(GraspRequest::at_pose(&aligned, mesh));
        }
        match (self.scale, self.metres) {
            (Some(scale), _) => Ok(GraspRequest::new(scale)),
            (None, true) => Ok(GraspRequest::new(1.0)),
            (None, false) => bail!(
                "the mesh has no unit: expected --metres, --scale S or --aligned FILE, found none"
            ),
        }
    }
}

/// Of its own size a region can be too small for grasps: said where none was found.
fn small_region(problem: &GraspProblem, weights: &[f64]) -> Result<Option<String>> {
    let areas = problem.mesh_in_metres()?.vertex_areas();
    let area: f64 = areas.iter().zip(weights).map(|(area, weight)| area * weight).sum();
    let [x, z] = problem.gripper().pad;
    let needed = problem.settings().limits.pad_in_region * x * z;
    let n = weights.iter().filter(|&&weight| weight > 0.0).count();
    Ok((area < needed).then(|| {
        format!(
            "the region of {n} vertices covers {:.1} mm², but each pad must lie on it with {:.1} mm²: \
             mark more of the object, or lower --pad-in-region",
            1e6 * area,
            1e6 * needed
        )
    }))
}

/// Says what speaks against a pose; one with the verdict `refuse` is no answer unless told otherwise.
fn warn_of_pose(path: &Path, aligned: &AlignedPose, use_refused: bool) -> Result<()> {
    let file = path.display();
    let reasons = aligned.reasons.join("; ");
    match aligned.verdict {
        Some(Verdict::Refuse) if !use_refused => Err(NoAnswer(format!(
            "{file}: the pose has the verdict `refuse` ({reasons}): align again, or grasp all the \
             same with --use-refused"
        ))
        .into()),
        Some(verdict @ (Verdict::Refuse | Verdict::Check)) => {
            console::message(format_args!(
                "warning: {file}: the pose has the verdict `{verdict}`: {reasons}"
            ));
            Ok(())
        }
        Some(Verdict::Accept) | None => Ok(()),
    }
}

/// Says which grasps depend on what the pose leaves open.
pub fn warn_of_dependent_grasps(
    problem: &GraspProblem,
    weights: &[f64],
    found: &Grasps,
) -> Result<()> {
    let shares = problem.shares_of_poses(weights, found)?.unwrap_or_default();
    let n_poses = problem.alternatives().len();
    let dependent: Vec<String> =
        (0..shares.len()).filter(|&i| shares[i] < 1.0).map(|i| i.to_string()).collect();
    if shares.is_empty() {
        return Ok(());
    }
    let least = shares.iter().copied().fold(1.0, f64::min);
    if dependent.is_empty() {
        console::message(format_args!(
            "the contacts of every grasp lie in the region under all {n_poses} poses that fit as well"
        ));
        return Ok(());
    }
    console::message(format_args!(
        "warning: grasps {} depend on the pose: of {n_poses} other poses that fit as well, as few as \
         {:.0} % keep their contacts in the region",
        dependent.join(", "),
        100.0 * least
    ));
    Ok(())
}

/// Draws the best grasps in a region, one weight per vertex.
pub fn draw_grasps(
    path: &Path,
    problem: &GraspProblem,
    weights: &[f64],
    found: &Grasps,
    task: &Task,
) -> Result<()> {
    let file = problem.file(weights, found)?;
    Ok(write_grasp_picture(path, problem.mesh(), weights, &file, task)?)
}

/// The grasps in short, for `--json`.
pub fn summary(found: &Grasps) -> Value {
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
pub fn print_grasps(found: &Grasps, common: &Common) {
    let (n, candidates) = (found.grasps.len(), found.n_candidates);
    console::data(format_args!("grasps      {n} of {candidates} candidates"));
    for (rank, grasp) in found.grasps.iter().take(5).enumerate() {
        let p = grasp.object_from_tcp.translation;
        console::data(format_args!(
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
        console::message(format_args!(
            "{count:8}  {:14} {} ({})",
            reason.name(),
            reason.explanation(),
            option_names(reason)
        ));
    }
    if let Some(miss) = &found.nearest_miss {
        let unit = miss.reason.unit();
        console::message(format_args!(
            "the nearest miss failed by {:.4} {unit}: {}; {} ({})",
            miss.by,
            miss.reason.explanation(),
            miss.reason.advice(),
            option_names(miss.reason)
        ));
    }
}

/// The options that would change a reason, as the shell knows them.
fn option_names(reason: Reason) -> String {
    let names = reason.options().iter().map(|&name| {
        // One option has another name here.
        let name = if name == "n_samples" { "samples" } else { name };
        format!("--{}", name.replace('_', "-"))
    });
    names.collect::<Vec<_>>().join(", ")
}

/// Says how far an uncertain pose keeps the gripper away.
fn print_pose_margin(margin: f64) {
    if margin > 0.0 {
        console::message(format_args!(
            "the pose is uncertain by {:.1} mm: before the pads close, the gripper keeps as far from everything",
            1e3 * margin
        ));
    }
}

/// Says that contacts were sought on another surface.
fn print_surface(surface: &SurfaceReport) {
    if surface.noise > 0.0 {
        console::message(format_args!(
            "the mesh has noise of {:.2} mm: contacts are those of a smoothed surface, collisions those of the mesh",
            1e3 * surface.noise
        ));
    } else if surface.is_simplified {
        console::message(format_args!(
            "contacts were sought on {} triangles, and every grasp was examined on the mesh itself",
            surface.n_triangles
        ));
    }
}

fn parse_vector(text: &str) -> Result<DVec3> {
    Ok(DVec3::from_array(numbers(text).context("expected X,Y,Z")?))
}

fn parse_table(text: &str) -> Result<Table> {
    let [x, y, z, nx, ny, nz] = numbers(text).context("expected X,Y,Z,NX,NY,NZ")?;
    Ok(Table { point: DVec3::new(x, y, z), normal: DVec3::new(nx, ny, nz) })
}

fn parse_range(text: &str) -> Result<[f64; 2]> {
    numbers(text).context("expected LEAST,MOST")
}
