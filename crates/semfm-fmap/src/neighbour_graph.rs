//! The surface as a graph: points of a cloud, joined to their nearest, weighted by likeness.
//!
//! Two steps use it: spectral clustering cuts it into parts (section IV-D of the paper), and
//! [`propagation`](crate::propagation) spreads a vote along it.

use faer::sparse::{SparseColMat, Triplet};
use semfm_geom::math::DVec3;
use semfm_geom::{DisjointSets, PointIndex};

use crate::{Error, Result};

/// An edge never weighs less: a part whose features resemble no neighbour's would otherwise fall off
/// numerically, and eigenvalues that close to zero leave their vectors undetermined (1e-6 was seen
/// to). Beside the typical e⁻¹ a thousandth cuts as well.
const LEAST_WEIGHT: f64 = 1e-3;

/// A connected graph of nearest neighbours in space with how much the ends of each edge differ.
#[derive(Clone, Debug)]
pub(crate) struct NeighbourGraph {
    n: usize,
    /// Pairs i < j, sorted but for the bridges between pieces, which come last.
    edges: Vec<(u32, u32)>,
    /// ‖sᵢ − sⱼ‖² of each edge over the median of all edges.
    differences: Vec<f64>,
}

impl NeighbourGraph {
    /// Joins each of the points (n) to its `neighbours` nearest, and what is still in several pieces
    /// along the minimum spanning tree. `square(i, j)` is ‖sᵢ − sⱼ‖², in any unit.
    ///
    /// # Errors
    /// [`Error::Geom`] for no points.
    pub fn new(
        points: &[DVec3],
        neighbours: usize,
        square: impl Fn(usize, usize) -> f64,
    ) -> Result<Self> {
        let edges = neighbour_edges(points, neighbours)?;
        let squares: Vec<f64> =
            edges.iter().map(|&(i, j)| square(i as usize, j as usize)).collect();
        let unit = median(squares.clone()).max(f64::MIN_POSITIVE);
        let differences = squares.into_iter().map(|square| square / unit).collect();
        Ok(Self { n: points.len(), edges, differences })
    }

    /// D − W (n × n) and the degrees D, with the weights exp(−‖sᵢ − sⱼ‖²/σ²) and σ² `contrast`
    /// times the median squared difference.
    ///
    /// # Errors
    /// [`Error::LinearAlgebra`] where the matrix does not fit into memory.
    pub fn laplacian(&self, contrast: f64) -> Result<(SparseColMat<usize, f64>, Vec<f64>)> {
        let mut degrees = vec![0.0; self.n];
        let mut triplets = Vec::with_capacity(2 * self.edges.len() + self.n);
        for (&(i, j), difference) in self.edges.iter().zip(&self.differences) {
            let weight = (-difference / contrast).exp().max(LEAST_WEIGHT);
            let (i, j) = (i as usize, j as usize);
            degrees[i] += weight;
            degrees[j] += weight;
            triplets.extend([Triplet::new(i, j, -weight), Triplet::new(j, i, -weight)]);
        }
        triplets.extend(degrees.iter().enumerate().map(|(i, &d)| Triplet::new(i, i, d)));
        let stiffness = SparseColMat::try_new_from_triplets(self.n, self.n, &triplets)
            .map_err(|_| Error::LinearAlgebra("assembling the neighbour graph"))?;
        Ok((stiffness, degrees))
    }
}

/// Edges (i < j) to the nearest neighbours in space, connected.
fn neighbour_edges(points: &[DVec3], neighbours: usize) -> Result<Vec<(u32, u32)>> {
    let index = PointIndex::new(points)?;
    let mut edges = Vec::with_capacity(points.len() * neighbours);
    for (i, &p) in points.iter().enumerate() {
        // The point itself is among the hits, though not always first: others may lie on it.
        let others = index.k_nearest(p, neighbours + 1).into_iter().filter(|hit| hit.0 != i);
        edges.extend(others.take(neighbours).map(|(j, _)| (i.min(j) as u32, i.max(j) as u32)));
    }
    edges.sort_unstable();
    edges.dedup();
    let mut pieces = DisjointSets::new(points.len());
    let joined = edges.iter().filter(|&&(i, j)| pieces.join(i, j)).count();
    if joined + 1 < points.len() {
        let bridges: Vec<_> =
            spanning_tree(points).into_iter().filter(|&(i, j)| pieces.join(i, j)).collect();
        edges.extend(bridges);
    }
    Ok(edges)
}

/// Edges (i < j) of the Euclidean minimum spanning tree, shortest first (Prim 1957, dense).
fn spanning_tree(points: &[DVec3]) -> Vec<(u32, u32)> {
    let mut nearest: Vec<(f64, u32)> =
        points.iter().map(|p| (p.distance_squared(points[0]), 0)).collect();
    let mut outside: Vec<u32> = (1..points.len() as u32).collect();
    let mut tree = Vec::with_capacity(outside.len());
    while let Some(at) = (0..outside.len())
        .min_by(|&a, &b| nearest[outside[a] as usize].0.total_cmp(&nearest[outside[b] as usize].0))
    {
        let new = outside.swap_remove(at);
        let (length, parent) = nearest[new as usize];
        tree.push((length, new.min(parent), new.max(parent)));
        for &i in &outside {
            let distance = points[i as usize].distance_squared(points[new as usize]);
            if distance < nearest[i as usize].0 {
                nearest[i as usize] = (distance, new);
            }
        }
    }
    tree.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    tree.into_iter().map(|(_, i, j)| (i, j)).collect()
}

/// The middle value; 0 where there is none (a single point has no edges).
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbour_graphs_are_connected_even_when_the_cloud_is_not() {
        let points: Vec<DVec3> = (0..60)
            .map(|i| DVec3::new(f64::from(i), f64::from(i % 7), 0.0))
            .map(|p| if p.x < 20.0 { p } else { p + 1000.0 * DVec3::X })
            .collect();
        let edges = neighbour_edges(&points, 4).unwrap();
        let mut pieces = DisjointSets::new(60);
        edges.iter().for_each(|&(i, j)| {
            pieces.join(i, j);
        });
        assert!((0..60).all(|i| pieces.root(i) == 0));
    }

    #[test]
    fn the_laplacian_of_a_constant_is_zero_and_one_point_is_a_graph() {
        let points: Vec<DVec3> = (0..9).map(|i| DVec3::X * f64::from(i)).collect();
        let graph = NeighbourGraph::new(&points, 2, |i, j| (i as f64 - j as f64).powi(2)).unwrap();
        let (stiffness, degrees) = graph.laplacian(0.5).unwrap();
        let mut sums = [0.0; 9];
        stiffness.triplet_iter().for_each(|t| sums[t.row] += t.val);
        assert!(sums.iter().all(|sum: &f64| sum.abs() < 1e-12));
        assert!(degrees.iter().all(|&d| d > 0.0));
        let alone = NeighbourGraph::new(&points[..1], 2, |_, _| 0.0).unwrap();
        assert_eq!(alone.laplacian(1.0).unwrap().1, [0.0]);
    }
}
