//! Closing the pads: where they touch, how wide that is, and what lies under each pad.

use parry3d_f64::math::Pose;
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::Triangle;
use semfm_geom::math::{DMat3, DVec3};

use crate::clip::Polygon;
use crate::hand::Hand;
use crate::object::{GraspObject, Region, Surface};
use crate::rejection::Reason;
use crate::solid::Solid;

/// Each pad stops this far before the object's first point (metres), and the rest of the hand stays
/// away by half of it: far above rounding, in this program or another, and far below what a robot
/// can place.
pub(crate) const TOUCH_GAP: f64 = 1e-4;

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

/// A piece of the surface inside the prism between the pads, in the TCP frame.
struct Piece {
    shape: PieceShape,
    low: f64,
    high: f64,
    /// Outward unit normal in the TCP frame, zero for a degenerate triangle.
    normal: DVec3,
}

enum PieceShape {
    Polygon(Polygon),
    Point { at: DVec3, area: f64, weight: f64 },
}

/// Closes the pads on what lies between them.
///
/// `tcp` is object_from_tcp; `seed` an interval along its y axis that the grasp is to hold. The held
/// part grows from the seed over every gap too narrow for a finger.
pub(crate) fn close(
    object: &GraspObject,
    region: &Region,
    hand: &Hand,
    tcp: &Pose,
    seed: [f64; 2],
    compliance: f64,
) -> Result<Closing, (Reason, f64)> {
    let widest = *hand.opening().end();
    let seeded =
        Pose::from_parts(*tcp * DVec3::new(0.0, (seed[0] + seed[1]) / 2.0, 0.0), tcp.rotation);
    let pieces = pieces_between(object, region, hand, &seeded);
    let half = (seed[1] - seed[0]).abs() / 2.0;
    let [low, high] = held_interval(&pieces, half, hand.reach().finger_thickness)
        .ok_or((Reason::NoContact, 0.0))?;
    let width = high - low;
    if width > widest - 2.0 * TOUCH_GAP {
        return Err((Reason::Width, width + 2.0 * TOUCH_GAP - widest));
    }
    let centred = Pose::from_parts(seeded * DVec3::new(0.0, (low + high) / 2.0, 0.0), tcp.rotation);
    let shift = (low + high) / 2.0;
    let depth = match object.surface() {
        Surface::Mesh { .. } => compliance,
        Surface::Cloud { spacing, .. } => compliance.max(*spacing),
    };
    let gather =
        |side: f64| gather(&pieces, side, if side < 0.0 { low } else { high }, depth, object);
    let (Some(left), Some(right)) = (gather(-1.0), gather(1.0)) else {
        return Err((Reason::NoContact, 0.0));
    };
    let aim = (left.centre + right.centre) / 2.0;
    let patches = [left, right].map(|patch| patch.settle(aim, shift, &centred));
    Ok(Closing { tcp: centred, width, patches })
}

fn pieces_between(object: &GraspObject, region: &Region, hand: &Hand, seeded: &Pose) -> Vec<Piece> {
    let [x, z] = hand.pad().map(|extent| extent / 2.0);
    let y = *hand.opening().end();
    let prism = Solid::oriented_box(*seeded, DVec3::new(x, y, z));
    let turn = DMat3::from_quat(seeded.rotation).transpose();
    let mut pieces = Vec::with_capacity(128);
    for item in object.obstacle().near(&prism, 0.0) {
        match object.surface() {
            Surface::Mesh { mesh, normals } => {
                let ids = mesh.faces()[item as usize];
                let corners = ids.map(|id| prism.local(mesh.vertices()[id as usize]));
                let [a, b, c] = corners;
                let half = DVec3::new(x, y, z);
                let outside = a.min(b).min(c).cmpgt(half) | a.max(b).max(c).cmplt(-half);
                if outside.any() {
                    continue;
                }
                let weights = ids.map(|id| region.weight(id as usize));
                let mut polygon = Polygon::triangle(corners, weights);
                for (axis, bound) in [(0, x), (2, z), (1, y)] {
                    polygon.clip(axis, 1.0, bound);
                    polygon.clip(axis, -1.0, bound);
                }
                let extent = polygon.corners().iter().map(|c| c.0.y);
                let (low, high) = extent
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
                if low <= high {
                    let normal = turn * normals[item as usize];
                    pieces.push(Piece { shape: PieceShape::Polygon(polygon), low, high, normal });
                }
            }
            Surface::Cloud { points, normals, area, .. } => {
                let at = prism.local(points[item as usize]);
                if at.abs().cmple(DVec3::new(x, y, z)).all() {
                    let weight = region.weight(item as usize);
                    let shape = PieceShape::Point { at, area: *area, weight };
                    let normal = turn * normals[item as usize];
                    pieces.push(Piece { shape, low: at.y, high: at.y, normal });
                }
            }
        }
    }
    pieces
}

/// The stretch of surface around [-half, half] that no gap of `finger` or more interrupts.
fn held_interval(pieces: &[Piece], half: f64, finger: f64) -> Option<[f64; 2]> {
    // A seed may lie a rounding error beside its own surface.
    let slack = 1e-6;
    let mut stretches: Vec<[f64; 2]> = pieces.iter().map(|piece| [piece.low, piece.high]).collect();
    stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut merged: Vec<[f64; 2]> = Vec::new();
    for [low, high] in stretches {
        match merged.last_mut() {
            Some(last) if low - last[1] <= finger + 2.0 * TOUCH_GAP => last[1] = last[1].max(high),
            _ => merged.push([low, high]),
        }
    }
    let held: Vec<[f64; 2]> =
        merged.into_iter().filter(|s| s[0] <= half + slack && s[1] >= -half - slack).collect();
    Some([held.first()?[0], held.last()?[1]])
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

/// What lies within `compliance` of the pad at `end`; `side` is -1 or +1. `None` where nothing
/// shows the pad any area.
fn gather(
    pieces: &[Piece],
    side: f64,
    end: f64,
    compliance: f64,
    object: &GraspObject,
) -> Option<Gathered> {
    let mut sum = Gathered {
        area: 0.0,
        centre: DVec3::ZERO,
        normal: DVec3::ZERO,
        region: 0.0,
        depth: [f64::INFINITY, f64::NEG_INFINITY],
        facets: Vec::new(),
        side,
    };
    for piece in pieces {
        let nearest = if side < 0.0 { piece.low - end } else { end - piece.high };
        let faces = piece.normal.y * side;
        if nearest > compliance
            || nearest < -1e-9
            || faces == 0.0
            || (object.is_signed() && faces < 0.0)
        {
            continue;
        }
        let normal = piece.normal * faces.signum();
        match piece.shape {
            PieceShape::Polygon(mut polygon) => {
                polygon.clip(1, -side, compliance - side * end);
                for [a, b, c] in polygon.fan() {
                    let across = (b.0 - a.0).cross(c.0 - a.0).y.abs() / 2.0;
                    let corners = [a.0, b.0, c.0];
                    sum.add(corners, across, normal, (a.1 + b.1 + c.1) / 3.0);
                }
            }
            PieceShape::Point { at, area, weight } => {
                sum.add([at; 3], area * faces.abs(), normal, weight);
            }
        }
    }
    (sum.area > 0.0).then(|| {
        sum.centre /= sum.area;
        sum.region /= sum.area;
        sum
    })
}

impl Gathered {
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
    /// into the object's frame.
    fn settle(self, aim: DVec3, shift: f64, tcp: &Pose) -> Patch {
        let flat = |p: DVec3| DVec3::new(p.x, 0.0, p.z);
        let mut best = (f64::INFINITY, f64::INFINITY, DVec3::ZERO, DVec3::ZERO);
        for (corners, normal) in &self.facets {
            let [a, b, c] = *corners;
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
        let (_, _, point, local_normal) = best;
        Patch {
            contact: *tcp * (point - DVec3::Y * shift),
            normal: tcp.rotation * self.normal.normalize_or(self.side * DVec3::Y),
            local_normal: tcp.rotation * local_normal,
            area: self.area,
            region: self.region,
            depth: self.depth,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::BoxHand;
    use crate::test_shapes::{cuboid, cylinder, joined, moved};

    fn closing(object: &GraspObject, tcp: &Pose) -> Result<Closing, (Reason, f64)> {
        let region = Region::new(object, &vec![1.0; object.n_weights()]).unwrap();
        let hand = Hand::of_boxes(&BoxHand::default()).unwrap();
        close(object, &region, &hand, tcp, [-0.001, 0.001], 1.5e-3)
    }

    #[test]
    fn a_box_is_as_wide_as_it_is_and_fills_the_pads() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::new(0.1, 0.04, 0.1)), 1.0).unwrap();
        let tcp = Pose::from_translation(DVec3::new(0.01, 0.007, 0.0));
        let closing = closing(&object, &tcp).unwrap();
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
        let closing = closing(&object, &Pose::IDENTITY).unwrap();
        let half_chord = (radius * radius - (radius - compliance).powi(2)).sqrt();
        for patch in closing.patches {
            // The cylinder's axis is z: the strip runs along z and is a chord across x.
            let strip = 0.018 * (2.0 * half_chord).min(0.018);
            assert!((patch.area - strip).abs() < 0.02 * strip, "{} for {strip}", patch.area);
        }
    }

    #[test]
    fn a_plate_wider_than_the_hand_is_refused_by_what_is_missing() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::splat(0.1)), 1.0).unwrap();
        let (reason, by) = closing(&object, &Pose::IDENTITY).unwrap_err();
        assert_eq!(reason, Reason::Width);
        assert!((by - 0.0202).abs() < 1e-9, "{by}");
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
            assert!((closing(&object, &tcp).unwrap().width - expected).abs() < 1e-9);
        }
    }
}
