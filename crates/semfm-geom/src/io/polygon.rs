//! Polygons to triangles, without new vertices.

use std::f64::consts::PI;

use super::appearance::MISSING_UV;
use super::polygon_with_holes::cut_constrained;
use crate::math::{DVec2, DVec3};

/// Above this many corners a concave polygon is not cut at its ears, which takes quadratic time, but by a constrained
/// Delaunay triangulation: at 256 a malicious file of nothing but such polygons costs as much as its parsing.
const MAX_EAR_CORNERS: usize = 256;

/// A corner that turns the wrong way by less than this share of the polygon's area counts as
/// straight: coordinates with six digits leave corners on straight sides that off.
const STRAIGHT: f64 = 1e-6;

/// Triangles may miss the polygon's area by this share: the rounding of a thousand corners.
const AREA_TOLERANCE: f64 = 1e-6;

/// Notes on single faces; what is beyond is counted.
const MAX_NOTES: usize = 4;

/// The faces of a file before they are cut, one after the other.
#[derive(Default)]
pub(crate) struct Polygons {
    /// Vertex ids of all corners.
    ids: Vec<u32>,
    /// Which texture coordinate each corner has, [`NO_UV`] for none; empty while no corner has one
    /// of its own.
    uv_ids: Vec<u32>,
    /// Texture coordinates go by vertex: those of a corner have its vertex's number.
    uvs_by_vertex: bool,
    /// For each face, one past its last corner.
    ends: Vec<usize>,
}

/// Marks a corner without a texture coordinate.
pub(crate) const NO_UV: u32 = u32::MAX;

impl Polygons {
    /// No faces yet; their corners will have the texture coordinates of their vertices.
    pub fn with_uvs_by_vertex() -> Self {
        Self { uvs_by_vertex: true, ..Self::default() }
    }

    /// Adds a corner to the face that [`close`](Self::close) will end.
    pub fn push(&mut self, vertex: u32, uv: u32) {
        if uv != NO_UV && self.uv_ids.is_empty() {
            self.uv_ids.resize(self.ids.len(), NO_UV);
        }
        if uv != NO_UV || !self.uv_ids.is_empty() {
            self.uv_ids.push(uv);
        }
        self.ids.push(vertex);
    }

    /// Ends the face. One or two corners are a point or an edge, which formats allow among their
    /// faces: they are dropped, since they have no surface.
    pub fn close(&mut self) {
        let start = self.ends.last().copied().unwrap_or(0);
        if self.ids.len() - start >= 3 {
            self.ends.push(self.ids.len());
        } else {
            self.ids.truncate(start);
            self.uv_ids.truncate(start);
        }
    }

    /// How many corners name a texture coordinate from `n_uvs` on.
    pub fn count_uvs_from(&self, n_uvs: u32) -> usize {
        self.uv_ids.iter().filter(|&&id| id != NO_UV && id >= n_uvs).count()
    }

    /// All faces as triangles, and the texture coordinates of their corners if there are any: NaN
    /// for a corner without one or with one that is not in `uvs`. Every vertex id must be one of
    /// `vertices`.
    pub fn into_triangles(self, vertices: &[DVec3], uvs: &[[f32; 2]]) -> Triangles {
        let n_triangles = self.ids.len() - 2 * self.ends.len();
        let uv_ids = if self.uvs_by_vertex { &self.ids } else { &self.uv_ids };
        let mut faces = Vec::with_capacity(n_triangles);
        let mut corner_uvs = Vec::with_capacity(if uv_ids.is_empty() { 0 } else { n_triangles });
        let mut cutter = PolygonCutter::default();
        let mut fanned = Vec::new();
        let mut start = 0;
        for (face, &end) in self.ends.iter().enumerate() {
            let ids = &self.ids[start..end];
            let mut push = |corners: [u32; 3]| {
                faces.push(corners.map(|i| ids[i as usize]));
                if !uv_ids.is_empty() {
                    corner_uvs.push(corners.map(|i| {
                        let id = uv_ids[start + i as usize];
                        uvs.get(id as usize).copied().unwrap_or(MISSING_UV)
                    }));
                }
            };
            let cut = cutter.cut(ids, vertices);
            if cut == Cut::CrossesItself {
                fanned.push(cutter.fan_note(face));
            }
            match cut {
                Cut::Triangles => cutter.triangles.iter().copied().for_each(&mut push),
                Cut::Convex | Cut::CrossesItself => {
                    (1..ids.len() as u32 - 1).for_each(|i| push([0, i, i + 1]));
                }
            }
            start = end;
        }
        if fanned.len() > MAX_NOTES {
            let more = fanned.len() - MAX_NOTES;
            fanned.truncate(MAX_NOTES);
            fanned.push(format!("{more} more faces cross themselves and are cut as fans"));
        }
        Triangles {
            n_faces: self.ends.len(),
            faces,
            corner_uvs: (!uv_ids.is_empty()).then_some(corner_uvs),
            notes: fanned,
        }
    }
}

/// Faces cut to triangles.
pub(crate) struct Triangles {
    /// Faces there were.
    pub n_faces: usize,
    /// Vertex ids (m).
    pub faces: Vec<[u32; 3]>,
    /// Texture coordinates of the corners (m).
    pub corner_uvs: Option<Vec<[[f32; 2]; 3]>>,
    /// Faces that could not be cut right, in words.
    pub notes: Vec<String>,
}

/// What became of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cut {
    /// The fan around its first corner is right.
    Convex,
    /// The cutter's triangles.
    Triangles,
    /// No triangles without overlap have its outline; most readers make a fan of it.
    CrossesItself,
}

/// Cuts one polygon after the other, keeping the scratch space.
#[derive(Default)]
struct PolygonCutter {
    corners: Vec<DVec3>,
    flat: Vec<DVec2>,
    ring: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl PolygonCutter {
    /// The triangles of a polygon, as numbers of its corners, with its winding.
    ///
    /// A concave one is cut at its ears (G. H. Meisters, *Polygons have ears*, 1975), since its fan would fold over.
    /// One that touches itself (a hole joined to the outline by a bridge that is walked twice), or that has many
    /// corners, is cut by a constrained Delaunay triangulation of its corners.
    fn cut(&mut self, ids: &[u32], vertices: &[DVec3]) -> Cut {
        if ids.len() <= 3 {
            return Cut::Convex;
        }
        self.corners.clear();
        self.corners.extend(ids.iter().map(|&id| vertices[id as usize]));
        let Some(double_area) = self.flatten() else { return Cut::Convex };
        if self.fan_is_right(double_area) {
            return Cut::Convex;
        }
        if ids.len() <= MAX_EAR_CORNERS && self.clip_ears() {
            return Cut::Triangles;
        }
        self.triangles.clear();
        cut_constrained(&self.flat, &mut self.triangles);
        let covered: f64 = self.triangles.iter().map(|&ids| self.turn_of(ids)).sum();
        if (covered - double_area).abs() <= AREA_TOLERANCE * double_area {
            Cut::Triangles
        } else {
            Cut::CrossesItself
        }
    }

    /// Projects the polygon along its Newell normal and gives twice its area; `None` where it has none.
    fn flatten(&mut self) -> Option<f64> {
        let corners = &self.corners;
        let origin = corners[0];
        // Newell: Σ pᵢ × pᵢ₊₁, which is twice the area along the normal.
        let normal: DVec3 = (0..corners.len())
            .map(|i| (corners[i] - origin).cross(corners[(i + 1) % corners.len()] - origin))
            .sum();
        let double_area = normal.length();
        let normal = normal.try_normalize()?;
        let (x, y) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat
            .extend(corners.iter().map(|&p| DVec2::new((p - origin).dot(x), (p - origin).dot(y))));
        Some(double_area)
    }

    /// Whether the polygon lies to the left of all its sides and winds once, so that the triangles of its fan neither
    /// turn over nor overlap.
    fn fan_is_right(&self, double_area: f64) -> bool {
        let n = self.flat.len();
        let reflex = -STRAIGHT * double_area;
        let corner = |i: usize| self.flat[i % n];
        if (0..n).any(|i| turn(corner(i), corner(i + 1), corner(i + 2)) < reflex) {
            return false;
        }
        // Many small turns the wrong way add up, and an outline that winds twice turns the right way everywhere.
        let (mut turned_over, mut angle) = (0.0, 0.0);
        for i in 1..n - 1 {
            let (from, to) = (self.flat[i] - self.flat[0], self.flat[i + 1] - self.flat[0]);
            turned_over += (-from.perp_dot(to)).max(0.0);
            angle += from.angle_to(to);
        }
        turned_over <= STRAIGHT * double_area && angle <= PI * (1.0 + STRAIGHT.sqrt())
    }

    /// Twice the signed area of a triangle of corners.
    fn turn_of(&self, ids: [u32; 3]) -> f64 {
        let [a, b, c] = ids.map(|i| self.flat[i as usize]);
        turn(a, b, c)
    }

    /// What to say of face number `face`, of which a fan is made.
    fn fan_note(&self, face: usize) -> String {
        let corners = &self.corners;
        let (mut fan, mut outline) = (0.0, DVec3::ZERO);
        for i in 1..corners.len() - 1 {
            let normal = (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]);
            fan += normal.length() / 2.0;
            outline += normal / 2.0;
        }
        let (n, outline) = (corners.len(), outline.length());
        format!(
            "face {face} ({n} corners) crosses itself: as a fan it has area {fan:.6}, its outline encloses {outline:.6}"
        )
    }

    /// Cuts ears off the flat polygon; false where it runs out of them early.
    fn clip_ears(&mut self) -> bool {
        self.triangles.clear();
        self.ring.clear();
        self.ring.extend(0..self.flat.len() as u32);
        while self.ring.len() > 3 {
            let Some(ear) = (0..self.ring.len()).find(|&at| self.is_ear(at)) else { return false };
            self.triangles.push(self.around(ear));
            self.ring.remove(ear);
        }
        let last = [self.ring[0], self.ring[1], self.ring[2]];
        self.triangles.push(last);
        self.turn_of(last) >= 0.0
    }

    /// Corner `at` of the ring between its neighbours.
    fn around(&self, at: usize) -> [u32; 3] {
        let n = self.ring.len();
        [self.ring[(at + n - 1) % n], self.ring[at], self.ring[(at + 1) % n]]
    }

    fn is_ear(&self, at: usize) -> bool {
        let ids = self.around(at);
        let [a, b, c] = ids.map(|i| self.flat[i as usize]);
        turn(a, b, c) > 0.0
            && !self.ring.iter().any(|&i| {
                let p = self.flat[i as usize];
                let outside = turn(a, b, p) < 0.0 || turn(b, c, p) < 0.0 || turn(c, a, p) < 0.0;
                !ids.contains(&i) && !outside
            })
    }
}

/// Twice the signed area of a triangle: positive for a left turn.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(points: &[(f64, f64)]) -> Vec<DVec3> {
        // Tilted out of the coordinate planes on purpose.
        points.iter().map(|&(x, y)| DVec3::new(x, y, 2.0 * x - y)).collect()
    }

    fn cut(corners: &[DVec3]) -> Vec<[u32; 3]> {
        let mut polygons = Polygons::default();
        (0..corners.len() as u32).for_each(|id| polygons.push(id, NO_UV));
        polygons.close();
        polygons.into_triangles(corners, &[]).faces
    }

    fn area(corners: &[DVec3], triangle: [u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|i| corners[i as usize]);
        (b - a).cross(c - a).length() / 2.0
    }

    #[test]
    fn a_convex_polygon_is_fanned() {
        let corners = polygon(&[(0.0, 0.0), (2.0, 0.0), (3.0, 1.0), (1.0, 3.0), (0.0, 2.0)]);
        assert_eq!(cut(&corners), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn the_triangles_of_a_concave_polygon_do_not_overlap() {
        // An arrowhead whose fan around corner 0 would leave it.
        let corners = polygon(&[(0.0, 0.0), (4.0, -3.0), (1.0, 0.0), (4.0, 3.0)]);
        let fan = area(&corners, [0, 1, 2]) + area(&corners, [0, 2, 3]);
        for shift in 0..4 {
            let mut turned = corners.clone();
            turned.rotate_left(shift);
            let triangles = cut(&turned);
            let total: f64 = triangles.iter().map(|&t| area(&turned, t)).sum();
            assert_eq!(triangles.len(), 2);
            assert!((total - fan).abs() < 1e-12, "{total} {fan}");
        }
    }

    /// Area of the triangles, and the area that the corners' outline encloses.
    fn areas(corners: &[DVec3]) -> (f64, f64) {
        let total = cut(corners).iter().map(|&t| area(corners, t)).sum();
        let n = corners.len();
        let outline: DVec3 = (0..n).map(|i| corners[i].cross(corners[(i + 1) % n])).sum();
        (total, outline.length() / 2.0)
    }

    /// `n` corners on a circle of that radius around the origin, from angle `from` to `to`.
    fn arc(n: usize, radius: f64, from: f64, to: f64) -> impl Iterator<Item = (f64, f64)> {
        (0..n).map(move |i| {
            let angle = from + (to - from) * i as f64 / (n - 1) as f64;
            (radius * angle.cos(), radius * angle.sin())
        })
    }

    #[test]
    fn concave_polygons_of_any_size_keep_their_area_and_all_corners() {
        for n in [5, 40, 127, 128, 129, 500, 20_000] {
            // Three quarters of a ring.
            let outline: Vec<_> = arc(n, 2.0, 0.0, 4.7).chain(arc(n, 1.5, 4.7, 0.0)).collect();
            let corners = polygon(&outline);
            let (total, outline) = areas(&corners);
            assert!((total / outline - 1.0).abs() < 1e-9, "{n}: {total} of {outline}");
            let mut used = vec![false; corners.len()];
            let triangles = cut(&corners);
            triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
            assert!(triangles.len() == corners.len() - 2 && !used.contains(&false), "{n}");
        }
    }

    #[test]
    fn holes_that_a_bridge_joins_to_the_outline_stay_open() {
        // A square with two holes; each bridge is walked there and back.
        let corners = polygon(&[
            (0.0, 0.0),
            (8.0, 0.0),
            (8.0, 4.0),
            (6.0, 3.0),
            (6.0, 1.0),
            (5.0, 1.0),
            (5.0, 3.0),
            (6.0, 3.0),
            (8.0, 4.0),
            (0.0, 4.0),
            (1.0, 3.0),
            (2.0, 3.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 3.0),
            (0.0, 4.0),
        ]);
        for shift in 0..corners.len() {
            let mut turned = corners.clone();
            turned.rotate_left(shift);
            let (total, outline) = areas(&turned);
            assert!((total / outline - 1.0).abs() < 1e-12, "{shift}: {total} of {outline}");
        }
        // Rings whose hole touches the outline in one corner.
        let touching = polygon(&[
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (0.0, 0.0),
            (1.0, 3.0),
            (3.0, 1.0),
        ]);
        let (total, outline) = areas(&touching);
        assert!((total / outline - 1.0).abs() < 1e-12, "{total} of {outline}");
    }

    #[test]
    fn corners_at_one_place_keep_their_own_numbers() {
        // A square whose hole touches it in the corner that is both 0 and 4: below the hole it is 0, beside it 4.
        let corners = polygon(&[
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (0.0, 0.0),
            (1.0, 3.0),
            (3.0, 1.0),
        ]);
        for triangle in cut(&corners) {
            let sum: DVec3 = triangle.iter().map(|&i| corners[i as usize]).sum();
            assert!(!triangle.contains(&0) || sum.x > sum.y, "{triangle:?}");
            assert!(!triangle.contains(&4) || sum.x < sum.y, "{triangle:?}");
        }
    }

    #[test]
    fn a_face_that_crosses_itself_is_fanned_and_named() {
        let corners =
            polygon(&[(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, -2.0), (1.0, 3.0), (0.0, 3.0)]);
        let mut polygons = Polygons::default();
        for face in [&[0, 1, 2][..], &[0, 1, 2, 3, 4, 5]] {
            face.iter().for_each(|&id| polygons.push(id, NO_UV));
            polygons.close();
        }
        let triangles = polygons.into_triangles(&corners, &[]);
        assert_eq!(triangles.faces.len(), 5);
        let [note] = &triangles.notes[..] else { panic!("{:?}", triangles.notes) };
        assert!(note.starts_with("face 1 (6 corners) crosses itself"), "{note}");
    }

    #[test]
    fn repeated_corners_still_give_two_less_than_corners() {
        let corners =
            polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        assert_eq!(cut(&corners).len(), 4);
    }
}
