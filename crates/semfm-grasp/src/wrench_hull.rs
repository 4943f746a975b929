//! The distance from the origin to the boundary of a convex hull in six dimensions.

/// A force and a torque.
pub(crate) type Wrench = [f64; 6];

/// Points nearer to a facet than this do not change it, relative to the largest point.
const TOLERANCE: f64 = 1e-9;

/// Points are moved by this (relative to the largest) before the hull is built, each by another
/// amount: wrenches of cones are full of coplanar groups, on which facets have no normal.
const JOGGLE: f64 = 1e-5;

/// Stops after so many rounds for each point, where rounding would let the hull grow for ever: a round makes a point a
/// corner, and without rounding no point twice. The radius is then that of the hull so far, which may be too small.
const MOST_ROUNDS: usize = 4;

/// A plane between two others is taken from them unless it is shorter than this, that is unless they are nearly opposite.
const LEAST_BETWEEN: f64 = 1e-3;

/// Across a ridge of a facet whose neighbour had no plane.
const NO_FACET: u32 = u32::MAX;

/// Bits of a point's number within a packed list of them; four fit into 64.
const POINT_BITS: u32 = 16;

/// A facet of the hull: six corners, `normal · x ≤ offset` inside.
#[derive(Clone, Copy)]
struct Facet {
    corners: [u16; 6],
    /// Across the ridge opposite each corner.
    neighbours: [u32; 6],
    plane: Plane,
    /// Whether the plane is that of the corners themselves; else it was taken from its neighbours' and may be off by some
    /// roundings.
    is_exact: bool,
}

/// All x with `normal · x = offset`.
#[derive(Clone, Copy)]
struct Plane {
    normal: Wrench,
    offset: f64,
}

/// The hull of some of the points, as it grows.
struct Hull<'a> {
    points: &'a [Wrench],
    /// A point inside.
    centre: Wrench,
    /// Facets of the hull, and former ones.
    facets: Vec<Facet>,
    /// Offsets of their planes; infinite for former facets.
    offsets: Vec<f64>,
    /// Places of former facets.
    free: Vec<u32>,
    /// What the last point sees: ids, and for each facet whether it is one of them.
    seen: Vec<u32>,
    is_seen: Vec<bool>,
    /// Ridges around that: a facet of it, and which corner lies opposite.
    rim: Vec<(u32, u8)>,
    /// Ridges of the latest facets that end in the apex: four corners, the facet, and which corner lies opposite.
    ridges: Vec<(u64, u32, u8)>,
}

/// Radius of the largest ball around the origin that the convex hull of `points` (fewer than 65,536) holds; 0 where the
/// origin lies outside or the hull is flat.
///
/// The facet nearest to the origin is expanded by the point farthest along its normal until none
/// lies farther: then the facet is one of the hull, and no facet of the hull is nearer (the
/// expanding polytope of van den Bergh 2001 in six dimensions; for grasps see Zheng 2013, "An
/// efficient algorithm for a grasp quality measure").
pub(crate) fn inner_radius(points: &[Wrench]) -> f64 {
    let scale = points.iter().map(|p| dot(p, p).sqrt()).fold(0.0, f64::max);
    if scale <= 0.0 || !scale.is_finite() {
        return 0.0;
    }
    let points: Vec<Wrench> =
        points.iter().enumerate().map(|(i, p)| joggled(p, i, scale)).collect();
    let Some(simplex) = first_simplex(&points, scale) else {
        return 0.0;
    };
    let mut hull = Hull::of_simplex(&points, &simplex);
    let mut radius = 0.0;
    for _ in 0..MOST_ROUNDS * points.len() {
        let Some((first, Plane { normal, offset })) = hull.nearest() else { return 0.0 };
        radius = offset.max(0.0);
        let heights = points.iter().map(|p| dot(&normal, p)).enumerate();
        let farthest = heights.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((apex, _)) = farthest.filter(|(_, reach)| *reach > offset + TOLERANCE * scale)
        else {
            break;
        };
        hull.expand(apex as u16, first, 1e-13 * scale);
    }
    radius
}

impl<'a> Hull<'a> {
    /// Of seven points.
    fn of_simplex(points: &'a [Wrench], simplex: &[usize]) -> Self {
        let centre =
            std::array::from_fn(|d| simplex.iter().map(|&i| points[i][d]).sum::<f64>() / 7.0);
        let (facets, offsets) = (Vec::with_capacity(512), Vec::with_capacity(512));
        let (free, seen, is_seen, rim, ridges) = Default::default();
        let mut hull = Self { points, centre, facets, offsets, free, seen, is_seen, rim, ridges };
        for left_out in 0..7 {
            let others = |k: usize| if k < left_out { k } else { k + 1 };
            let corners = std::array::from_fn(|k| simplex[others(k)] as u16);
            let neighbours = std::array::from_fn(|k| others(k) as u32);
            let plane = hull.plane_of(&corners).unwrap_or(Plane::NONE);
            hull.facets.push(Facet { corners, neighbours, plane, is_exact: true });
            hull.offsets.push(plane.offset);
        }
        hull
    }

    /// The plane through six points with the inside below it; `None` where they span less.
    fn plane_of(&self, corners: &[u16; 6]) -> Option<Plane> {
        Plane::through(corners.map(|i| self.points[usize::from(i)]), &self.centre)
    }

    /// The facet nearest to the origin, its plane that of its corners; `None` where there is no facet.
    fn nearest(&mut self) -> Option<(u32, Plane)> {
        loop {
            let offsets = self.offsets.iter().copied().enumerate();
            let (at, least) = offsets.min_by(|a, b| a.1.total_cmp(&b.1))?;
            let facet = self.facets[at];
            if least == f64::INFINITY || facet.is_exact {
                return (least < f64::INFINITY).then_some((at as u32, facet.plane));
            }
            let plane = self.plane_of(&facet.corners);
            self.offsets[at] = plane.map_or(f64::INFINITY, |plane| plane.offset);
            self.facets[at].is_exact = true;
            self.facets[at].plane = plane.unwrap_or(facet.plane);
        }
    }

    /// Replaces all facets that the point `apex` sees, one of which is `first`, by those between it and the rim of what it
    /// sees.
    fn expand(&mut self, apex: u16, first: u32, least: f64) {
        let p = self.points[usize::from(apex)];
        // What a point sees of a convex surface hangs together.
        self.seen.clear();
        self.seen.push(first);
        self.is_seen.clear();
        self.is_seen.resize(self.facets.len(), false);
        self.is_seen[first as usize] = true;
        self.rim.clear();
        let mut at = 0;
        while at < self.seen.len() {
            let seen = self.seen[at];
            at += 1;
            for (k, beyond) in self.facets[seen as usize].neighbours.into_iter().enumerate() {
                if beyond != NO_FACET && self.is_seen[beyond as usize] {
                    continue;
                }
                if beyond != NO_FACET && self.facets[beyond as usize].plane.height(&p) > least {
                    self.is_seen[beyond as usize] = true;
                    self.seen.push(beyond);
                } else {
                    self.rim.push((seen, k as u8));
                }
            }
        }
        self.ridges.clear();
        for at in 0..self.rim.len() {
            let (seen, k) = self.rim[at];
            self.add_between(seen, usize::from(k), apex);
        }
        for &seen in &self.seen {
            self.offsets[seen as usize] = f64::INFINITY;
        }
        self.free.extend(&self.seen);
        self.join();
    }

    /// Adds the facet between `apex` and the ridge of a seen facet opposite its corner `k`.
    fn add_between(&mut self, seen: u32, k: usize, apex: u16) {
        let old = self.facets[seen as usize];
        let beyond = old.neighbours[k];
        let p = &self.points[usize::from(apex)];
        let mut facet = Facet { is_exact: false, ..old };
        facet.corners[k] = apex;
        facet.neighbours = [NO_FACET; 6];
        facet.neighbours[k] = beyond;
        let between = (beyond != NO_FACET)
            .then(|| Plane::between(&old.plane, &self.facets[beyond as usize].plane, p))
            .flatten();
        facet.plane = match between {
            Some(plane) => plane,
            None => {
                facet.is_exact = true;
                let Some(plane) = self.plane_of(&facet.corners) else {
                    self.replace(beyond, seen, NO_FACET);
                    return;
                };
                plane
            }
        };
        // What this apex sees is still read: places become free after it.
        let id = self.free.pop().unwrap_or(self.facets.len() as u32);
        if id as usize == self.facets.len() {
            self.facets.push(facet);
            self.offsets.push(facet.plane.offset);
        } else {
            self.facets[id as usize] = facet;
            self.offsets[id as usize] = facet.plane.offset;
        }
        self.replace(beyond, seen, id);
        for other in (0..6).filter(|&other| other != k) {
            self.ridges.push((ridge(&facet.corners, k, other), id, other as u8));
        }
    }

    /// Makes `id` the neighbour of `facet` where it was `old`.
    fn replace(&mut self, facet: u32, old: u32, id: u32) {
        if facet != NO_FACET {
            let neighbours = &mut self.facets[facet as usize].neighbours;
            neighbours.iter_mut().filter(|neighbour| **neighbour == old).for_each(|n| *n = id);
        }
    }

    /// Makes neighbours of the new facets that share a ridge.
    fn join(&mut self) {
        self.ridges.sort_unstable();
        for pair in self.ridges.chunk_by(|a, b| a.0 == b.0) {
            if let &[(_, one, k), (_, other, l)] = pair {
                self.facets[one as usize].neighbours[usize::from(k)] = other;
                self.facets[other as usize].neighbours[usize::from(l)] = one;
            }
        }
    }
}

/// The four corners but the `k`-th and the `other`-th, ascending, in one number.
fn ridge(corners: &[u16; 6], k: usize, other: usize) -> u64 {
    let mut rest = (0..6).filter(|&i| i != k && i != other).map(|i| corners[i]);
    let mut four: [u16; 4] = std::array::from_fn(|_| rest.next().unwrap_or(0));
    four.sort_unstable();
    four.into_iter().fold(0, |packed, corner| packed << POINT_BITS | u64::from(corner))
}

/// Seven points that span six dimensions, each the farthest from the span of those before it.
fn first_simplex(points: &[Wrench], scale: f64) -> Option<Vec<usize>> {
    let mut chosen = vec![0];
    let mut basis: Vec<Wrench> = Vec::new();
    while basis.len() < 6 {
        let beyond = |p: &Wrench| {
            let mut rest: Wrench = std::array::from_fn(|d| p[d] - points[0][d]);
            for b in &basis {
                let along = dot(b, &rest);
                rest.iter_mut().zip(b).for_each(|(x, b)| *x -= along * b);
            }
            rest
        };
        let (i, rest) = points
            .iter()
            .map(beyond)
            .enumerate()
            .max_by(|a, b| dot(&a.1, &a.1).total_cmp(&dot(&b.1, &b.1)).then(b.0.cmp(&a.0)))?;
        let length = dot(&rest, &rest).sqrt();
        // Flat but for the joggle is flat.
        if length <= 10.0 * JOGGLE * scale {
            return None;
        }
        chosen.push(i);
        basis.push(rest.map(|x| x / length));
    }
    Some(chosen)
}

impl Plane {
    /// Of corners that span none: seen by no point, and farther from the origin than all others.
    const NONE: Self = Self { normal: [0.0; 6], offset: f64::INFINITY };

    /// The plane through six points with `inside` below it; `None` where they span less.
    fn through(corners: [Wrench; 6], inside: &Wrench) -> Option<Self> {
        let base = corners[0];
        let mut rows: [Wrench; 5] =
            std::array::from_fn(|r| std::array::from_fn(|d| corners[r + 1][d] - base[d]));
        let normal = null_vector(&mut rows)?;
        let offset = dot(&normal, &base);
        let flip = if dot(&normal, inside) > offset { -1.0 } else { 1.0 };
        Some(Self { normal: normal.map(|x| flip * x), offset: flip * offset })
    }

    /// The plane through `p` and what two planes share, of which the first is seen from `p` and the second is not:
    ///
    /// > h₁ (n₂, d₂) − h₂ (n₁, d₁), with hᵢ = nᵢ · p − dᵢ.
    ///
    /// `None` where the two are nearly opposite.
    fn between(seen: &Self, other: &Self, p: &Wrench) -> Option<Self> {
        let (seen_by, below) = (seen.height(p), -other.height(p));
        let mix = |one: f64, two: f64| below * one + seen_by * two;
        let normal: Wrench = std::array::from_fn(|d| mix(seen.normal[d], other.normal[d]));
        let length = dot(&normal, &normal).sqrt();
        (length > LEAST_BETWEEN * (seen_by + below.abs())).then(|| Self {
            normal: normal.map(|x| x / length),
            offset: mix(seen.offset, other.offset) / length,
        })
    }

    /// How far a point lies beyond the plane.
    fn height(&self, p: &Wrench) -> f64 {
        dot(&self.normal, p) - self.offset
    }
}

/// The unit vector orthogonal to five rows, by elimination with full pivoting.
fn null_vector(rows: &mut [Wrench; 5]) -> Option<Wrench> {
    let mut columns = [0, 1, 2, 3, 4, 5];
    for k in 0..5 {
        let (mut best, mut place) = (0.0, (k, k));
        for (r, row) in rows.iter().enumerate().skip(k) {
            for (c, x) in row.iter().enumerate().skip(k) {
                if x.abs() > best {
                    (best, place) = (x.abs(), (r, c));
                }
            }
        }
        if best < 1e-300 {
            return None;
        }
        rows.swap(k, place.0);
        if place.1 != k {
            columns.swap(k, place.1);
            rows.iter_mut().for_each(|row| row.swap(k, place.1));
        }
        let pivot = rows[k];
        for row in rows.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    // Entries in the order of the swapped columns, the last one free.
    let mut swapped = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    for k in (0..5).rev() {
        let sum: f64 = (k + 1..6).map(|c| rows[k][c] * swapped[c]).sum();
        swapped[k] = -sum / rows[k][k];
    }
    let length = dot(&swapped, &swapped).sqrt();
    let mut x = [0.0; 6];
    columns.into_iter().zip(swapped).for_each(|(column, value)| x[column] = value / length);
    length.is_finite().then_some(x)
}

/// Adds to each coordinate a number of at most `JOGGLE · scale` that depends on its place alone
/// (a Weyl sequence of the golden ratio).
fn joggled(point: &Wrench, i: usize, scale: f64) -> Wrench {
    std::array::from_fn(|d| {
        let turn = ((6 * i + d + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5;
        point[d] + 2.0 * JOGGLE * scale * turn
    })
}

fn dot(a: &Wrench, b: &Wrench) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_cross_polytope_and_a_cube_have_the_radii_of_the_textbook() {
        let mut cross = Vec::new();
        for d in 0..6 {
            for sign in [-2.0, 2.0] {
                let mut p = [0.0; 6];
                p[d] = sign;
                cross.push(p);
            }
        }
        assert!((inner_radius(&cross) - 2.0 / 6f64.sqrt()).abs() < 1e-4);
        let cube: Vec<Wrench> = (0..64)
            .map(|i| std::array::from_fn(|d| if i >> d & 1 == 0 { -1.0 } else { 1.0 }))
            .collect();
        let found = inner_radius(&cube);
        assert!((found - 1.0).abs() < 1e-4, "{found}");
        assert!(inner_radius(&cross[..11]) < 1e-4, "the origin is on the boundary");
        assert_eq!(inner_radius(&cross[..4]), 0.0, "flat");
        assert_eq!(inner_radius(&[]), 0.0);
    }

    #[test]
    fn the_radius_is_the_least_support_over_all_facets() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..5 {
            let points: Vec<Wrench> =
                (0..12).map(|_| std::array::from_fn(|_| rng.random::<f64>() - 0.45)).collect();
            let found = inner_radius(&points);
            let support = |normal: &Wrench| {
                points.iter().map(|p| dot(normal, p)).fold(f64::NEG_INFINITY, f64::max)
            };
            // Every six points whose plane has all others on one side make a facet.
            let mut least = f64::INFINITY;
            for mask in 0u32..1 << 12 {
                if mask.count_ones() == 6 {
                    let mut members = (0..12).filter(|i| mask >> i & 1 == 1);
                    let corners = std::array::from_fn(|_| points[members.next().unwrap()]);
                    let inside: Wrench =
                        std::array::from_fn(|d| points.iter().map(|p| p[d]).sum::<f64>() / 12.0);
                    let plane = Plane::through(corners, &inside).unwrap();
                    if support(&plane.normal) <= plane.offset + 1e-9 {
                        least = least.min(plane.offset);
                    }
                }
            }
            assert!((found - least.max(0.0)).abs() < 1e-4, "{found} instead of {least}");
        }
    }
}
