//! What touches what at given joint values.

use std::cell::RefCell;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use super::body::{CollisionBody, Frame, body_gap};
use super::convex::depth;
use super::joint_frames::{JointFrame, JointFrames};
use super::model::CollisionModel;
use super::moving_body::{Carried, MovingBody, RigidGroup};
use super::scene::Scene;
use crate::planning::Contact;
use crate::{Error, Result};

/// Distances beyond this are as good as any, metres.
const FAR: f64 = 0.5;

/// A body that a link carries: a grasped object, a hand that is no part of the robot's description.
#[derive(Clone, Debug)]
pub struct AttachedBody {
    /// Its name, unlike those of links, obstacles and other bodies.
    pub name: String,
    /// The link that carries it.
    pub link: usize,
    /// Its place there.
    pub link_from_body: Pose,
    /// Its shape.
    pub body: CollisionBody,
    /// Names of links, obstacles and other attached bodies that it may touch.
    pub may_touch: Vec<String>,
}

/// Says what touches at given joint values: links against each other and against a scene, with bodies that links carry.
/// Joint limits are not its matter. Cheap to derive variants from: models, scenes and bodies are shared.
#[derive(Clone, Debug)]
pub struct CollisionChecker {
    model: Arc<CollisionModel>,
    scene: Scene,
    attached: Vec<AttachedBody>,
    allowed: Vec<[String; 2]>,
    /// Links with a shape, then attached bodies.
    pub(super) bodies: Arc<[MovingBody]>,
    joints: Arc<JointFrames>,
    /// The same bodies, by what moves them.
    pub(super) groups: Arc<[RigidGroup]>,
    pub(super) group_pairs: Vec<GroupPair>,
    pub(super) scene_pairs: Vec<ScenePair>,
}

/// Two groups, and which of their bodies are checked against each other.
#[derive(Clone, Debug)]
pub(super) struct GroupPair {
    pub(super) a: usize,
    pub(super) b: usize,
    /// Number of joints that move both alike.
    pub(super) common: usize,
    bodies: Vec<[usize; 2]>,
}

/// A group and an obstacle, and which of the group's bodies are checked against it.
#[derive(Clone, Debug)]
pub(super) struct ScenePair {
    pub(super) group: usize,
    obstacle: usize,
    bodies: Vec<usize>,
}

/// Memory of one thread for one question after the other.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) joints: Vec<JointFrame>,
    /// Frames of the bodies; only of groups that are marked as placed.
    frames: Vec<Frame>,
    /// Which groups' bodies have their frames: most groups are far from everything, and theirs are not asked for.
    placed: Vec<bool>,
    /// Centres of the groups' spheres.
    pub(super) centres: Vec<DVec3>,
    pub(super) carried: Vec<Carried>,
    pub(super) travel: Vec<f64>,
    pub(super) q: Vec<f64>,
    pub(super) open: std::collections::VecDeque<[f64; 2]>,
}

thread_local!(static SCRATCH: RefCell<Scratch> = RefCell::default());

/// Runs `work` with this thread's memory; nothing that `work` calls does so again.
pub(super) fn with_scratch<T>(work: impl FnOnce(&mut Scratch) -> T) -> T {
    SCRATCH.with_borrow_mut(work)
}

impl CollisionChecker {
    /// A robot in a scene.
    ///
    /// # Errors
    /// [`Error::Invalid`] where an obstacle has the name of a link.
    pub fn new(model: Arc<CollisionModel>, scene: Scene) -> Result<Self> {
        let bodies: Arc<[MovingBody]> = model.moving_bodies().into();
        let (attached, allowed) = (Vec::new(), Vec::new());
        let (groups, group_pairs, scene_pairs) = (Arc::default(), Vec::new(), Vec::new());
        let joints = Arc::new(JointFrames::new(model.arm()));
        Self { model, scene, attached, allowed, bodies, joints, groups, group_pairs, scene_pairs }
            .paired()
    }

    /// The same in another scene; what may touch stays.
    ///
    /// # Errors
    /// [`Error::Invalid`] where an obstacle has the name of a link or of an attached body.
    pub fn with_scene(&self, scene: Scene) -> Result<Self> {
        Self { scene, ..self.clone() }.paired()
    }

    /// The same with another model of the same robot, see [`CollisionModel::with_arm`].
    ///
    /// # Errors
    /// [`Error::Invalid`] where an obstacle or an attached body has the name of a link.
    pub fn with_model(&self, model: Arc<CollisionModel>) -> Result<Self> {
        let attached = self.attached.iter().map(|attached| attached.on(&model));
        let bodies = model.moving_bodies().iter().cloned().chain(attached).collect();
        let joints = Arc::new(JointFrames::new(model.arm()));
        Self { bodies, joints, model, ..self.clone() }.paired()
    }

    /// The same with a body that a link carries. It is checked against the scene, other bodies, and the links that move
    /// against it.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a link that the robot does not have, and a name that is taken.
    pub fn with_attached(&self, attached: AttachedBody) -> Result<Self> {
        if attached.link >= self.model.arm().robot().links.len() {
            return Err(Error::Invalid {
                what: format!("attached body `{}`: link", attached.name),
                expected: format!("one of {} links", self.model.arm().robot().links.len()),
                found: attached.link.to_string(),
            });
        }
        let bodies = self.bodies.iter().cloned().chain([attached.on(&self.model)]).collect();
        let attached = self.attached.iter().cloned().chain([attached]).collect();
        Self { bodies, attached, ..self.clone() }.paired()
    }

    /// The same without any attached body.
    pub fn without_attached(&self) -> Result<Self> {
        let bodies = self.model.moving_bodies().into();
        Self { bodies, attached: Vec::new(), ..self.clone() }.paired()
    }

    /// The same where two things, named, may touch: a finger and the object, the object and the table it stands on.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a name that nothing has.
    pub fn allowing(&self, a: &str, b: &str) -> Result<Self> {
        for name in [a, b] {
            let is_body = self.bodies.iter().any(|body| body.name == name);
            let is_link = self.model.arm().robot().link(name).is_some();
            if !(is_body || is_link || self.scene.names().any(|other| other == name)) {
                return Err(Error::Invalid {
                    what: "pair that may touch".into(),
                    expected: "names of links, obstacles and attached bodies".into(),
                    found: format!("`{name}`"),
                });
            }
        }
        let mut allowed = self.allowed.clone();
        allowed.push([a.into(), b.into()]);
        Self { allowed, ..self.clone() }.paired()
    }

    /// The model of the robot.
    pub fn model(&self) -> &Arc<CollisionModel> {
        &self.model
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The bodies that links carry.
    pub fn attached(&self) -> &[AttachedBody] {
        &self.attached
    }

    /// Whether nothing touches: everything that is checked is farther apart than the settings' contact distance. False
    /// for a list of another length and for numbers that are not finite.
    pub fn is_free(&self, q: &[f64]) -> bool {
        self.is_sound(q)
            && with_scratch(|scratch| {
                self.place(q, scratch);
                let contact = self.contact();
                self.scene_pairs
                    .iter()
                    .all(|pair| self.scene_gap(pair, scratch, contact) >= contact)
                    && self
                        .group_pairs
                        .iter()
                        .all(|pair| self.group_gap(pair, scratch, contact) >= contact)
            })
    }

    /// A lower bound of the least distance between any two things that are checked, metres, exact where it is small; at
    /// most 0.5, and 0 where something touches or `q` is unsound.
    pub fn clearance(&self, q: &[f64]) -> f64 {
        if !self.is_sound(q) {
            return 0.0;
        }
        with_scratch(|scratch| {
            self.place(q, scratch);
            let mut least = FAR;
            for pair in &self.scene_pairs {
                least = least.min(self.scene_gap(pair, scratch, least));
            }
            for pair in &self.group_pairs {
                least = least.min(self.group_gap(pair, scratch, least));
            }
            if least < self.contact() { 0.0 } else { least }
        })
    }

    /// Everything that touches at `q`, the deepest first; empty where nothing does or `q` is unsound. Depths are the
    /// shortest ways that part the two pieces that are deepest in each other, metres; for the triangles of a mesh they
    /// are those of the triangle that is entered deepest.
    pub fn contacts(&self, q: &[f64]) -> Vec<Contact> {
        if !self.is_sound(q) {
            return Vec::new();
        }
        let contact = self.contact();
        let mut contacts = with_scratch(|scratch| {
            self.place(q, scratch);
            (0..self.groups.len()).for_each(|group| self.place_bodies(group, scratch));
            let frames = &scratch.frames;
            let mut contacts = Vec::new();
            for pair in &self.scene_pairs {
                let obstacle = &self.scene.obstacles()[pair.obstacle];
                for &i in &pair.bodies {
                    let MovingBody { name, body, .. } = &self.bodies[i];
                    if obstacle.gap(body, &frames[i], contact) < contact {
                        let depth = obstacle.depth(body, &frames[i]);
                        contacts.push(Contact { a: name.clone(), b: obstacle.name.clone(), depth });
                    }
                }
            }
            for &[a, b] in self.group_pairs.iter().flat_map(|pair| &pair.bodies) {
                if self.body_gap(a, b, frames, contact) < contact {
                    let depth = self.depth(a, b, frames);
                    let names = [a, b].map(|body| self.bodies[body].name.clone());
                    let [a, b] = names;
                    contacts.push(Contact { a, b, depth });
                }
            }
            contacts
        });
        contacts.sort_by(|a, b| b.depth.total_cmp(&a.depth));
        contacts
    }

    /// The deepest of the [`CollisionChecker::contacts`].
    pub fn first_contact(&self, q: &[f64]) -> Option<Contact> {
        self.contacts(q).into_iter().next()
    }

    pub(super) fn contact(&self) -> f64 {
        self.model.settings().contact
    }

    pub(super) fn is_sound(&self, q: &[f64]) -> bool {
        q.len() == self.model.arm().n_joints() && q.iter().all(|value| value.is_finite())
    }

    /// Puts joints and groups where they are at `q`; bodies follow when they are asked for.
    pub(super) fn place(&self, q: &[f64], scratch: &mut Scratch) {
        self.joints.place(q, &mut scratch.joints);
        scratch.placed.clear();
        scratch.placed.resize(self.groups.len(), false);
        scratch.frames.resize(self.bodies.len(), Frame::new(Pose::IDENTITY));
        scratch.centres.clear();
        scratch.centres.extend(self.groups.iter().map(|group| group.centre(&scratch.joints)));
    }

    fn place_bodies(&self, group: usize, scratch: &mut Scratch) {
        if !scratch.placed[group] {
            scratch.placed[group] = true;
            for (body, frame) in self.groups[group].frames(&scratch.joints) {
                scratch.frames[body] = frame;
            }
        }
    }

    /// A lower bound of the distance between a group and an obstacle, exact where it is small; `most` where it is that
    /// or more, 0 where they meet.
    pub(super) fn scene_gap(&self, pair: &ScenePair, scratch: &mut Scratch, most: f64) -> f64 {
        let obstacle = &self.scene.obstacles()[pair.obstacle];
        let group = &self.groups[pair.group];
        if obstacle.bound_distance(scratch.centres[pair.group]) - group.radius >= most {
            return most;
        }
        self.place_bodies(pair.group, scratch);
        let mut least = most;
        for &body in &pair.bodies {
            least = obstacle.gap(&self.bodies[body].body, &scratch.frames[body], least);
        }
        least
    }

    /// The same between two groups.
    pub(super) fn group_gap(&self, pair: &GroupPair, scratch: &mut Scratch, most: f64) -> f64 {
        let apart = scratch.centres[pair.a].distance(scratch.centres[pair.b]);
        if apart - self.groups[pair.a].radius - self.groups[pair.b].radius >= most {
            return most;
        }
        self.place_bodies(pair.a, scratch);
        self.place_bodies(pair.b, scratch);
        let mut least = most;
        for &[a, b] in &pair.bodies {
            least = self.body_gap(a, b, &scratch.frames, least);
        }
        least
    }

    fn body_gap(&self, a: usize, b: usize, frames: &[Frame], most: f64) -> f64 {
        body_gap(&self.bodies[a].body, &frames[a], &self.bodies[b].body, &frames[b], most)
    }

    fn depth(&self, a: usize, b: usize, frames: &[Frame]) -> f64 {
        let mut deepest = 0.0_f64;
        for piece_a in self.bodies[a].body.pieces() {
            let a_at = frames[a].pose * piece_a.body_from_piece;
            for piece_b in self.bodies[b].body.pieces() {
                let b_at = frames[b].pose * piece_b.body_from_piece;
                let found = depth(&a_at.inv_mul(&b_at), &piece_a.convex, &piece_b.convex);
                deepest = deepest.max(found);
            }
        }
        deepest
    }

    /// With the lists of what is checked, made anew.
    fn paired(mut self) -> Result<Self> {
        self.check_names()?;
        let bodies = &self.bodies;
        let may_touch = |a: &str, b: &str| {
            let is_pair =
                |pair: &[String; 2]| pair[0] == a && pair[1] == b || pair[0] == b && pair[1] == a;
            let tolerates = |one: &AttachedBody, other: &str, name: &str| {
                one.name == name && one.may_touch.iter().any(|touched| touched == other)
            };
            self.allowed.iter().any(is_pair)
                || self.attached.iter().any(|one| tolerates(one, b, a) || tolerates(one, a, b))
        };
        let n_links = self.model.moving_bodies().len();
        let of_attached = (n_links..bodies.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
        let pairs = self.model.pairs().iter().copied().chain(of_attached);
        let checked: Vec<[usize; 2]> = pairs
            .filter(|&[a, b]| {
                !bodies[a].is_fixed_to(&bodies[b]) && !may_touch(&bodies[a].name, &bodies[b].name)
            })
            .collect();
        let groups = RigidGroup::of_bodies(self.model.arm(), &self.joints, bodies);
        self.group_pairs = group_pairs(&groups, &checked);
        // The hand is nearest to what it works on: of all links it is the likeliest to touch, so it comes first.
        let moving = groups.iter().enumerate().rev().filter(|(_, group)| !group.path.is_empty());
        let mut scene_pairs = Vec::new();
        for (group, RigidGroup { members, .. }) in moving {
            for (obstacle, name) in self.scene.names().enumerate() {
                let checked = |&&body: &&usize| !may_touch(&bodies[body].name, name);
                let bodies: Vec<usize> = members.iter().filter(checked).copied().collect();
                if !bodies.is_empty() {
                    scene_pairs.push(ScenePair { group, obstacle, bodies });
                }
            }
        }
        self.scene_pairs = scene_pairs;
        self.groups = groups.into();
        Ok(self)
    }

    fn check_names(&self) -> Result<()> {
        let links = self.model.arm().robot().links.iter().map(|link| link.name.as_str());
        let attached = self.attached.iter().map(|attached| attached.name.as_str());
        let mut names: Vec<&str> = links.chain(attached).chain(self.scene.names()).collect();
        names.sort_unstable();
        match names.windows(2).find(|pair| pair[0] == pair[1]) {
            None => Ok(()),
            Some(pair) => Err(Error::Invalid {
                what: "names of links, obstacles and attached bodies".into(),
                expected: "each once".into(),
                found: format!("`{}` twice", pair[0]),
            }),
        }
    }
}

/// Pairs of bodies, by the groups that they belong to.
fn group_pairs(groups: &[RigidGroup], checked: &[[usize; 2]]) -> Vec<GroupPair> {
    let group_of = |body: usize| groups.iter().position(|group| group.members.contains(&body));
    let mut pairs: Vec<GroupPair> = Vec::new();
    for &[i, j] in checked {
        let (Some(a), Some(b)) = (group_of(i), group_of(j)) else { continue };
        match pairs.iter_mut().find(|pair| (pair.a, pair.b) == (a, b)) {
            Some(pair) => pair.bodies.push([i, j]),
            None => {
                let common = groups[a].n_common(&groups[b]);
                pairs.push(GroupPair { a, b, common, bodies: vec![[i, j]] });
            }
        }
    }
    pairs
}

impl AttachedBody {
    fn on(&self, model: &CollisionModel) -> MovingBody {
        let Self { name, link, link_from_body, body, .. } = self;
        MovingBody::new(model.arm(), name.clone(), *link, *link_from_body, body.clone())
    }
}
