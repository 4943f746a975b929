//! How alike two objects of one kind look to an encoder, and two of different kinds.

use serde::{Deserialize, Serialize};

/// Where on the scale one kind is as likely as another, and how steeply the probability rises there. Real objects of
/// one kind differ more than procedural ones: at 0 in place of −.2, 3 of 100 right answers by MobileNetV2 are no longer
/// accepted, at −.2 one; at −.5 twice as much nonsense is accepted as at 0 (`bench/README.md`). Slopes of 10 to 20 are
/// the same.
const MIDDLE: f64 = -0.2;
const SLOPE: f64 = 14.0;

/// The likeness of objects (`semfm_fmap::likeness`) on the scale of one encoder.
///
/// One encoder finds everything .9 alike, another little above .3. So a likeness l is read between two numbers that
/// are measured for each encoder on the same background, procedural objects of six categories:
///
/// z = (l − unlike) / (alike − unlike), P = σ(s (z − m))
///
/// ```
/// use semfm_geom::LikenessScale;
/// let scale = LikenessScale { unlike: 0.5, alike: 0.8 };
/// assert!(scale.probability_of_one_kind(0.85) > 0.9);
/// assert!(scale.probability_of_one_kind(0.35) < 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LikenessScale {
    /// Mean likeness of two objects of different categories.
    pub unlike: f64,
    /// Mean likeness of two objects of one category.
    pub alike: f64,
}

impl LikenessScale {
    /// From likenesses of pairs of different kinds and of pairs of one; none where there are none of either, or where
    /// they do not differ.
    pub fn of(unlike: &[f64], alike: &[f64]) -> Option<Self> {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let scale = Self { unlike: mean(unlike), alike: mean(alike) };
        (scale.alike - scale.unlike > f64::EPSILON).then_some(scale)
    }

    /// The probability that two objects of this likeness are of one kind.
    pub fn probability_of_one_kind(&self, likeness: f64) -> f64 {
        let z = (likeness - self.unlike) / (self.alike - self.unlike);
        (1.0 + (-SLOPE * (z - MIDDLE)).exp()).recip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_is_the_means_of_both_kinds_of_pairs() {
        let scale = LikenessScale::of(&[0.4, 0.6], &[0.8]).unwrap();
        assert_eq!(scale, LikenessScale { unlike: 0.5, alike: 0.8 });
        let probabilities = [0.2, 0.4, 0.5, 0.65, 1.0].map(|l| scale.probability_of_one_kind(l));
        assert!(probabilities.is_sorted(), "{probabilities:?}");
        assert_eq!(LikenessScale::of(&[], &[0.8]), None);
        assert_eq!(LikenessScale::of(&[0.8], &[0.8]), None);
    }
}
