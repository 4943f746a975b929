//! From ranked grasps to a motion: each grasp passes the gates in order, and the first that passes all of them becomes
//! the motion.

use std::sync::Arc;

use semfm_geom::Task;
use semfm_robot::{Arm, IkSettings, InverseKinematics, Preference};

use crate::cartesian::{LineArm, LineFault, Residual, StraightLine, follow_line};
use crate::motion_request::{GraspMotion, StartContact};
use crate::planning::joint_space::between;
use crate::reach::{Candidate, Reached, reach};
use crate::step_checks::{HandBodies, StepChecks};
use crate::timed_motion::{MotionCurves, timed_motion};
use crate::{
    BlendSettings, CollisionChecker, CollisionModel, Curve, Ending, Error, Gate, GraspOutcome,
    JointRange, JointSpace, MotionAnswer, MotionRequest, Obstruction, Planned, Pose, Result, blend,
    plan_path, shorten,
};

/// Farthest that corners between the steps of a straight line are cut, radians: with an arm of a metre the tip leaves
/// the line by less than a millimetre.
const LINE_TUBE: f64 = 1e-3;

/// States of a motion that was refused, at which the contact to report is looked for.
const N_LOOKS: usize = 64;

/// A gate that a way to take a grasp did not pass, and why.
type Stop = (Gate, Obstruction);

/// Plans the motions of one arm; made once, asked often.
#[derive(Clone, Debug)]
pub struct MotionPlanner {
    model: Arc<CollisionModel>,
    space: JointSpace,
    notes: Vec<String>,
}

impl MotionPlanner {
    /// A planner of the arm of a collision model.
    ///
    /// Each request brings the hand that it is for. Links of the description that joints outside the arm move at the
    /// arm's end are fingers: the hand stands for them, and they are not checked.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an arm whose joints have no proper ranges.
    pub fn new(model: Arc<CollisionModel>) -> Result<Self> {
        let ranges = model.arm().joints().iter().map(|joint| JointRange {
            name: joint.name.clone(),
            lower: joint.lower,
            upper: joint.upper,
        });
        let space = JointSpace::new(ranges.collect())?;
        let fingers = finger_links(model.arm());
        let mut notes = Vec::new();
        if !fingers.is_empty() {
            notes.push(format!(
                "{} move at the arm's end and are not checked: the hand of the grasps stands for them",
                fingers.join(", ")
            ));
        }
        let model = Arc::new(model.without_links(&fingers));
        Ok(Self { model, space, notes })
    }

    /// The arm.
    pub fn arm(&self) -> &Arc<Arm> {
        self.model.arm()
    }

    /// What was assumed, in words.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The links of the robot as collision checks see them, fingers left out.
    pub fn model(&self) -> &Arc<CollisionModel> {
        &self.model
    }

    /// The motion that takes the object by the best grasp that can be carried out, or what kept each grasp from it.
    ///
    /// Grasps are ranked by their joint values ([`Gate`] tells the order of the checks). For each in turn the ways to
    /// take it pass the gates up to the lift; then one path is searched from the start to all pre-grasps that are left.
    ///
    /// # Errors
    /// [`Error::Invalid`] and [`Error::Robot`] for a request that is not sound: a start out of limits, numbers that are
    /// not finite, names that are taken. That no motion was found is no error.
    pub fn plan(&self, request: &MotionRequest, task: &Task) -> Result<MotionAnswer> {
        let search = Search::new(self, request)?;
        let settings = &request.settings;
        let kinematics = InverseKinematics::new(
            self.arm().clone(),
            IkSettings {
                seed: settings.seed,
                restarts: settings.restarts,
                solutions: settings.solutions,
                ..Default::default()
            },
        )?;
        let is_symmetric = request.hand.is_symmetric;
        let reached = reach(&kinematics, &request.grasps, is_symmetric, &request.start, task)?;
        let mut answer = MotionAnswer { motion: None, outcomes: Vec::new(), start_contact: None };
        let mut searches = 0;
        for (rank, reached) in reached.iter().enumerate() {
            task.step("plan", rank, request.grasps.len())?;
            let is_over = answer.motion.is_some() || searches == settings.searches;
            let ending = if is_over && reached.obstruction.is_none() {
                Ending::NotTried
            } else {
                match search.try_grasp(reached, &mut searches, &mut answer.start_contact)? {
                    Ok(motion) => {
                        answer.motion = Some(motion);
                        Ending::Planned
                    }
                    Err((gate, obstruction)) => Ending::Stopped { gate, obstruction },
                }
            };
            let (grasp, n_solutions) = (reached.grasp, reached.candidates.len());
            answer.outcomes.push(GraspOutcome { grasp, n_solutions, ending });
        }
        answer.outcomes.sort_by_key(|outcome| outcome.grasp);
        Ok(answer)
    }
}

/// Names of the links that joints outside the arm move at the rigid body of its tip.
fn finger_links(arm: &Arm) -> Vec<&str> {
    let robot = arm.robot();
    let bodies = robot.bodies();
    let leaders = robot.leaders();
    let is_arm = |joint: usize| arm.joints().iter().any(|other| other.index == leaders[joint]);
    let mut is_finger = vec![false; robot.links.len()];
    // Joints stand in order from the root outwards.
    for (index, joint) in robot.joints.iter().enumerate() {
        let is_first = bodies[joint.parent] == bodies[arm.tip()]
            && joint.kind.has_position()
            && !is_arm(index);
        is_finger[joint.child] = is_first || is_finger[joint.parent];
    }
    let links = robot.links.iter().zip(is_finger);
    links.filter(|(_, is_finger)| *is_finger).map(|(link, _)| link.name.as_str()).collect()
}

/// One request under way.
struct Search<'a> {
    planner: &'a MotionPlanner,
    request: &'a MotionRequest,
    hand: HandBodies,
    /// Follows lines: near the step before, without random starts.
    nearby: InverseKinematics,
}

/// A way to take a grasp that passed the gates up to the lift.
struct Way<'a> {
    candidate: &'a Candidate,
    checks: StepChecks,
    /// From before the grasp to the grasp.
    approach: Vec<Vec<f64>>,
    /// From the grasp upwards.
    lift: Vec<Vec<f64>>,
}

impl<'a> Search<'a> {
    fn new(planner: &'a MotionPlanner, request: &'a MotionRequest) -> Result<Self> {
        request.settings.check()?;
        planner.arm().check_positions("start", &request.start)?;
        let n_parts = request.hand.parts.len();
        if n_parts == 0 {
            return Err(Error::Invalid {
                what: "hand".into(),
                expected: "at least one part".into(),
                found: "none".into(),
            });
        }
        request.grasps.iter().try_for_each(|grasp| grasp.check(n_parts))?;
        let nearby = IkSettings {
            seed: request.settings.seed,
            restarts: 0,
            solutions: 1,
            preference: Preference::None,
            ..Default::default()
        };
        let nearby = InverseKinematics::new(planner.arm().clone(), nearby)?;
        Ok(Self { planner, request, hand: HandBodies::new(&request.hand)?, nearby })
    }

    /// Takes a grasp through the gates: the motion, or where the way that came farthest was stopped.
    fn try_grasp(
        &self,
        reached: &Reached,
        searches: &mut usize,
        start_contact: &mut Option<StartContact>,
    ) -> Result<std::result::Result<GraspMotion, Stop>> {
        if let (true, Some(obstruction)) = (reached.candidates.is_empty(), &reached.obstruction) {
            return Ok(Err((Gate::Reach, obstruction.clone())));
        }
        let mut ways = Vec::new();
        let mut farthest: Option<Stop> = None;
        for candidate in &reached.candidates {
            match self.way(candidate)? {
                Ok(way) => ways.push(way),
                Err(stop) => note(&mut farthest, stop),
            }
        }
        if !ways.is_empty() {
            match self.connect(reached.grasp, &ways, searches, start_contact)? {
                Ok(motion) => return Ok(Ok(motion)),
                Err(stop) => note(&mut farthest, stop),
            }
        }
        Ok(Err(farthest.unwrap_or_else(|| {
            let what = "inverse kinematics gave neither joint values nor a best try".into();
            (Gate::Reach, Obstruction::Other { what })
        })))
    }

    /// A way to take a grasp through all gates that do not depend on the start.
    fn way(&self, candidate: &'a Candidate) -> Result<std::result::Result<Way<'a>, Stop>> {
        let Candidate { target, q, .. } = candidate;
        let settings = &self.request.settings;
        let checks = StepChecks::new(&self.planner.model, self.request, &self.hand, target, q)?;
        if let Some(contact) = checks.approach.first_contact(q) {
            return Ok(Err((Gate::Grasp, Obstruction::contact(contact))));
        }
        // Backwards: the grasp is what must be met.
        let at_grasp = target.base_from_tip();
        let before = target.base_from_tip_before(settings.approach);
        let back = StraightLine { from: at_grasp, to: before };
        let mut approach = match self.line(&back, q, &checks.approach, Gate::Approach) {
            Ok(waypoints) => waypoints,
            Err(stop) => return Ok(Err(stop)),
        };
        approach.reverse();
        if let Some(contact) = checks.free.first_contact(&approach[0]) {
            return Ok(Err((Gate::PreGrasp, Obstruction::contact(contact))));
        }
        for closing in &checks.closing {
            if let Some(contact) = closing.first_contact(q) {
                return Ok(Err((Gate::Close, Obstruction::contact(contact))));
            }
        }
        let above = Pose::from_translation(settings.lift) * at_grasp;
        let up = StraightLine { from: at_grasp, to: above };
        let lift = match self.line(&up, q, &checks.lift, Gate::Lift) {
            Ok(waypoints) => waypoints,
            Err(stop) => return Ok(Err(stop)),
        };
        let last = lift.last().unwrap_or(q);
        if let Some(contact) = checks.lifted.first_contact(last) {
            return Ok(Err((Gate::Lift, Obstruction::contact(contact))));
        }
        Ok(Ok(Way { candidate, checks, approach, lift }))
    }

    /// Joint values along a straight line on which nothing touches.
    fn line(
        &self,
        line: &StraightLine,
        start: &[f64],
        checker: &CollisionChecker,
        gate: Gate,
    ) -> std::result::Result<Vec<Vec<f64>>, Stop> {
        let length = line.length();
        let waypoints =
            follow_line(&Nearby(&self.nearby), line, start, &self.request.settings.line).map_err(
                |LineFault { at, residual: Residual { position, rotation } }| {
                    (gate, Obstruction::Line { at, length, position, rotation })
                },
            )?;
        for pair in waypoints.windows(2) {
            if checker.motion_is_free(&pair[0], &pair[1]) {
                continue;
            }
            let contact = contact_between(checker, &pair[0], &pair[1]);
            let Some((q, contact)) = contact else {
                let what = "something comes nearer than the contact distance on the line".into();
                return Err((gate, Obstruction::Other { what }));
            };
            let at =
                self.planner.arm().base_from_tip(&q).translation.distance(line.from.translation);
            let (a, b, depth) = (contact.a, contact.b, contact.depth);
            return Err((gate, Obstruction::ContactOnLine { at, length, a, b, depth }));
        }
        Ok(waypoints)
    }

    /// A path from the start to one of the ways' pre-grasps, and the whole motion.
    fn connect(
        &self,
        grasp: usize,
        ways: &[Way<'_>],
        searches: &mut usize,
        start_contact: &mut Option<StartContact>,
    ) -> Result<std::result::Result<GraspMotion, Stop>> {
        let (request, space) = (self.request, &self.planner.space);
        // Both turns of the hand are as wide, so the first way's checks speak for the start and for all pre-grasps.
        let free = &ways[0].checks.free;
        if let Some(contact) = free.first_contact(&request.start) {
            if start_contact.is_none() {
                let nearest_free = free.nearest_free(&request.start, request.settings.seed);
                *start_contact = Some(StartContact { contact: contact.clone(), nearest_free });
            }
            return Ok(Err((Gate::Path, Obstruction::contact(contact))));
        }
        *searches += 1;
        let goals: Vec<Vec<f64>> = ways.iter().map(|way| way.approach[0].clone()).collect();
        let planned = plan_path(space, free, &request.start, &goals, &request.settings.plan())?;
        let path = match planned {
            Planned::Path(path) => path,
            Planned::NotFound { iterations, .. } => {
                return Ok(Err((Gate::Path, Obstruction::NoPath { iterations })));
            }
            Planned::StartNotFree | Planned::NoGoalFree => {
                let what = "start or pre-grasps are not free".into();
                return Ok(Err((Gate::Path, Obstruction::Other { what })));
            }
        };
        let way = &ways[path.goal];
        let shorter = shorten(free, &path.waypoints, &request.settings.shorten());
        let tube = BlendSettings { tube: request.settings.tube };
        let line_tube = BlendSettings { tube: LINE_TUBE };
        // Continuous joints may arrive some turns away: the straight lines go on from there.
        let arrival = shorter.last().unwrap_or(&request.start);
        let offset: Vec<f64> = arrival.iter().zip(&way.approach[0]).map(|(a, b)| a - b).collect();
        let curves = MotionCurves {
            to_pre_grasp: blend(free, &shorter, &tube)?,
            approach: moved_curve(&way.checks.approach, &way.approach, &offset, &line_tube)?,
            lift: moved_curve(&way.checks.lift, &way.lift, &offset, &line_tube)?,
        };
        let target = &way.candidate.target;
        let motion =
            timed_motion(space, self.planner.arm(), &curves, target, &way.checks, request)?;
        Ok(motion.map(|timed| GraspMotion {
            grasp,
            target: target.clone(),
            trajectory: timed.trajectory,
            n_replayed: timed.n_replayed,
        }))
    }
}

/// A curve through the waypoints of a line, each joint moved by `offset`.
fn moved_curve(
    checker: &CollisionChecker,
    waypoints: &[Vec<f64>],
    offset: &[f64],
    settings: &BlendSettings,
) -> Result<Curve> {
    let moved: Vec<Vec<f64>> = waypoints
        .iter()
        .map(|q| q.iter().zip(offset).map(|(q, offset)| q + offset).collect())
        .collect();
    blend(checker, &moved, settings)
}

/// Keeps the stop of the way that came farther.
fn note(farthest: &mut Option<Stop>, stop: Stop) {
    if farthest.as_ref().is_none_or(|(gate, _)| stop.0 > *gate) {
        *farthest = Some(stop);
    }
}

/// The first contact of a motion that is not free, with the joint values where it is.
fn contact_between(
    checker: &CollisionChecker,
    from: &[f64],
    to: &[f64],
) -> Option<(Vec<f64>, crate::Contact)> {
    (0..=N_LOOKS).find_map(|i| {
        let q = between(from, to, i as f64 / N_LOOKS as f64);
        let contact = checker.first_contact(&q)?;
        Some((q, contact))
    })
}

/// Inverse kinematics as lines need it.
struct Nearby<'a>(&'a InverseKinematics);

impl LineArm for Nearby<'_> {
    fn tip(&self, q: &[f64]) -> Pose {
        self.0.arm().base_from_tip(q)
    }

    fn reach(&self, base_from_tip: &Pose, near: &[f64]) -> std::result::Result<Vec<f64>, Residual> {
        let far = Residual { position: f64::INFINITY, rotation: f64::INFINITY };
        let answer = self.0.solve(base_from_tip, near).map_err(|_| far)?;
        match answer.solutions.into_iter().next() {
            Some(solution) => Ok(solution.positions),
            None => Err(answer.closest.map_or(far, |closest| Residual {
                position: closest.position_error,
                rotation: closest.rotation_error,
            })),
        }
    }
}
