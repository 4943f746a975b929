//! The tufted cover: a non-manifold mesh made into a closed surface (Sharp & Crane 2020).
//!
//! Every triangle becomes two, a front and a back. Around each edge of the input, sorted by angle,
//! the side of one triangle that looks at the next is glued to the side of the next that looks
//! back. So an edge of two triangles has two layers, a boundary edge joins a triangle to its own
//! back, and an edge of a five-page book has five: all of them manifold.

use super::intrinsic::IntrinsicTriangulation;
use crate::math::DVec3;

/// The triangles around every edge.
///
/// Front half-edge h = 3·triangle + k runs from corner k to corner k + 1 (mod 3).
struct Fans {
    /// Front half-edges, those of one edge next to each other, in ascending order.
    halfedges: Vec<u32>,
    /// Where each edge begins in `halfedges`, and its end (n_edges + 1).
    starts: Vec<usize>,
}

impl Fans {
    fn new(n_vertices: usize, faces: &[[u32; 3]]) -> Self {
        let n_halfedges = 3 * faces.len();
        // Counting sort by the lower end, then a small sort by (upper end, half-edge) in each bin.
        let mut bins = vec![0usize; n_vertices + 1];
        (0..n_halfedges).for_each(|h| bins[ends(faces, h)[0] as usize + 1] += 1);
        (0..n_vertices).for_each(|v| bins[v + 1] += bins[v]);
        let mut keys = vec![0u64; n_halfedges];
        let mut fill = bins.clone();
        for h in 0..n_halfedges {
            let [low, high] = ends(faces, h);
            let slot = &mut fill[low as usize];
            keys[*slot] = u64::from(high) << 32 | h as u64;
            *slot += 1;
        }
        let mut starts = Vec::with_capacity(n_halfedges / 2);
        for bin in bins.windows(2) {
            keys[bin[0]..bin[1]].sort_unstable();
            for at in bin[0]..bin[1] {
                if at == bin[0] || keys[at] >> 32 != keys[at - 1] >> 32 {
                    starts.push(at);
                }
            }
        }
        starts.push(n_halfedges);
        Self { halfedges: keys.into_iter().map(|key| key as u32).collect(), starts }
    }

    fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|range| &self.halfedges[range[0]..range[1]])
    }
}

/// The ends of front half-edge h, lower id first.
fn ends(faces: &[[u32; 3]], h: usize) -> [u32; 2] {
    let face = faces[h / 3];
    let (tail, tip) = (face[h % 3], face[(h + 1) % 3]);
    [tail.min(tip), tail.max(tip)]
}

/// The tufted cover of a triangle soup, its edge lengths mollified; `None` where all edges have
/// length zero.
///
/// Every face must name three different vertices. Triangle f = a b c of the input becomes the
/// triangles 2f = a b c (front) and 2f + 1 = b a c (back) of the cover.
///
/// Mollification (ibid.): all edges grow by the smallest common length that gives each
/// triangle a slack of `mollify_factor` mean edges in its triangle inequality.
pub(super) fn tufted_cover(
    points: &[DVec3],
    faces: &[[u32; 3]],
    mollify_factor: f64,
) -> Option<IntrinsicTriangulation> {
    let fans = Fans::new(points.len(), faces);
    let mut cover = IntrinsicTriangulation {
        tail: faces.iter().flat_map(|&[a, b, c]| [a, b, c, b, a, c]).collect(),
        twin: vec![0; 6 * faces.len()],
        length: vec![0.0; 6 * faces.len()],
    };
    let mut lengths = vec![0.0; 3 * faces.len()];
    let (mut total, mut n_edges) = (0.0, 0);
    let (mut by_angle, mut sorted) = (Vec::new(), Vec::new());
    for fan in fans.iter() {
        let first = fan[0] as usize;
        let (tail, tip) = (faces[first / 3][first % 3], faces[first / 3][(first + 1) % 3]);
        let length = points[tail as usize].distance(points[tip as usize]);
        fan.iter().for_each(|&h| lengths[h as usize] = length);
        total += length;
        n_edges += 1;
        if fan.len() > 2 {
            sort_by_angle(points, faces, fan, &mut by_angle);
            sorted.clear();
            sorted.extend(by_angle.iter().map(|&(_, h)| h));
            glue(&mut cover, &sorted, tail);
        } else {
            glue(&mut cover, fan, tail);
        }
    }
    if total <= 0.0 {
        return None;
    }
    let growth = mollification(&lengths, mollify_factor * total / n_edges as f64);
    for (sides, double) in lengths.chunks_exact(3).zip(cover.length.chunks_exact_mut(6)) {
        let [ab, bc, ca] = [0, 1, 2].map(|k| sides[k] + growth);
        double.copy_from_slice(&[ab, bc, ca, ab, ca, bc]);
    }
    Some(cover)
}

/// Where front half-edge h lies in the cover, whose triangles alternate between front and back.
fn front(h: u32) -> usize {
    let h = h as usize;
    h + h / 3 * 3
}

/// The same edge on the other sheet of the same triangle, running the other way.
fn mirror(h: usize) -> usize {
    h - h % 6 + [3, 5, 4, 0, 2, 1][h % 6]
}

/// Glues the triangles around one edge into a ring, each to the next; `tail` is the end from which
/// the edge is seen.
///
/// With the triangles in order of falling angle, a half-edge that runs against the edge is on the
/// side that looks towards the next triangle. For one or two triangles every order is the same.
fn glue(cover: &mut IntrinsicTriangulation, fan: &[u32], tail: u32) {
    let mut current = front(fan[0]);
    if cover.tail[current] == tail {
        current = mirror(current);
    }
    for i in 0..fan.len() {
        let mut next = front(fan[(i + 1) % fan.len()]);
        if cover.tail[next] != tail {
            next = mirror(next);
        }
        cover.twin[current] = next as u32;
        cover.twin[next] = current as u32;
        current = mirror(next);
    }
}

/// The half-edges of a fan by falling angle of their triangles around the edge.
///
/// Copies of one triangle have the same angle. Their order decides what is glued to what, so it
/// is fixed: the first, then from the last to the second, as the authors' code meets them.
fn sort_by_angle(
    points: &[DVec3],
    faces: &[[u32; 3]],
    fan: &[u32],
    by_angle: &mut Vec<(f64, u32)>,
) {
    let [tail, tip, _] = corners_from(points, faces, fan[0]);
    let axis = (tip - tail).normalize_or(DVec3::Z);
    let right = axis.any_orthonormal_vector();
    let up = axis.cross(right);
    let met = std::iter::once(fan[0]).chain(fan[1..].iter().rev().copied());
    by_angle.clear();
    by_angle.extend(met.map(|h| {
        let [_, _, opposite] = corners_from(points, faces, h);
        let out = opposite - tail;
        (up.dot(out).atan2(right.dot(out)), h)
    }));
    by_angle.sort_by(|a, b| b.0.total_cmp(&a.0));
}

/// The corners of the triangle of half-edge h: its tail, its tip, and the one opposite.
fn corners_from(points: &[DVec3], faces: &[[u32; 3]], h: u32) -> [DVec3; 3] {
    let h = h as usize;
    [0, 1, 2].map(|k| points[faces[h / 3][(h + k) % 3] as usize])
}

/// The length by which all edges must grow so that the sides a, b, c of each triangle keep
/// a + b − c ≥ `slack`: the largest 2 max(a, b, c) − (a + b + c) + `slack`.
fn mollification(lengths: &[f64], slack: f64) -> f64 {
    let mut growth = 0.0f64;
    for sides in lengths.chunks_exact(3) {
        let longest = sides[0].max(sides[1]).max(sides[2]);
        growth = growth.max(2.0 * longest - (sides[0] + sides[1] + sides[2]) + slack);
    }
    growth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::zoo;

    fn whole_faces(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
        faces.iter().copied().filter(|&[a, b, c]| a != b && b != c && c != a).collect()
    }

    #[test]
    fn the_cover_is_closed_and_its_gluing_matches_ends_and_lengths() {
        for (name, mesh) in zoo::all() {
            let faces = whole_faces(mesh.faces());
            let cover = tufted_cover(mesh.vertices(), &faces, 1e-5).unwrap();
            for h in 0..cover.twin.len() {
                let twin = cover.twin[h] as usize;
                assert_eq!(cover.twin[twin] as usize, h, "{name}: gluing is mutual");
                assert_ne!(twin, h, "{name}: no edge is glued to itself");
                let [tip, twin_tip] = [h, twin].map(|h| cover.tail[h - h % 3 + (h + 1) % 3]);
                assert_eq!((cover.tail[twin], twin_tip), (tip, cover.tail[h]), "{name}");
                assert_eq!(cover.length[twin], cover.length[h], "{name}");
            }
        }
    }

    #[test]
    fn neighbours_in_a_book_look_at_each_other() {
        // Three pages around the z axis at 0°, 120° and 240°, wound alike.
        let [a, b, c] = [0.0f64, 120.0, 240.0]
            .map(|angle| DVec3::new(angle.to_radians().cos(), angle.to_radians().sin(), 0.0));
        let points = [DVec3::ZERO, DVec3::Z, a, b, c];
        let cover = tufted_cover(&points, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]], 1e-5).unwrap();
        // The front of a page a→b at angle θ has its normal towards growing θ, so it faces the
        // back of the next page.
        assert_eq!([cover.twin[0], cover.twin[6], cover.twin[12]], [9, 15, 3]);
        // The rim of each page joins its own back.
        assert_eq!((cover.twin[1], cover.twin[2]), (5, 4));
    }

    #[test]
    fn a_flat_triangle_gets_its_slack() {
        let growth = mollification(&[1.0, 1.0, 2.0, 3.0, 4.0, 5.0], 0.1);
        assert!((growth - 0.1).abs() < 1e-15);
        assert_eq!(mollification(&[3.0, 4.0, 5.0], 0.1), 0.0);
    }
}
