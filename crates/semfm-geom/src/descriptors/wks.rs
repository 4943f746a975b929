//! The wave kernel signature
//! (Aubry, Schlickewei & Cremers 2011, "The Wave Kernel Signature: A Quantum Mechanical Approach
//! to Shape Analysis").

use faer::Mat;

use super::{Spectrum, evenly, spectrum, weighted_squares};
use crate::{Eigenbasis, Error, Result};

/// How the wave kernel signature is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct WksSettings {
    /// Energies, spread evenly over the logarithms of the eigenvalues.
    pub n_energies: usize,
}

impl Default for WksSettings {
    fn default() -> Self {
        Self { n_energies: 100 }
    }
}

/// Width σ of an energy band, in steps of the full range of log λ over `n_energies`; the energies
/// keep 2 σ away from both ends. Both numbers as in pyFM, so that descriptors can be compared.
const BAND: f64 = 7.0;

/// The probability of meeting a quantum particle of each energy at each vertex,
/// (n × n_energies): Σ exp(−(e − ln λ)² / 2σ²) φ², divided by the sum of the exponentials.
///
/// Constant functions (λ = 0, one for each connected piece) have no energy and are left out. With
/// a single energy in the basis, σ is 1.
///
/// # Errors
/// [`Error::OutOfRange`] for no energies, or a basis without an eigenvalue above zero.
pub fn wks(basis: &Eigenbasis, settings: &WksSettings) -> Result<Mat<f64>> {
    Ok(weighted_squares(basis, bands(basis, settings)?))
}

/// The wave kernel between each vertex and each of some landmarks, (n × landmarks · n_energies),
/// landmark by landmark: Σ exp(−(e − ln λ)² / 2σ²) φ(landmark) φ, divided by the sum of the
/// exponentials. Where two shapes share landmarks, these functions correspond, whatever the
/// symmetries of the shapes.
///
/// # Errors
/// [`Error::OutOfRange`] for no energies, a basis without an eigenvalue above zero, or a landmark
/// beyond the vertices.
pub fn landmark_wks(
    basis: &Eigenbasis,
    landmarks: &[u32],
    settings: &WksSettings,
) -> Result<Mat<f64>> {
    if let Some(landmark) = landmarks.iter().find(|&&l| l as usize >= basis.n_vertices()) {
        let expected = format!("a vertex below {}", basis.n_vertices());
        let found = landmark.to_string();
        return Err(Error::OutOfRange { what: "landmark", expected, found });
    }
    let bands = bands(basis, settings)?;
    let n = bands.ncols();
    let totals: Vec<f64> = (0..n).map(|e| bands.col(e).iter().sum()).collect();
    let weights = Mat::from_fn(basis.k(), landmarks.len() * n, |k, column| {
        let (landmark, e) = (landmarks[column / n] as usize, column % n);
        bands[(k, e)] / totals[e] * basis.functions[(landmark, k)]
    });
    Ok(basis.reconstruct_all(weights.as_ref()))
}

/// Weight of each eigenfunction in each band of energy (k × n_energies), up to a factor a band.
fn bands(basis: &Eigenbasis, settings: &WksSettings) -> Result<Mat<f64>> {
    let n = settings.n_energies;
    if n == 0 {
        return Err(Error::OutOfRange {
            what: "n_energies",
            expected: "1 or more".into(),
            found: "0".into(),
        });
    }
    let Spectrum { smallest, largest } = spectrum(basis)?;
    let (low, high) = (smallest.ln(), largest.ln());
    let sigma = if high > low { BAND * (high - low) / n as f64 } else { 1.0 };
    let energies: Vec<f64> = evenly(low + 2.0 * sigma, high - 2.0 * sigma, n).collect();
    let positive: Vec<usize> = (0..basis.k()).filter(|&k| basis.values[k] >= smallest).collect();
    let mut weights = Mat::zeros(basis.k(), n);
    let mut exponents = vec![0.0; positive.len()];
    for (e, energy) in energies.iter().enumerate() {
        // −(e − ln λ)² / 2σ², taken from their largest, so that far bands do not vanish.
        for (exponent, &k) in exponents.iter_mut().zip(&positive) {
            let distance = (energy - basis.values[k].ln()) / sigma;
            *exponent = -0.5 * distance * distance;
        }
        let top = exponents.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (&exponent, &k) in exponents.iter().zip(&positive) {
            weights[(k, e)] = (exponent - top).exp();
        }
    }
    Ok(weights)
}
