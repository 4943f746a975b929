//! What an encoder says about a view: one vector per image patch.

use crate::Camera;

/// A grid of patch embeddings of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchEmbeddings {
    /// Rows of the grid.
    pub rows: usize,
    /// Columns of the grid.
    pub cols: usize,
    /// Dimension d of each vector.
    pub dim: usize,
    /// Vectors (rows × cols × d), row-major, top-left patch first.
    pub data: Vec<f32>,
    /// The grid's rectangle in pixels, edges not centres: left, top, right, bottom.
    pub rect: [f32; 4],
    /// Share of each patch covered by the object (rows × cols), 0 to 255.
    pub coverage: Vec<u8>,
    /// False where every roll's token was dropped (rows × cols).
    pub valid: Vec<bool>,
}

/// A view's camera and what the encoder made of its picture: all that lifting needs.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedView {
    /// The camera the picture was taken with.
    pub camera: Camera,
    /// Its patches.
    pub patches: PatchEmbeddings,
}
