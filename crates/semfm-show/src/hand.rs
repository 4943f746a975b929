//! Hands as they are drawn: palm, fingers and pads out of what a file of grasps tells of its gripper.
//!
//! Boxes, of which the built-in hands are made, get round edges inside the box, so that what is drawn
//! never reaches farther than what was checked for collisions; other convex pieces stay as they are. A
//! gripper whose pads are no parts of their own gets plates of the pads' size.

use parry3d_f64::shape::Cuboid;
use parry3d_f64::transformation::try_convex_hull;
use semfm::files::{GraspRecord, GraspsFile, GripperRecord, MatrixRows};
use semfm::geom::math::{DAffine3, DMat3, DVec3, bounds};

use crate::surface::Surface;

/// Round edges: a share of a box's shortest side, at most so many metres.
const EDGE_SHARE: f64 = 0.28;
const LARGEST_EDGE: f64 = 0.008;
/// Steps of a quarter circle of a round edge.
const EDGE_STEPS: usize = 3;
/// A palm this much wider than it is deep and high is drawn with a wrist of this share of its width: makers
/// give the outer measures, and a hand that is drawn as a brick is not told from a box.
const WIDE: f64 = 1.5;
const WRIST: f64 = 0.55;
/// Points nearer than this to a box's side lie on it, metres.
const ON_SIDE: f64 = 1e-9;
/// Thickness of a plate that stands for a pad, metres: thin beside any finger.
const PLATE: f64 = 0.0012;

/// What a drawn part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PartKind {
    /// Moves with no finger.
    Palm,
    /// Moves with a finger.
    Finger,
    /// Touches the object.
    Pad,
}

/// A gripper, ready to be drawn at any of a file's grasps.
#[derive(Clone, Debug)]
pub(crate) struct DrawnHand {
    pub parts: Vec<DrawnPart>,
}

/// A rigid part of a drawn gripper.
#[derive(Clone, Debug)]
pub(crate) struct DrawnPart {
    /// The part of the file whose pose it has.
    pub carrier: usize,
    pub kind: PartKind,
    /// In the frame of the carrier, metres.
    pub surface: Surface,
}

impl DrawnHand {
    /// The hand of a file; nothing where the file has no grasp.
    pub(crate) fn of(file: &GraspsFile) -> Self {
        let gripper = &file.gripper;
        let mut parts: Vec<DrawnPart> = gripper
            .parts
            .iter()
            .enumerate()
            .map(|(carrier, part)| {
                let kind = match (part.role.as_str(), part.link.as_str()) {
                    ("palm", _) => PartKind::Palm,
                    (_, "pad") => PartKind::Pad,
                    _ => PartKind::Finger,
                };
                let mut surface = Surface::default();
                for hull in &part.hulls {
                    surface.add(&drawn_piece(hull, kind));
                }
                DrawnPart { carrier, kind, surface }
            })
            .collect();
        if !parts.iter().any(|part| part.kind == PartKind::Pad) {
            parts.extend(file.grasps.first().into_iter().flat_map(|grasp| plates(gripper, grasp)));
        }
        Self { parts }
    }

    /// How far the hand reaches back from the TCP at a grasp: the least z, metres.
    pub(crate) fn back(&self, grasp: &GraspRecord) -> f64 {
        let points = self.parts.iter().flat_map(|part| {
            let tcp_from_part = affine(&grasp.hand.closed[part.carrier]);
            part.surface.vertices.iter().map(move |&p| tcp_from_part.transform_point3(p).z)
        });
        points.fold(0.0, f64::min)
    }
}

/// A matrix of a file.
pub(crate) fn affine(rows: &MatrixRows) -> DAffine3 {
    let row = |k: usize| DVec3::new(rows[k][0], rows[k][1], rows[k][2]);
    let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    let translation = DVec3::new(rows[0][3], rows[1][3], rows[2][3]);
    DAffine3::from_mat3_translation(rotation, translation)
}

/// A convex piece by its corners; nothing where they have no hull (all in one plane). A palm that is wide
/// along its own y is drawn narrower at the wrist.
pub(crate) fn drawn_piece(corners: &[[f64; 3]], kind: PartKind) -> Surface {
    let corners: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
    let Some((low, high)) = box_of(&corners) else { return hull(&corners) };
    let size = high - low;
    let is_wide = kind == PartKind::Palm && size.y > WIDE * size.x.max(size.z);
    rounded_box(low, high, if is_wide { WRIST } else { 1.0 })
}

/// The convex hull, every triangle with corners of its own, so that edges stay sharp.
fn hull(points: &[DVec3]) -> Surface {
    let Ok((points, triangles)) = try_convex_hull(points) else { return Surface::default() };
    let mut surface = Surface::default();
    for triangle in triangles {
        let first = surface.vertices.len() as u32;
        surface.vertices.extend(triangle.map(|v| points[v as usize]));
        surface.faces.push([first, first + 1, first + 2]);
    }
    surface
}

/// Lower and upper corner, where the points are the eight corners of a box along the axes.
fn box_of(corners: &[DVec3]) -> Option<(DVec3, DVec3)> {
    let (low, high) = bounds(corners)?;
    let mut seen = [false; 8];
    for corner in corners {
        let mut place = 0;
        for k in 0..3 {
            if (corner[k] - high[k]).abs() < ON_SIDE {
                place |= 1 << k;
            } else if (corner[k] - low[k]).abs() >= ON_SIDE {
                return None;
            }
        }
        seen[place] = true;
    }
    (corners.len() == 8 && seen == [true; 8]).then_some((low, high))
}

/// A box with round edges: the hull of an eighth of a ball in each corner. At its lowest z it is so much
/// narrower along y.
fn rounded_box(low: DVec3, high: DVec3, narrower: f64) -> Surface {
    let radius = ((high - low).min_element() * EDGE_SHARE).min(LARGEST_EDGE);
    let mut points = Vec::new();
    for corner in 0..8 {
        let side =
            DVec3::from_array([0, 1, 2].map(|k| if corner >> k & 1 == 1 { 1.0 } else { -1.0 }));
        let mut middle = DVec3::select(side.cmpgt(DVec3::ZERO), high, low) - side * radius;
        if side.z < 0.0 {
            let axis = f64::midpoint(low.y, high.y);
            middle.y = axis + narrower * (middle.y - axis);
        }
        for i in 0..=EDGE_STEPS {
            for j in 0..=EDGE_STEPS - i {
                let direction = DVec3::new(i as f64, j as f64, (EDGE_STEPS - i - j) as f64);
                points.push(middle + side * direction.normalize() * radius);
            }
        }
    }
    match try_convex_hull(&points) {
        Ok((vertices, faces)) => Surface { vertices, faces },
        // Rounding spoiled the hull: sharp edges will do.
        Err(_) => cuboid((low + high) / 2.0, (high - low) / 2.0),
    }
}

fn cuboid(middle: DVec3, half: DVec3) -> Surface {
    let (vertices, faces) = Cuboid::new(half).to_trimesh();
    Surface { vertices: vertices.into_iter().map(|p| p + middle).collect(), faces }
}

/// A plate of the pads' size on each side, carried by the finger's part that is nearest to it.
fn plates(gripper: &GripperRecord, grasp: &GraspRecord) -> Vec<DrawnPart> {
    let [x, z] = gripper.pad.map(|side| side / 2.0);
    let sides = [("left", -1.0), ("right", 1.0)];
    sides
        .into_iter()
        .filter_map(|(role, side)| {
            let middle = DVec3::Y * side * (grasp.width + PLATE) / 2.0;
            let (carrier, tcp_from_part) = nearest_part(gripper, grasp, role, middle)?;
            let plate = cuboid(middle, DVec3::new(x, PLATE / 2.0, z));
            let mut surface = Surface::default();
            surface.add_at(&plate, tcp_from_part.inverse());
            Some(DrawnPart { carrier, kind: PartKind::Pad, surface })
        })
        .collect()
}

/// The part of a finger that has a corner nearest to a point of the TCP's frame, and its pose.
fn nearest_part(
    gripper: &GripperRecord,
    grasp: &GraspRecord,
    role: &str,
    point: DVec3,
) -> Option<(usize, DAffine3)> {
    let fingers = gripper.parts.iter().enumerate().filter(|(_, part)| part.role == role);
    let reached = fingers.filter_map(|(i, part)| {
        let tcp_from_part = affine(grasp.hand.closed.get(i)?);
        let corners = part.hulls.iter().flatten().map(|&p| DVec3::from_array(p));
        let away = corners.map(|p| tcp_from_part.transform_point3(p).distance(point));
        Some((i, tcp_from_part, away.fold(f64::INFINITY, f64::min)))
    });
    let nearest = reached.min_by(|a, b| a.2.total_cmp(&b.2));
    nearest.map(|(i, tcp_from_part, _)| (i, tcp_from_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(low: DVec3, high: DVec3) -> Vec<[f64; 3]> {
        let (points, _) = Cuboid::new((high - low) / 2.0).to_trimesh();
        points.into_iter().map(|p| (p + (low + high) / 2.0).to_array()).collect()
    }

    #[test]
    fn a_box_gets_round_edges_inside_itself() {
        let (low, high) = (DVec3::new(-0.01, 0.0, 0.02), DVec3::new(0.03, 0.02, 0.05));
        let drawn = drawn_piece(&corners(low, high), PartKind::Finger);
        let (inner_low, inner_high) = bounds(&drawn.vertices).unwrap();
        assert!((inner_low - low).length() < 1e-12 && (inner_high - high).length() < 1e-12);
        let reach = drawn.vertices.iter().map(|&p| p.distance(high)).fold(1.0, f64::min);
        assert!(reach > 0.5e-3, "the corner is cut off");
        // A closed surface without a hole: V − E + F = 2.
        assert_eq!(drawn.vertices.len() as i64 - drawn.faces.len() as i64 / 2, 2);
    }

    #[test]
    fn a_wide_palm_is_narrow_at_the_wrist_and_stays_inside_its_box() {
        let (low, high) = (DVec3::new(-0.03, -0.1, -0.13), DVec3::new(0.03, 0.1, -0.04));
        let palm = drawn_piece(&corners(low, high), PartKind::Palm);
        let width_at = |z: f64| {
            let near = palm.vertices.iter().filter(|p| (p.z - z).abs() < 0.01);
            near.map(|p| p.y.abs()).fold(0.0, f64::max)
        };
        assert!((width_at(high.z) - 0.1).abs() < 1e-9 && width_at(low.z) < 0.07);
        let (least, most) = bounds(&palm.vertices).unwrap();
        assert!((low - least).max_element() < 1e-12 && (most - high).max_element() < 1e-12);
    }

    #[test]
    fn what_is_no_box_is_drawn_as_it_is() {
        let mut points = corners(DVec3::ZERO, DVec3::ONE);
        points[7] = [2.0, 2.0, 2.0];
        let drawn = drawn_piece(&points, PartKind::Palm);
        assert!(
            drawn.vertices.contains(&DVec3::splat(2.0)) || drawn.vertices.contains(&DVec3::ONE)
        );
        assert!(drawn_piece(&points[..2], PartKind::Palm).faces.is_empty());
    }
}
