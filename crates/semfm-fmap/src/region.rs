//! Where to act: a weight per vertex.

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// A region (an affordance): a weight in [0, 1] for each of the n vertices of a mesh.
///
/// A vertex *counts* where its weight is at least [`Region::COUNTS`]; weights say how surely. The
/// vertex ids are those of the mesh as read, before any cleaning.
///
/// ```
/// use semfm_fmap::Region;
/// let grip = Region::from_vertices(5, &[3, 1])?;
/// assert_eq!(grip.vertices(), [1, 3]);
/// # Ok::<(), semfm_fmap::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    weights: Vec<f64>,
}

impl Region {
    /// The weight from which a vertex counts as inside.
    pub const COUNTS: f64 = 0.5;

    /// Most vertices of the mesh that a region of named vertices may belong to: a weight each makes a gigabyte.
    pub const MOST_VERTICES: usize = 1 << 27;

    /// A region from one weight per vertex (n).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a weight that is not in [0, 1], naming the vertex.
    pub fn from_weights(weights: Vec<f64>) -> Result<Self> {
        if let Some(v) = weights.iter().position(|w| !(0.0..=1.0).contains(w)) {
            let found = format!("{} at vertex {v}", weights[v]);
            return Error::out_of_range("region weight", "a number from 0 to 1", found);
        }
        Ok(Self { weights })
    }

    /// A region of full weight on the named vertices of a mesh with `n_vertices`; ids may repeat.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an id that the mesh does not have, and for more vertices than
    /// [`Region::MOST_VERTICES`].
    pub fn from_vertices(n_vertices: usize, vertices: &[u32]) -> Result<Self> {
        if n_vertices > Self::MOST_VERTICES {
            let expected = format!("at most {}", Self::MOST_VERTICES);
            return Error::out_of_range("vertices of a region's mesh", expected, n_vertices);
        }
        let mut weights = vec![0.0; n_vertices];
        for &v in vertices {
            let Some(weight) = weights.get_mut(v as usize) else {
                return Error::out_of_range(
                    "region vertex",
                    format!("an id below {n_vertices}"),
                    v,
                );
            };
            *weight = 1.0;
        }
        Ok(Self { weights })
    }

    /// A region of full weight where `inside` (n) is true.
    pub fn from_mask(inside: &[bool]) -> Self {
        Self { weights: inside.iter().map(|&b| f64::from(u8::from(b))).collect() }
    }

    /// Weights (n).
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of vertices n of the mesh, inside or not.
    pub fn n_vertices(&self) -> usize {
        self.weights.len()
    }

    /// Ids of the vertices that count, ascending.
    pub fn vertices(&self) -> Vec<u32> {
        (0..).zip(&self.weights).filter(|(_, w)| **w >= Self::COUNTS).map(|(v, _)| v).collect()
    }

    /// Whether each vertex counts (n).
    pub fn mask(&self) -> Vec<bool> {
        self.weights.iter().map(|&w| w >= Self::COUNTS).collect()
    }

    /// Whether no vertex counts.
    pub fn is_empty(&self) -> bool {
        !self.weights.iter().any(|&w| w >= Self::COUNTS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constructors_agree_and_refuse_what_is_no_region() {
        let by_id = Region::from_vertices(4, &[2, 2, 0]).unwrap();
        assert_eq!(by_id, Region::from_weights(vec![1.0, 0.0, 1.0, 0.0]).unwrap());
        assert_eq!(by_id, Region::from_mask(&by_id.mask()));
        let beyond = Region::from_vertices(4, &[4]).unwrap_err().to_string();
        assert!(beyond.contains("below 4") && beyond.contains("found 4"), "{beyond}");
        let many = Region::from_vertices(1 << 31, &[]).unwrap_err().to_string();
        assert!(many.contains("at most 134217728"), "{many}");
        let nan = Region::from_weights(vec![0.0, f64::NAN]).unwrap_err().to_string();
        assert!(nan.contains("vertex 1"), "{nan}");
        assert!(Region::from_weights(vec![0.49; 3]).unwrap().is_empty());
    }
}
