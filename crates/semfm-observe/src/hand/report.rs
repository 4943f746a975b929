//! What is said of a demonstration's contact: `semfm.contact/1`.

use serde::Serialize;

use super::{Contact, HandFrame};

/// The format that is written.
const FORMAT: &str = "semfm.contact/1";

/// A finger counts as touching from this probability on.
const TOUCHES: f64 = 0.5;

/// What the hand of each frame touched, and how sure that is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactReport {
    /// `semfm.contact/1`.
    pub format: &'static str,
    /// One for each frame.
    pub frames: Vec<ContactFrameRecord>,
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactFrameRecord {
    /// Touched surface, square millimetres.
    pub area_mm2: f64,
    /// From 0, nothing sure, to 1, all likely places of the hand agree.
    pub confidence: f64,
    /// How near is a touch, millimetres.
    pub reach_mm: f64,
    /// How far the hand was moved to rest on the object, millimetres, in the axes of the mesh.
    pub hand_moved_mm: [f64; 3],
    /// How far it was moved along the camera's axis to its measured depth, millimetres.
    pub depth_moved_mm: Option<f64>,
    /// Fingers and palm, those that touch most first; empty where they are not known.
    pub parts: Vec<ContactPartRecord>,
    /// What is doubtful.
    pub doubts: Vec<String>,
}

/// A finger, or the palm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ContactPartRecord {
    /// `thumb`, `index`, `middle`, `ring`, `little` or `palm`.
    pub part: &'static str,
    /// Area that it touches, square millimetres.
    pub area_mm2: f64,
    /// Probability that it touches.
    pub probability: f64,
    /// Whether it counts as touching.
    pub touches: bool,
}

/// A hand moved farther than this (metres) to rest on the object may rest on the wrong side of it.
const FAR_MOVED: f64 = 0.012;
/// A hand wider or narrower by more than this at its measured depth has another focal length, or is another's.
const ODD_SCALE: f64 = 1.35;
/// Less than this is no contact to rely on.
const UNSURE: f64 = 0.5;

impl ContactReport {
    /// Of frames and their contacts, in the same order.
    pub fn new(frames: &[HandFrame], contacts: &[Contact]) -> Self {
        let records = frames.iter().zip(contacts).map(|(frame, contact)| record(frame, contact));
        Self { format: FORMAT, frames: records.collect() }
    }

    /// Lines for people, one or more for each frame.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (i, frame) in self.frames.iter().enumerate() {
            let head =
                if self.frames.len() > 1 { format!("hand {}: ", i + 1) } else { "hand: ".into() };
            let touching: Vec<String> = frame
                .parts
                .iter()
                .filter(|part| part.touches)
                .map(|part| {
                    format!(
                        "{} {:.0} mm² ({:.0} %)",
                        part.part,
                        part.area_mm2,
                        100.0 * part.probability
                    )
                })
                .collect();
            let what = if frame.parts.is_empty() {
                "fingers not known".to_owned()
            } else if touching.is_empty() {
                "no finger for sure".to_owned()
            } else {
                touching.join(", ")
            };
            lines.push(format!(
                "{head}touches {:.0} mm², confidence {:.2}: {what}",
                frame.area_mm2, frame.confidence
            ));
            lines.extend(frame.doubts.iter().map(|doubt| format!("  doubtful: {doubt}")));
        }
        lines
    }
}

fn record(frame: &HandFrame, contact: &Contact) -> ContactFrameRecord {
    let unit = frame.camera_from_object.as_ref().map_or(1.0, |pose| pose.scale);
    let (mm, mm2) = (1e3 * unit, 1e6 * unit * unit);
    let part = |part: &super::PartContact| ContactPartRecord {
        part: part.part.name(),
        area_mm2: part.area * mm2,
        probability: part.probability,
        touches: part.probability >= TOUCHES,
    };
    let moved = contact.offset.length() * unit;
    let mut doubts = Vec::new();
    if moved > FAR_MOVED {
        doubts.push(format!("the hand was moved by {:.0} mm to rest on the object", 1e3 * moved));
    }
    if let Some(shift) = &frame.shift
        && !(1.0 / ODD_SCALE..=ODD_SCALE).contains(&shift.scale)
    {
        doubts.push(format!(
            "at its measured depth the hand is {:.2} times as wide: is its focal length right? (--hand-focal)",
            shift.scale
        ));
    }
    if contact.confidence < UNSURE {
        doubts.push("likely places of the hand disagree on what it touches".to_owned());
    }
    ContactFrameRecord {
        area_mm2: contact.area * mm2,
        confidence: contact.confidence,
        reach_mm: contact.reach * mm,
        hand_moved_mm: (contact.offset * mm).to_array(),
        depth_moved_mm: frame.shift.as_ref().map(|shift| 1e3 * shift.along_axis),
        parts: contact.parts.iter().map(part).collect(),
        doubts,
    }
}
