//! What lies behind a surface that one camera saw: a volume of which nothing is known.

use std::collections::BTreeMap;

use semfm_geom::math::DVec3;
use semfm_geom::{DisjointSets, Mesh, PointIndex};

use crate::{Error, Result};

/// How far the unseen side reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnseenSettings {
    /// How far behind the seen surface it ends, along the camera's rays, in units of the mesh.
    pub depth: f64,
    /// How far behind the seen surface it begins, and how far from its outline it stays: a finger that closes on the outline
    /// must not meet it, and the outline itself is known to a few pixels only.
    pub gap: f64,
    /// A plane at which it ends, such as the top of a table: a point and the normal to the side on which the object is.
    pub ends_at: Option<[DVec3; 2]>,
}

/// A closed mesh around what is hidden behind `surface` from `eye`: each triangle moved along the camera's rays, from
/// [`gap`](UnseenSettings::gap) to [`depth`](UnseenSettings::depth) behind itself or to the plane. As an obstacle it keeps a
/// gripper out of where the rest of the object may be. `None` where nothing is wide enough to hide anything.
///
/// `surface` is what a camera at `eye` saw, in one frame and unit: no point of it hides another.
///
/// # Errors
/// [`Error::Invalid`] for lengths out of range, for an eye or a plane that is not finite, and for a mesh without an outline:
/// that has no unseen side.
pub fn unseen_side(surface: &Mesh, eye: DVec3, settings: &UnseenSettings) -> Result<Option<Mesh>> {
    settings.check(eye)?;
    let outline = outline(surface);
    let Some(outline) = PointIndex::new(&outline).ok().filter(|_| !outline.is_empty()) else {
        let expected = "a surface with an outline, as one camera sees it";
        return Err(Error::invalid(
            "unseen side",
            expected,
            "a closed mesh, which is known all around",
        ));
    };
    // From where to where each vertex is moved, as distances along its ray.
    let spans: Vec<Option<Span>> = surface
        .vertices()
        .iter()
        .map(|&p| {
            let is_inner = outline.nearest(p).1 >= settings.gap;
            is_inner.then(|| settings.span(p, eye)).flatten()
        })
        .collect();
    let faces: Vec<[u32; 3]> = surface
        .faces()
        .iter()
        .filter(|face| face.iter().all(|&v| spans[v as usize].is_some()))
        .copied()
        .collect();
    if faces.is_empty() {
        return Ok(None);
    }
    let sheet = Sheet::new(&faces);
    let n = sheet.vertex_of.len() as u32;
    let span = |corner: &u32| spans[*corner as usize].unwrap_or(Span { near: eye, far: eye });
    let near = sheet.vertex_of.iter().map(|v| span(v).near);
    let vertices = near.chain(sheet.vertex_of.iter().map(|v| span(v).far)).collect();
    let back = sheet.faces.iter().map(|&[a, b, c]| [a + n, c + n, b + n]);
    let sides = sheet.border.iter().flat_map(|&[a, b]| [[b, a, a + n], [b, a + n, b + n]]);
    let faces = sheet.faces.iter().copied().chain(back).chain(sides).collect();
    Ok(Some(Mesh::new(vertices, faces)?))
}

/// The part of a ray that is unseen.
#[derive(Clone, Copy)]
struct Span {
    near: DVec3,
    far: DVec3,
}

impl UnseenSettings {
    fn check(&self, eye: DVec3) -> Result<()> {
        if !(self.gap > 0.0 && self.gap < self.depth && self.depth.is_finite()) {
            let found = format!("gap {}, depth {}", self.gap, self.depth);
            return Err(Error::invalid("unseen side", "0 < gap < depth", found));
        }
        let [point, normal] = self.ends_at.unwrap_or([DVec3::ZERO, DVec3::Z]);
        if !(eye.is_finite() && point.is_finite() && normal.is_finite() && normal != DVec3::ZERO) {
            let found = format!("eye {eye}, plane {point}, {normal}");
            return Err(Error::invalid(
                "unseen side",
                "an eye and a plane of finite numbers",
                found,
            ));
        }
        Ok(())
    }

    /// The unseen part of the ray through a point of the surface; `None` where the plane leaves none.
    fn span(&self, p: DVec3, eye: DVec3) -> Option<Span> {
        let ray = (p - eye).try_normalize()?;
        let mut end = self.depth;
        if let Some([point, normal]) = self.ends_at {
            let falls = -ray.dot(normal);
            let height = (p - point).dot(normal);
            if falls > 0.0 {
                end = end.min(height / falls);
            } else if height < 0.0 {
                return None;
            }
        }
        (end > self.gap).then_some(Span { near: p + self.gap * ray, far: p + end * ray })
    }
}

/// The points of the edges that only one triangle has.
fn outline(mesh: &Mesh) -> Vec<DVec3> {
    let mut n_faces: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for &[a, b, c] in mesh.faces() {
        for [i, j] in [[a, b], [b, c], [c, a]] {
            *n_faces.entry([i.min(j), i.max(j)]).or_default() += 1;
        }
    }
    let border = n_faces.into_iter().filter(|(_, n)| *n == 1).flat_map(|(edge, _)| edge);
    border.map(|v| mesh.vertices()[v as usize]).collect()
}

/// Triangles whose vertices are split where two fans of them touch at a point only, so that moving them along rays makes a
/// closed mesh in which each edge has two triangles.
struct Sheet {
    /// The vertex that each new one is a copy of.
    vertex_of: Vec<u32>,
    faces: Vec<[u32; 3]>,
    /// Edges that one triangle has, in its direction.
    border: Vec<[u32; 2]>,
}

impl Sheet {
    fn new(faces: &[[u32; 3]]) -> Self {
        // Which triangle has an edge in this direction; of several the last, the others keep a border there.
        let mut face_at: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for (face, &[a, b, c]) in faces.iter().enumerate() {
            face_at.extend([([a, b], face), ([b, c], face), ([c, a], face)]);
        }
        let is_joined = |face: usize, [a, b]: [u32; 2]| {
            face_at.get(&[a, b]) == Some(&face) && face_at.contains_key(&[b, a])
        };
        // Corners (3 · face + place) joined across shared edges.
        let mut corners_of_fan = DisjointSets::new(3 * faces.len());
        for (face, corners) in faces.iter().enumerate() {
            for k in 0..3 {
                let edge = [corners[k], corners[(k + 1) % 3]];
                if !is_joined(face, edge) {
                    continue;
                }
                let other = face_at[&[edge[1], edge[0]]];
                for (place, vertex) in [(k, edge[0]), ((k + 1) % 3, edge[1])] {
                    let there = faces[other].iter().position(|&v| v == vertex).unwrap_or(0);
                    corners_of_fan.join((3 * face + place) as u32, (3 * other + there) as u32);
                }
            }
        }
        let mut number = vec![None; 3 * faces.len()];
        let mut vertex_of = Vec::new();
        let mut new_faces = vec![[0; 3]; faces.len()];
        for corner in 0..3 * faces.len() {
            let at = corners_of_fan.root(corner as u32) as usize;
            new_faces[corner / 3][corner % 3] = *number[at].get_or_insert_with(|| {
                vertex_of.push(faces[corner / 3][corner % 3]);
                vertex_of.len() as u32 - 1
            });
        }
        let mut border = Vec::new();
        for (face, corners) in faces.iter().enumerate() {
            for k in 0..3 {
                if !is_joined(face, [corners[k], corners[(k + 1) % 3]]) {
                    border.push([new_faces[face][k], new_faces[face][(k + 1) % 3]]);
                }
            }
        }
        Self { vertex_of, faces: new_faces, border }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::connectivity::MeshReport;
    use semfm_geom::zoo;

    const SETTINGS: UnseenSettings = UnseenSettings { depth: 0.3, gap: 0.01, ends_at: None };

    /// A square of 1 × 1 at z = 1, seen from the origin, with `n` cells a side of which `keep` says which there are.
    fn square(n: u32, keep: impl Fn(u32, u32) -> bool) -> Mesh {
        let at = |i: u32| f64::from(i) / f64::from(n) - 0.5;
        let vertices =
            (0..=n).flat_map(|row| (0..=n).map(move |c| DVec3::new(at(c), at(row), 1.0))).collect();
        let cells = (0..n).flat_map(|row| (0..n).map(move |column| (column, row)));
        let faces = cells.filter(|&(c, r)| keep(c, r)).flat_map(|(column, row)| {
            let a = row * (n + 1) + column;
            [[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]]
        });
        Mesh::new(vertices, faces.collect()).unwrap()
    }

    /// By the divergence theorem.
    fn volume(mesh: &Mesh) -> f64 {
        (0..mesh.n_faces()).map(|f| mesh.corners(f)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn it_is_closed_and_as_large_as_the_frustum() {
        let found = unseen_side(&square(40, |_, _| true), DVec3::ZERO, &SETTINGS).unwrap().unwrap();
        let report = MeshReport::new(&found);
        assert!(report.watertight && report.oriented, "{report:?}");
        // The vertices on the outline go: 38 of 40 cells a side. ∫ dA cos θ/r² · ((r + .3)³ − (r + .01)³)/3 over them.
        assert!((volume(&found) - 0.3223).abs() < 1e-3, "{}", volume(&found));
        let far = found.vertices().iter().map(|p| p.length()).fold(0.0, f64::max);
        assert!(far < 1.3 * 1.23 && found.vertices().iter().all(|p| p.z > 1.005));
    }

    #[test]
    fn triangles_that_touch_at_a_point_make_closed_volumes_too() {
        let checks = square(12, |column, row| (column / 3 + row / 3) % 2 == 0);
        let settings = UnseenSettings { gap: 1e-4, ..SETTINGS };
        // Eight squares of 4 × 4 vertices each: where two touch at a corner, the corner is two vertices.
        assert_eq!(Sheet::new(checks.faces()).vertex_of.len(), 8 * 16);
        let found = unseen_side(&checks, DVec3::ZERO, &settings).unwrap().unwrap();
        assert!(MeshReport::new(&found).watertight);
    }

    #[test]
    fn a_table_ends_it_and_thin_things_hide_nothing() {
        let mesh = square(20, |_, _| true);
        let table = [DVec3::new(0.0, 0.0, 1.1), -DVec3::Z];
        let ended = UnseenSettings { ends_at: Some(table), ..SETTINGS };
        let found = unseen_side(&mesh, DVec3::ZERO, &ended).unwrap().unwrap();
        assert!(found.vertices().iter().all(|p| p.z < 1.1 + 1e-12));
        let before = UnseenSettings { ends_at: Some([DVec3::Z, -DVec3::Z]), ..SETTINGS };
        assert!(unseen_side(&mesh, DVec3::ZERO, &before).unwrap().is_none());
        let wide = UnseenSettings { gap: 0.29, ..SETTINGS };
        let strip = square(20, |_, row| row < 4);
        assert!(unseen_side(&strip, DVec3::ZERO, &wide).unwrap().is_none());
    }

    #[test]
    fn what_has_no_unseen_side_is_refused() {
        let words = |mesh: &Mesh, settings: &UnseenSettings| {
            unseen_side(mesh, 3.0 * DVec3::X, settings).unwrap_err().to_string()
        };
        assert!(words(&zoo::icosphere(2), &SETTINGS).contains("closed"));
        let odd = UnseenSettings { gap: 0.5, ..SETTINGS };
        assert!(words(&square(4, |_, _| true), &odd).contains("gap 0.5"));
    }
}
