//! Bridges between the pieces of a mesh that does not hang together.
//!
//! The first c eigenfunctions of a mesh with c pieces are constants on them: on a shoe of 149
//! components nothing else is left below the usual 100. Weak edges across the gaps turn all but
//! one of these into slowly varying functions of the whole object.

use faer::sparse::SparseColMat;

use super::foreign::{ForeignIndex, Link};
use super::{Laplacian, assembly};
use crate::{Error, Mesh, Result};

/// How pieces are joined.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
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
    let (labels, n_components) = components(n, &laplacian.stiffness);
    if n_components == 1 {
        return Ok(BridgedLaplacian {
            laplacian: laplacian.clone(),
            n_components,
            bridges: Vec::new(),
        });
    }
    let mut bridges = links(mesh, labels, settings.reach * median_edge(mesh));
    bridges.sort_unstable();
    bridges.dedup();

    let upper = laplacian.stiffness.triplet_iter().filter(|t| t.row < t.col);
    let mut edges: Vec<_> = upper.map(|t| (t.row as u32, t.col as u32, -*t.val)).collect();
    edges.extend(bridges.iter().map(|&[i, j]| (i, j, settings.weight)));
    let stiffness = assembly::stiffness(n, &edges);
    let joined = Laplacian { stiffness, mass: laplacian.mass.clone() };
    Ok(BridgedLaplacian { laplacian: joined, n_components, bridges })
}

/// The bridges: first all short ones, then the shortest links until one piece is left.
fn links(mesh: &Mesh, labels: Vec<u32>, reach: f64) -> Vec<[u32; 2]> {
    let points = mesh.vertices();
    let mut index = ForeignIndex::new(points, &labels);
    let mut groups = Groups::new(labels);
    let limit = |distance_squared| Link { distance_squared, from: u32::MAX, to: u32::MAX };
    let is_link = |link: &Link| link.to != u32::MAX;

    let nearest = |index: &ForeignIndex, labels: &[u32], i: usize, best: Link| {
        index.nearest(i as u32, points[i], labels[i], best)
    };
    let mut chosen: Vec<Link> = (0..points.len())
        .map(|i| nearest(&index, &groups.labels, i, limit(reach * reach)))
        .filter(is_link)
        .collect();
    let mut bridges = chosen.clone();
    loop {
        chosen.iter().for_each(|link| groups.join(link));
        groups.refresh();
        if groups.is_one() {
            return bridges.iter().map(|l| [l.from.min(l.to), l.from.max(l.to)]).collect();
        }
        // One round of Borůvka: each group's own shortest link. Asking with the group's best so
        // far as the limit lets most vertices stop at the root.
        index.relabel(&groups.labels);
        let mut best = vec![limit(f64::INFINITY); groups.n_labels()];
        for i in 0..points.len() {
            let label = groups.labels[i] as usize;
            best[label] = nearest(&index, &groups.labels, i, best[label]);
        }
        chosen = best.into_iter().filter(is_link).collect();
        bridges.extend(&chosen);
    }
}

/// Union of labelled groups.
struct Groups {
    /// Label of each vertex, as of the last refresh.
    labels: Vec<u32>,
    parent: Vec<u32>,
}

impl Groups {
    fn new(labels: Vec<u32>) -> Self {
        let n_labels = labels.iter().max().map_or(0, |&label| label + 1);
        Self { labels, parent: (0..n_labels).collect() }
    }

    fn n_labels(&self) -> usize {
        self.parent.len()
    }

    fn join(&mut self, link: &Link) {
        let [a, b] = [link.from, link.to].map(|i| find(&mut self.parent, self.labels[i as usize]));
        // The smaller label stays, whatever the order of the links.
        self.parent[a.max(b) as usize] = a.min(b);
    }

    fn refresh(&mut self) {
        for label in &mut self.labels {
            *label = find(&mut self.parent, *label);
        }
    }

    fn is_one(&self) -> bool {
        self.labels.iter().all(|&label| label == 0)
    }
}

/// Root of `i`, halving the path to it.
fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Labels of the connected pieces of a stiffness matrix (n), numbered by their first vertex, and
/// how many there are.
pub(crate) fn components(n: usize, stiffness: &SparseColMat<usize, f64>) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for t in stiffness.triplet_iter().filter(|t| t.row < t.col && *t.val != 0.0) {
        let [a, b] = [t.row, t.col].map(|i| find(&mut parent, i as u32));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut labels = vec![0; n];
    let mut count = 0;
    for i in 0..n {
        let root = find(&mut parent, i as u32) as usize;
        if root == i {
            labels[i] = count;
            count += 1;
        } else {
            labels[i] = labels[root];
        }
    }
    (labels, count as usize)
}

/// Median length of the triangles' edges, counted once per triangle.
fn median_edge(mesh: &Mesh) -> f64 {
    let mut lengths: Vec<f64> = (0..mesh.n_faces())
        .flat_map(|face| {
            let [a, b, c] = mesh.corners(face);
            [a.distance(b), b.distance(c), c.distance(a)]
        })
        .collect();
    let middle = lengths.len() / 2;
    *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laplacian::{LaplacianKind, laplacian};
    use crate::math::DVec3;
    use crate::zoo;

    #[test]
    fn afterwards_every_animal_is_in_one_piece() {
        for (name, mesh) in zoo::all() {
            let before = laplacian(&mesh, LaplacianKind::Tufted).unwrap();
            let bridged = bridge(&before, &mesh, &BridgeSettings::default()).unwrap();
            let n = mesh.n_vertices();
            assert_eq!(components(n, &bridged.laplacian.stiffness).1, 1, "{name}");
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
