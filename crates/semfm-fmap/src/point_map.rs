//! One source vertex for each target vertex.

use std::borrow::Cow;

use faer::{Mat, MatRef};
use semfm_geom::{Eigenbasis, Shape};

use crate::{Error, Result};

/// A map target → source: `source_of[j]` is the source vertex matched to target vertex `j`.
///
/// Functions and regions therefore go source → target, by being looked up.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PointMap {
    /// Source vertex per target vertex (n_target).
    pub source_of: Vec<u32>,
}

impl PointMap {
    /// A map onto a source of `n_source` vertices.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an id that the source does not have.
    pub fn new(source_of: Vec<u32>, n_source: usize) -> Result<Self> {
        match source_of.iter().position(|&i| i as usize >= n_source) {
            None => Ok(Self { source_of }),
            Some(j) => {
                let found = format!("{} for target vertex {j}", source_of[j]);
                Error::out_of_range("point map", format!("source vertices below {n_source}"), found)
            }
        }
    }

    /// Number of target vertices.
    pub fn n_target(&self) -> usize {
        self.source_of.len()
    }

    /// A function (n_source) on the source, pulled back to the target (n_target).
    pub fn pull_back<T: Copy>(&self, function: &[T]) -> Vec<T> {
        self.source_of.iter().map(|&i| function[i as usize]).collect()
    }

    /// Rows `source_of[j]` of the first `k` source eigenfunctions (n_target × k).
    pub(crate) fn pull_back_basis(&self, source: &Eigenbasis, k: usize) -> Mat<f64> {
        rows_of(source.first(k), &self.source_of)
    }

    /// The same map between the original meshes, from one between the working meshes.
    pub fn onto_originals(&self, source: &Shape, target: &Shape) -> Self {
        let (source, target) = (source.working(), target.working());
        let working = target.of_original.iter().map(|&j| self.source_of[j as usize]);
        Self { source_of: working.map(|i| source.to_original[i as usize]).collect() }
    }
}

/// The chosen rows of a matrix, in that order (ids × k).
pub(crate) fn rows_of(matrix: MatRef<'_, f64>, ids: &[u32]) -> Mat<f64> {
    let mut out = Mat::zeros(ids.len(), matrix.ncols());
    for c in 0..matrix.ncols() {
        let column = matrix.col(c);
        // Whole columns are read: out of a strided one that would cost an address each.
        let column = match column.try_as_col_major() {
            Some(column) => Cow::Borrowed(column.as_slice()),
            None => Cow::Owned(column.iter().copied().collect::<Vec<f64>>()),
        };
        for (x, &i) in out.col_as_slice_mut(c).iter_mut().zip(ids) {
            *x = column[i as usize];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_looked_up_and_bad_ids_named() {
        let map = PointMap::new(vec![2, 0, 2], 3).unwrap();
        assert_eq!(map.pull_back(&['a', 'b', 'c']), ['c', 'a', 'c']);
        let error = PointMap::new(vec![2, 3], 3).unwrap_err().to_string();
        assert!(error.contains("target vertex 1"), "{error}");
    }
}
