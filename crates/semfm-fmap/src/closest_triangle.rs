//! The nearest point on triangles that stand in a space of any dimension.
//!
//! Ezuz & Ben-Chen, "Deblurring and Denoising of Maps between Shapes", 2017, section 4: rows of one embedding are
//! projected onto the triangles of another. They leave out triangles by their longest edge; here each triangle stands in
//! a ball, and the balls that come as near as the nearest vertex are searched as [`nearest_rows`](crate::nearest_rows)
//! searches points, so that few triangles are computed and no table of all pairs is kept.

use faer::{Mat, MatRef};

use crate::nearest_rows::{BallRows, Patches, Reached, Rows, nearest_of, reached_balls};
use crate::{Error, Result};

/// Relative rounding that a bound may have against a distance computed from rows.
const ROUNDING: f64 = 1e-9;

/// Triangles whose corners are rows.
pub(crate) struct EmbeddedTriangles<'a> {
    corners: MatRef<'a, f64>,
    faces: &'a [[u32; 3]],
    /// The corners (n × k), row after row.
    rows: Vec<f64>,
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TrianglePoint {
    pub face: u32,
    /// Coordinates on the triangle's corners: at least 0, sum 1.
    pub barycentric: [f64; 3],
    /// Squared distance of the query.
    pub square: f64,
}

impl<'a> EmbeddedTriangles<'a> {
    /// Triangles on the rows of a matrix (n × k).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] without a triangle.
    pub fn new(corners: MatRef<'a, f64>, faces: &'a [[u32; 3]]) -> Result<Self> {
        if faces.is_empty() {
            return Error::out_of_range("triangles of the source", "at least one", "none");
        }
        Ok(Self { corners, faces, rows: by_rows(corners) })
    }

    /// The nearest point to each query (q × k), on the first of equally near triangles.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for numbers that are not finite.
    pub fn closest_to(&self, queries: MatRef<'_, f64>) -> Result<Vec<TrianglePoint>> {
        let k = queries.ncols();
        let query_rows = by_rows(queries);
        let query = |q: usize| &query_rows[q * k..][..k];
        // The nearest corner bounds the distance from above.
        let used = self.used_corners();
        let corners = Rows::of(self.corners).chosen(&used);
        let queried = Rows::of(queries);
        let nearest = nearest_of(&queried, &corners, &Patches::of(&queried, &corners), None)?;
        let reach: Vec<f64> = (0..queries.nrows())
            .map(|q| square_between(query(q), self.row(used[nearest[q] as usize])).sqrt())
            .map(|distance| distance * (1.0 + ROUNDING))
            .collect();
        let (centres, radii) = self.balls();
        let balls = BallRows { centres: Rows::of(centres.as_ref()), radii: &radii };
        let patches = Patches::of(&queried, &balls.centres);
        reached_balls(&queried, &balls, &patches, &reach, |q, reached| {
            self.closest_among(query(q), reached)
        })
    }

    /// The nearest point of some triangles.
    fn closest_among(&self, query: &[f64], reached: &mut [Reached]) -> TrianglePoint {
        reached.sort_unstable_by(|a, b| a.at_least.total_cmp(&b.at_least).then(a.id.cmp(&b.id)));
        let mut best = TrianglePoint { square: f64::INFINITY, ..TrianglePoint::default() };
        for ball in reached.iter() {
            if ball.at_least > best.square.sqrt() * (1.0 + ROUNDING) {
                break;
            }
            let found = self.closest_on(ball.id, query);
            if found.square < best.square || (found.square == best.square && found.face < best.face)
            {
                best = found;
            }
        }
        best
    }

    /// The nearest point of one triangle.
    ///
    /// With e₁ = b − a, e₂ = c − a and d = q − a all that is needed are the products of these: the foot of the
    /// perpendicular a + s e₁ + t e₂ solves (e₁·e₁  e₁·e₂; e₁·e₂  e₂·e₂)(s, t) = (e₁·d, e₂·d); where it lies outside, or
    /// the triangle has no area, the nearest point is on an edge.
    fn closest_on(&self, face: u32, query: &[f64]) -> TrianglePoint {
        let ids = self.faces[face as usize];
        let [a, b, c] = ids.map(|id| self.row(id));
        let (mut g11, mut g12, mut g22, mut d1, mut d2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (((a, b), c), q) in a.iter().zip(b).zip(c).zip(query) {
            let (e1, e2, d) = (b - a, c - a, q - a);
            g11 += e1 * e1;
            g12 += e1 * e2;
            g22 += e2 * e2;
            d1 += e1 * d;
            d2 += e2 * d;
        }
        let determinant = g11 * g22 - g12 * g12;
        let (s, t) = (g22 * d1 - g12 * d2, g11 * d2 - g12 * d1);
        let at = |barycentric: [f64; 3]| TrianglePoint {
            face,
            barycentric,
            square: square_to_point([a, b, c], barycentric, query),
        };
        if determinant > 0.0 && s > 0.0 && t > 0.0 && s + t < determinant {
            let (s, t) = (s / determinant, t / determinant);
            return at([(1.0 - s - t).max(0.0), s, t]);
        }
        // Along a → b, a → c and b → c.
        let along_ab = share(d1, g11);
        let along_ac = share(d2, g22);
        let along_bc = share(d2 - d1 - (g12 - g11), g11 - 2.0 * g12 + g22);
        let on_edges = [
            [1.0 - along_ab, along_ab, 0.0],
            [1.0 - along_ac, 0.0, along_ac],
            [0.0, 1.0 - along_bc, along_bc],
        ];
        let nearer = |x: TrianglePoint, y: TrianglePoint| if y.square < x.square { y } else { x };
        let [first, second, third] = on_edges.map(at);
        nearer(nearer(first, second), third)
    }

    /// A ball around each triangle: the mean of its corners (faces × k), and how far the farthest one is.
    fn balls(&self) -> (Mat<f64>, Vec<f64>) {
        let k = self.corners.ncols();
        let mut centres = Mat::zeros(self.faces.len(), k);
        let mut squares = vec![[0.0; 3]; self.faces.len()];
        for c in 0..k {
            let (column, out) = (self.corners.col(c), centres.col_as_slice_mut(c));
            for ((ids, centre), squares) in self.faces.iter().zip(out).zip(&mut squares) {
                let corners = ids.map(|id| column[id as usize]);
                *centre = corners.iter().sum::<f64>() / 3.0;
                squares.iter_mut().zip(corners).for_each(|(s, x)| *s += (x - *centre).powi(2));
            }
        }
        let farthest = |squares: &[f64; 3]| squares.iter().copied().fold(0.0, f64::max).sqrt();
        (centres, squares.iter().map(|squares| farthest(squares) * (1.0 + ROUNDING)).collect())
    }

    /// Corners of triangles, ascending: a vertex of no triangle is no point of the surface.
    fn used_corners(&self) -> Vec<u32> {
        let mut is_used = vec![false; self.corners.nrows()];
        self.faces.iter().flatten().for_each(|&id| is_used[id as usize] = true);
        (0..).zip(is_used).filter(|(_, used)| *used).map(|(id, _)| id).collect()
    }

    fn row(&self, id: u32) -> &[f64] {
        let k = self.corners.ncols();
        &self.rows[id as usize * k..][..k]
    }
}

/// x/length² in \[0, 1\]; 0 on an edge without length.
fn share(product: f64, square: f64) -> f64 {
    if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 }
}

/// ‖q − Σ wᵢ xᵢ‖²
fn square_to_point([a, b, c]: [&[f64]; 3], w: [f64; 3], query: &[f64]) -> f64 {
    let corners = a.iter().zip(b).zip(c).zip(query);
    corners.map(|(((a, b), c), q)| (q - (w[0] * a + w[1] * b + w[2] * c)).powi(2)).sum()
}

fn square_between(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// The numbers of a matrix, row after row.
fn by_rows(matrix: MatRef<'_, f64>) -> Vec<f64> {
    let k = matrix.ncols();
    let mut out = vec![0.0; matrix.nrows() * k];
    for c in 0..k {
        let entries = out.iter_mut().skip(c).step_by(k);
        entries.zip(matrix.col(c).iter()).for_each(|(x, entry)| *x = *entry);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use semfm_geom::zoo;

    /// Every triangle tried.
    fn brute_force(
        triangles: &EmbeddedTriangles<'_>,
        queries: MatRef<'_, f64>,
    ) -> Vec<TrianglePoint> {
        let rows = by_rows(queries);
        let best = |query: &[f64]| {
            let all = (0..triangles.faces.len() as u32).map(|f| triangles.closest_on(f, query));
            all.min_by(|x, y| x.square.total_cmp(&y.square).then(x.face.cmp(&y.face))).unwrap()
        };
        rows.chunks(queries.ncols()).map(best).collect()
    }

    #[test]
    fn on_every_mesh_of_the_zoo_the_nearest_triangle_is_that_of_brute_force() {
        for (name, mesh) in zoo::all() {
            // Waves over the vertices, as an eigenbasis has them, and queries beside the surface.
            let embed = |shift: f64| {
                Mat::from_fn(mesh.n_vertices(), 30, |i, c| {
                    let p = mesh.vertices()[i];
                    let wave = (c % 6 + 1) as f64;
                    (wave * (p.x + shift) + c as f64 * p.y).cos() + (0.3 * wave * p.z).sin()
                })
            };
            let (corners, queries) = (embed(0.0), embed(0.03));
            let triangles = EmbeddedTriangles::new(corners.as_ref(), mesh.faces()).unwrap();
            let found = triangles.closest_to(queries.as_ref()).unwrap();
            assert_eq!(found, brute_force(&triangles, queries.as_ref()), "{name}");
        }
    }

    #[test]
    fn the_nearest_point_of_a_triangle_beats_a_fine_grid_on_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        for trial in 0..300 {
            let mut corners = Mat::from_fn(3, 5, |_, _| rng.random::<f64>());
            if trial % 5 == 0 {
                let first = corners.row(0).to_owned();
                corners.row_mut(1 + trial % 2).copy_from(&first); // no area
            }
            let query: Vec<f64> = (0..5).map(|_| rng.random::<f64>() * 2.0 - 0.5).collect();
            let triangles = EmbeddedTriangles::new(corners.as_ref(), &[[0, 1, 2]]).unwrap();
            let found = triangles.closest_on(0, &query);
            assert!(found.barycentric.iter().all(|&w| w >= 0.0), "{found:?}");
            assert!((found.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{found:?}");
            let ids = [0, 1, 2].map(|id| triangles.row(id));
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (s, t) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let other = square_to_point(ids, [1.0 - s - t, s, t], &query);
                    assert!(found.square <= other + 1e-12, "{found:?}, {other} at {s}, {t}");
                }
            }
        }
    }

    #[test]
    fn a_mesh_without_triangles_and_numbers_that_are_none_are_refused() {
        let corners = Mat::from_fn(3, 2, |i, c| (i * c) as f64);
        assert!(EmbeddedTriangles::new(corners.as_ref(), &[]).is_err());
        let faces = [[0, 1, 2]];
        let triangles = EmbeddedTriangles::new(corners.as_ref(), &faces).unwrap();
        let query = Mat::from_fn(1, 2, |_, _| f64::NAN);
        let error = triangles.closest_to(query.as_ref()).unwrap_err().to_string();
        assert!(error.contains("NaN in row 0, column 0"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Corners on a coarse grid: equal rows, triangles without area and ties are common.
        #[test]
        fn random_triangles_are_found_as_by_brute_force(
            n in 3usize..60,
            n_faces in 1usize..90,
            k in 1usize..40,
            levels in 1u32..50,
            seed in any::<u64>(),
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let corners = Mat::from_fn(n, k, |_, _| f64::from(rng.random_range(0..levels)));
            let faces: Vec<[u32; 3]> =
                (0..n_faces).map(|_| std::array::from_fn(|_| rng.random_range(0..n as u32))).collect();
            let queries = Mat::from_fn(20, k, |_, _| f64::from(rng.random_range(0..levels)) + 0.25);
            let triangles = EmbeddedTriangles::new(corners.as_ref(), &faces).unwrap();
            let found = triangles.closest_to(queries.as_ref()).unwrap();
            for (found, expected) in found.iter().zip(brute_force(&triangles, queries.as_ref())) {
                // Equal distances of neighbouring triangles differ in their last digit.
                prop_assert!((found.square - expected.square).abs() <= 1e-12 * (1.0 + expected.square));
            }
        }
    }
}
