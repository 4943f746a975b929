//! Hands whose dimensions their makers publish, as boxes.
//!
//! Franka Hand: product manual and flange drawing (stroke 80 mm, hand 204 × 63 mm, fingertips at
//! 112 mm and TCP at 103.4 mm above the flange, hand turned by −45° on it). Robotiq 2F-85 and
//! 2F-140: instruction manual, section "Specifications" (strokes 85 and 140 mm, foot of 75 mm
//! diameter) and the joints of the published ROS model for the parallelogram. Couplings, cameras
//! and cables are not included.

use std::f64::consts::FRAC_PI_4;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::math::{DQuat, DVec2, DVec3};

use super::{DriveJoint, Gripper, GripperPart, Motion, Role};
use crate::Result;

/// Steps of a crank between open and closed: see [`Motion`].
const N_STEPS: usize = 65;

/// The hand of that name, `None` for a name that is not built in.
pub(super) fn by_name(name: &str) -> Option<Result<Gripper>> {
    match name {
        "franka" => Some(franka()),
        "robotiq-2f85" => Some(ROBOTIQ_2F85.gripper(name)),
        "robotiq-2f140" => Some(ROBOTIQ_2F140.gripper(name)),
        _ => None,
    }
}

/// A box between two corners, both in the TCP frame.
fn between(low: [f64; 3], high: [f64; 3]) -> (SharedShape, Pose) {
    let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
    let half = (high - low) / 2.0;
    let middle = Pose::from_translation((low + high) / 2.0);
    (SharedShape::cuboid(half.x, half.y, half.z), middle)
}

fn franka() -> Result<Gripper> {
    const STROKE: f64 = 0.08;
    const TCP_ABOVE_FLANGE: f64 = 0.1034;
    // Boxes of the right finger, closed: rubber tip, neck, carriage.
    let finger = [
        ("pad", [-0.00875, 0.0, -0.009], [0.00875, 0.0152, 0.0095]),
        ("finger", [-0.00875, 0.007, -0.025], [0.00875, 0.0265, -0.009]),
        ("finger", [-0.011, 0.0022, -0.045], [0.011, 0.0265, -0.024]),
    ];
    let (shape, middle) = between(
        [-0.0316, -0.102, -0.0259 - TCP_ABOVE_FLANGE],
        [0.0316, 0.102, 0.066 - TCP_ABOVE_FLANGE],
    );
    let mut parts = vec![GripperPart::new("hand", Role::Palm, shape, middle)];
    for (link, low, high) in finger {
        let (shape, closed) = between(low, high);
        parts.push(GripperPart::sliding(link, Role::Right, shape, closed, STROKE));
        let (shape, closed) = between([low[0], -high[1], low[2]], [high[0], -low[1], high[2]]);
        parts.push(GripperPart::sliding(link, Role::Left, shape, closed, STROKE));
    }
    let flange_from_tcp =
        Pose::from_parts(DVec3::Z * TCP_ABOVE_FLANGE, DQuat::from_rotation_z(-FRAC_PI_4));
    let mut hand =
        Gripper::new("franka", 0.0..=STROKE, [0.0175, 0.0185], flange_from_tcp.into(), parts)?;
    // Each finger slides by half of the width.
    let slides = ["panda_finger_joint1", "panda_finger_joint2"]
        .map(|name| DriveJoint::new(name, [(0.0, 0.0), (STROKE, STROKE / 2.0)]));
    hand.joints = slides.into_iter().flatten().collect();
    Ok(hand)
}

/// A hand whose fingers are carried by parallelograms, described by its right finger in the plane
/// of the palm's frame (y closing, z approach), metres.
struct Parallelogram {
    stroke: f64,
    pad: [f64; 2],
    /// Joint of the outer, driven crank on the palm.
    pivot: DVec2,
    /// Joint of the inner crank on the palm.
    inner_pivot: DVec2,
    /// From pivot to the finger's joint.
    length: f64,
    /// Corner of the bent outer crank, as a vector from the pivot when fully open.
    elbow: DVec2,
    /// How far inside the finger's joint the pad's face lies, along y.
    inset: f64,
    /// How far above the finger's joint the pad's middle lies, along z.
    rise: f64,
}

const ROBOTIQ_2F85: Parallelogram = Parallelogram {
    stroke: 0.085,
    pad: [0.022, 0.0375],
    pivot: DVec2::new(0.0306, 0.0549),
    inner_pivot: DVec2::new(0.0127, 0.0614),
    length: 0.0571,
    elbow: DVec2::new(0.0315, -0.0041),
    inset: 0.0252,
    rise: 0.0324,
};

const ROBOTIQ_2F140: Parallelogram = Parallelogram {
    stroke: 0.14,
    pad: [0.027, 0.065],
    pivot: DVec2::new(0.0306, 0.0549),
    inner_pivot: DVec2::new(0.0127, 0.0614),
    length: 0.1,
    elbow: DVec2::new(0.0315, -0.0036),
    inset: 0.0252,
    rise: 0.0458,
};

impl Parallelogram {
    /// Angle of the crank from the approach axis at a width: pad face y = width / 2.
    fn angle(&self, width: f64) -> f64 {
        ((width / 2.0 - self.pivot.x + self.inset) / self.length).clamp(-1.0, 1.0).asin()
    }

    /// Height of the pad's middle above the palm's frame.
    fn height(&self, angle: f64) -> f64 {
        self.pivot.y + self.length * angle.cos() + self.rise
    }

    /// Widths of the table, at equal steps of the crank.
    fn widths(&self) -> impl Iterator<Item = f64> {
        let (closed, open) = (self.angle(0.0), self.angle(self.stroke));
        (0..N_STEPS).map(move |step| {
            // The ends exactly: arcsine and sine need not return the same bits.
            if step == 0 {
                return 0.0;
            }
            if step == N_STEPS - 1 {
                return self.stroke;
            }
            let angle = closed + (open - closed) * step as f64 / (N_STEPS - 1) as f64;
            2.0 * (self.pivot.x - self.inset + self.length * angle.sin())
        })
    }

    fn gripper(&self, name: &str) -> Result<Gripper> {
        let palm = Motion::new(self.widths().map(|width| {
            (width, Pose::from_translation(-DVec3::Z * self.height(self.angle(width))))
        }));
        let flange = Motion::new(self.widths().map(|width| {
            (width, Pose::from_translation(DVec3::Z * self.height(self.angle(width))))
        }));
        let mut parts = vec![
            self.palm_part([-0.0375, -0.0375, 0.0], [0.0375, 0.0375, 0.045], &palm),
            self.palm_part([-0.0315, -0.0425, 0.025], [0.0315, 0.0425, 0.09], &palm),
        ];
        for role in [Role::Left, Role::Right] {
            parts.extend(self.finger(role));
        }
        Gripper::new(name, 0.0..=self.stroke, self.pad, flange, parts)
    }

    fn palm_part(&self, low: [f64; 3], high: [f64; 3], palm: &Motion) -> GripperPart {
        let (shape, middle) = between(low, high);
        let motion = self.widths().map(|width| (width, palm.at(width) * middle));
        GripperPart::new("palm", Role::Palm, shape, Motion::new(motion))
    }

    /// Pad and finger, which keep their direction, then the three bars of the cranks.
    fn finger(&self, role: Role) -> Vec<GripperPart> {
        let [pad_x, pad_z] = self.pad.map(|side| side / 2.0);
        let foot = -self.rise;
        // The pad and the block at the finger's joints.
        let boxes = [
            ("pad", [-pad_x, 0.0, -pad_z], [pad_x, 0.008, pad_z]),
            ("finger", [-0.0075, 0.002, foot - 0.006], [0.0075, self.inset + 0.006, foot + 0.012]),
        ];
        let mut parts: Vec<GripperPart> = boxes
            .into_iter()
            .map(|(link, low, high)| {
                let (shape, closed) = between(low, high);
                mirrored(link, role, shape, self.widths(), |width| {
                    Pose::from_translation(DVec3::Y * width / 2.0) * closed
                })
            })
            .collect();
        // The finger leans from its joint to the back of the pad and keeps its direction.
        let (shape, lean) = bar(
            DVec2::new(self.inset - 0.003, foot),
            DVec2::new(0.011, pad_z * 0.6),
            [0.015, 0.012],
        );
        parts.push(mirrored("finger", role, shape, self.widths(), |width| {
            Pose::from_translation(DVec3::Y * width / 2.0) * lean
        }));
        let open = self.angle(self.stroke);
        let tip = DVec2::from_angle(std::f64::consts::FRAC_PI_2 - open) * self.length;
        let bars = [
            ("outer_knuckle", self.pivot, DVec2::ZERO, self.elbow, [0.024, 0.020]),
            ("outer_finger", self.pivot, self.elbow, tip, [0.027, 0.014]),
            ("inner_knuckle", self.inner_pivot, DVec2::ZERO, tip, [0.039, 0.012]),
        ];
        for (link, pivot, from, to, section) in bars {
            let (shape, lie) = bar(from, to, section);
            parts.push(mirrored(link, role, shape, self.widths(), |width| {
                let angle = self.angle(width);
                let turn = DQuat::from_rotation_x(open - angle);
                let at = DVec3::new(0.0, pivot.x, pivot.y - self.height(angle));
                Pose::from_parts(at, turn) * lie
            }));
        }
        parts
    }
}

/// A bar between two points of the plane of y and z, so wide along x and so thick.
fn bar(from: DVec2, to: DVec2, [wide, thick]: [f64; 2]) -> (SharedShape, Pose) {
    let (along, middle) = (to - from, (from + to) / 2.0);
    // A turn about x by φ takes z towards −y.
    let lie = DQuat::from_rotation_x(-along.x.atan2(along.y));
    let shape = SharedShape::cuboid(wide / 2.0, thick / 2.0, along.length() / 2.0);
    (shape, Pose::from_parts(DVec3::new(0.0, middle.x, middle.y), lie))
}

/// A part of the right finger, or its mirror image for the left: boxes are their own mirror images,
/// so y and the turn about x change sign.
fn mirrored(
    link: &str,
    role: Role,
    shape: SharedShape,
    widths: impl Iterator<Item = f64>,
    right: impl Fn(f64) -> Pose,
) -> GripperPart {
    let motion = widths.map(|width| {
        let mut pose = right(width);
        if role == Role::Left {
            pose.translation.y = -pose.translation.y;
            pose.rotation = pose.rotation.inverse();
        }
        (width, pose)
    });
    GripperPart::new(link, role, shape, Motion::new(motion))
}
