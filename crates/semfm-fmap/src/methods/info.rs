//! What the table of methods says of each.

use semfm_geom::Task;

use super::pair::Pair;
use crate::congruence::Congruence;
use crate::fit::FitReport;
use crate::settings::TransferSettings;
use crate::stages::Stages;
use crate::{FunctionalMap, PointMap, Result};

/// What a method is, for help texts, for reports, and for those who make the features that it reads.
#[derive(Debug)]
#[non_exhaustive]
pub struct MethodInfo {
    /// The name used by files and commands.
    pub name: &'static str,
    /// One line for help texts and tables.
    pub summary: &'static str,
    /// Its colour in reports (sRGB), distinct for colour-blind readers, too (Okabe & Ito 2008).
    pub color: [u8; 3],
    /// How the features that it was made for come about.
    pub features: ViewFeatures,
    /// Whether it reads features at all: one that does not is content with the geometry
    /// ([`PreparedObject::without_features`](crate::PreparedObject::without_features)).
    pub reads_features: bool,
    /// Whether a functional map stands behind the answer: the others have no image rule.
    pub has_map: bool,
    /// What its confidence is made of.
    pub confidence: ConfidenceRule,
    /// Its constants, where they differ from the common ones.
    pub(crate) settings: fn(TransferSettings) -> TransferSettings,
    /// What it finds out about a pair.
    pub(crate) matched: fn(&Pair, &TransferSettings, &mut Stages, &Task) -> Result<Matched>,
    /// Vote on the target's working vertices for a region on the source's (`inside`, n_source).
    pub(crate) votes: VoteFunction,
}

type VoteFunction = fn(&Pair, &TransferSettings, &Matched, &[bool]) -> Result<Vec<f64>>;

/// How the embeddings of views become the features that a method reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ViewFeatures {
    /// How they are lifted to the surface.
    pub lifting: Lifting,
    /// Rotations of each view that the encoder averages.
    pub rolls: u32,
}

impl ViewFeatures {
    /// What every method but the published one reads.
    pub(crate) const PULLED: Self = Self { lifting: Lifting::Pull, rolls: 4 };
}

/// How embeddings of views are lifted to the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Lifting {
    /// Samples of the surface take their features out of every view that sees them.
    Pull,
    /// The paper's: centres of patches are cast onto the surface.
    Unproject,
}

/// What the confidence of a method's answers is made of ([`confidence`](crate::confidence)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ConfidenceRule {
    /// Of the [`Evidence`](crate::Evidence) in the answer itself.
    Evidence,
    /// Of the agreement with a second opinion, where there is one, and else of the evidence.
    Agreement,
}

impl MethodInfo {
    /// Whether the method cannot do without a second opinion: its confidence is the agreement with
    /// one.
    pub(crate) fn needs_second_opinion(&self) -> bool {
        self.has_map && self.confidence == ConfidenceRule::Agreement
    }
}

/// What a method found out about a pair, on working vertices.
#[derive(Debug)]
pub(crate) struct Matched {
    pub point_map: PointMap,
    /// A target vertex per source vertex, where the method reads its map both ways.
    pub target_of: Option<Vec<u32>>,
    pub map: Option<FunctionalMap>,
    pub fit: Option<FitReport>,
    /// How the target lies on the source, where it is the same surface once more.
    pub congruence: Option<Congruence>,
}

impl Matched {
    /// A point map that no functional map stands behind.
    pub fn points(point_map: PointMap) -> Self {
        Self { point_map, target_of: None, map: None, fit: None, congruence: None }
    }
}
