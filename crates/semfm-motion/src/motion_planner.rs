//! From ranked grasps to a motion: each grasp passes the gates in order, and the first that passes all of them becomes
//! the motion.

use std::sync::Arc;

use semfm_geom::Task;
use semfm_robot::{Arm, IkSettings, InverseKinematics, Preference};

use crate::cartesian::{LineArm, LineFault, StraightLine, follow_line};
use crate::motion_request::{GraspMotion, NearestMiss, StartContact};
use crate::planning::joint_space::between;
use crate::reach::{BestTry, Candidate, Reached, joints_at_limits, reach};
use crate::step_checks::{HandBodies, StepChecks};
use crate::timed_motion::{MotionCurves, TimedMotion, timed_motion};
use crate::{
    BlendSettings, CollisionChecker, CollisionModel, Contact, Curve, Ending, Error, Gate,
    GraspOutcome, JointRange, JointSpace, MotionAnswer, MotionRequest, Obstruction, Planned, Pose,
    Result, TargetGrasp, blend, plan_path, shorten,
};

/// Farthest that corners between the steps of a straight line are cut, radians: with an arm of a metre the tip leaves
/// the line by less than a millimetre.
const LINE_TUBE: f64 = 1e-3;

/// States of a motion that was refused, at which the contact to report is looked for.
const N_LOOKS: usize = 64;

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
        let ik_settings = IkSettings {
            seed: settings.seed,
            restarts: settings.restarts,
            solutions: settings.solutions,
            ..Default::default()
        };
        let kinematics = InverseKinematics::new(self.arm().clone(), ik_settings)?;
        let is_symmetric = request.hand.is_symmetric;
        let reached = reach(&kinematics, &request.grasps, is_symmetric, &request.start, task)?;
        let mut answer = MotionAnswer::default();
        let mut searches = 0;
        for (rank, reached) in reached.iter().enumerate() {
            task.step("plan", rank, request.grasps.len())?;
            let is_over = answer.motion.is_some() || searches == settings.searches;
            let ending = if is_over && !reached.candidates.is_empty() {
                Ending::NotTried
            } else {
                match search.try_grasp(reached, &mut searches, &mut answer.start_contact)? {
                    Ok(motion) => {
                        answer.motion = Some(motion);
                        Ending::Planned
                    }
                    Err(stop) => {
                        let (gate, obstruction) = (stop.gate, stop.obstruction.clone());
                        keep_miss(&mut answer.nearest_miss, reached.grasp, stop);
                        Ending::Stopped { gate, obstruction }
                    }
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

/// A gate that a way to take a grasp did not pass.
struct Stop {
    gate: Gate,
    obstruction: Obstruction,
    /// Joint values where it ends.
    q: Vec<f64>,
    target: TargetGrasp,
}

/// What a step of a way gives.
type Passed<T> = std::result::Result<T, Stop>;

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
    ) -> Result<Passed<GraspMotion>> {
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
        if let Some(BestTry { target, q, obstruction }) = reached.best_try.clone() {
            note(&mut farthest, Stop { gate: Gate::Reach, obstruction, q, target });
        }
        Ok(Err(farthest.unwrap_or_else(|| {
            let what = "inverse kinematics gave neither joint values nor a best try".into();
            let target = self.request.grasps[reached.grasp].clone();
            let obstruction = Obstruction::Other { what };
            Stop { gate: Gate::Reach, obstruction, q: self.request.start.clone(), target }
        })))
    }

    /// A way to take a grasp through all gates that do not depend on the start.
    fn way<'b>(&self, candidate: &'b Candidate) -> Result<Passed<Way<'b>>> {
        let Candidate { target, q, .. } = candidate;
        let settings = &self.request.settings;
        let checks = StepChecks::new(&self.planner.model, self.request, &self.hand, target, q)?;
        let stop = |gate, obstruction, q: &[f64]| {
            Ok(Err(Stop { gate, obstruction, q: q.to_vec(), target: target.clone() }))
        };
        if let Some(contact) = checks.approach.first_contact(q) {
            return stop(Gate::Grasp, Obstruction::contact(contact), q);
        }
        // Backwards: the grasp is what must be met.
        let at_grasp = target.base_from_tip();
        let before = target.base_from_tip_before(settings.approach);
        let back = StraightLine { from: at_grasp, to: before };
        let mut approach = match self.line(&back, q, &checks.approach) {
            Ok(waypoints) => waypoints,
            Err((obstruction, q)) => return stop(Gate::Approach, obstruction, &q),
        };
        approach.reverse();
        if let Some(contact) = checks.free.first_contact(&approach[0]) {
            return stop(Gate::PreGrasp, Obstruction::contact(contact), &approach[0]);
        }
        for closing in &checks.closing {
            if let Some(contact) = closing.first_contact(q) {
                return stop(Gate::Close, Obstruction::contact(contact), q);
            }
        }
        let above = Pose::from_translation(settings.lift) * at_grasp;
        let up = StraightLine { from: at_grasp, to: above };
        let lift = match self.line(&up, q, &checks.lift) {
            Ok(waypoints) => waypoints,
            Err((obstruction, q)) => return stop(Gate::Lift, obstruction, &q),
        };
        let last = lift.last().unwrap_or(q);
        if let Some(contact) = checks.lifted.first_contact(last) {
            return stop(Gate::Lift, Obstruction::contact(contact), last);
        }
        Ok(Ok(Way { candidate, checks, approach, lift }))
    }

    /// Joint values along a straight line on which nothing touches; else why not, and joint values where it ends.
    fn line(
        &self,
        line: &StraightLine,
        start: &[f64],
        checker: &CollisionChecker,
    ) -> std::result::Result<Vec<Vec<f64>>, (Obstruction, Vec<f64>)> {
        let length = line.length();
        let arm = Nearby(&self.nearby);
        let followed = follow_line(&arm, line, start, &self.request.settings.line);
        let waypoints = followed.map_err(|LineFault { at, q, beyond }| {
            let at_limits = joints_at_limits(self.nearby.arm(), &beyond);
            (Obstruction::Line { at, length, at_limits }, q)
        })?;
        for pair in waypoints.windows(2) {
            if checker.motion_is_free(&pair[0], &pair[1]) {
                continue;
            }
            let Some((q, contact)) = contact_between(checker, &pair[0], &pair[1]) else {
                let what = "something comes nearer than the contact distance on the line".into();
                return Err((Obstruction::Other { what }, pair[0].clone()));
            };
            let at = arm.tip(&q).translation.distance(line.from.translation);
            let Contact { a, b, depth } = contact;
            return Err((Obstruction::ContactOnLine { at, length, a, b, depth }, q));
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
    ) -> Result<Passed<GraspMotion>> {
        let (request, space) = (self.request, &self.planner.space);
        let stop = |gate, obstruction, target: &TargetGrasp| {
            let (q, target) = (request.start.clone(), target.clone());
            Ok(Err(Stop { gate, obstruction, q, target }))
        };
        // Both turns of the hand are as wide, so the first way's checks speak for the start and for all pre-grasps.
        let (free, first) = (&ways[0].checks.free, &ways[0].candidate.target);
        if let Some(contact) = free.first_contact(&request.start) {
            if start_contact.is_none() {
                let nearest_free = free.nearest_free(&request.start, request.settings.seed);
                *start_contact = Some(StartContact { contact: contact.clone(), nearest_free });
            }
            return stop(Gate::Path, Obstruction::contact(contact), first);
        }
        *searches += 1;
        let goals: Vec<Vec<f64>> = ways.iter().map(|way| way.approach[0].clone()).collect();
        let path = match plan_path(space, free, &request.start, &goals, &request.settings.plan())? {
            Planned::Path(path) => path,
            Planned::NotFound { iterations, .. } => {
                return stop(Gate::Path, Obstruction::NoPath { iterations }, first);
            }
            Planned::StartNotFree | Planned::NoGoalFree => {
                let what = "start or pre-grasps are not free".into();
                return stop(Gate::Path, Obstruction::Other { what }, first);
            }
        };
        let way = &ways[path.goal];
        let shorter = shorten(free, &path.waypoints, &request.settings.shorten());
        // Continuous joints may arrive some turns away: the straight lines go on from there.
        let arrival = shorter.last().unwrap_or(&request.start);
        let offset: Vec<f64> = arrival.iter().zip(&way.approach[0]).map(|(a, b)| a - b).collect();
        let curves = MotionCurves {
            to_pre_grasp: blend(free, &shorter, &BlendSettings { tube: request.settings.tube })?,
            approach: line_curve(&way.checks.approach, &way.approach, &offset)?,
            lift: line_curve(&way.checks.lift, &way.lift, &offset)?,
        };
        let target = &way.candidate.target;
        match timed_motion(space, self.planner.arm(), &curves, target, &way.checks, request)? {
            Ok(TimedMotion { trajectory, n_replayed }) => {
                Ok(Ok(GraspMotion { grasp, target: target.clone(), trajectory, n_replayed }))
            }
            Err(obstruction) => stop(Gate::Replay, obstruction, target),
        }
    }
}

/// A curve through the waypoints of a straight line, each joint moved by `offset`.
fn line_curve(checker: &CollisionChecker, waypoints: &[Vec<f64>], offset: &[f64]) -> Result<Curve> {
    let moved = |q: &Vec<f64>| q.iter().zip(offset).map(|(q, offset)| q + offset).collect();
    let moved: Vec<Vec<f64>> = waypoints.iter().map(moved).collect();
    blend(checker, &moved, &BlendSettings { tube: LINE_TUBE })
}

/// Keeps the stop of the way that came farther.
fn note(farthest: &mut Option<Stop>, stop: Stop) {
    if farthest.as_ref().is_none_or(|known| stop.gate > known.gate) {
        *farthest = Some(stop);
    }
}

/// Keeps the way that came farthest of all grasps.
fn keep_miss(nearest: &mut Option<NearestMiss>, grasp: usize, stop: Stop) {
    if nearest.as_ref().is_none_or(|known| stop.gate > known.gate) {
        let Stop { gate, obstruction, q, target } = stop;
        *nearest = Some(NearestMiss { grasp, target, gate, obstruction, positions: q });
    }
}

/// The first contact of a motion that is not free, with the joint values where it is.
fn contact_between(
    checker: &CollisionChecker,
    from: &[f64],
    to: &[f64],
) -> Option<(Vec<f64>, Contact)> {
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

    fn reach(&self, base_from_tip: &Pose, near: &[f64]) -> std::result::Result<Vec<f64>, Vec<f64>> {
        let answer = self.0.solve(base_from_tip, near).map_err(|_| near.to_vec())?;
        match answer.solutions.into_iter().next() {
            Some(solution) => Ok(solution.positions),
            None => Err(answer.closest.map_or_else(|| near.to_vec(), |closest| closest.positions)),
        }
    }
}
