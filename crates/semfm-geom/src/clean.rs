//! Cleaning: a mesh from anywhere made fit for a Laplacian, with every step counted.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::disjoint_sets::DisjointSets;
use crate::weld::first_at_place;
use crate::{Error, Mesh, Result};

/// How a mesh is cleaned.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CleanSettings {
    /// A component is dust when its share of the surface area is below this; 0 keeps them all.
    ///
    /// Real objects are made of many parts (one shoe has 149 components, the smallest 2.5e-5 of
    /// its area; the smallest of a hundred objects is 2.2e-5, on a game pad), and a part that
    /// floats is still a part. The default drops only what no working mesh could resolve: at
    /// 10 000 vertices a vertex carries 1e-4 of the area, and dust is a whole component of less
    /// than a hundredth of that.
    pub dust_share: f64,
}

impl Default for CleanSettings {
    fn default() -> Self {
        Self { dust_share: 1e-6 }
    }
}

/// Dust may add up to this share of the area; beyond it, small pieces are what the object is made
/// of (a triangle soup has nothing else) and all of them stay.
const MOST_DUST: f64 = 0.01;

/// What cleaning did, in the order in which it was done.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CleanReport {
    /// Vertices before.
    pub n_vertices_before: usize,
    /// Triangles before.
    pub n_faces_before: usize,
    /// Vertices merged into an earlier one at exactly the same position.
    pub welded_vertices: usize,
    /// Triangles dropped because two of their corners are one vertex.
    pub collapsed_faces: usize,
    /// Triangles dropped because an earlier one has the same three corners, in whatever order.
    pub duplicate_faces: usize,
    /// Triangles without area whose corners differ. They are kept: such a sliver closes the gap
    /// where a vertex lies on its neighbour's edge, and without it the surface would be torn.
    pub flat_faces: usize,
    /// Components dropped as dust.
    pub dust_components: usize,
    /// Triangles dropped with them.
    pub dust_faces: usize,
    /// Vertices dropped because no triangle is left that names them.
    pub unreferenced_vertices: usize,
    /// Connected components that remain.
    pub n_components: usize,
    /// Vertices that remain.
    pub n_vertices: usize,
    /// Triangles that remain.
    pub n_faces: usize,
}

impl fmt::Display for CleanReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (vertices, faces) = (self.n_vertices_before, self.n_faces_before);
        write!(f, "{vertices} vertices and {faces} triangles; ")?;
        let steps = [
            (self.welded_vertices, "duplicate vertices welded"),
            (self.collapsed_faces, "collapsed triangles dropped"),
            (self.duplicate_faces, "duplicate triangles dropped"),
            (self.dust_faces, "triangles of dust dropped"),
            (self.unreferenced_vertices, "unreferenced vertices dropped"),
        ];
        for (count, what) in steps.into_iter().filter(|(count, _)| *count > 0) {
            write!(f, "{count} {what}; ")?;
        }
        let (vertices, faces, n) = (self.n_vertices, self.n_faces, self.n_components);
        let plural = if n == 1 { "" } else { "s" };
        write!(f, "{vertices} vertices and {faces} triangles in {n} component{plural} remain")
    }
}

/// A clean mesh and where each vertex came from.
#[derive(Clone, Debug)]
pub struct Cleaned {
    /// The clean mesh (n_clean vertices), in the order of the original.
    pub mesh: Mesh,
    /// For each original vertex (n), its clean vertex; `None` where it was dropped.
    pub of_original: Vec<Option<u32>>,
    /// For each clean vertex (n_clean), the first original vertex at its place; ascending.
    pub to_original: Vec<u32>,
    /// What was done.
    pub report: CleanReport,
}

/// Welds exact duplicates, drops collapsed and duplicate triangles, dust and vertices that nothing
/// refers to. No vertex moves, and what remains keeps its order.
///
/// # Errors
/// [`Error::NoArea`] where every triangle is degenerate.
pub fn clean(mesh: &Mesh, settings: &CleanSettings) -> Result<Cleaned> {
    let mut report = CleanReport {
        n_vertices_before: mesh.n_vertices(),
        n_faces_before: mesh.n_faces(),
        ..CleanReport::default()
    };
    // Ids stay those of the original until the end: `first[i]` is the first vertex where i is.
    let first = first_at_place(mesh);
    report.welded_vertices = (0..first.len()).filter(|&i| first[i] as usize != i).count();
    let faces = sound_faces(mesh, &first, &mut report);
    let faces = without_dust(mesh, faces, settings.dust_share, &mut report)?;

    let mut clean_of_first = vec![None; mesh.n_vertices()];
    for &id in faces.iter().flatten() {
        clean_of_first[id as usize] = Some(0);
    }
    let mut to_original = Vec::new();
    for (id, clean) in clean_of_first.iter_mut().enumerate().filter(|(_, clean)| clean.is_some()) {
        *clean = Some(to_original.len() as u32);
        to_original.push(id as u32);
    }
    let of_original: Vec<Option<u32>> =
        first.iter().map(|&first| clean_of_first[first as usize]).collect();
    let vertices = to_original.iter().map(|&id| mesh.vertices()[id as usize]).collect();
    let corners = faces.iter().map(|f| f.map(|id| of_original[id as usize].expect("in a face")));
    let mesh = Mesh::new(vertices, corners.collect())?;

    report.unreferenced_vertices =
        report.n_vertices_before - report.welded_vertices - mesh.n_vertices();
    (report.n_vertices, report.n_faces) = (mesh.n_vertices(), mesh.n_faces());
    Ok(Cleaned { mesh, of_original, to_original, report })
}

/// The triangles with three different corners, once each, on welded ids.
fn sound_faces(mesh: &Mesh, first: &[u32], report: &mut CleanReport) -> Vec<[u32; 3]> {
    let welded: Vec<[u32; 3]> =
        mesh.faces().iter().map(|ids| ids.map(|id| first[id as usize])).collect();
    let is_repeated = repeated(&welded, mesh.n_vertices());
    let mut sound = Vec::with_capacity(mesh.n_faces());
    for (face, &[a, b, c]) in welded.iter().enumerate() {
        if a == b || b == c || c == a {
            report.collapsed_faces += 1;
        } else if is_repeated[face] {
            report.duplicate_faces += 1;
        } else {
            report.flat_faces += usize::from(mesh.face_area(face) <= 0.0);
            sound.push([a, b, c]);
        }
    }
    sound
}

/// For each triangle, whether an earlier one has its corners, in whatever order.
fn repeated(faces: &[[u32; 3]], n_vertices: usize) -> Vec<bool> {
    // By their lowest corner; of each the other two, and the triangle.
    let sorted = faces.iter().map(|&ids| {
        let mut ids = ids;
        ids.sort_unstable();
        ids
    });
    let triangles = (0u32..).zip(sorted).map(|(face, [a, b, c])| (a, ([b, c], face)));
    let mut lists = ListsByVertex::new(n_vertices, triangles);
    let mut is_repeated = vec![false; faces.len()];
    lists.for_each(|list| {
        list.sort_unstable();
        for pair in list.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            is_repeated[pair[1].1 as usize] = true;
        }
    });
    is_repeated
}

/// Things that belong to vertices, those of a vertex together.
pub(crate) struct ListsByVertex<T> {
    /// Where the things of each vertex begin (n + 1).
    starts: Vec<usize>,
    things: Vec<T>,
}

impl<T: Copy + Default> ListsByVertex<T> {
    pub fn new(n_vertices: usize, things: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut starts = vec![0; n_vertices + 1];
        things.clone().for_each(|(vertex, _)| starts[vertex as usize + 1] += 1);
        for vertex in 0..n_vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let mut all = vec![T::default(); starts[n_vertices]];
        let mut next = starts.clone();
        for (vertex, thing) in things {
            all[next[vertex as usize]] = thing;
            next[vertex as usize] += 1;
        }
        Self { starts, things: all }
    }

    /// Calls `work` with the list of each vertex in turn.
    pub fn for_each(&mut self, mut work: impl FnMut(&mut [T])) {
        for range in self.starts.windows(2) {
            work(&mut self.things[range[0]..range[1]]);
        }
    }
}

/// The triangles whose component is more than dust.
fn without_dust(
    mesh: &Mesh,
    faces: Vec<[u32; 3]>,
    dust_share: f64,
    report: &mut CleanReport,
) -> Result<Vec<[u32; 3]>> {
    let root = roots(mesh.n_vertices(), &faces);
    let mut area = vec![0.0; mesh.n_vertices()];
    let mut n_faces = vec![0; mesh.n_vertices()];
    for ids in &faces {
        let [a, b, c] = ids.map(|id| mesh.vertices()[id as usize]);
        area[root[ids[0] as usize] as usize] += (b - a).cross(c - a).length() / 2.0;
        n_faces[root[ids[0] as usize] as usize] += 1;
    }
    let total: f64 = area.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::NoArea { n_faces: mesh.n_faces() });
    }
    // A component without any area is dust even where all are kept: it has no Laplacian.
    let mut is_dust: Vec<bool> =
        area.iter().map(|&area| area <= 0.0 || area < dust_share * total).collect();
    let components: Vec<usize> = (0..area.len()).filter(|&root| n_faces[root] > 0).collect();
    let dust: f64 = components.iter().filter(|&&root| is_dust[root]).map(|&root| area[root]).sum();
    if dust > MOST_DUST * total {
        is_dust = area.iter().map(|&area| area <= 0.0).collect();
    }

    let (gone, kept): (Vec<usize>, Vec<usize>) =
        components.into_iter().partition(|&root| is_dust[root]);
    report.dust_components = gone.len();
    report.dust_faces = gone.iter().map(|&root| n_faces[root]).sum();
    report.n_components = kept.len();
    Ok(faces.into_iter().filter(|ids| !is_dust[root[ids[0] as usize] as usize]).collect())
}

/// For each vertex the lowest vertex of its connected component.
pub(crate) fn roots(n_vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = DisjointSets::new(n_vertices);
    for &[a, b, c] in faces {
        sets.join(a, b);
        sets.join(b, c);
    }
    (0..n_vertices as u32).map(|id| sets.root(id)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use proptest::prelude::*;

    #[test]
    fn each_fault_is_found_counted_and_mended() {
        let (o, x, y, z) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z);
        // Vertices 1 and 4 are one place (and −0 is 0), vertex 5 is in no face, 6–8 are a speck.
        let speck = [5.0 * z, 5.0 * z + 1e-6 * x, 5.0 * z + 1e-6 * y];
        let points =
            [vec![o, x, y, z, DVec3::new(1.0, -0.0, 0.0), 9.0 * y], speck.to_vec()].concat();
        let faces = vec![
            [0, 1, 2],
            [0, 4, 3], // the same vertex under another id
            [1, 4, 2], // collapses with the weld
            [2, 0, 4], // [0, 1, 2] again
            [1, 0, 2], // and once more, turned over
            [2, 3, 3], // collapsed as read
            [6, 7, 8],
        ];
        let mesh = Mesh::new(points, faces).unwrap();
        let cleaned = clean(&mesh, &CleanSettings::default()).unwrap();
        let expected = CleanReport {
            n_vertices_before: 9,
            n_faces_before: 7,
            welded_vertices: 1,
            collapsed_faces: 2,
            duplicate_faces: 2,
            flat_faces: 0,
            dust_components: 1,
            dust_faces: 1,
            unreferenced_vertices: 4,
            n_components: 1,
            n_vertices: 4,
            n_faces: 2,
        };
        assert_eq!(cleaned.report, expected);
        assert_eq!(cleaned.mesh.faces(), [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(cleaned.to_original, [0, 1, 2, 3]);
        let [kept, gone] = [Some, |_| None];
        let expected =
            [kept(0), kept(1), kept(2), kept(3), kept(1), gone(5), gone(6), gone(7), gone(8)];
        assert_eq!(cleaned.of_original, expected);
        let text = cleaned.report.to_string();
        assert!(
            text.contains("1 duplicate vertices welded") && text.ends_with("1 component remain")
        );

        let all = clean(&mesh, &CleanSettings { dust_share: 0.0 }).unwrap();
        assert_eq!((all.report.dust_faces, all.report.n_components), (0, 2));
    }

    #[test]
    fn a_soup_of_small_pieces_is_not_dust() {
        let n = 3000;
        let points = (0..n).flat_map(|i| {
            let at = DVec3::new(3.0 * f64::from(i), 0.0, 0.0);
            [at, at + DVec3::X, at + DVec3::Y]
        });
        let faces = (0..n as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let soup = Mesh::new(points.collect(), faces).unwrap();
        let cleaned = clean(&soup, &CleanSettings { dust_share: 1e-3 }).unwrap();
        assert_eq!((cleaned.report.n_components, cleaned.mesh.n_faces()), (3000, 3000));
    }

    #[test]
    fn a_flat_triangle_that_holds_two_parts_together_stays() {
        // The top edge of the square is split at its middle (4), the triangle above it is not.
        let points = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0), (1.0, 1.0), (1.0, 2.0)]
            .map(|(x, y)| DVec3::new(x, y, 0.0));
        let faces = vec![[0, 1, 4], [1, 2, 4], [0, 4, 3], [3, 4, 2], [3, 2, 5]];
        let cleaned =
            clean(&Mesh::new(points.into(), faces).unwrap(), &Default::default()).unwrap();
        assert_eq!((cleaned.report.flat_faces, cleaned.report.n_components), (1, 1));
    }

    #[test]
    fn a_mesh_without_area_is_refused() {
        let points = vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
        let mesh = Mesh::new(points, vec![[0, 1, 2], [0, 0, 0]]).unwrap();
        let refused = clean(&mesh, &CleanSettings::default());
        assert!(matches!(refused, Err(Error::NoArea { n_faces: 2 })), "found {refused:?}");
    }

    proptest! {
        /// On any soup: the maps undo each other, places are kept, and a second pass finds nothing.
        #[test]
        fn the_maps_are_exact_and_cleaning_twice_is_cleaning_once(
            places in prop::collection::vec(prop::array::uniform3(0u8..3), 4..30),
            corners in prop::collection::vec(prop::array::uniform3(0usize..30), 1..60),
        ) {
            let n = places.len();
            let points = places.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
            let faces = corners.iter().map(|f| f.map(|i| (i % n) as u32)).collect();
            let mesh = Mesh::new(points, faces).unwrap();
            let Ok(cleaned) = clean(&mesh, &CleanSettings::default()) else {
                prop_assert!(mesh.area() == 0.0);
                return Ok(());
            };
            prop_assert!(cleaned.to_original.is_sorted());
            for (id, &original) in (0u32..).zip(&cleaned.to_original) {
                prop_assert_eq!(cleaned.of_original[original as usize], Some(id));
            }
            for (original, id) in cleaned.of_original.iter().enumerate() {
                if let Some(id) = id {
                    prop_assert_eq!(mesh.vertices()[original], cleaned.mesh.vertices()[*id as usize]);
                }
            }
            let again = clean(&cleaned.mesh, &CleanSettings::default()).unwrap();
            prop_assert_eq!(again.mesh, cleaned.mesh);
        }
    }
}
