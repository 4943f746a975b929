//! From a region to ranked grasps: grow candidates, examine each in stages, score, select.

use std::time::{Duration, Instant};

use parry3d_f64::math::Pose;
use rayon::prelude::*;
use semfm_geom::Task;

use crate::Result;
use crate::candidate::Candidate;
use crate::grasp::Grasp;
use crate::gripper_geometry::GripperGeometry;
use crate::object::{GraspObject, Region};
use crate::rejection::{Miss, Rejected};
use crate::scene::Scene;
use crate::search::{Found, Search};
use crate::select::{diverse, drawn};
use crate::settings::{GraspSettings, Selection};
use crate::working_surface::SurfaceReport;
use semfm_robot::Gripper;

/// Grasps of one region by one gripper in one scene, and what became of the other candidates.
#[derive(Clone, Debug)]
pub struct Grasps {
    /// Best first; empty where nothing survived.
    pub grasps: Vec<Grasp>,
    /// Candidates refused, by the first thing that each failed.
    pub rejected: Rejected,
    /// Of the candidates refused for the main reason (the stage that let the smallest share of those that reached it
    /// through) the one that missed by least.
    pub nearest_miss: Option<Miss>,
    /// The surface on which contacts were sought.
    pub surface: SurfaceReport,
    /// Gripper poses examined.
    pub n_candidates: usize,
    /// Gripper poses that passed every check, before near ones were merged and the best chosen.
    pub n_survivors: usize,
    /// Wall time of each stage, milliseconds.
    pub stages_ms: Vec<(&'static str, f64)>,
}

/// Grasps of `object` whose pads lie in a region.
///
/// `region` has one weight (at least 0) for each vertex or point of the object. All lengths are
/// metres; scene, approach and grasps are in the frame of the object. Finding nothing is an answer:
/// `grasps` is empty then, and `rejected` and `nearest_miss` say why.
///
/// The same seed gives the same grasps at every thread count.
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for settings, weights and grippers that make no
/// sense; [`Cancelled`](semfm_geom::Error::Cancelled) once the task is.
pub fn find_grasps(
    object: &GraspObject,
    region: &[f64],
    gripper: &Gripper,
    scene: &Scene,
    settings: &GraspSettings,
    task: &Task,
) -> Result<Grasps> {
    find_grasps_with(object, region, &GripperGeometry::new(gripper)?, scene, settings, task)
}

/// [`find_grasps`] with a gripper that was prepared before.
///
/// ```
/// use semfm_geom::{Mesh, Task, math::DVec3};
/// use semfm_grasp::{BoxGripper, GraspObject, GraspSettings, GripperGeometry, Scene, find_grasps_with};
/// // A plate of 10 × 10 × 1 cm on a table.
/// let corner = |i: usize| DVec3::new((i & 1) as f64 * 0.1, (i >> 1 & 1) as f64 * 0.1, (i >> 2) as f64 * 0.01);
/// let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
/// let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
/// let plate = GraspObject::from_mesh(&Mesh::new((0..8).map(corner).collect(), faces)?, 1.0)?;
/// let gripper = GripperGeometry::from_boxes(&BoxGripper::default())?;
/// let settings = GraspSettings { n_samples: 200, ..GraspSettings::default() };
/// let whole = vec![1.0; plate.n_weights()];
/// let found = find_grasps_with(&plate, &whole, &gripper, &Scene::new(), &settings, &Task::default())?;
/// assert!((found.grasps[0].width - 0.01).abs() < 1e-3);
/// # Ok::<(), semfm_grasp::Error>(())
/// ```
///
/// # Errors
/// As [`find_grasps`].
pub fn find_grasps_with(
    object: &GraspObject,
    region: &[f64],
    gripper: &GripperGeometry,
    scene: &Scene,
    settings: &GraspSettings,
    task: &Task,
) -> Result<Grasps> {
    let start = Instant::now();
    settings.check()?;
    let region = Region::new(object, region)?;
    let search = Search::new(object, &region, gripper, scene, settings);
    let prepared = start.elapsed();
    let sampled = search.run(task)?;
    let examined = start.elapsed();
    let found = match settings.selection {
        Selection::Best => search.climb(search.add_neighbours(sampled, task)?, task)?,
        Selection::Random => sampled.into_found(),
    };
    let all = settings.selection == Selection::Random;
    let Found { kept, n_survivors, mut sampled } = search.on_exact_surface(found, all, task)?;
    let spread = start.elapsed();
    let grasps = match settings.selection {
        Selection::Best => diverse(kept, settings.top, settings.diversity, object.radius()),
        Selection::Random => drawn(kept, settings.top, settings.seed),
    };
    Ok(Grasps {
        grasps,
        nearest_miss: sampled.nearest().map(|near| search.miss(near)),
        rejected: sampled.rejected,
        surface: object.surface_report(),
        n_candidates: sampled.n_candidates,
        n_survivors,
        stages_ms: vec![
            ("prepare", milliseconds(prepared)),
            ("examine", milliseconds(examined - prepared)),
            ("spread", milliseconds(spread - examined)),
            ("select", milliseconds(start.elapsed() - spread)),
        ],
    })
}

/// A pose from elsewhere, to be examined as our own candidates are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseToExamine {
    /// The gripper's TCP frame in the object's frame, metres.
    pub object_from_tcp: Pose,
    /// The width that the gripper is to hold there, metres.
    pub width: f64,
}

/// Examines gripper poses from elsewhere as [`find_grasps`] does its own: for each pose a grasp, or the
/// first thing that it failed.
///
/// The gripper is moved along its closing axis until both pads touch at once. Only what concerns all
/// poses is an error.
///
/// # Errors
/// As [`find_grasps`].
pub fn examine_poses(
    object: &GraspObject,
    region: &[f64],
    gripper: &GripperGeometry,
    scene: &Scene,
    settings: &GraspSettings,
    poses: &[PoseToExamine],
) -> Result<Vec<std::result::Result<Grasp, Box<Miss>>>> {
    settings.check()?;
    let region = Region::new(object, region)?;
    let search = Search::new(object, &region, gripper, scene, settings);
    let examined = poses.par_iter().map(|pose| {
        let seed = [-pose.width / 2.0, pose.width / 2.0];
        let candidate = Candidate { tcp: pose.object_from_tcp, seed };
        search.examine_pose(&candidate).map_err(|near| Box::new(search.miss(*near)))
    });
    Ok(examined.collect())
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}
