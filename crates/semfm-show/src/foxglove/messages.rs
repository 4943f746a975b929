//! Labels, links and the log of a scene as Foxglove's messages.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::log::Level;
use foxglove::messages::{LinePrimitive, Log, SceneEntity, TextPrimitive};
use semfm::geom::math::DVec3;
use semfm::views::mcap::messages::{color, point, pose_at, scene_entity, timestamp};

use super::items::{SceneLabel, SceneLog, Severity};
use super::layout::WORLD;

/// Height of labels in pixels of the screen.
const FONT: f64 = 16.0;
/// Width of links in pixels of the screen.
const THICKNESS: f64 = 2.0;
/// Links are seen through each other.
const LINK_ALPHA: f64 = 0.6;

pub(super) fn text_entity(
    label: &SceneLabel<'_>,
    id: &str,
    frame_id: &str,
    at: DVec3,
) -> SceneEntity {
    let text = TextPrimitive {
        pose: Some(pose_at(at)),
        billboard: true,
        font_size: FONT,
        scale_invariant: true,
        color: Some(color(label.color, 1.0)),
        text: label.text.clone(),
    };
    SceneEntity { texts: vec![text], ..scene_entity(frame_id, id) }
}

/// A piece of line in the world.
pub(super) struct Segment {
    pub ends: [DVec3; 2],
    pub color: [u8; 3],
}

pub(super) fn segments_entity(segments: &[Segment]) -> SceneEntity {
    let colors = segments.iter().flat_map(|segment| [color(segment.color, LINK_ALPHA); 2]);
    let lines = LinePrimitive {
        r#type: LineType::LineList.into(),
        pose: Some(pose_at(DVec3::ZERO)),
        thickness: THICKNESS,
        scale_invariant: true,
        points: segments.iter().flat_map(|segment| segment.ends.map(point)).collect(),
        color: Some(color([128; 3], LINK_ALPHA)),
        colors: colors.collect(),
        indices: Vec::new(),
    };
    SceneEntity { lines: vec![lines], ..scene_entity(WORLD, "links") }
}

pub(super) fn log_message(log: &SceneLog<'_>) -> Log {
    let level = match log.severity {
        Severity::Info => Level::Info,
        Severity::Warning => Level::Warning,
        Severity::Error => Level::Error,
    };
    Log {
        timestamp: Some(timestamp(0)),
        level: level.into(),
        message: log.text.clone(),
        name: "semfm".to_owned(),
        file: String::new(),
        line: 0,
    }
}
