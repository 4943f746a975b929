//! Coloured meshes and point clouds for a viewer: `transfer.mcap`.

use std::collections::BTreeMap;
use std::path::Path;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    Color, FrameTransform, PackedElementField, Point3, PointCloud, Pose, Quaternion, SceneEntity,
    SceneUpdate, TriangleListPrimitive, Vector3,
};
use semfm_geom::math::{DVec3, bounds};

use super::frames::TF;
use super::inspect::METADATA_NAME;
use super::writer::{Packing, timestamp, write_file};
use crate::{Error, Result};

/// A triangle mesh to be shown.
#[derive(Clone, Copy, Debug)]
pub struct SceneMesh<'a> {
    /// Topic, such as `/source/mesh`.
    pub topic: &'a str,
    /// Frame of the vertices, such as `source`.
    pub frame_id: &'a str,
    /// Positions (n).
    pub vertices: &'a [DVec3],
    /// Triangles (m).
    pub faces: &'a [[u32; 3]],
    /// sRGB colours of the vertices (n), grey without.
    pub colors: Option<&'a [[u8; 3]]>,
}

/// A point cloud to be shown.
#[derive(Clone, Copy, Debug)]
pub struct ScenePoints<'a> {
    /// Topic, such as `/source/cloud`.
    pub topic: &'a str,
    /// Frame of the points.
    pub frame_id: &'a str,
    /// Positions (n).
    pub points: &'a [DVec3],
    /// sRGB colours (n).
    pub colors: &'a [[u8; 3]],
}

/// The frame in which the frames of a scene stand side by side.
const WORLD: &str = "world";

/// Room between two neighbours, as a share of the larger one.
const GAP: f64 = 0.25;

/// Writes a scene whole or not at all: each mesh as a `foxglove.SceneUpdate`, each cloud as a
/// `foxglove.PointCloud`, `/tf` that lays the frames side by side along x in the order in which
/// they appear, and `metadata` as JSON in the record `semfm`, key `json`, beside its `format`.
///
/// # Errors
/// [`Error::Invalid`] for colours or triangles that do not fit their points, [`Error::Io`].
pub fn write_scene(
    path: &Path,
    format: &str,
    meshes: &[SceneMesh<'_>],
    clouds: &[ScenePoints<'_>],
    metadata: &serde_json::Value,
) -> Result<()> {
    for mesh in meshes {
        mesh.check()?;
    }
    for cloud in clouds {
        check_length(cloud.topic, "colours", cloud.points.len(), cloud.colors.len())?;
        check_finite(cloud.topic, cloud.points)?;
    }
    write_file(path, "", Packing::Lz4, |file| {
        let entries = [("format", format.to_owned()), ("json", metadata.to_string())];
        file.metadata(METADATA_NAME, entries.map(|(k, v)| (k.to_owned(), v)).into())?;
        for placed in side_by_side(meshes, clouds) {
            file.log(TF, 0, &placed)?;
        }
        for mesh in meshes {
            file.log(mesh.topic, 0, &scene_update(mesh))?;
        }
        clouds.iter().try_for_each(|cloud| file.log(cloud.topic, 0, &point_cloud(cloud)))
    })
}

impl SceneMesh<'_> {
    pub(super) fn check(&self) -> Result<()> {
        if let Some(colors) = self.colors {
            check_length(self.topic, "colours", self.vertices.len(), colors.len())?;
        }
        let n_vertices = self.vertices.len();
        if let Some(id) = self.faces.iter().flatten().find(|&&id| id as usize >= n_vertices) {
            return Err(Error::Invalid {
                what: format!("vertex ids of {}", self.topic),
                expected: format!("below {n_vertices}"),
                found: id.to_string(),
            });
        }
        check_finite(self.topic, self.vertices)
    }
}

fn check_length(topic: &str, what: &str, expected: usize, found: usize) -> Result<()> {
    match expected == found {
        true => Ok(()),
        false => Err(Error::Invalid {
            what: format!("{what} of {topic}"),
            expected: expected.to_string(),
            found: found.to_string(),
        }),
    }
}

fn check_finite(topic: &str, points: &[DVec3]) -> Result<()> {
    match points.iter().position(|p| !p.is_finite()) {
        None => Ok(()),
        Some(at) => Err(Error::Invalid {
            what: format!("point {at} of {topic}"),
            expected: "finite coordinates".to_owned(),
            found: points[at].to_string(),
        }),
    }
}

/// A mesh as a scene of one entity.
pub(super) fn scene_update(mesh: &SceneMesh<'_>) -> SceneUpdate {
    let grey = Color { r: 0.7, g: 0.7, b: 0.7, a: 1.0 };
    let colors = mesh.colors.unwrap_or(&[]).iter().map(|rgb| {
        let [r, g, b] = rgb.map(|byte| f64::from(byte) / 255.0);
        Color { r, g, b, a: 1.0 }
    });
    let points = mesh.vertices.iter().map(|p| Point3 { x: p.x, y: p.y, z: p.z });
    let triangles = TriangleListPrimitive {
        pose: Some(identity_pose()),
        points: points.collect(),
        color: Some(grey),
        colors: colors.collect(),
        indices: mesh.faces.iter().flatten().copied().collect(),
    };
    let entity = SceneEntity {
        timestamp: Some(timestamp(0)),
        frame_id: mesh.frame_id.to_owned(),
        id: mesh.topic.trim_start_matches('/').to_owned(),
        triangles: vec![triangles],
        ..Default::default()
    };
    SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
}

fn identity_pose() -> Pose {
    Pose {
        position: Some(Vector3::default()),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    }
}

/// Position as three f32 and colour as four bytes, in the names that Foxglove looks for.
fn point_cloud(cloud: &ScenePoints<'_>) -> PointCloud {
    let field = |name: &str, offset: u32, kind: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: kind.into(),
    };
    let mut data = Vec::with_capacity(16 * cloud.points.len());
    for (point, rgb) in cloud.points.iter().zip(cloud.colors) {
        data.extend(point.as_vec3().to_array().into_iter().flat_map(f32::to_le_bytes));
        data.extend(rgb);
        data.push(u8::MAX);
    }
    PointCloud {
        timestamp: Some(timestamp(0)),
        frame_id: cloud.frame_id.to_owned(),
        pose: Some(identity_pose()),
        point_stride: 16,
        fields: vec![
            field("x", 0, NumericType::Float32),
            field("y", 4, NumericType::Float32),
            field("z", 8, NumericType::Float32),
            field("red", 12, NumericType::Uint8),
            field("green", 13, NumericType::Uint8),
            field("blue", 14, NumericType::Uint8),
            field("alpha", 15, NumericType::Uint8),
        ],
        data: data.into(),
    }
}

/// Transforms from the world to each frame, so that nothing overlaps.
fn side_by_side(meshes: &[SceneMesh<'_>], clouds: &[ScenePoints<'_>]) -> Vec<FrameTransform> {
    let shown = meshes.iter().map(|mesh| (mesh.frame_id, mesh.vertices));
    let shown = shown.chain(clouds.iter().map(|cloud| (cloud.frame_id, cloud.points)));
    let mut order: Vec<&str> = Vec::new();
    let mut extents: BTreeMap<&str, (DVec3, DVec3)> = BTreeMap::new();
    for (frame_id, points) in shown {
        let Some((low, high)) = bounds(points) else { continue };
        match extents.get_mut(frame_id) {
            Some(extent) => *extent = (extent.0.min(low), extent.1.max(high)),
            None => {
                order.push(frame_id);
                extents.insert(frame_id, (low, high));
            }
        }
    }
    let widest = extents.values().map(|(low, high)| high.x - low.x).fold(0.0, f64::max);
    let mut edge = 0.0;
    let place = |frame_id: &&str| {
        let (low, high) = extents[frame_id];
        let translation = Vector3 { x: edge - low.x, y: 0.0, z: 0.0 };
        edge += high.x - low.x + GAP * widest;
        FrameTransform {
            timestamp: Some(timestamp(0)),
            parent_frame_id: WORLD.to_owned(),
            child_frame_id: (*frame_id).to_owned(),
            translation: Some(translation),
            rotation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
        }
    };
    order.iter().map(place).collect()
}
