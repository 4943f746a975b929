//! A gripper pose with its reasons.

use parry3d_f64::math::Pose;
use semfm_geom::math::DVec3;

use crate::settings::PAD_COMPLIANCE;

/// How far beyond its contact each pad is told to go, metres: the depth within which pads give way.
const PRESS: f64 = PAD_COMPLIANCE;

/// One parallel-jaw grasp of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Grasp {
    /// The gripper's TCP frame in the object's frame, metres.
    pub object_from_tcp: Pose,
    /// Distance between the pads when they have closed, metres: each stands a tenth of a millimetre
    /// off the object's first point, so that rounding never makes a touch a collision.
    pub width: f64,
    /// Distance between the pads on the way in, metres: fully open, or less where a fully open gripper
    /// would hit something.
    pub opening: f64,
    /// One contact point for each pad (the one at -y first), in the object's frame, metres. Both
    /// lie on the surface, and the line between them inside both friction cones.
    pub contacts: [DVec3; 2],
    /// The object's unit normal at each contact, averaged over the patch that the pad covers,
    /// pointing at the pad.
    pub normals: [DVec3; 2],
    /// Ferrari & Canny's ε: the least wrench that the grasp cannot resist, for a unit of grip force,
    /// torques about the centre of mass divided by the object's radius around it.
    pub epsilon: f64,
    /// Angle by which the object turns while the pads close, until friction holds it, radians: above zero where
    /// pads that give way press it off the line between its first points.
    pub closing_turn: f64,
    /// The probability that the grasp holds, times what is asked beyond that
    /// ([`ScoreWeights`](crate::ScoreWeights)), in [0, 1]; without a mass, as for an object of .3 kg.
    pub score: f64,
    /// The probability that the grasp holds while the object is lifted, shaken and tilted, slipping less than
    /// 1 cm and 20°; `None` where no mass was given.
    pub hold: Option<f64>,
    /// Name and value of each term of the score, each in [0, 1].
    pub terms: Vec<(&'static str, f64)>,
}

impl Grasp {
    /// Distance between the two contacts along the closing direction, metres: where the pads touch. `width`, at which
    /// nothing is touched yet, is a little more, and much more on a noisy mesh.
    pub fn contact_width(&self) -> f64 {
        (self.contacts[1] - self.contacts[0]).dot(self.closing()).abs()
    }

    /// What a hand that goes to a width with limited force is told, metres: so far below the contacts that its pads
    /// press, at least 0.
    pub fn command_width(&self) -> f64 {
        (self.contact_width().min(self.width) - 2.0 * PRESS).max(0.0)
    }

    /// The direction in which the gripper comes, in the object's frame (unit).
    pub fn approach(&self) -> DVec3 {
        self.object_from_tcp.rotation * DVec3::Z
    }

    /// The direction from the pad at -y to the one at +y, in the object's frame (unit).
    pub fn closing(&self) -> DVec3 {
        self.object_from_tcp.rotation * DVec3::Y
    }

    /// Whether `score` is the score, and no bound of it.
    pub(crate) fn is_scored(&self) -> bool {
        !self.terms.is_empty()
    }

    /// The value of the term called `name`.
    pub fn term(&self, name: &str) -> Option<f64> {
        self.terms.iter().find(|term| term.0 == name).map(|term| term.1)
    }
}
