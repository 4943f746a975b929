//! Depth at single pixel positions: the z-buffer of a handful of samples, wherever they lie.
//!
//! 1 200 positions cost a fraction of a full z-buffer, and the depth is exact at the
//! position instead of at the nearest pixel centre, which matters at silhouettes and thin parts.

use super::triangle::{PixelBox, Projection};

/// Positions for each cell of the lookup grid, on average: few triangles then meet any position
/// outside their bounding rectangle.
const POSITIONS_PER_CELL: f64 = 0.5;

/// 1/z of the surface nearest to the camera at each position (f64, 0 where there is none).
/// Positions outside the image have a depth, too; at positions that are NaN there is nothing.
pub(crate) fn inverse_depths(projection: &Projection<'_>, positions: &[[f64; 2]]) -> Vec<f64> {
    let cells = Cells::new(positions);
    let mut nearest = vec![0.0; positions.len()];
    for (places, block) in projection.mesh.blocks() {
        if block.is_some_and(|block| {
            let bounds = projection.block_box(block);
            !cells.within(bounds).any(|id| bounds.holds(positions[id]))
        }) {
            continue;
        }
        for place in places {
            let bounds = projection.pixel_box(place);
            let mut forms = None;
            for id in cells.within(bounds) {
                let [u, v] = positions[id];
                if !bounds.holds([u, v]) {
                    continue;
                }
                // Made at the first position that needs them; most triangles meet none.
                let forms = *forms.get_or_insert_with(|| projection.forms(place));
                if let Some(inverse) = forms.and_then(|forms| forms.inverse_depth_at(u, v)) {
                    nearest[id] = inverse.max(nearest[id]);
                }
            }
        }
    }
    nearest
}

/// Positions sorted into the cells of a square grid.
struct Cells {
    low: [f64; 2],
    per_unit: [f64; 2],
    side: usize,
    /// Where each cell's ids start in `ids` (side² + 1).
    starts: Vec<u32>,
    ids: Vec<u32>,
}

impl Cells {
    fn new(positions: &[[f64; 2]]) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for position in positions.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            for k in 0..2 {
                low[k] = low[k].min(position[k]);
                high[k] = high[k].max(position[k]);
            }
        }
        let side = (positions.len() as f64 / POSITIONS_PER_CELL).sqrt().ceil().max(1.0) as usize;
        let per_unit = [0, 1].map(|k| side as f64 / (high[k] - low[k]).max(f64::MIN_POSITIVE));
        let mut cells =
            Self { low, per_unit, side, starts: vec![0; side * side + 1], ids: Vec::new() };
        // Counting sort: ids of a cell stay in ascending order.
        let cell_of: Vec<Option<usize>> = positions.iter().map(|&p| cells.cell_of(p)).collect();
        for &cell in cell_of.iter().flatten() {
            cells.starts[cell + 1] += 1;
        }
        for cell in 0..side * side {
            cells.starts[cell + 1] += cells.starts[cell];
        }
        let mut next = cells.starts.clone();
        cells.ids = vec![0; cells.starts[side * side] as usize];
        for (id, cell) in cell_of.iter().enumerate() {
            if let Some(cell) = *cell {
                cells.ids[next[cell] as usize] = id as u32;
                next[cell] += 1;
            }
        }
        cells
    }

    fn cell_of(&self, position: [f64; 2]) -> Option<usize> {
        let finite = position.iter().all(|x| x.is_finite());
        finite.then(|| self.index(1, position[1]) * self.side + self.index(0, position[0]))
    }

    /// Row or column of a coordinate, clamped into the grid; `as` takes what is below to 0.
    fn index(&self, axis: usize, x: f64) -> usize {
        (((x - self.low[axis]) * self.per_unit[axis]) as usize).min(self.side - 1)
    }

    /// Ids of the positions in the cells that a rectangle touches.
    fn within(&self, bounds: PixelBox) -> impl Iterator<Item = usize> + '_ {
        let columns = self.index(0, bounds.low[0])..self.index(0, bounds.high[0]) + 1;
        let rows = self.index(1, bounds.low[1])..self.index(1, bounds.high[1]) + 1;
        let rows = if bounds.low[0] > bounds.high[0] { 0..0 } else { rows };
        rows.flat_map(move |row| {
            let first = self.starts[row * self.side + columns.start] as usize;
            let last = self.starts[row * self.side + columns.end] as usize;
            self.ids[first..last].iter().map(|&id| id as usize)
        })
    }
}
