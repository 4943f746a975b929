//! Where in an image an object may stand: what is left once the large planes are taken away, in connected pieces.

use nalgebra::{Matrix3, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use semfm_geom::math::DVec3;

use crate::depth_view::{DepthView, Pixel};

/// Columns of the grid of pixels that are looked at.
const COLUMNS: usize = 160;

/// Trials for each plane (Fischler & Bolles, *Random sample consensus*, 1981).
const TRIALS: usize = 60;

/// Points that are held against each trial's plane.
const TESTED: usize = 400;

/// Planes that are taken away at most: a table, walls.
const PLANES: usize = 3;

/// A plane holds at least this share of the points, or of those that are left this, if it is wider than any object: of the strip
/// of a wall above a table every part looks like a flat object.
const PLANE_SHARE: f64 = 0.15;
const WIDE_SHARE: f64 = 0.3;

/// Thickness of a plane, metres, at one metre from the camera; it grows with the square of the depth.
const PLANE_THICKNESS: f64 = 0.008;

/// Smallest piece, in cells of the grid.
const LEAST_CELLS: usize = 10;

/// A piece of the foreground.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Mean of its points, camera's frame.
    pub middle: DVec3,
    /// Twice the greatest distance of a point from the middle, metres.
    pub diameter: f64,
    /// Cells of the grid: column and row of the pixel that each stands for.
    pub pixels: Vec<[usize; 2]>,
}

/// The pieces of the foreground, as grid cells.
pub(crate) struct Foreground {
    pub pieces: Vec<Piece>,
    /// Normals of the planes that were taken away, the largest first; none under a mask.
    pub planes: Vec<DVec3>,
    /// Pixels between two cells.
    pub step: usize,
}

/// The foreground's pieces, the `most` largest first; what is wider than `most_diameter` is cut into blocks. Where there is a mask,
/// what it leaves out is no foreground.
pub(crate) fn foreground(
    view: &DepthView<'_>,
    mask: Option<&[bool]>,
    most_diameter: f64,
    most: usize,
    seed: u64,
) -> Foreground {
    let (width, height) = (view.depth.width(), view.depth.height());
    let step = width.div_ceil(COLUMNS).max(1);
    let (columns, rows) = (width.div_ceil(step), height.div_ceil(step));
    let mut cells: Vec<Option<DVec3>> = vec![None; columns * rows];
    for (id, cell) in cells.iter_mut().enumerate() {
        let [column, row] = pixel(id, columns, step);
        let at = [column as f64 + 0.5, row as f64 + 0.5];
        if mask.is_none_or(|mask| mask[row * width + column])
            && let Pixel::Depth(z) = view.at(at)
        {
            *cell = Some(view.point(at, z));
        }
    }
    // Under a mask everything is the object's.
    let planes = match mask {
        None => remove_planes(&mut cells, most_diameter, seed),
        Some(_) => Vec::new(),
    };
    let mut pieces = Vec::new();
    for piece in connected(&cells, columns, step as f64 / view.focal()) {
        let whole = piece_of(&piece, &cells, columns, step);
        if whole.diameter <= most_diameter {
            pieces.push(whole);
        } else {
            let blocks = blocks(&piece, &cells, most_diameter / 2.0);
            pieces.extend(blocks.iter().map(|block| piece_of(block, &cells, columns, step)));
        }
    }
    pieces.retain(|piece| piece.pixels.len() >= LEAST_CELLS);
    pieces.sort_by_key(|piece| std::cmp::Reverse(piece.pixels.len()));
    pieces.truncate(most);
    Foreground { pieces, planes, step }
}

impl Foreground {
    /// The pixels of a piece as a mask of the image: each cell with the pixels around it.
    pub fn mask(&self, piece: &Piece, width: usize, height: usize) -> Vec<bool> {
        let mut mask = vec![false; width * height];
        for &[column, row] in &piece.pixels {
            for r in row..(row + self.step).min(height) {
                let end = (column + self.step).min(width);
                mask[r * width + column..r * width + end].fill(true);
            }
        }
        mask
    }
}

fn pixel(cell: usize, columns: usize, step: usize) -> [usize; 2] {
    [cell % columns * step, cell / columns * step]
}

/// A plane: n·p = offset, the normal of length 1 towards the camera.
#[derive(Clone, Copy)]
struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Plane {
    /// Through a point; `None` for a normal of no length.
    fn new(normal: DVec3, through: DVec3) -> Option<Self> {
        let normal = normal.try_normalize()?;
        let normal = if normal.dot(through) > 0.0 { -normal } else { normal };
        Some(Self { normal, offset: normal.dot(through) })
    }

    /// How far a point lies before it.
    fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }

    /// Twice the greatest distance of the points that lie on it from their middle.
    fn extent(self, points: &[DVec3]) -> f64 {
        let on = points.iter().copied().filter(|p| self.height(*p).abs() < thickness(*p));
        let (sum, n) = on.clone().fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
        let middle = if n > 0.0 { sum / n } else { sum };
        2.0 * on.map(|p| p.distance(middle)).fold(0.0, f64::max)
    }

    /// The plane of least squares through those of the points that lie on this one. Three points with noise lean by so much
    /// that a band of a wall is left at the edge of the image, which was sought for the object in every frame.
    fn refined(self, points: &[DVec3]) -> Self {
        let on: Vec<DVec3> =
            points.iter().copied().filter(|p| self.height(*p).abs() < thickness(*p)).collect();
        let middle = on.iter().sum::<DVec3>() / on.len().max(1) as f64;
        let mut scatter = Matrix3::zeros();
        for p in &on {
            let d = (*p - middle).to_array();
            scatter += Matrix3::from_fn(|i, j| d[i] * d[j]);
        }
        let eigen = SymmetricEigen::new(scatter);
        let least = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        Self::new(DVec3::new(least[0], least[1], least[2]), middle).unwrap_or(self)
    }
}

/// How often a plane is refined.
const REFINEMENTS: usize = 2;

/// Takes away the points of the largest planes, and what lies behind them; then those of planes that hold less, but are wider
/// than any object (`most_diameter`). Their normals.
fn remove_planes(cells: &mut [Option<DVec3>], most_diameter: f64, seed: u64) -> Vec<DVec3> {
    let mut normals = Vec::new();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let n_all = cells.iter().flatten().count();
    for _ in 0..PLANES {
        let points: Vec<DVec3> = cells.iter().flatten().copied().collect();
        if points.len() < 3 * LEAST_CELLS {
            return normals;
        }
        let tested: Vec<DVec3> =
            (0..TESTED).map(|_| points[rng.random_range(0..points.len())]).collect();
        let mut best: Option<(usize, Plane)> = None;
        for _ in 0..TRIALS {
            let [a, b, c] = [0; 3].map(|_| points[rng.random_range(0..points.len())]);
            let Some(plane) = Plane::new((b - a).cross(c - a), a) else { continue };
            let n = tested.iter().filter(|p| plane.height(**p).abs() < thickness(**p)).count();
            if best.is_none_or(|(most, _)| n > most) {
                best = Some((n, plane));
            }
        }
        let Some((n, plane)) = best else { return normals };
        let share = n as f64 / TESTED as f64;
        let is_ground = share * points.len() as f64 >= PLANE_SHARE * n_all as f64;
        let plane = (0..REFINEMENTS).fold(plane, |plane, _| plane.refined(&points));
        let is_wide = share >= WIDE_SHARE && plane.extent(&points) > most_diameter;
        if !(is_ground || is_wide) {
            return normals;
        }
        normals.push(plane.normal);
        for cell in cells.iter_mut() {
            let is_taken = |p: DVec3| {
                let height = plane.height(p);
                height < thickness(p) && (is_ground || height > -thickness(p))
            };
            if cell.is_some_and(is_taken) {
                *cell = None;
            }
        }
    }
    normals
}

fn thickness(p: DVec3) -> f64 {
    PLANE_THICKNESS * (p.z * p.z).max(0.5)
}

/// Cells that hang together: neighbours whose points are near each other. `cell` is the width of a cell at one metre.
fn connected(cells: &[Option<DVec3>], columns: usize, cell: f64) -> Vec<Vec<usize>> {
    let mut taken = vec![false; cells.len()];
    let mut pieces = Vec::new();
    for first in 0..cells.len() {
        if taken[first] || cells[first].is_none() {
            continue;
        }
        taken[first] = true;
        let (mut piece, mut next) = (vec![first], 0);
        while let Some(&id) = piece.get(next) {
            next += 1;
            let Some(here) = cells[id] else { continue };
            let column = id % columns;
            let beside = [
                (column > 0).then(|| id - 1),
                (column + 1 < columns).then_some(id + 1),
                id.checked_sub(columns),
                (id + columns < cells.len()).then_some(id + columns),
            ];
            for id in beside.into_iter().flatten() {
                let near = cells[id]
                    .is_some_and(|there| there.distance(here) < 0.01 + 3.0 * cell * here.z);
                if near && !taken[id] {
                    taken[id] = true;
                    piece.push(id);
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}

/// A piece cut into cubes of an edge.
fn blocks(piece: &[usize], cells: &[Option<DVec3>], edge: f64) -> Vec<Vec<usize>> {
    let mut cubes: std::collections::BTreeMap<[i64; 3], Vec<usize>> = Default::default();
    for &id in piece {
        if let Some(p) = cells[id] {
            let cube = p.to_array().map(|x| (x / edge).floor() as i64);
            cubes.entry(cube).or_default().push(id);
        }
    }
    cubes.into_values().collect()
}

fn piece_of(ids: &[usize], cells: &[Option<DVec3>], columns: usize, step: usize) -> Piece {
    let points: Vec<DVec3> = ids.iter().filter_map(|&id| cells[id]).collect();
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let reach = points.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
    let pixels = ids.iter().map(|&id| pixel(id, columns, step)).collect();
    Piece { middle, diameter: 2.0 * reach, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_align::DepthImage;
    use semfm_geom::math::DAffine3;
    use semfm_geom::{Intrinsics, Pinhole};

    #[test]
    fn two_boxes_before_a_wall_are_two_pieces_and_a_mask_leaves_one() {
        let (width, height) = (320, 240);
        let intrinsics =
            Intrinsics { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 };
        let camera = Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::IDENTITY).unwrap();
        let mut metres = vec![1.0f32; width * height];
        for row in 100..140 {
            for column in 60..100 {
                metres[row * width + column] = 0.8;
                metres[row * width + column + 120] = 0.7;
            }
        }
        let left: Vec<bool> = (0..width * height).map(|i| i % width < 150).collect();
        let depth = DepthImage::new(width, height, metres).unwrap();
        let view = DepthView::new(&depth, &camera);
        let found = foreground(&view, None, 0.3, 6, 1);
        assert_eq!(found.pieces.len(), 2);
        let depths: Vec<f64> = found.pieces.iter().map(|piece| piece.middle.z).collect();
        assert!(depths.iter().any(|z| (z - 0.8).abs() < 1e-3), "{depths:?}");
        let mask = found.mask(&found.pieces[0], width, height);
        assert!((1500..1800).contains(&mask.iter().filter(|&&m| m).count()));
        let masked = foreground(&view, Some(&left), 2.0, 6, 1);
        assert!(masked.pieces.iter().all(|piece| piece.middle.x < 0.0));
        let cut = foreground(&view, Some(&left), 0.06, 6, 1);
        assert!(cut.pieces.len() > 2);
        // Faces that are wider than the object are none of its own.
        assert!(foreground(&view, None, 0.06, 6, 1).pieces.is_empty());
    }
}
