//! A mesh in the order in which it is drawn.
//!
//! A picture of 224 pixels has some 10⁵ samples of a surface. Most triangles of a mesh with a million
//! miss all of them, and what drawing costs is to find that out: three corners from three places in
//! memory. Dense meshes are therefore put in an order in which neighbours lie near each other, in blocks
//! that are left out where nothing is asked of their place. What is drawn is the same to the bit.

use std::borrow::Cow;
use std::ops::Range;

use semfm_geom::math::{DVec3, bounds};
use semfm_geom::{Mesh, SpatialOrder};

/// From how many triangles on they are sorted; other numbers were not tried.
const DENSE: usize = 100_000;

/// Triangles of a block. One of 64 covers a handful of samples of a picture of a million triangles. Not varied.
const BLOCK: usize = 64;

/// Vertices and triangles, sorted where they are many.
pub(crate) struct OrderedMesh<'a> {
    pub vertices: Cow<'a, [DVec3]>,
    pub faces: Cow<'a, [[u32; 3]]>,
    /// Where the triangles stand in the mesh, if they were sorted.
    sorted: Option<Sorted>,
}

struct Sorted {
    /// For each triangle in the order of drawing its id in the mesh.
    id_of: Vec<u32>,
    /// For each id its place in the order of drawing.
    place_of: Vec<u32>,
    blocks: Vec<Block>,
}

/// A ball around the triangles of a block.
#[derive(Clone, Copy)]
pub(crate) struct Block {
    pub centre: DVec3,
    pub radius: f64,
}

impl<'a> OrderedMesh<'a> {
    pub fn new(mesh: &'a Mesh) -> Self {
        if mesh.n_faces() < DENSE {
            let (vertices, faces) = (Cow::Borrowed(mesh.vertices()), Cow::Borrowed(mesh.faces()));
            return Self { vertices, faces, sorted: None };
        }
        Self::sorted(mesh)
    }

    fn sorted(mesh: &Mesh) -> Self {
        let order = SpatialOrder::new(mesh.vertices());
        let vertices: Vec<DVec3> =
            order.name_of.iter().map(|&name| mesh.vertices()[name as usize]).collect();
        let number = |name: u32| order.number_of[name as usize];
        // Each triangle beside its lowest vertex, the lower id first.
        let mut keys: Vec<(u32, u32)> = (0..)
            .zip(mesh.faces())
            .map(|(id, &[a, b, c])| (number(a).min(number(b)).min(number(c)), id))
            .collect();
        keys.sort_unstable();
        let id_of: Vec<u32> = keys.into_iter().map(|(_, id)| id).collect();
        let mut place_of = vec![0; id_of.len()];
        for (place, &id) in (0..).zip(&id_of) {
            place_of[id as usize] = place;
        }
        let faces: Vec<[u32; 3]> =
            id_of.iter().map(|&id| mesh.faces()[id as usize].map(number)).collect();
        let blocks = faces.chunks(BLOCK).map(|faces| Block::around(&vertices, faces)).collect();
        let sorted = Some(Sorted { id_of, place_of, blocks });
        Self { vertices: vertices.into(), faces: faces.into(), sorted }
    }

    /// The id in the mesh of the triangle at a place of the order.
    pub fn id(&self, place: usize) -> u32 {
        self.sorted.as_ref().map_or(place as u32, |sorted| sorted.id_of[place])
    }

    /// The place of a triangle of the mesh in the order.
    pub fn place(&self, id: usize) -> usize {
        self.sorted.as_ref().map_or(id, |sorted| sorted.place_of[id] as usize)
    }

    /// All places, block by block; one block without a ball where nothing was sorted.
    pub fn blocks(&self) -> impl Iterator<Item = (Range<usize>, Option<Block>)> + '_ {
        let n = self.faces.len();
        let length = if self.sorted.is_some() { BLOCK } else { n.max(1) };
        (0..n).step_by(length).enumerate().map(move |(k, first)| {
            let block = self.sorted.as_ref().map(|sorted| sorted.blocks[k]);
            (first..n.min(first + length), block)
        })
    }
}

impl Block {
    fn around(vertices: &[DVec3], faces: &[[u32; 3]]) -> Self {
        let corners: Vec<DVec3> = faces.iter().flatten().map(|&v| vertices[v as usize]).collect();
        let (low, high) = bounds(&corners).unwrap_or_default();
        let centre = low.midpoint(high);
        let radius = corners.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        Self { centre, radius }
    }
}

#[cfg(test)]
mod tests {
    use semfm_geom::math::DAffine3;
    use semfm_geom::{Intrinsics, Pinhole, zoo};

    use super::*;
    use crate::render::depth_lookup::inverse_depths;
    use crate::render::triangle::Projection;
    use crate::render::triangles_of;

    #[test]
    fn ids_and_places_belong_together_and_balls_hold_their_triangles() {
        let mesh = zoo::torus(40, 20);
        let ordered = OrderedMesh::sorted(&mesh);
        for id in 0..mesh.n_faces() {
            let place = ordered.place(id);
            assert_eq!(ordered.id(place), id as u32);
            let corners = ordered.faces[place].map(|v| ordered.vertices[v as usize]);
            assert_eq!(corners, mesh.faces()[id].map(|v| mesh.vertices()[v as usize]));
        }
        let mut n_places = 0;
        for (places, block) in ordered.blocks() {
            n_places += places.len();
            let Block { centre, radius } = block.unwrap();
            let corners = places.flat_map(|place| ordered.faces[place]);
            let mut far = corners.map(|v| ordered.vertices[v as usize].distance(centre));
            assert!(far.all(|distance| distance <= radius));
        }
        assert_eq!(n_places, mesh.n_faces());
    }

    #[test]
    fn depths_are_those_of_the_mesh_as_it_is_even_with_the_eye_inside() {
        let mesh = zoo::torus(200, 100);
        let ordered = [OrderedMesh::new(&mesh), OrderedMesh::sorted(&mesh)];
        let intrinsics =
            Intrinsics { width: 224, height: 224, fx: 300.0, fy: 300.0, cx: 112.0, cy: 112.0 };
        let positions: Vec<[f64; 2]> =
            (0..400).map(|i| [f64::from(i * 7 % 224) + 0.3, f64::from(i % 224)]).collect();
        for eye in [DVec3::new(0.3, -0.2, -4.0), DVec3::new(1.0, 0.1, 0.0)] {
            let camera =
                Pinhole::with_pixel_centres_at_half(intrinsics, DAffine3::from_translation(-eye))
                    .unwrap();
            let [plain, sorted] = ordered
                .each_ref()
                .map(|mesh| inverse_depths(&Projection::new(mesh, &camera), &positions));
            assert_eq!(plain, sorted);
            assert!(plain.iter().any(|&inverse| inverse > 0.0));
            let [plain, sorted] = ordered.each_ref().map(|mesh| triangles_of(mesh, &camera));
            assert_eq!(plain, sorted);
        }
    }
}
