//! A triangle mesh as Foxglove's SceneUpdate, there and back: the object of a views file.

use std::path::Path;

use foxglove::messages::{Color, KeyValuePair, SceneEntity, SceneUpdate, TriangleListPrimitive};
use semfm_geom::Mesh;
use semfm_geom::math::DVec3;

use super::super::decode::{decode, message_error, topic_error};
use super::super::reader::{Message, read_messages};
use super::super::topics::MESH;
use super::values::{color, point, pose_at, scene_entity};
use crate::{Error, Result};

/// A triangle mesh to be shown.
#[derive(Clone, Copy, Debug)]
pub struct MeshEntity<'a> {
    /// Frame of the vertices.
    pub frame_id: &'a str,
    /// What it is; unique in its topic.
    pub name: &'a str,
    /// Positions (n).
    pub vertices: &'a [DVec3],
    /// Triangles (m).
    pub faces: &'a [[u32; 3]],
    /// sRGB colours of the vertices (n), grey without.
    pub colors: Option<&'a [[u8; 3]]>,
}

impl MeshEntity<'_> {
    /// The entity of a scene; `topic` is for messages.
    ///
    /// # Errors
    /// [`Error::Invalid`] for colours or triangles that do not fit the vertices, and for coordinates
    /// that are not finite.
    pub fn message(&self, topic: &str) -> Result<SceneEntity> {
        self.check(topic)?;
        let triangles = TriangleListPrimitive {
            pose: Some(pose_at(DVec3::ZERO)),
            points: self.vertices.iter().copied().map(point).collect(),
            color: Some(Color { r: 0.7, g: 0.7, b: 0.7, a: 1.0 }),
            colors: self.colors.unwrap_or(&[]).iter().map(|&rgb| color(rgb, 1.0)).collect(),
            indices: self.faces.as_flattened().to_vec(),
        };
        let counts = [("vertices", self.vertices.len()), ("triangles", self.faces.len())]
            .map(|(key, n)| KeyValuePair { key: key.to_owned(), value: n.to_string() });
        Ok(SceneEntity {
            metadata: counts.into(),
            triangles: vec![triangles],
            ..scene_entity(self.frame_id, self.name)
        })
    }

    /// The entity as a scene of its own.
    ///
    /// # Errors
    /// As [`message`](Self::message): [`Error::Invalid`].
    pub fn update(&self, topic: &str) -> Result<SceneUpdate> {
        Ok(SceneUpdate { deletions: Vec::new(), entities: vec![self.message(topic)?] })
    }

    fn check(&self, topic: &str) -> Result<()> {
        let n_vertices = self.vertices.len();
        if let Some(found) = self.colors.map(<[_]>::len).filter(|&n| n != n_vertices) {
            let what = format!("colours of {topic}");
            return Err(Error::invalid(what, n_vertices.to_string(), found.to_string()));
        }
        if let Some(id) = self.faces.iter().flatten().find(|&&id| id as usize >= n_vertices) {
            let expected = format!("below {n_vertices}");
            return Err(Error::invalid(format!("vertex ids of {topic}"), expected, id.to_string()));
        }
        match self.vertices.iter().position(|p| !p.is_finite()) {
            None => Ok(()),
            Some(at) => {
                let found = self.vertices[at].to_string();
                Err(Error::invalid(format!("point {at} of {topic}"), "finite coordinates", found))
            }
        }
    }
}

/// Colours of vertices as sRGB bytes (n).
pub type Colors = Vec<[u8; 3]>;

/// The mesh in a views file and the colours of its vertices, if it has any.
///
/// # Errors
/// As [`find_mesh`]; also [`Error::Format`] where there is no mesh.
pub fn read_mesh(path: &Path) -> Result<(Mesh, Option<Colors>)> {
    find_mesh(path)?.ok_or_else(|| topic_error(path, MESH, "one message", "none"))
}

/// The mesh in a file and the colours of its vertices, if it has any; `None` where the file has no
/// mesh.
///
/// # Errors
/// [`Error::Container`] for a damaged file;
/// [`Error::Format`] where there are several meshes, or one that is none.
pub fn find_mesh(path: &Path) -> Result<Option<(Mesh, Option<Colors>)>> {
    let mut found = None;
    read_messages(path, |message| {
        if message.channel.topic == MESH && found.replace(mesh_of(path, &message)?).is_some() {
            return Err(topic_error(path, MESH, "one message", "several"));
        }
        Ok(())
    })?;
    Ok(found)
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
    let colors = list.colors.iter().map(|c| [c.r, c.g, c.b].map(srgb_byte)).collect();
    let mesh = Mesh::new(vertices, faces.to_vec())
        .map_err(|error| message_error(path, message, "a sound mesh", error.to_string()))?;
    Ok((mesh, Some(colors).filter(|_| !list.colors.is_empty())))
}

/// An sRGB value from 0 to 1 as a byte.
fn srgb_byte(x: f64) -> u8 {
    (x.clamp(0.0, 1.0) * 255.0).round() as u8
}
