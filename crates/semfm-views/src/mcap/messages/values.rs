//! The small parts of messages: times, points, colours, poses, and an entity to be filled.

use foxglove::messages::{
    Color, FrameTransform, Point3, Pose, Quaternion, SceneEntity, Timestamp, Vector3,
};
use semfm_geom::math::{DQuat, DVec3};

/// A time of recording in nanoseconds, as messages carry it.
pub fn timestamp(time: u64) -> Timestamp {
    let (seconds, nanos) = (time / 1_000_000_000, time % 1_000_000_000);
    Timestamp::new(seconds as u32, nanos as u32)
}

/// A point.
pub fn point(p: DVec3) -> Point3 {
    Point3 { x: p.x, y: p.y, z: p.z }
}

/// A colour of sRGB bytes and an opacity from 0 to 1.
pub fn color(rgb: [u8; 3], a: f64) -> Color {
    let [r, g, b] = rgb.map(|byte| f64::from(byte) / 255.0);
    Color { r, g, b, a }
}

/// The pose at a point, not turned.
pub fn pose_at(p: DVec3) -> Pose {
    Pose { position: Some(vector(p)), orientation: Some(quaternion(DQuat::IDENTITY)) }
}

/// How the frame `child` stands in the frame `parent`, at `time` in nanoseconds.
pub fn transform(
    parent: &str,
    child: String,
    time: u64,
    translation: DVec3,
    rotation: DQuat,
) -> FrameTransform {
    FrameTransform {
        timestamp: Some(timestamp(time)),
        parent_frame_id: parent.to_owned(),
        child_frame_id: child,
        translation: Some(vector(translation)),
        rotation: Some(quaternion(rotation)),
    }
}

/// An empty entity. It follows its frame, so that it need not be read after its frame's place.
pub fn scene_entity(frame_id: &str, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(0)),
        frame_id: frame_id.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..Default::default()
    }
}

fn vector(p: DVec3) -> Vector3 {
    Vector3 { x: p.x, y: p.y, z: p.z }
}

fn quaternion(q: DQuat) -> Quaternion {
    Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }
}
