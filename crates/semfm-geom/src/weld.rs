//! The surface that a file's vertices describe: vertices at one place joined.
//!
//! Files double a vertex wherever its texture coordinate or its normal changes: along a UV seam, on every edge of a
//! flat-shaded mesh, at every corner of an STL file. Triangles on both sides of such a seam share no vertex id and are
//! still one surface. Distances along the surface, components and boundaries are asked of that surface.

use std::collections::{HashMap, HashSet};

use crate::Mesh;
use crate::math::DVec3;

/// A mesh with the vertices at one place joined, and where each vertex of the original went.
///
/// Places are the same where all coordinates are equal (−0 is 0). No vertex moves; joined vertices come in the order of
/// their first originals. All triangles stay, in their order, those too that the joining collapsed.
///
/// ```
/// use semfm_geom::{Mesh, Welded, connectivity::components, math::DVec3};
/// // Two triangles of a square, each with corners of its own.
/// let square = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Y, DVec3::X, DVec3::X + DVec3::Y];
/// let welded = Welded::new(&Mesh::new(square.to_vec(), vec![[0, 1, 2], [3, 4, 5]])?);
/// assert_eq!(welded.mesh.faces(), [[0, 1, 2], [2, 1, 3]]);
/// assert_eq!(welded.of_original, [0, 1, 2, 2, 1, 3]);
/// # Ok::<(), semfm_geom::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Welded {
    /// The joined mesh (n_welded vertices).
    pub mesh: Mesh,
    /// For each original vertex (n), its joined vertex.
    pub of_original: Vec<u32>,
    /// For each joined vertex (n_welded), the first original vertex at its place; ascending.
    pub to_original: Vec<u32>,
}

impl Welded {
    /// Joins the vertices at one place.
    pub fn new(mesh: &Mesh) -> Self {
        let first = first_at_place(mesh);
        let mut to_original = Vec::new();
        let mut of_original = Vec::with_capacity(first.len());
        for (id, &first) in (0u32..).zip(&first) {
            if first == id {
                of_original.push(to_original.len() as u32);
                to_original.push(id);
            } else {
                of_original.push(of_original[first as usize]);
            }
        }
        let vertices = to_original.iter().map(|&id| mesh.vertices()[id as usize]).collect();
        let faces = mesh.faces().iter().map(|ids| ids.map(|id| of_original[id as usize]));
        let mesh = Mesh::new(vertices, faces.collect()).expect("vertices and ids of a mesh");
        Self { mesh, of_original, to_original }
    }

    /// Whether any two vertices were joined.
    pub fn joined_any(&self) -> bool {
        self.to_original.len() < self.of_original.len()
    }
}

/// For each vertex the first one with exactly its coordinates (−0 is 0).
pub(crate) fn first_at_place(mesh: &Mesh) -> Vec<u32> {
    let mut first = HashMap::with_capacity(mesh.n_vertices());
    (0u32..)
        .zip(mesh.vertices())
        .map(|(id, &p)| *first.entry(place_bits(p)).or_insert(id))
        .collect()
}

/// The mesh without triangles whose three corners lie at the places of an earlier one's, in whatever order; `None` where
/// there are none. Vertices keep their numbers.
///
/// A pile of coincident triangles makes every search through it a search through all of them, though one says it all.
pub fn without_repeated_faces(mesh: &Mesh) -> Option<Mesh> {
    let repeated = repeated_faces(mesh)?;
    let faces = mesh.faces().iter().zip(repeated).filter(|(_, repeated)| !repeated);
    let faces = faces.map(|(&ids, _)| ids).collect();
    Some(Mesh::new(mesh.vertices().to_vec(), faces).expect("vertices and ids of a mesh"))
}

/// For each triangle, whether an earlier one has its three corners at the same places, in whatever order; `None` where
/// no triangle is repeated.
pub(crate) fn repeated_faces(mesh: &Mesh) -> Option<Vec<bool>> {
    let mut keys: Vec<(u64, u32)> =
        (0..mesh.n_faces()).map(|face| (face_key(&mesh.corners(face)), face as u32)).collect();
    keys.sort_unstable();
    let mut repeated = Vec::new();
    for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        let mut known = HashSet::new();
        for &(_, face) in group {
            let mut places = mesh.corners(face as usize).map(place_bits);
            places.sort_unstable();
            if !known.insert(places) {
                repeated.resize(mesh.n_faces(), false);
                repeated[face as usize] = true;
            }
        }
    }
    (!repeated.is_empty()).then_some(repeated)
}

/// The bits of a place's coordinates (−0 is 0).
fn place_bits(p: DVec3) -> [u64; 3] {
    p.to_array().map(|x| (x + 0.0).to_bits())
}

/// A number that triangles at the same places share, whatever the order of their corners.
fn face_key(corners: &[DVec3; 3]) -> u64 {
    let mix = |h: u64| (h ^ (h >> 32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let key = |p: DVec3| place_bits(p).into_iter().fold(0, |h, bits| mix(h ^ bits).rotate_left(23));
    corners.iter().map(|&p| mix(key(p))).fold(0, u64::wrapping_add)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    #[test]
    fn a_soup_becomes_the_mesh_it_was_cut_from() {
        for (name, mesh) in zoo::all() {
            let welded = Welded::new(&zoo::as_soup(&mesh));
            let again = Welded::new(&welded.mesh);
            assert!(!again.joined_any(), "{name}: places remain doubled");
            for (face, ids) in welded.mesh.faces().iter().enumerate() {
                let corners = ids.map(|id| welded.mesh.vertices()[id as usize]);
                assert_eq!(corners, mesh.corners(face), "{name}: triangle {face}");
            }
            assert!(welded.to_original.is_sorted(), "{name}");
            for (id, &original) in (0u32..).zip(&welded.to_original) {
                assert_eq!(welded.of_original[original as usize], id, "{name}");
            }
        }
    }

    #[test]
    fn repeated_triangles_are_found_whatever_their_vertices_and_order() {
        for (name, mesh) in zoo::all() {
            let twice = name == "duplicate_faces";
            assert_eq!(repeated_faces(&mesh).is_some(), twice, "{name}");
        }
        let mesh = zoo::icosphere(1);
        let n = mesh.n_faces();
        let faces = mesh.faces().iter().copied();
        let turned = mesh.faces().iter().map(|&[a, b, c]| [c, b, a]);
        let both = Mesh::new(mesh.vertices().to_vec(), faces.chain(turned).collect()).unwrap();
        let repeated = repeated_faces(&zoo::as_soup(&both)).unwrap();
        assert_eq!(repeated, [vec![false; n], vec![true; n]].concat());
    }
}
