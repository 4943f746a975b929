//! The methods that an evaluation compares: the six, the paper's variants, lower and upper bound.

use std::fmt;
use std::str::FromStr;

use semfm::views::LiftSettings;
use semfm::{Method, PipelineSettings, Rule, TransferSettings};
use serde::{Deserialize, Serialize};

use crate::embeddings::{OUR_ROLLS, PAPER_ROLLS};
use crate::{Error, Result};

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Variant {
    /// The default method.
    Fused,
    /// The published method to the letter, preimage rule.
    Semfm,
    /// The same with the paper's own image rule.
    SemfmImage,
    /// The published matching with our views and lifting.
    SemfmPlus,
    /// The same with the image rule.
    SemfmPlusImage,
    /// The paper's anchors, then features and heat.
    Anchored,
    /// Transport alone.
    Sinkhorn,
    /// Nearest features.
    Nearest,
    /// Geometry alone, the paper's baseline.
    Wks,
    /// True part labels as features, and the default method: the upper bound.
    Oracle,
    /// Every vertex: the lower bound.
    Whole,
}

/// Which features an object is seen by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Features {
    /// Our views (rolled) and lifting.
    Ours,
    /// The paper's: one picture per view, patch centres unprojected.
    Paper,
    /// True part labels.
    Parts,
}

impl Features {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ours, Self::Paper, Self::Parts];

    /// Rotations of each picture.
    pub fn rolls(self) -> u32 {
        if self == Self::Paper { PAPER_ROLLS } else { OUR_ROLLS }
    }

    /// How views are lifted.
    pub fn lift(self, seed: u64) -> LiftSettings {
        let method = if self == Self::Paper { Method::Semfm } else { Method::Fused };
        PipelineSettings::of(method).with_seed(seed).lift
    }
}

impl Variant {
    /// All variants, in the order of the tables.
    pub const ALL: [Self; 11] = [
        Self::Fused,
        Self::Anchored,
        Self::Sinkhorn,
        Self::Nearest,
        Self::SemfmPlus,
        Self::SemfmPlusImage,
        Self::Semfm,
        Self::SemfmImage,
        Self::Wks,
        Self::Oracle,
        Self::Whole,
    ];

    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fused => "fused",
            Self::Semfm => "semfm",
            Self::SemfmImage => "semfm-image",
            Self::SemfmPlus => "semfm+",
            Self::SemfmPlusImage => "semfm+image",
            Self::Anchored => "anchored",
            Self::Sinkhorn => "sinkhorn",
            Self::Nearest => "nearest",
            Self::Wks => "wks",
            Self::Oracle => "oracle",
            Self::Whole => "whole",
        }
    }

    /// What it is, for people.
    pub fn about(self) -> &'static str {
        match self {
            Self::Fused => "the default: transport starts a map that features steer",
            Self::Semfm => "the published method with its own views and lifting, preimage rule",
            Self::SemfmImage => "the same, image rule as in the paper's words",
            Self::SemfmPlus => "the published matching on our views and lifting",
            Self::SemfmPlusImage => "the same, image rule",
            Self::Anchored => "the paper's anchors, then features and heat",
            Self::Sinkhorn => "transport between the clouds, no map",
            Self::Nearest => "nearest features, no map",
            Self::Wks => "wave kernel signatures: geometry alone",
            Self::Oracle => "the default method with true part labels as features: the upper bound",
            Self::Whole => "every vertex: the lower bound",
        }
    }

    /// The features it needs; none for the lower bound.
    pub fn features(self) -> Option<Features> {
        match self {
            Self::Whole => None,
            Self::Oracle => Some(Features::Parts),
            Self::Semfm | Self::SemfmImage => Some(Features::Paper),
            _ => Some(Features::Ours),
        }
    }

    /// How it matches; none for the lower bound.
    pub fn settings(self, seed: u64) -> Option<TransferSettings> {
        let method = match self {
            Self::Whole => return None,
            Self::Fused | Self::Oracle => Method::Fused,
            Self::Semfm | Self::SemfmImage | Self::SemfmPlus | Self::SemfmPlusImage => {
                Method::Semfm
            }
            Self::Anchored => Method::Anchored,
            Self::Sinkhorn => Method::Sinkhorn,
            Self::Nearest => Method::Nearest,
            Self::Wks => Method::Wks,
        };
        let image = matches!(self, Self::SemfmImage | Self::SemfmPlusImage);
        let mut settings = PipelineSettings::of(method).with_seed(seed).transfer;
        settings.rule = if image { Rule::Image } else { Rule::Preimage };
        Some(settings)
    }

    /// The same matching on our features, where that is another variant.
    pub fn with_our_features(self) -> Self {
        match self {
            Self::Semfm => Self::SemfmPlus,
            Self::SemfmImage => Self::SemfmPlusImage,
            other => other,
        }
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Variant {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let found = Self::ALL.into_iter().find(|variant| variant.name() == text);
        found.ok_or_else(|| Error::invalid("method", Self::ALL.map(Self::name).join(", "), text))
    }
}

/// One setting of one variant, changed: `fused.threshold=0.35`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Override {
    /// Name of the variant.
    pub method: String,
    /// Where in its settings, keys joined by points.
    pub key: String,
    /// The value there.
    pub value: serde_json::Value,
}

impl Override {
    /// Changes `settings` where they are those of this override's variant.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a key that is not there or a value of another kind.
    pub fn apply(&self, variant: Variant, settings: TransferSettings) -> Result<TransferSettings> {
        if variant.name() != self.method {
            return Ok(settings);
        }
        let unfit = |error: serde_json::Error| {
            let what = format!("{}.{}", self.method, self.key);
            Error::invalid(
                what,
                "a value of the setting's kind",
                format!("{} ({error})", self.value),
            )
        };
        let mut tree = serde_json::to_value(&settings).map_err(unfit)?;
        let place = format!("/{}", self.key.replace('.', "/"));
        let Some(found) = tree.pointer_mut(&place) else {
            let keys = tree.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>().join(", "));
            let expected = format!("one of {}", keys.unwrap_or_default());
            return Err(Error::invalid(format!("setting of {}", self.method), expected, &self.key));
        };
        *found = self.value.clone();
        serde_json::from_value(tree).map_err(unfit)
    }
}

impl FromStr for Override {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let unfit = || Error::invalid("setting", "METHOD.KEY=VALUE", text);
        let (place, value) = text.split_once('=').ok_or_else(unfit)?;
        let (method, key) = place.split_once('.').ok_or_else(unfit)?;
        method.parse::<Variant>()?;
        // A word that is no JSON is meant as a string.
        let value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
        Ok(Self { method: method.into(), key: key.into(), value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_only_the_lower_bound_needs_nothing() {
        for variant in Variant::ALL {
            assert_eq!(variant.name().parse::<Variant>().unwrap(), variant);
            let needs_nothing = variant.features().is_none();
            assert_eq!(needs_nothing, variant == Variant::Whole);
            assert_eq!(needs_nothing, variant.settings(0).is_none());
        }
        let error = "magic".parse::<Variant>().unwrap_err().to_string();
        assert!(error.contains("semfm+image") && error.contains("magic"), "{error}");
    }

    #[test]
    fn settings_are_changed_by_name_or_the_fault_is_named() {
        let change = |text: &str| -> Result<TransferSettings> {
            let base = Variant::Fused.settings(0).unwrap();
            text.parse::<Override>()?.apply(Variant::Fused, base)
        };
        assert_eq!(change("fused.threshold=0.35").unwrap().threshold, 0.35);
        assert_eq!(change("fused.zoomout.k_final=40").unwrap().zoomout.k_final, 40);
        assert_eq!(change("fused.rule=image").unwrap().rule, Rule::Image);
        assert_eq!(change("wks.threshold=0.9").unwrap(), Variant::Fused.settings(0).unwrap());
        for bad in ["fused.treshold=1", "fused.threshold=high", "fused", "fused.x", "magic.x=1"] {
            assert!(change(bad).is_err(), "{bad}");
        }
    }
}
