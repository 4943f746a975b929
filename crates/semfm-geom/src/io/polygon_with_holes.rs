//! Polygons that touch themselves: outlines with holes that are joined to them by bridges, coincident corners, thousands
//! of corners.

use std::collections::HashMap;

use spade::handles::{FixedVertexHandle, OUTER_FACE};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::math::DVec2;

/// Adds to `triangles` those that a flat polygon encloses (an odd number of times), as numbers of its corners, wound as
/// the plane is. Nothing is added where two sides cross.
///
/// Its corners are joined by a constrained Delaunay triangulation with exact predicates (the crate `spade`), in which
/// corners at one place are one point and a side that is walked twice separates nothing. The insides are then told from
/// the outside by crossing sides. Every corner is one of a triangle, those too that lie on a straight side: left out,
/// they would tear the surface, since the neighbouring face has them.
pub(super) fn cut_constrained(corners: &[DVec2], triangles: &mut Vec<[u32; 3]>) {
    let Some(outline) = Outline::new(corners) else { return };
    let is_inside = outline.faces_inside();
    for face in outline.triangulation.inner_faces() {
        if is_inside[face.fix().index()] {
            let points = face.vertices().map(|vertex| vertex.fix().index());
            let middle = points.iter().map(|&point| outline.places[point]).sum::<DVec2>() / 3.0;
            triangles.push(points.map(|point| outline.corner_towards(point, middle)));
        }
    }
}

/// A point of the triangulation.
struct Place(Point2<f64>);

impl HasPosition for Place {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.0
    }
}

/// A polygon with the triangulation of its corners.
struct Outline<'a> {
    corners: &'a [DVec2],
    triangulation: ConstrainedDelaunayTriangulation<Place>,
    /// Positions of the triangulation's points.
    places: Vec<DVec2>,
    /// The corners at each point, ascending.
    corners_at: Vec<Vec<u32>>,
    /// How often the polygon walks along an edge of the triangulation, by its points, the lower first.
    walks: HashMap<[usize; 2], usize>,
}

impl<'a> Outline<'a> {
    /// `None` where sides cross, or where numbers are beyond the triangulation's.
    fn new(corners: &'a [DVec2]) -> Option<Self> {
        let scale = corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let mut triangulation = ConstrainedDelaunayTriangulation::<Place>::new();
        let (mut places, mut corners_at): (Vec<DVec2>, Vec<Vec<u32>>) = (Vec::new(), Vec::new());
        let mut point_of_corner: Vec<FixedVertexHandle> = Vec::with_capacity(corners.len());
        for (corner, &p) in (0u32..).zip(corners) {
            // Numbers that are nothing beside the polygon's size are 0: the triangulation's exact predicates need it.
            let [x, y] = (p / scale).to_array().map(|x| if x.abs() < 1e-40 { 0.0 } else { x });
            let point = triangulation.insert(Place(Point2::new(x, y))).ok()?;
            if point.index() == places.len() {
                places.push(p);
                corners_at.push(Vec::new());
            }
            corners_at[point.index()].push(corner);
            point_of_corner.push(point);
        }
        let mut walks = HashMap::new();
        for (i, &from) in point_of_corner.iter().enumerate() {
            let to = point_of_corner[(i + 1) % point_of_corner.len()];
            if from == to {
                continue;
            }
            let edges = triangulation.try_add_constraint(from, to);
            if edges.is_empty() {
                return None;
            }
            for edge in edges {
                let ends = triangulation.directed_edge(edge).vertices();
                *walks.entry(ordered(ends.map(|vertex| vertex.fix().index()))).or_default() += 1;
            }
        }
        Some(Self { corners, triangulation, places, corners_at, walks })
    }

    /// For each face of the triangulation, whether an odd number of sides lies between it and the outside.
    fn faces_inside(&self) -> Vec<bool> {
        let mut is_inside: Vec<Option<bool>> = vec![None; self.triangulation.num_all_faces()];
        is_inside[OUTER_FACE.index()] = Some(false);
        let mut front = Vec::new();
        for edge in self.triangulation.convex_hull() {
            front.push((edge.rev().fix(), false));
        }
        while let Some((edge, here)) = front.pop() {
            // `edge` is a side of the face to enter.
            let edge = self.triangulation.directed_edge(edge);
            let face = edge.face();
            let known = &mut is_inside[face.fix().index()];
            if known.is_some() || face.is_outer() {
                continue;
            }
            let there = here ^ self.is_crossed_oddly(edge.vertices().map(|v| v.fix().index()));
            *known = Some(there);
            for side in [edge.next(), edge.prev()] {
                front.push((side.rev().fix(), there));
            }
        }
        is_inside.into_iter().map(Option::unwrap_or_default).collect()
    }

    fn is_crossed_oddly(&self, ends: [usize; 2]) -> bool {
        self.walks.get(&ordered(ends)).is_some_and(|n| n % 2 == 1)
    }

    /// Which of the corners at a point has the inside of the polygon on the side of `towards`: between the side that
    /// leaves it and, counter-clockwise, the side that leads to it.
    fn corner_towards(&self, point: usize, towards: DVec2) -> u32 {
        let corners = &self.corners_at[point];
        if let [only] = corners[..] {
            return only;
        }
        let here = self.places[point];
        let n = self.corners.len();
        let faces = |&&corner: &&u32| {
            let corner = corner as usize;
            let away = |mut at: usize, step: usize| {
                // Past corners at the same place.
                for _ in 0..n {
                    at = (at + step) % n;
                    if self.corners[at] != here {
                        break;
                    }
                }
                self.corners[at] - here
            };
            is_between(towards - here, away(corner, 1), away(corner, n - 1))
        };
        corners.iter().find(faces).copied().unwrap_or(corners[0])
    }
}

fn ordered([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// Whether a direction lies in the angle from `from` counter-clockwise to `to`.
fn is_between(direction: DVec2, from: DVec2, to: DVec2) -> bool {
    let (after, before) = (from.perp_dot(direction) >= 0.0, direction.perp_dot(to) >= 0.0);
    if from.perp_dot(to) >= 0.0 { after && before } else { after || before }
}
