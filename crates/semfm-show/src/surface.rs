//! Triangles being gathered, and the simple shapes that pictures of grasps are made of.

use parry3d_f64::shape::Ball;
use semfm::geom::math::{DAffine3, DVec3};

/// Corners of the circles of arrows, discs and balls.
const N_AROUND: u32 = 32;

/// A surface that is put together piece by piece.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
}

impl Surface {
    /// Adds another surface as it is.
    pub(crate) fn add(&mut self, other: &Self) {
        self.add_at(other, DAffine3::IDENTITY);
    }

    /// Adds another surface at its place.
    pub(crate) fn add_at(&mut self, other: &Self, place: DAffine3) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(other.vertices.iter().map(|&p| place.transform_point3(p)));
        self.faces.extend(other.faces.iter().map(|face| face.map(|v| v + first)));
    }

    /// A ball.
    pub(crate) fn ball(middle: DVec3, radius: f64) -> Self {
        let (points, faces) = Ball::new(radius).to_trimesh(N_AROUND / 2, N_AROUND / 2);
        Self { vertices: points.into_iter().map(|p| p + middle).collect(), faces }
    }

    /// An arrow along +z, from `tail` to `tip`: the shaft of this radius, the head 2.6 times as wide and
    /// at most half of the length.
    pub(crate) fn arrow(tail: f64, tip: f64, radius: f64) -> Self {
        let neck = tip - (5.0 * radius).min((tip - tail) / 2.0);
        let profile =
            [(0.0, tail), (radius, tail), (radius, neck), (2.6 * radius, neck), (0.0, tip)];
        let mut arrow = Self::default();
        for ring in profile.windows(2) {
            arrow.add(&turned(ring[0], ring[1]));
        }
        arrow
    }

    /// A disc around a point, across a unit normal.
    pub(crate) fn disc(middle: DVec3, normal: DVec3, radius: f64) -> Self {
        let x = normal.any_orthonormal_vector();
        let place = DAffine3::from_cols(x, normal.cross(x), normal, middle);
        let mut disc = Self::default();
        disc.add_at(&turned((0.0, 0.0), (radius, 0.0)), place);
        disc
    }
}

/// Edges whose triangles differ by more than this stay sharp: a cylinder of 32 sides turns by 11°, a chamfer by 45°.
const CREASE_COSINE: f64 = 0.82; // 35°

impl Surface {
    /// The same triangles with a vertex of its own on each side of a sharp edge, so that normals summed at a vertex shade
    /// flat sides flat and round ones round. Triangles around a vertex go with the first whose normal is near theirs.
    pub(crate) fn with_creases(&self) -> Self {
        // Vertex of this surface, then its sides: the normal of the first triangle of each, and its new number.
        let mut sides: Vec<Vec<(DVec3, u32)>> = vec![Vec::new(); self.vertices.len()];
        let mut creased = Self::default();
        for face in &self.faces {
            let [a, b, c] = face.map(|v| self.vertices[v as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let corners = face.map(|v| {
                let of_vertex = &mut sides[v as usize];
                let near = of_vertex.iter().find(|side| side.0.dot(normal) >= CREASE_COSINE);
                if let Some(side) = near {
                    return side.1;
                }
                let new = creased.vertices.len() as u32;
                creased.vertices.push(self.vertices[v as usize]);
                of_vertex.push((normal, new));
                new
            });
            creased.faces.push(corners);
        }
        creased
    }

    /// Unit normals of the vertices: those of the triangles around each, weighted by area.
    pub(crate) fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertices.len()];
        for face in &self.faces {
            let [a, b, c] = face.map(|v| self.vertices[v as usize]);
            face.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
        }
        normals.into_iter().map(|n| n.try_normalize().unwrap_or(DVec3::Z)).collect()
    }
}

/// The surface that a piece of a profile (distance from the z axis, height) sweeps around the axis.
fn turned(from: (f64, f64), to: (f64, f64)) -> Surface {
    let mut surface = Surface::default();
    for i in 0..N_AROUND {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / f64::from(N_AROUND)).sin_cos();
        surface.vertices.extend([from, to].map(|(r, z)| DVec3::new(r * cos, r * sin, z)));
        let [a, b] = [2 * i, 2 * i + 1];
        let [c, d] = [a, b].map(|v| (v + 2) % (2 * N_AROUND));
        surface.faces.extend([[a, b, c], [b, d, c]]);
    }
    surface
}

#[cfg(test)]
mod tests {
    use semfm::geom::math::bounds;

    use super::*;

    #[test]
    fn an_arrow_reaches_from_its_tail_to_its_tip() {
        let arrow = Surface::arrow(-2.0, 1.0, 0.1);
        let (low, high) = bounds(&arrow.vertices).unwrap();
        assert!((low.z + 2.0).abs() < 1e-12 && (high.z - 1.0).abs() < 1e-12);
        assert!((high.x - 0.26).abs() < 1e-12);
    }

    #[test]
    fn a_box_has_three_vertices_at_each_corner_and_a_ball_keeps_its_own() {
        let (vertices, faces) = parry3d_f64::shape::Cuboid::new(DVec3::ONE).to_trimesh();
        let block = Surface { vertices, faces }.with_creases();
        assert_eq!((block.vertices.len(), block.faces.len()), (24, 12));
        for (p, n) in block.vertices.iter().zip(block.normals()) {
            assert!((n.abs().max_element() - 1.0).abs() < 1e-12 && (p.dot(n) - 1.0).abs() < 1e-12);
        }
        let ball = Surface::ball(DVec3::ZERO, 1.0);
        let creased = ball.with_creases();
        assert!(creased.vertices.len() < ball.vertices.len() + 4 * N_AROUND as usize);
    }

    #[test]
    fn a_disc_lies_across_its_normal() {
        let normal = DVec3::new(1.0, 2.0, -1.0).normalize();
        let disc = Surface::disc(DVec3::X, normal, 0.5);
        for p in &disc.vertices {
            assert!(
                (*p - DVec3::X).dot(normal).abs() < 1e-12 && p.distance(DVec3::X) < 0.5 + 1e-12
            );
        }
    }
}
