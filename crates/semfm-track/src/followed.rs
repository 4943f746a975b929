//! An object of known size from frame to frame.

use nalgebra::Matrix3;
use semfm_align::Sim3;
use semfm_geom::math::DVec3;
use semfm_geom::{Mesh, Task};

use crate::Result;
use crate::depth_view::DepthView;
use crate::evidence::Evidence;
use crate::model::TrackModel;
use crate::motion::{
    Matrix6, Twist, covariance_about_origin, moved, of_inner, of_mesh, twist_between,
};
use crate::outline::Shown;
use crate::probability::{LEAST_SEEN, probability};
use crate::record::{RegionRecord, TrackRecord, TrackState};
use crate::register::{Registration, Start, register};
use crate::search::{Search, SearchFrame};
use crate::settings::TrackSettings;
use crate::surface_memory::SurfaceMemory;
use crate::tracker::{DepthFrame, Examined};
use crate::uncertainty::{after_a_frame, covariance, greatest_std};

/// Standard deviation of the depth before any frame told, metres.
const FIRST_NOISE: f64 = 0.002;

/// Share of a frame's noise in what is known of the noise.
const NOISE_GAIN: f64 = 0.1;

/// Width of the first kernel while an object is followed, as a share of its diameter, metres at least: it moves so far from
/// one frame to the next, and what stands so far before it is something else.
const WIDTH: f64 = 0.1;
const LEAST_WIDTH: f64 = 0.01;

/// A pose that moved more than this (metres, or radians of the radius) while it was registered shows other samples.
const SHOWS_OTHERS: f64 = 0.004;

/// Probability from which a pose counts as seen where it was expected, and from which it is believed elsewhere.
const SEEN: f64 = 0.5;
const FOUND: f64 = 0.8;

/// Share of the surface that must be seen for either.
const SEEN_SHARE: f64 = 0.1;
const FOUND_SHARE: f64 = 0.3;

/// Points of the outline at which the depth must jump before an object is believed where it was not followed to: a flat thing
/// lies in any wall.
const FOUND_JUMPS: usize = 5;

/// Of what was seen or looked through, the share that may be looked through where it is found by search, and the share of the outline at which the
/// depth must jump: a mug that is away was found in a box with .37 and .6; where it is they are .01 and .95.
const FOUND_THROUGH: f64 = 0.1;
const FOUND_OUTLINE: f64 = 0.7;

/// An object of which this share is hidden, and of what is not less than this share is looked through, is not contradicted.
const HIDDEN_SHARE: f64 = 0.5;
const CONTRADICTED: f64 = 0.4;

/// The probability that an object is still where it was, from one hidden frame to the next: it is moved now and then.
const STAYS: f64 = 0.99;

/// Poses of the search that are looked at closely in a frame.
const LOOKED_AT: usize = 3;

/// An object whose size is known.
pub(crate) struct Followed {
    pub model: TrackModel,
    pub memory: SurfaceMemory,
    search: Search,
    /// World from the inner frame, where it was seen last or is expected.
    pub last: Option<Sim3>,
    /// Camera from world of the frame before.
    camera_before: Option<Sim3>,
    /// Whether `last` was seen in some frame, and not only given.
    was_seen: bool,
    /// Motion of the last frame, where the two before it were seen.
    velocity: Option<Twist>,
    covariance: Matrix6,
    probability: f64,
    pub noise: f64,
    state: TrackState,
}

/// A pose looked at closely.
struct Attempt {
    shown: Shown,
    registration: Registration,
    evidence: Evidence,
    probability: f64,
}

impl Followed {
    pub fn new(
        mesh: &Mesh,
        scale: f64,
        settings: &TrackSettings,
        region: Option<&[f64]>,
        task: &Task,
    ) -> Result<Self> {
        let model = TrackModel::new(mesh, scale, settings.seed, task)?;
        let memory = SurfaceMemory::new(&model, region);
        Ok(Self {
            model,
            memory,
            search: Search::default(),
            last: None,
            camera_before: None,
            was_seen: false,
            velocity: None,
            covariance: Matrix6::identity(),
            probability: 0.0,
            noise: FIRST_NOISE,
            state: TrackState::Lost,
        })
    }

    /// The next frame.
    pub fn follow(
        &mut self,
        number: usize,
        frame: &DepthFrame<'_>,
        view: &DepthView<'_>,
        camera_from_world: &Sim3,
        settings: &TrackSettings,
    ) -> Result<TrackRecord> {
        if let Some(before) = self.camera_before.replace(*camera_from_world) {
            self.seen_from(&(*camera_from_world * before.inverse()));
        }
        let expected = self.last.map(|last| *camera_from_world * last);
        let near = expected.and_then(|expected| self.look_near(view, &expected));
        let seen = near.filter(|attempt| {
            let evidence = &attempt.evidence;
            // What comes back from behind something may have moved there.
            let is_enough = match self.state.is_seen() {
                true => evidence.visible_share() >= SEEN_SHARE,
                false => is_distinct(evidence),
            };
            attempt.probability >= SEEN && is_enough
        });
        if let Some(attempt) = seen {
            let state = match self.state {
                _ if !self.was_seen => TrackState::New,
                TrackState::Lost => TrackState::Reacquired,
                _ => TrackState::Tracking,
            };
            return Ok(self.found(number, frame, view, camera_from_world, attempt, state));
        }
        let elsewhere = self.look_elsewhere(view, expected, frame.mask, number, settings);
        if let Some(attempt) = elsewhere {
            let state = if self.was_seen { TrackState::Reacquired } else { TrackState::New };
            return Ok(self.found(number, frame, view, camera_from_world, attempt, state));
        }
        self.velocity = None;
        self.memory.none_visible();
        Ok(self.not_seen(number, frame, view, expected))
    }

    /// Expresses what is kept along the axes of another camera.
    fn seen_from(&mut self, now_from_before: &Sim3) {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| now_from_before.rotation * axis);
        let turn = Matrix3::from_fn(|i, j| axes[j][i]);
        let mut both = Matrix6::zeros();
        both.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
        both.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        self.covariance = both * self.covariance * both.transpose();
        self.velocity = self.velocity.map(|velocity| both * velocity);
        self.search.seen_from(now_from_before);
    }

    /// A pose made better by a frame, and what the image says of it.
    pub fn examine(&self, view: &DepthView<'_>, camera_from_object: &Sim3) -> Option<Examined> {
        let model = &self.model;
        let start = of_inner(camera_from_object, model.centre);
        let width = (WIDTH * model.diameter()).max(LEAST_WIDTH);
        self.attempt(view, &start, width).map(|attempt| Examined {
            camera_from_object: of_mesh(&attempt.registration.pose, model.scale, model.centre),
            evidence: attempt.evidence.summary(model.diameter()),
        })
    }

    /// Bytes that are kept from one frame to the next, but for the tree over the triangles.
    pub fn kept_bytes(&self) -> usize {
        size_of::<Self>() + self.memory.bytes() + self.model.bytes() + self.search.bytes()
    }

    /// Registers from where it is expected: standing still, or moving on as it did.
    fn look_near(&self, view: &DepthView<'_>, expected: &Sim3) -> Option<Attempt> {
        let width = (WIDTH * self.model.diameter()).max(LEAST_WIDTH);
        let still = self.attempt(view, expected, width);
        let moves_on = self.velocity.filter(|velocity| self.way(velocity) > SHOWS_OTHERS);
        let is_clear = |attempt: &Attempt| attempt.probability >= FOUND;
        match (still, moves_on) {
            (Some(still), _) if is_clear(&still) => Some(still),
            (still, Some(velocity)) => {
                let on = self.attempt(view, &moved(expected, &velocity), width);
                still.into_iter().chain(on).max_by(|a, b| a.probability.total_cmp(&b.probability))
            }
            (still, None) => still,
        }
    }

    /// Some hypotheses of the search, the best of them looked at closely.
    fn look_elsewhere(
        &mut self,
        view: &DepthView<'_>,
        expected: Option<Sim3>,
        mask: Option<&[bool]>,
        number: usize,
        settings: &TrackSettings,
    ) -> Option<Attempt> {
        let at = SearchFrame {
            model: &self.model,
            view,
            mask,
            last: expected,
            noise: self.noise,
            budget: settings.hypotheses,
            is_first: !self.was_seen,
            seed: settings.seed.wrapping_add(number as u64),
        };
        let poses = self.search.frame(&at);
        let width = (0.5 * WIDTH * self.model.diameter()).max(LEAST_WIDTH);
        let looked_at = &poses[..poses.len().min(LOOKED_AT)];
        let attempts = looked_at.iter().filter_map(|pose| self.attempt(view, pose, width));
        let is_found = |found: &Attempt| {
            let evidence = &found.evidence;
            found.probability >= FOUND
                && is_distinct(evidence)
                && evidence.through_share() <= FOUND_THROUGH
                && evidence.outline_share() >= FOUND_OUTLINE
        };
        let best = attempts.filter(is_found).max_by(|a, b| a.probability.total_cmp(&b.probability));
        if best.is_none() {
            looked_at.iter().for_each(|pose| self.search.refute(pose));
        }
        best
    }

    /// How far a motion takes the farthest points of the object, metres.
    fn way(&self, twist: &Twist) -> f64 {
        twist.fixed_rows::<3>(0).norm() + self.model.radius * twist.fixed_rows::<3>(3).norm()
    }

    fn attempt(&self, view: &DepthView<'_>, pose: &Sim3, width: f64) -> Option<Attempt> {
        let mut shown = Shown::new(&self.model, view, pose);
        let start = Start { pose: *pose, width, noise: self.noise };
        let mut registration = register(&self.model, view, &shown, &start)?;
        let twist = twist_between(pose, &registration.pose);
        if self.way(&twist) > SHOWS_OTHERS {
            shown = Shown::new(&self.model, view, &registration.pose);
            let Registration { pose, noise, .. } = registration;
            let start = Start { pose, width: (0.5 * width).max(LEAST_WIDTH), noise };
            registration = register(&self.model, view, &shown, &start)?;
        }
        // A pose that explains its surroundings badly must not widen its own tolerance.
        let noise = registration.noise.min(2.0 * self.noise.max(FIRST_NOISE));
        let evidence = Evidence::of(&self.model, view, &shown, &registration.pose, noise);
        let probability = probability(&evidence, self.model.diameter());
        Some(Attempt { shown, registration, evidence, probability })
    }

    fn found(
        &mut self,
        number: usize,
        frame: &DepthFrame<'_>,
        view: &DepthView<'_>,
        camera_from_world: &Sim3,
        attempt: Attempt,
        state: TrackState,
    ) -> TrackRecord {
        let Attempt { shown, registration, evidence, probability } = attempt;
        let world_from_inner = camera_from_world.inverse() * registration.pose;
        let follows = self.state.is_seen() && state == TrackState::Tracking;
        self.velocity = self
            .last
            .filter(|_| follows)
            .map(|last| twist_between(&(*camera_from_world * last), &registration.pose));
        self.last = Some(world_from_inner);
        self.was_seen = true;
        self.noise += NOISE_GAIN * (registration.noise - self.noise);
        self.covariance = covariance(&self.model, view, &shown, &registration);
        self.probability = probability;
        self.state = state;
        self.search = Search::default();
        self.memory.take(&evidence);
        self.record(number, frame.time_nanos, Some(registration.pose), &evidence)
    }

    /// Hidden or lost, by what is seen where it should be.
    fn not_seen(
        &mut self,
        number: usize,
        frame: &DepthFrame<'_>,
        view: &DepthView<'_>,
        expected: Option<Sim3>,
    ) -> TrackRecord {
        let expected = expected.filter(|_| self.was_seen && self.state != TrackState::Lost);
        let evidence = expected.map(|pose| {
            let shown = Shown::new(&self.model, view, &pose);
            Evidence::of(&self.model, view, &shown, &pose, self.noise)
        });
        let is_hidden = evidence.as_ref().is_some_and(|evidence| {
            let few = evidence.n_here + evidence.n_through < LEAST_SEEN;
            evidence.hidden_share() >= HIDDEN_SHARE
                && (few || evidence.through_share() < CONTRADICTED)
        });
        if is_hidden {
            self.probability *= STAYS;
            self.covariance = after_a_frame(&self.covariance);
            self.state = TrackState::Occluded;
            return self.record(number, frame.time_nanos, expected, &evidence.unwrap_or_default());
        }
        self.probability = 0.0;
        self.state = TrackState::Lost;
        self.record(number, frame.time_nanos, None, &evidence.unwrap_or_default())
    }

    fn record(
        &self,
        frame: usize,
        time_nanos: Option<u64>,
        pose: Option<Sim3>,
        evidence: &Evidence,
    ) -> TrackRecord {
        let model = &self.model;
        let block = |at: usize| self.covariance.fixed_view::<3, 3>(at, at).into_owned();
        let covariance = pose.map(|pose| {
            let origin = -model.scale * (pose.rotation * model.centre);
            let about = covariance_about_origin(&self.covariance, origin);
            std::array::from_fn(|i| std::array::from_fn(|j| about[(i, j)]))
        });
        let region = self.memory.region(self.noise).map(|state| {
            let centre: Option<DVec3> = self.memory.region_centre(model);
            RegionRecord {
                confidence: state.confidence,
                visible_share: state.visible,
                observed_share: state.observed,
                deviation: state.deviation,
                centre: pose.zip(centre).map(|(pose, centre)| pose.apply(centre)),
            }
        });
        TrackRecord {
            frame,
            time_nanos,
            state: self.state,
            camera_from_object: pose.map(|pose| of_mesh(&pose, model.scale, model.centre)),
            probability: self.probability,
            covariance,
            position_std: pose.map(|_| greatest_std(block(0))),
            rotation_std: pose.map(|_| greatest_std(block(3)).min(std::f64::consts::PI)),
            evidence: evidence.summary(model.diameter()),
            region,
        }
    }
}

/// Whether enough is seen to believe an object where it was not followed to.
fn is_distinct(evidence: &Evidence) -> bool {
    evidence.visible_share() >= FOUND_SHARE && evidence.n_jumps >= FOUND_JUMPS
}
