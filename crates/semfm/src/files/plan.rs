//! `plan.json`: what became of the grasps that an arm was to carry out.

use std::path::Path;

use semfm_motion::{GateCount, GraspOutcome, MotionSettings, SegmentKind};
use serde::{Deserialize, Serialize};

use super::write_json;
use crate::{GraspPlan, Result};

/// The format that is written.
pub const FORMAT: &str = "semfm.plan/1";

/// What became of the grasps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanFile {
    /// `semfm.plan/1`.
    pub format: String,
    /// The grasp that is carried out: its place in the file of grasps, from 0; `None` where none can be.
    pub grasp: Option<usize>,
    /// Seconds of each segment of the motion, in order.
    pub segments: Vec<SegmentSeconds>,
    /// States of the finished motion that were looked at again.
    pub n_replayed: usize,
    /// Grasps that did not become the motion, counted by the first gate that each did not pass.
    pub gates: Vec<GateCount>,
    /// What became of each grasp.
    pub outcomes: Vec<GraspOutcome>,
    /// Where the start itself touches something.
    pub start_contact: Option<StartContactRecord>,
    /// What was assumed, in words.
    pub notes: Vec<String>,
    /// How the motion was made.
    pub settings: PlanSettingsRecord,
}

/// The time that a segment takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SegmentSeconds {
    /// What it is for.
    pub kind: SegmentKind,
    /// Seconds.
    pub seconds: f64,
}

/// What the start touches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartContactRecord {
    /// One of the two things.
    pub a: String,
    /// The other one.
    pub b: String,
    /// How far one is inside of the other, metres.
    pub depth: f64,
    /// The nearest free joint values that were found.
    pub nearest_free: Option<Vec<f64>>,
}

/// The settings of a [`PlanFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanSettingsRecord {
    /// Seed of everything drawn by chance.
    pub seed: u64,
    /// Length of the straight way to the grasp, metres.
    pub approach: f64,
    /// The straight way after it, in the frame of the arm's base, metres.
    pub lift: [f64; 3],
    /// Share of the joints' limits that is used.
    pub speed: f64,
    /// The same on straight lines.
    pub line_speed: f64,
    /// Most iterations of each search.
    pub iterations: usize,
    /// Grasps for which a path is searched at most.
    pub searches: usize,
    /// Version of the program.
    pub version: String,
}

impl PlanFile {
    /// The file of a plan.
    pub fn new(plan: &GraspPlan) -> Self {
        let answer = &plan.answer;
        let segments = answer.motion.iter().flat_map(|motion| &motion.trajectory.segments);
        let seconds =
            |points: &[semfm_motion::TrajectoryPoint]| match (points.first(), points.last()) {
                (Some(first), Some(last)) => last.time - first.time,
                _ => 0.0,
            };
        Self {
            format: FORMAT.into(),
            grasp: answer.motion.as_ref().map(|motion| motion.grasp),
            segments: segments
                .map(|segment| SegmentSeconds {
                    kind: segment.kind,
                    seconds: seconds(&segment.points),
                })
                .collect(),
            n_replayed: answer.motion.as_ref().map_or(0, |motion| motion.n_replayed),
            gates: answer.gates(),
            outcomes: answer.outcomes.clone(),
            start_contact: answer.start_contact.as_ref().map(|start| StartContactRecord {
                a: start.contact.a.clone(),
                b: start.contact.b.clone(),
                depth: start.contact.depth,
                nearest_free: start.nearest_free.clone(),
            }),
            notes: plan.notes.clone(),
            settings: PlanSettingsRecord::new(&plan.settings),
        }
    }

    /// Its JSON.
    pub fn to_json(&self) -> serde_json::Value {
        super::to_json(self)
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`semfm_geom::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        write_json(path, self)
    }
}

impl PlanSettingsRecord {
    fn new(settings: &MotionSettings) -> Self {
        Self {
            seed: settings.seed,
            approach: settings.approach,
            lift: settings.lift.to_array(),
            speed: settings.speed,
            line_speed: settings.line_speed,
            iterations: settings.iterations,
            searches: settings.searches,
            version: env!("CARGO_PKG_VERSION").into(),
        }
    }
}
