//! A pose made better in one depth image: every sample that should be seen against the depth at its pixel, and the outline
//! against the jumps of the depth.
//!
//! Samples are matched along their own lines of sight (Blais & Levine, *Registering multiview range data to create 3D
//! computer objects*, 1995), which takes no search, by the distance to the plane of the sample (Chen & Medioni 1992) under
//! the kernel of Geman & McClure, whose width narrows (Zhou, Park & Koltun 2016). That leaves what slides along a plane
//! undetermined; the outline does not: each of its points is moved across itself to the nearest jump of the depth (Harris &
//! Stennett, *RAPID*, 1990, with depth for brightness).

use semfm_align::Sim3;
use semfm_geom::math::DVec3;

use crate::depth_view::{DepthView, Pixel};
use crate::model::TrackModel;
use crate::motion::{Matrix6, Twist, matrix, moved};
use crate::outline::{GRAZING, OutlinePoint, Shown};

/// Least and greatest standard deviation of the depth, metres; the greatest as a share of the diameter, too.
const NOISE: [f64; 2] = [0.0006, 0.008];
const NOISE_SHARE: f64 = 0.03;

/// Widths of the kernel: the last one in standard deviations of the noise, and how much a step narrows it.
const WIDTH_PER_NOISE: f64 = 4.0;
const NARROWING: f64 = 0.6;

/// Steps at most, and how many of them at the last width.
const MAX_STEPS: usize = 14;
const LAST_STEPS: usize = 2;

/// Standard deviation of a jump of the depth across the outline, in pixels.
const JUMP_NOISE: f64 = 1.0;

/// Pixels on either side of the outline in which a jump is sought: at least, at most.
const REACH: [f64; 2] = [3.0, 24.0];

/// Pixels beyond the object that may show no return before the ground is seen.
const GAP: i32 = 3;

/// Stiffness of what the image leaves undetermined, as standard deviations of one step: metres and radians.
const HOLD_SHIFT: f64 = 0.05;
const HOLD_TURN: f64 = 0.5;

/// A step that moves less than this (metres, or radians of the radius) is the last.
const SHORT: f64 = 2e-5;

/// A pose and how its matches determine it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registration {
    /// Camera from the inner frame.
    pub pose: Sim3,
    /// Of shift and turn, from the last step: Σ w Jᵀ J / σ².
    pub information: Matrix6,
    /// Standard deviation of the samples about their planes, metres.
    pub noise: f64,
}

/// Where a registration starts from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub pose: Sim3,
    /// Width of the first kernel, metres.
    pub width: f64,
    /// Standard deviation of the depth as known so far, metres.
    pub noise: f64,
}

/// Sums of one step.
struct Sums {
    a: Matrix6,
    g: Twist,
    residuals: Vec<f64>,
}

impl Sums {
    fn add(&mut self, residual: f64, normal: DVec3, lever: DVec3, weight: f64) {
        let turn = lever.cross(normal);
        let j = Twist::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z);
        self.a += weight * j * j.transpose();
        self.g += weight * residual * j;
    }
}

/// Registers what is shown from `start`. `None` where nothing matches.
pub(crate) fn register(
    model: &TrackModel,
    view: &DepthView<'_>,
    shown: &Shown,
    start: &Start,
) -> Option<Registration> {
    let Start { mut pose, mut width, mut noise } = *start;
    // Of a very small object even the least noise is more than its share.
    let most_noise = NOISE[1].min(NOISE_SHARE * model.diameter()).max(NOISE[0]);
    let mut hold = Matrix6::identity() / (HOLD_TURN * HOLD_TURN);
    (0..3).for_each(|k| hold[(k, k)] = 1.0 / (HOLD_SHIFT * HOLD_SHIFT));
    let mut last_steps = 0;
    let mut information = Matrix6::zeros();
    for _ in 0..MAX_STEPS {
        let mut sums = samples_against_depth(model, view, &pose, &shown.samples, width, noise);
        if sums.residuals.len() < 6 {
            return None;
        }
        outline_against_jumps(view, &pose, &shown.outline, width, &mut sums);
        noise = deviation(&mut sums.residuals).clamp(NOISE[0], most_noise);
        information = sums.a;
        let step = (sums.a + hold).cholesky()?.solve(&sums.g);
        let length = step.fixed_rows::<3>(0).norm() + model.radius * step.fixed_rows::<3>(3).norm();
        pose = moved(&pose, &step);
        let last = WIDTH_PER_NOISE * noise;
        if width <= last * 1.001 {
            last_steps += 1;
            if last_steps >= LAST_STEPS || length < SHORT {
                break;
            }
        }
        width = (width * NARROWING).max(last);
    }
    pose.translation.is_finite().then_some(Registration { pose, information, noise })
}

/// Distances of the measured points q to the planes of the samples p that they should show: with the motion (v, ω) of the
/// object about its middle,
///
/// > r = n·(q − p) − n·v − ((p − t) × n)·ω
fn samples_against_depth(
    model: &TrackModel,
    view: &DepthView<'_>,
    pose: &Sim3,
    ids: &[u32],
    width: f64,
    noise: f64,
) -> Sums {
    let turn = matrix(pose);
    let mut sums =
        Sums { a: Matrix6::zeros(), g: Twist::zeros(), residuals: Vec::with_capacity(ids.len()) };
    for &id in ids {
        let sample = &model.samples[id as usize];
        let lever = turn * sample.point;
        let place = lever + pose.translation;
        let mut normal = turn * sample.normal;
        let mut cosine = -normal.dot(place) / place.length();
        if model.both_sides && cosine < 0.0 {
            (normal, cosine) = (-normal, -cosine);
        }
        let Some(at) = view.project(place).filter(|_| cosine >= GRAZING) else { continue };
        let Pixel::Depth(z) = view.at(at) else { continue };
        let offset = view.point(at, z) - place;
        // Farther along the line of sight than the kernel reaches: something else.
        if (z - place.z).abs() > 3.0 * width {
            continue;
        }
        let residual = normal.dot(offset);
        let x = 1.0 + residual * residual / (width * width);
        if residual.abs() < width {
            sums.residuals.push(residual);
        }
        sums.add(residual, normal, lever, 1.0 / (x * x * noise * noise));
    }
    sums
}

/// How far each point of the outline is from the jump of the depth nearest to it, across the outline.
fn outline_against_jumps(
    view: &DepthView<'_>,
    pose: &Sim3,
    outline: &[OutlinePoint],
    width: f64,
    sums: &mut Sums,
) {
    for rim in outline {
        let Some(line) = OutlineLine::new(view, pose, rim) else { continue };
        let reach = (width * line.per_metre).clamp(REACH[0], REACH[1]);
        let Some(jump) = line.jump(view, reach as i32, width) else { continue };
        let residual = jump / line.per_metre;
        let sigma = JUMP_NOISE / line.per_metre;
        let kernel = (width * line.per_metre).clamp(2.0, REACH[1]) / line.per_metre;
        let x = 1.0 + residual * residual / (kernel * kernel);
        sums.add(residual, line.outward, line.lever, 1.0 / (x * x * sigma * sigma));
    }
}

/// The line on the image across a point of the outline.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OutlineLine {
    at: [f64; 2],
    /// Unit, in pixels, away from the object.
    direction: [f64; 2],
    /// Pixels that a metre along `outward` takes.
    per_metre: f64,
    /// In the camera's frame.
    outward: DVec3,
    lever: DVec3,
    depth: f64,
}

/// What a pixel beside an outline shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beside {
    /// The object's depth, or a little nearer.
    Object,
    /// What is far behind.
    Ground,
    /// Something that stands before it.
    Before,
    Unknown,
}

impl OutlineLine {
    pub fn new(view: &DepthView<'_>, pose: &Sim3, rim: &OutlinePoint) -> Option<Self> {
        let lever = pose.rotation * rim.point;
        let outward = pose.rotation * rim.outward;
        let place = lever + pose.translation;
        let at = view.project(place)?;
        let motion = view.image_motion(place, outward);
        let per_metre = motion[0].hypot(motion[1]);
        let direction = motion.map(|x| x / per_metre);
        (per_metre > 1.0).then_some(Self {
            at,
            direction,
            per_metre,
            outward,
            lever,
            depth: place.z,
        })
    }

    /// What is seen `k` pixels outward, where surface within `tolerance` (metres) of the outline's depth is the object's.
    pub fn beside(&self, view: &DepthView<'_>, k: f64, tolerance: f64) -> Beside {
        let at = [0, 1].map(|i| self.at[i] + k * self.direction[i]);
        let Pixel::Depth(z) = view.at(at) else { return Beside::Unknown };
        // The surface comes nearer inward of its outline.
        let nearer = tolerance + 2.0 * (-k).max(0.0) / self.per_metre;
        match z - self.depth {
            d if d > tolerance => Beside::Ground,
            d if d < -nearer => Beside::Before,
            _ => Beside::Object,
        }
    }

    /// The jump from the object to the ground that lies nearest, in pixels outward, within `reach` of the outline.
    pub fn jump(&self, view: &DepthView<'_>, reach: i32, tolerance: f64) -> Option<f64> {
        let is = |k: i32| self.beside(view, f64::from(k), tolerance);
        let mut best: Option<f64> = None;
        let mut inner = is(-reach);
        for k in -reach..reach {
            let outer = is(k + 1);
            if inner == Beside::Object && outer != Beside::Object && outer != Beside::Before {
                // The ground, or no return and then the ground.
                let ground = (1..=GAP).map(|i| is(k + i)).find(|&seen| seen != Beside::Unknown);
                let place = f64::from(k) + 0.5;
                if ground == Some(Beside::Ground) && best.is_none_or(|b| place.abs() < b.abs()) {
                    best = Some(place);
                }
            }
            inner = outer;
        }
        best
    }
}

/// Standard deviation by the median distance from zero: 1.4826 · median |r|.
fn deviation(residuals: &mut [f64]) -> f64 {
    if residuals.is_empty() {
        return f64::INFINITY;
    }
    let middle = residuals.len() / 2;
    residuals.iter_mut().for_each(|r| *r = r.abs());
    1.4826 * *residuals.select_nth_unstable_by(middle, f64::total_cmp).1
}
