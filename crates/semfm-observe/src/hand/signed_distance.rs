//! Distance from a hand, negative inside.

use semfm_geom::math::{DVec3, bounds};
use semfm_geom::{Mesh, PointIndex, SurfaceIndex};

use super::winding::Winding;
use super::{Hand, HandPart};
use crate::Result;

/// A hand, asked for distances.
pub(super) struct HandDistance<'a> {
    hand: &'a Hand,
    surface: Surface,
    winding: Winding,
    /// Corners of the bounding box: nothing beyond it is inside.
    bounds: (DVec3, DVec3),
}

enum Surface {
    Mesh(SurfaceIndex),
    /// Points, and what each of them is taken to fill.
    Points(PointIndex, f64),
}

/// Where a point lies to a hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearness {
    /// Negative inside.
    pub distance: f64,
    /// The part that is nearest, where parts are known.
    pub part: Option<HandPart>,
}

impl<'a> HandDistance<'a> {
    pub fn new(hand: &'a Hand) -> Result<Self> {
        let surface = if hand.faces.is_empty() {
            let index = PointIndex::new(&hand.points)?;
            let mut spacings: Vec<f64> = hand
                .points
                .iter()
                .step_by(1 + hand.points.len() / 500)
                .map(|p| index.k_nearest(*p, 2).last().map_or(0.0, |&(_, distance)| distance))
                .collect();
            spacings.sort_by(f64::total_cmp);
            Surface::Points(index, 0.5 * spacings[spacings.len() / 2])
        } else {
            Surface::Mesh(SurfaceIndex::new(&Mesh::new(hand.points.clone(), hand.faces.clone())?)?)
        };
        let bounds = bounds(&hand.points).unwrap_or_default();
        let winding = Winding::new(&hand.points, &hand.faces);
        Ok(Self { hand, surface, winding, bounds })
    }

    /// Whether a point is within a length of the surface.
    pub fn is_near(&self, point: DVec3, within: f64) -> bool {
        match &self.surface {
            Surface::Points(index, filled) => index.nearest(point).1 - filled <= within,
            Surface::Mesh(index) => index.closest_among(point, within, |_| true).is_some(),
        }
    }

    /// The distance of a point, `None` where it is more than `within` away.
    pub fn at(&self, point: DVec3, within: f64) -> Option<Nearness> {
        let part_of = |v: u32| self.hand.parts.as_ref().map(|parts| parts[v as usize]);
        match &self.surface {
            Surface::Points(index, filled) => {
                let (nearest, distance) = index.nearest(point);
                let distance = distance - filled;
                (distance <= within).then(|| Nearness { distance, part: part_of(nearest as u32) })
            }
            Surface::Mesh(index) => {
                let found = index.closest_among(point, within, |_| true)?;
                let corners = self.hand.faces[found.face as usize];
                let heaviest =
                    (0..3).max_by(|&a, &b| found.barycentric[a].total_cmp(&found.barycentric[b]));
                let part = part_of(corners[heaviest.unwrap_or(0)]);
                let sign = if self.is_inside(point) { -1.0 } else { 1.0 };
                Some(Nearness { distance: sign * found.distance, part })
            }
        }
    }

    /// By the generalised winding number ([`Winding`]).
    fn is_inside(&self, point: DVec3) -> bool {
        if point.cmplt(self.bounds.0).any() || point.cmpgt(self.bounds.1).any() {
            return false;
        }
        self.winding.at(point).abs() > 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use semfm_geom::zoo;

    #[test]
    fn an_open_ball_has_an_inside() {
        let ball = zoo::icosphere(3);
        // Open at one end, as a hand at the wrist.
        let open: Vec<[u32; 3]> = ball
            .faces()
            .iter()
            .filter(|face| face.iter().any(|&v| ball.vertices()[v as usize].z > -0.8))
            .copied()
            .collect();
        let turned = open.iter().map(|&[a, b, c]| [a, c, b]).collect();
        for faces in [open, turned] {
            let hand = Hand::new(ball.vertices().to_vec(), faces).unwrap();
            let distance = HandDistance::new(&hand).unwrap();
            let at = |p: DVec3| distance.at(p, 2.0).unwrap().distance;
            assert!((at(DVec3::new(0.0, 0.0, 0.9)) + 0.1).abs() < 0.01);
            assert!((at(DVec3::new(0.0, 1.2, 0.0)) - 0.2).abs() < 0.01);
            assert!(at(DVec3::ZERO) < 0.0 && at(DVec3::new(0.0, 0.0, -1.3)) > 0.0);
            assert!(distance.at(DVec3::new(0.0, 0.0, 9.0), 2.0).is_none());
        }
    }
}
