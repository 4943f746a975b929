//! Which pairs of a robot's links are checked against each other, and why the others are not.

use std::fmt;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_robot::{Arm, Srdf};

use super::body::body_gap;
use super::moving_body::MovingBody;

/// Pairs that touch in at least this share of all samples are held to touch always: neighbours whose shapes overlap,
/// meshes that are too fat.
const OFTEN: f64 = 0.95;

/// Two links that are not checked against each other.
#[derive(Clone, Debug, PartialEq)]
pub struct SkippedPair {
    /// Their names.
    pub links: [String; 2],
    /// Why.
    pub reason: SkipReason,
}

/// Why two links are not checked against each other.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SkipReason {
    /// No joint of the arm is between them.
    Fixed,
    /// One joint is between them.
    Adjacent,
    /// They touch in so large a share of all samples that it must be meant: 0.95 to 1.
    Often(f64),
    /// They touch in none of the samples.
    Never,
    /// The SRDF says so, for this reason.
    Srdf(String),
}

impl fmt::Display for SkipReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => f.write_str("fixed to each other"),
            Self::Adjacent => f.write_str("adjacent"),
            Self::Often(share) => write!(f, "touching in {:.1} % of the samples", 100.0 * share),
            Self::Never => f.write_str("touching in none of the samples"),
            Self::Srdf(reason) => write!(f, "disabled in the SRDF: {reason}"),
        }
    }
}

/// Pairs of links, by their places in the list of bodies.
pub(crate) struct Pairs {
    pub(crate) checked: Vec<[usize; 2]>,
    pub(crate) skipped: Vec<SkippedPair>,
}

impl Pairs {
    /// By an SRDF: what it does not disable is checked, but for links that are fixed to each other.
    pub(crate) fn by_srdf(bodies: &[MovingBody], srdf: &Srdf) -> Self {
        Self::sorted(bodies, |a, b| {
            let links = [a.link.min(b.link), a.link.max(b.link)];
            let disabled = srdf.disabled.iter().find(|pair| pair.links == links);
            disabled.map(|pair| SkipReason::Srdf(pair.reason.clone()))
        })
    }

    /// By random states of the arm within its limits: `n_samples` of them. A joint without limits turns once around.
    pub(crate) fn by_samples(
        arm: &Arm,
        bodies: &[MovingBody],
        contact: f64,
        n_samples: usize,
        seed: u64,
    ) -> Self {
        let adjacent = |a: &MovingBody, b: &MovingBody| {
            is_adjacent(arm, bodies, a, b).then_some(SkipReason::Adjacent)
        };
        let Self { checked, mut skipped } = Self::sorted(bodies, adjacent);
        let touching = count_touching(arm, bodies, &checked, contact, n_samples, seed);
        let mut kept = Vec::new();
        for (&pair, &n) in checked.iter().zip(&touching) {
            let share = n as f64 / n_samples.max(1) as f64;
            let reason = match n {
                _ if n_samples == 0 => None,
                0 => Some(SkipReason::Never),
                _ if share >= OFTEN => Some(SkipReason::Often(share)),
                _ => None,
            };
            match reason {
                Some(reason) => {
                    let links = pair.map(|body| bodies[body].name.clone());
                    skipped.push(SkippedPair { links, reason });
                }
                None => kept.push(pair),
            }
        }
        Self { checked: kept, skipped }
    }

    fn sorted(
        bodies: &[MovingBody],
        skip: impl Fn(&MovingBody, &MovingBody) -> Option<SkipReason>,
    ) -> Self {
        let mut pairs = Self { checked: Vec::new(), skipped: Vec::new() };
        for (i, a) in bodies.iter().enumerate() {
            for (j, b) in bodies.iter().enumerate().skip(i + 1) {
                let reason = if a.is_fixed_to(b) { Some(SkipReason::Fixed) } else { skip(a, b) };
                match reason {
                    Some(reason) => {
                        let links = [a.name.clone(), b.name.clone()];
                        pairs.skipped.push(SkippedPair { links, reason });
                    }
                    None => pairs.checked.push([i, j]),
                }
            }
        }
        pairs
    }
}

/// Whether one is the next link above the other that has a shape.
fn is_adjacent(arm: &Arm, bodies: &[MovingBody], a: &MovingBody, b: &MovingBody) -> bool {
    let robot = arm.robot();
    let above = |mut link: usize| {
        while let Some(joint) = robot.joint_to(link) {
            link = robot.joints[joint].parent;
            if bodies.iter().any(|body| body.link == link) {
                return Some(link);
            }
        }
        None
    };
    above(a.link) == Some(b.link) || above(b.link) == Some(a.link)
}

fn count_touching(
    arm: &Arm,
    bodies: &[MovingBody],
    pairs: &[[usize; 2]],
    contact: f64,
    n_samples: usize,
    seed: u64,
) -> Vec<usize> {
    let mut counts = vec![0; pairs.len()];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut poses = Vec::new();
    for _ in 0..n_samples {
        let q: Vec<f64> = arm
            .joints()
            .iter()
            .map(|joint| {
                let share: f64 = random.random();
                let turn = std::f64::consts::PI;
                let (lower, upper) = (joint.lower.max(-turn), joint.upper.min(turn));
                // Slides and ranges beyond a turn are taken as they are.
                let [lower, upper] = if joint.lower.is_finite() && joint.upper.is_finite() {
                    [joint.lower, joint.upper]
                } else {
                    [lower, upper]
                };
                lower + share * (upper - lower)
            })
            .collect();
        arm.link_poses(&q, &mut poses);
        let frames: Vec<_> = bodies.iter().map(|body| body.frame(&poses)).collect();
        for (&[a, b], count) in pairs.iter().zip(&mut counts) {
            let gap = body_gap(&bodies[a].body, &frames[a], &bodies[b].body, &frames[b], contact);
            *count += usize::from(gap < contact);
        }
    }
    counts
}
