//! The triangle mesh, and the hash that names it.

use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

use serde::de::{Error as _, Unexpected};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::math::{DVec3, bounds};
use crate::{Error, Result};

/// A triangle mesh: `vertices` (n) in the file's own frame and units, `faces` (m) triples of
/// vertex ids, counter-clockwise seen from outside where the file keeps that convention.
///
/// A value of this type is proof that there is at least one vertex and one triangle, that every
/// coordinate is finite and every id in range. Nothing else is promised: components, holes,
/// non-manifold edges, duplicate vertices and degenerate triangles are all allowed.
///
/// ```
/// use semfm_geom::{Mesh, math::DVec3};
/// let triangle = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
/// assert_eq!(triangle.area(), 0.5);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Mesh {
    vertices: Vec<DVec3>,
    faces: Vec<[u32; 3]>,
    /// Computed when first asked for.
    hash: OnceLock<MeshHash>,
}

impl PartialEq for Mesh {
    fn eq(&self, other: &Self) -> bool {
        self.vertices == other.vertices && self.faces == other.faces
    }
}

impl Mesh {
    /// Largest coordinate of a vertex, in any unit: lengths squared, areas squared and volumes of such numbers are
    /// still finite, in single precision the lengths themselves are.
    pub const MAX_COORDINATE: f64 = 1e30;

    /// Checks and keeps the arrays as they are: no vertex is moved, merged or dropped.
    ///
    /// # Errors
    /// [`Error::EmptyMesh`], [`Error::NotFinite`], [`Error::TooFar`] beyond [`Mesh::MAX_COORDINATE`], or
    /// [`Error::VertexOutOfRange`], naming the item.
    pub fn new(vertices: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Result<Self> {
        if vertices.is_empty() || faces.is_empty() {
            return Err(Error::EmptyMesh { n_vertices: vertices.len(), n_faces: faces.len() });
        }
        Error::check_points(&vertices)?;
        let n_vertices = vertices.len();
        for (face, ids) in faces.iter().enumerate() {
            if let Some(&id) = ids.iter().find(|&&id| id as usize >= n_vertices) {
                return Err(Error::VertexOutOfRange { face, vertex: id.into(), n_vertices });
            }
        }
        Ok(Self { vertices, faces, hash: OnceLock::new() })
    }

    /// Vertex positions (n).
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// Triangles (m) as vertex ids.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Number of vertices n.
    pub fn n_vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Number of triangles m.
    pub fn n_faces(&self) -> usize {
        self.faces.len()
    }

    /// The three corners of triangle `face`.
    pub fn corners(&self, face: usize) -> [DVec3; 3] {
        self.faces[face].map(|id| self.vertices[id as usize])
    }

    /// Normal of triangle `face` whose length is twice its area; zero for a degenerate triangle.
    pub fn face_normal_scaled(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a)
    }

    /// Area of triangle `face`.
    pub fn face_area(&self, face: usize) -> f64 {
        self.face_normal_scaled(face).length() / 2.0
    }

    /// Total surface area.
    pub fn area(&self) -> f64 {
        (0..self.n_faces()).map(|face| self.face_area(face)).sum()
    }

    /// A third of the area of the triangles around each vertex (n).
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.n_vertices()];
        for (face, ids) in self.faces.iter().enumerate() {
            let third = self.face_area(face) / 3.0;
            for &id in ids {
                areas[id as usize] += third;
            }
        }
        areas
    }

    /// Lower and upper corner of the axis-aligned bounding box.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        bounds(&self.vertices).expect("a mesh has at least one vertex")
    }

    /// Length of the bounding box's diagonal.
    pub fn diagonal(&self) -> f64 {
        let (low, high) = self.bounds();
        low.distance(high)
    }

    /// Median length of the triangles' edges, counted once per triangle; 0 without triangles.
    pub(crate) fn median_edge(&self) -> f64 {
        let sides = (0..self.n_faces()).map(|face| self.corners(face));
        let mut lengths: Vec<f64> =
            sides.flat_map(|[a, b, c]| [a.distance(b), b.distance(c), c.distance(a)]).collect();
        let middle = lengths.len() / 2;
        if lengths.is_empty() {
            return 0.0;
        }
        *lengths.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Centre of the bounding box and the distance from it to the farthest vertex.
    pub fn bounding_sphere(&self) -> (DVec3, f64) {
        let (low, high) = self.bounds();
        let centre = (low + high) / 2.0;
        let radius = self.vertices.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        (centre, radius)
    }

    /// BLAKE3 over counts, positions and triangles (see [`MeshHash`]), computed once and kept.
    pub fn hash(&self) -> MeshHash {
        *self.hash.get_or_init(|| hash_of(&self.vertices, &self.faces))
    }
}

fn hash_of(vertices: &[DVec3], faces: &[[u32; 3]]) -> MeshHash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"semfm.mesh/1\n");
    hasher.update(&(vertices.len() as u64).to_le_bytes());
    hasher.update(&(faces.len() as u64).to_le_bytes());
    let mut bytes = Vec::with_capacity(24 * 4096);
    for block in vertices.chunks(4096) {
        bytes.clear();
        // −0 + 0 is +0; every other number stays as it is.
        let coordinates = block.iter().flat_map(|p| p.to_array()).map(|x| x + 0.0);
        bytes.extend(coordinates.flat_map(f64::to_le_bytes));
        hasher.update(&bytes);
    }
    for block in faces.chunks(4096) {
        bytes.clear();
        bytes.extend(block.iter().flatten().flat_map(|id| id.to_le_bytes()));
        hasher.update(&bytes);
    }
    MeshHash(*hasher.finalize().as_bytes())
}

/// BLAKE3 of a mesh as read, before any cleaning: the bytes `semfm.mesh/1\n`, u64 vertex count,
/// u64 triangle count, positions as f64, triangles as u32, all little-endian. A coordinate −0 counts
/// as 0: the two are one place, and formats that leave out zeros (protobuf) do not keep the sign.
///
/// Written `blake3:` and 64 hexadecimal digits. A mesh given as arrays has the hash of its file.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeshHash(pub [u8; 32]);

impl MeshHash {
    /// The form of its text, for messages.
    pub const FORM: &str = "`blake3:` and 64 hexadecimal digits";

    /// Reads the form that [`Display`](fmt::Display) writes; `None` where the text is not one.
    pub fn parse(text: &str) -> Option<Self> {
        blake3::Hash::from_hex(text.strip_prefix("blake3:")?)
            .ok()
            .map(|hash| Self(*hash.as_bytes()))
    }
}

impl FromStr for MeshHash {
    type Err = Error;

    /// # Errors
    /// [`Error::OutOfRange`] for text of another form.
    fn from_str(text: &str) -> Result<Self> {
        Self::parse(text).ok_or_else(|| {
            let found = format!("`{text}`");
            Error::OutOfRange { what: "mesh hash", expected: Self::FORM.into(), found }
        })
    }
}

impl Serialize for MeshHash {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for MeshHash {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        Self::parse(&text)
            .ok_or_else(|| D::Error::invalid_value(Unexpected::Str(&text), &Self::FORM))
    }
}

impl fmt::Display for MeshHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "blake3:{}", blake3::Hash::from_bytes(self.0).to_hex())
    }
}

impl fmt::Debug for MeshHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Mesh {
        Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn the_hash_is_of_the_documented_bytes() {
        let mut bytes = b"semfm.mesh/1\n".to_vec();
        bytes.extend(3u64.to_le_bytes());
        bytes.extend(1u64.to_le_bytes());
        for x in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f64] {
            bytes.extend(x.to_le_bytes());
        }
        for id in [0u32, 1, 2] {
            bytes.extend(id.to_le_bytes());
        }
        let hash = triangle().hash();
        assert_eq!(hash.0, *blake3::hash(&bytes).as_bytes());
        assert_eq!(MeshHash::parse(&hash.to_string()), Some(hash));
    }

    #[test]
    fn a_zero_is_a_zero_whatever_its_sign() {
        let signed = vec![DVec3::new(-0.0, 0.0, -0.0), DVec3::X, DVec3::Y];
        let signed = Mesh::new(signed, vec![[0, 1, 2]]).unwrap();
        assert!(signed.vertices()[0].x.is_sign_negative());
        assert_eq!(signed.hash(), triangle().hash());
    }

    #[test]
    fn the_door_refuses_what_is_not_a_mesh() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(matches!(
            Mesh::new(points.clone(), vec![]),
            Err(Error::EmptyMesh { n_faces: 0, .. })
        ));
        assert!(matches!(
            Mesh::new(points, vec![[0, 1, 3]]),
            Err(Error::VertexOutOfRange { face: 0, vertex: 3, n_vertices: 3 })
        ));
        let mut points = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        points[1].y = f64::NAN;
        assert!(matches!(
            Mesh::new(points.clone(), vec![[0, 1, 2]]),
            Err(Error::NotFinite { vertex: 1, .. })
        ));
        points[1].y = -1e300;
        assert!(matches!(Mesh::new(points, vec![[0, 1, 2]]), Err(Error::TooFar { vertex: 1, .. })));
    }

    #[test]
    fn areas_of_vertices_add_up_to_the_area() {
        let mesh = triangle();
        assert!((mesh.vertex_areas().iter().sum::<f64>() - mesh.area()).abs() < 1e-15);
    }
}
