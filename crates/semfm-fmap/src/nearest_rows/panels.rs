//! Rows in f32, packed so that a product of a few queries and a few points runs in registers.

use rayon::prelude::*;

use super::Rows;
use super::rows::Range;
use crate::{Error, Result};

/// Points whose distances are computed together: two AVX2 registers.
pub(super) const PANEL: usize = 16;
/// Queries that share a panel: with two registers of points each, twelve sums stay in registers.
pub(super) const TILE: usize = 6;
/// Columns between two looks at the bound, and columns of the balls around panels. On people and animals at k = 100 a
/// panel's ball in 8, 12, 16, 24, 32, 48, 100 columns lets 24, 16, 13, 10, 11, 12, 22 % of the tiles through (animals 55,
/// 38, 32, 25, 22, 25, 27 %): fewer columns tell less, more make the balls wide.
pub(super) const CHUNK: usize = 24;
/// Groups that one thread packs at a time.
const GROUPS: usize = 256;

/// A common shift and a power of two: distances change by that factor alone, and f32 neither overflows nor loses small
/// differences in a large mean.
pub(super) struct Frame {
    mean: Vec<f64>,
    /// Length in this frame over length.
    pub scale: f64,
    /// In this frame no row of either side is longer.
    pub longest: f32,
}

impl Frame {
    /// # Errors
    /// [`Error::OutOfRange`] for a number that is not finite or whose square is not.
    pub fn of(queries: &Rows<'_>, points: &Rows<'_>) -> Result<Self> {
        let (ranges, of_queries) = (points.ranges(), queries.ranges());
        let mean: Vec<f64> = ranges.iter().map(|range| range.mean).collect();
        // √ Σ_c max |x_c − mean_c|² is an upper bound.
        let bound = |ranges: &[Range]| {
            let farthest = ranges.iter().zip(&mean).map(|(range, &mean)| range.farthest(mean));
            farthest.map(|x| x * x).sum::<f64>().sqrt()
        };
        let a = bound(&ranges);
        let b = if queries.len() == 0 { 0.0 } else { bound(&of_queries) };
        let longest = if a > b || a.is_nan() { a } else { b };
        if !longest.is_finite() {
            queries.check_finite("queries of a nearest-row search")?;
            points.check_finite("points of a nearest-row search")?;
            let what = "rows of a nearest-row search";
            return Error::out_of_range(what, "numbers whose squares are finite", longest);
        }
        let scale = if longest > 0.0 { longest.log2().floor().exp2().recip() } else { 1.0 };
        let scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        Ok(Self { mean, scale, longest: (longest * scale) as f32 })
    }
}

/// Rows in groups of `WIDTH`: number c of row i of group g stands at (g k + c) · WIDTH + i.
pub(super) struct Packed<const WIDTH: usize> {
    numbers: Vec<f32>,
    k: usize,
    /// Id of each row; the last group is filled up with its last row.
    pub ids: Vec<u32>,
}

impl<const WIDTH: usize> Packed<WIDTH> {
    pub fn new(rows: &Rows<'_>, order: &[u32], frame: &Frame) -> Self {
        let k = rows.n_columns();
        let mut ids = order.to_vec();
        if let Some(&last) = ids.last() {
            ids.resize(ids.len().next_multiple_of(WIDTH), last);
        }
        let mut numbers = vec![0.0f32; ids.len() * k];
        if k > 0 {
            let parts = numbers.par_chunks_mut(GROUPS * WIDTH * k);
            parts.zip(ids.par_chunks(GROUPS * WIDTH)).for_each(|(numbers, ids)| {
                let row_ids = rows.row_ids(ids);
                for c in 0..k {
                    let (column, factor) = rows.column(c);
                    // (factor · x − mean) · scale
                    let (factor, shift) = (factor * frame.scale, frame.mean[c] * frame.scale);
                    let groups = row_ids.as_chunks::<WIDTH>().0.iter();
                    for (group, ids) in numbers.chunks_exact_mut(WIDTH * k).zip(groups) {
                        let out: &mut [f32; WIDTH] = &mut group.as_chunks_mut().0[c];
                        let in_f32 = |x: f64| (factor * x - shift) as f32;
                        match neighbours(column, ids) {
                            Some(column) => *out = column.map(in_f32),
                            None => *out = ids.map(|id| in_f32(column[id as usize])),
                        }
                    }
                }
            });
        }
        Self { numbers, k, ids }
    }

    pub fn n_groups(&self) -> usize {
        self.ids.len() / WIDTH
    }

    /// The numbers of a group (k × WIDTH).
    pub fn group(&self, g: usize) -> &[f32] {
        &self.numbers[g * self.k * WIDTH..][..self.k * WIDTH]
    }
}

/// The numbers of these rows where they stand one after the other.
#[inline(always)]
fn neighbours<'a, const WIDTH: usize>(
    column: &'a [f64],
    ids: &[u32; WIDTH],
) -> Option<&'a [f64; WIDTH]> {
    let are_neighbours = ids.iter().zip(ids[0]..).all(|(&id, next)| id == next);
    column.get(ids[0] as usize..)?.first_chunk().filter(|_| are_neighbours)
}

/// The ball around each panel in the first [`CHUNK`] columns, in panels themselves.
pub(super) struct Balls {
    /// Centres, in the layout of [`Packed`].
    centres: Vec<f32>,
    n_columns: usize,
    /// Their radii; of the last panel only as many count as there are balls.
    radii: Vec<[f32; PANEL]>,
}

impl Balls {
    /// The balls hold the balls of radius `radii` around the points, or the points alone where none are given.
    pub fn around(points: &Packed<PANEL>, radii: &[[f32; PANEL]], relative: f32) -> Self {
        let (n, n_columns) = (points.n_groups(), points.k.min(CHUNK));
        let n_panels = n.div_ceil(PANEL);
        let mut centres = vec![0.0f32; n_panels * n_columns * PANEL];
        let mut out = vec![[0.0f32; PANEL]; n_panels];
        for g in 0..n {
            let (panel, lane) = (g / PANEL, g % PANEL);
            let columns = points.group(g).chunks_exact(PANEL).take(n_columns);
            let mut squares = [0.0f32; PANEL];
            for (c, column) in columns.enumerate() {
                let centre = column.iter().sum::<f32>() / PANEL as f32;
                centres[(panel * n_columns + c) * PANEL + lane] = centre;
                squares.iter_mut().zip(column).for_each(|(s, x)| *s += (x - centre).powi(2));
            }
            let own = radii.get(g).copied().unwrap_or_default();
            let reaches = squares.iter().zip(own).map(|(s, own)| s.sqrt() + own);
            out[panel][lane] = reaches.fold(0.0, f32::max) * (1.0 + relative);
        }
        Self { centres, n_columns, radii: out }
    }

    pub fn n_panels(&self) -> usize {
        self.radii.len()
    }

    /// Centres of a panel (columns × PANEL).
    pub fn centres(&self, panel: usize) -> &[f32] {
        let size = self.n_columns * PANEL;
        &self.centres[panel * size..][..size]
    }

    pub fn radii(&self, panel: usize) -> &[f32; PANEL] {
        &self.radii[panel]
    }
}
