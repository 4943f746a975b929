//! The whole alignment: search, exact pose, what stays uncertain, verdict.

use std::time::Instant;

use semfm_geom::{Mesh, Task};

use crate::certainty::{Certainty, noise};
use crate::model::AlignModel;
use crate::observation::Observation;
use crate::sim3::Sim3;
use crate::solve::{Matching, Problem, Vector7};
use crate::verdict::{self, Verdict};
use crate::{Error, Result};

/// Where the search starts and how far it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct AlignSettings {
    /// A guess of the pose (camera from object, scale included); the search stays near its rotation.
    pub init: Option<Sim3>,
    /// Least and greatest scale, metres per unit of the mesh. `None` derives it from how large the
    /// observed cloud is beside the mesh, or from the guess.
    pub scale_range: Option<[f64; 2]>,
    /// Rotations to start from where there is no guess.
    pub n_starts: usize,
    /// Seed of the model's samples.
    pub seed: u64,
}

impl Default for AlignSettings {
    fn default() -> Self {
        Self { init: None, scale_range: None, n_starts: 400, seed: 0 }
    }
}

/// The pose of an object in a camera's frame, and how far to trust it.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// From the mesh's frame and units to the camera's frame in metres.
    pub camera_from_object: Sim3,
    /// Standard deviation of the scale, metres per unit of the mesh.
    pub scale_std: f64,
    /// Standard deviation of the rotation about its least certain axis, radians.
    pub rotation_std: f64,
    /// Standard deviation of the position in its least certain direction, metres.
    pub position_std: f64,
    /// Root mean square distance from the points that lie on the model to its surface, metres.
    pub residual_m: f64,
    /// Share of the observed points that lie on the model.
    pub inlier_share: f64,
    /// Of the model's side that faces the camera, the share that was seen where it is.
    pub visibility: f64,
    /// Score of the best pose with another place of the surface, as a share of this one's.
    pub rival: f64,
    /// Starts tried.
    pub n_starts: usize,
    /// Steps of the last, exact round.
    pub iterations: usize,
    /// What to do with the pose.
    pub verdict: Verdict,
    /// What speaks against accepting it, in words.
    pub reasons: Vec<String>,
    /// Time per stage in milliseconds, in order.
    pub stages_ms: Vec<(&'static str, f64)>,
}

/// Aligns a mesh to an observation; [`align_model`] is the same for a mesh that is prepared.
///
/// ```
/// use semfm_geom::{Mesh, Task, math::DVec3};
/// use semfm_align::{AlignSettings, Observation, align};
/// # let (mut points, mut faces) = (Vec::new(), Vec::new());
/// # for face in 0..6usize { let (n, s) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
/// #   for c in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
/// #     let mut p = DVec3::ZERO; p[n] = s; p[(n + 1) % 3] = c[0]; p[(n + 2) % 3] = s * c[1];
/// #     points.push(p * DVec3::new(1.0, 2.0, 3.0)); }
/// #   let i = 4 * face as u32; faces.extend([[i, i + 1, i + 2], [i, i + 2, i + 3]]); }
/// let cuboid = Mesh::new(points, faces)?; // 2 × 4 × 6, in nobody's units
/// // Its three sides at y = −2, x = −1, z = −3, seen from afar, a hundred times smaller.
/// let grid = (0..2500).map(|i| (f64::from(i % 50) / 25.0 - 1.0, f64::from(i / 50) / 25.0 - 1.0));
/// let seen: Vec<DVec3> = grid
///     .flat_map(|(a, b)| {
///         let sides = [DVec3::new(a, -2.0, 3.0 * b), DVec3::new(-1.0, 2.0 * a, 3.0 * b),
///             DVec3::new(a, 2.0 * b, -3.0)];
///         sides.map(|p| 0.01 * p + DVec3::new(0.2, 0.3, 0.4))
///     })
///     .collect();
/// let observation = Observation::from_view(&seen, DVec3::ZERO)?;
/// let found = align(&cuboid, &observation, &AlignSettings::default(), &Task::default())?;
/// assert!((found.camera_from_object.scale - 0.01).abs() < 2e-4); // by its outline alone
/// # Ok::<(), semfm_align::Error>(())
/// ```
///
/// # Errors
/// [`Error::OutOfRange`] for settings out of range; [`semfm_geom::Error::NoArea`];
/// [`semfm_geom::Error::Cancelled`]. A pose that cannot be trusted is no error: see
/// [`Alignment::verdict`].
pub fn align(
    mesh: &Mesh,
    observed: &Observation,
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
/// As [`align`].
pub fn align_model(
    model: &AlignModel,
    observed: &Observation,
    settings: &AlignSettings,
    task: &Task,
) -> Result<Alignment> {
    settings.check()?;
    task.check()?;
    let start = Instant::now();
    let scales = settings.scales(model, observed);
    let problem = Problem { model, observed, scales };
    let init = settings.init.map(|init| init * model.object_from_unit);
    let Some((best, rival, n_starts)) = problem.search(init, settings.n_starts, task)? else {
        return Ok(nothing_found(init, scales, model, milliseconds(start)));
    };
    let searched = milliseconds(start);

    let start = Instant::now();
    let ids = observed.some(observed.points.len());
    let widest = FIRST_WIDTH * observed.diameter();
    let (mut pose, mut width, mut iterations) =
        problem.polish(best.pose, &ids, widest, &[], task)?;
    let mut certainty = Certainty::of(&problem, &pose, &ids, width);
    let polished = milliseconds(start);

    let start = Instant::now();
    let weak = certainty.weak();
    if !weak.is_empty() {
        let (settled, stds) = problem.settle(pose, &weak, width, task)?;
        let more;
        (pose, width, more) = problem.polish(settled, &ids, 2.0 * width, &weak, task)?;
        iterations += more;
        certainty = Certainty::of(&problem, &pose, &ids, width);
        weak.iter().zip(&stds).for_each(|(direction, &std)| certainty.know(direction, std));
    }
    let settled = milliseconds(start);

    let start = Instant::now();
    // A sample within the points' noise, or within the width of their cells, was seen.
    let tolerance = width.max(0.02 * observed.diameter());
    let visibility = problem.seen(&pose, tolerance, 2, true).share();
    let camera_from_object = pose * model.object_from_unit.inverse();
    let mut found = Alignment {
        camera_from_object,
        scale_std: certainty.growth_std() * camera_from_object.scale,
        rotation_std: certainty.rotation_std(&problem, &pose, &ids, width),
        position_std: certainty.shift_std() * pose.scale,
        residual_m: certainty.residual_m,
        inlier_share: certainty.inlier_share,
        visibility,
        rival: rival.map_or(0.0, |rival| rival.score / best.score),
        n_starts,
        iterations,
        verdict: Verdict::Refuse,
        reasons: Vec::new(),
        stages_ms: Vec::new(),
    };
    let at_bound = pose.scale <= scales[0] * 1.0001 || pose.scale >= scales[1] / 1.0001;
    (found.verdict, found.reasons) = verdict::judge(&found, weak.len(), at_bound);
    found.stages_ms = vec![
        ("search", searched),
        ("polish", polished),
        ("settle", settled),
        ("judge", milliseconds(start)),
    ];
    Ok(found)
}

/// Width of the last round's kernel in standard deviations of the noise: wide enough to lose little
/// against least squares, narrow enough that clutter a few millimetres away does no harm.
pub(crate) const NOISE_WIDTH: f64 = 4.0;

/// Width of the last round's kernel at first, as a share of the observed diameter.
const FIRST_WIDTH: f64 = 0.03;

/// Least width of the kernel, as a share of the observed diameter, on clouds without noise.
const LEAST_WIDTH: f64 = 1e-4;

/// Steps of the last round at most; four to six are usual.
const LAST_STEPS: usize = 12;

/// Points of the first steps of the last round, in which the kernel finds its width.
const SETTLE_POINTS: usize = 250;
/// Those first steps.
const SETTLE_STEPS: usize = 2;

/// Steps in which the kernel still follows the noise; later it would make the pose tremble.
const WIDTH_STEPS: usize = 6;

/// A step is the last one where it is this share of what the noise leaves uncertain.
const SHORT_STEP: f64 = 0.25;

impl Problem<'_> {
    /// All points, exact matches, a kernel as wide as the noise (`widest` at first), no step along
    /// what is `held`. Returns the pose, the kernel's
    /// width and the steps taken.
    fn polish(
        &self,
        start: Sim3,
        ids: &[u32],
        widest: f64,
        held: &[Vector7],
        task: &Task,
    ) -> Result<(Sim3, f64, usize)> {
        let size = self.observed.diameter();
        let some = self.observed.some(SETTLE_POINTS);
        let (mut pose, mut width) = (start, widest);
        let mut pulls = Vec::with_capacity(ids.len());
        for step in 1..=LAST_STEPS {
            task.check()?;
            pulls.clear();
            let asked = if step <= SETTLE_STEPS { &some } else { ids };
            self.pulls(&pose, asked, width, Matching::Exact, |_, pull| pulls.push(pull));
            if step <= WIDTH_STEPS {
                let noise = noise(&pulls, width).unwrap_or(width);
                width = (NOISE_WIDTH * noise).clamp(LEAST_WIDTH * size, width);
            }
            let Some((moved, length)) = self.follow(&pose, &pulls, width, held) else {
                return Ok((pose, width, step));
            };
            pose = moved;
            let uncertain = width / (NOISE_WIDTH * pose.scale * (ids.len() as f64).sqrt());
            if step > SETTLE_STEPS && length < SHORT_STEP * uncertain {
                return Ok((pose, width, step));
            }
        }
        Ok((pose, width, LAST_STEPS))
    }
}

/// What no start led to: the guess, or the identity, refused.
fn nothing_found(init: Option<Sim3>, scales: [f64; 2], model: &AlignModel, ms: f64) -> Alignment {
    let scale = (scales[0] * scales[1]).sqrt();
    let pose = init.unwrap_or(Sim3 { scale, ..Sim3::IDENTITY });
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
        n_starts: 0,
        iterations: 0,
        verdict: Verdict::Refuse,
        reasons: vec!["no start led to a pose under which observed points lie on the model".into()],
        stages_ms: vec![("search", ms)],
    }
}

impl AlignSettings {
    /// How far the scale may be from the one at which mesh and cloud are equally large: a single
    /// view of a hammer's end shows a third of its length, and clutter makes the cloud larger.
    const SCALES: [f64; 2] = [0.35, 4.0];

    /// The same around the scale of a guess.
    const SCALES_OF_INIT: [f64; 2] = [0.5, 2.0];

    fn check(&self) -> Result<()> {
        let refuse = |what, expected: &str, found| {
            Err(Error::OutOfRange { what, expected: expected.into(), found })
        };
        if let Some([low, high]) = self.scale_range
            && !(low > 0.0 && high >= low && high.is_finite())
        {
            return refuse("scale range", "0 < low ≤ high", format!("{low}, {high}"));
        }
        if let Some(init) = self.init
            && !(init.scale > 0.0
                && init.scale.is_finite()
                && init.translation.is_finite()
                && init.rotation.is_normalized())
        {
            return refuse(
                "initial pose",
                "a positive scale and finite numbers",
                format!("{init:?}"),
            );
        }
        if !(1..=100_000).contains(&self.n_starts) {
            return refuse("starts", "1 to 100000", self.n_starts.to_string());
        }
        Ok(())
    }

    /// Metres for each radius of the model.
    fn scales(&self, model: &AlignModel, observed: &Observation) -> [f64; 2] {
        let radius = model.object_from_unit.scale;
        match (self.scale_range, self.init) {
            (Some(range), _) => range.map(|scale| scale * radius),
            (None, Some(init)) => Self::SCALES_OF_INIT.map(|x| x * init.scale * radius),
            (None, None) => Self::SCALES.map(|x| x * observed.diameter() / 2.0),
        }
    }
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
