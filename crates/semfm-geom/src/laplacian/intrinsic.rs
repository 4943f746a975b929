//! A triangulation known by its edge lengths alone, and its flip to Delaunay.
//!
//! No positions: triangles may stand for anything whose sides obey the triangle inequality. That
//! is what makes the tufted cover possible, and what lets an edge be flipped *within* the surface
//! without moving it (Bobenko & Springborn 2007).

use std::collections::VecDeque;

use super::assembly::WeightedEdge;

/// An edge whose cotangent weight is below −`DELAUNAY_TOLERANCE` is flipped. Zero would let
/// rounding flip the diagonal of a square for ever; 1e-6 is what the authors' own code uses, and
/// anything above it shows as negative weights of that size.
const DELAUNAY_TOLERANCE: f64 = 1e-6;

/// Flips allowed per half-edge before the search for Delaunay gives up. Flipping ends by itself in
/// exact arithmetic, mostly within one flip per edge; the cap stands against cycles by rounding,
/// and what is left is still a Laplacian, only with some negative weights.
const FLIPS_PER_HALFEDGE: usize = 20;

/// Triangles glued along half-edges, without boundary.
///
/// Half-edge h = 3·triangle + k runs from `tail[h]` to the tail of the next half-edge of the same
/// triangle; `twin[h]` is the half-edge on the other side, and both carry the same `length`.
pub(super) struct IntrinsicTriangulation {
    /// Vertex at which each half-edge starts (3 m).
    pub tail: Vec<u32>,
    /// The half-edge on the other side (3 m).
    pub twin: Vec<u32>,
    /// Length of the edge (3 m).
    pub length: Vec<f64>,
}

fn next(h: usize) -> usize {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

fn previous(h: usize) -> usize {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// Four times the area of a triangle with these sides (Heron), 0 where they make none.
pub(super) fn quadruple_area(a: f64, b: f64, c: f64) -> f64 {
    ((a + b + c) * (b + c - a) * (c + a - b) * (a + b - c)).max(0.0).sqrt()
}

/// One side of an edge: with the angle θ across it, cos θ / sin θ = `cosine` / `sine`.
#[derive(Clone, Copy)]
struct Corner {
    cosine: f64,
    sine: f64,
}

impl Corner {
    /// cot θ; 0 in a triangle without area.
    fn cotangent(self) -> f64 {
        if self.sine > 0.0 { self.cosine / self.sine } else { 0.0 }
    }
}

/// Where the half-edge of `slot` goes by a list of (from, to); itself where it is not in it.
fn moved(slot: usize, turn: &[(usize, usize)]) -> usize {
    turn.iter().find(|(from, _)| *from == slot).map_or(slot, |(_, to)| *to)
}

impl IntrinsicTriangulation {
    /// Number of triangles m.
    pub fn n_triangles(&self) -> usize {
        self.twin.len() / 3
    }

    fn corner(&self, h: usize) -> Corner {
        let (a, b, c) = (self.length[h], self.length[next(h)], self.length[previous(h)]);
        Corner { cosine: b * b + c * c - a * a, sine: quadruple_area(a, b, c) }
    }

    /// Flips edges until each has a cotangent weight (cot α + cot β) / 2 that is not negative.
    /// Returns the number of flips.
    ///
    /// An edge between a triangle and itself stays, and so does one whose flip would have no
    /// finite length.
    pub fn flip_to_delaunay(&mut self) -> usize {
        let n_halfedges = self.twin.len();
        let mut queued = vec![false; n_halfedges];
        let mut queue = VecDeque::new();
        let mut n_flips = 0;
        for h in 0..n_halfedges {
            if h < self.twin[h] as usize && self.flip_if_needed(h) {
                n_flips += 1;
                self.enqueue_around(h, &mut queue, &mut queued);
            }
        }
        while let Some(h) = queue.pop_front() {
            queued[h as usize] = false;
            if self.flip_if_needed(h as usize) {
                n_flips += 1;
                self.enqueue_around(h as usize, &mut queue, &mut queued);
            }
            if n_flips > FLIPS_PER_HALFEDGE * n_halfedges {
                break;
            }
        }
        n_flips
    }

    /// A flip can only disturb the four edges around the two triangles that it changed.
    ///
    /// Half-edges move between slots as their triangles are rewritten, so an older entry of the
    /// queue may now name another edge; every moved edge is entered anew here, so none is lost.
    fn enqueue_around(&self, h: usize, queue: &mut VecDeque<u32>, queued: &mut [bool]) {
        let other = self.twin[h] as usize;
        for side in [next(h), previous(h), next(other), previous(other)] {
            let slot = side.min(self.twin[side] as usize);
            if !std::mem::replace(&mut queued[slot], true) {
                queue.push_back(slot as u32);
            }
        }
    }

    fn flip_if_needed(&mut self, h: usize) -> bool {
        let other = self.twin[h] as usize;
        if h / 3 == other / 3 {
            return false;
        }
        let (near, far) = (self.corner(h), self.corner(other));
        // (cot α + cot β) / 2 < −ε, without the divisions.
        let (sum, product) =
            (near.cosine * far.sine + far.cosine * near.sine, near.sine * far.sine);
        if sum >= -2.0 * DELAUNAY_TOLERANCE * product {
            return false;
        }
        // Lay both triangles out along the edge: their apexes are the ends of the new edge.
        let length = self.length[h];
        let above = self.apex_along(h, previous(h), next(h));
        let below = self.apex_along(h, next(other), previous(other));
        let height = (near.sine + far.sine) / (2.0 * length);
        let flipped = (above - below).hypot(height);
        if !(flipped.is_finite() && flipped > 0.0) {
            return false;
        }
        self.flip(h, flipped);
        true
    }

    /// How far along edge `h` the apex of a triangle on it lies, seen from the tail:
    /// (ℓ² + p² − q²) / 2ℓ, with p its side at the tail and q its side at the tip.
    fn apex_along(&self, h: usize, side_at_tail: usize, side_at_tip: usize) -> f64 {
        let [length, p, q] = [h, side_at_tail, side_at_tip].map(|side| self.length[side]);
        (length * length + p * p - q * q) / (2.0 * length)
    }

    /// Replaces the diagonal a→b of the quadrilateral a d b c by d→c.
    fn flip(&mut self, h: usize, length: f64) {
        //      c                   c
        //     / \                 /|\
        //    a → b    becomes    a ↑ b      (the half-edge h, its twin against it)
        //     \ /                 \|/
        //      d                   d
        let other = self.twin[h] as usize;
        let (bc, ca, ad, db) = (next(h), previous(h), next(other), previous(other));
        let (c, d) = (self.tail[ca], self.tail[db]);
        let (a, b) = (self.tail[h], self.tail[other]);
        // The sides turn by one slot: h's triangle becomes d→c, c→a, a→d, the other c→d, d→b, b→c.
        let turn = [(ca, bc), (ad, ca), (db, ad), (bc, db)];
        let sides = [bc, ca, ad, db]
            .map(|s| (moved(s, &turn), moved(self.twin[s] as usize, &turn), self.length[s]));
        for (slot, twin, side_length) in sides {
            self.twin[slot] = twin as u32;
            self.twin[twin] = slot as u32;
            self.length[slot] = side_length;
        }
        (self.length[h], self.length[other]) = (length, length);
        (self.tail[h], self.tail[bc], self.tail[ca]) = (d, c, a);
        (self.tail[other], self.tail[ad], self.tail[db]) = (c, d, b);
    }

    /// The cotangent weight (cot α + cot β) / 2 of every edge; a triangle without area adds none.
    pub fn weighted_edges(&self) -> Vec<WeightedEdge> {
        (0..self.twin.len())
            .filter(|&h| h < self.twin[h] as usize)
            .map(|h| {
                let other = self.twin[h] as usize;
                let weight = 0.5 * (self.corner(h).cotangent() + self.corner(other).cotangent());
                WeightedEdge { ends: [self.tail[h], self.tail[other]], weight }
            })
            .collect()
    }

    /// A third of the area of the triangles around each of `n` vertices.
    pub fn vertex_areas(&self, n: usize) -> Vec<f64> {
        let mut areas = vec![0.0; n];
        for (sides, tails) in self.length.chunks_exact(3).zip(self.tail.chunks_exact(3)) {
            let third = quadruple_area(sides[0], sides[1], sides[2]) / 12.0;
            tails.iter().for_each(|&id| areas[id as usize] += third);
        }
        areas
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pillow over the kite (0, 0), (±2, .5)-ish: two flat sheets glued along their rim, cut
    /// along the long diagonal, which is not Delaunay.
    fn pillow() -> IntrinsicTriangulation {
        let (long, side) = (4.0, (4.0f64 + 0.25).sqrt());
        // Sheet one: triangles 0 1 2 and 1 0 3; sheet two their mirror images.
        IntrinsicTriangulation {
            tail: vec![0, 1, 2, 1, 0, 3, 1, 0, 2, 0, 1, 3],
            twin: vec![3, 8, 7, 0, 11, 10, 9, 2, 1, 6, 5, 4],
            length: [long, side, side].repeat(4),
        }
    }

    #[test]
    fn the_long_diagonal_of_a_kite_gives_way_to_the_short_one() {
        let mut kite = pillow();
        let areas: f64 = kite.vertex_areas(4).iter().sum();
        assert_eq!(kite.flip_to_delaunay(), 2);
        assert!((kite.vertex_areas(4).iter().sum::<f64>() - areas).abs() < 1e-12);
        for h in 0..12 {
            let twin = kite.twin[h] as usize;
            assert_eq!(kite.twin[twin] as usize, h, "gluing is mutual");
            assert_eq!(kite.tail[twin], kite.tail[next(h)], "glued edges have the same ends");
            assert_eq!(kite.length[twin], kite.length[h]);
        }
        assert!(kite.weighted_edges().iter().all(|edge| edge.weight >= -DELAUNAY_TOLERANCE));
        assert!(kite.length.iter().all(|&length| length < 2.1), "the short diagonal has length 1");
    }
}
