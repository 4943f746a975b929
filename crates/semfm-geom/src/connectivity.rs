//! Edges, components, boundaries: how the triangles of a mesh hang together.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::Mesh;
use crate::math::DVec3;

/// What is regular and what is not about the connectivity of a mesh.
///
/// An edge is a pair of vertices that a triangle with three different vertices joins. Counts are of the mesh as it
/// stands: vertices at the same place are different vertices until somebody merges them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Vertices.
    pub n_vertices: usize,
    /// Triangles.
    pub n_triangles: usize,
    /// Edges.
    pub n_edges: usize,
    /// Parts that share no vertex, isolated vertices not counted.
    pub components: usize,
    /// Edges of exactly one triangle.
    pub boundary_edges: usize,
    /// Edges of three triangles or more.
    pub non_manifold_edges: usize,
    /// Vertices whose triangles form more than one fan, or that end a non-manifold edge.
    pub non_manifold_vertices: usize,
    /// Triangles that name a vertex twice or have no area.
    pub degenerate_faces: usize,
    /// Triangles that name the same three vertices as one before them.
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
    /// Looks at a mesh.
    pub fn new(mesh: &Mesh) -> Self {
        let half_edges = HalfEdges::new(mesh);
        let mut used = vec![false; mesh.n_vertices()];
        mesh.faces().iter().flatten().for_each(|&id| used[id as usize] = true);
        let isolated_vertices = used.iter().filter(|&&used| !used).count();
        let (mut n_edges, mut boundary_edges, mut non_manifold_edges) = (0, 0, 0);
        let mut oriented = true;
        for edge in half_edges.by_edge() {
            n_edges += 1;
            boundary_edges += usize::from(edge.len() == 1);
            non_manifold_edges += usize::from(edge.len() > 2);
            let forward = edge.iter().filter(|half| half.is_forward(mesh)).count();
            oriented &= edge.len() == 1 || (edge.len() == 2 && forward == 1);
        }
        Self {
            n_vertices: mesh.n_vertices(),
            n_triangles: mesh.n_faces(),
            n_edges,
            components: components(mesh).count - isolated_vertices,
            boundary_edges,
            non_manifold_edges,
            non_manifold_vertices: non_manifold_vertices(mesh, &half_edges),
            degenerate_faces: (0..mesh.n_faces()).filter(|&face| is_degenerate(mesh, face)).count(),
            duplicate_faces: duplicate_faces(mesh),
            isolated_vertices,
            duplicate_positions: duplicate_positions(mesh),
            edge_manifold: non_manifold_edges == 0,
            watertight: non_manifold_edges == 0 && boundary_edges == 0 && n_edges > 0,
            oriented,
        }
    }
}

/// The edges of a mesh, each once, lower id first, sorted.
pub fn edges(mesh: &Mesh) -> Vec<[u32; 2]> {
    HalfEdges::new(mesh).by_edge().map(|edge| edge[0].ends()).collect()
}

/// Which part of the mesh each vertex belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// For each vertex (n), the number of its part, from 0 in the order of their lowest vertices.
    pub of_vertex: Vec<u32>,
    /// Number of parts; a vertex without triangles is one of its own.
    pub count: usize,
}

/// Parts of the mesh that no triangle joins.
pub fn components(mesh: &Mesh) -> Components {
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

/// The neighbours of every vertex along edges.
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

/// One triangle's side of an edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    /// Lower id in the upper half, so that sorting groups the sides of an edge.
    edge: u64,
    /// 3 × triangle + corner at which the side starts.
    corner: u32,
}

impl HalfEdge {
    fn ends(self) -> [u32; 2] {
        [(self.edge >> 32) as u32, self.edge as u32]
    }

    /// The two corners of its triangle that it joins, that of the lower id first.
    fn corners(self, mesh: &Mesh) -> [u32; 2] {
        let next = self.corner - self.corner % 3 + (self.corner + 1) % 3;
        if self.is_forward(mesh) { [self.corner, next] } else { [next, self.corner] }
    }

    fn is_forward(self, mesh: &Mesh) -> bool {
        mesh.faces().as_flattened()[self.corner as usize] == self.ends()[0]
    }
}

/// All sides of all edges, grouped by edge.
struct HalfEdges(Vec<HalfEdge>);

impl HalfEdges {
    fn new(mesh: &Mesh) -> Self {
        let mut sides = Vec::with_capacity(3 * mesh.n_faces());
        for (face, ids) in mesh.faces().iter().enumerate() {
            if names_twice(ids) {
                continue;
            }
            for side in 0..3 {
                let (a, b) = (ids[side], ids[(side + 1) % 3]);
                let edge = u64::from(a.min(b)) << 32 | u64::from(a.max(b));
                sides.push(HalfEdge { edge, corner: (3 * face + side) as u32 });
            }
        }
        sides.sort_unstable();
        Self(sides)
    }

    fn by_edge(&self) -> impl Iterator<Item = &[HalfEdge]> {
        self.0.chunk_by(|a, b| a.edge == b.edge)
    }
}

/// Joins triangle corners across the edges at their vertex: what stays apart are different fans.
fn non_manifold_vertices(mesh: &Mesh, half_edges: &HalfEdges) -> usize {
    let mut fans = DisjointSets::new(3 * mesh.n_faces());
    let mut bad = vec![false; mesh.n_vertices()];
    for edge in half_edges.by_edge() {
        let first = edge[0].corners(mesh);
        for half in &edge[1..] {
            let corners = half.corners(mesh);
            fans.join(first[0], corners[0]);
            fans.join(first[1], corners[1]);
        }
        if edge.len() > 2 {
            edge[0].ends().iter().for_each(|&id| bad[id as usize] = true);
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
    let sorted = |mut ids: [u32; 3]| {
        ids.sort_unstable();
        ids
    };
    let mut faces: Vec<_> = mesh.faces().iter().map(|&ids| sorted(ids)).collect();
    faces.sort_unstable();
    faces.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

fn duplicate_positions(mesh: &Mesh) -> usize {
    // Adding zero turns −0 into 0, which is the same place.
    let mut places: Vec<_> =
        mesh.vertices().iter().map(|p| p.to_array().map(|x| (x + 0.0).to_bits())).collect();
    places.sort_unstable();
    places.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

/// Union–find with path halving (R. E. Tarjan, 1975); the lowest member is the root.
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut id: u32) -> u32 {
        while self.0[id as usize] != id {
            let grandparent = self.0[self.0[id as usize] as usize];
            self.0[id as usize] = grandparent;
            id = grandparent;
        }
        id
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(n_vertices: usize, faces: &[[u32; 3]]) -> Mesh {
        let place = |i: usize| DVec3::new(i as f64, (i * i) as f64, (i % 3) as f64);
        Mesh::new((0..n_vertices).map(place).collect(), faces.to_vec()).unwrap()
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
    fn neighbours_come_in_ascending_order() {
        let adjacency = VertexAdjacency::new(&mesh(5, &[[0, 2, 1], [1, 2, 3]]));
        assert_eq!(adjacency.of(2), [0, 1, 3]);
        assert_eq!(adjacency.of(1), [0, 2, 3]);
        assert!(adjacency.of(4).is_empty());
    }
}
