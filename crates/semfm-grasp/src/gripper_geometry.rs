//! A gripper made ready for many collision tests: convex pieces, their motion, and the few lengths
//! that a candidate generator needs.

use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use crate::solid::Convex;
use crate::{Error, Result};
use semfm_robot::{Gripper, MAX_SPAN, Role};

/// Pads longer than this, metres, also hold with their tips alone: what is short to hold on leaves no room for all of
/// one.
const LONG_PAD: f64 = 0.03;

type Motion = Arc<dyn Fn(f64) -> Vec<Pose> + Send + Sync>;

/// A parallel-jaw gripper prepared once and asked often, from any thread.
///
/// Frame as in [`Gripper`]: origin between the pads, +z the approach, y the closing direction. The
/// pads are rectangles at y = ± half the width, centred on the origin in x and z.
#[derive(Clone)]
pub struct GripperGeometry {
    opening: RangeInclusive<f64>,
    pad: [f64; 2],
    pieces: Vec<Piece>,
    /// For a width, the pose of each piece in the TCP frame.
    motion: Motion,
    reach: GripperExtents,
}

#[derive(Clone, Debug)]
struct Piece {
    role: Role,
    shape: Convex,
}

/// Lengths of the open gripper, metres: what GPG calls finger width, outer diameter, depth and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripperExtents {
    /// How far the fingertips stand out along z, from the TCP.
    pub tip: f64,
    /// z of the palm's foremost point: nothing may come nearer.
    pub palm: f64,
    /// Thickness of a finger along y, at the height of its pad.
    pub finger_thickness: f64,
    /// Width of a finger along x, at the height of its pad.
    pub finger_width: f64,
    /// Half of the outer diameter along y.
    pub outer: f64,
}

/// A gripper of three boxes, by its dimensions in metres: the simplest gripper that grasps.
///
/// The default has the dimensions of the Franka Hand.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxGripper {
    /// Distances between the pads.
    pub opening: RangeInclusive<f64>,
    /// The pads' rectangle: along x and along z.
    pub pad: [f64; 2],
    /// Each finger: width along x, thickness along y, length along z from the palm to the tip.
    pub finger: [f64; 3],
    /// How far the fingertips stand out beyond the TCP.
    pub tip: f64,
    /// The palm: along x, y and z.
    pub palm: [f64; 3],
}

impl Default for BoxGripper {
    fn default() -> Self {
        Self {
            opening: 0.0..=0.08,
            pad: [0.018, 0.018],
            finger: [0.021, 0.015, 0.054],
            tip: 0.009,
            palm: [0.063, 0.204, 0.066],
        }
    }
}

impl GripperGeometry {
    /// Takes a gripper's parts apart and checks what every grasp relies on.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an opening or a pad without size, for a gripper without parts, for
    /// a part that has no bounds.
    pub fn new(gripper: &Gripper) -> Result<Self> {
        let widest = *gripper.opening.end();
        if gripper.parts_at(widest).len() != gripper.parts.len() {
            return Err(out_of_range("gripper parts", "one pose for each part", "another number"));
        }
        let mut pieces = Vec::new();
        let mut places = Vec::new(); // of each piece: its part, and its pose in the part's frame
        for (i, part) in gripper.parts.iter().enumerate() {
            let convex = Convex::pieces(part.shape.as_typed_shape()).ok_or_else(|| {
                out_of_range("shape of a gripper's part", "a shape with bounds", &part.link)
            })?;
            for (pose, shape) in convex {
                pieces.push(Piece { role: part.role, shape });
                places.push((i, pose));
            }
        }
        let owned = gripper.clone();
        let motion = move |width: f64| {
            let parts = owned.parts_at(width);
            places.iter().map(|&(part, local)| parts[part].tcp_from_part * local).collect()
        };
        Self::from_pieces(gripper.opening.clone(), gripper.pad, pieces, Arc::new(motion))
    }

    /// A gripper of three boxes.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an opening or a pad without size, and for lengths beyond any hand's.
    pub fn from_boxes(boxes: &BoxGripper) -> Result<Self> {
        let [width, thickness, length] = boxes.finger.map(|extent| extent / 2.0);
        let palm = DVec3::from_array(boxes.palm) / 2.0;
        let finger = DVec3::new(width, thickness, length);
        let part = |role, half| Piece { role, shape: Convex::cuboid(DVec3::ZERO, half) };
        let pieces =
            vec![part(Role::Palm, palm), part(Role::Left, finger), part(Role::Right, finger)];
        let finger_z = boxes.tip - length;
        let palm_z = boxes.tip - 2.0 * length - palm.z;
        let motion = move |opening: f64| {
            let y = opening / 2.0 + thickness;
            [DVec3::Z * palm_z, DVec3::new(0.0, -y, finger_z), DVec3::new(0.0, y, finger_z)]
                .map(Pose::from_translation)
                .to_vec()
        };
        Self::from_pieces(boxes.opening.clone(), boxes.pad, pieces, Arc::new(motion))
    }

    fn from_pieces(
        opening: RangeInclusive<f64>,
        pad: [f64; 2],
        pieces: Vec<Piece>,
        motion: Motion,
    ) -> Result<Self> {
        let (least, most) = (*opening.start(), *opening.end());
        if !(least >= 0.0 && most > least && most.is_finite()) {
            let found = format!("{least} to {most}");
            return Err(out_of_range("gripper opening", "0 ≤ least < most (metres)", &found));
        }
        if !pad.iter().all(|extent| *extent > 0.0 && extent.is_finite()) {
            return Err(out_of_range("gripper pad", "two positive lengths", &format!("{pad:?}")));
        }
        let has = |role| pieces.iter().any(|piece| piece.role == role);
        if !(has(Role::Left) && has(Role::Right)) {
            return Err(out_of_range("gripper parts", "at least one for each finger", "none"));
        }
        if motion(most).iter().chain(&motion(least)).any(|pose| !pose.is_finite()) {
            return Err(out_of_range("poses of the gripper's parts", "finite numbers", "others"));
        }
        let reach = GripperExtents::of(&pieces, &motion(most), most, pad);
        let lengths = [most, pad[0], pad[1], reach.tip.abs(), reach.palm.abs(), reach.outer];
        let lengths = [&lengths[..], &[reach.finger_width, reach.finger_thickness]].concat();
        if let Some(length) =
            lengths.iter().find(|length| length.is_nan() || **length > 2.0 * MAX_SPAN)
        {
            let expected = format!("lengths of at most {} m", 2.0 * MAX_SPAN);
            return Err(out_of_range("gripper", &expected, &format!("{length:.3e}")));
        }
        Ok(Self { opening, pad, pieces, motion, reach })
    }

    /// Distances between the pads that the gripper can reach, metres.
    pub fn opening(&self) -> RangeInclusive<f64> {
        self.opening.clone()
    }

    /// The pads' rectangle: extent along x and along z, metres.
    pub fn pad(&self) -> [f64; 2] {
        self.pad
    }

    /// Whether the pads are so long that their tips alone are tried, too.
    pub(crate) fn has_long_pads(&self) -> bool {
        self.pad[1] > LONG_PAD
    }

    /// Lengths of the open gripper.
    pub fn reach(&self) -> GripperExtents {
        self.reach
    }

    /// The gripper with its pads `width` apart.
    pub(crate) fn at(&self, width: f64) -> PosedGripper<'_> {
        PosedGripper { gripper: self, poses: (self.motion)(width) }
    }
}

impl GripperExtents {
    fn of(pieces: &[Piece], poses: &[Pose], opening: f64, pad: [f64; 2]) -> Self {
        let boxes = || pieces.iter().zip(poses).map(|(p, pose)| (p.role, p.shape.bounds_at(pose)));
        let fingers = || boxes().filter(|(role, _)| *role != Role::Palm).map(|(_, b)| b);
        let tip = fingers().map(|(_, high)| high.z).fold(f64::NEG_INFINITY, f64::max);
        let root = fingers().map(|(low, _)| low.z).fold(f64::INFINITY, f64::min);
        let palm = boxes()
            .filter(|(role, _)| *role == Role::Palm)
            .map(|(_, (_, high))| high.z)
            .fold(f64::NEG_INFINITY, f64::max);
        let beside_pad =
            || fingers().filter(|(low, high)| high.z > -pad[1] / 2.0 && low.z < pad[1] / 2.0);
        let thickness =
            beside_pad().map(|(low, high)| high.y.max(-low.y) - opening / 2.0).fold(1e-3, f64::max);
        let width = beside_pad().map(|(low, high)| high.x.max(-low.x) * 2.0).fold(pad[0], f64::max);
        Self {
            tip,
            palm: if palm.is_finite() { palm.min(tip) } else { root },
            finger_thickness: thickness,
            finger_width: width,
            outer: fingers().map(|(low, high)| high.y.max(-low.y)).fold(opening / 2.0, f64::max),
        }
    }
}

/// A gripper at one width: its pieces with their poses in the TCP frame.
#[derive(Clone)]
pub(crate) struct PosedGripper<'a> {
    gripper: &'a GripperGeometry,
    poses: Vec<Pose>,
}

impl PosedGripper<'_> {
    /// Role, shape and pose of each piece.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = (Role, &Convex, &Pose)> {
        self.gripper
            .pieces
            .iter()
            .zip(&self.poses)
            .map(|(piece, pose)| (piece.role, &piece.shape, pose))
    }

    /// Pose of the piece with this number.
    pub(crate) fn pose(&self, piece: usize) -> &Pose {
        &self.poses[piece]
    }

    /// The same gripper seen from the TCP of `other`, both having their palm in one place: where a
    /// linkage carries the pads along z as it closes, the robot holds the flange still.
    pub(crate) fn with_palm_of(mut self, other: &Self) -> Self {
        let palm = self.gripper.pieces.iter().position(|piece| piece.role == Role::Palm);
        if let Some(palm) = palm {
            let shift = other.poses[palm] * self.poses[palm].inverse();
            self.poses.iter_mut().for_each(|pose| *pose = shift * *pose);
        }
        self
    }
}

impl fmt::Debug for GripperGeometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GripperGeometry")
            .field("opening", &self.opening)
            .field("pad", &self.pad)
            .field("pieces", &self.pieces)
            .field("reach", &self.reach)
            .finish_non_exhaustive()
    }
}

fn out_of_range(what: &'static str, expected: &str, found: &str) -> Error {
    Error::OutOfRange { what, expected: expected.into(), found: found.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_boxes_have_the_lengths_they_were_made_of() {
        let boxes = BoxGripper::default();
        let reach = GripperGeometry::from_boxes(&boxes).unwrap().reach();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        close(reach.tip, boxes.tip);
        close(reach.palm, boxes.tip - boxes.finger[2]);
        close(reach.finger_thickness, boxes.finger[1]);
        close(reach.finger_width, boxes.finger[0]);
        close(reach.outer, boxes.opening.end() / 2.0 + boxes.finger[1]);
    }

    #[test]
    fn a_hand_that_cannot_hold_is_refused() {
        for opening in [0.08..=0.02, -0.01..=0.08, 0.0..=f64::INFINITY, 0.0..=1e12] {
            assert!(
                GripperGeometry::from_boxes(&BoxGripper { opening, ..BoxGripper::default() })
                    .is_err()
            );
        }
        assert!(
            GripperGeometry::from_boxes(&BoxGripper { pad: [0.0, 0.02], ..BoxGripper::default() })
                .is_err()
        );
    }
}
