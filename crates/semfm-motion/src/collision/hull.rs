//! A convex polyhedron that answers quickly which of its corners lies farthest in a direction.

use semfm_geom::math::DVec3;

/// Up to so many corners are all looked at: a table saves nothing.
const FEW: usize = 12;

/// Cells along each edge of the six faces of the cube of directions. With 8, a hull of 400 corners keeps some 10
/// candidates a cell; with 4 some 25; with 16 the tables of an arm no longer fit a core's second cache.
const N_CELLS: usize = 8;

/// Corners of a convex polyhedron, with the candidates for each of 6 · 8² cells of directions.
///
/// A corner v is left out of a cell where some other w is farther in all four corner directions c of the cell,
/// w · c > v · c: every direction of the cell is a sum of these with positive factors, so w is farther there too.
#[derive(Clone, Debug)]
pub(crate) struct Hull {
    corners: Vec<DVec3>,
    /// Where the candidates of each cell start in `candidates`, and one number more; empty for few corners.
    starts: Vec<u32>,
    candidates: Vec<DVec3>,
}

impl Hull {
    /// The hull of at least one point; points inside of it do no harm.
    pub(crate) fn new(corners: Vec<DVec3>) -> Self {
        let (mut starts, mut candidates) = (Vec::new(), Vec::new());
        if corners.len() > FEW {
            for cell in 0..6 * N_CELLS * N_CELLS {
                starts.push(candidates.len() as u32);
                push_candidates(&corners, cell, &mut candidates);
            }
            starts.push(candidates.len() as u32);
        }
        Self { corners, starts, candidates }
    }

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The corner farthest in a direction of any length.
    pub(crate) fn farthest(&self, direction: DVec3) -> DVec3 {
        if self.starts.is_empty() {
            return farthest_of(&self.corners, direction);
        }
        let cell = cell_of(direction);
        let (from, to) = (self.starts[cell] as usize, self.starts[cell + 1] as usize);
        farthest_of(&self.candidates[from..to], direction)
    }
}

fn farthest_of(points: &[DVec3], direction: DVec3) -> DVec3 {
    let mut best = (f64::NEG_INFINITY, points[0]);
    for &p in points {
        let along = p.dot(direction);
        if along > best.0 {
            best = (along, p);
        }
    }
    best.1
}

/// The cell of a direction: the face of the cube that it crosses, and where. Zero and NaN fall in some cell.
fn cell_of(direction: DVec3) -> usize {
    let size = direction.abs();
    let (axis, u, v) = if size.x >= size.y && size.x >= size.z {
        (0, direction.y / size.x, direction.z / size.x)
    } else if size.y >= size.z {
        (1, direction.z / size.y, direction.x / size.y)
    } else {
        (2, direction.x / size.z, direction.y / size.z)
    };
    let face = 2 * axis + usize::from(direction[axis] < 0.0);
    let place = |t: f64| (((t + 1.0) * (N_CELLS as f64 / 2.0)) as usize).min(N_CELLS - 1);
    (face * N_CELLS + place(u)) * N_CELLS + place(v)
}

/// The four corner directions of a cell, grown by a hair so that rounding in [`cell_of`] puts none outside.
fn corner_directions(cell: usize) -> [DVec3; 4] {
    let (face, u, v) = (cell / (N_CELLS * N_CELLS), cell / N_CELLS % N_CELLS, cell % N_CELLS);
    let axis = face / 2;
    let sign = if face % 2 == 1 { -1.0 } else { 1.0 };
    [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[du, dv]| {
        let place = |i: usize, d: usize| {
            2.0 * (i + d) as f64 / N_CELLS as f64 - 1.0 + if d == 0 { -1e-9 } else { 1e-9 }
        };
        let mut direction = DVec3::ZERO;
        direction[axis] = sign;
        direction[(axis + 1) % 3] = place(u, du);
        direction[(axis + 2) % 3] = place(v, dv);
        direction
    })
}

fn push_candidates(corners: &[DVec3], cell: usize, candidates: &mut Vec<DVec3>) {
    let directions = corner_directions(cell);
    let scores = |p: DVec3| directions.map(|direction| p.dot(direction));
    let middle = directions.iter().sum::<DVec3>();
    let rivals: Vec<[f64; 4]> =
        directions.iter().chain([&middle]).map(|&d| scores(farthest_of(corners, d))).collect();
    let is_beaten = |v: &[f64; 4]| rivals.iter().any(|w| v.iter().zip(w).all(|(v, w)| w > v));
    candidates.extend(corners.iter().filter(|&&corner| !is_beaten(&scores(corner))));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(i: u32) -> DVec3 {
        let t = f64::from(i);
        DVec3::new((7.1 * t).sin(), (3.3 * t + 1.0).cos(), (1.9 * t).sin())
    }

    #[test]
    fn the_table_answers_as_a_full_search_does() {
        let corners: Vec<DVec3> =
            (0..400).map(|i| direction(i).normalize() * DVec3::new(0.1, 0.2, 0.05)).collect();
        let hull = Hull::new(corners.clone());
        assert!(hull.candidates.len() < 6 * N_CELLS * N_CELLS * 40);
        let axes = [DVec3::X, DVec3::NEG_Y, DVec3::new(1.0, 1.0, -1.0), DVec3::new(0.0, 1.0, 1.0)];
        for way in (1000..6000).map(direction).chain(axes) {
            let found = hull.farthest(way).dot(way);
            assert_eq!(found, farthest_of(&corners, way).dot(way));
        }
    }

    #[test]
    fn any_direction_has_an_answer() {
        let hull = Hull::new((0..50).map(direction).collect());
        for odd in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, 1e300 * DVec3::X] {
            let _ = hull.farthest(odd);
        }
    }
}
