//! What becomes of a region that is transferred.

use crate::confidence::verdict;
use crate::hypotheses::Hypothesis;
use crate::report::TransferReport;
use crate::{PointMap, Region, Verdict};

/// A transferred region and everything known about it. Vertices are those of the meshes as read.
#[derive(Clone, Debug)]
pub struct Transfer {
    /// The region on the target. Weights are scaled so that the method's threshold stands at
    /// [`Region::COUNTS`].
    pub region: Region,
    /// The probability that the region's IoU with the truth is at least one half, in [0, 1]
    /// ([`confidence`](crate::confidence) says how it is known).
    pub confidence: f64,
    /// What to do with the answer.
    pub verdict: Verdict,
    /// Where else the region may belong, by falling probability; the first is the likeliest place.
    pub hypotheses: Vec<Hypothesis>,
    /// One source vertex per target vertex. The methods without a map give the vertex at the
    /// nearest or most coupled cloud point.
    pub point_map: PointMap,
    /// The region under the other rule, where the method computes both (`semfm`).
    pub other_rule: Option<Region>,
    /// How the answer came about.
    pub report: TransferReport,
}

impl Transfer {
    /// The same answer where the objects are of one kind with this probability only, which was not known before: the
    /// confidence is multiplied by it.
    #[must_use]
    pub fn if_of_one_kind(mut self, probability: f64) -> Self {
        self.confidence *= probability;
        self.verdict = verdict(self.confidence);
        self.report.one_kind = Some(probability);
        self
    }

    /// Why the answer is not accepted, in words, where more is known than that it is doubtful.
    pub fn why(&self) -> Option<&'static str> {
        let doubtful = self.verdict != Verdict::Accept;
        (doubtful && self.report.is_not_alike())
            .then_some("not alike: the two objects are hardly of one kind")
    }

    /// Weight per target vertex, in [0, 1].
    pub fn weights(&self) -> &[f64] {
        self.region.weights()
    }
}
