//! The parts of a scene as Foxglove's messages.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::log::Level;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    Color, KeyValuePair, LinePrimitive, Log, PackedElementField, Point3, PointCloud, Pose,
    Quaternion, SceneEntity, SceneUpdate, TextPrimitive, TriangleListPrimitive, Vector3,
};
use semfm_geom::math::DVec3;

use super::scene::{SceneLabel, SceneLog, SceneMesh, SceneNumbers, ScenePoints, Severity, WORLD};
use super::writer::timestamp;

/// Height of labels in pixels of the screen.
const FONT: f64 = 16.0;
/// Width of links in pixels of the screen.
const THICKNESS: f64 = 2.0;
/// Links are seen through each other.
const LINK_ALPHA: f64 = 0.6;

/// A mesh as a scene of one entity.
pub(super) fn mesh_update(mesh: &SceneMesh<'_>) -> SceneUpdate {
    SceneUpdate { deletions: Vec::new(), entities: vec![mesh_entity(mesh)] }
}

pub(super) fn mesh_entity(mesh: &SceneMesh<'_>) -> SceneEntity {
    let grey = Color { r: 0.7, g: 0.7, b: 0.7, a: 1.0 };
    let triangles = TriangleListPrimitive {
        pose: Some(pose(DVec3::ZERO)),
        points: mesh.vertices.iter().copied().map(point).collect(),
        color: Some(grey),
        colors: mesh.colors.unwrap_or(&[]).iter().map(|&rgb| color(rgb, 1.0)).collect(),
        indices: mesh.faces.as_flattened().to_vec(),
    };
    let counts = [("vertices", mesh.vertices.len()), ("triangles", mesh.faces.len())]
        .map(|(key, n)| KeyValuePair { key: key.to_owned(), value: n.to_string() });
    SceneEntity {
        metadata: counts.into(),
        triangles: vec![triangles],
        ..entity(mesh.frame_id, mesh.name)
    }
}

pub(super) fn text_entity(
    label: &SceneLabel<'_>,
    id: &str,
    frame_id: &str,
    at: DVec3,
) -> SceneEntity {
    let text = TextPrimitive {
        pose: Some(pose(at)),
        billboard: true,
        font_size: FONT,
        scale_invariant: true,
        color: Some(color(label.color, 1.0)),
        text: label.text.clone(),
    };
    SceneEntity { texts: vec![text], ..entity(frame_id, id) }
}

/// A piece of line in the world and its colour.
pub(super) type Segment = ([DVec3; 2], [u8; 3]);

pub(super) fn segments_entity(segments: &[Segment]) -> SceneEntity {
    let colors = segments.iter().flat_map(|&(_, rgb)| [color(rgb, LINK_ALPHA); 2]);
    let lines = LinePrimitive {
        r#type: LineType::LineList.into(),
        pose: Some(pose(DVec3::ZERO)),
        thickness: THICKNESS,
        scale_invariant: true,
        points: segments.iter().flat_map(|(ends, _)| ends.map(point)).collect(),
        color: Some(color([128; 3], LINK_ALPHA)),
        colors: colors.collect(),
        indices: Vec::new(),
    };
    SceneEntity { lines: vec![lines], ..entity(WORLD, "links") }
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

/// Position as three f32 and colour as four bytes, in the names that Foxglove looks for, then the
/// numbers, four bytes each.
pub(super) fn point_cloud(cloud: &ScenePoints<'_>) -> PointCloud {
    let field = |name: &str, offset: u32, kind: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind.into(),
    };
    let mut fields = vec![
        field("x", 0, NumericType::Float32),
        field("y", 4, NumericType::Float32),
        field("z", 8, NumericType::Float32),
        field("red", 12, NumericType::Uint8),
        field("green", 13, NumericType::Uint8),
        field("blue", 14, NumericType::Uint8),
        field("alpha", 15, NumericType::Uint8),
    ];
    let mut stride = 16;
    for (name, numbers) in cloud.numbers {
        let kind = match numbers {
            SceneNumbers::F32(_) => NumericType::Float32,
            SceneNumbers::I32(_) => NumericType::Int32,
            SceneNumbers::U32(_) => NumericType::Uint32,
        };
        fields.push(field(name, stride, kind));
        stride += 4;
    }
    let mut data = Vec::with_capacity(stride as usize * cloud.points.len());
    for (i, (point, rgb)) in cloud.points.iter().zip(cloud.colors).enumerate() {
        data.extend(point.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
        data.extend(rgb);
        data.push(u8::MAX);
        for (_, numbers) in cloud.numbers {
            data.extend(match numbers {
                SceneNumbers::F32(numbers) => numbers[i].to_le_bytes(),
                SceneNumbers::I32(numbers) => numbers[i].to_le_bytes(),
                SceneNumbers::U32(numbers) => numbers[i].to_le_bytes(),
            });
        }
    }
    PointCloud {
        timestamp: Some(timestamp(0)),
        frame_id: cloud.frame_id.to_owned(),
        pose: Some(pose(DVec3::ZERO)),
        point_stride: stride,
        fields,
        data: data.into(),
    }
}

/// An empty entity. It follows its frame, so that it need not be read after its frame's place.
fn entity(frame_id: &str, id: &str) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(0)),
        frame_id: frame_id.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..Default::default()
    }
}

fn point(p: DVec3) -> Point3 {
    Point3 { x: p.x, y: p.y, z: p.z }
}

fn color(rgb: [u8; 3], a: f64) -> Color {
    let [r, g, b] = rgb.map(|byte| f64::from(byte) / 255.0);
    Color { r, g, b, a }
}

fn pose(p: DVec3) -> Pose {
    Pose {
        position: Some(Vector3 { x: p.x, y: p.y, z: p.z }),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    }
}
