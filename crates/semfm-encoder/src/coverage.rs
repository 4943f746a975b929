//! How much of each patch the object fills.

use semfm_views::{PatchGrid, View};

use crate::turned::picture_size;

/// The share of each patch (rows × columns) that lies on the object, 0 to 255. What hangs over the
/// picture's edge counts as background.
///
/// Edges of patches may fall inside pixels, so the shares are exact areas: the summed-area table of a
/// picture that is constant in each pixel is linear between the corners of pixels.
pub(crate) fn coverage(view: &View, grid: &PatchGrid) -> Vec<u8> {
    let (height, width) = picture_size(&view.camera);
    let [left, top, right, bottom] = grid.rect.map(f64::from);
    let table = SummedArea::new(view, height, width);
    let xs: Vec<f64> = edges(left, right, grid.cols);
    let ys: Vec<f64> = edges(top, bottom, grid.rows);
    // (rows + 1) × (columns + 1)
    let corners: Vec<Vec<f64>> =
        ys.iter().map(|&y| xs.iter().map(|&x| table.at(x, y)).collect()).collect();
    let area = (right - left) / grid.cols as f64 * ((bottom - top) / grid.rows as f64);
    let mut shares = Vec::with_capacity(grid.rows * grid.cols);
    for rows in corners.windows(2) {
        for col in 0..grid.cols {
            let on_object = rows[1][col + 1] - rows[0][col + 1] - rows[1][col] + rows[0][col];
            shares.push((255.0 * (on_object / area).clamp(0.0, 1.0)).round_ties_even() as u8);
        }
    }
    shares
}

/// `n` + 1 places that cut from `start` to `end` into equal parts.
fn edges(start: f64, end: f64, n: usize) -> Vec<f64> {
    (0..=n).map(|i| start + (end - start) / n as f64 * i as f64).collect()
}

/// Numbers of the object's pixels above and left of each corner ((height + 1) × (width + 1)).
struct SummedArea {
    sums: Vec<f64>,
    height: usize,
    width: usize,
}

impl SummedArea {
    fn new(view: &View, height: usize, width: usize) -> Self {
        let mut sums = vec![0.0; (height + 1) * (width + 1)];
        for (y, line) in view.triangles.chunks_exact(width).enumerate() {
            let mut in_line = 0.0;
            for (x, &triangle) in line.iter().enumerate() {
                in_line += f64::from(u8::from(triangle >= 0));
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + in_line;
            }
        }
        Self { sums, height, width }
    }

    /// The area of the object above and left of a point.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (column, across) = cell(x, self.width);
        let (row, down) = cell(y, self.height);
        let sum = |row: usize, column: usize| self.sums[row * (self.width + 1) + column];
        let line = |row: usize| sum(row, column) * (1.0 - across) + sum(row, column + 1) * across;
        line(row) * (1.0 - down) + line(row + 1) * down
    }
}

/// The pixel, of `n`, in which a place lies, and where in it (0 to 1); places outside are moved to the
/// edge.
fn cell(place: f64, n: usize) -> (usize, f64) {
    let place = place.clamp(0.0, n as f64);
    let pixel = (place.floor() as usize).min(n - 1);
    (pixel, place - pixel as f64)
}

#[cfg(test)]
mod tests {
    use semfm_geom::{Task, zoo};
    use semfm_views::{Renderer, RigSettings, SurfaceColor, rig};

    use super::*;

    /// A ball, with the picture's size.
    fn view() -> View {
        let mesh = zoo::icosphere(2);
        let cameras =
            rig(&mesh, &RigSettings { count: 1, size: 30, ..Default::default() }).unwrap();
        Renderer::cpu()
            .render(
                &mesh,
                &SurfaceColor::default(),
                &cameras,
                &Default::default(),
                &Task::default(),
            )
            .unwrap()
            .remove(0)
    }

    fn on_object(view: &View) -> usize {
        view.triangles.iter().filter(|&&triangle| triangle >= 0).count()
    }

    #[test]
    fn whole_pixels_are_counted() {
        let view = view();
        let grid = PatchGrid { rows: 30, cols: 30, rect: [0.0, 0.0, 30.0, 30.0] };
        let found = coverage(&view, &grid);
        let expected: Vec<u8> = view.triangles.iter().map(|&t| 255 * u8::from(t >= 0)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_patch_as_large_as_the_picture_has_the_mean() {
        let view = view();
        let mean = 255.0 * on_object(&view) as f64 / 900.0;
        let whole = PatchGrid { rows: 1, cols: 1, rect: [0.0, 0.0, 30.0, 30.0] };
        assert_eq!(coverage(&view, &whole), [mean.round_ties_even() as u8]);
        // Twice the picture's size: three quarters of the patch are background.
        let larger = PatchGrid { rows: 1, cols: 1, rect: [0.0, 0.0, 60.0, 60.0] };
        assert_eq!(coverage(&view, &larger), [(mean / 4.0).round_ties_even() as u8]);
    }

    #[test]
    fn edges_inside_of_pixels_share_them() {
        let view = view();
        let grid = PatchGrid { rows: 7, cols: 4, rect: [0.0, 0.0, 30.0, 30.0] };
        let found: f64 = coverage(&view, &grid).iter().map(|&share| f64::from(share)).sum();
        let expected = 255.0 * on_object(&view) as f64 / 900.0 * 28.0;
        assert!((found - expected).abs() <= 14.0, "rounding alone: {found} {expected}");
    }
}
