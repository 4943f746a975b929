//! The z-buffer: for every sample of a regular grid, the triangle nearest to the camera.

use std::ops::Range;

use super::triangle::{LinearForm, PixelBox, Projection, TriangleForms};

/// The nearest triangle at a sample: bits of 1/z (f32, not negative, so they sort as it does) above
/// the complement of the triangle's id. The larger of two hits is the nearer one, or the one with
/// the lower id, whatever the order of drawing.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Hit(u64);

impl Hit {
    /// Endlessly far: also what triangles beyond f32's range come to.
    const NONE: Self = Self(0);

    #[inline(always)]
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

/// Nearest triangle for a window of a grid of samples.
///
/// The grid has `per_pixel` samples along each side of a pixel; sample (i, j) looks through pixel
/// position ((i + ½)/per_pixel, (j + ½)/per_pixel).
pub(crate) struct Raster {
    pub per_pixel: u32,
    /// Pixels from one sample to the next.
    spacing: f64,
    /// Columns and rows of the grid that the window covers.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    /// What each sample sees (rows × columns), row-major.
    pub hits: Vec<Hit>,
}

impl Raster {
    /// A window of pixels in which nothing is seen yet.
    pub fn new(per_pixel: u32, columns: Range<usize>, rows: Range<usize>) -> Self {
        let hits = vec![Hit::NONE; columns.len() * rows.len() * (per_pixel as usize).pow(2)];
        Self::with(per_pixel, columns, rows, hits)
    }

    /// A window of pixels whose triangles (−1: none) and depths are known already.
    #[cfg(feature = "gpu")]
    pub fn of(
        per_pixel: u32,
        columns: Range<usize>,
        rows: Range<usize>,
        samples: impl Iterator<Item = (i32, f32)>,
    ) -> Self {
        let hits = samples.map(|(triangle, depth)| match u32::try_from(triangle) {
            Ok(face) => Hit::new(1.0 / depth, face),
            Err(_) => Hit::NONE,
        });
        Self::with(per_pixel, columns, rows, hits.collect())
    }

    fn with(per_pixel: u32, columns: Range<usize>, rows: Range<usize>, hits: Vec<Hit>) -> Self {
        let [columns, rows] = [columns, rows]
            .map(|pixels| pixels.start * per_pixel as usize..pixels.end * per_pixel as usize);
        Self { per_pixel, spacing: 1.0 / f64::from(per_pixel), columns, rows, hits }
    }

    /// Pixel position of the centre of a grid row or column.
    pub fn position(&self, sample: usize) -> f64 {
        (sample as f64 + 0.5) * self.spacing
    }

    /// The grid columns and rows of a window that a rectangle can reach.
    fn within(&self, bounds: PixelBox) -> [Range<usize>; 2] {
        [self.reach(bounds, 0, &self.columns), self.reach(bounds, 1, &self.rows)]
    }

    /// Whether a rectangle reaches any sample.
    fn has_samples(&self, bounds: PixelBox) -> bool {
        !self.within(bounds).iter().any(Range::is_empty)
    }

    /// Those along one axis.
    fn reach(&self, bounds: PixelBox, axis: usize, allowed: &Range<usize>) -> Range<usize> {
        let per_pixel = f64::from(self.per_pixel);
        // `as` saturates: an endless box is the whole range, an empty one none.
        let end = (bounds.high[axis] * per_pixel + 0.5).max(0.0) as i32 as usize;
        ceil(bounds.low[axis] * per_pixel - 0.5).max(allowed.start)..end.min(allowed.end)
    }

    #[inline(always)] // into the dispatch to vector instructions
    fn draw(&mut self, face: u32, forms: &TriangleForms, [columns, rows]: [Range<usize>; 2]) {
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
            let first = (row - self.rows.start) * self.columns.len();
            let span =
                first + span.start - self.columns.start..first + span.end - self.columns.start;
            for hit in &mut self.hits[span] {
                let inverse = at_least(lowest, at_most(highest, start + slope * column)) as f32;
                *hit = (*hit).max(Hit::new(inverse, face));
                column += 1.0;
            }
        }
    }
}

/// Draws every triangle into some rasters at once: its forms are the same for all of them.
pub(crate) struct DrawAll<'a> {
    pub projection: &'a Projection<'a>,
    pub rasters: &'a mut [Raster],
}

impl pulp::WithSimd for DrawAll<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let mesh = self.projection.mesh;
        for (places, block) in mesh.blocks() {
            if let Some(block) = block {
                let bounds = self.projection.block_box(block);
                if !self.rasters.iter().any(|raster| raster.has_samples(bounds)) {
                    continue;
                }
            }
            for place in places {
                let bounds = self.projection.pixel_box(place);
                let mut forms = None;
                for raster in &mut *self.rasters {
                    let within = raster.within(bounds);
                    // Most triangles of a dense mesh miss every sample: leave before any arithmetic.
                    if within.iter().any(Range::is_empty) {
                        continue;
                    }
                    if let Some(forms) = forms.get_or_insert_with(|| self.projection.forms(place)) {
                        raster.draw(mesh.id(place), forms, within);
                    }
                }
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
    #[inline(always)]
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
#[inline(always)]
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
#[inline(always)]
fn at_least(low: f64, x: f64) -> f64 {
    if x > low { x } else { low }
}

/// The smaller number, `high` where the other is NaN.
#[inline(always)]
fn at_most(high: f64, x: f64) -> f64 {
    if x < high { x } else { high }
}

/// Smallest index that is not below `x`; 0 for anything negative or NaN. (`f64::ceil` is a call
/// on processors without SSE 4.1, and casts to `usize` are slow on x86.)
#[inline(always)]
fn ceil(x: f64) -> usize {
    let below = x.max(0.0) as i32;
    below as usize + usize::from(f64::from(below) < x)
}
