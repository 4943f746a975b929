//! What a pretrained network is: pictures in, grids of raw tokens out.

use std::fmt;

use semfm_views::{PatchGrid, View};

use crate::Result;
use crate::turned::{Turned, picture_size};

/// A picture in sRGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Picture {
    pub height: usize,
    pub width: usize,
    /// Height × width, row-major.
    pub rgb: Vec<[u8; 3]>,
}

impl Picture {
    /// A view's picture turned by quarters, counter-clockwise.
    pub fn turned(view: &View, quarters: u32) -> Self {
        let (height, width) = picture_size(&view.camera);
        let turned = Turned::new(height, width, quarters);
        let pixels = view.rgb.as_chunks::<3>().0;
        let (height, width) = turned.size();
        Self { height, width, rgb: turned.places().map(|place| pixels[place]).collect() }
    }
}

/// Raw tokens of a picture by one output of a network.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RawTokens {
    pub rows: usize,
    pub cols: usize,
    /// Length of a token.
    pub dim: usize,
    /// Rows × columns × dim, top-left token first.
    pub values: Vec<f32>,
}

/// A network that knows nothing of turns, norms or files.
pub(crate) trait TokenNetwork: fmt::Debug + Send + Sync {
    /// Where its tokens lie in pictures of this size.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) for sizes that it does not take.
    fn grid(&self, height: usize, width: usize) -> Result<PatchGrid>;

    /// Raw tokens of a picture by each of its outputs, on the grid of [`grid`](Self::grid); works on
    /// one thread.
    ///
    /// # Errors
    /// [`Error::Network`](crate::Error::Network).
    fn tokens(&self, picture: &Picture) -> Result<Vec<RawTokens>>;
}

/// Channels first (dim × tokens) as tokens (tokens × dim).
pub(crate) fn by_token(values: &[f32], dim: usize) -> Vec<f32> {
    let n = values.len() / dim;
    (0..n * dim).map(|place| values[place % dim * n + place / dim]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_first_become_tokens() {
        // Two channels of three tokens.
        assert_eq!(by_token(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 2), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    }
}
