//! Which joint values reach the grasps, and which of them are best.

use semfm_geom::Task;
use semfm_robot::{Arm, InverseKinematics};

use crate::{Obstruction, Result, TargetGrasp};

/// Share of half its range from a limit at which a joint makes joint values half as good as they are in the middle: a
/// straight way of 10 cm asks about as much of a wrist.
const NEAR_LIMIT: f64 = 0.05;

/// A joint this near to a limit stands at it, radians or metres.
const AT_LIMIT: f64 = 1e-6;

/// A way to take a grasp: a turn of the hand with joint values.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// The grasp with its turn.
    pub target: TargetGrasp,
    /// Joint values that reach it.
    pub q: Vec<f64>,
    /// How good it is: see [`rank`].
    pub quality: f64,
}

/// What inverse kinematics found for a grasp.
#[derive(Clone, Debug)]
pub(crate) struct Reached {
    /// The grasp's place in the list.
    pub grasp: usize,
    /// Ways to take it, best first.
    pub candidates: Vec<Candidate>,
    /// Where there is none, the best try.
    pub best_try: Option<BestTry>,
}

/// The try that came closest to a grasp that cannot be reached.
#[derive(Clone, Debug)]
pub(crate) struct BestTry {
    /// The grasp with its turn.
    pub target: TargetGrasp,
    /// Joint values.
    pub q: Vec<f64>,
    /// By how much they miss.
    pub obstruction: Obstruction,
}

/// Ways to take each grasp; grasps in the order of their best way, those that cannot be reached at the end.
pub(crate) fn reach(
    kinematics: &InverseKinematics,
    grasps: &[TargetGrasp],
    is_symmetric: bool,
    near: &[f64],
    task: &Task,
) -> Result<Vec<Reached>> {
    let mut reached = Vec::new();
    for (grasp, target) in grasps.iter().enumerate() {
        task.step("reach", grasp, grasps.len())?;
        reached.push(reach_one(kinematics, grasp, target, is_symmetric, near)?);
    }
    rank(kinematics.arm(), &mut reached);
    Ok(reached)
}

fn reach_one(
    kinematics: &InverseKinematics,
    grasp: usize,
    target: &TargetGrasp,
    is_symmetric: bool,
    near: &[f64],
) -> Result<Reached> {
    let mut reached = Reached { grasp, candidates: Vec::new(), best_try: None };
    let turned = is_symmetric.then(|| target.turned());
    let mut least_error = f64::INFINITY;
    for target in std::iter::once(target).chain(&turned) {
        let answer = kinematics.solve(&target.base_from_tip(), near)?;
        let ways = answer.solutions.into_iter().map(|solution| Candidate {
            target: target.clone(),
            q: solution.positions,
            quality: target.score,
        });
        reached.candidates.extend(ways);
        let Some(closest) = answer.closest else { continue };
        let error = closest.position_error.hypot(closest.rotation_error);
        if error < least_error {
            least_error = error;
            let obstruction = Obstruction::Unreachable {
                position: closest.position_error,
                rotation: closest.rotation_error,
                at_limits: joints_at_limits(kinematics.arm(), &closest.positions),
            };
            let (target, q) = (target.clone(), closest.positions);
            reached.best_try = Some(BestTry { target, q, obstruction });
        }
    }
    Ok(reached)
}

/// Gives each way its quality and sorts.
///
/// > quality = score · m / (m + 0.05) · √(w / w_max)
///
/// with m the share of its half range that the joint nearest to a limit stands from it ([`Arm::limit_margin`]), w
/// Yoshikawa's manipulability ([`Arm::manipulability`]), and w_max the greatest of all ways of all grasps: w has no unit
/// that two arms would share.
fn rank(arm: &Arm, reached: &mut [Reached]) {
    let manipulabilities: Vec<Vec<f64>> = reached
        .iter()
        .map(|reached| reached.candidates.iter().map(|way| arm.manipulability(&way.q)).collect())
        .collect();
    let most = manipulabilities.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    for (reached, manipulabilities) in reached.iter_mut().zip(manipulabilities) {
        for (way, manipulability) in reached.candidates.iter_mut().zip(manipulabilities) {
            let margin = arm.limit_margin(&way.q).max(0.0);
            way.quality *= margin / (margin + NEAR_LIMIT) * (manipulability / most).sqrt();
        }
        // Stable: among equals the one nearest to the start comes first.
        reached.candidates.sort_by(|a, b| b.quality.total_cmp(&a.quality));
    }
    let best = |reached: &Reached| reached.candidates.first().map_or(-1.0, |way| way.quality);
    reached.sort_by(|a, b| best(b).total_cmp(&best(a)));
}

/// Names of the joints that stand at a limit.
pub(crate) fn joints_at_limits(arm: &Arm, q: &[f64]) -> Vec<String> {
    arm.joints()
        .iter()
        .zip(q)
        .filter(|(joint, q)| **q - joint.lower < AT_LIMIT || joint.upper - **q < AT_LIMIT)
        .map(|(joint, _)| joint.name.clone())
        .collect()
}
