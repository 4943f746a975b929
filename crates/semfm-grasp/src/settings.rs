//! What is asked of a grasp: limits, preferences, and how hard to look.

use std::ops::RangeInclusive;

use semfm_geom::math::DVec3;

use crate::score_weights::ScoreWeights;
use crate::{Error, Result};

/// Depth within which pads give way unless [`GraspSettings::compliance`] says otherwise, metres.
pub(crate) const PAD_COMPLIANCE: f64 = 1.5e-3;

/// Settings of [`find_grasps`](crate::find_grasps); the default fits grippers and objects of a size
/// that a human hand holds.
#[derive(Clone, Debug, PartialEq)]
pub struct GraspSettings {
    /// Surface points from which candidates are grown; each gives some twenty.
    pub n_samples: usize,
    /// Rounds in which neighbours of the grasps found are tried: each finds what the samples missed
    /// one step farther out. With 0 the best ones are not moved to where each is best, either.
    pub neighbour_rounds: usize,
    /// The same seed gives the same grasps at every thread count.
    pub seed: u64,
    /// Coulomb friction coefficient μ between pad and object.
    pub friction: f64,
    /// Force with which each pad presses, newtons.
    pub grip_force: f64,
    /// Mass of the object, kilograms, where it is known: the score is then the probability that the grasp
    /// holds. Without it the score ranks grasps as for an object of .3 kg.
    pub mass: Option<f64>,
    /// Depth within which the pads give way and touch, metres.
    pub compliance: f64,
    /// How far the gripper comes straight from behind, along its approach, metres.
    pub retreat: f64,
    /// Grasps to return.
    pub top: usize,
    /// How much score the returned grasps may give up to differ from each other: each has at least
    /// (1 − `diversity`) times the score of the last that a plain ranking would return. 0 returns the best
    /// ones, however near each other.
    pub diversity: f64,
    /// Which of the grasps that passed every check are returned.
    pub selection: Selection,
    /// How far the object may stand from where it is said to stand, metres: before the pads close, the gripper keeps
    /// at least so far from it, from the table and from the scene.
    pub pose_margin: f64,
    /// Two grasps are one where they are nearer than this in both place and direction.
    pub separation: Separation,
    /// What a grasp must satisfy.
    pub limits: Limits,
    /// The direction in which the demonstrator's gripper came, in the object's frame.
    pub demonstrated_approach: Option<DVec3>,
    /// Direction of gravity in the object's frame; without it, away from the scene's table, and
    /// without that, the worst direction.
    pub gravity: Option<DVec3>,
    /// How much each term counts in the score.
    pub weights: ScoreWeights,
}

/// Which of the grasps that passed every check are returned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Selection {
    /// The best ones, of near ones the best, as different as [`GraspSettings::diversity`] says.
    #[default]
    Best,
    /// Drawn at random from all that passed, whatever their score: to measure how good a score is.
    Random,
}

/// What a grasp must satisfy to be returned.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Distances between the closed pads, metres; the whole opening of the gripper where absent.
    pub width: Option<RangeInclusive<f64>>,
    /// Directions of approach.
    pub approach: Option<ApproachCone>,
    /// Least distance of the open gripper to object and scene, metres.
    pub clearance: f64,
    /// Least distance of the gripper to the table, metres.
    pub table_clearance: f64,
    /// Share of each pad's contact that must lie in the region, 0 to 1.
    pub pad_in_region: f64,
    /// Share of each pad's area that must be in contact, 0 to 1.
    pub pad_in_contact: f64,
}

/// Approaches within `half_angle` (radians) of `axis` (object's frame, any length).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachCone {
    /// The middle of the cone.
    pub axis: DVec3,
    /// Radians.
    pub half_angle: f64,
}

/// How far apart two grasps must be, in one of the two, to be two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Metres.
    pub translation: f64,
    /// Radians.
    pub rotation: f64,
}

impl Default for GraspSettings {
    fn default() -> Self {
        Self {
            n_samples: 1000,
            neighbour_rounds: 2,
            seed: 0,
            friction: 0.5,
            grip_force: 30.0,
            mass: None,
            compliance: PAD_COMPLIANCE,
            retreat: 0.1,
            top: 20,
            diversity: 0.1,
            selection: Selection::Best,
            pose_margin: 0.0,
            separation: Separation { translation: 0.01, rotation: 15f64.to_radians() },
            limits: Limits::default(),
            demonstrated_approach: None,
            gravity: None,
            weights: ScoreWeights::default(),
        }
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            width: None,
            approach: None,
            clearance: 0.0,
            table_clearance: 1e-3,
            pad_in_region: 0.5,
            pad_in_contact: 0.03,
        }
    }
}

impl GraspSettings {
    /// Says which number is out of its range.
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub fn check(&self) -> Result<()> {
        share("diversity", self.diversity)?;
        share("limits.pad_in_region", self.limits.pad_in_region)?;
        share("limits.pad_in_contact", self.limits.pad_in_contact)?;
        length("limits.clearance", self.limits.clearance)?;
        length("limits.table_clearance", self.limits.table_clearance)?;
        length("retreat", self.retreat)?;
        length("pose_margin", self.pose_margin)?;
        length("separation.translation", self.separation.translation)?;
        within("separation.rotation", self.separation.rotation, 0.0, 3.2, "0 to π")?;
        within("compliance", self.compliance, 1e-5, 0.1, "0.01 mm to 0.1 m")?;
        within("friction", self.friction, 1e-3, 10.0, "0.001 to 10")?;
        within("grip_force", self.grip_force, 0.1, 1e4, "0.1 to 10 000 N")?;
        if let Some(mass) = self.mass {
            within("mass", mass, 1e-4, 1e3, "0.1 g to 1000 kg")?;
        }
        within("n_samples", self.n_samples as f64, 1.0, 1e7, "1 to 10 million")?;
        within("top", self.top as f64, 1.0, f64::MAX, "at least 1")?;
        if let Some(width) = &self.limits.width {
            let (least, most) = (*width.start(), *width.end());
            if !(least >= 0.0 && most >= least) {
                let found = format!("{least} to {most}");
                let expected = "0 ≤ least ≤ most (metres)".into();
                return Err(Error::OutOfRange { what: "limits.width", expected, found });
            }
        }
        if let Some(cone) = self.limits.approach {
            direction("limits.approach.axis", cone.axis)?;
            within("limits.approach.half_angle", cone.half_angle, 0.0, 3.2, "0 to π")?;
        }
        for (what, vector) in
            [("demonstrated_approach", self.demonstrated_approach), ("gravity", self.gravity)]
        {
            vector.map_or(Ok(()), |vector| direction(what, vector))?;
        }
        self.weights.check()
    }
}

fn share(what: &'static str, x: f64) -> Result<()> {
    within(what, x, 0.0, 1.0, "0 to 1")
}

fn length(what: &'static str, x: f64) -> Result<()> {
    within(what, x, 0.0, 10.0, "0 to 10 m")
}

fn within(what: &'static str, x: f64, least: f64, most: f64, expected: &str) -> Result<()> {
    if x >= least && x <= most {
        return Ok(());
    }
    Err(Error::OutOfRange { what, expected: expected.into(), found: x.to_string() })
}

pub(crate) fn direction(what: &'static str, vector: DVec3) -> Result<()> {
    if vector.is_finite() && vector.length() > 1e-12 {
        return Ok(());
    }
    let expected = "a direction, finite and not zero".into();
    Err(Error::OutOfRange { what, expected, found: vector.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_passes_and_a_bad_number_is_named() {
        GraspSettings::default().check().unwrap();
        let bad = GraspSettings { friction: f64::NAN, ..GraspSettings::default() };
        assert!(bad.check().unwrap_err().to_string().contains("friction"));
        let gravity = Some(DVec3::ZERO);
        assert!(GraspSettings { gravity, ..GraspSettings::default() }.check().is_err());
    }
}
