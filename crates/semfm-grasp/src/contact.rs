//! Closing the pads: where they touch, how wide that is, and what lies under each pad.

use parry3d_f64::math::Pose;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::Triangle;
use semfm_geom::math::{DMat3, DVec3};

use crate::clip::Polygon;
use crate::gripper_geometry::GripperGeometry;
use crate::object::{Body, Surface};
#[cfg(test)]
use crate::object::{GraspObject, Region};
use crate::solid::Solid;

/// Each pad stops this far before the object's first point (metres), and the rest of the gripper stays
/// away by half of it: far above rounding, in this program or another, and far below what a robot
/// can place.
pub(crate) const TOUCH_GAP: f64 = 1e-4;

/// On a rough surface the normal at a contact is the mean within this of it, metres: a fingertip's pad gives way over
/// about as much.
const NORMAL_RADIUS: f64 = 3e-3;

/// The object between closed pads.
#[derive(Clone, Debug)]
pub(crate) struct Closing {
    /// object_from_tcp, moved along y until both pads touch at once.
    pub(crate) tcp: Pose,
    /// Extent of the object between the pads, metres.
    pub(crate) width: f64,
    /// What touches the pad at -y, then the one at +y.
    pub(crate) patches: [Patch; 2],
}

/// What one pad touches, within the compliance of its surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    /// A point of the surface, opposite the other patch's as well as can be; object's frame.
    pub(crate) contact: DVec3,
    /// Unit normal averaged over the patch, towards the pad; object's frame.
    pub(crate) normal: DVec3,
    /// Unit normal at `contact`, towards the pad; object's frame.
    pub(crate) local_normal: DVec3,
    /// Area as the pad sees it, m².
    pub(crate) area: f64,
    /// Weight of the region, averaged over the patch, 0 to 1.
    pub(crate) region: f64,
    /// Extent along the approach, in the TCP frame, metres.
    pub(crate) depth: [f64; 2],
}

/// A piece of the surface inside the prism between the pads, in the prism's frame.
struct Piece {
    /// A triangle, or a point three times.
    corners: [DVec3; 3],
    /// Triangle or point id.
    item: u32,
    /// Whether it reaches beyond the prism, so that only a part of it counts.
    cut: bool,
    /// Whether `low` and `high` are those of the part inside; else they enclose them. Cutting is most of the work,
    /// and what lies within the held stretch as a whole need not be cut to know that.
    is_exact: bool,
    low: f64,
    high: f64,
}

/// [`close_on`] the surface on which contacts are sought.
#[cfg(test)]
pub(crate) fn close(
    object: &GraspObject,
    region: &Region,
    gripper: &GripperGeometry,
    tcp: &Pose,
    seed: [f64; 2],
    compliance: f64,
) -> Option<Closing> {
    close_on(object.touched(), region.touched(), gripper, tcp, seed, compliance)
}

/// Closes the pads on what lies between them.
///
/// `weights` has one number for each vertex or point of the body; `tcp` is object_from_tcp; `seed` an
/// interval along its y axis that the grasp is to hold. The held part grows from the seed over every gap
/// too narrow for a finger, and may be wider than the gripper opens. `None` where there is nothing to hold.
pub(crate) fn close_on(
    body: &Body,
    weights: &[f64],
    gripper: &GripperGeometry,
    tcp: &Pose,
    seed: [f64; 2],
    compliance: f64,
) -> Option<Closing> {
    let widest = *gripper.opening().end();
    let seeded =
        Pose::from_parts(*tcp * DVec3::new(0.0, (seed[0] + seed[1]) / 2.0, 0.0), tcp.rotation);
    let half = (seed[1] - seed[0]).abs() / 2.0;
    let gap = gripper.reach().finger_thickness + 2.0 * TOUCH_GAP;
    let [x, z] = gripper.pad().map(|extent| extent / 2.0);
    // First as far as a finger needs beside the seed; all the way where something is there.
    let (mut reach, far) = (half + 1.01 * gap, half.max(widest));
    let (prism, pieces, [low, high]) = loop {
        let prism = Prism::new(&seeded, DVec3::new(x, reach, z));
        let mut pieces = prism.pieces(body);
        let held = prism.held_interval(&mut pieces, half, gap)?;
        if reach >= far || held[1].max(-held[0]) <= reach - gap {
            break (prism, pieces, held);
        }
        reach = far;
    };
    let centred = Pose::from_parts(seeded * DVec3::new(0.0, (low + high) / 2.0, 0.0), tcp.rotation);
    let shift = (low + high) / 2.0;
    let depth = match body.surface {
        Surface::Mesh { .. } => compliance,
        Surface::Cloud { spacing, .. } => compliance.max(spacing),
    };
    let left = prism.gather(&pieces, [-1.0, low], depth, body, weights)?;
    let right = prism.gather(&pieces, [1.0, high], depth, body, weights)?;
    let aim = (left.centre + right.centre) / 2.0;
    let patches = [left, right].map(|patch| patch.into_patch(aim, shift, &centred, body.is_rough));
    Some(Closing { tcp: centred, width: high - low, patches })
}

/// The pads closed on `working`, moved apart to where the first points of another surface of the same object
/// stop them: `exact` lies within `reach` (metres) of the working one. Contacts and patches stay.
pub(crate) fn widened(
    closing: Closing,
    exact: &Body,
    gripper: &GripperGeometry,
    reach: f64,
) -> Closing {
    let [x, z] = gripper.pad().map(|extent| extent / 2.0);
    let half = closing.width / 2.0;
    let ends = [-1.0, 1.0].map(|side| {
        let frame = closing.tcp * Pose::from_translation(side * half * DVec3::Y);
        let slab = Prism::new(&frame, DVec3::new(x, reach, z));
        let outermost = slab.outermost(exact, side);
        side * half + side * outermost.unwrap_or(0.0)
    });
    let shift = Pose::from_translation(DVec3::Y * (ends[0] + ends[1]) / 2.0);
    Closing { tcp: closing.tcp * shift, width: ends[1] - ends[0], ..closing }
}

/// The space that the pads sweep, around the seed.
struct Prism {
    solid: Solid,
    half: DVec3,
    /// prism_from_object.
    turn: DMat3,
}

impl Prism {
    fn new(frame: &Pose, half: DVec3) -> Self {
        let turn = DMat3::from_quat(frame.rotation).transpose();
        Self { solid: Solid::oriented_box(*frame, half), half, turn }
    }

    fn pieces(&self, body: &Body) -> Vec<Piece> {
        let mut pieces = Vec::with_capacity(256);
        for item in body.tree.near(&self.solid, 0.0) {
            let corners @ [a, b, c] = body.tree.corners(item).map(|p| self.solid.local(p));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            if (low.cmpgt(self.half) | high.cmplt(-self.half)).any() {
                continue;
            }
            let cut = (high.cmpgt(self.half) | low.cmplt(-self.half)).any();
            let (low, high) = (low.y.max(-self.half.y), high.y.min(self.half.y));
            pieces.push(Piece { corners, item, cut, is_exact: !cut, low, high });
        }
        pieces
    }

    /// How far along `side` (-1 or +1) the surface reaches, in the prism's frame; `None` where nothing is inside.
    fn outermost(&self, body: &Body, side: f64) -> Option<f64> {
        let mut most = None;
        for mut piece in self.pieces(body) {
            let end = |piece: &Piece| if side < 0.0 { -piece.low } else { piece.high };
            if most.is_none_or(|most| end(&piece) > most) {
                self.cut_piece(&mut piece);
                if piece.low <= piece.high && most.is_none_or(|most| end(&piece) > most) {
                    most = Some(end(&piece));
                }
            }
        }
        most
    }

    /// Cuts a piece, so that its extent is that of the part inside: empty (low above high) where there is none.
    fn cut_piece(&self, piece: &mut Piece) {
        if !piece.is_exact {
            [piece.low, piece.high] = self.extent(piece.corners, [piece.low, piece.high]);
            piece.is_exact = true;
        }
    }

    /// Extent along y of the triangle's part inside; empty (low above high) where there is none.
    fn extent(&self, corners: [DVec3; 3], whole: [f64; 2]) -> [f64; 2] {
        let is_beside = corners.iter().any(|p| p.x.abs() > self.half.x || p.z.abs() > self.half.z);
        if !is_beside {
            return whole;
        }
        let inside = self.inside(corners, [0.0; 3]);
        inside
            .corners()
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], c| [l.min(c.0.y), h.max(c.0.y)])
    }

    fn inside(&self, corners: [DVec3; 3], weights: [f64; 3]) -> Polygon {
        let mut polygon = Polygon::triangle(corners, weights);
        for axis in [0, 2, 1] {
            polygon.clip(axis, 1.0, self.half[axis]);
            polygon.clip(axis, -1.0, self.half[axis]);
        }
        polygon
    }

    /// The stretch of surface around [-half, half] that no gap wider than `gap` interrupts.
    fn held_interval(&self, pieces: &mut [Piece], half: f64, gap: f64) -> Option<[f64; 2]> {
        // A seed may lie a rounding error beside its own surface, or wholly inside of something solid.
        let mut held = self
            .extent_near(pieces, half + 1e-6)
            .or_else(|| self.extent_near(pieces, half + gap))?;
        loop {
            let before = held;
            for piece in pieces.iter_mut() {
                let is_within = piece.low >= held[0] && piece.high <= held[1];
                let is_near =
                    |piece: &Piece| piece.low <= held[1] + gap && piece.high >= held[0] - gap;
                if is_within || !is_near(piece) {
                    continue;
                }
                self.cut_piece(piece);
                if is_near(piece) {
                    held = [held[0].min(piece.low), held[1].max(piece.high)];
                }
            }
            if held == before {
                return Some(held);
            }
        }
    }

    /// Extent along y of the pieces that reach into [-half, half]; `None` where none does.
    fn extent_near(&self, pieces: &mut [Piece], half: f64) -> Option<[f64; 2]> {
        let reaches_in = |piece: &Piece| piece.low <= half && piece.high >= -half;
        let mut held = [f64::INFINITY, f64::NEG_INFINITY];
        for is_exact in [true, false] {
            for piece in pieces.iter_mut().filter(|piece| piece.is_exact == is_exact) {
                let is_within = piece.low >= held[0] && piece.high <= held[1];
                if is_within || !reaches_in(piece) {
                    continue;
                }
                self.cut_piece(piece);
                if reaches_in(piece) {
                    held = [held[0].min(piece.low), held[1].max(piece.high)];
                }
            }
        }
        (held[0] <= held[1]).then_some(held)
    }

    /// What lies within `compliance` of the pad at `end`; `side` is -1 or +1. `None` where nothing
    /// shows the pad any area.
    fn gather(
        &self,
        pieces: &[Piece],
        [side, end]: [f64; 2],
        compliance: f64,
        body: &Body,
        weights: &[f64],
    ) -> Option<Gathered> {
        let mut sum = Gathered::new(side);
        for piece in pieces {
            let nearest = if side < 0.0 { piece.low - end } else { end - piece.high };
            if nearest > compliance || nearest < -1e-9 {
                continue;
            }
            let item = piece.item as usize;
            let normal = self.turn * body.surface.normal(item);
            let faces = normal.y * side;
            if faces == 0.0 || (body.is_signed && faces < 0.0) {
                continue;
            }
            let normal = normal * faces.signum();
            match &body.surface {
                Surface::Mesh { mesh, .. } => {
                    let weights = mesh.faces()[item].map(|id| weights[id as usize]);
                    let mut polygon = if piece.cut {
                        self.inside(piece.corners, weights)
                    } else {
                        Polygon::triangle(piece.corners, weights)
                    };
                    polygon.clip(1, -side, compliance - side * end);
                    for [a, b, c] in polygon.fan() {
                        let across = (b.0 - a.0).cross(c.0 - a.0).y.abs() / 2.0;
                        sum.add([a.0, b.0, c.0], across, normal, (a.1 + b.1 + c.1) / 3.0);
                    }
                }
                Surface::Cloud { area, .. } => {
                    sum.add(piece.corners, area * faces.abs(), normal, weights[item]);
                }
            }
        }
        sum.means()
    }
}

/// How far `aim` lies from the box around a triangle as a pad sees it: no point of the triangle is nearer.
fn distance_to_box([a, b, c]: &[DVec3; 3], aim: DVec3) -> f64 {
    let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
    let outside = (low - aim).max(aim - high).max(DVec3::ZERO);
    outside.x.hypot(outside.z)
}

/// A point as a pad sees it, along the closing axis.
fn flat(p: DVec3) -> DVec3 {
    DVec3::new(p.x, 0.0, p.z)
}

/// Sums over a patch, in the frame of the seed.
struct Gathered {
    area: f64,
    centre: DVec3,
    normal: DVec3,
    region: f64,
    depth: [f64; 2],
    /// The patch's triangles (or points, three times the same) with their normals.
    facets: Vec<([DVec3; 3], DVec3)>,
    side: f64,
}

impl Gathered {
    fn new(side: f64) -> Self {
        Self {
            area: 0.0,
            centre: DVec3::ZERO,
            normal: DVec3::ZERO,
            region: 0.0,
            depth: [f64::INFINITY, f64::NEG_INFINITY],
            facets: Vec::new(),
            side,
        }
    }

    /// Sums to means; `None` where there is no area.
    fn means(mut self) -> Option<Self> {
        if self.area <= 0.0 {
            return None;
        }
        self.centre /= self.area;
        self.region /= self.area;
        Some(self)
    }

    fn add(&mut self, corners: [DVec3; 3], area: f64, normal: DVec3, weight: f64) {
        if area <= 0.0 {
            return;
        }
        self.area += area;
        self.centre += area * (corners[0] + corners[1] + corners[2]) / 3.0;
        self.normal += area * normal;
        self.region += area * weight;
        for p in corners {
            self.depth = [self.depth[0].min(p.z), self.depth[1].max(p.z)];
        }
        self.facets.push((corners, normal));
    }

    /// Chooses the patch's point that lies nearest to `aim` as the pad sees it, and turns everything
    /// into the object's frame. On a rough surface the normal there is the mean around it.
    fn into_patch(self, aim: DVec3, shift: f64, tcp: &Pose, is_rough: bool) -> Patch {
        let mut best = (f64::INFINITY, f64::INFINITY, DVec3::ZERO, DVec3::ZERO);
        for (corners, normal) in &self.facets {
            let [a, b, c] = *corners;
            if distance_to_box(corners, aim) > best.0 + 1e-9 {
                continue;
            }
            let point = if a == b && b == c {
                a
            } else {
                let seen = Triangle::new(flat(a), flat(b), flat(c));
                let (_, place) = seen.project_local_point_and_get_location(flat(aim), true);
                let Some(weights) = place.barycentric_coordinates() else { continue };
                weights[0] * a + weights[1] * b + weights[2] * c
            };
            // Of two layers under the same spot the outer one touches.
            let key = (flat(point).distance(flat(aim)), -self.side * point.y);
            if key.0 < best.0 - 1e-9 || (key.0 < best.0 + 1e-9 && key.1 < best.1) {
                best = (key.0, key.1, point, *normal);
            }
        }
        let (_, _, point, facet_normal) = best;
        let local_normal =
            if is_rough { self.normal_around(point, facet_normal) } else { facet_normal };
        Patch {
            contact: *tcp * (point - DVec3::Y * shift),
            normal: tcp.rotation * self.normal.normalize_or(self.side * DVec3::Y),
            local_normal: tcp.rotation * local_normal,
            area: self.area,
            region: self.region,
            depth: self.depth,
        }
    }

    /// Mean normal of the patch within [`NORMAL_RADIUS`] of a point, by area; `own` where nothing is there.
    fn normal_around(&self, point: DVec3, own: DVec3) -> DVec3 {
        let near = self.facets.iter().filter(|(corners, _)| {
            let [a, b, c] = *corners;
            ((a + b + c) / 3.0).distance(point) <= NORMAL_RADIUS
        });
        let sum = near.fold(DVec3::ZERO, |sum, ([a, b, c], normal)| {
            sum + (*b - *a).cross(*c - *a).length() * *normal
        });
        sum.normalize_or(own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper_geometry::BoxGripper;
    use crate::test_meshes::{cuboid, cylinder, joined, moved};

    fn closing(object: &GraspObject, tcp: &Pose, half: f64) -> Option<Closing> {
        let region = Region::new(object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        close(object, &region, &gripper, tcp, [-half, half], 1.5e-3)
    }

    #[test]
    fn a_box_is_as_wide_as_it_is_and_fills_the_pads() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::new(0.1, 0.04, 0.1)), 1.0).unwrap();
        let tcp = Pose::from_translation(DVec3::new(0.01, 0.007, 0.0));
        let closing = closing(&object, &tcp, 0.03).unwrap();
        assert!((closing.width - 0.04).abs() < 1e-12);
        assert!(closing.tcp.translation.distance(DVec3::new(0.01, 0.0, 0.0)) < 1e-12, "recentred");
        for (patch, side) in closing.patches.iter().zip([-1.0, 1.0]) {
            assert!((patch.area - 0.018 * 0.018).abs() < 1e-12);
            assert!(patch.normal.distance(side * DVec3::Y) < 1e-12);
            assert!(patch.contact.distance(DVec3::new(0.01, side * 0.02, 0.0)) < 1e-9);
            assert!((patch.region - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_cylinder_touches_along_a_strip_as_wide_as_the_pads_give_way() {
        let (radius, compliance) = (0.02, 1.5e-3f64);
        let object = GraspObject::from_mesh(&cylinder(radius, 0.1, 256), 1.0).unwrap();
        let closing = closing(&object, &Pose::IDENTITY, 0.02).unwrap();
        let half_chord = (radius * radius - (radius - compliance).powi(2)).sqrt();
        for patch in closing.patches {
            // The cylinder's axis is z: the strip runs along z and is a chord across x.
            let strip = 0.018 * (2.0 * half_chord).min(0.018);
            assert!((patch.area - strip).abs() < 0.02 * strip, "{} for {strip}", patch.area);
        }
    }

    #[test]
    fn a_block_wider_than_the_hand_is_measured_and_nothing_is_nothing() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::splat(0.1)), 1.0).unwrap();
        let block = closing(&object, &Pose::IDENTITY, 0.05).unwrap();
        assert!((block.width - 0.1).abs() < 1e-12);
        assert!(closing(&object, &Pose::from_translation(DVec3::Z), 0.05).is_none());
    }

    #[test]
    fn two_walls_are_one_where_no_finger_fits_between() {
        let walls = |gap: f64| {
            let wall = cuboid(DVec3::new(0.1, 0.004, 0.1));
            let shift = (gap + 0.004) / 2.0 * DVec3::Y;
            joined(&moved(&wall, |p| p - shift), &moved(&wall, |p| p + shift))
        };
        for (gap, expected) in [(0.010, 0.018), (0.030, 0.004)] {
            let object = GraspObject::from_mesh(&walls(gap), 1.0).unwrap();
            let tcp = Pose::from_translation(DVec3::Y * (gap + 0.004) / 2.0);
            assert!((closing(&object, &tcp, 0.001).unwrap().width - expected).abs() < 1e-9);
        }
    }
}
