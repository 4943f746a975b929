//! Fingers on parallelograms: the pads keep their direction and move along z as they close.

use std::f64::consts::FRAC_PI_2;

use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use semfm_geom::math::{DQuat, DVec2, DVec3};

use super::{PlacedShape, box_between};
use crate::Result;
use crate::gripper::{DriveJoint, Gripper, GripperPart, Motion, Role};

/// Steps of a crank between open and closed: see [`Motion`].
const N_STEPS: usize = 65;

/// A gripper whose fingers are carried by parallelograms, described by its right finger in the plane
/// of the palm's frame (y closing, z approach), metres.
pub(super) struct Parallelogram {
    /// Greatest distance between the pads.
    pub stroke: f64,
    /// The pads' sides along x and z.
    pub pad: [f64; 2],
    /// Joint of the outer, driven crank on the palm.
    pub pivot: DVec2,
    /// Joint of the inner crank on the palm.
    pub inner_pivot: DVec2,
    /// From pivot to the finger's joint.
    pub length: f64,
    /// Corner of the bent outer crank, as a vector from the pivot when fully open.
    pub elbow: DVec2,
    /// How far inside the finger's joint the pad's face lies, along y.
    pub inset: f64,
    /// How far above the finger's joint the pad's middle lies, along z.
    pub rise: f64,
}

impl Parallelogram {
    /// Angle α of the crank from the approach axis at a width w, by the pad's face:
    ///
    /// > w/2 = pivot.y − inset + length · sin α
    fn angle(&self, width: f64) -> f64 {
        ((width / 2.0 - self.pivot.x + self.inset) / self.length).clamp(-1.0, 1.0).asin()
    }

    /// Height of the pad's middle above the palm's frame at a crank's angle α:
    ///
    /// > z = pivot.z + length · cos α + rise
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

    pub fn gripper(&self, name: &str) -> Result<Gripper> {
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
        // The published models turn the outer crank by `finger_joint`, 0 where the hand is open; the others mimic it.
        let open = self.angle(self.stroke);
        let drive = self.widths().map(|width| (width, open - self.angle(width)));
        let joints = DriveJoint::new("finger_joint", drive).into_iter().collect();
        let gripper = Gripper::new(name, 0.0..=self.stroke, self.pad, flange, parts)?;
        Ok(Gripper { joints, flange_link: "robotiq_arg2f_base_link".into(), ..gripper })
    }

    fn palm_part(&self, low: [f64; 3], high: [f64; 3], palm: &Motion) -> GripperPart {
        let PlacedShape { shape, pose } = box_between(low, high);
        let motion = self.widths().map(|width| (width, palm.at(width) * pose));
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
                let PlacedShape { shape, pose } = box_between(low, high);
                mirrored(link, role, shape, self.widths(), |width| {
                    Pose::from_translation(DVec3::Y * width / 2.0) * pose
                })
            })
            .collect();
        // The finger leans from its joint to the back of the pad and keeps its direction.
        let lean = bar(
            DVec2::new(self.inset - 0.003, foot),
            DVec2::new(0.011, pad_z * 0.6),
            [0.015, 0.012],
        );
        parts.push(mirrored("finger", role, lean.shape, self.widths(), |width| {
            Pose::from_translation(DVec3::Y * width / 2.0) * lean.pose
        }));
        let open = self.angle(self.stroke);
        let tip = DVec2::from_angle(FRAC_PI_2 - open) * self.length;
        let bars = [
            ("outer_knuckle", self.pivot, DVec2::ZERO, self.elbow, [0.024, 0.020]),
            ("outer_finger", self.pivot, self.elbow, tip, [0.027, 0.014]),
            ("inner_knuckle", self.inner_pivot, DVec2::ZERO, tip, [0.039, 0.012]),
        ];
        for (link, pivot, from, to, section) in bars {
            let bar = bar(from, to, section);
            parts.push(mirrored(link, role, bar.shape, self.widths(), |width| {
                let angle = self.angle(width);
                let turn = DQuat::from_rotation_x(open - angle);
                let at = DVec3::new(0.0, pivot.x, pivot.y - self.height(angle));
                Pose::from_parts(at, turn) * bar.pose
            }));
        }
        parts
    }
}

/// A bar between two points of the plane of y and z; `section` is its width along x and its
/// thickness.
fn bar(from: DVec2, to: DVec2, section: [f64; 2]) -> PlacedShape {
    let [wide, thick] = section;
    let (along, middle) = (to - from, (from + to) / 2.0);
    // A turn about x by φ takes z towards −y.
    let turn = DQuat::from_rotation_x(-along.x.atan2(along.y));
    let shape = SharedShape::cuboid(wide / 2.0, thick / 2.0, along.length() / 2.0);
    PlacedShape { shape, pose: Pose::from_parts(DVec3::new(0.0, middle.x, middle.y), turn) }
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
