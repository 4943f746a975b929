//! Depth without its noise, and without single missing pixels.

use semfm_align::DepthImage;

/// A depth beside a pixel is of the same surface where it differs by less than this share: a steep surface changes as much
/// over the window, and the noise of a sensor is a tenth of it. With half of it, steep sides stay rough; with twice as much,
/// the rim of a cup runs into what is behind.
const SAME_SURFACE: f64 = 0.02;

/// A pixel without a return is filled where this share of its window has one.
const FILLED_FROM: f64 = 0.5;

/// Depth along the camera's axis (height × width, row-major, metres), 0 outside of the object.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SmoothedDepth {
    pub depth: Vec<f32>,
    /// Pixels that had no return and have a depth now.
    pub n_filled: usize,
}

impl SmoothedDepth {
    /// The depth of the marked pixels, each from a plane through those of its window (radius in pixels) that lie on the same
    /// surface. A plane in space is linear in the picture for the inverse of depth:
    ///
    /// > 1/z = a + b·Δu + c·Δv,
    ///
    /// fitted by weighted least squares, weights (1 − (d/(r+1))²)·(1 − (Δz/range)²); the pixel's depth is 1/a.
    pub fn new(image: &DepthImage, marked: &[bool], radius: usize) -> Self {
        let (width, height) = (image.width(), image.height());
        let mut smoothed = Self { depth: vec![0.0; width * height], n_filled: 0 };
        for row in 0..height {
            for column in 0..width {
                let at = row * width + column;
                if !marked[at] {
                    continue;
                }
                let window = Window { image, marked, column, row, radius };
                let own = image.metres()[at];
                if own > 0.0 {
                    smoothed.depth[at] = window.depth(own.into()).map_or(own, |z| z as f32);
                } else if let Some(z) = window.middle().and_then(|z| window.depth(z)) {
                    smoothed.depth[at] = z as f32;
                    smoothed.n_filled += 1;
                }
            }
        }
        smoothed
    }

    /// Pixels that have a depth.
    pub fn n_pixels(&self) -> usize {
        self.depth.iter().filter(|&&z| z > 0.0).count()
    }
}

/// The marked pixels around one.
struct Window<'a> {
    image: &'a DepthImage,
    marked: &'a [bool],
    column: usize,
    row: usize,
    radius: usize,
}

/// A return in a window: where it is from the middle, and its depth.
struct Return {
    du: f64,
    dv: f64,
    z: f64,
}

impl Window<'_> {
    fn returns(&self) -> impl Iterator<Item = Return> + '_ {
        let r = self.radius as isize;
        (-r..=r).flat_map(move |dv| (-r..=r).map(move |du| (du, dv))).filter_map(|(du, dv)| {
            let column = self.column.checked_add_signed(du)?;
            let row = self.row.checked_add_signed(dv)?;
            let z = self.image.at(column, row)?;
            let is_marked = self.marked[row * self.image.width() + column];
            is_marked.then_some(Return { du: du as f64, dv: dv as f64, z: z.into() })
        })
    }

    /// The middle one of the depths, where enough pixels of the window have one.
    fn middle(&self) -> Option<f64> {
        let mut depths: Vec<f64> = self.returns().map(|found| found.z).collect();
        let side = 2.0 * self.radius as f64 + 1.0;
        depths.sort_by(f64::total_cmp);
        let enough = depths.len() as f64 >= FILLED_FROM * side * side;
        depths.get(depths.len() / 2).copied().filter(|_| enough)
    }

    /// The depth in the middle of a plane through what lies near depth `z`; `None` for too few returns.
    fn depth(&self, z: f64) -> Option<f64> {
        let (range, reach) = (SAME_SURFACE * z, self.radius as f64 + 1.0);
        // Sums of w, w·u, w·v, w·u², w·u·v, w·v², w·y, w·y·u, w·y·v with y = 1/z.
        let mut sums = [0.0; 9];
        let mut n = 0;
        for Return { du, dv, z: other } in self.returns() {
            let near = 1.0 - (du * du + dv * dv) / (reach * reach);
            let alike = 1.0 - ((other - z) / range).powi(2);
            if near <= 0.0 || alike <= 0.0 {
                continue;
            }
            let (w, y) = (near * alike, other.recip());
            let terms = [1.0, du, dv, du * du, du * dv, dv * dv, y, y * du, y * dv];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += w * term);
            n += 1;
        }
        let [s, u, v, uu, uv, vv, y, yu, yv] = sums;
        // Cramer's rule for a of the three normal equations.
        let determinant = s * (uu * vv - uv * uv) - u * (u * vv - uv * v) + v * (u * uv - uu * v);
        let is_plane = n >= 6 && determinant > 1e-6 * s * s * s;
        if !is_plane {
            return None;
        }
        let a = y * (uu * vv - uv * uv) - u * (yu * vv - uv * yv) + v * (yu * uv - uu * yv);
        let plane = determinant / a;
        ((plane - z).abs() <= range).then_some(plane)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE: usize = 60;

    /// A plane seen at an angle, from .5 to .56 m: 1/z is linear in the picture.
    fn plane() -> Vec<f32> {
        let at = |i: usize| (2.0 - 0.0035 * (i % SIDE) as f64).recip() as f32;
        (0..SIDE * SIDE).map(at).collect()
    }

    fn rms(a: &[f32], b: &[f32], of: impl Fn(usize) -> bool) -> f64 {
        let squares: Vec<f64> =
            (0..a.len()).filter(|&i| of(i)).map(|i| f64::from(a[i] - b[i]).powi(2)).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    fn inside(i: usize) -> bool {
        let (column, row) = (i % SIDE, i / SIDE);
        (4..SIDE - 4).contains(&column) && (4..SIDE - 4).contains(&row)
    }

    #[test]
    fn a_plane_stays_and_its_noise_goes() {
        let all = vec![true; SIDE * SIDE];
        let clean = DepthImage::new(SIDE, SIDE, plane()).unwrap();
        let found = SmoothedDepth::new(&clean, &all, 3);
        assert!(rms(&found.depth, &plane(), |_| true) < 1e-6, "borders included");
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let noise: Vec<f32> =
            plane().iter().map(|z| z + random.random_range(-0.002..0.002)).collect();
        let before = rms(&noise, &plane(), inside);
        let image = DepthImage::new(SIDE, SIDE, noise).unwrap();
        let after = rms(&SmoothedDepth::new(&image, &all, 3).depth, &plane(), inside);
        assert!(after < 0.3 * before, "{before} {after}");
        assert_eq!(SmoothedDepth::new(&image, &all, 0).depth, image.metres());
    }

    #[test]
    fn a_step_stays_a_step_and_single_holes_are_filled() {
        let step = |i: usize| if i % SIDE < 30 { 0.5 } else { 0.6 };
        let mut depth: Vec<f32> = (0..SIDE * SIDE).map(step).collect();
        let hole = 20 * SIDE + 20;
        depth[hole] = 0.0;
        // Too large to be closed.
        for row in 40..50 {
            depth[row * SIDE + 5..row * SIDE + 15].fill(0.0);
        }
        let image = DepthImage::new(SIDE, SIDE, depth).unwrap();
        let mut marked = vec![true; SIDE * SIDE];
        marked[0] = false;
        let found = SmoothedDepth::new(&image, &marked, 2);
        assert!((found.depth[hole] - 0.5).abs() < 1e-6);
        assert_eq!((found.depth[45 * SIDE + 10], found.depth[0]), (0.0, 0.0));
        assert!((found.depth[10 * SIDE + 29] - 0.5).abs() < 1e-6);
        assert!((found.depth[10 * SIDE + 30] - 0.6).abs() < 1e-6);
        assert!((1..30).contains(&found.n_filled), "{}", found.n_filled);
    }
}
