//! The z-buffer: for every sample of a regular grid, the triangle nearest to the camera.

use std::ops::Range;

use super::triangle::{Projection, TriangleForms};

/// Marks a sample that sees no triangle.
pub(crate) const BACKGROUND: u32 = u32::MAX;

/// Nearest triangle and 1/z for a band of rows of a grid of samples, row-major.
///
/// The grid has `per_pixel` samples along each side of a pixel; sample (i, j) looks through pixel
/// position ((i + ½)/per_pixel, (j + ½)/per_pixel). Of triangles at the same f32 depth the one with
/// the lowest id wins.
pub(crate) struct Raster {
    pub per_pixel: u32,
    /// Samples in a row.
    pub width: usize,
    /// Rows of the grid that this band covers.
    pub rows: Range<usize>,
    /// 1/z in f32 (relative precision 6e-8), 0 on the background.
    pub inverse_depth: Vec<f32>,
    /// Triangle ids, [`BACKGROUND`] where there is none.
    pub triangles: Vec<u32>,
}

impl Raster {
    /// Draws every triangle into the band of grid rows `rows`.
    pub fn new(projection: &Projection<'_>, per_pixel: u32, rows: Range<usize>) -> Self {
        let width = projection.camera.width as usize * per_pixel as usize;
        let n_samples = width * rows.len();
        let mut raster = Self {
            per_pixel,
            width,
            rows,
            inverse_depth: vec![0.0; n_samples],
            triangles: vec![BACKGROUND; n_samples],
        };
        for face in 0..projection.mesh.n_faces() {
            let bounds = projection.pixel_box(face);
            let columns = raster.samples_in(bounds.low[0], bounds.high[0], 0..width);
            let rows = raster.samples_in(bounds.low[1], bounds.high[1], raster.rows.clone());
            // Most triangles of a dense mesh miss every sample: leave before any arithmetic.
            if columns.is_empty() || rows.is_empty() {
                continue;
            }
            if let Some(forms) = projection.forms(face) {
                raster.draw(face as u32, &forms, columns, rows);
            }
        }
        raster
    }

    /// Pixel position of the centre of a grid row or column.
    pub fn position(&self, sample: usize) -> f64 {
        (sample as f64 + 0.5) / f64::from(self.per_pixel)
    }

    /// Grid rows or columns whose positions lie within [low, high], clipped to `allowed`.
    fn samples_in(&self, low: f64, high: f64, allowed: Range<usize>) -> Range<usize> {
        let per_pixel = f64::from(self.per_pixel);
        // `as` saturates, and takes NaN to 0: an endless box is the whole range, an empty one none.
        let start = (low * per_pixel - 0.5).ceil() as usize;
        let end = (high * per_pixel + 0.5).floor() as usize;
        start.max(allowed.start)..end.min(allowed.end)
    }

    fn draw(
        &mut self,
        face: u32,
        forms: &TriangleForms,
        columns: Range<usize>,
        rows: Range<usize>,
    ) {
        let per_pixel = f64::from(self.per_pixel);
        let [lowest, highest] = forms.bounds;
        let slope = forms.inverse_depth.du / per_pixel;
        for row in rows {
            let v = self.position(row);
            let Some(span) = self.span(forms, v, &columns) else { continue };
            let start = forms.inverse_depth.row(v) + forms.inverse_depth.du * 0.5 / per_pixel;
            let first = (row - self.rows.start) * self.width;
            let depths = &mut self.inverse_depth[first..][span.clone()];
            let ids = &mut self.triangles[first..][span.clone()];
            for ((column, depth), id) in span.zip(depths).zip(ids) {
                let inverse = (start + slope * column as f64).clamp(lowest, highest) as f32;
                if inverse > *depth {
                    (*depth, *id) = (inverse, face);
                }
            }
        }
    }

    /// Columns of a row that lie inside all three edges: each edge bounds them from one side.
    fn span(&self, forms: &TriangleForms, v: f64, columns: &Range<usize>) -> Option<Range<usize>> {
        let per_pixel = f64::from(self.per_pixel);
        let (mut low, mut high) = (columns.start as f64, columns.end as f64 - 1.0);
        for weight in &forms.weights {
            let row = weight.row(v);
            // Two triangles at a shared edge compute the same quotient: one takes the columns up
            // to it, the other those from it on.
            let crossing = -row / weight.du * per_pixel - 0.5;
            if weight.du > 0.0 {
                low = low.max(crossing);
            } else if weight.du < 0.0 {
                high = high.min(crossing);
            } else if row < 0.0 {
                return None;
            }
        }
        let (start, end) = (low.ceil() as usize, high.floor() + 1.0);
        (end > 0.0 && start < end as usize).then_some(start..end as usize)
    }
}
