//! From raw tokens to patch embeddings: turns, outlier tokens, unit length, average.
//!
//! Tokens of pretrained networks hold the place in the picture besides what is there, so a long object
//! would match its own mirror image end for end. Averaging over pictures turned by quarters cancels
//! that. Some transformers put a few tokens of huge norm at places without local information (Darcet,
//! Oquab, Mairal & Bojanowski, "Vision Transformers Need Registers", 2024); they are told by their raw
//! norm. The program `semfm-embed` does the same (`python/semfm/sidecar/patches.py`).

use semfm_views::{PatchGrid, View};

use super::token_network::{Picture, RawTokens, TokenNetwork};
use crate::turned::{Turned, picture_size};
use crate::{Error, Result};

/// A token is an outlier where its raw norm passes this multiple of its grid's median. Plain tokens of
/// MobileNetV2 (objects on white) reach 3.5 times the median; the outliers worth dropping reach 15.
pub(crate) const OUTLIER_RATIO: f32 = 5.0;

/// Tokens of one picture: averaged over its turns, not scaled back to unit length.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AveragedTokens {
    pub grid: PatchGrid,
    /// Length of a token.
    pub dim: usize,
    /// Rows × columns × dim; zero where not valid.
    pub data: Vec<f32>,
    /// Rows × columns: whether the token was kept in some turn.
    pub valid: Vec<bool>,
}

/// Shows a view to a network at some turns (quarters, counter-clockwise), scales the tokens of each
/// to unit length, turns them back and averages those that are no outliers.
pub(crate) fn averaged_tokens(
    network: &dyn TokenNetwork,
    view: &View,
    quarters: &[u32],
) -> Result<AveragedTokens> {
    let (height, width) = picture_size(&view.camera);
    let grid = network.grid(height, width)?;
    let n = grid.rows * grid.cols;
    let (mut data, mut dim, mut n_valid) = (Vec::new(), 0, vec![0u32; n]);
    for &turn in quarters {
        let outputs = network.tokens(&Picture::turned(view, turn))?;
        let unit = UnitTokens::new(&outputs)?;
        let back = Turned::new(unit.rows, unit.cols, (4 - turn) % 4);
        if back.size() != (grid.rows, grid.cols) || (dim != 0 && dim != unit.dim) {
            let expected = format!("{} × {} tokens at every turn", grid.rows, grid.cols);
            let found = format!("{} × {} at {}°", back.size().0, back.size().1, 90 * turn);
            return Err(Error::invalid("grid of tokens", expected, found));
        }
        dim = unit.dim;
        data.resize(n * dim, 0.0);
        for (patch, place) in back.places().enumerate() {
            let token = &unit.values[place * dim..][..dim];
            data[patch * dim..][..dim].iter_mut().zip(token).for_each(|(sum, x)| *sum += x);
            n_valid[patch] += u32::from(unit.valid[place]);
        }
    }
    for (token, &count) in data.chunks_exact_mut(dim).zip(&n_valid) {
        token.iter_mut().for_each(|sum| *sum /= count.max(1) as f32);
    }
    let valid = n_valid.iter().map(|&count| count > 0).collect();
    Ok(AveragedTokens { grid, dim, data, valid })
}

/// Tokens of all outputs, each scaled to unit length, one behind the other.
#[derive(Debug)]
struct UnitTokens {
    rows: usize,
    cols: usize,
    dim: usize,
    /// Rows × columns × dim; zero where not valid.
    values: Vec<f32>,
    /// False where the token of any output is an outlier or zero.
    valid: Vec<bool>,
}

impl UnitTokens {
    fn new(outputs: &[RawTokens]) -> Result<Self> {
        let [first, ..] = outputs else {
            return Err(Error::invalid("tokens", "an output", "none"));
        };
        let (rows, cols) = (first.rows, first.cols);
        let dim: usize = outputs.iter().map(|output| output.dim).sum();
        let norms: Vec<Vec<f32>> = outputs.iter().map(norms).collect::<Result<_>>()?;
        let mut valid = vec![true; rows * cols];
        for norms in &norms {
            let most = OUTLIER_RATIO * median(norms);
            valid.iter_mut().zip(norms).for_each(|(valid, &norm)| {
                *valid &= norm > 0.0 && norm <= most;
            });
        }
        let mut values = vec![0.0; rows * cols * dim];
        for (patch, token) in values.chunks_exact_mut(dim).enumerate() {
            let mut token = &mut token[..];
            for (output, norms) in outputs.iter().zip(&norms) {
                let (part, rest) = token.split_at_mut(output.dim);
                if valid[patch] {
                    let scale = norms[patch].recip();
                    let raw = &output.values[patch * output.dim..][..output.dim];
                    part.iter_mut().zip(raw).for_each(|(x, raw)| *x = raw * scale);
                }
                token = rest;
            }
        }
        Ok(Self { rows, cols, dim, values, valid })
    }
}

/// The norm of each token.
fn norms(tokens: &RawTokens) -> Result<Vec<f32>> {
    let norms: Vec<f32> = tokens
        .values
        .chunks_exact(tokens.dim)
        .map(|token| token.iter().map(|x| x * x).sum::<f32>().sqrt())
        .collect();
    match norms.iter().find(|norm| !norm.is_finite()) {
        Some(norm) => Err(Error::invalid("tokens", "finite numbers", format!("a norm of {norm}"))),
        None => Ok(norms),
    }
}

/// The median; of an even number the mean of the two in the middle.
fn median(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let half = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[half] } else { (sorted[half - 1] + sorted[half]) / 2.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(dim: usize, values: &[f32]) -> RawTokens {
        RawTokens { rows: 1, cols: values.len() / dim, dim, values: values.to_vec() }
    }

    #[test]
    fn outputs_are_scaled_one_by_one() {
        let unit =
            UnitTokens::new(&[tokens(2, &[3.0, 4.0, 0.0, 2.0]), tokens(1, &[-7.0, 0.5])]).unwrap();
        assert_eq!((unit.dim, unit.cols), (3, 2));
        assert_eq!(unit.values, [0.6, 0.8, -1.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn outliers_and_zeros_have_nothing_to_say() {
        let raw = [1.0, 1.0, 5.0, 5.1, 0.0, 1.0, 1.0];
        let unit = UnitTokens::new(&[tokens(1, &raw), tokens(1, &[2.0; 7])]).unwrap();
        assert_eq!(unit.valid, [true, true, true, false, false, true, true]);
        assert_eq!(unit.values[6..10], [0.0; 4]);
    }

    #[test]
    fn numbers_that_are_none_are_refused() {
        for bad in [f32::NAN, f32::INFINITY, 1e30] {
            let error = UnitTokens::new(&[tokens(1, &[1.0, bad])]).unwrap_err();
            assert!(error.to_string().contains("finite"), "{error}");
        }
    }

    #[test]
    fn the_median_of_an_even_number_lies_between() {
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), 2.5);
        assert_eq!(median(&[9.0, 1.0, 3.0]), 3.0);
    }
}
