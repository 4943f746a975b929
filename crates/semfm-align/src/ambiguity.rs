//! What was seen does not always tell the whole pose: which others fit as well, and about which axis
//! they are turned.
//!
//! Rivals come from everywhere: the other ends of the search, the pose itself turned about each axis
//! until some of its surface has moved, and turns all the way around each axis about which a rival
//! differs. Each is fitted again with its turn kept, and compared by what it leaves unexplained
//! ([`Problem::unexplained`]).

use std::f64::consts::PI;
use std::fmt;

use nalgebra::SymmetricEigen;
use rayon::prelude::*;
use semfm_geom::Task;
use semfm_geom::math::{DQuat, DVec3};

use crate::Result;
use crate::align::Settled;
use crate::correspondence::{NearestBy, Problem};
use crate::sim3::{Sim3, Tangent};
use crate::uncertainty::Uncertainty;

/// A pose that leaves more unexplained by less than this fits as well: a share of what was seen.
/// Edges of masks and stray points reach it; a handle of which a twentieth of the object's picture
/// shows anything has several times as much.
const AS_GOOD: f64 = 0.015;

/// And by this share of the observed points that lie off the pose itself, beyond what noise leaves there:
/// where a model fits badly, it fits some headings a little less badly by chance.
const AS_GOOD_OF_MISFIT: f64 = 0.2;

/// Share that lies off where there is noise only: the mean of d²/(d² + width²) at four standard deviations.
const NOISE_OFF: f64 = 0.05;

/// Rivals that leave more unexplained by this, before they are fitted, are not fitted.
const HOPELESS: f64 = 0.08;

/// Rivals that leave more unexplained by less than this are fitted to all points.
const CLOSE: f64 = 0.05;

/// Points by which that is seen.
const GLANCE_POINTS: usize = 100;

/// An axis about which a small turn leaves this much more unexplained is not turned about.
const STIFF: f64 = 0.4;

/// A pose that explains more by this share takes the place of the one that was found.
pub(crate) const BETTER: f64 = 0.004;

/// A pose is another one where some of the surface lies this far away, in radii of the object: 4 % of
/// its diameter, 5 mm on a mug.
const ELSEWHERE: f64 = 0.08;

/// Points and steps with which rivals are fitted.
const FIT_POINTS: usize = 200;
const FIT_STEPS: usize = 3;

/// Steps in which a turned pose is brought back onto the points by the table.
const COARSE_STEPS: usize = 4;

/// Widths of the kernel in those steps, in shares of the observed diameter.
const COARSE_WIDTHS: [f64; 2] = [0.12, 0.04];

/// Turns that are tried around an axis, evenly spread.
const TURNS: usize = 18;

/// Turns no further apart than this (radians) are one range.
const STEP: f64 = 1.5 * 2.0 * PI / TURNS as f64;

/// Axes that are named at most.
const MAX_AXES: usize = 3;

/// Axes this near each other (cosine) are one.
const SAME_AXIS: f64 = 0.94;

/// A turn smaller than this (radians) has no axis to speak of.
const LEAST_TURN: f64 = 0.02;

/// A turn beyond this (radians, 15°) that fits as well says that nothing is known.
const NOTHING_KNOWN: f64 = 0.26;

/// An axis about which turns are not told apart by what was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct UndeterminedAxis {
    /// Unit vector in the mesh's frame.
    pub axis: DVec3,
    /// Ranges of turns (radians, from −π to π, 0 the pose itself) that fit as well, in order; a turn
    /// that does so alone is a range of no width.
    pub turns: Vec<[f64; 2]>,
}

impl fmt::Display for UndeterminedAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DVec3 { x, y, z } = self.axis;
        write!(
            f,
            "the rotation about ({x:.2}, {y:.2}, {z:.2}) of the mesh is not determined by what was seen: "
        )?;
        let [first, last] = [self.turns[0][0], self.turns[self.turns.len() - 1][1]];
        if self.turns.len() == 1 && last - first > 2.0 * PI - 2.0 * STEP {
            return f.write_str("any turn fits as well");
        }
        f.write_str("turns of ")?;
        for (i, [from, to]) in self.turns.iter().map(|range| range.map(f64::to_degrees)).enumerate()
        {
            f.write_str(if i > 0 { ", " } else { "" })?;
            if to - from < 1.0 {
                write!(f, "{from:.0}°")?
            } else {
                write!(f, "{from:.0}° to {to:.0}°")?
            }
        }
        f.write_str(" fit as well")
    }
}

/// What was seen besides the pose itself.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ambiguity {
    /// Share that the best pose elsewhere explains of what the pose explains.
    pub rival: f64,
    /// Axes about which turns fit as well.
    pub axes: Vec<UndeterminedAxis>,
    /// Poses (camera from the model's inner frame) that fit as well and lie elsewhere.
    pub poses: Vec<Sim3>,
    /// Least standard deviations that follow: radians, and radii.
    pub rotation_std: f64,
    pub shift_std: f64,
    /// A pose that explains more than the one that was found, and what it leaves unexplained.
    pub better: Option<Rival>,
}

/// A pose with what it leaves unexplained.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rival {
    pub pose: Sim3,
    pub unexplained: f64,
}

/// A line in the model's inner frame.
#[derive(Clone, Copy, Debug)]
struct Line {
    point: DVec3,
    direction: DVec3,
}

impl Line {
    /// The turn about the line by an angle.
    fn turned(&self, angle: f64) -> Sim3 {
        Self::rotated(DQuat::from_axis_angle(self.direction, angle), self.point)
    }

    /// Half a turn about an axis across the line, next to the middle of the model.
    fn flip(&self) -> Sim3 {
        let middle = self.point - self.direction * self.point.dot(self.direction);
        Self::rotated(DQuat::from_axis_angle(self.direction.any_orthonormal_vector(), PI), middle)
    }

    fn rotated(rotation: DQuat, centre: DVec3) -> Sim3 {
        Sim3 { scale: 1.0, rotation, translation: centre - rotation * centre }
    }
}

impl Problem<'_> {
    /// Which other poses explain what was seen as well as the settled one does. `candidates` are the
    /// other ends of the search. Where one explains more, and the pose `may_move`, that is all that is
    /// told.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Cancelled`].
    pub fn ambiguity(
        &self,
        settled: &Settled,
        candidates: &[Sim3],
        may_move: bool,
        task: &Task,
    ) -> Result<Ambiguity> {
        let Settled { refined, uncertainty, .. } = settled;
        let compared = Compared::new(self, refined.pose, refined.width);
        let mut rivals = compared.fit_all(candidates.to_vec(), |_| None, task)?;
        if let Some(better) = compared.better(&rivals).filter(|_| may_move) {
            return Ok(Ambiguity { better: Some(better), ..Ambiguity::default() });
        }
        let turn_kept = |start: &Sim3| turn_of(&refined.pose, start);
        rivals.extend(compared.fit_all(compared.nearby(uncertainty), turn_kept, task)?);
        let mut axes = Vec::new();
        while axes.len() < MAX_AXES {
            let least = if axes.is_empty() { STIFF } else { compared.as_good };
            let Some(line) = compared.next_axis(&rivals, &axes, least) else { break };
            rivals.extend(compared.turned_about(line, Sim3::IDENTITY, task)?);
            if axes.is_empty() {
                // An object that is nearly round may stand on its head, at another heading.
                rivals.extend(compared.turned_about(line, line.flip(), task)?);
            }
            axes.push(line);
        }
        if let Some(better) = compared.better(&rivals).filter(|_| may_move) {
            return Ok(Ambiguity { better: Some(better), ..Ambiguity::default() });
        }
        Ok(compared.summary(&rivals, &axes))
    }
}

/// The comparison of rivals with one pose.
struct Compared<'a> {
    problem: &'a Problem<'a>,
    ids: Vec<u32>,
    few: Vec<u32>,
    glance: Vec<u32>,
    /// Distance that counts half, metres.
    width: f64,
    here: Rival,
    /// What the pose leaves unexplained by the points of a glance.
    here_at_a_glance: f64,
    /// A rival that leaves more unexplained by less than this fits as well.
    as_good: f64,
}

impl<'a> Compared<'a> {
    fn new(problem: &'a Problem<'a>, pose: Sim3, width: f64) -> Self {
        let ids = problem.all_ids();
        let width = problem.evidence_width(width);
        let here = Rival { pose, unexplained: problem.unexplained(&pose, &ids, width) };
        let misfit = (problem.off_model(&pose, &ids, width) - NOISE_OFF).max(0.0);
        let as_good = AS_GOOD + AS_GOOD_OF_MISFIT * misfit;
        let [few, glance] = [FIT_POINTS, GLANCE_POINTS].map(|n| problem.observed.subset(n));
        let here_at_a_glance = problem.unexplained(&pose, &glance, 2.0 * width);
        Self { problem, ids, few, glance, width, here, here_at_a_glance, as_good }
    }

    /// The poses fitted to the points, each with no step along the direction that is `held` for it, and
    /// compared.
    fn fit_all(
        &self,
        poses: Vec<Sim3>,
        held: impl Fn(&Sim3) -> Option<Tangent> + Sync,
        task: &Task,
    ) -> Result<Vec<Rival>> {
        task.check()?;
        let fitted: Vec<Option<Rival>> =
            poses.into_par_iter().map(|pose| self.fit(pose, held(&pose))).collect();
        Ok(fitted.into_iter().flatten().collect())
    }

    /// `None` where nothing matches, or what hardly could.
    fn fit(&self, start: Sim3, held: Option<Tangent>) -> Option<Rival> {
        let Self { problem, few, width, here, .. } = self;
        let at_a_glance = problem.unexplained(&start, &self.glance, 2.0 * width);
        if at_a_glance > self.here_at_a_glance + HOPELESS {
            return None;
        }
        let held: Vec<Tangent> = held.into_iter().collect();
        let widths = [2.0 * width, *width];
        let by = NearestBy::Triangles;
        let pose = problem.anneal(start, few, widths, FIT_STEPS, by, &held)?;
        let fitted = Rival { pose, unexplained: problem.unexplained(&pose, &self.ids, *width) };
        if fitted.unexplained > here.unexplained + CLOSE {
            return Some(fitted);
        }
        // As well fitted as the pose itself, or its dents are held against it.
        let widths = [*width, 0.5 * width];
        let pose = problem.anneal(pose, &self.ids, widths, FIT_STEPS, by, &held)?;
        let polished = Rival { pose, unexplained: problem.unexplained(&pose, &self.ids, *width) };
        Some(if polished.unexplained < fitted.unexplained { polished } else { fitted })
    }

    /// The best of the rivals where it explains more than the pose itself.
    fn better(&self, rivals: &[Rival]) -> Option<Rival> {
        let best = rivals.iter().min_by(|a, b| a.unexplained.total_cmp(&b.unexplained))?;
        (best.unexplained < self.here.unexplained - BETTER).then_some(*best)
    }

    /// The pose turned either way about the axes of its own uncertainty, until some of the surface
    /// has moved to another place.
    fn nearby(&self, uncertainty: &Uncertainty) -> Vec<Sim3> {
        let mut poses = Vec::new();
        for along in uncertainty.turns() {
            for sign in [1.0, -1.0] {
                let small = self.here.pose.moved_along(&along, sign * 0.01);
                let speed = self.displacement(&small) / 0.01;
                // A direction in which hardly anything moves is followed for half a turn at most.
                let angle = (1.2 * ELSEWHERE / speed.max(1e-6)).min(PI / 2.0);
                poses.push(self.here.pose.moved_along(&along, sign * angle));
            }
        }
        poses
    }

    /// The largest distance between a place of the surface here and at another pose, in radii.
    fn displacement(&self, other: &Sim3) -> f64 {
        let here = &self.here.pose;
        let samples = self.problem.model.samples.iter().step_by(5);
        samples
            .map(|s| here.apply(s.point).distance(other.apply(s.point)) / here.scale)
            .fold(0.0, f64::max)
    }

    fn fits_as_well(&self, rival: &Rival) -> bool {
        rival.unexplained < self.here.unexplained + self.as_good
    }

    /// The axis of the rival that fits best of those that leave more unexplained by less than `least` and
    /// are turned about none of the axes known.
    fn next_axis(&self, rivals: &[Rival], known: &[Line], least: f64) -> Option<Line> {
        let mut found: Vec<(f64, Line)> = rivals
            .iter()
            .filter(|rival| rival.unexplained < self.here.unexplained + least)
            .filter_map(|rival| Some((rival.unexplained, axis_of(&self.here.pose, &rival.pose)?)))
            .filter(|(_, line)| known.iter().all(|axis| !same(axis, line)))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.first().map(|(_, line)| *line)
    }

    /// The pose, moved in the inner frame by `moved` first, and turned all the way around a line, fitted
    /// with the turns kept.
    fn turned_about(&self, line: Line, moved: Sim3, task: &Task) -> Result<Vec<Rival>> {
        task.check()?;
        let held = turn(line.direction);
        let size = self.problem.observed.diameter();
        let first = usize::from(moved == Sim3::IDENTITY);
        let poses = (first..TURNS).into_par_iter().filter_map(|i| {
            let start = self.here.pose * moved * line.turned(2.0 * PI * i as f64 / TURNS as f64);
            let widths = COARSE_WIDTHS.map(|share| share * size);
            let (by, few) = (NearestBy::Table, &self.few);
            self.problem.anneal(start, few, widths, COARSE_STEPS, by, &[held])
        });
        self.fit_all(poses.collect(), |_| Some(held), task)
    }

    fn summary(&self, rivals: &[Rival], lines: &[Line]) -> Ambiguity {
        let explained = |rival: &Rival| 2.0 - rival.unexplained;
        let elsewhere: Vec<&Rival> =
            rivals.iter().filter(|rival| self.displacement(&rival.pose) > ELSEWHERE).collect();
        let rival = elsewhere.iter().map(|rival| explained(rival)).fold(0.0, f64::max);
        let as_good: Vec<&Rival> =
            elsewhere.into_iter().filter(|rival| self.fits_as_well(rival)).collect();
        let turn_to = |rival: &&Rival| turn_vector(relative(&self.here.pose, &rival.pose).rotation);
        let largest = as_good.iter().map(|r| turn_to(r).length()).fold(0.0, f64::max);
        let axes = lines.iter().filter_map(|line| self.turns_about(line, &as_good)).collect();
        let shift = as_good.iter().map(|rival| {
            let middle = |pose: &Sim3| pose.translation;
            middle(&rival.pose).distance(middle(&self.here.pose)) / self.here.pose.scale
        });
        Ambiguity {
            rival: rival / explained(&self.here),
            axes,
            rotation_std: if largest > NOTHING_KNOWN { PI } else { largest },
            shift_std: shift.fold(0.0, f64::max),
            poses: as_good.iter().map(|rival| rival.pose).collect(),
            better: None,
        }
    }

    /// The turns about one axis that fit as well.
    fn turns_about(&self, line: &Line, as_good: &[&Rival]) -> Option<UndeterminedAxis> {
        let mut turns: Vec<f64> = as_good
            .iter()
            .filter_map(|rival| {
                let turn = turn_vector(relative(&self.here.pose, &rival.pose).rotation);
                let along = turn.dot(line.direction);
                let on_axis = along.abs() > SAME_AXIS * turn.length();
                // Half a turn is the same either way.
                on_axis.then_some(if along < -PI + STEP / 3.0 { along + 2.0 * PI } else { along })
            })
            .collect();
        if turns.is_empty() {
            return None;
        }
        turns.push(0.0);
        turns.sort_by(f64::total_cmp);
        let mut ranges: Vec<[f64; 2]> = Vec::new();
        for turn in turns {
            match ranges.last_mut() {
                Some(range) if turn - range[1] < STEP => range[1] = turn,
                _ => ranges.push([turn, turn]),
            }
        }
        Some(UndeterminedAxis { axis: line.direction, turns: ranges })
    }
}

/// `b` as seen from `a`: in the inner frame of the pose `a`.
fn relative(a: &Sim3, b: &Sim3) -> Sim3 {
    a.inverse() * *b
}

/// Axis times angle, at most π long.
fn turn_vector(rotation: DQuat) -> DVec3 {
    (if rotation.w < 0.0 { -rotation } else { rotation }).to_scaled_axis()
}

/// The direction that holds the turn about an axis.
fn turn(axis: DVec3) -> Tangent {
    Tangent::from_column_slice(&[axis.x, axis.y, axis.z, 0.0, 0.0, 0.0, 0.0])
}

/// The direction that holds the turn from one pose to another.
fn turn_of(from: &Sim3, to: &Sim3) -> Option<Tangent> {
    let turned = turn_vector(relative(from, to).rotation);
    turned.try_normalize().map(turn)
}

/// The axis that one pose is turned about to become another: the line of the points that keep their
/// place across it. `None` for hardly any turn.
///
/// With the turn θ about the unit vector a and the shift t⊥ across it, the line goes through
///
/// > p = ½ (t⊥ + cot(θ/2) a × t⊥)
fn axis_of(from: &Sim3, to: &Sim3) -> Option<Line> {
    let motion = relative(from, to);
    let turned = turn_vector(motion.rotation);
    let angle = turned.length();
    if angle < LEAST_TURN {
        return None;
    }
    // One of the two directions, so that the axis of a turn and of its opposite is the same.
    let sign = turned[turned.abs().max_position()].signum();
    let (direction, angle) = (sign * turned / angle, sign * angle);
    let shift = motion.translation - direction * motion.translation.dot(direction);
    let point = 0.5 * (shift + direction.cross(shift) / (0.5 * angle).tan());
    Some(Line { point, direction })
}

fn same(a: &Line, b: &Line) -> bool {
    a.direction.dot(b.direction).abs() > SAME_AXIS
}

impl Uncertainty {
    /// For each axis of the rotation's uncertainty the motion of the whole pose that a turn about it
    /// brings along at the least cost, per radian.
    fn turns(&self) -> Vec<Tangent> {
        let covariance = self.covariance();
        let eigen = SymmetricEigen::new(covariance.fixed_view::<3, 3>(0, 0).into_owned());
        (0..3)
            .filter(|&i| eigen.eigenvalues[i] > 0.0)
            .map(|i| {
                let axis = eigen.eigenvectors.column(i);
                covariance.fixed_view::<7, 3>(0, 0) * axis / eigen.eigenvalues[i]
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_between_two_poses_is_the_line_that_stays() {
        let a = Sim3 { scale: 0.1, rotation: DQuat::from_rotation_x(0.4), translation: DVec3::Z };
        let point = DVec3::new(0.2, -0.3, 0.0);
        let rotation = DQuat::from_rotation_z(1.2);
        let turned = Sim3 { scale: 1.0, rotation, translation: point - rotation * point };
        let line = axis_of(&a, &(a * turned)).unwrap();
        assert!(line.direction.distance(DVec3::Z) < 1e-12);
        assert!(line.point.distance(point) < 1e-12, "{}", line.point);
        assert!(axis_of(&a, &a).is_none());
    }
}
