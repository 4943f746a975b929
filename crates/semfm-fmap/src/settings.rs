//! What can be set about a transfer.

use std::fmt;
use std::str::FromStr;

use semfm_geom::suggestion::unknown_name;
use serde::{Deserialize, Serialize};

use crate::clusters::ClusterSettings;
use crate::descriptors::DescriptorNorm;
use crate::fit::FitSettings;
use crate::method::Method;
use crate::propagation::PropagationSettings;
use crate::transport::TransportSettings;
use crate::zoomout::ZoomOutSettings;
use crate::{Error, Result};

/// How a map transfers a region.
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
            _ => {
                let given = unknown_name(text, ["preimage", "image"]);
                Error::out_of_range("rule", "preimage, image", given)
            }
        }
    }
}

/// Everything that can be set about a transfer. [`TransferSettings::of`] gives a method's own
/// constants; the default is `fused`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferSettings {
    /// The method.
    pub method: Method,
    /// The rule by which a map transfers the region.
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
    /// Nearest points whose mean is the vote of `nearest`.
    pub neighbours: usize,
    /// Heat time that smooths the vote of a map, 0 for none.
    pub diffusion: f64,
    /// How the vote is spread along the target's own features, weight 0 for not at all.
    pub propagation: PropagationSettings,
    /// How far the target's surface may lie from the source's, as a share of the source's diagonal, to be the same
    /// surface once more; 0 to not look for that.
    #[serde(default)]
    pub congruence: f64,
    /// The vote from which a vertex counts, inside (0, 1).
    pub threshold: f64,
    /// Whether a second opinion is computed, in another way than the method's: by transport beside a
    /// method with a map, by the map of `fused` beside one without. `semfm`, `anchored` and `wks`
    /// need it, for their confidence is the agreement with it; `fused` has its transport at hand;
    /// beside `nearest` and `sinkhorn` it costs a whole `fused`, and is left out where it is not
    /// asked for.
    pub second_opinion: bool,
}

impl TransferSettings {
    /// The constants of a method.
    pub fn of(method: Method) -> Self {
        (method.info().settings)(Self::common(method))
    }

    /// What methods have in common: no smoothing, a threshold of one half, the constants of the paper
    /// where it gives any.
    fn common(method: Method) -> Self {
        Self {
            method,
            rule: Rule::default(),
            n_hypotheses: 3,
            clusters: ClusterSettings::default(),
            n_anchors: 2,
            heat_time: 0.005,
            descriptor_norm: DescriptorNorm::Surface,
            fit: FitSettings::default(),
            zoomout: ZoomOutSettings { k_start: 10, k_final: 30, step: 5, feature_weight: 1.0 },
            feature_dims: 32,
            transport: TransportSettings::default(),
            neighbours: 15,
            diffusion: 0.0,
            propagation: PropagationSettings { weight: 0.0, ..PropagationSettings::default() },
            congruence: 0.0,
            threshold: 0.5,
            second_opinion: true,
        }
    }

    pub(crate) fn check(&self) -> Result<()> {
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
        if !(self.congruence >= 0.0 && self.congruence.is_finite()) {
            let expected = "a share of the diagonal, at least 0";
            return Error::out_of_range("congruence", expected, self.congruence);
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
        let info = self.method.info();
        if info.needs_second_opinion() && !self.second_opinion {
            let expected =
                format!("true (the confidence of {} is the agreement with it)", self.method);
            return Error::out_of_range("second_opinion", expected, false);
        }
        if self.rule == Rule::Image && !info.has_map {
            let expected = format!("preimage ({} makes no map that has an image)", self.method);
            return Error::out_of_range("rule", expected, self.rule);
        }
        Ok(())
    }

    /// The same with map sizes that bases of `available` pairs can serve.
    pub(crate) fn clipped(&self, available: usize) -> Self {
        let k_final = self.zoomout.k_final.min(available);
        let zoomout =
            ZoomOutSettings { k_final, k_start: self.zoomout.k_start.min(k_final), ..self.zoomout };
        Self { zoomout, ..self.clone() }
    }

    /// `fused` with this transfer's features and transport: the second opinion beside a method
    /// without a map.
    pub(crate) fn as_fused(&self, available: usize) -> Self {
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
    fn rules_are_read_back_and_are_each_others_other() {
        for rule in [Rule::Preimage, Rule::Image] {
            assert_eq!(rule.name().parse::<Rule>().unwrap(), rule);
            assert_eq!(rule.other().other(), rule);
        }
        assert!("inverse".parse::<Rule>().is_err());
    }

    #[test]
    fn settings_go_through_json_and_clip_to_small_bases() {
        let settings = TransferSettings::of(Method::Semfm);
        let text = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<TransferSettings>(&text).unwrap(), settings);
        let clipped = settings.clipped(4).zoomout;
        assert_eq!((clipped.k_start, clipped.k_final), (4, 4));
    }

    #[test]
    fn a_confidence_by_agreement_needs_the_second_opinion() {
        for method in Method::ALL {
            let settings =
                TransferSettings { second_opinion: false, ..TransferSettings::of(method) };
            let needed = matches!(method, Method::Semfm | Method::Anchored | Method::Wks);
            assert_eq!(settings.check().is_err(), needed, "{method}");
        }
    }
}
