//! How good a grasp is, in named terms.

use semfm_geom::math::DVec3;

use crate::closing_turn::{TurnedObject, turn_until_held};
use crate::collision::{FAR, Fit};
use crate::contact::{Closing, Patch};
use crate::force_closure::{SoftContact, ferrari_canny};
use crate::gripper_geometry::GripperGeometry;
use crate::object::GraspObject;
use crate::pad_view::{PadView, cell_side};
use crate::pressure::Pressure;
use crate::settings::GraspSettings;

/// A patch of this share of the pad counts as full contact: a cylinder of 2 cm radius gives .8 of a
/// pad of 18 mm, a ball of 2 cm .6.
const FULL_CONTACT: f64 = 0.6;

/// Kilograms where nothing is known: half of the YCB objects weigh less.
const UNKNOWN_MASS: f64 = 0.3;

/// What lifting and shaking ask of the grip, m/s²: half as much again as standing still.
const LOAD: f64 = 1.5 * 9.81;

/// An object that turns by this much while the pads close is not held where it was planned, radians.
const FULL_TURN: f64 = 0.26; // 15°

/// Turns measurements of a grasp into terms in [0, 1], and those into the probability that it holds
/// ([`ScoreWeights`]).
///
/// | term | 1 | 0 |
/// | --- | --- | --- |
/// | `contact` | the smaller patch covers 60 % of its pad or more | nothing touches |
/// | `friction` | the contacts oppose each other exactly | at the edge of a friction cone |
/// | `epsilon` | ε of two full pads around the centre of mass | no force closure |
/// | `gravity` | the weight does not turn the object about the closing axis | its torque is beyond what friction can hold (held / (held + torque)) |
/// | `weight` | the object weighs nothing against what friction can hold | it weighs far more (held / (held + load)) |
/// | `lever` | contacts around the centre of mass | as far from it as the object reaches |
/// | `evenness` | the whole of both pads is pressed evenly | a point of one is |
/// | `centred` | the forces act in the middle of the pads | at the rim of one |
/// | `closing` | the object does not turn while the pads close | it turns by 15° or more |
/// | `clearance` | the open gripper is 1 cm from everything | it touches |
/// | `bite` | the pads are filled along their length | only a tip holds |
/// | `approach` | as demonstrated | at a right angle to it, or against |
/// | `region` | all contact is at full weight | none is in the region |
pub(crate) struct Scorer<'a> {
    object: &'a GraspObject,
    gripper: &'a GripperGeometry,
    settings: &'a GraspSettings,
    /// Direction of gravity, where known.
    down: Option<DVec3>,
    pad: [f64; 2],
    /// ε of two full pads around the centre of mass.
    best_epsilon: f64,
}

/// The terms that cost most of a score's time: ε, and those of what the pads see.
struct ExaminedTerms {
    epsilon: f64,
    gravity: f64,
    evenness: f64,
    centred: f64,
    closing: f64,
}

/// The score with its reasons.
pub(crate) struct Score {
    pub(crate) score: f64,
    /// Where the mass is known.
    pub(crate) hold: Option<f64>,
    pub(crate) epsilon: f64,
    /// Radians.
    pub(crate) closing_turn: f64,
    pub(crate) terms: Vec<(&'static str, f64)>,
}

impl Score {
    /// Where only a number is known that the score does not exceed.
    pub(crate) fn of_bound(bound: f64) -> Self {
        Self { score: bound, hold: None, epsilon: 0.0, closing_turn: 0.0, terms: Vec::new() }
    }
}

impl<'a> Scorer<'a> {
    pub(crate) fn new(
        object: &'a GraspObject,
        gripper: &'a GripperGeometry,
        settings: &'a GraspSettings,
        down: Option<DVec3>,
    ) -> Self {
        let pad = gripper.pad();
        let half = (*gripper.opening().end() / 2.0).min(object.radius());
        let ideal = [-1.0, 1.0].map(|side| {
            let y = side * DVec3::Y;
            SoftContact::new(half * y, -y, DVec3::Z, pad[0] * pad[1], settings.friction)
        });
        let best_epsilon = ferrari_canny(&ideal, settings.friction, object.radius());
        let down = settings.gravity.or(down).map(DVec3::normalize);
        Self { object, gripper, settings, down, pad, best_epsilon }
    }

    /// Scores a grasp whose widest contact angle (radians, see `force_closure`) is `angle`.
    pub(crate) fn score(&self, closing: &Closing, fit: &Fit, angle: f64) -> Score {
        let epsilon = self.epsilon(closing);
        let turned = self.turned(closing);
        let [one, other] = turned.pressures;
        let examined = ExaminedTerms {
            epsilon: epsilon / self.best_epsilon.max(1e-12),
            gravity: self.share_of_torque(one.radius + other.radius, self.turning_arm(closing)),
            evenness: self.evenness(&turned),
            centred: self.centred(&turned),
            closing: 1.0 - turned.turn / FULL_TURN,
        };
        let terms = self.terms(closing, fit, angle, &examined);
        let weights = &self.settings.weights;
        let hold = weights.probability(&terms);
        Score {
            score: hold * weights.preference(&terms),
            hold: self.settings.mass.map(|_| hold),
            epsilon,
            closing_turn: turned.turn,
            terms,
        }
    }

    /// A number that the score does not exceed, for a tenth of its time: ε and what the pads see are taken for as good
    /// as can be.
    pub(crate) fn at_most(&self, closing: &Closing, fit: &Fit, angle: f64) -> f64 {
        let weights = &self.settings.weights;
        let best = |weight: f64, most: f64| if weight > 0.0 { most } else { 0.0 };
        // Points in a rectangle lie, in the mean, at most half its diagonal from their centre; and a pressure is spread
        // over a cell at least.
        let cell = cell_side(self.object, self.pad);
        let of_cell = Pressure::of_point(DVec3::ZERO, cell * cell).radius;
        let most_held = self.pad[0].hypot(self.pad[1]).max(2.0 * of_cell);
        let gravity = self.share_of_torque(most_held, self.turning_arm(closing));
        let examined = ExaminedTerms {
            epsilon: best(weights.epsilon, 1.0),
            gravity: best(weights.gravity, gravity),
            evenness: best(weights.evenness, 1.0),
            centred: best(weights.centred, 1.0),
            closing: 1.0,
        };
        let terms = self.terms(closing, fit, angle, &examined);
        weights.probability(&terms) * weights.preference(&terms)
    }

    fn terms(
        &self,
        closing: &Closing,
        fit: &Fit,
        angle: f64,
        examined: &ExaminedTerms,
    ) -> Vec<(&'static str, f64)> {
        let [left, right] = &closing.patches;
        let mut terms = vec![
            ("contact", self.pad_share(closing) / FULL_CONTACT),
            ("friction", 1.0 - angle / self.settings.friction.atan()),
            ("epsilon", examined.epsilon),
            ("gravity", examined.gravity),
            ("weight", self.share_of_force()),
            ("lever", 1.0 - self.arm(closing).length() / self.object.radius()),
            ("bite", self.bite(left).min(self.bite(right))),
            ("evenness", examined.evenness),
            ("centred", examined.centred),
            ("closing", examined.closing),
            ("clearance", fit.clearance / FAR),
            ("region", left.region.midpoint(right.region)),
        ];
        if let Some(demonstrated) = self.settings.demonstrated_approach {
            let cosine = (closing.tcp.rotation * DVec3::Z).dot(demonstrated.normalize());
            terms.push(("approach", cosine));
        }
        terms.iter_mut().for_each(|term| term.1 = term.1.clamp(0.0, 1.0));
        terms
    }

    /// Ferrari & Canny's ε of both patches.
    fn epsilon(&self, closing: &Closing) -> f64 {
        let com = self.object.centre_of_mass();
        let friction = self.settings.friction;
        let contacts = closing.patches.map(|patch| {
            let area = patch.area.min(self.pad[0] * self.pad[1]);
            let approach = closing.tcp.rotation * DVec3::Z;
            SoftContact::new(patch.contact - com, -patch.normal, approach, area, friction)
        });
        ferrari_canny(&contacts, friction, self.object.radius())
    }

    /// From the middle of the contacts to the centre of mass, metres.
    fn arm(&self, closing: &Closing) -> DVec3 {
        let [left, right] = &closing.patches;
        self.object.centre_of_mass() - left.contact.midpoint(right.contact)
    }

    /// The object at rest between the pads; where a pad meets less than a cell of its grid, it meets a point.
    fn turned(&self, closing: &Closing) -> TurnedObject {
        let view = PadView::new(self.object, self.gripper, closing);
        let GraspSettings { friction, grip_force, .. } = *self.settings;
        turn_until_held(&view, friction, grip_force).unwrap_or_else(|| {
            let points = closing.patches.map(|patch| closing.tcp.inverse() * patch.contact);
            let pressures = points.map(|point| Pressure::of_point(point, view.cell_area));
            TurnedObject { turn: 0.0, pressures }
        })
    }

    /// The torque that both pads, of pressures whose radii add up to `radii` metres, can hold about the closing axis,
    /// against that and the torque of the load on an arm of `arm` metres.
    fn share_of_torque(&self, radii: f64, arm: f64) -> f64 {
        let GraspSettings { friction, grip_force, .. } = self.settings;
        let held = friction * grip_force * radii;
        held / (held + self.load() * arm)
    }

    /// The force that both pads can hold along themselves, against that and the load.
    fn share_of_force(&self) -> f64 {
        let held = 2.0 * self.settings.friction * self.settings.grip_force;
        held / (held + self.load())
    }

    /// What the object weighs while it is lifted and shaken, newtons.
    fn load(&self) -> f64 {
        self.settings.mass.unwrap_or(UNKNOWN_MASS) * LOAD
    }

    /// How evenly the less even pad is pressed: the area of an even pressure against the pad's.
    fn evenness(&self, turned: &TurnedObject) -> f64 {
        let least = turned.pressures.iter().map(|p| p.area).fold(f64::INFINITY, f64::min);
        least / (self.pad[0] * self.pad[1])
    }

    /// How far from the pads' rims the forces act: a hand that comes a little beside still meets the object.
    fn centred(&self, turned: &TurnedObject) -> f64 {
        let off = |p: &Pressure| {
            (2.0 * p.centre.x.abs() / self.pad[0]).max(2.0 * p.centre.z.abs() / self.pad[1])
        };
        1.0 - turned.pressures.iter().map(off).fold(0.0, f64::max)
    }

    /// Share of the pad's length that a patch fills.
    fn bite(&self, patch: &Patch) -> f64 {
        (patch.depth[1] - patch.depth[0]) / self.pad[1]
    }

    /// Share of its pad that the smaller patch covers.
    pub(crate) fn pad_share(&self, closing: &Closing) -> f64 {
        let least = closing.patches.iter().map(|patch| patch.area).fold(f64::INFINITY, f64::min);
        (least / (self.pad[0] * self.pad[1])).min(1.0)
    }

    /// Arm of the weight about the closing axis: the object hangs in two pads as on a hinge. Without
    /// a direction of gravity the worst one counts.
    fn turning_arm(&self, closing: &Closing) -> f64 {
        let arm = self.arm(closing);
        let axis = closing.tcp.rotation * DVec3::Y;
        match self.down {
            Some(down) => arm.cross(down).dot(axis).abs(),
            None => arm.reject_from_normalized(axis).length(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    use crate::contact::close;
    use crate::gripper_geometry::BoxGripper;
    use crate::object::Region;
    use crate::test_meshes::cuboid;
    use parry3d_f64::math::Pose;

    #[test]
    fn the_middle_of_a_bar_is_best_and_each_term_tells_why() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::new(0.2, 0.03, 0.03)), 1.0).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let settings = GraspSettings::default();
        let scorer = Scorer::new(&object, &gripper, &settings, Some(DVec3::NEG_Z));
        let fit = Fit { width: 0.03, opening: 0.08, clearance: 0.02 };
        let at = |x: f64, z: f64| {
            let tcp = Pose::new(DVec3::new(x, 0.0, z), DVec3::X * PI);
            let closing = close(&object, &region, &gripper, &tcp, [-0.015, 0.015], 1.5e-3).unwrap();
            let score = scorer.score(&closing, &fit, 0.0);
            assert!((score.score..1.0).contains(&scorer.at_most(&closing, &fit, 0.0)));
            score
        };
        let value = |score: &Score, name: &str| {
            score.terms.iter().find(|term| term.0 == name).map(|term| term.1).unwrap()
        };
        let middle = at(0.0, 0.0);
        for (name, value) in &middle.terms {
            // A full pad is pressed evenly but for the cells on its rim.
            assert!(*value > 0.75 || *name == "epsilon" && *value > 0.5, "{name} is {value}");
        }
        let end = at(0.08, 0.0);
        assert!(end.score < middle.score && end.epsilon < middle.epsilon);
        // Full pads of 18 mm: torsion 2 μ F r with r = .3826 · 18 mm, against 1.5 · .3 kg · g on 8 cm.
        let held: f64 = 2.0 * 0.5 * 30.0 * 0.3826 * 0.018;
        let gravity = held / (held + UNKNOWN_MASS * LOAD * 0.08);
        assert!((value(&end, "gravity") - gravity).abs() < 0.01, "{:?}", end.terms);
        assert!((value(&end, "lever") - (1.0 - 0.08 / object.radius())).abs() < 1e-9);
        let shallow = at(0.0, 0.02);
        assert!((value(&shallow, "bite") - 0.004 / 0.018).abs() < 1e-9);
        assert!(shallow.score < middle.score);
    }

    #[test]
    fn the_demonstrated_approach_counts_where_it_is_given() {
        let object = GraspObject::from_mesh(&cuboid(DVec3::splat(0.03)), 1.0).unwrap();
        let region = Region::new(&object, &vec![1.0; object.n_weights()]).unwrap();
        let gripper = GripperGeometry::from_boxes(&BoxGripper::default()).unwrap();
        let closing =
            close(&object, &region, &gripper, &Pose::IDENTITY, [-0.015, 0.015], 1.5e-3).unwrap();
        let fit = Fit { width: 0.03, opening: 0.08, clearance: 1.0 };
        let scores = [DVec3::Z, DVec3::X].map(|approach| {
            let demonstrated_approach = Some(approach);
            let settings = GraspSettings { demonstrated_approach, ..GraspSettings::default() };
            Scorer::new(&object, &gripper, &settings, None).score(&closing, &fit, 0.0).score
        });
        assert!(
            (scores[1] - 0.5 * scores[0]).abs() < 1e-9,
            "a right angle takes away the whole share"
        );
    }
}
