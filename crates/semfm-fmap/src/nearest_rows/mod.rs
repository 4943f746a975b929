//! Nearest neighbours between the rows of two matrices, exact and mostly not computed.
//!
//! In 20 to 200 dimensions a k-d tree visits most of its leaves, and all distances together are a matrix product. Between
//! the two: points stand in panels of 16 that lie near each other, queries in tiles of 6 that do
//! ([`patches`]). A panel whose ball, taken in the first 24 columns alone, is out of the reach of all six queries is left
//! out; of the others the squared distances are summed up column by column in registers, and left as soon as none of the
//! 96 can come within reach ([`scan`]). A query reaches as far as the nearest point that it has met, and it first meets
//! the panel of its last answer or the one with the nearest centre.
//!
//! Sums run in f32, which finds the winner up to rounding; points within the rounding bound of the winner are compared
//! again in f64, so the answer is that of all f64 distances, ties to the lowest row.

mod panels;
mod patches;
mod rows;
mod scan;

use faer::MatRef;
use rayon::prelude::*;

use self::panels::{Balls, Frame, PANEL, Packed, TILE};
pub(crate) use self::patches::Patches;
pub(crate) use self::rows::Rows;
use self::scan::{Margin, Near, ScanTile, Scratch, Start};
use crate::{Error, Result};

/// For each row of `queries` (q × k) the nearest row of `points` (p × k), ties to the lowest row.
///
/// The answer is that of exact f64 distances and does not depend on the number of threads.
///
/// # Errors
/// [`Error::Length`] where the numbers of columns differ, [`Error::OutOfRange`] without a row of `points` and for a
/// number that is not finite.
pub fn nearest_rows(queries: MatRef<'_, f64>, points: MatRef<'_, f64>) -> Result<Vec<u32>> {
    Error::length("columns of the queries", points.ncols(), queries.ncols())?;
    let (queries, points) = (Rows::of(queries), Rows::of(points));
    nearest_of(&queries, &points, &Patches::of(&queries, &points), None)
}

/// For each of the queries the nearest of the points, ties to the first or to that of the lowest rank.
///
/// `guesses` are points that may be near, one for each query: with good ones the search is shorter.
///
/// # Errors
/// As [`nearest_rows`].
pub(crate) fn nearest_of(
    queries: &Rows<'_>,
    points: &Rows<'_>,
    patches: &Patches,
    guesses: Option<&[u32]>,
) -> Result<Vec<u32>> {
    let search = Search::new(queries, points, patches, None)?;
    let panel_of = guesses.map(|guesses| search.panels_of(guesses));
    let answers = search.each_tile(|tile, scratch| {
        let panels = panel_of.as_ref().map(|panels| search.of_tile(tile, panels));
        scratch.reach = [f32::INFINITY; TILE];
        let start = panels.as_ref().map_or(Start::Nearest, |panels| Start::Panels(panels));
        search.scan(tile, start, scratch);
        std::array::from_fn(|q| {
            let query = search.queries32.ids[tile * TILE + q] as usize;
            search.decide(query, scratch.reach[q], &scratch.near[q])
        })
    });
    Ok(search.in_rows(answers))
}

/// Balls in the space of the rows.
pub(crate) struct BallRows<'a> {
    /// Their centres.
    pub centres: Rows<'a>,
    /// Their radii.
    pub radii: &'a [f64],
}

/// A ball that a query may reach.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached {
    /// Row of its centre.
    pub id: u32,
    /// Nothing in it is nearer than this.
    pub at_least: f64,
}

/// What `decide` says of each query and of all balls that come as near to it as `reach`, in any order; by rounding a ball
/// just beyond may be among them, none within is left out.
///
/// # Errors
/// As [`nearest_rows`].
pub(crate) fn reached_balls<T: Send + Default + Clone>(
    queries: &Rows<'_>,
    balls: &BallRows<'_>,
    patches: &Patches,
    reach: &[f64],
    decide: impl Fn(usize, &mut Vec<Reached>) -> T + Sync,
) -> Result<Vec<T>> {
    let search = Search::new(queries, &balls.centres, patches, Some(balls.radii))?;
    let answers = search.each_tile(|tile, scratch| {
        let reach = search.of_tile(tile, reach);
        scratch.reach = reach.map(|reach| search.margin.beyond((reach * search.scale) as f32));
        search.scan(tile, Start::Within, scratch);
        let mut reached = Vec::new();
        std::array::from_fn(|q| {
            reached.clear();
            reached.extend(scratch.near[q].iter().map(|near| search.reached(*near, balls.radii)));
            decide(search.queries32.ids[tile * TILE + q] as usize, &mut reached)
        })
    });
    Ok(search.in_rows(answers))
}

/// The two sets of rows as the scan wants them.
struct Search<'a> {
    queries: &'a Rows<'a>,
    points: &'a Rows<'a>,
    queries32: Packed<TILE>,
    points32: Packed<PANEL>,
    /// Radii of the points where they are centres of balls.
    radii32: Vec<[f32; PANEL]>,
    balls: Balls,
    margin: Margin,
    /// Length in the frame of f32 over length.
    scale: f64,
}

impl<'a> Search<'a> {
    fn new(
        queries: &'a Rows<'a>,
        points: &'a Rows<'a>,
        patches: &Patches,
        radii: Option<&[f64]>,
    ) -> Result<Self> {
        if points.len() == 0 {
            return Error::out_of_range("points of a nearest-row search", "at least one row", 0);
        }
        let frame = Frame::of(queries, points)?;
        let points32 = Packed::new(points, &patches.points, &frame);
        // A sum of k squared differences errs by (k + 3) u at most, u half of ε, its root by half of that; a row that
        // became f32 by u times its length. Both sides of a comparison err, and the rest is to spare.
        let relative = (points.n_columns() + 8) as f32 * f32::EPSILON;
        let margin = Margin { relative, absolute: 4.0 * f32::EPSILON * frame.longest };
        let radii32 = radii.map_or(Vec::new(), |radii| {
            let groups = points32.ids.chunks_exact(PANEL);
            let scaled = |id: u32| margin.beyond((radii[id as usize] * frame.scale) as f32);
            groups.map(|ids| std::array::from_fn(|i| scaled(ids[i]))).collect()
        });
        let balls = Balls::around(&points32, &radii32, relative);
        let queries32 = Packed::new(queries, &patches.queries, &frame);
        let scale = frame.scale;
        Ok(Self { queries, points, queries32, points32, radii32, balls, margin, scale })
    }

    /// `work` on every tile, in their order.
    fn each_tile<T: Send>(
        &self,
        work: impl Fn(usize, &mut Scratch) -> [T; TILE] + Sync,
    ) -> Vec<[T; TILE]> {
        let tiles = (0..self.queries32.n_groups()).into_par_iter();
        let scratch = || Scratch::new(&self.points32, &self.balls);
        tiles.map_init(scratch, |scratch, tile| work(tile, scratch)).collect()
    }

    fn scan(&self, tile: usize, start: Start<'_>, scratch: &mut Scratch) {
        pulp::Arch::new().dispatch(ScanTile {
            queries: self.queries32.group(tile),
            points: &self.points32,
            radii: &self.radii32,
            balls: &self.balls,
            margin: self.margin,
            start,
            scratch,
        });
    }

    /// The panel in which each query's guess stands.
    fn panels_of(&self, guesses: &[u32]) -> Vec<u32> {
        let mut panel_of = vec![0u32; self.points.len()];
        for (i, &id) in self.points32.ids.iter().enumerate() {
            panel_of[id as usize] = (i / PANEL) as u32;
        }
        guesses.iter().map(|&guess| panel_of[guess as usize]).collect()
    }

    /// What is said of each query, for those of one tile.
    fn of_tile<T: Copy>(&self, tile: usize, of_query: &[T]) -> [T; TILE] {
        std::array::from_fn(|q| of_query[self.queries32.ids[tile * TILE + q] as usize])
    }

    /// Answers of the tiles, in the order of the rows.
    fn in_rows<T: Clone + Default>(&self, answers: Vec<[T; TILE]>) -> Vec<T> {
        let mut out = vec![T::default(); self.queries.len()];
        for (&id, answer) in self.queries32.ids.iter().zip(answers.into_iter().flatten()) {
            out[id as usize] = answer;
        }
        out
    }

    /// The exact winner among the points within reach.
    fn decide(&self, query: usize, reach: f32, near: &[Near]) -> u32 {
        let mut ids = near.iter().filter(|x| x.square <= reach * reach).map(|x| x.id);
        let first = ids.next().unwrap_or(0);
        let mut winner = (first, None);
        for id in ids {
            let current = *winner.1.get_or_insert_with(|| self.distance(query, winner.0));
            let distance = self.distance(query, id);
            let is_first = || self.points.rank(id) < self.points.rank(winner.0);
            if distance < current || (distance == current && is_first()) {
                winner = (id, Some(distance));
            }
        }
        winner.0
    }

    fn distance(&self, query: usize, point: u32) -> f64 {
        let rows = self.queries.row(query).zip(self.points.row(point as usize));
        rows.map(|(x, y)| (x - y) * (x - y)).sum()
    }

    /// The ball of a centre, in lengths of the rows.
    fn reached(&self, near: Near, radii: &[f64]) -> Reached {
        let distance = near.square.sqrt() * (1.0 - self.margin.relative) - self.margin.absolute;
        let at_least = f64::from(distance) / self.scale - radii[near.id as usize];
        Reached { id: near.id, at_least }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::Mat;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random(n: usize, k: usize, seed: u64) -> Mat<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Mat::from_fn(n, k, |_, _| rng.random::<f64>() + 5.0)
    }

    /// The nearest of all points by f64 distances, ties to the lowest row.
    fn brute_force(queries: MatRef<'_, f64>, points: MatRef<'_, f64>) -> Vec<u32> {
        let distance = |q: usize, p: usize| {
            (0..queries.ncols()).map(|c| (queries[(q, c)] - points[(p, c)]).powi(2)).sum::<f64>()
        };
        let nearest = |q: usize| {
            let all = (0..points.nrows()).map(|p| (distance(q, p), p as u32));
            all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).unwrap().1
        };
        (0..queries.nrows()).map(nearest).collect()
    }

    #[test]
    fn every_row_gets_its_exact_nearest() {
        for (n_queries, n_points, k) in [(300, 2500, 7), (1, 1, 1), (7, 17, 30), (500, 900, 90)] {
            let (queries, points) = (random(n_queries, k, 1), random(n_points, k, 2));
            let found = nearest_rows(queries.as_ref(), points.as_ref()).unwrap();
            assert_eq!(found, brute_force(queries.as_ref(), points.as_ref()));
        }
    }

    #[test]
    fn points_along_a_surface_get_their_nearest_whatever_is_guessed() {
        // Waves on a sheet, as an eigenbasis has them: most panels are never looked into.
        let sheet = |n: usize, seed: u64| {
            let places = random(n, 2, seed);
            Mat::from_fn(n, 60, |i, c| {
                let (x, y) = (places[(i, 0)], places[(i, 1)]);
                (3.0 * (c % 8) as f64 * x).cos() * (3.0 * (c / 8) as f64 * y).cos()
            })
        };
        let (queries, points) = (sheet(400, 3), sheet(1500, 4));
        let expected = brute_force(queries.as_ref(), points.as_ref());
        let (q, p) = (Rows::of(queries.as_ref()), Rows::of(points.as_ref()));
        let patches = Patches::of(&q, &p);
        let wrong: Vec<u32> = (0..400).map(|i| (i * 7) % 1500).collect();
        for guesses in [None, Some(&expected[..]), Some(&wrong)] {
            assert_eq!(nearest_of(&q, &p, &patches, guesses).unwrap(), expected);
        }
    }

    #[test]
    fn ties_closer_than_f32_can_see_are_settled_and_equal_rows_go_to_the_first() {
        let mut points = random(40, 3, 3);
        let copy = points.row(11).to_owned();
        points.row_mut(30).copy_from(&copy);
        points[(20, 0)] = points[(11, 0)] + 1e-12;
        points[(20, 1)] = points[(11, 1)];
        points[(20, 2)] = points[(11, 2)];
        let queries = Mat::from_fn(2, 3, |i, c| points[([11, 20][i], c)]);
        assert_eq!(nearest_rows(queries.as_ref(), points.as_ref()).unwrap(), [11, 20]);
    }

    #[test]
    fn what_has_no_nearest_row_is_refused() {
        let (queries, points) = (random(4, 3, 1), random(5, 3, 2));
        let error = nearest_rows(queries.as_ref(), random(5, 2, 2).as_ref()).unwrap_err();
        assert!(matches!(error, Error::Length { expected: 2, found: 3, .. }), "{error}");
        let error = nearest_rows(queries.as_ref(), Mat::zeros(0, 3).as_ref()).unwrap_err();
        assert!(error.to_string().contains("at least one row"), "{error}");
        for bad in [f64::NAN, f64::INFINITY] {
            let mut spoiled = points.clone();
            spoiled[(3, 1)] = bad;
            let error = nearest_rows(queries.as_ref(), spoiled.as_ref()).unwrap_err().to_string();
            assert!(error.contains("points") && error.contains("row 3, column 1"), "{error}");
            let error = nearest_rows(spoiled.as_ref(), points.as_ref()).unwrap_err().to_string();
            assert!(error.contains("queries") && error.contains("row 3, column 1"), "{error}");
        }
    }

    #[test]
    fn balls_within_reach_are_all_found() {
        let (queries, centres) = (random(50, 40, 5), random(800, 40, 6));
        let radii: Vec<f64> = (0..800).map(|i| 0.001 * f64::from(i % 500)).collect();
        let reach: Vec<f64> = (0..50).map(|i| 1.6 + 0.01 * f64::from(i)).collect();
        let (q, c) = (Rows::of(queries.as_ref()), Rows::of(centres.as_ref()));
        let patches = Patches::of(&q, &c);
        let balls = BallRows { centres: c, radii: &radii };
        let found = reached_balls(&q, &balls, &patches, &reach, |_, reached| {
            reached.sort_unstable_by_key(|ball| ball.id);
            reached.iter().map(|ball| (ball.id, ball.at_least)).collect::<Vec<_>>()
        });
        let mut n_reached = 0;
        for (i, found) in found.unwrap().iter().enumerate() {
            let gap = |b: usize| (queries.row(i) - centres.row(b)).norm_l2() - radii[b];
            let ids: Vec<u32> = found.iter().map(|x| x.0).collect();
            let mut within = (0..800).filter(|&b| gap(b) <= reach[i]).map(|b| b as u32);
            assert!(within.all(|id| ids.contains(&id)), "one within reach is missing");
            assert!(ids.iter().all(|&id| gap(id as usize) <= reach[i] + 1e-4), "one is far beyond");
            for &(id, at_least) in found {
                assert!((at_least..at_least + 1e-4).contains(&gap(id as usize)), "{at_least}");
            }
            n_reached += ids.len();
        }
        assert!((1..50 * 800).contains(&n_reached), "{n_reached}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Few values in each column make ties and equal rows common; the magnitude must not matter.
        #[test]
        fn ties_and_duplicates_go_to_the_lowest_row(
            n_queries in 1usize..40,
            n_points in 1usize..120,
            k in 1usize..60,
            levels in 1u32..4,
            exponent in -40i32..40,
            seed in any::<u64>(),
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let unit = 10f64.powi(exponent);
            let mut rows = |n| Mat::from_fn(n, k, |_, _| unit * f64::from(rng.random_range(0..levels)));
            let (queries, points) = (rows(n_queries), rows(n_points));
            let found = nearest_rows(queries.as_ref(), points.as_ref()).unwrap();
            prop_assert_eq!(found, brute_force(queries.as_ref(), points.as_ref()));
        }
    }
}
