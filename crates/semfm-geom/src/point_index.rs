//! Nearest neighbours among points in space, by a k-d tree.

use std::fmt;
use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::math::DVec3;
use crate::{Error, Result};

/// A k-d tree over a fixed set of points: built once, asked often, from any thread.
///
/// ```
/// use semfm_geom::{PointIndex, math::DVec3};
/// let index = PointIndex::new(&[DVec3::ZERO, DVec3::X])?;
/// assert_eq!(index.nearest(DVec3::new(0.9, 0.0, 0.0)).0, 1);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
pub struct PointIndex {
    tree: ImmutableKdTree<f64, 3>,
    n_points: usize,
}

impl PointIndex {
    /// Builds the tree over `points` (n); their ids are their positions in the slice.
    ///
    /// # Errors
    /// [`Error::Length`] for no points, [`Error::NotFinite`] for a coordinate that is not a number.
    pub fn new(points: &[DVec3]) -> Result<Self> {
        if points.is_empty() {
            return Err(Error::Length { what: "points to search", expected: 1, found: 0 });
        }
        if let Some(vertex) = points.iter().position(|p| !p.is_finite()) {
            let p = points[vertex];
            return Err(Error::NotFinite { vertex, x: p.x, y: p.y, z: p.z });
        }
        let coordinates: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
        let tree = ImmutableKdTree::new_from_slice(&coordinates)
            .map_err(|_| Error::LinearAlgebra("the k-d tree"))?;
        Ok(Self { tree, n_points: points.len() })
    }

    /// Id of the point nearest to `query`, and its distance.
    pub fn nearest(&self, query: DVec3) -> (usize, f64) {
        let hit =
            self.tree.query(&query.to_array()).nearest_one::<SquaredEuclidean<f64>>().execute();
        (hit.item as usize, hit.distance.sqrt())
    }

    /// The `k` nearest points (fewer where there are fewer), nearest first, ties by id.
    pub fn k_nearest(&self, query: DVec3, k: usize) -> Vec<(usize, f64)> {
        let Some(k) = NonZero::new(k.min(self.n_points)) else { return Vec::new() };
        let hits =
            self.tree.query(&query.to_array()).nearest_n::<SquaredEuclidean<f64>>(k).execute();
        sorted(hits.into_iter().map(|hit| (hit.item as usize, hit.distance.sqrt())).collect())
    }

    /// All points within `radius` of `query`, nearest first, ties by id.
    pub fn within(&self, query: DVec3, radius: f64) -> Vec<(usize, f64)> {
        let hits = self
            .tree
            .query(&query.to_array())
            .within::<SquaredEuclidean<f64>>(radius * radius)
            .unsorted()
            .execute();
        sorted(hits.into_iter().map(|hit| (hit.item as usize, hit.distance.sqrt())).collect())
    }
}

fn sorted(mut hits: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    hits.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    hits
}

impl fmt::Debug for PointIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PointIndex").field("n_points", &self.n_points).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_points_on_one_plane_or_one_spot_are_no_trouble() {
        let plane: Vec<DVec3> =
            (0..2000).map(|i| DVec3::new(f64::from(i % 40), f64::from(i / 40), 0.0)).collect();
        let index = PointIndex::new(&plane).unwrap();
        assert_eq!(index.nearest(DVec3::new(3.2, 7.1, 1.0)).0, 7 * 40 + 3);
        assert_eq!(index.within(DVec3::new(3.0, 7.0, 0.0), 1.0).len(), 5);
        let spot = PointIndex::new(&vec![DVec3::ONE; 1000]).unwrap();
        assert_eq!(spot.k_nearest(DVec3::ZERO, 2000).len(), 1000);
    }
}
