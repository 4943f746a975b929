//! Grasps in the region: what `grasp` does.

use std::path::Path;
use std::sync::Arc;

use semfm::demonstration::is_one_sided;
use semfm::files::{SURFACE_AROUND, read_aligned, read_obstacle, read_region};
use semfm::geom::io::read_mesh;
use semfm::geom::math::DVec3;
use semfm::grasp::{ApproachCone, GraspSettings, Grasps};
use semfm::motion::Pose;
use semfm::robot::{Gripper, GripperSettings};
use semfm::{GraspProblem, GraspRequest, Mesh, Table, Task};
use semfm_show::write_grasp_picture;

use super::pose::ALIGNED_FILE;
use super::region::REGION_FILE;
use super::{StageContext, StageEnd, no_answer};
use crate::recipe::{GraspTable, TableValue};
use crate::{Result, Stage};

/// The grasps and their picture.
pub const GRASPS_FILE: &str = "grasps.json";
const PICTURE: &str = "grasps.png";

/// Degrees.
const APPROACH_CONE: f64 = 45.0;

/// Finds grasps.
pub fn grasp(context: &StageContext<'_>, folder: &Path, task: &Task) -> Result<StageEnd> {
    let Some(table) = &context.recipe.grasp else { return Ok(StageEnd::default()) };
    let mesh = read_mesh(context.target_mesh())?.mesh;
    let region = read_region(&context.file(Stage::Transfer, REGION_FILE), &mesh)?;
    let mut request = request(context, &mesh)?;
    let pose_margin = request.settings.pose_margin;
    request.settings = GraspSettings { pose_margin, ..settings(table, context.recipe.seed) };
    request.table = table.table.map(|TableValue { point, normal }| Table {
        point: DVec3::from_array(point),
        normal: DVec3::from_array(normal),
    });
    for path in &table.scene {
        request.obstacles.push(read_obstacle(path)?);
    }
    if let Some(depth) = table.unseen {
        request.obstacles.extend(request.hidden_behind(&mesh, DVec3::ZERO, depth)?);
    }
    let packages = table.packages.clone();
    let settings = GripperSettings { packages, ..Default::default() };
    let gripper = Gripper::open(&table.gripper, &settings).map_err(semfm::Error::from)?;
    let problem = request.prepare(Arc::new(mesh), gripper)?;
    let weights = region.weights();
    let found = problem.find(weights, task)?;
    let file = problem.file(weights, &found)?;
    file.write(&folder.join(GRASPS_FILE))?;
    write_grasp_picture(&folder.join(PICTURE), problem.mesh(), weights, &file, task)?;
    let mut end = StageEnd { summary: summary(&problem, &found), ..StageEnd::default() };
    if found.grasps.is_empty() {
        let is_one_sided = is_one_sided(problem.mesh(), &region)?;
        end.no_answer = no_answer(why_none(&found), what_next(&found, is_one_sided));
    }
    Ok(end)
}

/// A request with metres, and the pose before the camera where there is one.
fn request(context: &StageContext<'_>, mesh: &Mesh) -> Result<GraspRequest> {
    let target = &context.recipe.target;
    if target.mesh.is_none() {
        return observed_request(context);
    }
    let aligned = match (&target.aligned, context.recipe.aligns_target()) {
        (Some(path), _) => Some(path.clone()),
        (None, true) => Some(context.file(Stage::TargetPose, ALIGNED_FILE)),
        (None, false) => None,
    };
    Ok(match aligned {
        Some(path) => GraspRequest::at_pose(&read_aligned(&path, Some(mesh))?, mesh),
        None => GraspRequest::new(target.scale.unwrap_or(1.0)),
    })
}

/// A request for a surface that the camera saw, which is in the camera's frame; what it saw beside the object is in the way.
fn observed_request(context: &StageContext<'_>) -> Result<GraspRequest> {
    let mut request = GraspRequest::new(1.0);
    request.camera_from_object = Some(Pose::IDENTITY);
    let around = context.file(Stage::TargetSurface, SURFACE_AROUND);
    if around.is_file() {
        request.obstacles.push(read_obstacle(&around)?);
    }
    Ok(request)
}

fn settings(table: &GraspTable, seed: u64) -> GraspSettings {
    let defaults = GraspSettings::default();
    let mut settings = GraspSettings {
        top: table.top.unwrap_or(defaults.top),
        n_samples: table.samples.unwrap_or(defaults.n_samples),
        friction: table.friction.unwrap_or(defaults.friction),
        mass: table.mass.or(defaults.mass),
        diversity: table.diversity.unwrap_or(defaults.diversity),
        grip_force: table.grip_force.unwrap_or(defaults.grip_force),
        demonstrated_approach: table.demonstrated.map(DVec3::from_array),
        seed,
        ..defaults
    };
    let half_angle = table.approach_cone.unwrap_or(APPROACH_CONE).to_radians();
    let limits = &mut settings.limits;
    limits.width = table.width_range.map(|[least, most]| least..=most);
    limits.approach =
        table.approach.map(|axis| ApproachCone { axis: DVec3::from_array(axis), half_angle });
    limits.clearance = table.clearance.unwrap_or(limits.clearance);
    limits.pad_in_region = table.pad_in_region.unwrap_or(limits.pad_in_region);
    settings
}

fn summary(problem: &GraspProblem, found: &Grasps) -> Vec<String> {
    let (n, candidates) = (found.grasps.len(), found.n_candidates);
    let mut lines = vec![format!("{n} grasps of {candidates} candidates")];
    lines.extend(found.grasps.first().map(|best| {
        let (score, width) = (best.score, 1e3 * best.width);
        format!("the best has score {score:.2} and {width:.0} mm between the pads")
    }));
    lines.push(format!("the object is {}", problem.size()));
    let margin = problem.settings().pose_margin;
    if margin > 0.0 {
        lines.push(format!(
            "the pose is uncertain by {:.1} mm, and the gripper keeps as far away",
            1e3 * margin
        ));
    }
    lines
}

/// What most candidates failed at.
fn why_none(found: &Grasps) -> String {
    let most = found.rejected.iter().max_by_key(|(_, n)| *n).filter(|(_, n)| *n > 0);
    let most = most.map_or_else(String::new, |(reason, n)| {
        format!("; most often ({n} times): {}", reason.explanation())
    });
    format!("none of {} candidates is a grasp{most}", found.n_candidates)
}

/// What would change that.
fn what_next(found: &Grasps, is_one_sided: bool) -> String {
    let mut next = Vec::new();
    if is_one_sided {
        next.push("the region is what one camera saw of its part, and pads need both sides: demonstration.grow = true".into());
    }
    if let Some(miss) = &found.nearest_miss {
        next.push(format!(
            "the nearest miss failed by {:.4} {}: {}",
            miss.by,
            miss.reason.unit(),
            miss.reason.advice()
        ));
    }
    if next.is_empty() {
        next.push("try another gripper (grasp.gripper), or mark more of the part".into());
    }
    next.join("; ")
}
