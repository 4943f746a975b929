//! The search behind [`find_grasps`](crate::find_grasps): each candidate through every stage, then
//! the neighbours of what survived.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use parry3d_f64::math::Pose;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::math::DVec3;

use crate::Result;
use crate::antipodal::antipodal;
use crate::candidate::Candidate;
use crate::collision::{Collision, Fit};
use crate::contact::{Closing, TOUCH_GAP, close_on, widened};
use crate::force_closure::widest_angle;
use crate::gpg::Gpg;
use crate::grasp::Grasp;
use crate::gripper_geometry::GripperGeometry;
use crate::neighbours::neighbours;
use crate::object::{Body, GraspObject, Region, Surface};
use crate::refine::CLIMBERS;
use crate::rejection::{Miss, Reason, Refusal, Rejected};
use crate::scene::Scene;
use crate::score::{Score, Scorer};
use crate::select::suppress;
use crate::settings::GraspSettings;

/// Contacts must lie inside the friction cone by this share of its half-angle: another program
/// computes other normals.
const CONE_SHARE: f64 = 0.97;

/// What one seed, or all of them, gave.
#[derive(Default)]
pub(crate) struct Sampled {
    grasps: Vec<Grasp>,
    pub(crate) rejected: Rejected,
    /// By reason, what missed by least.
    nearest: [Option<Near>; Reason::ALL.len()],
    pub(crate) n_candidates: usize,
}

/// What stays of the candidates: grasps apart from each other, best first.
pub(crate) struct Found {
    pub(crate) kept: Vec<Grasp>,
    pub(crate) n_survivors: usize,
    pub(crate) sampled: Sampled,
}

/// A refused candidate, as far as it came.
#[derive(Clone)]
pub(crate) struct Near {
    refusal: Refusal,
    candidate: Candidate,
    closing: Option<Closing>,
}

impl Near {
    fn boxed(refusal: Refusal, candidate: &Candidate, closing: Option<&Closing>) -> Box<Self> {
        Box::new(Self { refusal, candidate: *candidate, closing: closing.cloned() })
    }
}

pub(crate) struct Search<'a> {
    object: &'a GraspObject,
    region: &'a Region,
    gripper: &'a GripperGeometry,
    settings: &'a GraspSettings,
    collision: Collision<'a>,
    scorer: Scorer<'a>,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        object: &'a GraspObject,
        region: &'a Region,
        gripper: &'a GripperGeometry,
        scene: &'a Scene,
        settings: &'a GraspSettings,
    ) -> Self {
        let down = scene.table().map(|table| -table.normal);
        let scorer = Scorer::new(object, gripper, settings, down);
        let collision = Collision::new(object, scene, gripper, settings);
        Self { object, region, gripper, settings, collision, scorer }
    }

    pub(crate) fn object(&self) -> &GraspObject {
        self.object
    }

    pub(crate) fn settings(&self) -> &GraspSettings {
        self.settings
    }

    pub(crate) fn run(&self, task: &Task) -> Result<Sampled> {
        let n_samples = self.settings.n_samples;
        let done = AtomicUsize::new(0);
        let parts: Vec<Sampled> = (0..n_samples)
            .into_par_iter()
            .map_init(
                || {
                    let gpg = Gpg::new(self.object, self.gripper, self.settings.friction);
                    (gpg, Vec::new())
                },
                |(gpg, candidates), i| {
                    candidates.clear();
                    let sampled = self.sample(i as u64, gpg, candidates);
                    task.step("examine", done.fetch_add(1, Ordering::Relaxed) + 1, n_samples)?;
                    Ok(sampled)
                },
            )
            .collect::<Result<_>>()?;
        let mut all = Sampled::default();
        parts.into_iter().for_each(|part| all.absorb(part));
        Ok(all)
    }

    /// One seed of the region: on a mesh, antipodal pairs and GPG take turns.
    fn sample(&self, i: u64, gpg: &mut Gpg<'_>, candidates: &mut Vec<Candidate>) -> Sampled {
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(i + 1);
        let seed = self.region.draw(self.object, &mut rng);
        let on_mesh = matches!(self.object.surface(), Surface::Mesh { .. });
        let mut sampled = Sampled::default();
        if on_mesh && i.is_multiple_of(2) {
            let friction = self.settings.friction;
            antipodal(self.object, self.gripper, &seed, friction, &mut rng, candidates);
        } else {
            let refused = gpg.grow(&seed, candidates);
            sampled.n_candidates += refused;
            sampled.rejected.add(Reason::ForceClosure, refused);
        }
        if candidates.is_empty() && sampled.n_candidates == 0 {
            sampled.n_candidates = 1;
            sampled.rejected.add(Reason::NoContact, 1);
        }
        sampled.n_candidates += candidates.len();
        for candidate in candidates.iter() {
            sampled.record(self.examine(candidate));
        }
        sampled
    }

    /// Merges near grasps and tries the neighbours of those that stay, and theirs again.
    pub(crate) fn add_neighbours(&self, mut sampled: Sampled, task: &Task) -> Result<Found> {
        let separation = self.settings.separation;
        let mut n_survivors = sampled.grasps.len();
        let mut kept = suppress(std::mem::take(&mut sampled.grasps), separation);
        let mut frontier = kept.clone();
        let rounds = self.settings.neighbour_rounds;
        for round in 0..rounds {
            task.step("spread", round, rounds)?;
            let least = self.least_returned(&kept);
            let mut part = Sampled::default();
            let candidates = neighbours(&frontier, &kept, separation);
            part.n_candidates = candidates.len();
            let results: Vec<_> = candidates
                .par_iter()
                .map(|candidate| task.check().map(|()| self.examine_above(candidate, least)))
                .collect::<std::result::Result<_, _>>()?;
            results.into_iter().for_each(|result| part.record(result));
            n_survivors += part.grasps.len();
            let before: HashSet<PoseBits> = kept.iter().map(pose_bits).collect();
            kept.append(&mut part.grasps);
            kept = suppress(kept, separation);
            frontier =
                kept.iter().filter(|grasp| !before.contains(&pose_bits(grasp))).cloned().collect();
            sampled.absorb(part);
        }
        Ok(Found { kept: self.merged(kept), n_survivors, sampled })
    }

    /// The score that a grasp must reach to be returned, as far as is known: of `kept` (best first) so many reach it
    /// that enough are left where all that climb become one, or half of those examined on the object as it is fail.
    fn least_returned(&self, kept: &[Grasp]) -> f64 {
        let GraspSettings { top, diversity, .. } = *self.settings;
        let wanted = self.n_examined_exactly().map_or(top, |n| n.saturating_mul(2));
        let last = wanted.saturating_add(CLIMBERS);
        let of_last = kept.iter().filter(|grasp| grasp.is_scored()).nth(last - 1);
        of_last.map_or(f64::NEG_INFINITY, |grasp| (1.0 - diversity) * grasp.score)
    }

    /// Near ones merged, with the scores of those that may be returned; the others keep their bounds. Best first.
    pub(crate) fn merged(&self, mut grasps: Vec<Grasp>) -> Vec<Grasp> {
        loop {
            grasps = suppress(grasps, self.settings.separation);
            let least = self.least_returned(&grasps);
            let may_be_returned = |grasp: &Grasp| !grasp.is_scored() && grasp.score >= least;
            if !grasps.iter().any(may_be_returned) {
                return grasps;
            }
            // What is scored may hide others, or be less than was thought: then more may be returned.
            let examined = grasps.into_par_iter().filter_map(|grasp| {
                if may_be_returned(&grasp) {
                    self.examine(&Candidate::from_grasp(&grasp)).ok()
                } else {
                    Some(grasp)
                }
            });
            grasps = examined.collect();
        }
    }

    /// The stages, cheap ones first.
    pub(crate) fn examine(&self, candidate: &Candidate) -> std::result::Result<Grasp, Box<Near>> {
        self.examine_above(candidate, f64::NEG_INFINITY)
    }

    /// [`Search::examine`], but where the score cannot reach `least` the grasp has a bound of it instead, and no terms.
    pub(crate) fn examine_above(
        &self,
        candidate: &Candidate,
        least: f64,
    ) -> std::result::Result<Grasp, Box<Near>> {
        self.approach(candidate).map_err(|refusal| Near::boxed(refusal, candidate, None))?;
        let mut closing = self.closed(candidate, self.object.touched(), self.region.touched())?;
        let refused = |refusal, closing: &Closing| Near::boxed(refusal, candidate, Some(closing));
        let angle = self.contacts(&closing).map_err(|refusal| refused(refusal, &closing))?;
        if let Some(reach) = self.object.deviation() {
            closing = widened(closing, self.object.exact(), self.gripper, reach);
        }
        self.examine_closed(&closing, angle, least).map_err(|refusal| refused(refusal, &closing))
    }

    /// The stages on the surface that answers are of.
    pub(crate) fn examine_pose(
        &self,
        candidate: &Candidate,
    ) -> std::result::Result<Grasp, Box<Near>> {
        if self.object.is_simplified() {
            self.examine_as_is(candidate)
        } else {
            self.examine(candidate)
        }
    }

    /// The stages on the object as it is, for a grasp that was found on a simpler surface.
    pub(crate) fn examine_exactly(&self, grasp: &Grasp) -> std::result::Result<Grasp, Box<Near>> {
        let ends = grasp.contacts.map(|contact| (grasp.object_from_tcp.inverse() * contact).y);
        let seed = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        self.examine_as_is(&Candidate { tcp: grasp.object_from_tcp, seed })
    }

    fn examine_as_is(&self, candidate: &Candidate) -> std::result::Result<Grasp, Box<Near>> {
        self.approach(candidate).map_err(|refusal| Near::boxed(refusal, candidate, None))?;
        let closing = self.closed(candidate, self.object.exact(), self.region.given())?;
        self.contacts(&closing)
            .and_then(|angle| self.examine_closed(&closing, angle, f64::NEG_INFINITY))
            .map_err(|refusal| Near::boxed(refusal, candidate, Some(&closing)))
    }

    fn closed(
        &self,
        candidate: &Candidate,
        body: &Body,
        weights: &[f64],
    ) -> std::result::Result<Closing, Box<Near>> {
        let compliance = self.settings.compliance;
        let Candidate { tcp, seed } = candidate;
        close_on(body, weights, self.gripper, tcp, *seed, compliance)
            .ok_or_else(|| Near::boxed(Reason::NoContact.into(), candidate, None))
    }

    /// The stages after the contacts are found good.
    fn examine_closed(
        &self,
        closing: &Closing,
        angle: f64,
        least: f64,
    ) -> std::result::Result<Grasp, Refusal> {
        self.width(closing)?;
        self.collision.above_table(closing)?;
        let fit = self.collision.fit(closing)?;
        let unknown = least > f64::NEG_INFINITY;
        let bound = unknown.then(|| self.scorer.at_most(closing, &fit, angle));
        let score = match bound.filter(|bound| *bound < least) {
            Some(bound) => Score::of_bound(bound),
            None => self.scorer.score(closing, &fit, angle),
        };
        Ok(self.grasp(closing, &fit, score))
    }

    fn approach(&self, candidate: &Candidate) -> std::result::Result<(), Refusal> {
        let Some(cone) = self.settings.limits.approach else {
            return Ok(());
        };
        let beyond = (candidate.tcp.rotation * DVec3::Z).angle_between(cone.axis) - cone.half_angle;
        Refusal::where_positive(Reason::Approach, beyond)
    }

    fn width(&self, closing: &Closing) -> std::result::Result<(), Refusal> {
        let opening = self.gripper.opening();
        let asked = self.settings.limits.width.clone().unwrap_or(0.0..=f64::INFINITY);
        let least = opening.start().max(*asked.start());
        let most = (opening.end() - 2.0 * TOUCH_GAP).min(*asked.end());
        let beyond = (least - closing.width).max(closing.width - most);
        Refusal::where_positive(Reason::Width, beyond)
    }

    /// Patches, force closure and region; returns the widest contact angle.
    fn contacts(&self, closing: &Closing) -> std::result::Result<f64, Refusal> {
        let limits = &self.settings.limits;
        let bare = limits.pad_in_contact - self.scorer.pad_share(closing);
        Refusal::where_positive(Reason::Contact, bare)?;
        let angle = widest_angle(&closing.patches, closing.tcp.rotation * DVec3::Y);
        let beyond = angle - CONE_SHARE * self.settings.friction.atan();
        Refusal::where_positive(Reason::ForceClosure, beyond)?;
        let [left, right] = &closing.patches;
        let outside = limits.pad_in_region - left.region.min(right.region);
        if outside > 1e-9 {
            return Err(Refusal { reason: Reason::Region, by: outside });
        }
        Ok(angle)
    }

    fn grasp(&self, closing: &Closing, fit: &Fit, score: Score) -> Grasp {
        Grasp {
            object_from_tcp: closing.tcp,
            width: fit.width,
            opening: fit.opening,
            contacts: closing.patches.map(|patch| patch.contact),
            normals: closing.patches.map(|patch| patch.normal),
            epsilon: score.epsilon,
            closing_turn: score.closing_turn,
            score: score.score,
            hold: score.hold,
            terms: score.terms,
        }
    }

    /// A refused candidate as a grasp, with what is known of it.
    pub(crate) fn miss(&self, near: Near) -> Miss {
        let Near { refusal: Refusal { reason, by }, candidate, closing } = near;
        let widest = *self.gripper.opening().end();
        let by = match (&closing, reason) {
            (Some(closing), reason)
                if reason >= Reason::Collision && reason != Reason::Clearance =>
            {
                self.collision.back_off(closing)
            }
            _ => by,
        };
        let seed = candidate.seed;
        let closing_axis = candidate.tcp.rotation * DVec3::Y;
        let (tcp, width, contacts, normals) = closing.map_or_else(
            || {
                let ends = seed.map(|y| candidate.tcp * (DVec3::Y * y));
                (candidate.tcp, seed[1] - seed[0], ends, [-closing_axis, closing_axis])
            },
            |closing| {
                let patches = closing.patches;
                (closing.tcp, closing.width, patches.map(|p| p.contact), patches.map(|p| p.normal))
            },
        );
        let grasp = Grasp {
            object_from_tcp: tcp,
            width,
            opening: widest,
            contacts,
            normals,
            epsilon: 0.0,
            closing_turn: 0.0,
            score: 0.0,
            hold: None,
            terms: Vec::new(),
        };
        Miss { reason, by, grasp }
    }
}

/// A pose to the last bit, for a set.
type PoseBits = ([u64; 3], [u64; 4]);

fn pose_bits(grasp: &Grasp) -> PoseBits {
    let Pose { translation, rotation } = grasp.object_from_tcp;
    (translation.to_array().map(f64::to_bits), rotation.to_array().map(f64::to_bits))
}

impl Sampled {
    fn record(&mut self, result: std::result::Result<Grasp, Box<Near>>) {
        match result {
            Ok(grasp) => self.grasps.push(grasp),
            Err(near) => self.refuse(*near),
        }
    }

    pub(crate) fn refuse(&mut self, near: Near) {
        self.rejected.add(near.refusal.reason, 1);
        self.consider(near);
    }

    /// Of the candidates refused for the main reason the one that missed by least.
    pub(crate) fn nearest(&mut self) -> Option<Near> {
        let main = self.rejected.main_reason(self.n_candidates)?;
        // Seeds without any candidate have the reason but no pose: the nearest of the latest stage with one is returned then.
        let of_main = self.nearest[main as usize].take();
        of_main.or_else(|| self.nearest.iter_mut().rev().find_map(Option::take))
    }

    fn absorb(&mut self, part: Self) {
        self.grasps.extend(part.grasps);
        self.rejected.merge(&part.rejected);
        self.n_candidates += part.n_candidates;
        part.nearest.into_iter().flatten().for_each(|near| self.consider(near));
    }

    /// All grasps of the samples, near ones too, as the answer.
    pub(crate) fn into_found(mut self) -> Found {
        let kept = std::mem::take(&mut self.grasps);
        Found { n_survivors: kept.len(), kept, sampled: self }
    }

    /// Keeps, for each reason, what missed by least, of that the first.
    fn consider(&mut self, near: Near) {
        let best = &mut self.nearest[near.refusal.reason as usize];
        if best.as_ref().is_none_or(|best| near.refusal.by < best.refusal.by) {
            *best = Some(near);
        }
    }
}
