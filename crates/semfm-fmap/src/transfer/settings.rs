//! The methods' names and constants.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::clusters::ClusterSettings;
use crate::descriptors::DescriptorNorm;
use crate::fit::FitSettings;
use crate::propagation::PropagationSettings;
use crate::transport::TransportSettings;
use crate::zoomout::ZoomOutSettings;
use crate::{Error, Result};

/// Which of the six methods carries the region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Transport, then bidirectional feature-augmented ZoomOut (our successor of the paper's).
    #[default]
    Fused,
    /// The published method, to the letter.
    Semfm,
    /// Its anchors, then feature-augmented ZoomOut.
    Anchored,
    /// Transport alone.
    Sinkhorn,
    /// Nearest points in feature space.
    Nearest,
    /// Wave kernel signatures: geometry alone.
    Wks,
}

impl Method {
    /// All methods, best first.
    pub const ALL: [Self; 6] =
        [Self::Fused, Self::Semfm, Self::Anchored, Self::Sinkhorn, Self::Nearest, Self::Wks];

    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fused => "fused",
            Self::Semfm => "semfm",
            Self::Anchored => "anchored",
            Self::Sinkhorn => "sinkhorn",
            Self::Nearest => "nearest",
            Self::Wks => "wks",
        }
    }

    /// Whether a functional map stands behind the answer: the others know no image rule.
    pub fn has_map(self) -> bool {
        !matches!(self, Self::Sinkhorn | Self::Nearest)
    }

    /// The vote from which a vertex counts. Once it is spread, .4 to .45 are the same for `fused`
    /// on real pairs; .5 costs .01, and .02 on the hardest of the simulated ones.
    pub(super) fn threshold(self) -> f64 {
        if self == Self::Fused { 0.42 } else { 0.5 }
    }

    /// How the vote is spread along the target's features; the paper's method and the baselines
    /// know nothing of it.
    pub(super) fn propagation(self) -> PropagationSettings {
        let settings = PropagationSettings::default();
        if self == Self::Fused { settings } else { PropagationSettings { weight: 0.0, ..settings } }
    }

    /// Heat time (area 1) of the implicit step that smooths the vote of a map. On the truth itself
    /// it costs IoU 0 to .09; .003 on 60 eigenfunctions cost up to .3 on the handle of a kettle.
    pub(super) fn diffusion(self) -> f64 {
        if matches!(self, Self::Fused | Self::Anchored) { 0.001 } else { 0.0 }
    }

    fn zoomout(self) -> ZoomOutSettings {
        let (k_start, k_final, feature_weight) = match self {
            Self::Anchored => (20, 50, 0.5),
            Self::Semfm | Self::Wks => (20, 50, 0.0),
            // The optimum is flat: k 20 to 50 and w .5 to 1 are within .02.
            Self::Fused | Self::Sinkhorn | Self::Nearest => (10, 30, 1.0),
        };
        ZoomOutSettings { k_start, k_final, step: 5, feature_weight }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Method {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let names = Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|method| method.name() == text);
        found.map_or_else(|| Error::out_of_range("method", names, text), Ok)
    }
}

/// How a region travels through a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// A target vertex is in the region where its source vertex is.
    #[default]
    Preimage,
    /// The region is the set of target vertices that the source's region is sent to (the paper's
    /// words). Leaves salt and pepper: IoU .20 against .73 on the same map.
    Image,
}

impl Rule {
    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preimage => "preimage",
            Self::Image => "image",
        }
    }

    /// The one that this is not.
    pub fn other(self) -> Self {
        match self {
            Self::Preimage => Self::Image,
            Self::Image => Self::Preimage,
        }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Rule {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "preimage" => Ok(Self::Preimage),
            "image" => Ok(Self::Image),
            _ => Error::out_of_range("rule", "preimage, image", text),
        }
    }
}

/// Everything that can be set about a transfer. [`TransferSettings::of`] gives a method's own
/// constants; the default is `fused`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferSettings {
    /// The method.
    pub method: Method,
    /// The rule by which a map carries the region.
    pub rule: Rule,
    /// Alternatives returned at most.
    pub n_hypotheses: usize,
    /// Semantic clusters, with the seed of all that is random here.
    pub clusters: ClusterSettings,
    /// Anchors α.
    pub n_anchors: usize,
    /// Heat time t of the anchors' indicators, on area 1.
    pub heat_time: f64,
    /// The norm that those descriptors are scaled to.
    pub descriptor_norm: DescriptorNorm,
    /// What is asked of C besides the descriptors.
    pub fit: FitSettings,
    /// How the map grows.
    pub zoomout: ZoomOutSettings,
    /// Principal directions kept of the pair's features.
    pub feature_dims: usize,
    /// Transport between the clouds.
    pub transport: TransportSettings,
    /// Neighbours asked by `nearest`.
    pub neighbours: usize,
    /// Heat time that smooths the vote of a map, 0 for none.
    pub diffusion: f64,
    /// How the vote is spread along the target's own features, weight 0 for not at all.
    pub propagation: PropagationSettings,
    /// The vote from which a vertex counts, inside (0, 1).
    pub threshold: f64,
}

impl TransferSettings {
    /// The constants of a method.
    pub fn of(method: Method) -> Self {
        let literal = method == Method::Semfm;
        Self {
            method,
            rule: Rule::default(),
            n_hypotheses: 3,
            clusters: ClusterSettings::default(),
            n_anchors: 2,
            heat_time: 0.005,
            descriptor_norm: if literal {
                DescriptorNorm::Vertices
            } else {
                DescriptorNorm::Surface
            },
            fit: FitSettings {
                laplacian: if method == Method::Wks { 0.01 } else { 0.0 },
                ..FitSettings::default()
            },
            zoomout: method.zoomout(),
            feature_dims: 32,
            transport: TransportSettings::default(),
            neighbours: 15,
            diffusion: method.diffusion(),
            propagation: method.propagation(),
            threshold: method.threshold(),
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        if !(self.threshold > 0.0 && self.threshold < 1.0) {
            return Error::out_of_range("threshold", "a number between 0 and 1", self.threshold);
        }
        if !(self.diffusion >= 0.0 && self.heat_time >= 0.0) {
            let found = format!("{} and {}", self.diffusion, self.heat_time);
            return Error::out_of_range("heat times", "numbers of at least 0", found);
        }
        let PropagationSettings { weight, contrast } = self.propagation;
        if !(weight >= 0.0 && weight.is_finite() && contrast > 0.0) {
            let found = format!("weight {weight}, contrast {contrast}");
            return Error::out_of_range(
                "propagation",
                "a weight of at least 0 and a positive contrast",
                found,
            );
        }
        if self.n_anchors == 0 || self.feature_dims == 0 || self.neighbours == 0 {
            let found =
                format!("{}, {} and {}", self.n_anchors, self.feature_dims, self.neighbours);
            return Error::out_of_range(
                "anchors, feature dimensions, neighbours",
                "at least 1 of each",
                found,
            );
        }
        if self.fit.orientation > 0.0 && self.method != Method::Wks {
            let expected = format!("0 ({} does not fit descriptors of the surface)", self.method);
            return Error::out_of_range("fit.orientation", expected, self.fit.orientation);
        }
        if self.rule == Rule::Image && !self.method.has_map() {
            let expected = format!("preimage ({} makes no map that has an image)", self.method);
            return Error::out_of_range("rule", expected, self.rule);
        }
        Ok(())
    }

    /// The same with map sizes that bases of `available` pairs can serve.
    pub(super) fn clipped(&self, available: usize) -> Self {
        let k_final = self.zoomout.k_final.min(available);
        let zoomout =
            ZoomOutSettings { k_final, k_start: self.zoomout.k_start.min(k_final), ..self.zoomout };
        Self { zoomout, ..self.clone() }
    }

    /// `fused` with this transfer's features and transport: the second opinion beside a method
    /// without a map.
    pub(super) fn as_fused(&self, available: usize) -> Self {
        let settings = Self::of(Method::Fused).clipped(available);
        Self { feature_dims: self.feature_dims, transport: self.transport, ..settings }
    }
}

impl Default for TransferSettings {
    fn default() -> Self {
        Self::of(Method::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_strangers_refused() {
        for method in Method::ALL {
            assert_eq!(method.name().parse::<Method>().unwrap(), method);
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("\"{method}\""));
        }
        for rule in [Rule::Preimage, Rule::Image] {
            assert_eq!(rule.name().parse::<Rule>().unwrap(), rule);
        }
        let error = "magic".parse::<Method>().unwrap_err().to_string();
        assert!(error.contains("fused, semfm") && error.contains("magic"), "{error}");
    }

    #[test]
    fn settings_go_through_json_and_clip_to_small_bases() {
        let settings = TransferSettings::of(Method::Semfm);
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<TransferSettings>(&text).unwrap(), settings);
        let clipped = settings.clipped(4).zoomout;
        assert_eq!((clipped.k_start, clipped.k_final), (4, 4));
    }
}
