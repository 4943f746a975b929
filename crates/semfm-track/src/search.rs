//! Finding an object again, some hypotheses a frame.

use rayon::prelude::*;
use semfm_align::{Sim3, super_fibonacci};
use semfm_geom::math::{DQuat, DVec3};

use crate::depth_view::DepthView;
use crate::evidence::Evidence;
use crate::foreground::{Foreground, foreground};
use crate::model::TrackModel;
use crate::motion::{matrix, twist_between};
use crate::outline::{GRAZING, Shown};
use crate::register::{Start, register};

/// Rotations that are tried, spread over all of them: none is farther than some 40° from one.
const N_ROTATIONS: usize = 240;

/// Steps of the turns of the last pose about the normals of planes, degrees, which are tried first: what is moved on a table
/// mostly turns so.
const TABLE_STEP: usize = 15;

/// Turns of the last pose that are tried after those, degrees, about the axes of a cube's faces.
const TURNS: [f64; 2] = [25.0, 50.0];

/// Every so many-th sample takes part: 100 in all, half of which face the camera.
const EVERY: usize = 16;

/// Width of the first kernel, as a share of the diameter.
const WIDTH: f64 = 0.15;

/// Poses that are kept from one frame to the next, and made better there.
const KEPT: usize = 6;

/// Poses that place the surface closer than this, in shares of its radius, are one pose.
const SAME: f64 = 0.15;

/// Frames in which a pose that did not stand a closer look is not looked at again: others get their turn.
const REFUTED_FRAMES: usize = 20;

/// A piece wider than this many diameters is cut up.
const MOST_PIECE: f64 = 1.4;

/// Pieces of the foreground in which it is sought: the largest, and more of them while nobody waits.
const PIECES: usize = 6;
const FIRST_PIECES: usize = 12;

/// So many times the hypotheses of a frame are tried in each frame until the object is found for the first time: nothing is
/// lost yet that should be answered soon.
const FIRST_HYPOTHESES: usize = 12;

/// A search that goes on from frame to frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Search {
    /// How many of the rotations were tried.
    tried: usize,
    /// The best poses so far.
    kept: Vec<Sim3>,
    /// Poses that did not stand a closer look, with the frames that have passed since.
    refuted: Vec<Refuted>,
}

/// A pose that looked well to a hundred samples and was none.
#[derive(Clone, Copy, Debug)]
struct Refuted {
    pose: Sim3,
    n_frames: usize,
}

/// What a search may use in one frame.
pub(crate) struct SearchFrame<'a> {
    pub model: &'a TrackModel,
    pub view: &'a DepthView<'a>,
    /// Pixels of the object, where they are known.
    pub mask: Option<&'a [bool]>,
    /// Where it was last, or is expected.
    pub last: Option<Sim3>,
    /// Standard deviation of the depth, metres.
    pub noise: f64,
    /// Hypotheses in this frame.
    pub budget: usize,
    /// Whether it was never found.
    pub is_first: bool,
    pub seed: u64,
}

impl Search {
    /// Expresses the kept poses in the frame of another camera.
    pub fn seen_from(&mut self, now_from_before: &Sim3) {
        let refuted = self.refuted.iter_mut().map(|refuted| &mut refuted.pose);
        self.kept.iter_mut().chain(refuted).for_each(|pose| *pose = *now_from_before * *pose);
    }

    /// Makes way for others in the place of a pose that did not stand a closer look.
    pub fn refute(&mut self, pose: &Sim3) {
        self.kept.retain(|kept| kept != pose);
        self.refuted.push(Refuted { pose: *pose, n_frames: 0 });
    }

    /// Tries the next hypotheses, and the best of the frames before; the best first.
    pub fn frame(&mut self, at: &SearchFrame<'_>) -> Vec<Sim3> {
        self.refuted.iter_mut().for_each(|refuted| refuted.n_frames += 1);
        self.refuted.retain(|refuted| refuted.n_frames < REFUTED_FRAMES);
        let most = MOST_PIECE * at.model.diameter();
        let (n_pieces, budget) = match at.is_first {
            true => (FIRST_PIECES, FIRST_HYPOTHESES * at.budget),
            false => (PIECES, at.budget),
        };
        let Foreground { pieces, planes, .. } =
            foreground(at.view, at.mask, most, n_pieces, at.seed);
        let mut starts: Vec<Sim3> = self.kept.clone();
        let rotations = rotations(at.last.as_ref(), &planes);
        let n_places = pieces.len() + usize::from(at.last.is_some());
        if n_places > 0 {
            for _ in 0..budget.div_ceil(n_places).min(rotations.len()) {
                let rotation = rotations[self.tried % rotations.len()];
                self.tried += 1;
                starts.extend(at.last.map(|last| Sim3 { rotation, ..last }));
                let before = |middle: DVec3| behind(at.model, rotation, middle);
                starts.extend(pieces.iter().map(|piece| before(piece.middle)));
            }
        }
        let mut found: Vec<(f64, Sim3)> =
            starts.par_iter().filter_map(|start| refined(at, *start)).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        self.kept.clear();
        for (_, pose) in found {
            let mut others = self.kept.iter().chain(self.refuted.iter().map(|r| &r.pose));
            let is_new = others.all(|other| {
                let twist = twist_between(other, &pose);
                let shift = twist.fixed_rows::<3>(0).norm() / at.model.radius;
                shift + twist.fixed_rows::<3>(3).norm() > SAME
            });
            if is_new {
                self.kept.push(pose);
            }
            if self.kept.len() == KEPT {
                break;
            }
        }
        self.kept.clone()
    }

    /// Bytes that it keeps.
    pub fn bytes(&self) -> usize {
        KEPT * size_of::<Sim3>() + self.refuted.len() * size_of::<Refuted>()
    }
}

/// Those around the last one first, on the table and then in any direction.
fn rotations(last: Option<&Sim3>, planes: &[DVec3]) -> Vec<DQuat> {
    let on_table = last.into_iter().flat_map(|last| {
        let steps = (TABLE_STEP..=180).step_by(TABLE_STEP).map(|degrees| degrees as f64);
        steps.flat_map(move |degrees| {
            planes.iter().flat_map(move |&normal| {
                [degrees, -degrees]
                    .map(|turn| DQuat::from_axis_angle(normal, turn.to_radians()) * last.rotation)
            })
        })
    });
    let around = last.into_iter().flat_map(|last| {
        let turns = TURNS.into_iter().flat_map(|degrees: f64| {
            [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(move |axis| {
                [degrees, -degrees].map(|turn| DQuat::from_axis_angle(axis, turn.to_radians()))
            })
        });
        turns.map(|turn| turn * last.rotation)
    });
    let same = last.map(|last| last.rotation);
    same.into_iter().chain(on_table).chain(around).chain(super_fibonacci(N_ROTATIONS)).collect()
}

/// The pose of a rotation that brings the middle of the side that is seen to a place.
fn behind(model: &TrackModel, rotation: DQuat, middle: DVec3) -> Sim3 {
    let sight = rotation.conjugate() * middle.normalize_or(DVec3::Z);
    let (mut sum, mut n) = (DVec3::ZERO, 0.0);
    for sample in model.samples.iter().step_by(EVERY) {
        if sample.normal.dot(sight) < -GRAZING {
            (sum, n) = (sum + sample.point, n + 1.0);
        }
    }
    let seen = if n > 0.0 { sum / n } else { DVec3::ZERO };
    Sim3 { scale: 1.0, rotation, translation: middle - rotation * seen }
}

/// A start made better, and how much it explains.
fn refined(at: &SearchFrame<'_>, start: Sim3) -> Option<(f64, Sim3)> {
    let model = at.model;
    let ids = (0..model.samples.len() as u32).step_by(EVERY);
    let all = Shown { samples: ids.collect(), ..Default::default() };
    let width = WIDTH * model.diameter();
    let start = Start { pose: start, width, noise: at.noise };
    let found = register(model, at.view, &all, &start)?;
    let turn = matrix(&found.pose);
    let facing = |&id: &u32| {
        let sample = &model.samples[id as usize];
        let place = turn * sample.point + found.pose.translation;
        let cosine = -(turn * sample.normal).dot(place) / place.length();
        (if model.both_sides { cosine.abs() } else { cosine }) >= GRAZING
    };
    let samples: Vec<u32> = all.samples.iter().copied().filter(facing).collect();
    let n_facing = samples.len();
    let shown = Shown { samples, ..Default::default() };
    let noise = found.noise.min(2.0 * at.noise);
    let evidence = Evidence::of(model, at.view, &shown, &found.pose, noise);
    let unknown = n_facing - evidence.n_here - evidence.n_hidden - evidence.n_through;
    let against = evidence.n_through as f64 + (evidence.n_hidden + unknown) as f64 / 3.0;
    let score = evidence.n_here as f64 / (evidence.n_here as f64 + against).max(1.0);
    Some((score, found.pose))
}
