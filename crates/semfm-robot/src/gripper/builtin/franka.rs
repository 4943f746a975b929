//! The Franka Hand: two fingers that slide.

use std::f64::consts::FRAC_PI_4;

use parry3d_f64::math::Pose;
use semfm_geom::math::{DQuat, DVec3};

use super::{BuiltinGripper, PlacedShape, box_between};
use crate::Result;
use crate::gripper::{DriveJoint, Gripper, GripperPart, Role};

pub(super) const FRANKA_HAND: BuiltinGripper = BuiltinGripper {
    name: "franka",
    summary: "Franka Hand of Panda and FR3, 80 mm",
    source: "product manual and flange drawing: stroke 80 mm, hand 204 × 63 mm, fingertips at 112 mm \
             and TCP at 103.4 mm above the flange, hand turned by −45° on it",
    also_called: &["panda", "panda hand", "fr3", "fer", "emika", "franka hand"],
    known_by: &["pandahand", "fr3hand", "ferhand", "frankahand"],
    make: franka_hand,
};

const STROKE: f64 = 0.08;
const TCP_ABOVE_FLANGE: f64 = 0.1034;
/// Sides of the rubber tip along x and z.
const PAD: [f64; 2] = [0.0175, 0.0185];

/// A box of the right finger, closed, in the TCP frame.
struct FingerBox {
    link: &'static str,
    low: [f64; 3],
    high: [f64; 3],
}

/// Rubber tip, neck, carriage.
const FINGER: [FingerBox; 3] = [
    FingerBox { link: "pad", low: [-0.00875, 0.0, -0.009], high: [0.00875, 0.0152, 0.0095] },
    FingerBox { link: "finger", low: [-0.00875, 0.007, -0.025], high: [0.00875, 0.0265, -0.009] },
    FingerBox { link: "finger", low: [-0.011, 0.0022, -0.045], high: [0.011, 0.0265, -0.024] },
];

fn franka_hand(row: &BuiltinGripper) -> Result<Gripper> {
    let palm = box_between(
        [-0.0316, -0.102, -0.0259 - TCP_ABOVE_FLANGE],
        [0.0316, 0.102, 0.066 - TCP_ABOVE_FLANGE],
    );
    let mut parts = vec![GripperPart::new("hand", Role::Palm, palm.shape, palm.pose)];
    for FingerBox { link, low, high } in FINGER {
        let PlacedShape { shape, pose } = box_between(low, high);
        parts.push(GripperPart::sliding(link, Role::Right, shape, pose, STROKE));
        let PlacedShape { shape, pose } =
            box_between([low[0], -high[1], low[2]], [high[0], -low[1], high[2]]);
        parts.push(GripperPart::sliding(link, Role::Left, shape, pose, STROKE));
    }
    let flange_from_tcp =
        Pose::from_parts(DVec3::Z * TCP_ABOVE_FLANGE, DQuat::from_rotation_z(-FRAC_PI_4));
    let gripper = Gripper::new(row.name, 0.0..=STROKE, PAD, flange_from_tcp.into(), parts)?;
    // Each finger slides by half of the width.
    let joints = ["panda_finger_joint1", "panda_finger_joint2"]
        .into_iter()
        .filter_map(|name| DriveJoint::new(name, [(0.0, 0.0), (STROKE, STROKE / 2.0)]))
        .collect();
    Ok(Gripper { joints, flange_link: "panda_link8".into(), ..gripper })
}
