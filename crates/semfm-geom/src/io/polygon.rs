//! Polygons to triangles, without new vertices.

use super::appearance::MISSING_UV;
use crate::math::{DVec2, DVec3};

/// Above this many corners a polygon is fanned even if it is concave: ear clipping takes quadratic
/// time, and at 256 a malicious file of nothing but such polygons costs as much as its parsing.
const MAX_EAR_CORNERS: usize = 256;

/// A corner that turns the wrong way by less than this share of the polygon's area counts as
/// straight: coordinates with six digits leave corners on straight sides that off.
const STRAIGHT: f64 = 1e-6;

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
        let mut cutter = EarCutter::default();
        let mut start = 0;
        for &end in &self.ends {
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
            match cutter.cut(ids, vertices) {
                Some(triangles) => triangles.iter().copied().for_each(&mut push),
                None => (1..ids.len() as u32 - 1).for_each(|i| push([0, i, i + 1])),
            }
            start = end;
        }
        Triangles {
            n_faces: self.ends.len(),
            faces,
            corner_uvs: (!uv_ids.is_empty()).then_some(corner_uvs),
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
}

/// Cuts one concave polygon after the other, keeping the scratch space.
#[derive(Default)]
struct EarCutter {
    corners: Vec<DVec3>,
    flat: Vec<DVec2>,
    ring: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl EarCutter {
    /// The n − 2 triangles of a concave polygon, as numbers of its corners, with its winding: it is
    /// cut at its ears (G. H. Meisters, *Polygons have ears*, 1975), since its fan would fold over.
    ///
    /// `None` asks for the fan around the first corner, which is what most readers make of any
    /// polygon: where it is convex, and where no ear is left because it crosses itself or repeats
    /// corners.
    fn cut(&mut self, ids: &[u32], vertices: &[DVec3]) -> Option<&[[u32; 3]]> {
        if ids.len() <= 3 || ids.len() > MAX_EAR_CORNERS {
            return None;
        }
        self.corners.clear();
        self.corners.extend(ids.iter().map(|&id| vertices[id as usize]));
        (self.flatten_if_concave() && self.clip_ears()).then_some(&self.triangles)
    }

    /// Projects the polygon along its Newell normal; false where it is convex or has no area.
    fn flatten_if_concave(&mut self) -> bool {
        let corners = &self.corners;
        let origin = corners[0];
        // Newell: Σ pᵢ × pᵢ₊₁, which is twice the area along the normal.
        let normal: DVec3 = (0..corners.len())
            .map(|i| (corners[i] - origin).cross(corners[(i + 1) % corners.len()] - origin))
            .sum();
        let double_area = normal.length();
        let Some(normal) = normal.try_normalize() else { return false };
        let (x, y) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat
            .extend(corners.iter().map(|&p| DVec2::new((p - origin).dot(x), (p - origin).dot(y))));
        let n = self.flat.len();
        let reflex = -STRAIGHT * double_area;
        (0..n).any(|i| turn(self.flat[i], self.flat[(i + 1) % n], self.flat[(i + 2) % n]) < reflex)
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
        self.triangles.push([self.ring[0], self.ring[1], self.ring[2]]);
        true
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

    #[test]
    fn repeated_corners_still_give_two_less_than_corners() {
        let corners =
            polygon(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        assert_eq!(cut(&corners).len(), 4);
    }
}
