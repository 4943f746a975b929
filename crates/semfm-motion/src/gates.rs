//! What kept a grasp from becoming a motion: the first gate that it did not pass, with its numbers.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::Contact;

/// The gates in the order in which a grasp passes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// Joint values put the tip where the grasp wants it.
    Reach,
    /// Nothing touches at the grasp but fingers and object.
    Grasp,
    /// The straight line from before the grasp can be followed without touching.
    Approach,
    /// Nothing touches before the grasp, the object included.
    PreGrasp,
    /// The fingers close without touching anything but the object.
    Close,
    /// The straight line up can be followed with the object in the hand.
    Lift,
    /// A path leads from the start to before the grasp.
    Path,
    /// The finished trajectory, looked at again at each time step, touches nothing and keeps its limits.
    Replay,
}

impl Gate {
    /// All of them, in order.
    pub const ALL: [Self; 8] = [
        Self::Reach,
        Self::Grasp,
        Self::Approach,
        Self::PreGrasp,
        Self::Close,
        Self::Lift,
        Self::Path,
        Self::Replay,
    ];

    /// Its name, as in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reach => "reach",
            Self::Grasp => "grasp",
            Self::Approach => "approach",
            Self::PreGrasp => "pre_grasp",
            Self::Close => "close",
            Self::Lift => "lift",
            Self::Path => "path",
            Self::Replay => "replay",
        }
    }

    /// What would change the answer, in words.
    pub fn advice(self) -> &'static str {
        match self {
            Self::Reach => {
                "move the object or the base so that the grasp lies within reach, or check the pose of the object, \
                 `--tip` and the hand's mounting"
            }
            Self::Grasp => {
                "grasp elsewhere, move what stands in the way, or check the scene and the pose of the object"
            }
            Self::Approach => "shorten the way of approach, or move what stands before the grasp",
            Self::PreGrasp => "shorten the way of approach, or move what stands before the grasp",
            Self::Close => "move what stands beside the object",
            Self::Lift => "shorten the lift, or move what stands above the object",
            Self::Path => "allow more iterations, try another seed, or start elsewhere",
            Self::Replay => "try another seed; report it if that does not help",
        }
    }
}

impl fmt::Display for Gate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Why a grasp did not pass a gate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "why", rename_all = "snake_case")]
pub enum Obstruction {
    /// No joint values were found that reach a pose.
    Unreachable {
        /// What is left to the pose at the best try: metres.
        position: f64,
        /// The same: radians.
        rotation: f64,
        /// The joints that stood at a limit at the best try, by name.
        at_limits: Vec<String>,
    },
    /// Two things touch.
    Contact {
        /// One of them.
        a: String,
        /// The other one.
        b: String,
        /// How far one is inside of the other, metres.
        depth: f64,
    },
    /// The straight line cannot be followed at a place.
    Line {
        /// Metres along the line that could be followed.
        at: f64,
        /// Length of the line, metres.
        length: f64,
        /// The joints that stand at a limit at the best try for what comes next, by name; none where the arm is
        /// stretched, or would have to change its posture.
        at_limits: Vec<String>,
    },
    /// Something touches on the straight line.
    ContactOnLine {
        /// Metres along the line.
        at: f64,
        /// Length of the line, metres.
        length: f64,
        /// One of the two things.
        a: String,
        /// The other one.
        b: String,
        /// How far one is inside of the other, metres.
        depth: f64,
    },
    /// No path was found.
    NoPath {
        /// Iterations used.
        iterations: usize,
    },
    /// The trajectory touches something at a time.
    ContactAtTime {
        /// Seconds.
        time: f64,
        /// One of the two things.
        a: String,
        /// The other one.
        b: String,
        /// How far one is inside of the other, metres.
        depth: f64,
    },
    /// The trajectory passes a limit of a joint.
    LimitAtTime {
        /// Seconds.
        time: f64,
        /// The joint's name.
        joint: String,
        /// `position`, `velocity` or `acceleration`.
        quantity: String,
        /// The value there.
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// Something else, in words.
    Other {
        /// What.
        what: String,
    },
}

impl Obstruction {
    /// Names of the two things that touch, where that is the reason.
    pub fn pair(&self) -> Option<(&str, &str)> {
        match self {
            Self::Contact { a, b, .. }
            | Self::ContactOnLine { a, b, .. }
            | Self::ContactAtTime { a, b, .. } => Some((a, b)),
            _ => None,
        }
    }

    /// Two things that touch.
    pub(crate) fn contact(contact: Contact) -> Self {
        let Contact { a, b, depth } = contact;
        Self::Contact { a, b, depth }
    }
}

impl fmt::Display for Obstruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreachable { position, rotation, at_limits } => {
                let (mm, degrees) = (1e3 * position, rotation.to_degrees());
                write!(f, "the best try misses the pose by {mm:.1} mm and {degrees:.1}°")?;
                match at_limits.as_slice() {
                    [] => Ok(()),
                    names => write_at_limits(f, names),
                }
            }
            Self::Contact { a, b, depth } => write_contact(f, a, b, *depth),
            Self::Line { at, length, at_limits } => {
                let (length, at) = (1e3 * length, 1e3 * at);
                write!(f, "the arm follows the line of {length:.0} mm for {at:.1} mm")?;
                match at_limits.as_slice() {
                    [] => {
                        f.write_str("; then it is stretched, or would have to change its posture")
                    }
                    names => write_at_limits(f, names),
                }
            }
            Self::ContactOnLine { at, length, a, b, depth } => {
                write_contact(f, a, b, *depth)?;
                write!(f, " after {:.1} of {:.0} mm", 1e3 * at, 1e3 * length)
            }
            Self::NoPath { iterations } => {
                write!(f, "no path after {iterations} iterations")
            }
            Self::ContactAtTime { time, a, b, depth } => {
                write_contact(f, a, b, *depth)?;
                write!(f, " at {time:.3} s")
            }
            Self::LimitAtTime { time, joint, quantity, value, limit } => {
                write!(
                    f,
                    "{quantity} of {joint} is {value:.4} at {time:.3} s, allowed is {limit:.4}"
                )
            }
            Self::Other { what } => f.write_str(what),
        }
    }
}

fn write_at_limits(f: &mut fmt::Formatter<'_>, names: &[String]) -> fmt::Result {
    write!(f, ", with {} at the limit", names.join(", "))
}

fn write_contact(f: &mut fmt::Formatter<'_>, a: &str, b: &str, depth: f64) -> fmt::Result {
    write!(f, "{a} is {:.1} mm inside {b}", 1e3 * depth)
}

/// What became of a grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GraspOutcome {
    /// Its place in the list of grasps, from 0.
    pub grasp: usize,
    /// Joint values found that reach it, over both turns of the hand.
    pub n_solutions: usize,
    /// How it ended.
    pub ending: Ending,
}

/// How a grasp ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ending", rename_all = "snake_case")]
pub enum Ending {
    /// It became the motion.
    Planned,
    /// Of its ways the one that came farthest did not pass this gate.
    Stopped {
        /// The gate.
        gate: Gate,
        /// Why.
        obstruction: Obstruction,
    },
    /// Another one became the motion before it was tried any further.
    NotTried,
}

/// How many grasps ended at a gate, with the one of the best rank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateCount {
    /// The gate.
    pub gate: Gate,
    /// Grasps that ended there.
    pub n: usize,
    /// The first of them in the list of grasps.
    pub grasp: usize,
    /// Why that one did not pass.
    pub obstruction: Obstruction,
}

/// What became of all grasps, one row a gate at which some ended, in the gates' order.
pub fn gate_table(outcomes: &[GraspOutcome]) -> Vec<GateCount> {
    let mut rows: BTreeMap<Gate, GateCount> = BTreeMap::new();
    for outcome in outcomes {
        let Ending::Stopped { gate, obstruction } = &outcome.ending else { continue };
        let first = || GateCount {
            gate: *gate,
            n: 0,
            grasp: outcome.grasp,
            obstruction: obstruction.clone(),
        };
        rows.entry(*gate).or_insert_with(first).n += 1;
    }
    rows.into_values().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stopped(grasp: usize, gate: Gate) -> GraspOutcome {
        let obstruction = Obstruction::NoPath { iterations: grasp };
        GraspOutcome { grasp, n_solutions: 1, ending: Ending::Stopped { gate, obstruction } }
    }

    #[test]
    fn a_table_counts_every_stopped_grasp_once_in_the_order_of_gates() {
        let planned = GraspOutcome { grasp: 3, n_solutions: 1, ending: Ending::Planned };
        let outcomes =
            [stopped(0, Gate::Path), stopped(1, Gate::Reach), stopped(2, Gate::Path), planned];
        let table = gate_table(&outcomes);
        let rows: Vec<(Gate, usize, usize)> =
            table.iter().map(|row| (row.gate, row.n, row.grasp)).collect();
        assert_eq!(rows, [(Gate::Reach, 1, 1), (Gate::Path, 2, 0)]);
    }

    #[test]
    fn names_of_gates_are_those_of_files() {
        for gate in Gate::ALL {
            assert_eq!(serde_json::to_value(gate).unwrap(), gate.name());
        }
        assert!(Gate::ALL.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn messages_have_their_numbers() {
        let far = Obstruction::Unreachable {
            position: 0.3125,
            rotation: 0.0,
            at_limits: vec!["elbow".into()],
        };
        let text = far.to_string();
        assert!(text.contains("312.5 mm") && text.contains("elbow"), "{text}");
        let stretched = Obstruction::Line { at: 0.0434, length: 0.1, at_limits: Vec::new() };
        assert!(stretched.to_string().contains("of 100 mm for 43.4 mm; then it is stretched"));
        let line = Obstruction::ContactOnLine {
            at: 0.02,
            length: 0.1,
            a: "hand".into(),
            b: "table".into(),
            depth: 0.003,
        };
        assert_eq!(line.to_string(), "hand is 3.0 mm inside table after 20.0 of 100 mm");
    }
}
