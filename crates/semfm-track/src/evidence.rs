//! What an image says for and against a pose.

use semfm_align::Sim3;

use crate::depth_view::{DepthView, Pixel};
use crate::model::TrackModel;
use crate::motion::matrix;
use crate::outline::Shown;
use crate::probability::probability;
use crate::record::PoseEvidence;
use crate::register::{Beside, OutlineLine};

/// A sample within so many standard deviations of its depth was seen.
const TOLERANCE_PER_NOISE: f64 = 4.0;

/// Least tolerance, metres: cameras that say a millimetre step by as much.
const LEAST_TOLERANCE: f64 = 0.003;

/// How much (pixels, times the slope) a slanted surface adds to it.
const SLOPE_PIXELS: f64 = 1.0;

/// Steepest slope that adds.
const MOST_SLOPE: f64 = 3.0;

/// A jump of the depth within so many pixels is where the outline should be.
const AT_OUTLINE: i32 = 4;

/// How one sample compares with what was measured where it should be seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Seen {
    /// Surface at its depth; how far (metres) before the sample's plane.
    Here(f64),
    /// Something nearer.
    Hidden,
    /// Nothing up to what is behind.
    Through,
    /// No return.
    Unknown,
}

/// Counts over what a pose shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evidence {
    /// Samples that should be seen, were they not beyond the border.
    pub n_shown: usize,
    pub n_here: usize,
    pub n_hidden: usize,
    pub n_through: usize,
    pub n_outside: usize,
    /// Points of the outline where the depth jumps as it should.
    pub n_jumps: usize,
    /// Where it does not: the ground within, or the same surface beyond.
    pub n_missed: usize,
    /// Root mean square distance of what was seen to the surface, metres.
    pub residual: f64,
    /// Largest distance at which a sample counted as seen (slant not counted), metres.
    pub tolerance: f64,
    /// Each sample that was compared.
    pub samples: Vec<(u32, Seen)>,
}

impl Evidence {
    /// Of a pose with the standard deviation of its matches.
    pub fn of(
        model: &TrackModel,
        view: &DepthView<'_>,
        shown: &Shown,
        pose: &Sim3,
        noise: f64,
    ) -> Self {
        let turn = matrix(pose);
        let tolerance = (TOLERANCE_PER_NOISE * noise).max(LEAST_TOLERANCE);
        let mut evidence = Self {
            n_shown: shown.samples.len() + shown.n_outside,
            n_outside: shown.n_outside,
            tolerance,
            samples: Vec::with_capacity(shown.samples.len()),
            ..Self::default()
        };
        let mut squares = 0.0;
        for &id in &shown.samples {
            let sample = &model.samples[id as usize];
            let place = turn * sample.point + pose.translation;
            let mut normal = turn * sample.normal;
            let cosine = (normal.dot(place) / place.length()).abs().max(1e-3);
            if normal.dot(place) > 0.0 {
                normal = -normal;
            }
            let Some(at) = view.project(place) else { continue };
            let slope = ((1.0 - cosine * cosine).max(0.0).sqrt() / cosine).min(MOST_SLOPE);
            let within = tolerance + SLOPE_PIXELS * slope * place.z / view.focal();
            let seen = match view.nearest_depth(at, place.z) {
                Pixel::Outside => continue,
                Pixel::NoReturn => Seen::Unknown,
                Pixel::Depth(z) if z - place.z > within => Seen::Through,
                Pixel::Depth(z) if z - place.z < -within => Seen::Hidden,
                Pixel::Depth(z) => {
                    // Along the line of sight, turned to the plane: the pixel's own position does not matter.
                    let before = normal.dot(place * (z / place.z - 1.0));
                    squares += before * before;
                    Seen::Here(before)
                }
            };
            match seen {
                Seen::Here(_) => evidence.n_here += 1,
                Seen::Hidden => evidence.n_hidden += 1,
                Seen::Through => evidence.n_through += 1,
                Seen::Unknown => {}
            }
            evidence.samples.push((id, seen));
        }
        evidence.residual = (squares / evidence.n_here.max(1) as f64).sqrt();
        evidence.compare_outline(view, shown, pose);
        evidence
    }

    fn compare_outline(&mut self, view: &DepthView<'_>, shown: &Shown, pose: &Sim3) {
        let tolerance = 2.0 * self.tolerance;
        for rim in &shown.outline {
            let Some(line) = OutlineLine::new(view, pose, rim) else { continue };
            if line.jump(view, AT_OUTLINE, tolerance).is_some() {
                self.n_jumps += 1;
                continue;
            }
            let [inside, outside] = [-f64::from(AT_OUTLINE), f64::from(AT_OUTLINE)]
                .map(|k| line.beside(view, k, tolerance));
            let through = inside == Beside::Ground;
            let flush = inside == Beside::Object && outside == Beside::Object;
            self.n_missed += usize::from(through || flush);
        }
    }

    /// Of the samples that should be seen, the share that was.
    pub fn visible_share(&self) -> f64 {
        self.n_here as f64 / self.n_shown.max(1) as f64
    }

    /// Of the samples that were seen or looked through, the share that was looked through.
    pub fn through_share(&self) -> f64 {
        self.n_through as f64 / (self.n_here + self.n_through).max(1) as f64
    }

    /// Of the points of the outline that tell, the share where the depth jumps; ½ where none tells. One of either kind is
    /// added, so that few points say little.
    pub fn outline_share(&self) -> f64 {
        (self.n_jumps as f64 + 1.0) / ((self.n_jumps + self.n_missed) as f64 + 2.0)
    }

    /// Of the samples that should be seen, the share that something hides or that lies beyond the border.
    pub fn hidden_share(&self) -> f64 {
        (self.n_hidden + self.n_outside) as f64 / self.n_shown.max(1) as f64
    }

    /// All of it in shares, with the probability for an object of a diameter (metres).
    pub fn summary(&self, diameter: f64) -> PoseEvidence {
        PoseEvidence {
            visible_share: self.visible_share(),
            hidden_share: self.hidden_share(),
            through_share: self.through_share(),
            outline_share: self.outline_share(),
            residual: (self.n_here > 0).then_some(self.residual),
            probability: probability(self, diameter),
        }
    }
}
