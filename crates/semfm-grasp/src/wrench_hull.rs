//! The distance from the origin to the boundary of a convex hull in six dimensions.

/// A force and a torque.
pub(crate) type Wrench = [f64; 6];

/// Points nearer to a facet than this do not change it, relative to the largest point.
const TOLERANCE: f64 = 1e-9;

/// Points are moved by this (relative to the largest) before the hull is built, each by another
/// amount: wrenches of cones are full of coplanar groups, on which facets have no normal.
const JOGGLE: f64 = 1e-5;

/// Stops where rounding would let the hull grow for ever, with a radius that is then too small;
/// hulls of two contacts take below 400.
const MOST_FACETS: usize = 4000;

/// A facet of the hull: six corners, `normal · x ≤ offset` inside.
struct Facet {
    corners: [usize; 6],
    normal: Wrench,
    offset: f64,
}

/// Radius of the largest ball around the origin that the convex hull of `points` holds; 0 where the
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
    let Some(simplex) = first_simplex(&points, scale) else { return 0.0 };
    let centre: Wrench =
        std::array::from_fn(|d| simplex.iter().map(|&i| points[i][d]).sum::<f64>() / 7.0);
    let facet = |corners: [usize; 6]| Facet::new(corners, &points, &centre);
    let mut facets: Vec<Facet> = (0..7)
        .filter_map(|left_out| {
            let mut corners = simplex.iter().enumerate().filter(|(k, _)| *k != left_out);
            facet(std::array::from_fn(|_| corners.next().map_or(0, |(_, &i)| i)))
        })
        .collect();
    loop {
        let Some(nearest) = facets.iter().min_by(|a, b| a.offset.total_cmp(&b.offset)) else {
            return 0.0;
        };
        let along = |p: &Wrench| dot(&nearest.normal, p);
        let Some((apex, reach)) = points
            .iter()
            .map(along)
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
        else {
            return 0.0;
        };
        if reach <= nearest.offset + TOLERANCE * scale || facets.len() > MOST_FACETS {
            return nearest.offset.max(0.0);
        }
        let (seen, kept): (Vec<Facet>, Vec<Facet>) = facets
            .into_iter()
            .partition(|f| dot(&f.normal, &points[apex]) > f.offset + 1e-13 * scale);
        facets = kept;
        facets.extend(horizon(&seen).into_iter().filter_map(|ridge| {
            let mut corners = [apex; 6];
            corners[..5].copy_from_slice(&ridge);
            facet(corners)
        }));
    }
}

/// Ridges (five points each) between what the apex sees and what it does not: those that belong to
/// one seen facet only.
fn horizon(seen: &[Facet]) -> Vec<[usize; 5]> {
    let mut ridges: Vec<[usize; 5]> = seen
        .iter()
        .flat_map(|facet| {
            (0..6).map(|left_out| {
                let mut rest = (0..6).filter(|&k| k != left_out).map(|k| facet.corners[k]);
                let mut ridge = std::array::from_fn(|_| rest.next().unwrap_or(0));
                ridge.sort_unstable();
                ridge
            })
        })
        .collect();
    ridges.sort_unstable();
    ridges.chunk_by(|a, b| a == b).filter(|group| group.len() == 1).map(|group| group[0]).collect()
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

impl Facet {
    /// The plane through six points with `inside` below it; `None` where they span less.
    fn new(corners: [usize; 6], points: &[Wrench], inside: &Wrench) -> Option<Self> {
        let base = points[corners[0]];
        let mut rows: [Wrench; 5] =
            std::array::from_fn(|r| std::array::from_fn(|d| points[corners[r + 1]][d] - base[d]));
        let normal = null_vector(&mut rows)?;
        let offset = dot(&normal, &base);
        let flip = if dot(&normal, inside) > offset { -1.0 } else { 1.0 };
        Some(Self { corners, normal: normal.map(|x| flip * x), offset: flip * offset })
    }
}

/// The unit vector orthogonal to five rows, by elimination with full pivoting.
fn null_vector(rows: &mut [Wrench; 5]) -> Option<Wrench> {
    let mut columns = [0, 1, 2, 3, 4, 5];
    for k in 0..5 {
        let (mut best, mut place) = (0.0, (k, k));
        for (r, row) in rows.iter().enumerate().skip(k) {
            for (c, &column) in columns.iter().enumerate().skip(k) {
                if row[column].abs() > best {
                    (best, place) = (row[column].abs(), (r, c));
                }
            }
        }
        if best < 1e-300 {
            return None;
        }
        rows.swap(k, place.0);
        columns.swap(k, place.1);
        let pivot = rows[k];
        for row in rows.iter_mut().skip(k + 1) {
            let factor = row[columns[k]] / pivot[columns[k]];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    let mut x = [0.0; 6];
    x[columns[5]] = 1.0;
    for k in (0..5).rev() {
        let sum: f64 = (k + 1..6).map(|c| rows[k][columns[c]] * x[columns[c]]).sum();
        x[columns[k]] = -sum / rows[k][columns[k]];
    }
    let length = dot(&x, &x).sqrt();
    length.is_finite().then(|| x.map(|x| x / length))
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
                    let corners = std::array::from_fn(|_| members.next().unwrap());
                    let inside: Wrench =
                        std::array::from_fn(|d| points.iter().map(|p| p[d]).sum::<f64>() / 12.0);
                    let facet = Facet::new(corners, &points, &inside).unwrap();
                    if support(&facet.normal) <= facet.offset + 1e-9 {
                        least = least.min(facet.offset);
                    }
                }
            }
            assert!((found - least.max(0.0)).abs() < 1e-4, "{found} instead of {least}");
        }
    }
}
