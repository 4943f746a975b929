//! GLB: one mesh with one primitive.
//!
//! It has no material on purpose: beside one, trimesh drops the colours of the vertices. They are
//! written as sRGB bytes, though the specification calls `COLOR_0` linear, because trimesh and
//! Open3D show them as they stand.

use std::io::{Error, Result, Write};

use serde_json::{Value, json};

use crate::Mesh;
use crate::io::VertexAttributes;
use crate::io::blocks::write_blocks;

const FLOAT: u32 = 5126;
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_INT: u32 = 5125;

/// How the mesh of a GLB stands in its scene; the coordinates in the file stay those of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlbNode<'a> {
    /// Name of the node, which viewers list.
    pub name: &'a str,
    /// Unit quaternion x, y, z, w: scene from mesh. y of a glTF scene points up.
    pub rotation: [f64; 4],
}

pub(super) fn write(
    out: &mut dyn Write,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
) -> Result<()> {
    write_node(out, mesh, attributes, None)
}

/// As [`write`], the mesh in a node that turns it.
pub(in super::super) fn write_node(
    out: &mut dyn Write,
    mesh: &Mesh,
    attributes: &VertexAttributes<'_>,
    node: Option<&GlbNode<'_>>,
) -> Result<()> {
    let n = mesh.n_vertices();
    let mut arrays = Arrays::default();
    let mut accessors = serde_json::Map::new();
    let (low, high) = mesh.bounds();
    let position = arrays.add(
        12 * n,
        json!({
            "componentType": FLOAT, "type": "VEC3", "count": n,
            "min": low.as_vec3().to_array(), "max": high.as_vec3().to_array(),
        }),
    );
    accessors.insert("POSITION".into(), position);
    if attributes.colors.is_some() {
        let color =
            json!({"componentType": UNSIGNED_BYTE, "type": "VEC4", "count": n, "normalized": true});
        accessors.insert("COLOR_0".into(), arrays.add(4 * n, color));
    }
    for (name, _) in attributes.scalars {
        let scalar = json!({"componentType": FLOAT, "type": "SCALAR", "count": n});
        accessors.insert(format!("_{}", name.to_ascii_uppercase()), arrays.add(4 * n, scalar));
    }
    let n_indices = 3 * mesh.n_faces();
    let index = json!({"componentType": UNSIGNED_INT, "type": "SCALAR", "count": n_indices});
    let indices = arrays.add(4 * n_indices, index);
    let json = json!({
        "asset": {"version": "2.0", "generator": "SemFM"},
        "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [match node {
            None => json!({"mesh": 0}),
            Some(GlbNode { name, rotation }) => {
                json!({"mesh": 0, "name": name, "rotation": rotation})
            }
        }],
        "meshes": [{"primitives": [{"attributes": accessors, "indices": indices}]}],
        "accessors": arrays.accessors, "bufferViews": arrays.views,
        "buffers": [{"byteLength": arrays.n_bytes}],
    });
    write_glb(out, &json, arrays.n_bytes, |out| {
        write_blocks(out, mesh.vertices(), |block, p| {
            block.extend(p.as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()));
        })?;
        write_blocks(out, attributes.colors.unwrap_or_default(), |block, color| {
            block.extend(color);
        })?;
        for (_, values) in attributes.scalars {
            write_blocks(out, *values, |block, &x| block.extend((x as f32).to_le_bytes()))?;
        }
        write_blocks(out, mesh.faces().as_flattened(), |block, id| block.extend(id.to_le_bytes()))
    })
}

/// Writes a GLB: the JSON of a glTF whose one buffer is the `n_bytes` (a multiple of 4) that `fill` writes.
///
/// # Errors
/// Those of `out`; also where the whole would be larger than the 4 GiB that a GLB holds.
pub fn write_glb(
    out: &mut dyn Write,
    json: &Value,
    n_bytes: usize,
    fill: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> Result<()> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = word(12 + 8 + json.len() + 8 + n_bytes)?;
    for part in [&b"glTF"[..], &2u32.to_le_bytes(), &total.to_le_bytes()] {
        out.write_all(part)?;
    }
    out.write_all(&word(json.len())?.to_le_bytes())?;
    out.write_all(b"JSON")?;
    out.write_all(&json)?;
    out.write_all(&word(n_bytes)?.to_le_bytes())?;
    out.write_all(b"BIN\0")?;
    fill(out)
}

/// A length in a GLB.
fn word(n: usize) -> Result<u32> {
    u32::try_from(n).map_err(|_| Error::other("a GLB holds at most 4 GiB"))
}

/// Arrays one after the other in one buffer; all have elements of 4 bytes or a multiple.
#[derive(Default)]
struct Arrays {
    accessors: Vec<Value>,
    views: Vec<Value>,
    n_bytes: usize,
}

impl Arrays {
    /// Describes the next array and returns the number of its accessor.
    fn add(&mut self, n_bytes: usize, mut accessor: Value) -> Value {
        accessor["bufferView"] = self.views.len().into();
        self.views.push(json!({"buffer": 0, "byteOffset": self.n_bytes, "byteLength": n_bytes}));
        self.accessors.push(accessor);
        self.n_bytes += n_bytes;
        (self.accessors.len() - 1).into()
    }
}
