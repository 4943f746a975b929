//! What an encoder says about a view: one vector per image patch.

use crate::{Error, Result};
use semfm_geom::Pinhole;

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

impl PatchEmbeddings {
    /// Pixel position (u, v) of the centre of patch `patch` = row · cols + column.
    pub fn centre(&self, patch: usize) -> [f64; 2] {
        let [left, top, right, bottom] = self.rect.map(f64::from);
        let across = ((patch % self.cols) as f64 + 0.5) / self.cols as f64;
        let down = ((patch / self.cols) as f64 + 0.5) / self.rows as f64;
        [left + across * (right - left), top + down * (bottom - top)]
    }

    /// Checks that there is at least one patch and one dimension, that the arrays have the grid's
    /// length, that the rectangle has an area, and that values of valid patches are finite. `name`
    /// leads the message.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the field and the patch.
    pub fn check(&self, name: &str) -> Result<()> {
        let refuse = |what: &str, expected: String, found: String| {
            Err(Error::invalid(format!("{name}: {what}"), expected, found))
        };
        let (rows, cols, dim) = (self.rows, self.cols, self.dim);
        let n_patches = rows.checked_mul(cols).filter(|&n| n > 0);
        let n_values = n_patches.and_then(|n| n.checked_mul(dim)).filter(|&n| n > 0);
        let (Some(n_patches), Some(n_values)) = (n_patches, n_values) else {
            return refuse("grid", "positive sizes".into(), format!("{rows} × {cols} × {dim}"));
        };
        for (what, expected, found) in [
            ("embedding values", n_values, self.data.len()),
            ("patch coverages", n_patches, self.coverage.len()),
            ("patch validities", n_patches, self.valid.len()),
        ] {
            if expected != found {
                return refuse(what, expected.to_string(), found.to_string());
            }
        }
        let [left, top, right, bottom] = self.rect;
        let finite = self.rect.iter().all(|x| x.is_finite());
        if !(finite && left < right && top < bottom) {
            return refuse(
                "rectangle",
                "left < right, top < bottom".into(),
                format!("{:?}", self.rect),
            );
        }
        for (patch, token) in self.data.chunks_exact(dim).enumerate() {
            if !self.valid[patch] {
                continue;
            }
            if let Some(k) = token.iter().position(|x| !x.is_finite()) {
                let what = format!("patch ({}, {}), dimension {k}", patch / cols, patch % cols);
                return refuse(&what, "a finite number".into(), token[k].to_string());
            }
        }
        Ok(())
    }
}

/// A view's camera and what the encoder made of its picture: all that lifting needs.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedView {
    /// The camera the picture was taken with.
    pub camera: Pinhole,
    /// Its patches.
    pub patches: PatchEmbeddings,
}
