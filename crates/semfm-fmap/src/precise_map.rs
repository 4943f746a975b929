//! One point of the source's surface for each target vertex.

use faer::{Mat, MatRef};
use semfm_geom::math::DVec3;
use semfm_geom::{Eigenbasis, Mesh, Shape};

use crate::closest_triangle::EmbeddedTriangles;
use crate::functional_map::check_size;
use crate::{Error, FunctionalMap, PointMap, Result};

/// How far from 1 barycentric coordinates may sum up, and how far below 0 one may lie.
const TOLERANCE: f64 = 1e-6;
/// What is counted where barycentric coordinates are.
const COORDINATES: &str = "barycentric coordinates (target vertices)";

/// A map target → source that sends each vertex to a point on a triangle.
///
/// Ezuz & Ben-Chen, "Deblurring and Denoising of Maps between Shapes", 2017: the vertex's row of the target's basis is
/// projected onto the source's triangles, embedded by the rows of Φ_source Cᵀ. As a matrix (n_target × n_source) the map
/// holds three numbers a row; functions go source → target by its product.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PreciseMap {
    /// Source triangle of each target vertex (n_target).
    face_of: Vec<u32>,
    /// The vertices of that triangle (n_target × 3).
    corners: Vec<[u32; 3]>,
    /// Barycentric coordinates on them (n_target × 3): at least 0, sum 1.
    barycentric: Vec<[f64; 3]>,
    n_source: usize,
}

/// A sparse matrix by rows: row i has `values[k]` in column `columns[k]` for k from `starts[i]` to `starts[i + 1]`.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseRows {
    /// Where each row starts, and the end (rows + 1).
    pub starts: Vec<u32>,
    /// Column of each entry, ascending within a row.
    pub columns: Vec<u32>,
    /// The entries.
    pub values: Vec<f64>,
}

impl PreciseMap {
    /// A map onto points of a source with these triangles.
    ///
    /// # Errors
    /// [`Error::Length`] where counts differ; [`Error::OutOfRange`] for a triangle that the source does not have, and for
    /// coordinates that are negative, not finite or do not sum to 1 within 1e-6.
    pub fn new(
        face_of: Vec<u32>,
        barycentric: Vec<[f64; 3]>,
        source_faces: &[[u32; 3]],
        n_source: usize,
    ) -> Result<Self> {
        Error::length(COORDINATES, face_of.len(), barycentric.len())?;
        if let Some(j) = face_of.iter().position(|&f| f as usize >= source_faces.len()) {
            let found = format!("{} for target vertex {j}", face_of[j]);
            let expected = format!("source triangles below {}", source_faces.len());
            return Error::out_of_range("precise map", expected, found);
        }
        let corners = face_of.iter().map(|&f| source_faces[f as usize]).collect();
        Self::from_corners(face_of, corners, barycentric, n_source)
    }

    /// A map onto points of triangles of which the corners are known (n_target × 3 each).
    ///
    /// # Errors
    /// As [`Self::new`], for corners instead of triangles.
    pub fn from_corners(
        face_of: Vec<u32>,
        corners: Vec<[u32; 3]>,
        barycentric: Vec<[f64; 3]>,
        n_source: usize,
    ) -> Result<Self> {
        Error::length("corners of triangles (target vertices)", face_of.len(), corners.len())?;
        Error::length(COORDINATES, face_of.len(), barycentric.len())?;
        let is_vertex = |&v: &u32| (v as usize) < n_source;
        if let Some(j) = corners.iter().position(|ids| !ids.iter().all(is_vertex)) {
            let found = format!("{:?} for target vertex {j}", corners[j]);
            let expected = format!("source vertices below {n_source}");
            return Error::out_of_range("corners of a precise map", expected, found);
        }
        let is_good = |w: &[f64; 3]| {
            w.iter().all(|&x| x >= -TOLERANCE) && (w.iter().sum::<f64>() - 1.0).abs() <= TOLERANCE
        };
        if let Some(j) = barycentric.iter().position(|w| !is_good(w)) {
            let found = format!("{:?} for target vertex {j}", barycentric[j]);
            let expected = "barycentric coordinates of at least 0 that sum to 1";
            return Error::out_of_range("precise map", expected, found);
        }
        Ok(Self { face_of, corners, barycentric, n_source })
    }

    /// Number of target vertices.
    pub fn n_target(&self) -> usize {
        self.face_of.len()
    }

    /// Number of source vertices.
    pub fn n_source(&self) -> usize {
        self.n_source
    }

    /// Source triangle of each target vertex (n_target).
    pub fn face_of(&self) -> &[u32] {
        &self.face_of
    }

    /// The source vertices of each target vertex's triangle (n_target × 3).
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// Barycentric coordinates on those vertices (n_target × 3).
    pub fn barycentric(&self) -> &[[f64; 3]] {
        &self.barycentric
    }

    /// A function (n_source) that is linear on the source's triangles, as the target's vertices (n_target) find it.
    pub fn pull_back(&self, function: &[f64]) -> Vec<f64> {
        let points = self.corners.iter().zip(&self.barycentric);
        points.map(|(ids, weights)| at(ids, weights, function)).collect()
    }

    /// The points themselves, on a source with these vertices (n_source).
    pub fn points(&self, vertices: &[DVec3]) -> Vec<DVec3> {
        let points = self.corners.iter().zip(&self.barycentric);
        points.map(|(ids, w)| (0..3).map(|c| w[c] * vertices[ids[c] as usize]).sum()).collect()
    }

    /// Rows of the first `k` source eigenfunctions at those points (n_target × k).
    pub(crate) fn pull_back_basis(&self, source: MatRef<'_, f64>) -> Mat<f64> {
        Mat::from_fn(self.n_target(), source.ncols(), |j, c| {
            let (ids, weights) = (self.corners[j], self.barycentric[j]);
            (0..3).map(|i| weights[i] * source[(ids[i] as usize, c)]).sum()
        })
    }

    /// The map of vertices that takes the corner of largest weight, the first of equal ones.
    pub fn to_point_map(&self) -> PointMap {
        let nearest = |(ids, w): (&[u32; 3], &[f64; 3])| {
            ids[(1..3).fold(0, |best, c| if w[c] > w[best] { c } else { best })]
        };
        PointMap { source_of: self.corners.iter().zip(&self.barycentric).map(nearest).collect() }
    }

    /// The map as a matrix (n_target × n_source) of at most three entries a row.
    pub fn to_sparse(&self) -> SparseRows {
        let mut out = SparseRows { starts: vec![0], columns: Vec::new(), values: Vec::new() };
        for (ids, weights) in self.corners.iter().zip(&self.barycentric) {
            let mut entries = [0, 1, 2].map(|c| (ids[c], weights[c]));
            entries.sort_unstable_by_key(|entry| entry.0);
            for (column, value) in entries.into_iter().filter(|entry| entry.1 != 0.0) {
                out.columns.push(column);
                out.values.push(value);
            }
            out.starts.push(out.columns.len() as u32);
        }
        out
    }

    /// The same map between the original meshes, from one between the working meshes. A working mesh that was simplified
    /// has triangles of its own, so that triangles are named by their corners alone and [`Self::face_of`] stays theirs.
    pub fn onto_originals(&self, source: &Shape, target: &Shape) -> Self {
        let (n_source, source) = (source.original().n_vertices(), source.working());
        let of_original = &target.working().of_original;
        let pick = |j: &u32| *j as usize;
        Self {
            face_of: of_original.iter().map(|j| self.face_of[pick(j)]).collect(),
            corners: of_original
                .iter()
                .map(|j| self.corners[pick(j)].map(|i| source.to_original[i as usize]))
                .collect(),
            barycentric: of_original.iter().map(|j| self.barycentric[pick(j)]).collect(),
            n_source,
        }
    }
}

/// A linear function at a point of a triangle.
fn at(ids: &[u32; 3], weights: &[f64; 3], function: &[f64]) -> f64 {
    (0..3).map(|c| weights[c] * function[ids[c] as usize]).sum()
}

impl FunctionalMap {
    /// The precise map target → source: each target vertex takes the point nearest to its row of Φ_target on the
    /// source's triangles, whose corners stand at the rows of Φ_source Cᵀ. Exact: no triangle is left out that could
    /// hold a nearer point; of equally near ones the first is taken.
    ///
    /// `source_mesh` holds the triangles on the vertices of the source's basis.
    ///
    /// # Errors
    /// [`Error::BasisTooSmall`] for a map larger than a basis, [`Error::Length`] for a mesh of another number of
    /// vertices, [`Error::OutOfRange`] for a mesh without triangles and for numbers that are not finite.
    pub fn precise_map(
        &self,
        source: &Eigenbasis,
        source_mesh: &Mesh,
        target: &Eigenbasis,
    ) -> Result<PreciseMap> {
        let k = self.k_source().max(self.k_target());
        check_size("the precise map", k, source, target)?;
        let n_source = source.n_vertices();
        Error::length("vertices of the source's mesh", n_source, source_mesh.n_vertices())?;
        let mapped = self.mapped_deltas(source.first(self.k_source()));
        let triangles = EmbeddedTriangles::new(mapped.as_ref(), source_mesh.faces())?;
        let found = triangles.closest_to(target.first(self.k_target()))?;
        let face_of = found.iter().map(|point| point.face).collect();
        let barycentric = found.iter().map(|point| point.barycentric).collect();
        PreciseMap::new(face_of, barycentric, source_mesh.faces(), n_source)
    }

    /// C f = B f in the two bases, B the matrix of a precise map: Φ_targetᵀ M_target B Φ_source, of size `k` × `k`.
    ///
    /// # Errors
    /// As [`Self::from_point_map`].
    pub fn from_precise_map(
        map: &PreciseMap,
        source: &Eigenbasis,
        target: &Eigenbasis,
        k: usize,
    ) -> Result<Self> {
        Error::length("precise map (target vertices)", target.n_vertices(), map.n_target())?;
        Error::length("precise map (source vertices)", source.n_vertices(), map.n_source())?;
        check_size("the functional map", k, source, target)?;
        Ok(Self::projected(map.pull_back_basis(source.first(k)), target.first(k), &target.mass))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_objects::{blob, shape};

    fn faces() -> Vec<[u32; 3]> {
        vec![[0, 1, 2], [3, 2, 1]]
    }

    #[test]
    fn functions_are_interpolated_and_the_matrix_does_the_same() {
        let weights = vec![[0.5, 0.25, 0.25], [0.0, 1.0, 0.0], [0.2, 0.0, 0.8]];
        let map = PreciseMap::new(vec![0, 1, 1], weights, &faces(), 4).unwrap();
        let function = [1.0, 3.0, 5.0, 10.0];
        assert_eq!(map.pull_back(&function), [2.5, 5.0, 4.4]);
        assert_eq!(map.to_point_map().source_of, [0, 2, 1]);
        let sparse = map.to_sparse();
        assert_eq!(sparse.starts, [0, 3, 4, 6]);
        assert_eq!(sparse.columns, [0, 1, 2, 2, 1, 3]);
        let row = |i: usize| sparse.starts[i] as usize..sparse.starts[i + 1] as usize;
        let product = |i| row(i).map(|e| sparse.values[e] * function[sparse.columns[e] as usize]);
        let products: Vec<f64> = (0..3).map(|i| product(i).sum()).collect();
        assert_eq!(products, map.pull_back(&function));
        let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE];
        assert_eq!(map.points(&vertices)[0], DVec3::new(0.25, 0.25, 0.0));
    }

    #[test]
    fn what_is_no_point_of_a_triangle_is_refused() {
        let new = |face: u32, w: [f64; 3]| {
            PreciseMap::new(vec![0, face], vec![[1.0, 0.0, 0.0], w], &faces(), 4)
        };
        for (face, w) in
            [(2, [1.0, 0.0, 0.0]), (1, [0.5, 0.6, -0.1]), (1, [0.5, 0.4, 0.0]), (1, [f64::NAN; 3])]
        {
            let error = new(face, w).unwrap_err().to_string();
            assert!(error.contains("target vertex 1"), "{error}");
        }
        assert!(PreciseMap::new(vec![0], vec![], &faces(), 4).is_err());
        assert!(PreciseMap::new(vec![1], vec![[1.0, 0.0, 0.0]], &faces(), 3).is_err());
    }

    #[test]
    fn a_shape_is_sent_onto_itself() {
        let shape = shape(&blob(1.0), 30);
        let identity = FunctionalMap::new(Mat::identity(30, 30));
        let basis = shape.basis();
        let map = identity.precise_map(basis, shape.mesh(), basis).unwrap();
        let points = map.points(shape.mesh().vertices());
        for (found, vertex) in points.iter().zip(shape.mesh().vertices()) {
            assert!(found.distance(*vertex) < 1e-9, "{found} for {vertex}");
        }
        let back = FunctionalMap::from_precise_map(&map, basis, basis, 30).unwrap();
        // A shape keeps its eigenfunctions in single precision.
        assert!((back.matrix() - identity.matrix()).norm_l2() < 1e-5);
        let small = crate::test_objects::shape(&blob(1.0), 10);
        let error = identity.precise_map(small.basis(), small.mesh(), small.basis()).unwrap_err();
        assert!(matches!(error, Error::BasisTooSmall { .. }), "{error}");
    }
}
