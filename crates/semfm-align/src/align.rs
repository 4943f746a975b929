//! The whole alignment: search, exact pose, what stays uncertain, verdict.

use std::time::Instant;

use semfm_geom::{Mesh, Task, Verdict};

use crate::Result;
use crate::alignment::Alignment;
use crate::ambiguity::{BETTER, Rival};
use crate::correspondence::Problem;
use crate::judgement::judge;
use crate::model::AlignModel;
use crate::observed_cloud::ObservedCloud;
use crate::refine::RefinedPose;
use crate::settings::AlignSettings;
use crate::sim3::Sim3;
use crate::uncertainty::Uncertainty;

/// Width of the last steps' kernel at first, as a share of the observed diameter.
const FIRST_WIDTH: f64 = 0.03;

/// How near (as a factor) the scale may come to a border of its range and still be inside.
const AT_BORDER: f64 = 1.0001;

/// How often a rival that explains more may take the pose's place.
const MAX_MOVES: usize = 3;

/// Aligns a mesh to an observation; [`align_model`] is the same for a mesh that is prepared.
///
/// ```
/// use semfm_align::{AlignSettings, ObservedCloud, align};
/// use semfm_geom::{Mesh, Task, math::DVec3};
/// # let (mut points, mut faces) = (Vec::new(), Vec::new());
/// # for face in 0..6usize { let (n, s) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
/// #   for c in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
/// #     let mut p = DVec3::ZERO; p[n] = s; p[(n + 1) % 3] = c[0]; p[(n + 2) % 3] = s * c[1];
/// #     points.push(p * DVec3::new(1.0, 2.0, 3.0)); }
/// #   let i = 4 * face as u32; faces.extend([[i, i + 1, i + 2], [i, i + 2, i + 3]]); }
/// let cuboid = Mesh::new(points, faces)?; // 2 × 4 × 6, in no unit of length
/// // Its three sides at y = −2, x = −1, z = −3, seen from afar, a hundred times smaller.
/// let grid = (0..2500).map(|i| (f64::from(i % 50) / 25.0 - 1.0, f64::from(i / 50) / 25.0 - 1.0));
/// let seen: Vec<DVec3> = grid
///     .flat_map(|(a, b)| {
///         let sides = [DVec3::new(a, -2.0, 3.0 * b), DVec3::new(-1.0, 2.0 * a, 3.0 * b),
///             DVec3::new(a, 2.0 * b, -3.0)];
///         sides.map(|p| 0.01 * p + DVec3::new(0.2, 0.3, 0.4))
///     })
///     .collect();
/// let observation = ObservedCloud::from_view(&seen, DVec3::ZERO)?;
/// let found = align(&cuboid, &observation, &AlignSettings::default(), &Task::default())?;
/// assert!((found.camera_from_object.scale - 0.01).abs() < 2e-4); // by its outline alone
/// # Ok::<(), semfm_align::Error>(())
/// ```
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for settings out of range;
/// [`semfm_geom::Error::NoArea`]; [`semfm_geom::Error::Cancelled`]. A pose that cannot be trusted is
/// no error: see [`Alignment::verdict`].
pub fn align(
    mesh: &Mesh,
    observed: &ObservedCloud,
    settings: &AlignSettings,
    task: &Task,
) -> Result<Alignment> {
    let start = Instant::now();
    let model = AlignModel::new(mesh, settings.seed, task)?;
    let prepared = milliseconds(start);
    let mut found = align_model(&model, observed, settings, task)?;
    found.stages_ms.insert(0, ("model", prepared));
    Ok(found)
}

/// Aligns a prepared mesh to an observation.
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for settings out of range;
/// [`semfm_geom::Error::Cancelled`].
pub fn align_model(
    model: &AlignModel,
    observed: &ObservedCloud,
    settings: &AlignSettings,
    task: &Task,
) -> Result<Alignment> {
    settings.check()?;
    task.check()?;
    let scales = settings.scales(model, observed);
    let problem = Problem { model, observed, scales };

    let start = Instant::now();
    let guess = settings.init.map(|init| init * model.object_from_unit);
    let Some(searched) = problem.search(guess, settings.n_starts, task)? else {
        return Ok(nothing_found(&problem, guess, milliseconds(start)));
    };
    let search_ms = milliseconds(start);

    let start = Instant::now();
    let mut settled = problem.settle(searched.best, task)?;
    let mut candidates = searched.others;
    candidates.push(searched.best);
    let settle_ms = milliseconds(start);

    let start = Instant::now();
    let mut moves = 0;
    let ambiguity = loop {
        let ambiguity = problem.ambiguity(&settled, &candidates, moves < MAX_MOVES, task)?;
        let Some(better) = ambiguity.better else { break ambiguity };
        candidates.push(settled.refined.pose);
        settled = problem.settle_rival(better, settled.refined.width, task)?;
        moves += 1;
    };
    let rivals_ms = milliseconds(start);

    let start = Instant::now();
    let Settled { refined: RefinedPose { pose, width, iterations }, uncertainty, n_weak } = settled;
    // A sample within the points' noise, or within the width of their cells, was seen.
    let tolerance = width.max(0.02 * observed.diameter());
    let visibility = problem.visibility(&pose, tolerance, 2, true).share();
    let from_unit = model.object_from_unit.inverse();
    let camera_from_object = pose * from_unit;
    let ids = problem.all_ids();
    let mut found = Alignment {
        camera_from_object,
        scale_std: uncertainty.growth_std() * camera_from_object.scale,
        rotation_std: uncertainty
            .rotation_std(&problem, &pose, &ids, width)
            .max(ambiguity.rotation_std),
        position_std: uncertainty.shift_std().max(ambiguity.shift_std) * pose.scale,
        residual_m: uncertainty.residual_m,
        inlier_share: uncertainty.inlier_share,
        visibility,
        rival: ambiguity.rival,
        undetermined: ambiguity.axes,
        alternatives: ambiguity.poses.iter().map(|&pose| pose * from_unit).collect(),
        n_starts: searched.n_starts,
        iterations,
        verdict: Verdict::Refuse,
        reasons: Vec::new(),
        stages_ms: Vec::new(),
    };
    let at_border = pose.scale <= scales[0] * AT_BORDER || pose.scale >= scales[1] / AT_BORDER;
    let judgement = judge(&found, n_weak, at_border);
    found.verdict = judgement.verdict;
    found.reasons = judgement.reasons;
    found.stages_ms = vec![
        ("search", search_ms),
        ("settle", settle_ms),
        ("rivals", rivals_ms),
        ("judge", milliseconds(start)),
    ];
    Ok(found)
}

/// A pose after its last steps, with its uncertainty.
pub(crate) struct Settled {
    pub refined: RefinedPose,
    pub uncertainty: Uncertainty,
    /// Directions that the outline alone determined.
    pub n_weak: usize,
}

impl Problem<'_> {
    /// Ids of all points.
    pub fn all_ids(&self) -> Vec<u32> {
        self.observed.subset(self.observed.points.len())
    }

    /// The exact pose from a searched one, moved to where the outline has it along what the points
    /// leave open.
    fn settle(&self, start: Sim3, task: &Task) -> Result<Settled> {
        let ids = self.all_ids();
        let widest = FIRST_WIDTH * self.observed.diameter();
        let mut refined = self.refine(start, &ids, widest, &[], task)?;
        let mut uncertainty = Uncertainty::of(self, &refined.pose, &ids, refined.width);
        let weak = uncertainty.weak_directions();
        if !weak.is_empty() {
            let RefinedPose { pose, width, iterations } = refined;
            let moved = self.move_along_weak_directions(pose, &weak, width, task)?;
            let again = self.refine(moved.pose, &ids, 2.0 * width, &weak, task)?;
            refined = RefinedPose { iterations: iterations + again.iterations, ..again };
            uncertainty = Uncertainty::of(self, &refined.pose, &ids, refined.width);
            for (direction, &std) in weak.iter().zip(&moved.stds) {
                uncertainty.limit_std_along(direction, std);
            }
        }
        Ok(Settled { refined, uncertainty, n_weak: weak.len() })
    }

    /// As [`Self::settle`], for a pose that explains more than the one before, of which `width` is the
    /// final kernel's: where that would lead away again, the pose stays where it is.
    fn settle_rival(&self, rival: Rival, width: f64, task: &Task) -> Result<Settled> {
        let ids = self.all_ids();
        let evidence = self.evidence_width(width);
        let settled = self.settle(rival.pose, task)?;
        let unexplained = self.unexplained(&settled.refined.pose, &ids, evidence);
        if unexplained < rival.unexplained + BETTER {
            return Ok(settled);
        }
        let width = self.kernel_width(&rival.pose, &ids, evidence);
        let refined = RefinedPose { pose: rival.pose, width, iterations: 0 };
        let uncertainty = Uncertainty::of(self, &rival.pose, &ids, width);
        let n_weak = uncertainty.weak_directions().len();
        Ok(Settled { refined, uncertainty, n_weak })
    }
}

/// What no start led to: the guess, or the identity, refused.
fn nothing_found(problem: &Problem<'_>, guess: Option<Sim3>, search_ms: f64) -> Alignment {
    let Problem { model, scales, .. } = problem;
    let scale = (scales[0] * scales[1]).sqrt();
    let pose = guess.unwrap_or(Sim3 { scale, ..Sim3::IDENTITY });
    let camera_from_object = pose * model.object_from_unit.inverse();
    Alignment {
        camera_from_object,
        scale_std: camera_from_object.scale,
        rotation_std: std::f64::consts::PI,
        position_std: pose.scale,
        residual_m: pose.scale,
        inlier_share: 0.0,
        visibility: 0.0,
        rival: 0.0,
        undetermined: Vec::new(),
        alternatives: Vec::new(),
        n_starts: 0,
        iterations: 0,
        verdict: Verdict::Refuse,
        reasons: vec!["no start led to a pose under which observed points lie on the model".into()],
        stages_ms: vec![("search", search_ms)],
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
