//! What an encoder says about a view: one vector per image patch.

use semfm_geom::Pinhole;

use crate::{Error, Result};

/// Where the patches of a view lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchGrid {
    /// Rows of the grid.
    pub rows: usize,
    /// Columns of the grid.
    pub cols: usize,
    /// The grid's rectangle in pixels, edges not centres: left, top, right, bottom.
    pub rect: [f32; 4],
}

impl PatchGrid {
    /// Pixel position (u, v) of the centre of patch `patch` = row · cols + column.
    pub fn centre(&self, patch: usize) -> [f64; 2] {
        let [left, top, right, bottom] = self.rect.map(f64::from);
        let across = ((patch % self.cols) as f64 + 0.5) / self.cols as f64;
        let down = ((patch / self.cols) as f64 + 0.5) / self.rows as f64;
        [left + across * (right - left), top + down * (bottom - top)]
    }
}

/// A grid of patch embeddings of one view.
///
/// A value of this type is proof that there is at least one patch and one dimension, that the arrays
/// have the grid's length, that the rectangle has an area, and that the vectors of valid patches are
/// finite. Those of patches that are not valid may hold anything.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchEmbeddings {
    grid: PatchGrid,
    dim: usize,
    data: Vec<f32>,
    coverage: Vec<u8>,
    valid: Vec<bool>,
}

impl PatchEmbeddings {
    /// Checks and keeps the arrays: `data` (rows × cols × dim), row-major, top-left patch first;
    /// `coverage` (rows × cols), the share of each patch that the object covers, 0 to 255; `valid`
    /// (rows × cols), false where a patch has nothing to say.
    ///
    /// # Errors
    /// [`Error::Invalid`], naming the field or the patch.
    pub fn new(
        grid: PatchGrid,
        dim: usize,
        data: Vec<f32>,
        coverage: Vec<u8>,
        valid: Vec<bool>,
    ) -> Result<Self> {
        let PatchGrid { rows, cols, rect } = grid;
        let n_patches = rows.checked_mul(cols).filter(|&n| n > 0);
        let n_values = n_patches.and_then(|n| n.checked_mul(dim)).filter(|&n| n > 0);
        let (Some(n_patches), Some(n_values)) = (n_patches, n_values) else {
            let found = format!("{rows} × {cols} × {dim}");
            return Err(Error::invalid("patches: grid", "positive sizes", found));
        };
        for (what, expected, found) in [
            ("patches: embedding values", n_values, data.len()),
            ("patches: coverages", n_patches, coverage.len()),
            ("patches: validities", n_patches, valid.len()),
        ] {
            if expected != found {
                return Err(Error::invalid(what, expected.to_string(), found.to_string()));
            }
        }
        let [left, top, right, bottom] = rect;
        if !(rect.iter().all(|x| x.is_finite()) && left < right && top < bottom) {
            let expected = "left < right, top < bottom";
            let found = format!("{left}, {top}, {right}, {bottom}");
            return Err(Error::invalid("patches: rectangle", expected, found));
        }
        let mut vectors = data.chunks_exact(dim).zip(&valid);
        if let Some(patch) = vectors.position(|(vector, &valid)| valid && !is_finite(vector)) {
            let vector = &data[patch * dim..][..dim];
            let k = vector.iter().position(|x| !x.is_finite()).unwrap_or(0);
            let (row, col) = (patch / cols, patch % cols);
            let found = format!("NaN or infinity at row {row}, column {col}, dimension {k}");
            return Err(Error::invalid("patches", "finite numbers in every valid patch", found));
        }
        Ok(Self { grid, dim, data, coverage, valid })
    }

    /// Where the patches lie.
    pub fn grid(&self) -> PatchGrid {
        self.grid
    }

    /// Number of patches, rows × cols.
    pub fn n_patches(&self) -> usize {
        self.valid.len()
    }

    /// Dimension d of each vector.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Vectors (rows × cols × d), row-major, top-left patch first.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// The vector (d) of patch `patch` = row · cols + column.
    pub fn vector(&self, patch: usize) -> &[f32] {
        &self.data[patch * self.dim..][..self.dim]
    }

    /// Share of each patch covered by the object (rows × cols), 0 to 255.
    pub fn coverage(&self) -> &[u8] {
        &self.coverage
    }

    /// False where a patch has nothing to say, since every roll's token was dropped (rows × cols).
    pub fn valid(&self) -> &[bool] {
        &self.valid
    }
}

/// Without an early exit, so that the compiler compares many numbers at once.
fn is_finite(vector: &[f32]) -> bool {
    vector.iter().fold(true, |all, x| all & x.is_finite())
}

/// A view's camera and what the encoder made of its picture: all that lifting needs.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedView {
    /// The camera the picture was taken with.
    pub camera: Pinhole,
    /// Its patches.
    pub patches: PatchEmbeddings,
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIM: usize = 4;

    /// What a sound grid of 2 × 3 patches is made of.
    struct Parts {
        grid: PatchGrid,
        dim: usize,
        data: Vec<f32>,
        coverage: Vec<u8>,
        valid: Vec<bool>,
    }

    impl Parts {
        fn new() -> Self {
            let grid = PatchGrid { rows: 2, cols: 3, rect: [0.0, 0.0, 48.0, 32.0] };
            let (data, coverage) = (vec![0.5; 6 * DIM], vec![255; 6]);
            Self { grid, dim: DIM, data, coverage, valid: vec![true; 6] }
        }

        fn check(self) -> Result<PatchEmbeddings> {
            PatchEmbeddings::new(self.grid, self.dim, self.data, self.coverage, self.valid)
        }
    }

    #[test]
    fn what_is_no_grid_of_embeddings_is_refused_by_name() {
        assert!(Parts::new().check().is_ok());
        type Change = fn(&mut Parts);
        let cases: [(Change, &str); 8] = [
            (|parts| parts.data[DIM * 4 + 1] = f32::NAN, "row 1, column 1, dimension 1"),
            (|parts| parts.data.truncate(9), "patches: embedding values"),
            (|parts| parts.dim = 2, "patches: embedding values"),
            (|parts| parts.coverage.truncate(5), "patches: coverages"),
            (|parts| parts.valid.push(true), "patches: validities"),
            (|parts| parts.grid.rect[2] = 0.0, "patches: rectangle"),
            (|parts| parts.grid.cols = 0, "patches: grid"),
            (|parts| parts.grid.rows = usize::MAX, "patches: grid"),
        ];
        for (change, expected) in cases {
            let mut parts = Parts::new();
            change(&mut parts);
            let message = parts.check().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}, expected {expected}");
        }
    }

    #[test]
    fn a_patch_that_is_not_valid_may_hold_anything() {
        let mut parts = Parts::new();
        parts.valid[4] = false;
        parts.data[DIM * 4 + 1] = f32::NAN;
        assert!(parts.check().is_ok());
    }

    #[test]
    fn centres_lie_half_a_patch_from_the_edges() {
        let grid = Parts::new().grid;
        assert_eq!((grid.centre(0), grid.centre(5)), ([8.0, 8.0], [40.0, 24.0]));
    }
}
