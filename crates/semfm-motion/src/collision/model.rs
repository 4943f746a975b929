//! A robot's links as bodies, and which of them are checked against each other.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_robot::{Arm, LinkShape, MeshPaths, Srdf};

use super::body::CollisionBody;
use super::moving_body::MovingBody;
use super::pairs::{Pairs, SkippedPair};
use crate::{Error, Result};

/// How collisions are checked.
#[derive(Clone, Debug, PartialEq)]
pub struct CollisionSettings {
    /// Distance that counts as contact, metres. It also bounds the steps of motion checks from below: while a motion is
    /// free at steps, nothing comes nearer than half of it in between.
    pub contact: f64,
    /// Random states by which pairs of links that always or never touch are found; where there is an SRDF, none is
    /// needed. With 0 all pairs but adjacent ones are checked.
    pub n_samples: usize,
    /// Seed of these states.
    pub seed: u64,
}

impl Default for CollisionSettings {
    fn default() -> Self {
        Self { contact: 1e-4, n_samples: 10_000, seed: 0 }
    }
}

/// The links of an arm's robot as bodies. Costly to build (meshes are read and cut into convex pieces), shared by all
/// checkers.
#[derive(Clone, Debug)]
pub struct CollisionModel {
    arm: Arc<Arm>,
    bodies: Vec<MovingBody>,
    pairs: Vec<[usize; 2]>,
    skipped: Vec<SkippedPair>,
    notes: Vec<String>,
    missing: Vec<String>,
    settings: CollisionSettings,
}

impl CollisionModel {
    /// Reads the shapes of all links, and sorts out which pairs are checked: those that the SRDF leaves, or, without
    /// one or with one that disables none, those that neither are adjacent nor always or never touch.
    ///
    /// A link without collision geometry, or whose collision meshes cannot be read, is taken by its visuals; a note says
    /// so. Links that no joint of the arm moves are not checked against the scene: no motion can change it.
    ///
    /// # Errors
    /// [`Error::Robot`] for the name of a mesh that leads out of the allowed folders, and for a mesh that is damaged or
    /// too large; [`Error::Invalid`] for a contact distance that is not positive.
    pub fn new(
        arm: Arc<Arm>,
        paths: &MeshPaths,
        srdf: Option<&Srdf>,
        settings: &CollisionSettings,
    ) -> Result<Self> {
        if !(settings.contact > 0.0 && settings.contact.is_finite()) {
            return Err(Error::Invalid {
                what: "contact distance".into(),
                expected: "a positive number of metres".into(),
                found: settings.contact.to_string(),
            });
        }
        let (mut bodies, mut notes, mut missing) = (Vec::new(), Vec::new(), Vec::new());
        for (index, link) in arm.robot().links.iter().enumerate() {
            let shape = LinkShape::new(link, paths)?;
            add_notes(&link.name, &shape, link.collisions.is_empty(), &mut notes);
            missing
                .extend(shape.missing.iter().map(|mesh| format!("link `{}`: {mesh}", link.name)));
            if !shape.pieces.is_empty() {
                let body = CollisionBody::from_link(&shape)?;
                bodies.push(MovingBody::new(&arm, link.name.clone(), index, Pose::IDENTITY, body));
            }
        }
        // Neighbours overlap where they are joined: a file that allows no contact at all has no list of pairs.
        let listed = srdf.filter(|srdf| !srdf.disabled.is_empty());
        if srdf.is_some() && listed.is_none() {
            notes.push(
                "the SRDF disables no pair of links: by random states of the arm instead".into(),
            );
        }
        let Pairs { checked, skipped } = match listed {
            Some(srdf) => Pairs::by_srdf(&bodies, srdf),
            None => {
                let CollisionSettings { contact, n_samples, seed } = *settings;
                Pairs::by_samples(&arm, &bodies, contact, n_samples, seed)
            }
        };
        let settings = settings.clone();
        Ok(Self { arm, bodies, pairs: checked, skipped, notes, missing, settings })
    }

    /// The same links, moved by another arm of the same robot: other fixed positions, another tip. Pairs stay as they
    /// are, but for links that are no longer fixed to each other or are now.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the other arm's robot has other links.
    pub fn with_arm(&self, arm: Arc<Arm>) -> Result<Self> {
        let names = |arm: &Arm| -> Vec<String> {
            arm.robot().links.iter().map(|link| link.name.clone()).collect()
        };
        if names(&arm) != names(&self.arm) {
            return Err(Error::Invalid {
                what: "arm of a collision model".into(),
                expected: format!("an arm of the robot `{}`", self.arm.robot().name),
                found: format!("one of `{}` with other links", arm.robot().name),
            });
        }
        let place = |old: &MovingBody| {
            MovingBody::new(&arm, old.name.clone(), old.link, old.link_from_body, old.body.clone())
        };
        Ok(Self { bodies: self.bodies.iter().map(place).collect(), arm, ..self.clone() })
    }

    /// The same without some links, by name: fingers of the description, where another hand stands for them. Names that
    /// no link has are passed over.
    #[must_use]
    pub fn without_links(&self, names: &[&str]) -> Self {
        let stays: Vec<bool> =
            self.bodies.iter().map(|body| !names.contains(&body.name.as_str())).collect();
        let place: Vec<usize> =
            (0..stays.len()).map(|i| stays[..i].iter().filter(|s| **s).count()).collect();
        let pairs = self.pairs.iter().filter(|pair| pair.iter().all(|&body| stays[body]));
        let bodies = self.bodies.iter().zip(&stays).filter(|(_, stays)| **stays);
        Self {
            pairs: pairs.map(|pair| pair.map(|body| place[body])).collect(),
            bodies: bodies.map(|(body, _)| body.clone()).collect(),
            ..self.clone()
        }
    }

    /// The arm that moves them.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.arm
    }

    /// What was assumed: visuals that stand for collisions, meshes that are missing or could not be cut.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Pairs of links that are not checked against each other, and why.
    pub fn skipped_pairs(&self) -> &[SkippedPair] {
        &self.skipped
    }

    /// Pairs of links that are checked against each other, by name.
    pub fn checked_pairs(&self) -> impl ExactSizeIterator<Item = [&str; 2]> {
        self.pairs.iter().map(|pair| pair.map(|body| self.bodies[body].name.as_str()))
    }

    /// The links that have a shape, by name, with their bodies.
    pub fn bodies(&self) -> impl ExactSizeIterator<Item = (&str, &CollisionBody)> {
        self.bodies.iter().map(|body| (body.name.as_str(), &body.body))
    }

    /// Meshes of links that are not there, so that these links are not checked, or only in part: each with its link and why.
    pub fn missing(&self) -> &[String] {
        &self.missing
    }

    /// How collisions are checked.
    pub fn settings(&self) -> &CollisionSettings {
        &self.settings
    }

    pub(crate) fn moving_bodies(&self) -> &[MovingBody] {
        &self.bodies
    }

    pub(crate) fn pairs(&self) -> &[[usize; 2]] {
        &self.pairs
    }
}

fn add_notes(link: &str, shape: &LinkShape, has_no_collisions: bool, notes: &mut Vec<String>) {
    notes.extend(shape.notes.iter().cloned());
    if shape.from_visuals {
        let why = if has_no_collisions {
            "it has no collision geometry"
        } else {
            "its collision meshes cannot be read"
        };
        notes.push(format!("link `{link}`: {why}; its visuals are checked in their place"));
    }
    for missing in &shape.missing {
        let rest =
            if shape.pieces.is_empty() { "it is not checked" } else { "a part is not checked" };
        notes.push(format!("link `{link}`: {missing}; {rest}"));
    }
}
