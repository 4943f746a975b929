//! The Delaunay triangles around one point of the plane: its star in the triangulation.

use crate::math::DVec2;

/// Half the side of the square that stands for an unbounded Voronoi cell, in distances of the
/// farthest neighbour. A triangle at the rim whose circumcircle is larger than this is left out:
/// its angle at the centre is within 1e-4 of 180°, so it has next to no area.
const FAR: f64 = 1e4;

/// Neighbours closer to the centre than this share of the farthest neighbour's distance are its
/// copies: they have the same star, and no direction.
const COINCIDENT: f64 = 1e-9;

/// Lift of the points, as a share of the farthest neighbour's squared distance: large against
/// rounding, small against anything that a Delaunay triangulation is asked for.
const LIFT: f64 = 1e-8;

/// A neighbour of the centre, which is the origin.
#[derive(Clone, Copy)]
pub(super) struct Neighbour {
    pub position: DVec2,
    /// Its lift minus that of the centre, in (−1, 1); see [`lift`].
    pub lift: f64,
}

/// A number in [0, 1) that belongs to a point, scattered over the ids.
///
/// Points on a common circle (a regular grid is full of them) have several Delaunay
/// triangulations, and stars that choose differently cover the surface twice here and four times
/// there. So the points are lifted by these numbers and the triangulation is a weighted one, whose
/// ties are broken alike from everywhere (Edelsbrunner & Mücke 1990 with finite numbers).
pub(super) fn lift(id: usize) -> f64 {
    // Two rounds of multiply and fold: a single multiplication is linear in the id, and on a grid
    // numbered row by row both diagonals of every square would have the same sum.
    let mut hash = (id as u32).wrapping_mul(0x9E37_79B9);
    hash = (hash ^ hash >> 16).wrapping_mul(0x85EB_CA6B);
    f64::from(hash ^ hash >> 13) / 2f64.powi(32)
}

/// One corner of the cell, and the neighbour whose bisector runs from here to the next corner.
#[derive(Clone, Copy)]
struct CellCorner {
    position: DVec2,
    neighbour: Option<u32>,
}

impl CellCorner {
    /// x · q − `limit`: positive beyond the bisector towards a neighbour at q.
    fn beyond(&self, q: DVec2, limit: f64) -> f64 {
        self.position.dot(q) - limit
    }
}

/// Finds stars one after the other, reusing its memory.
#[derive(Default)]
pub(super) struct LocalDelaunay {
    cell: Vec<CellCorner>,
    clipped: Vec<CellCorner>,
}

impl LocalDelaunay {
    /// Pairs (i, j) of `neighbours`, counter-clockwise, such that (centre, i, j) is a triangle of
    /// the Delaunay triangulation of the centre (at the origin) and its neighbours.
    ///
    /// The Voronoi cell of the centre is cut out of a large square by the bisectors to the
    /// neighbours; its sides are the Delaunay edges, its corners the triangles. Any order will do,
    /// nearest first is fastest.
    pub fn star(&mut self, neighbours: &[Neighbour]) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.cell.clear();
        let reach = neighbours.iter().map(|q| q.position.length()).fold(0.0, f64::max);
        if reach > 0.0 {
            let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            let corner =
                |(x, y)| CellCorner { position: DVec2::new(x, y) * FAR * reach, neighbour: None };
            self.cell.extend(square.map(corner));
        }
        for (i, q) in neighbours.iter().enumerate() {
            if q.position.length() > COINCIDENT * reach {
                let limit = (q.position.length_squared() - LIFT * reach * reach * q.lift) / 2.0;
                self.clip(q.position, limit, i as u32);
            }
        }
        let n = self.cell.len();
        // Two bisectors that meet at a corner: the one that ends there and the one that starts.
        (0..n).filter_map(move |k| self.cell[(k + n - 1) % n].neighbour.zip(self.cell[k].neighbour))
    }

    /// Keeps the side x · q ≤ `limit` of the bisector towards neighbour `id` at q.
    fn clip(&mut self, q: DVec2, limit: f64, id: u32) {
        if self.cell.iter().all(|corner| corner.beyond(q, limit) <= 0.0) {
            return;
        }
        self.clipped.clear();
        for (k, corner) in self.cell.iter().enumerate() {
            let following = &self.cell[(k + 1) % self.cell.len()];
            let (here, there) = (corner.beyond(q, limit), following.beyond(q, limit));
            if here <= 0.0 {
                self.clipped.push(*corner);
            }
            if (here <= 0.0) != (there <= 0.0) {
                let position = corner.position.lerp(following.position, here / (here - there));
                // Leaving the half-plane starts the new side; entering it resumes the old one.
                let neighbour = if here <= 0.0 { Some(id) } else { corner.neighbour };
                self.clipped.push(CellCorner { position, neighbour });
            }
        }
        std::mem::swap(&mut self.cell, &mut self.clipped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn ring(n: usize, radius: f64, phase: f64) -> impl Iterator<Item = DVec2> {
        (0..n).map(move |i| DVec2::from_angle(TAU * i as f64 / n as f64 + phase) * radius)
    }

    fn star(positions: impl IntoIterator<Item = DVec2>) -> Vec<(u32, u32)> {
        let positions = positions.into_iter().enumerate();
        let neighbours: Vec<_> = positions
            .map(|(i, position)| Neighbour { position, lift: lift(i + 1) - lift(0) })
            .collect();
        let mut star: Vec<_> = LocalDelaunay::default().star(&neighbours).collect();
        star.sort_unstable();
        star
    }

    #[test]
    fn the_nearest_ring_hides_the_next() {
        let star = star(ring(6, 1.0, 0.1).chain(ring(12, 1.9, 0.0)));
        assert_eq!(star, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)]);
    }

    #[test]
    fn at_the_rim_the_star_is_open() {
        let star = star([DVec2::X, DVec2::new(0.6, 0.9), DVec2::new(-1.0, 0.8)]);
        assert_eq!(star, [(0, 1), (1, 2)]);
    }

    #[test]
    fn copies_and_lines_are_no_trouble() {
        assert_eq!(star([]), []);
        assert_eq!(star([DVec2::ZERO; 4]), []);
        assert_eq!(star([DVec2::X, -DVec2::X, 2.0 * DVec2::X]), []);
        let doubled = [DVec2::ZERO].into_iter().chain(ring(5, 1.0, 0.0)).chain(ring(5, 1.0, 0.0));
        assert_eq!(star(doubled).len(), 5);
    }
}
