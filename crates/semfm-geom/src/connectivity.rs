//! Edges, components, boundaries: how the triangles of a mesh hang together.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::disjoint_sets::DisjointSets;
use crate::math::DVec3;
use crate::{Mesh, Welded};

/// What is regular and what is not about the connectivity of a mesh.
///
/// Vertices, triangles and isolated vertices are those of the file. Edges, components, boundaries and what follows from
/// them are those of the surface: vertices at the same place count as one ([`Welded`]), so that a UV seam or flat
/// shading is no boundary. An edge is a pair of places that a triangle with three different ones joins.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Vertices.
    pub n_vertices: usize,
    /// Triangles.
    pub n_triangles: usize,
    /// Edges.
    pub n_edges: usize,
    /// Parts that share no place, isolated vertices not counted.
    pub components: usize,
    /// Edges of exactly one triangle.
    pub boundary_edges: usize,
    /// Edges of three triangles or more.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles form more than one fan, or that end a non-manifold edge.
    pub non_manifold_vertices: usize,
    /// Triangles that name a vertex twice or have no area.
    pub degenerate_faces: usize,
    /// Triangles on the same three places as one before them.
    pub duplicate_faces: usize,
    /// Vertices of no triangle.
    pub isolated_vertices: usize,
    /// Vertices at the same place as one before them.
    pub duplicate_positions: usize,
    /// No edge has more than two triangles.
    pub edge_manifold: bool,
    /// Every edge has exactly two triangles.
    pub watertight: bool,
    /// The two triangles of every edge run through it in opposite directions.
    pub oriented: bool,
}

impl MeshReport {
    /// Looks at the surface of a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let Welded { mesh: welded, to_original, .. } = Welded::new(mesh);
        let duplicate_positions = mesh.n_vertices() - to_original.len();
        Self {
            n_vertices: mesh.n_vertices(),
            isolated_vertices: isolated_vertices(mesh),
            duplicate_positions,
            ..Self::as_stored(&welded)
        }
    }

    /// Looks at a mesh as it is stored: vertices at the same place are different ones, and every seam is a boundary.
    pub fn as_stored(mesh: &Mesh) -> Self {
        let sides = Sides::new(mesh);
        let isolated_vertices = isolated_vertices(mesh);
        let (mut n_edges, mut boundary_edges, mut non_manifold_edges) = (0, 0, 0);
        let mut oriented = true;
        for edge in sides.by_edge() {
            n_edges += 1;
            boundary_edges += usize::from(edge.len() == 1);
            non_manifold_edges += usize::from(edge.len() > 2);
            let forward = edge.iter().filter(|&&side| sides.is_forward(side)).count();
            oriented &= edge.len() == 1 || (edge.len() == 2 && forward == 1);
        }
        Self {
            n_vertices: mesh.n_vertices(),
            n_triangles: mesh.n_faces(),
            n_edges,
            components: parts(mesh).count - isolated_vertices,
            boundary_edges,
            non_manifold_edges,
            non_manifold_vertices: non_manifold_vertices(mesh, &sides),
            degenerate_faces: (0..mesh.n_faces()).filter(|&face| is_degenerate(mesh, face)).count(),
            duplicate_faces: duplicate_faces(mesh),
            isolated_vertices,
            duplicate_positions: mesh.n_vertices() - Welded::new(mesh).to_original.len(),
            edge_manifold: non_manifold_edges == 0,
            watertight: non_manifold_edges == 0 && boundary_edges == 0 && n_edges > 0,
            oriented,
        }
    }
}

/// The edges of a mesh as it is stored, each once, lower id first, sorted. Those of its surface, seams closed, are the
/// edges of [`Welded::mesh`].
pub fn edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    let sides = Sides::new(mesh);
    sides.by_edge().map(|edge| sides.ends(edge[0])).collect()
}

/// Which part of the surface each vertex belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// For each vertex (n), the number of its part, from 0 in the order of their lowest vertices.
    pub of_vertex: Vec<u32>,
    /// Number of parts; a vertex without triangles is one of its own.
    pub count: usize,
}

/// Parts of the surface that no triangle joins; vertices at one place belong to one part ([`Welded`]).
pub fn components(mesh: &Mesh) -> Components {
    let Welded { mesh: welded, of_original, .. } = Welded::new(mesh);
    let Components { of_vertex, count } = parts(&welded);
    Components { of_vertex: of_original.iter().map(|&id| of_vertex[id as usize]).collect(), count }
}

/// Parts of the mesh as it is stored.
fn parts(mesh: &Mesh) -> Components {
    let mut sets = DisjointSets::new(mesh.n_vertices());
    for &[a, b, c] in mesh.faces() {
        sets.join(a, b);
        sets.join(b, c);
    }
    let mut number_of_root = HashMap::new();
    let of_vertex = (0..mesh.n_vertices() as u32)
        .map(|id| {
            let next = number_of_root.len() as u32;
            *number_of_root.entry(sets.root(id)).or_insert(next)
        })
        .collect();
    Components { of_vertex, count: number_of_root.len() }
}

/// The neighbours of every vertex along the edges of a mesh as it is stored, see [`edges`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VertexAdjacency {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl VertexAdjacency {
    /// Gathers the neighbours of all vertices.
    pub fn new(mesh: &Mesh) -> Self {
        let edges = edges(mesh);
        let mut starts = vec![0; mesh.n_vertices() + 1];
        for &id in edges.iter().flatten() {
            starts[id as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0; 2 * edges.len()];
        // Edges are sorted by lower end, then by upper: first come a vertex's lower neighbours, as
        // upper ends, in ascending order, then its upper ones.
        for [from, to] in edges.iter().map(|&[a, b]| [b, a]).chain(edges.iter().copied()) {
            neighbours[next[from as usize]] = to;
            next[from as usize] += 1;
        }
        Self { starts, neighbours }
    }

    /// Neighbours of a vertex, ascending.
    pub fn of(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

/// The sides of all triangles that name three different vertices, grouped by edge.
///
/// A side is named by the corner it starts at: 3 × triangle + corner. That takes 12 bytes a
/// triangle, where keeping each side's ends for the sorting would take 48.
struct Sides<'a> {
    corners: &'a [u32],
    sorted: Vec<u32>,
}

impl<'a> Sides<'a> {
    fn new(mesh: &'a Mesh) -> Self {
        let corners = mesh.faces().as_flattened();
        let faces = mesh.faces().iter().enumerate().filter(|(_, ids)| !names_twice(ids));
        let sorted =
            faces.flat_map(|(face, _)| (0..3).map(move |i| (3 * face + i) as u32)).collect();
        let mut sides = Self { corners, sorted };
        // By the upper end, then by the lower; the second pass keeps the order of the first.
        for end in [1, 0] {
            sides.sorted =
                counting_sort(&sides.sorted, mesh.n_vertices(), |side| sides.ends(side)[end]);
        }
        sides
    }

    /// Corner at which a side ends.
    fn end(side: u32) -> u32 {
        side - side % 3 + (side + 1) % 3
    }

    /// The two vertices of a side, lower id first.
    fn ends(&self, side: u32) -> [u32; 2] {
        let (a, b) = (self.corners[side as usize], self.corners[Self::end(side) as usize]);
        [a.min(b), a.max(b)]
    }

    /// The two corners of a side, that of the lower vertex first.
    fn corners_by_vertex(&self, side: u32) -> [u32; 2] {
        if self.is_forward(side) { [side, Self::end(side)] } else { [Self::end(side), side] }
    }

    /// Whether its triangle runs through the side from the lower vertex to the upper.
    fn is_forward(&self, side: u32) -> bool {
        self.corners[side as usize] < self.corners[Self::end(side) as usize]
    }

    fn by_edge(&self) -> impl Iterator<Item = &[u32]> {
        self.sorted.chunk_by(|&a, &b| self.ends(a) == self.ends(b))
    }
}

/// Items in the order of their keys, which are below `n_keys`; equal keys keep their order.
fn counting_sort(items: &[u32], n_keys: usize, key: impl Fn(u32) -> u32) -> Vec<u32> {
    let mut next = vec![0; n_keys + 1];
    items.iter().for_each(|&item| next[key(item) as usize + 1] += 1);
    for i in 1..next.len() {
        next[i] += next[i - 1];
    }
    let mut sorted = vec![0; items.len()];
    for &item in items {
        let slot: &mut usize = &mut next[key(item) as usize];
        sorted[*slot] = item;
        *slot += 1;
    }
    sorted
}

/// Joins triangle corners across the edges at their vertex: what stays apart are different fans.
fn non_manifold_vertices(mesh: &Mesh, sides: &Sides<'_>) -> usize {
    let mut fans = DisjointSets::new(3 * mesh.n_faces());
    let mut bad = vec![false; mesh.n_vertices()];
    for edge in sides.by_edge() {
        let first = sides.corners_by_vertex(edge[0]);
        for &side in &edge[1..] {
            let corners = sides.corners_by_vertex(side);
            fans.join(first[0], corners[0]);
            fans.join(first[1], corners[1]);
        }
        if edge.len() > 2 {
            sides.ends(edge[0]).iter().for_each(|&id| bad[id as usize] = true);
        }
    }
    let mut fan_of = vec![u32::MAX; mesh.n_vertices()];
    for (corner, &id) in mesh.faces().as_flattened().iter().enumerate() {
        if names_twice(&mesh.faces()[corner / 3]) {
            continue;
        }
        let fan = fans.root(corner as u32);
        let known = &mut fan_of[id as usize];
        bad[id as usize] |= *known != u32::MAX && *known != fan;
        *known = fan;
    }
    bad.iter().filter(|&&bad| bad).count()
}

fn is_degenerate(mesh: &Mesh, face: usize) -> bool {
    names_twice(&mesh.faces()[face]) || mesh.face_normal_scaled(face) == DVec3::ZERO
}

fn names_twice(&[a, b, c]: &[u32; 3]) -> bool {
    a == b || b == c || c == a
}

fn duplicate_faces(mesh: &Mesh) -> usize {
    let mut faces = mesh.faces().to_vec();
    faces.iter_mut().for_each(|ids| ids.sort_unstable());
    faces.sort_unstable();
    faces.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

fn isolated_vertices(mesh: &Mesh) -> usize {
    let mut used = vec![false; mesh.n_vertices()];
    mesh.faces().iter().flatten().for_each(|&id| used[id as usize] = true);
    used.iter().filter(|&&used| !used).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(n_vertices: usize, faces: &[[u32; 3]]) -> Mesh {
        let places = (0..n_vertices).map(|i| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64));
        Mesh::new(places.collect(), faces.to_vec()).unwrap()
    }

    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    #[test]
    fn a_tetrahedron_is_watertight() {
        let report = MeshReport::new(&mesh(4, &TETRAHEDRON));
        assert!(report.watertight && report.oriented && report.edge_manifold);
        assert_eq!((report.n_edges, report.components, report.non_manifold_vertices), (6, 1, 0));
    }

    #[test]
    fn a_bow_tie_is_non_manifold_at_its_knot_only() {
        let report = MeshReport::new(&mesh(5, &[[0, 1, 2], [0, 3, 4]]));
        assert_eq!((report.boundary_edges, report.non_manifold_edges), (6, 0));
        assert_eq!((report.non_manifold_vertices, report.components), (1, 1));
    }

    #[test]
    fn three_leaves_of_a_book_share_a_non_manifold_edge() {
        let report = MeshReport::new(&mesh(5, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]));
        assert_eq!((report.non_manifold_edges, report.non_manifold_vertices), (1, 2));
        assert!(!report.edge_manifold && !report.oriented);
    }

    #[test]
    fn blemishes_are_counted() {
        let mut vertices = mesh(7, &[[0, 1, 2]]).vertices().to_vec();
        vertices[5] = vertices[4];
        let faces = vec![[0, 1, 2], [2, 0, 1], [3, 3, 4], [3, 4, 5]];
        let report = MeshReport::new(&Mesh::new(vertices, faces).unwrap());
        assert_eq!((report.duplicate_faces, report.degenerate_faces), (1, 2));
        assert_eq!((report.isolated_vertices, report.duplicate_positions), (1, 1));
        assert_eq!(report.components, 2);
    }

    #[test]
    fn a_seam_is_no_boundary_and_flat_shading_no_crowd_of_parts() {
        let sphere = crate::zoo::icosphere(2);
        let soup = crate::zoo::as_soup(&sphere);
        let (whole, cut) = (MeshReport::new(&sphere), MeshReport::new(&soup));
        assert!(cut.watertight && cut.oriented);
        assert_eq!((cut.components, cut.n_edges), (1, whole.n_edges));
        assert_eq!((cut.n_vertices, cut.duplicate_positions), (960, 960 - 162));
        let stored = MeshReport::as_stored(&soup);
        assert_eq!((stored.components, stored.boundary_edges), (320, 960));
        assert_eq!(stored.duplicate_positions, cut.duplicate_positions);
        assert_eq!(components(&soup), Components { of_vertex: vec![0; 960], count: 1 });
    }

    #[test]
    fn neighbours_come_in_ascending_order() {
        let adjacency = VertexAdjacency::new(&mesh(5, &[[0, 2, 1], [1, 2, 3]]));
        assert_eq!(adjacency.of(2), [0, 1, 3]);
        assert_eq!(adjacency.of(1), [0, 2, 3]);
        assert!(adjacency.of(4).is_empty());
    }
}
