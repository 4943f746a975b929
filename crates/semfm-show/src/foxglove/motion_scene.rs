//! A motion as a scene for Foxglove: a mesh for each link, the object and what stands around, each locked to its
//! frame, and `/tf` that moves the frames.

use std::path::Path;

use foxglove::messages::log::Level;
use foxglove::messages::{FrameTransform, JointState, JointStates, Log, SceneEntity, SceneUpdate};
use semfm::PlannedMotion;
use semfm::robot::Pose;
use semfm::views::mcap::messages::{MeshEntity, timestamp, transform};
use semfm::views::mcap::{ChunkCompression, METADATA_NAME, McapWriter, TF, write_mcap};
use serde_json::Value;

use crate::Result;
use crate::colors::color_bytes;
use crate::motion::{BodyKind, FrameTracks, MotionBodies};

const ROBOT: &str = "/robot";
const OBJECT: &str = "/object";
const OBSTACLES: &str = "/obstacles";
const JOINTS: &str = "/joint_states";
const SEGMENTS: &str = "/segments";

/// Writes the scene, whole or not at all; `about` goes into the record `semfm`, key `json`.
///
/// # Errors
/// [`Error::Semfm`](crate::Error::Semfm) where the file cannot be written.
pub(crate) fn write_motion_scene(
    path: &Path,
    motion: &PlannedMotion,
    bodies: &MotionBodies,
    tracks: &FrameTracks,
    about: &Value,
) -> Result<()> {
    let updates = [ROBOT, OBJECT, OBSTACLES]
        .into_iter()
        .map(|topic| Ok((topic, scene_update(topic, bodies)?)))
        .collect::<Result<Vec<_>>>()?;
    let moving: Vec<usize> = (0..bodies.frames.len()).filter(|&k| tracks.moves(k)).collect();
    write_mcap(path, "", ChunkCompression::Lz4, |file| {
        let format = about["format"].as_str().unwrap_or_default().to_owned();
        let entries = [("format", format), ("json", about.to_string())];
        file.metadata(METADATA_NAME, entries.map(|(k, v)| (k.to_owned(), v)).into())?;
        let at_start =
            |k: &usize| tracks.poses.first().map(|poses| frame(bodies, *k, poses[*k], 0));
        let still = (0..bodies.frames.len()).filter(|k| !moving.contains(k));
        still.filter_map(|k| at_start(&k).flatten()).try_for_each(|f| file.log(TF, 0, &f))?;
        for (topic, update) in updates.iter().filter(|(_, update)| !update.entities.is_empty()) {
            file.log(topic, 0, update)?;
        }
        write_samples(motion, bodies, tracks, &moving, file)
    })?;
    Ok(())
}

/// What moves, joints and the names of segments, in the order of time.
fn write_samples(
    motion: &PlannedMotion,
    bodies: &MotionBodies,
    tracks: &FrameTracks,
    moving: &[usize],
    file: &mut McapWriter<'_>,
) -> semfm::views::Result<()> {
    let mut segments = motion.trajectory.segments.iter().peekable();
    let tracked: Vec<Vec<Pose>> = moving.iter().map(|&k| tracks.track(k)).collect();
    for (i, point) in tracks.points.iter().enumerate() {
        let time = (point.time * 1e9).round() as u64;
        let begins = |segment: &&semfm::motion::Segment| {
            segment.points.first().is_none_or(|first| first.time <= point.time)
        };
        while let Some(segment) = segments.next_if(begins) {
            file.log(SEGMENTS, time, &log(segment.kind.name(), time))?;
        }
        for (&k, track) in moving.iter().zip(&tracked) {
            if let Some(transform) = frame(bodies, k, track[i], time) {
                file.log(TF, time, &transform)?;
            }
        }
        let names = motion.trajectory.joint_names.iter().enumerate();
        let joints = names.map(|(j, name)| JointState {
            name: name.clone(),
            position: Some(point.positions[j]),
            velocity: Some(point.velocities[j]),
            acceleration: Some(point.accelerations[j]),
            effort: None,
        });
        let states = JointStates { timestamp: Some(timestamp(time)), joints: joints.collect() };
        file.log(JOINTS, time, &states)?;
    }
    Ok(())
}

/// A frame in its parent's; the root has none.
fn frame(bodies: &MotionBodies, k: usize, pose: Pose, time: u64) -> Option<FrameTransform> {
    let frame = &bodies.frames[k];
    let parent = &bodies.frames[frame.parent?].name;
    let rotation = pose.rotation.normalize();
    Some(transform(parent, frame.name.clone(), time, pose.translation, rotation))
}

fn scene_update(topic: &str, bodies: &MotionBodies) -> Result<SceneUpdate> {
    let shown = bodies.bodies.iter().filter(|body| topic_of(body.kind) == topic);
    let entities = shown.map(|body| -> Result<SceneEntity> {
        let colors = vec![color_bytes(body.color); body.surface.vertices.len()];
        let name = bodies.name(body);
        let entity = MeshEntity {
            frame_id: name,
            name,
            vertices: &body.surface.vertices,
            faces: &body.surface.faces,
            colors: Some(&colors),
        };
        Ok(entity.message(topic)?)
    });
    Ok(SceneUpdate { deletions: Vec::new(), entities: entities.collect::<Result<_>>()? })
}

fn topic_of(kind: BodyKind) -> &'static str {
    match kind {
        BodyKind::Link | BodyKind::Hand => ROBOT,
        BodyKind::Object => OBJECT,
        BodyKind::Obstacle | BodyKind::Table => OBSTACLES,
    }
}

fn log(message: &str, time: u64) -> Log {
    Log {
        timestamp: Some(timestamp(time)),
        level: Level::Info.into(),
        message: message.to_owned(),
        name: "semfm".to_owned(),
        file: String::new(),
        line: 0,
    }
}
