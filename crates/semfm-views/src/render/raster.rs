//! The z-buffer: for every sample of a regular grid, the triangle nearest to the camera.

use std::ops::Range;

use super::triangle::{LinearForm, Projection, TriangleForms};

/// The nearest triangle at a sample: bits of 1/z (f32, not negative, so they sort as it does) above
/// the complement of the triangle's id. The larger of two hits is the nearer one, or the one with
/// the lower id, whatever the order of drawing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Hit(u64);

impl Hit {
    /// Endlessly far: also what triangles beyond f32's range come to.
    const NONE: Self = Self(0);

    fn new(inverse_depth: f32, face: u32) -> Self {
        Self(u64::from(inverse_depth.to_bits()) << 32 | u64::from(!face))
    }

    /// 1/z (relative precision 6e-8), 0 on the background.
    pub fn inverse_depth(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    /// Triangle id, `None` on the background.
    pub fn face(self) -> Option<u32> {
        (self.inverse_depth() > 0.0).then_some(!self.0 as u32)
    }
}

/// Nearest triangle for a band of rows of a grid of samples.
///
/// The grid has `per_pixel` samples along each side of a pixel; sample (i, j) looks through pixel
/// position ((i + ½)/per_pixel, (j + ½)/per_pixel).
pub(crate) struct Raster {
    pub per_pixel: u32,
    /// Pixels from one sample to the next.
    spacing: f64,
    /// Samples in a row.
    pub width: usize,
    /// Rows of the grid that this band covers.
    pub rows: Range<usize>,
    /// What each sample sees (rows × width), row-major.
    pub hits: Vec<Hit>,
}

impl Raster {
    /// Draws every triangle into the band of grid rows `rows`.
    pub fn new(projection: &Projection<'_>, per_pixel: u32, rows: Range<usize>) -> Self {
        let width = projection.camera.width as usize * per_pixel as usize;
        let n_samples = width * rows.len();
        let spacing = 1.0 / f64::from(per_pixel);
        let hits = vec![Hit::NONE; n_samples];
        let mut raster = Self { per_pixel, spacing, width, rows, hits };
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

    /// A raster of a whole picture of which somebody else found the triangles (−1: none) and depths.
    #[cfg(feature = "gpu")]
    pub fn of(per_pixel: u32, width: usize, triangles: &[i32], depth: &[f32]) -> Self {
        let hit = |(&triangle, &depth): (&i32, &f32)| match u32::try_from(triangle) {
            Ok(face) => Hit::new(1.0 / depth, face),
            Err(_) => Hit::NONE,
        };
        let hits: Vec<Hit> = triangles.iter().zip(depth).map(hit).collect();
        let rows = 0..hits.len() / width;
        Self { per_pixel, spacing: 1.0 / f64::from(per_pixel), width, rows, hits }
    }

    /// Pixel position of the centre of a grid row or column.
    pub fn position(&self, sample: usize) -> f64 {
        (sample as f64 + 0.5) * self.spacing
    }

    /// Grid rows or columns whose positions lie within [low, high], clipped to `allowed`.
    fn samples_in(&self, low: f64, high: f64, allowed: Range<usize>) -> Range<usize> {
        let per_pixel = f64::from(self.per_pixel);
        // `as` saturates: an endless box is the whole range, an empty one none.
        let end = (high * per_pixel + 0.5).max(0.0) as i32 as usize;
        ceil(low * per_pixel - 0.5).max(allowed.start)..end.min(allowed.end)
    }

    fn draw(
        &mut self,
        face: u32,
        forms: &TriangleForms,
        columns: Range<usize>,
        rows: Range<usize>,
    ) {
        let per_pixel = f64::from(self.per_pixel);
        let edges = forms.weights.map(|weight| Edge::new(weight, per_pixel));
        let [lowest, highest] = forms.bounds;
        let slope = forms.inverse_depth.du * self.spacing;
        for row in rows {
            let v = self.position(row);
            let span = span(&edges, v, &columns);
            if span.is_empty() {
                continue;
            }
            let start = forms.inverse_depth.row(v) + 0.5 * slope;
            let mut column = span.start as f64;
            let first = (row - self.rows.start) * self.width;
            for hit in &mut self.hits[first..][span] {
                let inverse = at_least(lowest, at_most(highest, start + slope * column)) as f32;
                *hit = (*hit).max(Hit::new(inverse, face));
                column += 1.0;
            }
        }
    }
}

/// The border of a half-plane, made ready to be cut with many rows without branching.
#[derive(Clone, Copy)]
struct Edge {
    weight: LinearForm,
    /// Grid columns to the crossing, per unit of the form's value at the row's start.
    columns_per_value: f64,
    /// From the crossing to the bound that this edge sets: half a column back to the sample's own
    /// index on the side that it bounds, endlessly far on the other.
    to_low: f64,
    to_high: f64,
}

impl Edge {
    fn new(weight: LinearForm, per_pixel: f64) -> Self {
        let (far, half) = (f64::INFINITY, -0.5);
        let (to_low, to_high) = if weight.du < 0.0 { (-far, half) } else { (half, far) };
        // A level edge crosses at −∞ above zero and at +∞ below: all of the row, or nothing.
        let du = if weight.du == 0.0 { 0.0 } else { weight.du };
        Self { weight, columns_per_value: -per_pixel / du, to_low, to_high }
    }
}

/// Columns of the row at `v` that lie inside all three edges: each bounds them from one side.
///
/// Two triangles compute the same crossing for the edge they share, so one takes the columns up to
/// it and the other those from it on.
fn span(edges: &[Edge; 3], v: f64, columns: &Range<usize>) -> Range<usize> {
    let (mut low, mut high) = (columns.start as f64, columns.end as f64 - 1.0);
    for edge in edges {
        let crossing = edge.weight.row(v) * edge.columns_per_value;
        let (from, to) = (crossing + edge.to_low, crossing + edge.to_high);
        // ∞ − ∞ and 0 · ∞, on a level edge, bound nothing.
        low = at_least(low, from);
        high = at_most(high, to);
    }
    // Within the columns, so the casts neither saturate nor see a negative number.
    if low <= high { ceil(low)..high as i32 as usize + 1 } else { 0..0 }
}

/// The larger number, `low` where the other is NaN: one instruction, unlike `f64::max`.
fn at_least(low: f64, x: f64) -> f64 {
    if x > low { x } else { low }
}

/// The smaller number, `high` where the other is NaN.
fn at_most(high: f64, x: f64) -> f64 {
    if x < high { x } else { high }
}

/// Smallest index that is not below `x`; 0 for anything negative or NaN. (`f64::ceil` is a call
/// on processors without SSE 4.1, and casts to `usize` are slow on x86.)
fn ceil(x: f64) -> usize {
    let below = x.max(0.0) as i32;
    below as usize + usize::from(f64::from(below) < x)
}
