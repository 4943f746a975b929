//! The heat kernel signature
//! (Sun, Ovsjanikov & Guibas 2009, "A Concise and Provably Informative Multi-Scale Signature").

use std::f64::consts::LN_10;

use faer::Mat;

use super::{Spectrum, evenly, spectrum, weighted_squares};
use crate::{Eigenbasis, Error, Result};

/// How the heat kernel signature is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct HksSettings {
    /// Diffusion times, spread evenly in logarithm over the range that the basis resolves.
    pub n_times: usize,
}

impl Default for HksSettings {
    fn default() -> Self {
        Self { n_times: 100 }
    }
}

/// How much heat is left at each vertex after each time, (n × n_times): Σ exp(−λt) φ², divided by
/// the heat trace Σ exp(−λt) so that all times weigh alike.
///
/// Times run from 4 ln 10 / λ_max to 4 ln 10 / λ_min, as in the paper, with λ_min the
/// smallest eigenvalue above zero.
///
/// # Errors
/// [`Error::OutOfRange`] for no times, or a basis without an eigenvalue above zero.
pub fn hks(basis: &Eigenbasis, settings: &HksSettings) -> Result<Mat<f64>> {
    if settings.n_times == 0 {
        return Err(Error::OutOfRange {
            what: "n_times",
            expected: "1 or more".into(),
            found: "0".into(),
        });
    }
    let Spectrum { smallest, largest } = spectrum(basis)?;
    // t from 4 ln 10 / λ_max to 4 ln 10 / λ_min, evenly in ln t.
    let [first, last] = [largest, smallest].map(|lambda| (4.0 * LN_10 / lambda).ln());
    let times: Vec<f64> = evenly(first, last, settings.n_times).map(f64::exp).collect();
    let weights = Mat::from_fn(basis.k(), times.len(), |k, t| (-times[t] * basis.values[k]).exp());
    Ok(weighted_squares(basis, weights))
}
