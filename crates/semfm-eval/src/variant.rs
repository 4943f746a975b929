//! The methods that an evaluation compares: those of the table, the published one's variants, and a
//! lower and an upper bound.

use std::fmt;
use std::str::FromStr;

use semfm::fmap::ViewFeatures;
use semfm::geom::suggestion::unknown_name;
use semfm::views::LiftSettings;
use semfm::{Method, PipelineSettings, Rule, TransferSettings};
use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// What is compared: a method with the features that it reads and the rule of its map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    name: &'static str,
    about: &'static str,
    /// None where nothing is matched.
    matching: Option<MatchingVariant>,
}

/// How a variant matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct MatchingVariant {
    method: Method,
    features: VariantFeatures,
    rule: Rule,
}

/// Which features a variant's method gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum VariantFeatures {
    /// Those that it was made for.
    Own,
    /// Those of the default method.
    Default,
    /// True part labels.
    Parts,
}

/// Which features an object is prepared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Features {
    /// Lifted from views.
    Views(ViewFeatures),
    /// True part labels.
    Parts,
}

impl Features {
    /// Those of the default method: our views, each at several rolls, and our lifting.
    pub fn of_default_method() -> Self {
        Self::Views(Method::default().info().features)
    }

    /// Rotations of each view that the encoder averages.
    pub fn rolls(self) -> u32 {
        self.method().info().features.rolls
    }

    /// How views are lifted.
    pub fn lift(self, seed: u64) -> LiftSettings {
        PipelineSettings::of(self.method()).with_seed(seed).lift
    }

    /// A method that reads such features.
    fn method(self) -> Method {
        let mut methods = Method::ALL.into_iter();
        methods.find(|method| Self::Views(method.info().features) == self).unwrap_or_default()
    }
}

/// The variants beside the methods themselves, each listed after its method.
const VARIANTS: [Variant; 3] = [
    variant(
        "semfm-image",
        "the published method by its own image rule",
        Method::Semfm,
        VariantFeatures::Own,
        Rule::Image,
    ),
    variant(
        "semfm+",
        "the published matching on our views and lifting",
        Method::Semfm,
        VariantFeatures::Default,
        Rule::Preimage,
    ),
    variant(
        "semfm+image",
        "the same, image rule",
        Method::Semfm,
        VariantFeatures::Default,
        Rule::Image,
    ),
];

const fn variant(
    name: &'static str,
    about: &'static str,
    method: Method,
    features: VariantFeatures,
    rule: Rule,
) -> Variant {
    Variant { name, about, matching: Some(MatchingVariant { method, features, rule }) }
}

impl Variant {
    /// `oracle`: the default method with true part labels as features.
    pub const UPPER_BOUND: Self = variant(
        "oracle",
        "the default method with true part labels as features: the upper bound",
        Method::Fused,
        VariantFeatures::Parts,
        Rule::Preimage,
    );

    /// `whole`: every vertex.
    pub const LOWER_BOUND: Self =
        Self { name: "whole", about: "every vertex: the lower bound", matching: None };

    /// A method with its own features and the preimage rule.
    pub fn of(method: Method) -> Self {
        let info = method.info();
        variant(info.name, info.summary, method, VariantFeatures::Own, Rule::Preimage)
    }

    /// All variants, in the order of the tables.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for method in Method::ALL {
            all.push(Self::of(method));
            all.extend(VARIANTS.into_iter().filter(|variant| variant.method() == Some(method)));
        }
        all.extend([Self::UPPER_BOUND, Self::LOWER_BOUND]);
        all
    }

    /// The name used by files and commands.
    pub fn name(self) -> &'static str {
        self.name
    }

    /// What it is, for people.
    pub fn about(self) -> &'static str {
        self.about
    }

    /// Whether it is one of the bounds, which compete with no method.
    pub fn is_bound(self) -> bool {
        self == Self::UPPER_BOUND || self == Self::LOWER_BOUND
    }

    /// The method; none for the lower bound.
    pub fn method(self) -> Option<Method> {
        self.matching.map(|matching| matching.method)
    }

    /// The features that it reads; none for the lower bound.
    pub fn features(self) -> Option<Features> {
        let matching = self.matching?;
        Some(match matching.features {
            VariantFeatures::Own => Features::Views(matching.method.info().features),
            VariantFeatures::Default => Features::of_default_method(),
            VariantFeatures::Parts => Features::Parts,
        })
    }

    /// How it matches; none for the lower bound.
    pub fn settings(self, seed: u64) -> Option<TransferSettings> {
        let MatchingVariant { method, rule, .. } = self.matching?;
        let settings = PipelineSettings::of(method).with_seed(seed).transfer;
        Some(TransferSettings { rule, ..settings })
    }

    /// The same matching on the default method's features, where that is another variant.
    pub fn with_our_features(self) -> Self {
        let Some(own) = self.matching.filter(|own| own.features == VariantFeatures::Own) else {
            return self;
        };
        let same = MatchingVariant { features: VariantFeatures::Default, ..own };
        VARIANTS.into_iter().find(|other| other.matching == Some(same)).unwrap_or(self)
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name)
    }
}

impl FromStr for Variant {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let all = Self::all();
        all.iter().find(|variant| variant.name == text).copied().ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|variant| variant.name).collect();
            let given = unknown_name(text, names.iter().copied());
            Error::invalid("method", names.join(", "), given)
        })
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
        if variant.name != self.method {
            return Ok(settings);
        }
        let mut tree = serde_json::to_value(&settings).map_err(|error| self.unfit(&error))?;
        let place = format!("/{}", self.key.replace('.', "/"));
        let Some(found) = tree.pointer_mut(&place) else {
            let keys = tree.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>().join(", "));
            let expected = format!("one of {}", keys.unwrap_or_default());
            return Err(Error::invalid(format!("setting of {}", self.method), expected, &self.key));
        };
        *found = self.value.clone();
        serde_json::from_value(tree).map_err(|error| self.unfit(&error))
    }

    fn unfit(&self, error: &serde_json::Error) -> Error {
        let what = format!("{}.{}", self.method, self.key);
        let found = format!("{} ({error})", self.value);
        Error::invalid(what, "a value of the setting's kind", found)
    }
}

impl FromStr for Override {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts = text.split_once('=').and_then(|(place, value)| {
            let (method, key) = place.split_once('.')?;
            Some((method, key, value))
        });
        let Some((method, key, value)) = parts else {
            return Err(Error::invalid("setting", "METHOD.KEY=VALUE", text));
        };
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
        let all = Variant::all();
        assert_eq!(all[0], Variant::of(Method::default()));
        for &variant in &all {
            assert_eq!(variant.name().parse::<Variant>().unwrap(), variant);
            let needs_nothing = variant.features().is_none();
            assert_eq!(needs_nothing, variant == Variant::LOWER_BOUND);
            assert_eq!(needs_nothing, variant.settings(0).is_none());
            assert_eq!(all.iter().filter(|other| other.name() == variant.name()).count(), 1);
        }
        let error = "magic".parse::<Variant>().unwrap_err().to_string();
        assert!(error.contains("semfm+image") && error.contains("magic"), "{error}");
    }

    #[test]
    fn the_published_matching_can_have_our_features() {
        for (name, with_ours) in [
            ("semfm", "semfm+"),
            ("semfm-image", "semfm+image"),
            ("semfm+", "semfm+"),
            ("fused", "fused"),
            ("oracle", "oracle"),
        ] {
            let variant: Variant = name.parse().unwrap();
            assert_eq!(variant.with_our_features().name(), with_ours);
        }
    }

    fn change(text: &str) -> Result<TransferSettings> {
        let fused = Variant::of(Method::Fused);
        text.parse::<Override>()?.apply(fused, fused.settings(0).unwrap())
    }

    #[test]
    fn settings_are_changed_by_name_or_the_fault_is_named() {
        let fused = Variant::of(Method::Fused).settings(0).unwrap();
        assert_eq!(change("fused.threshold=0.35").unwrap().threshold, 0.35);
        assert_eq!(change("fused.zoomout.k_final=40").unwrap().zoomout.k_final, 40);
        assert_eq!(change("fused.rule=image").unwrap().rule, Rule::Image);
        assert_eq!(change("wks.threshold=0.9").unwrap(), fused);
        for bad in ["fused.treshold=1", "fused.threshold=high", "fused", "fused.x", "magic.x=1"] {
            assert!(change(bad).is_err(), "{bad}");
        }
    }
}
