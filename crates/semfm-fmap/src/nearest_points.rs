//! The nearest points between two clouds in feature space.

use faer::Mat;
use rayon::prelude::*;

/// For each of some points its nearest ones of another cloud, nearest first.
#[derive(Debug)]
pub(crate) struct NearestPoints {
    /// Ids (n × count).
    ids: Vec<Vec<u32>>,
}

impl NearestPoints {
    /// The (at most) `count` rows of `points` nearest to each row of `queries`.
    pub fn new(queries: &Mat<f64>, points: &Mat<f64>, count: usize) -> Self {
        let count = count.min(points.nrows());
        let ids = (0..queries.nrows()).into_par_iter();
        Self { ids: ids.map(|j| nearest_to(queries, j, points, count)).collect() }
    }

    /// The very nearest of each.
    pub fn nearest(&self) -> Vec<u32> {
        self.ids.iter().map(|ids| ids[0]).collect()
    }

    /// The mean of a function on the other cloud over the nearest ones of each.
    pub fn vote(&self, function: &[f64]) -> Vec<f64> {
        self.ids.iter().map(|ids| mean_over(ids, function)).collect()
    }
}

fn mean_over(ids: &[u32], values: &[f64]) -> f64 {
    ids.iter().map(|&i| values[i as usize]).sum::<f64>() / ids.len().max(1) as f64
}

fn nearest_to(queries: &Mat<f64>, j: usize, points: &Mat<f64>, count: usize) -> Vec<u32> {
    let mut squares = vec![0.0; points.nrows()];
    for c in 0..points.ncols() {
        let x = queries[(j, c)];
        for (d, y) in squares.iter_mut().zip(points.col_as_slice(c)) {
            *d += (x - y) * (x - y);
        }
    }
    let mut hits: Vec<(f64, u32)> = squares.into_iter().zip(0..).collect();
    hits.select_nth_unstable_by(count - 1, nearer);
    hits.truncate(count);
    hits.sort_unstable_by(nearer);
    hits.into_iter().map(|hit| hit.1).collect()
}

/// By distance, ties to the lower id.
fn nearer(a: &(f64, u32), b: &(f64, u32)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::mat;

    #[test]
    fn neighbours_come_by_distance_and_their_votes_are_means() {
        let (queries, points) = (mat![[0.1], [2.2]], mat![[2.0], [0.0], [1.0], [0.0]]);
        let found = NearestPoints::new(&queries, &points, 3);
        assert_eq!(found.ids, [[1, 3, 2], [0, 2, 1]]);
        assert_eq!(found.nearest(), [1, 0]);
        assert_eq!(found.vote(&[3.0, 0.0, 3.0, 0.0]), [1.0, 2.0]);
        assert_eq!(NearestPoints::new(&queries, &points, 9).ids[0].len(), 4);
    }
}
