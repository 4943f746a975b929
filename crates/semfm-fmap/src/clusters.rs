//! Cutting a semantic cloud into parts: spectral clustering on its neighbour graph (section IV-D).

use semfm_geom::eigensolver::{EigenSettings, eigenbasis};
use semfm_geom::{Laplacian, SemanticCloud, Task};
use serde::{Deserialize, Serialize};

use crate::kmeans::k_means;
use crate::neighbour_graph::NeighbourGraph;
use crate::{Error, Result};

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

/// A cloud cut into parts: one label in `0..n_clusters` per point, each label on some point.
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
        let ranks = labels.iter().map(|l| names.partition_point(|n| n < l) as u32);
        Self { labels: ranks.collect(), n_clusters: names.len() }
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
/// [`Error::OutOfRange`] for no clusters or no neighbours, [`Error::Geom`] where the eigensolver
/// fails or on cancellation.
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
    let graph = NeighbourGraph::new(cloud.points(), settings.neighbours, |i, j| {
        let pairs = cloud.feature(i).iter().zip(cloud.feature(j));
        pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum()
    })?;
    // D − W as stiffness and the degrees D as mass: their eigenproblem is that of the normalised cut.
    let (stiffness, mass) = graph.laplacian(1.0)?;
    let laplacian = Laplacian { stiffness, mass };
    let eigen = EigenSettings { seed: settings.seed, ..EigenSettings::default() };
    let basis = eigenbasis(&laplacian, k, &eigen, task)?;
    let rows: Vec<f64> =
        (0..n).flat_map(|i| basis.functions.row(i).iter().copied().collect::<Vec<_>>()).collect();
    Ok(Clusters::from_labels(&k_means(&rows, k, k, settings.starts, settings.seed)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::math::DVec3;

    /// A strip of points along x in three equal thirds with features of their own; `gap` tears it.
    fn strip(n: usize, gap: f64) -> SemanticCloud {
        let points = (0..n)
            .map(|i| DVec3::new(i as f64 + gap * (3 * i / n) as f64, (i % 7) as f64, 0.0))
            .collect();
        let features = (0..4 * n).map(|at| {
            let (i, c) = (at / 4, at % 4);
            let noise = 0.02 * ((i * 7 + c * 13) as f32).sin();
            (if 3 * i / n == c { 1.0 } else { 0.0 }) + noise
        });
        SemanticCloud::new(points, features.collect(), 4, vec![1; n]).unwrap()
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
