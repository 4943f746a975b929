//! What may touch what at each step of a grasp's motion.
//!
//! The object is avoided until the approach; on the straight way in and while the fingers close, they and nothing else
//! may touch it; from then on it is carried, and may touch the hand, and what it stood on until it is lifted off.

use std::sync::Arc;

use parry3d_f64::math::Pose;
use semfm_robot::Role;

use crate::motion_request::TargetObject;
use crate::{
    AttachedBody, CollisionBody, CollisionChecker, CollisionModel, Hand, HandPart, MotionRequest,
    Result, Scene, TargetGrasp,
};

/// The object's name in messages.
pub(crate) const OBJECT: &str = "object";

/// States of the fingers, from open to closed, at which they are looked at while they close: at 8 cm of stroke each
/// finger moves by 8 mm from one to the next.
const N_CLOSING: usize = 5;

/// The checks of a grasp's motion.
pub(crate) struct StepChecks {
    /// Hand open, nothing may touch the object.
    pub free: CollisionChecker,
    /// Hand open, its fingers may touch the object.
    pub approach: CollisionChecker,
    /// The same at states of the closing fingers, closed at the end.
    pub closing: Vec<CollisionChecker>,
    /// The object in the hand; it may touch what it stood on.
    pub lift: CollisionChecker,
    /// The object in the hand; it touches nothing else.
    pub lifted: CollisionChecker,
}

/// A hand whose parts are ready to be attached: once for all grasps.
pub(crate) struct HandBodies {
    parts: Vec<HandBody>,
}

struct HandBody {
    /// Unique, and unlike the robot's links.
    name: String,
    is_finger: bool,
    body: CollisionBody,
}

impl HandBodies {
    pub fn new(hand: &Hand) -> Result<Self> {
        let body = |(part, name): (&HandPart, String)| -> Result<HandBody> {
            let body = CollisionBody::from_pieces(&part.pieces)?;
            Ok(HandBody { name, is_finger: part.role != Role::Palm, body })
        };
        let parts = hand.parts.iter().zip(hand.part_names()).map(body);
        Ok(Self { parts: parts.collect::<Result<_>>()? })
    }

    /// A checker with the parts where they are.
    fn at(
        &self,
        checker: &CollisionChecker,
        tip: usize,
        poses: &[Pose],
    ) -> Result<CollisionChecker> {
        let names: Vec<String> = self.parts.iter().map(|part| part.name.clone()).collect();
        let mut with_hand = checker.clone();
        for (part, &link_from_body) in self.parts.iter().zip(poses) {
            with_hand = with_hand.with_attached(AttachedBody {
                name: part.name.clone(),
                link: tip,
                link_from_body,
                body: part.body.clone(),
                may_touch: names.clone(),
            })?;
        }
        Ok(with_hand)
    }

    /// The same, fingers allowed to touch the object.
    fn touching(&self, checker: CollisionChecker) -> Result<CollisionChecker> {
        let mut touching = checker;
        for part in self.parts.iter().filter(|part| part.is_finger) {
            touching = touching.allowing(&part.name, OBJECT)?;
        }
        Ok(touching)
    }
}

impl StepChecks {
    /// The checks for a grasp of the request, at joint values that reach it.
    pub fn new(
        model: &Arc<CollisionModel>,
        request: &MotionRequest,
        hand: &HandBodies,
        grasp: &TargetGrasp,
        q: &[f64],
    ) -> Result<Self> {
        let tip = model.arm().tip();
        let around = CollisionChecker::new(model.clone(), request.scene.clone())?;
        let with_object = match &request.object {
            Some(object) => around.with_scene(with_object(&request.scene, object)?)?,
            None => around.clone(),
        };
        let free = hand.at(&with_object, tip, &grasp.tip_from_parts(0.0))?;
        let touching = |share: f64| -> Result<CollisionChecker> {
            let checker = hand.at(&with_object, tip, &grasp.tip_from_parts(share))?;
            if request.object.is_some() { hand.touching(checker) } else { Ok(checker) }
        };
        let approach = touching(0.0)?;
        let closing: Result<Vec<CollisionChecker>> =
            (1..=N_CLOSING).map(|i| touching(i as f64 / N_CLOSING as f64)).collect();
        let closed = hand.at(&around, tip, &grasp.tip_from_parts(1.0))?;
        let (lift, lifted) = match &request.object {
            Some(object) => carrying(&closed, tip, hand, object, grasp, q)?,
            None => (closed.clone(), closed),
        };
        Ok(Self { free, approach, closing: closing?, lift, lifted })
    }
}

fn with_object(scene: &Scene, object: &TargetObject) -> Result<Scene> {
    scene.clone().with_body(OBJECT, &object.body, object.base_from_object)
}

/// The checks with the object in the hand: during the lift, where it may touch what it stood on, and after it.
fn carrying(
    closed: &CollisionChecker,
    tip: usize,
    hand: &HandBodies,
    object: &TargetObject,
    grasp: &TargetGrasp,
    q: &[f64],
) -> Result<(CollisionChecker, CollisionChecker)> {
    let names = hand.parts.iter().map(|part| part.name.clone());
    let tip_from_object = grasp.base_from_tip().inverse() * object.base_from_object;
    let lifted = closed.with_attached(AttachedBody {
        name: OBJECT.into(),
        link: tip,
        link_from_body: tip_from_object,
        body: object.body.clone(),
        may_touch: names.collect(),
    })?;
    let stood_on: Vec<String> = lifted
        .contacts(q)
        .into_iter()
        .filter_map(|contact| match (contact.a.as_str(), contact.b.as_str()) {
            (OBJECT, _) => Some(contact.b),
            (_, OBJECT) => Some(contact.a),
            _ => None,
        })
        .filter(|name| closed.scene().names().any(|other| other == name))
        .collect();
    let mut lift = lifted.clone();
    for name in &stood_on {
        lift = lift.allowing(OBJECT, name)?;
    }
    Ok((lift, lifted))
}
