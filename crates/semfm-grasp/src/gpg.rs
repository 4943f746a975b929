//! Candidates as in Grasp Pose Detection: a frame from the normals around a point, turned and
//! pushed forward until the gripper would touch.
//!
//! ten Pas & Platt, "Using geometry to detect grasp poses in 3D point clouds", 2015; ten Pas,
//! Gualtieri, Saenko & Platt, "Grasp Pose Detection in Point Clouds", 2017. Departures: the
//! neighbourhood of the normals is scaled to the gripper instead of fixed at 3 cm, grippers also tilt about
//! the closing axis, both approaches are tried where the sign of a normal is unknown, and a placement
//! is only a proposal: width, contact and collision are decided on the surface itself.

use std::f64::consts::PI;

use parry3d_f64::glamx::DSymmetricEigen3;
use parry3d_f64::math::{Pose, Rotation};
use semfm_geom::math::{DMat3, DQuat, DVec3};

use crate::candidate::{Candidate, rotation};
use crate::gripper_geometry::{GripperExtents, GripperGeometry};
use crate::object::{GraspObject, Seed};

/// Turns about the approach axis, over half a turn: the gripper is symmetric.
const TURNS: usize = 8;

/// Tilts about the closing axis, radians.
const TILTS: [f64; 3] = [0.0, -0.5, 0.5];

/// The gripper must enclose this share of the pad's length before a placement counts (initial bite).
const INITIAL_BITE: f64 = 0.3;

/// ... but at most this, metres: the tips of long pads hold, too.
const LONGEST_BITE: f64 = 6e-3;

/// How deep the tips of long pads hold, metres.
const TIP_BITE: f64 = 0.012;

/// Placements of the gripper along its closing axis, over the width of its opening.
const PLACEMENTS: usize = 9;

/// Width of the bins in which the surface is gathered along the closing axis, metres. Finer ones
/// stay empty at the samples' spacing of 2.5 mm.
const BIN: f64 = 1.5e-3;

/// Samples within this of the outermost one count as the end of what is held (metres): the pads'
/// compliance and half the samples' spacing.
const END: f64 = 2.5e-3;

/// Samples whose normals leave the friction cone by up to this angle may stand for a surface inside
/// it (radians).
const NORMAL_SLACK: f64 = 0.15;

/// The push stops this far from contact (metres): the samples may miss what stands out between them.
const PUSH_GAP: f64 = 2e-3;

/// Reusable memory, and what all seeds share.
pub(crate) struct Gpg<'a> {
    object: &'a GraspObject,
    gripper: &'a GripperGeometry,
    /// Cosine of the widest angle that sampled normals and closing axis may have.
    least_cosine: f64,
    /// Samples near the seed, from the seed, with their normals.
    points: Vec<(DVec3, DVec3)>,
    /// The same points in single precision, by coordinate.
    coordinates: [Vec<f32>; 3],
    /// How far each lies from the plane of the fingers.
    beside: Vec<f32>,
    /// Those that the fingers meet, in the gripper's frame, each with its normal's part along y.
    slab: Vec<(DVec3, f64)>,
    /// For each bin along the closing axis, the least z of the surface in it.
    first: Vec<f64>,
}

impl<'a> Gpg<'a> {
    pub(crate) fn new(
        object: &'a GraspObject,
        gripper: &'a GripperGeometry,
        friction: f64,
    ) -> Self {
        let least_cosine = (friction.atan() + NORMAL_SLACK).cos();
        let (points, slab, first) = (Vec::new(), Vec::new(), Vec::new());
        let (coordinates, beside) = Default::default();
        Self { object, gripper, least_cosine, points, coordinates, beside, slab, first }
    }

    /// Adds the placements around `seed` whose ends can oppose each other, and returns how many
    /// others there were.
    pub(crate) fn grow(&mut self, seed: &Seed, out: &mut Vec<Candidate>) -> usize {
        let mut refused = 0;
        let reach = self.gripper.reach();
        let depth = reach.tip - reach.palm;
        let samples = self.object.samples();
        let radius = (2.0 * reach.outer).hypot(depth);
        self.points.clear();
        self.points.extend(
            samples
                .tree
                .points_within(seed.point, radius)
                .map(|i| (samples.points[i as usize] - seed.point, samples.normals[i as usize])),
        );
        for (axis, coordinates) in self.coordinates.iter_mut().enumerate() {
            coordinates.clear();
            coordinates.extend(self.points.iter().map(|(p, _)| p[axis] as f32));
        }
        let Some((normal, axis)) = self.darboux(seed) else { return 0 };
        let sides: &[f64] = if self.object.is_signed() { &[1.0] } else { &[1.0, -1.0] };
        for side in sides {
            let approach = -normal * side;
            for turn in 0..TURNS {
                let about = DQuat::from_axis_angle(approach, PI * turn as f64 / TURNS as f64);
                let closing = about * approach.cross(axis).normalize();
                for tilt in TILTS {
                    let tilted = DQuat::from_axis_angle(closing, tilt) * approach;
                    refused += self.place(seed, &rotation(closing, tilted), out);
                }
            }
        }
        refused
    }

    /// The normal at the seed and the direction in which normals around it change least (the axis of
    /// a cylinder): eigenvectors of Σ n nᵀ over a neighbourhood as wide as a finger.
    fn darboux(&self, seed: &Seed) -> Option<(DVec3, DVec3)> {
        let samples = self.object.samples();
        let mut spread = DMat3::ZERO;
        let radius = 0.5 * self.gripper.reach().finger_width;
        for i in samples.tree.points_within(seed.point, radius) {
            let n = samples.normals[i as usize];
            spread += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        }
        let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
        if trace <= 0.0 {
            let normal = seed.normal.try_normalize()?;
            return Some((normal, normal.any_orthonormal_vector()));
        }
        let frame = DSymmetricEigen3::new(spread * (1.0 / trace)).eigenvectors;
        let mut normal = frame.z_axis.try_normalize()?;
        if normal.dot(seed.normal) < 0.0 {
            normal = -normal;
        }
        let axis = frame.x_axis.reject_from_normalized(normal);
        Some((normal, axis.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector())))
    }

    /// Slides the open gripper along its closing axis and pushes it forward at each place.
    fn place(&mut self, seed: &Seed, turn: &Rotation, out: &mut Vec<Candidate>) -> usize {
        let reach = self.gripper.reach();
        let opening = *self.gripper.opening().end();
        let span = opening / 2.0 + reach.outer; // the farthest a finger gets
        self.gather(turn, span, reach);
        let bite = (INITIAL_BITE * self.gripper.pad()[1]).min(LONGEST_BITE);
        let (mut last, mut refused) = (None, 0);
        for k in 0..PLACEMENTS {
            let offset = opening * ((k as f64 + 0.5) / PLACEMENTS as f64 - 0.5);
            let (left, right) = (offset - opening / 2.0, offset + opening / 2.0);
            let fingers = self
                .nearest_surface(span, left - reach.finger_thickness, left - BIN)
                .min(self.nearest_surface(span, right + BIN, right + reach.finger_thickness));
            let front = self.nearest_surface(span, left, right);
            // Pushed until a fingertip touches beside, or the palm in front.
            let tip = (fingers - PUSH_GAP).min(front + reach.tip - reach.palm - PUSH_GAP);
            if !(front.is_finite() && tip - front >= bite) {
                continue;
            }
            // Deepest, with the pads just filled, and with the tips of long pads.
            let shallow = (front + (reach.tip + self.gripper.pad()[1] / 2.0)).min(tip);
            let deeper = tip - shallow > bite;
            let tips = front + TIP_BITE;
            let with_tips = self.gripper.has_long_pads() && tip.min(shallow) - tips > bite;
            let depths = [Some(tip), deeper.then_some(shallow), with_tips.then_some(tips)];
            for tip in depths.into_iter().flatten() {
                let middle = tip - reach.tip;
                let Some((held, opposed)) = self.held([left, right], middle) else { continue };
                let key = [held[0], held[1], middle.max(-span)].map(|y| self.bin(span, y));
                if last.replace(key) == Some(key) {
                    continue;
                }
                if !opposed {
                    refused += 1;
                    continue;
                }
                let place = seed.point + *turn * (DVec3::Z * middle);
                out.push(Candidate { tcp: Pose::from_parts(place, *turn), seed: held });
            }
        }
        refused
    }

    /// The bin of a place along the closing axis; the first one begins at `-span`.
    fn bin(&self, span: f64, y: f64) -> usize {
        (((y + span) / BIN).max(0.0) as usize).min(self.first.len() - 1)
    }

    /// Least z of the surface between two places along the closing axis.
    fn nearest_surface(&self, span: f64, from: f64, to: f64) -> f64 {
        let bins = self.bin(span, from)..=self.bin(span, to);
        self.first[bins].iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// What lies between pads whose middle is at `middle` along the approach: its extent along the
    /// closing axis, and whether at both ends some normal is within reach of the friction cone.
    fn held(&self, [left, right]: [f64; 2], middle: f64) -> Option<([f64; 2], bool)> {
        let half = self.gripper.pad()[1] / 2.0;
        let is_between = |p: DVec3| (p.z - middle).abs() <= half && p.y > left && p.y < right;
        let between = self.slab.iter().filter(|(p, _)| is_between(*p));
        let (low, high) = between
            .clone()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (p, _)| (l.min(p.y), h.max(p.y)));
        if low > high {
            return None;
        }
        let opposed = [low, high].into_iter().all(|end| {
            between
                .clone()
                .any(|(p, along)| (p.y - end).abs() <= END && along.abs() >= self.least_cosine)
        });
        Some(([low, high], opposed))
    }

    fn gather(&mut self, turn: &Rotation, span: f64, reach: GripperExtents) {
        self.slab.clear();
        self.first.clear();
        self.first.resize((2.0 * span / BIN) as usize + 2, f64::INFINITY);
        let back = DMat3::from_quat(turn.inverse());
        let half_width = reach.finger_width / 2.0;
        let (across, along, ahead) = (back.row(0), back.row(1), back.row(2));
        // Most points lie beside the fingers: those are told apart first, many at once, in single precision.
        let [xs, ys, zs] = &self.coordinates;
        let axis = across.as_vec3();
        self.beside.clear();
        self.beside.extend(
            (xs.iter().zip(ys).zip(zs)).map(|((x, y), z)| axis.x * x + axis.y * y + axis.z * z),
        );
        let wider = (half_width + 1e-6) as f32;
        let near = self.beside.iter().zip(&self.points).filter(|(beside, _)| beside.abs() <= wider);
        for (_, (p, n)) in near {
            let y = along.dot(*p);
            let x = across.dot(*p);
            if x.abs() <= half_width && y.abs() < span {
                let i = self.bin(span, y);
                let z = ahead.dot(*p);
                self.first[i] = self.first[i].min(z);
                self.slab.push((DVec3::new(x, y, z), along.dot(*n)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper_geometry::BoxGripper;
    use crate::object::Region;
    use crate::test_meshes::cylinder;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_frame_on_a_cylinder_knows_normal_and_axis() {
        let object = GraspObject::from_mesh(&cylinder(0.02, 0.2, 128), 1.0).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let gpg = Gpg::new(&object, &gripper, 0.5);
        let seed = Seed { point: DVec3::X * 0.02, normal: DVec3::X, item: 0 };
        let (normal, axis) = gpg.darboux(&seed).unwrap();
        assert!(normal.x > 0.99 && axis.z.abs() > 0.99, "{normal} {axis}");
    }

    #[test]
    fn hands_are_pushed_until_they_hold_the_cylinder() {
        let object = GraspObject::from_mesh(&cylinder(0.02, 0.2, 128), 1.0).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut candidates = Vec::new();
        let mut gpg = Gpg::new(&object, &gripper, 0.5);
        for _ in 0..20 {
            gpg.grow(&region.draw(&object, &mut rng), &mut candidates);
        }
        let across = candidates.iter().filter(|c| {
            let axis = c.tcp.rotation * DVec3::Y;
            axis.z.abs() < 0.2 && (c.seed[1] - c.seed[0] - 0.04).abs() < 0.008
        });
        assert!(across.count() > 20);
    }
}
