//! Bridges between the pieces of a mesh that does not hang together.
//!
//! The first c eigenfunctions of a mesh with c pieces are constants on them: on a shoe of 149
//! components nothing else is left below the usual 100. Weak edges across the gaps turn all but
//! one of these into slowly varying functions of the whole object.

use faer::sparse::SparseColMat;
use serde::Serialize;

use super::assembly::WeightedEdge;
use super::labelled_tree::{LabelledTree, Link};
use super::{Laplacian, assembly};
use crate::connectivity::Components;
use crate::disjoint_sets::DisjointSets;
use crate::{Error, Mesh, Result};

/// How pieces are joined.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BridgeSettings {
    /// Stiffness of a bridge. 0.5 is near that of an edge between equilateral triangles (0.58).
    pub weight: f64,
    /// Vertices of different pieces closer than this many median edge lengths are joined.
    pub reach: f64,
}

impl Default for BridgeSettings {
    fn default() -> Self {
        Self { weight: 0.5, reach: 1.0 }
    }
}

/// A Laplacian whose pieces were joined, and what it took.
#[derive(Clone, Debug)]
pub struct BridgedLaplacian {
    /// The Laplacian with the bridges added to its stiffness; the mass is as it was.
    pub laplacian: Laplacian,
    /// Pieces before; there is one piece after. A vertex without triangles is a piece.
    pub n_components: usize,
    /// The added edges, smaller id first, in ascending order.
    pub bridges: Vec<[u32; 2]>,
}

/// Joins the pieces of `laplacian` into one.
///
/// Every vertex with a vertex of another piece within `reach` median edges of `mesh` gets an edge
/// to the nearest such vertex. What is apart after that is joined piece by piece by the shortest
/// link to another (Borůvka 1926), so that as little length as possible is added.
///
/// # Errors
/// [`Error::Length`] where Laplacian and mesh differ in vertices, [`Error::OutOfRange`] for a
/// weight that is not positive or a reach that is negative.
pub fn bridge(
    laplacian: &Laplacian,
    mesh: &Mesh,
    settings: &BridgeSettings,
) -> Result<BridgedLaplacian> {
    let n = laplacian.n_vertices();
    if n != mesh.n_vertices() {
        return Err(Error::Length {
            what: "vertices of the mesh",
            expected: n,
            found: mesh.n_vertices(),
        });
    }
    for (what, value, valid) in [
        ("bridge weight", settings.weight, settings.weight > 0.0),
        ("bridge reach", settings.reach, settings.reach >= 0.0),
    ] {
        if !(valid && value.is_finite()) {
            return Err(Error::OutOfRange {
                what,
                expected: "a positive number".into(),
                found: value.to_string(),
            });
        }
    }
    let Components { of_vertex: labels, count: n_components } = components(n, &laplacian.stiffness);
    if n_components == 1 {
        return Ok(BridgedLaplacian {
            laplacian: laplacian.clone(),
            n_components,
            bridges: Vec::new(),
        });
    }
    let mut bridges = links(mesh, labels, settings.reach * mesh.median_edge());
    bridges.sort_unstable();
    bridges.dedup();

    let upper = laplacian.stiffness.triplet_iter().filter(|t| t.row < t.col);
    let mut edges: Vec<WeightedEdge> = upper
        .map(|t| WeightedEdge { ends: [t.row as u32, t.col as u32], weight: -*t.val })
        .collect();
    edges.extend(bridges.iter().map(|&ends| WeightedEdge { ends, weight: settings.weight }));
    let stiffness = assembly::stiffness(n, &edges);
    let joined = Laplacian { stiffness, mass: laplacian.mass.clone() };
    Ok(BridgedLaplacian { laplacian: joined, n_components, bridges })
}

/// The bridges: first all short ones, then the shortest links until one piece is left.
fn links(mesh: &Mesh, labels: Vec<u32>, reach: f64) -> Vec<[u32; 2]> {
    let points = mesh.vertices();
    let mut index = LabelledTree::new(points, &labels);
    let mut groups = Groups::new(labels);
    let short = Link::limit(reach * reach);
    let mut chosen: Vec<Link> = (0..points.len())
        .map(|i| index.nearest(i as u32, points[i], groups.labels[i], short))
        .filter(Link::is_found)
        .collect();
    let mut bridges = chosen.clone();
    loop {
        chosen.iter().for_each(|link| groups.join(link));
        groups.refresh();
        if groups.is_one() {
            return bridges.iter().map(Link::ends).collect();
        }
        // One round of Borůvka: each group's own shortest link. Asking with the group's best so
        // far as the limit lets most vertices stop at the root.
        index.relabel(&groups.labels);
        let mut best = vec![Link::limit(f64::INFINITY); groups.n_labels];
        for ((i, &point), &label) in (0u32..).zip(points).zip(&groups.labels) {
            let best = &mut best[label as usize];
            *best = index.nearest(i, point, label, *best);
        }
        chosen = best.into_iter().filter(Link::is_found).collect();
        bridges.extend(&chosen);
    }
}

/// Union of labelled groups.
struct Groups {
    /// Label of each vertex, as of the last refresh.
    labels: Vec<u32>,
    /// Of the labels; the smallest stays, whatever the order of the links.
    sets: DisjointSets,
    n_labels: usize,
}

impl Groups {
    fn new(labels: Vec<u32>) -> Self {
        let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
        Self { labels, sets: DisjointSets::new(n_labels), n_labels }
    }

    fn join(&mut self, link: &Link) {
        let [a, b] = [link.from, link.to].map(|i| self.labels[i as usize]);
        self.sets.join(a, b);
    }

    fn refresh(&mut self) {
        for label in &mut self.labels {
            *label = self.sets.root(*label);
        }
    }

    fn is_one(&self) -> bool {
        self.labels.iter().all(|&label| label == 0)
    }
}

/// The connected pieces of a stiffness matrix (n × n), numbered by their first vertex.
pub(crate) fn components(n: usize, stiffness: &SparseColMat<usize, f64>) -> Components {
    let mut sets = DisjointSets::new(n);
    for t in stiffness.triplet_iter().filter(|t| t.row < t.col && *t.val != 0.0) {
        sets.join(t.row as u32, t.col as u32);
    }
    let mut labels = vec![0; n];
    let mut count = 0;
    for i in 0..n {
        let root = sets.root(i as u32) as usize;
        if root == i {
            labels[i] = count;
            count += 1;
        } else {
            labels[i] = labels[root];
        }
    }
    Components { of_vertex: labels, count: count as usize }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laplacian::{LaplacianKind, laplacian};
    use crate::math::DVec3;
    use crate::zoo;

    #[test]
    fn afterwards_every_mesh_of_the_zoo_is_in_one_piece() {
        for (name, mesh) in zoo::all() {
            let before = laplacian(&mesh, LaplacianKind::Tufted).unwrap();
            let bridged = bridge(&before, &mesh, &BridgeSettings::default()).unwrap();
            let n = mesh.n_vertices();
            assert_eq!(components(n, &bridged.laplacian.stiffness).count, 1, "{name}");
            assert!(bridged.bridges.len() + 1 >= bridged.n_components, "{name}");
            assert_eq!(bridged.bridges.is_empty(), bridged.n_components == 1, "{name}");
            let sums =
                bridged.laplacian.stiffness.triplet_iter().fold(vec![0.0; n], |mut sums, t| {
                    sums[t.row] += t.val;
                    sums
                });
            assert!(sums.iter().all(|s: &f64| s.abs() < 1e-6), "{name}: rows sum to zero");
        }
    }

    /// `n` unit-edge triangles along x, each `gap` from the next.
    fn row_of_triangles(n: usize, gap: f64) -> Mesh {
        let corners = (0..n).flat_map(|i| {
            let left = DVec3::X * (1.0 + gap) * i as f64;
            [left, left + DVec3::X, left + DVec3::new(0.5, 0.75f64.sqrt(), 0.0)]
        });
        Mesh::new(corners.collect(), (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
            .unwrap()
    }

    #[test]
    fn near_pieces_get_every_short_edge_and_far_pieces_one_link() {
        for (gap, expected) in [(0.5, vec![[1, 3], [4, 6]]), (3.0, vec![[1, 3], [4, 6]])] {
            let mesh = row_of_triangles(3, gap);
            let before = laplacian(&mesh, LaplacianKind::Cotan).unwrap();
            let bridged = bridge(&before, &mesh, &BridgeSettings::default()).unwrap();
            assert_eq!((bridged.n_components, &bridged.bridges), (3, &expected), "gap {gap}");
            assert_eq!(bridged.laplacian.stiffness.get(1, 3), Some(&-0.5));
        }
    }

    #[test]
    fn a_bad_weight_is_refused() {
        let mesh = row_of_triangles(2, 1.0);
        let before = laplacian(&mesh, LaplacianKind::Cotan).unwrap();
        let bad = BridgeSettings { weight: 0.0, ..Default::default() };
        assert!(matches!(bridge(&before, &mesh, &bad), Err(Error::OutOfRange { .. })));
    }
}
