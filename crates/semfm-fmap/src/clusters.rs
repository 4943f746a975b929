//! Cutting a semantic cloud into parts: spectral clustering on its neighbour graph (section IV-D).

use faer::sparse::{SparseColMat, Triplet};
use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::{Laplacian, PointIndex, SemanticCloud, Task};
use serde::{Deserialize, Serialize};

use crate::kmeans::k_means;
use crate::{Error, Result};

/// An edge never weighs less: a part whose features resemble no neighbour's would otherwise fall off
/// numerically, and eigenvalues that close to zero leave their vectors undetermined (1e-6 was seen
/// to). Beside the typical e⁻¹ a thousandth cuts as well.
const LEAST_WEIGHT: f64 = 1e-3;

/// How the graph is made and cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClusterSettings {
    /// Parts K (the paper's figure shows 5).
    pub n_clusters: usize,
    /// Neighbours of each point in space.
    pub neighbours: usize,
    /// Seedings of k-means, the best of which is kept.
    pub starts: usize,
    /// Seed of k-means and of the eigensolver.
    pub seed: u64,
}

impl Default for ClusterSettings {
    fn default() -> Self {
        Self { n_clusters: 5, neighbours: 10, starts: 10, seed: 0 }
    }
}

/// A cloud cut into parts: one label in `0..n_clusters` per point, every label borne by somebody.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clusters {
    labels: Vec<u32>,
    n_clusters: usize,
}

impl Clusters {
    /// Labels (M) from elsewhere; gaps in the numbering are closed.
    pub fn from_labels(labels: &[u32]) -> Self {
        let mut names = labels.to_vec();
        names.sort_unstable();
        names.dedup();
        let rank = |l: &u32| names.partition_point(|n| n < l) as u32;
        Self { labels: labels.iter().map(rank).collect(), n_clusters: names.len() }
    }

    /// Label of each point (M).
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// Number of parts there are.
    pub fn n_clusters(&self) -> usize {
        self.n_clusters
    }

    /// Mean feature vector of each part (n_clusters rows of length d), the paper's s̄.
    pub fn means(&self, cloud: &SemanticCloud) -> Vec<Vec<f64>> {
        let mut means = vec![vec![0.0; cloud.dim()]; self.n_clusters];
        let mut counts = vec![0.0; self.n_clusters];
        for (j, &label) in self.labels.iter().enumerate() {
            counts[label as usize] += 1.0;
            for (sum, &x) in means[label as usize].iter_mut().zip(cloud.feature(j)) {
                *sum += f64::from(x);
            }
        }
        for (mean, count) in means.iter_mut().zip(counts) {
            mean.iter_mut().for_each(|x| *x /= count);
        }
        means
    }
}

/// Spectral clustering with the normalised Laplacian (Shi & Malik 2000; von Luxburg 2007): the first
/// K generalised eigenvectors of L φ = λ D φ, cut by k-means.
///
/// Edges join each point to its nearest ones in space and weigh exp(−‖sᵢ − sⱼ‖²/σ²), σ² the median
/// squared difference over the edges; a graph in several pieces is joined along its minimum
/// spanning tree. A cloud of at most K points has one part per point.
///
/// # Errors
/// [`Error::OutOfRange`] for no clusters or no neighbours, whatever the eigensolver reports.
pub fn spectral_clusters(
    cloud: &SemanticCloud,
    settings: &ClusterSettings,
    task: &Task,
) -> Result<Clusters> {
    let (n, k) = (cloud.n_points(), settings.n_clusters);
    if k == 0 || settings.neighbours == 0 {
        let found = format!("{k} clusters, {} neighbours", settings.neighbours);
        return Error::out_of_range("clustering", "at least one cluster and one neighbour", found);
    }
    if n <= k {
        return Ok(Clusters { labels: (0..n as u32).collect(), n_clusters: n });
    }
    let laplacian = graph_laplacian(cloud, &neighbour_edges(cloud, settings.neighbours)?)?;
    let eigen = EigenSettings { seed: settings.seed, ..EigenSettings::default() };
    let basis = eigenbasis(&laplacian, k, &eigen, task)?;
    let rows: Vec<f64> =
        (0..n).flat_map(|i| basis.functions.row(i).iter().copied().collect::<Vec<_>>()).collect();
    Ok(Clusters::from_labels(&k_means(&rows, k, k, settings.starts, settings.seed)))
}

/// Edges (i < j) to the nearest neighbours in space, connected.
fn neighbour_edges(cloud: &SemanticCloud, neighbours: usize) -> Result<Vec<(u32, u32)>> {
    let points = cloud.points();
    let index = PointIndex::new(points)?;
    let mut edges = Vec::with_capacity(points.len() * neighbours);
    for (i, &p) in points.iter().enumerate() {
        // The point itself is among the hits, though not always first: others may lie on it.
        let others = index.k_nearest(p, neighbours + 1).into_iter().filter(|hit| hit.0 != i);
        edges.extend(others.take(neighbours).map(|(j, _)| (i.min(j) as u32, i.max(j) as u32)));
    }
    edges.sort_unstable();
    edges.dedup();
    let mut pieces = Pieces::new(points.len());
    let joined = edges.iter().filter(|&&(i, j)| pieces.join(i, j)).count();
    if joined + 1 < points.len() {
        let bridges: Vec<_> =
            spanning_tree(cloud).into_iter().filter(|&(i, j)| pieces.join(i, j)).collect();
        edges.extend(bridges);
    }
    Ok(edges)
}

/// Edges (i < j) of the Euclidean minimum spanning tree, shortest first (Prim 1957, dense).
fn spanning_tree(cloud: &SemanticCloud) -> Vec<(u32, u32)> {
    let points = cloud.points();
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

/// D − W as stiffness and the degrees D as mass: their eigenproblem is that of the normalised cut.
fn graph_laplacian(cloud: &SemanticCloud, edges: &[(u32, u32)]) -> Result<Laplacian> {
    let difference = |&(i, j): &(u32, u32)| -> f64 {
        let pairs = cloud.feature(i as usize).iter().zip(cloud.feature(j as usize));
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let squares: Vec<f64> = edges.iter().map(difference).collect();
    let sigma_squared = median(squares.clone()).max(f64::MIN_POSITIVE);
    let n = cloud.n_points();
    let mut degrees = vec![0.0; n];
    let mut triplets = Vec::with_capacity(2 * edges.len() + n);
    for (&(i, j), square) in edges.iter().zip(squares) {
        let weight = (-square / sigma_squared).exp().max(LEAST_WEIGHT);
        let (i, j) = (i as usize, j as usize);
        degrees[i] += weight;
        degrees[j] += weight;
        triplets.extend([Triplet::new(i, j, -weight), Triplet::new(j, i, -weight)]);
    }
    triplets.extend(degrees.iter().enumerate().map(|(i, &d)| Triplet::new(i, i, d)));
    let stiffness = SparseColMat::try_new_from_triplets(n, n, &triplets)
        .map_err(|_| Error::LinearAlgebra("assembling the neighbour graph"))?;
    Ok(Laplacian { stiffness, mass: degrees })
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Which points hang together: a union–find forest.
pub(crate) struct Pieces(Vec<u32>);

impl Pieces {
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    pub fn of(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Joins two points' pieces; false where they were one already.
    pub fn join(&mut self, i: u32, j: u32) -> bool {
        let (a, b) = (self.of(i), self.of(j));
        self.0[a.max(b) as usize] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    /// A strip of points along x in three equal thirds with features of their own; `gap` tears it.
    fn strip(n: usize, gap: f64) -> SemanticCloud {
        let third = |i: usize| 3 * i / n;
        let points = (0..n)
            .map(|i| DVec3::new(i as f64 + gap * third(i) as f64, (i % 7) as f64, 0.0))
            .collect();
        let wobble = |i: usize, c: usize| 0.02 * ((i * 7 + c * 13) as f32).sin();
        let features = (0..n)
            .flat_map(|i| {
                (0..4).map(move |c| (if third(i) == c { 1.0 } else { 0.0 }) + wobble(i, c))
            })
            .collect();
        SemanticCloud::new(points, features, 4, vec![1; n]).unwrap()
    }

    #[test]
    fn three_kinds_of_surface_become_three_parts_torn_or_not() {
        for gap in [0.0, 1000.0] {
            let settings = ClusterSettings { n_clusters: 3, ..ClusterSettings::default() };
            let clusters =
                spectral_clusters(&strip(150, gap), &settings, &Task::default()).unwrap();
            assert_eq!(clusters.n_clusters(), 3);
            let wrong =
                (0..150).filter(|&i| clusters.labels()[i] != clusters.labels()[50 * (i / 50) + 25]);
            assert!(wrong.count() <= 3, "gap {gap}");
        }
    }

    #[test]
    fn neighbour_graphs_are_connected_even_when_the_cloud_is_not() {
        let edges = neighbour_edges(&strip(60, 1000.0), 4).unwrap();
        let mut pieces = Pieces::new(60);
        edges.iter().for_each(|&(i, j)| {
            pieces.join(i, j);
        });
        assert!((0..60).all(|i| pieces.of(i) == 0));
    }

    #[test]
    fn a_handful_of_points_and_points_on_one_spot_still_have_parts() {
        let task = Task::default();
        let few = spectral_clusters(&strip(4, 0.0), &ClusterSettings::default(), &task).unwrap();
        assert_eq!(few.labels(), [0, 1, 2, 3]);
        let spot = SemanticCloud::new(vec![DVec3::ONE; 30], vec![0.5; 60], 2, vec![1; 30]).unwrap();
        let clusters = spectral_clusters(&spot, &ClusterSettings::default(), &task).unwrap();
        assert!(clusters.n_clusters() >= 1);
        assert_eq!(Clusters::from_labels(&[4, 9, 4]).labels(), [0, 1, 0]);
    }
}
