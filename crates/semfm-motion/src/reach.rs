//! Which joint values reach the grasps, and which of them are best.

use nalgebra::DMatrix;
use semfm_geom::Task;
use semfm_robot::{Arm, InverseKinematics};

use crate::{Obstruction, Result, TargetGrasp};

/// Distance of a joint from its nearest limit at which the quality of joint values is half of what it is far away,
/// radians or metres. A tenth of a radian is what a straight way of 10 cm asks of a wrist.
const NEAR_LIMIT: f64 = 0.1;

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
    /// Where there is none, by how much the best try missed.
    pub obstruction: Option<Obstruction>,
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
    let mut reached = Reached { grasp, candidates: Vec::new(), obstruction: None };
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
            reached.obstruction = Some(Obstruction::Unreachable {
                position: closest.position_error,
                rotation: closest.rotation_error,
                at_limits: joints_at_limits(kinematics.arm(), &closest.positions),
            });
        }
    }
    Ok(reached)
}

/// Gives each way its quality and sorts.
///
/// > quality = score · m / (m + 0.1) · √(w / w_max)
///
/// with m the distance of the joint that is nearest to a limit, and w Yoshikawa's manipulability √det(J Jᵀ)
/// (Manipulability of Robotic Mechanisms, IJRR 1985), w_max the greatest of all ways of all grasps: it has no unit of
/// its own that two arms would share.
fn rank(arm: &Arm, reached: &mut [Reached]) {
    let manipulabilities: Vec<Vec<f64>> = reached
        .iter()
        .map(|reached| reached.candidates.iter().map(|way| manipulability(arm, &way.q)).collect())
        .collect();
    let most = manipulabilities.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    for (reached, manipulabilities) in reached.iter_mut().zip(manipulabilities) {
        for (way, manipulability) in reached.candidates.iter_mut().zip(manipulabilities) {
            let margin = limit_margin(arm, &way.q);
            let margin_term = if margin.is_finite() { margin / (margin + NEAR_LIMIT) } else { 1.0 };
            way.quality *= margin_term * (manipulability / most).sqrt();
        }
        // Stable: among equals the one nearest to the start comes first.
        reached.candidates.sort_by(|a, b| b.quality.total_cmp(&a.quality));
    }
    let best = |reached: &Reached| reached.candidates.first().map_or(-1.0, |way| way.quality);
    reached.sort_by(|a, b| best(b).total_cmp(&best(a)));
}

/// Distance of the joint that is nearest to a limit, radians or metres; infinite where no joint has one.
fn limit_margin(arm: &Arm, q: &[f64]) -> f64 {
    let margins =
        arm.joints().iter().zip(q).map(|(joint, q)| (q - joint.lower).min(joint.upper - q));
    margins.fold(f64::INFINITY, f64::min).max(0.0)
}

/// √det(J Jᵀ); of arms with less than six joints √det(Jᵀ J).
fn manipulability(arm: &Arm, q: &[f64]) -> f64 {
    let n = arm.n_joints();
    let mut numbers = vec![0.0; 6 * n];
    arm.jacobian(q, &mut numbers);
    let jacobian = DMatrix::from_row_slice(6, n, &numbers); // (6 × n)
    let square = if n < 6 { jacobian.tr_mul(&jacobian) } else { &jacobian * jacobian.transpose() };
    square.determinant().max(0.0).sqrt()
}

/// Names of the joints that stand at a limit.
fn joints_at_limits(arm: &Arm, q: &[f64]) -> Vec<String> {
    arm.joints()
        .iter()
        .zip(q)
        .filter(|(joint, q)| **q - joint.lower < AT_LIMIT || joint.upper - **q < AT_LIMIT)
        .map(|(joint, _)| joint.name.clone())
        .collect()
}
