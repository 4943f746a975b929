//! What viewers are shown, read back: the mesh of a views file, the clouds of a scene.

use std::path::Path;

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PointCloud, SceneUpdate};
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

use super::cameras::{decode, message_error, topic_error};
use super::reader::{Message, read_messages};
use super::views_file::MESH;
use crate::Result;

/// Colours of vertices or points as sRGB bytes (n).
pub type Colors = Vec<[u8; 3]>;

/// The mesh in a views file and the colours of its vertices, if it has any.
///
/// # Errors
/// [`Error::Container`](crate::Error::Container) for a damaged file;
/// [`Error::Format`](crate::Error::Format) where there is not one mesh, or one that is none.
pub fn read_mesh(path: &Path) -> Result<(Mesh, Option<Colors>)> {
    let mut found = None;
    read_messages(path, |message| {
        if message.channel.topic == MESH && found.replace(mesh_of(path, &message)?).is_some() {
            return Err(topic_error(path, MESH, "one message", "several"));
        }
        Ok(())
    })?;
    found.ok_or_else(|| topic_error(path, MESH, "one message", "none"))
}

fn mesh_of(path: &Path, message: &Message<'_>) -> Result<(Mesh, Option<Colors>)> {
    let scene: SceneUpdate = decode(path, message, "foxglove.SceneUpdate")?;
    let lists: Vec<_> = scene.entities.iter().flat_map(|entity| &entity.triangles).collect();
    let [list] = lists[..] else {
        let found = format!("{} lists", lists.len());
        return Err(message_error(path, message, "one list of triangles", found));
    };
    let (faces, rest) = list.indices.as_chunks::<3>();
    if !rest.is_empty() || ![0, list.points.len()].contains(&list.colors.len()) {
        let expected = "three indices a triangle, and no colours or one a point";
        let found = format!("{} indices, {} colours", list.indices.len(), list.colors.len());
        return Err(message_error(path, message, expected, found));
    }
    let vertices = list.points.iter().map(|p| DVec3::new(p.x, p.y, p.z)).collect();
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    let colors = list.colors.iter().map(|c| [c.r, c.g, c.b].map(byte)).collect();
    let mesh = Mesh::new(vertices, faces.to_vec())
        .map_err(|error| message_error(path, message, "a sound mesh", error.to_string()))?;
    Ok((mesh, Some(colors).filter(|_| !list.colors.is_empty())))
}

/// Points and colours of the cloud on a topic of a scene that this program wrote; nothing where there
/// is none.
///
/// # Errors
/// [`Error::Container`](crate::Error::Container) for a damaged file;
/// [`Error::Format`](crate::Error::Format) for a cloud with other fields than ours.
pub fn read_cloud(path: &Path, topic: &str) -> Result<Option<(Vec<DVec3>, Colors)>> {
    let mut found = None;
    read_messages(path, |message| {
        if message.channel.topic == topic {
            found = Some(cloud_of(path, &message)?);
        }
        Ok(())
    })?;
    Ok(found)
}

fn cloud_of(path: &Path, message: &Message<'_>) -> Result<(Vec<DVec3>, Colors)> {
    let cloud: PointCloud = decode(path, message, "foxglove.PointCloud")?;
    let is_ours = |(name, offset, kind): (&str, u32, NumericType)| {
        let kind: i32 = kind.into();
        cloud.fields.iter().any(|f| f.name == name && f.offset == offset && f.r#type == kind)
    };
    let (float, byte) = (NumericType::Float32, NumericType::Uint8);
    let fields = [
        ("x", 0, float),
        ("y", 4, float),
        ("z", 8, float),
        ("red", 12, byte),
        ("green", 13, byte),
        ("blue", 14, byte),
    ];
    let stride = cloud.point_stride as usize;
    if stride < 16 || !cloud.data.len().is_multiple_of(stride) || !fields.into_iter().all(is_ours) {
        let expected = "x, y, z as 32-bit floats, then red, green, blue as bytes";
        let names: Vec<&str> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
        let found = format!("{} of stride {stride}", names.join(", "));
        return Err(message_error(path, message, expected, found));
    }
    let read = |point: &[u8]| {
        let x = |at: usize| {
            f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]])
        };
        let position = DVec3::new(f64::from(x(0)), f64::from(x(4)), f64::from(x(8)));
        (position, [point[12], point[13], point[14]])
    };
    Ok(cloud.data.chunks_exact(stride).map(read).unzip())
}
