//! What each term of a score counts: fitted to trials in MuJoCo, and what is asked beyond holding.

use crate::{Error, Result};

/// Names of the terms of a score, in the order in which they are listed.
pub const TERMS: [&str; 13] = [
    "contact",
    "friction",
    "epsilon",
    "gravity",
    "weight",
    "lever",
    "bite",
    "evenness",
    "centred",
    "closing",
    "clearance",
    "region",
    "approach",
];

/// How a score is made of its terms.
///
/// The probability that a grasp holds is 1 / (1 + exp(−z)), z = `constant` + Σ weight · term (logistic regression),
/// over the terms up to `centred`. What is asked beyond that multiplies it: each of `closing`, `clearance`, `region`
/// and `approach` takes away up to its share, by the factor 1 − share · (1 − term).
///
/// The log-odds are those of 342 trials in MuJoCo on 37 objects (`bench/grasp_score.py`, whose tables in
/// `bench/README.md` tell what each term is worth). `bite` and `closing` came out at -0.1 and -0.8, that is at
/// nothing and on the wrong side: an object that turned while the pads closed is held as well as another. It is not
/// where it was planned, though, so `closing` is asked beyond holding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreWeights {
    /// Log-odds of holding where every term is 0.
    pub constant: f64,
    /// `contact`: the part of the pads that touches. Log-odds, as all weights up to `centred`.
    pub contact: f64,
    /// `friction`: how far inside the friction cones the forces lie.
    pub friction: f64,
    /// `epsilon`: Ferrari & Canny's ε against that of two full pads around the centre of mass.
    pub epsilon: f64,
    /// `gravity`: how little of the torque that friction can hold the object's weight asks for.
    pub gravity: f64,
    /// `weight`: how little of the force that friction can hold the object's weight asks for.
    pub weight: f64,
    /// `lever`: how near the contacts are to the centre of mass.
    pub lever: f64,
    /// `bite`: how much of the pads' length is filled.
    pub bite: f64,
    /// `evenness`: how evenly the pads are pressed.
    pub evenness: f64,
    /// `centred`: how far from the pads' rims the forces act.
    pub centred: f64,
    /// `closing`: how little the object turns while the pads close. A share from 0 to 1, as the three below.
    pub closing: f64,
    /// `clearance`: how far the open gripper stays from everything.
    pub clearance: f64,
    /// `region`: weight of the region under the pads.
    pub region: f64,
    /// `approach`: agreement with the demonstrated approach; left out where none was given.
    pub approach: f64,
}

impl Default for ScoreWeights {
    fn default() -> Self {
        Self {
            constant: -7.34,
            contact: 1.42,
            friction: 1.43,
            epsilon: 1.31,
            gravity: 6.43,
            weight: 1.77,
            lever: 0.78,
            bite: 0.0,
            evenness: 0.23,
            centred: 0.53,
            closing: 0.2,
            clearance: 0.05,
            region: 0.5,
            approach: 0.5,
        }
    }
}

impl ScoreWeights {
    /// The weights of what makes a grasp hold, by term.
    fn physical(&self) -> [(&'static str, f64); 9] {
        [
            ("contact", self.contact),
            ("friction", self.friction),
            ("epsilon", self.epsilon),
            ("gravity", self.gravity),
            ("weight", self.weight),
            ("lever", self.lever),
            ("bite", self.bite),
            ("evenness", self.evenness),
            ("centred", self.centred),
        ]
    }

    /// The shares of what is asked beyond that, by term.
    fn preferences(&self) -> [(&'static str, f64); 4] {
        [
            ("closing", self.closing),
            ("clearance", self.clearance),
            ("region", self.region),
            ("approach", self.approach),
        ]
    }

    /// The probability that a grasp with these terms holds.
    pub(crate) fn probability(&self, terms: &[(&'static str, f64)]) -> f64 {
        let weighted =
            self.physical().into_iter().filter_map(|(name, w)| Some(w * term(terms, name)?));
        1.0 / (1.0 + (-self.constant - weighted.sum::<f64>()).exp())
    }

    /// The factor of what is asked beyond holding, 0 to 1.
    pub(crate) fn preference(&self, terms: &[(&'static str, f64)]) -> f64 {
        let factors = self
            .preferences()
            .into_iter()
            .filter_map(|(name, share)| Some(1.0 - share * (1.0 - term(terms, name)?)));
        factors.product()
    }

    /// Says which weight is out of its range.
    pub(crate) fn check(&self) -> Result<()> {
        let log_odds = self.physical().map(|(_, w)| w);
        if !(log_odds.iter().all(|w| w.is_finite()) && self.constant.is_finite()) {
            let expected = "finite log-odds".into();
            let found = format!("{} and {log_odds:?}", self.constant);
            return Err(Error::OutOfRange { what: "weights", expected, found });
        }
        match self.preferences().into_iter().find(|(_, share)| !(0.0..=1.0).contains(share)) {
            None => Ok(()),
            Some((what, share)) => {
                let expected = "a share from 0 to 1".into();
                Err(Error::OutOfRange { what, expected, found: share.to_string() })
            }
        }
    }
}

fn term(terms: &[(&'static str, f64)], name: &str) -> Option<f64> {
    terms.iter().find(|term| term.0 == name).map(|term| term.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_term_up_to_centred_is_a_weight_and_the_others_take_away_up_to_their_share() {
        let weights = ScoreWeights::default();
        let named = weights.physical().map(|(name, _)| name);
        let asked = weights.preferences().map(|(name, _)| name);
        assert_eq!(named.into_iter().chain(asked).collect::<Vec<_>>(), TERMS);
        let all = |x: f64| TERMS.map(|name| (name, x));
        assert!(weights.probability(&all(1.0)) > 0.9 && weights.probability(&all(0.0)) < 0.05);
        assert_eq!(weights.preference(&all(1.0)), 1.0);
        let half = weights.preference(&[("region", 0.0)]);
        assert!((half - (1.0 - weights.region)).abs() < 1e-12, "what was not asked counts nothing");
    }

    #[test]
    fn bad_weights_are_named() {
        ScoreWeights::default().check().unwrap();
        let bad = ScoreWeights { approach: 1.5, ..Default::default() };
        assert!(bad.check().unwrap_err().to_string().contains("approach"));
        let bad = ScoreWeights { gravity: f64::NAN, ..Default::default() };
        assert!(bad.check().unwrap_err().to_string().contains("weights"));
    }
}
